"""COMTRADE in two files."""

from tractexp.extend import plugin

from ._comtrade import _COMTRADE


@plugin
class COMTRADEWriter(_COMTRADE):
    """COMTRADE, .cfg and .dat: the raw values of the source where they are integers, else numbers
    in full as text.

    Source: IEEE C37.111-2013.
    Departures: none.
    """

    endings = (".cfg", ".dat")
