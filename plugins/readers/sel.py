"""Records from SEL relays: the dips of one compressed event report."""

from pathlib import Path

from tractexp.extend import Recording, WaveformReader, plugin
from tractexp.extend.files import cev, kind_of


@plugin
class SEL(WaveformReader):
    """Dips from an SEL relay's compressed event report (.cev, command CEV R).

    The report's columns, instantaneous primary values over the root of two, are taken back to
    instantaneous ones; they are sampled by the frequency in its column FREQ. A filtered report (4
    or 8 samples per cycle) holds phasors, which are a table, `data=csv`.

    Source: SEL instruction manuals, appendix Compressed ASCII and section event reports.
    Departures: the scale is checked against the currents of the report's summary; reports as text
    for people (.eve) are not read.
    """

    endings = parts = (".cev",)

    encoding: str | None = None  # of the file; null: found from its letters

    @classmethod
    def takes(cls, path: str, *join: str) -> bool:
        return kind_of(path) == "waves"

    def recording(self) -> Recording:
        return cev.load(Path(self.path), self.encoding)
