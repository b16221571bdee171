"""Records from COMTRADE fault recordings: the dips of one file, numbered in order of time."""

from tractexp.extend import Recording, WaveformReader, plugin
from tractexp.extend.files import comtrade, kind_of, locate_file


@plugin
class COMTRADE(WaveformReader):
    """Dips from three phase voltages and currents of a COMTRADE record (.cfg with its .dat, or
    .cff).

    Channels are counted from 0, or named. Secondary values are taken to the primary side. One-cycle
    phasors at the tracked frequency, stamped at the window's center, about one per millisecond, no
    window across two sampling rates; V1, I1 positive, V2 negative sequence: U = |V1|, U2 = |V2|, P
    + jQ = 3 V1 conj(I1), consumed positive. f is the speed at which V1 turns, so a jump of its
    angle shows as a short peak. One base for the whole file, from the steady state before the first
    dip: its line-to-line voltage and its apparent power. Dips are numbered from 1; the first is
    fitted and the others validate unless said otherwise.

    Source: IEEE C37.111-1991, -1999 and -2013 (files); IEEE C37.118.1-2011 (centered phasors);
    Fortescue 1918.
    Departures: the time skew of channels is corrected on request only.
    """

    endings = parts = (".cfg", ".cff", ".dat")

    @classmethod
    def takes(cls, path: str, *join: str) -> bool:
        return kind_of(path) == "waves"

    # of the .cfg; null: found from its letters among utf-8, gbk, cp1251 and latin-1
    encoding: str | None = None

    def recording(self) -> Recording:
        return comtrade.load(locate_file(self.path), self.encoding)
