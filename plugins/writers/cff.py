"""COMTRADE in one file."""

from tractexp.extend import plugin

from ._comtrade import _COMTRADE


@plugin
class CFF(_COMTRADE):
    """COMTRADE in one file, .cff: the raw values of the source where they are integers, else
    numbers in full as text.

    Source: IEEE C37.111-2013, section 9.
    Departures: none.
    """

    endings = (".cff",)
