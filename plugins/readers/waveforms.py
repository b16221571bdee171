"""Records from tables of waveforms: the dips of one file, numbered in order of time."""

from tractexp.extend import Recording, WaveformReader, check_range, plugin
from tractexp.extend.files import (
    ENDINGS,
    QUANTITIES,
    SIZES,
    Tabular,
    kind_of,
    read_sidecar,
    recording,
    restore_recording,
)


@plugin
class Waveforms(Tabular, WaveformReader):
    """Dips from a table of sampled voltages and currents: CSV and other text, Parquet, Excel.

    Columns such as t, ua, ub, uc, ia, ib, ic, or t, u, i of a single-phase feeder; every further
    column of numbers is a channel too. Names, units, delimiter, decimal mark and encoding are found
    and said in a note, or given (`columns`, `units`, ...). A gap in time parts the file: no window
    reaches across it. A table that `task=convert` wrote of a recording is that recording again,
    ratios and all.

    Source: RFC 4180; the names ua, ub, uc, ia, ib, ic are those of IEC 61869 in small letters.
    Departures: any delimiter, title lines, unit rows.
    """

    quantities = QUANTITIES
    endings = ENDINGS

    frequency: float = 50.0  # Hz, nominal

    @classmethod
    def takes(cls, path: str, *join: str) -> bool:
        return kind_of(path, *join) == "waves"

    def check(self) -> None:
        super().check()
        check_range("data.frequency", self.frequency, *SIZES["frequency"])
        self.check_table()

    def join_files(self) -> Recording:
        return self.recording()  # the columns of all files are those of one table

    def recording(self) -> Recording:
        sidecar = read_sidecar(self.path)
        if sidecar.recording is not None and not self.join:
            return restore_recording(self.path, sidecar.recording)
        return recording(*self.table_of(self.path, sidecar, self.join), self.frequency)
