"""Records from PQDIF files: the dips of the waveforms of one file."""

from pathlib import Path

from tractexp.extend import Recording, WaveformReader, plugin
from tractexp.extend.files import kind_of, pqdif


@plugin
class PQDIF(WaveformReader):
    """Dips from the waveforms of a PQDIF file (.pqd), as power quality analyzers write it.

    Values are in V and A of the primary side, where the monitor's settings say that its transformer
    ratios are to be applied, after them. Each observation of the channels that most observations
    have is a stretch of its own. Logs of RMS values, P and Q are a table, `data=csv`.

    Source: IEEE Std 1159.3-2003 and -2019.
    Departures: histograms, spectra and flicker are not read, nor PKZIP and the compression of the
    whole file.
    """

    endings = parts = (".pqd", ".pqdif")

    encoding: str | None = None  # of its texts; null: found from their letters

    @classmethod
    def takes(cls, path: str, *join: str) -> bool:
        return kind_of(path) == "waves"

    def recording(self) -> Recording:
        return pqdif.load(Path(self.path), self.encoding)
