"""CSV with a sidecar."""

from tractexp.extend import plugin

from ._table import _Table


@plugin
class CSVWriter(_Table):
    """A tidy CSV table, every number with the digits that give it back, and a sidecar in JSON:
    units, base, channels.

    Source: RFC 4180.
    Departures: lines end in a line feed alone.
    """

    endings = (".csv", ".json")
