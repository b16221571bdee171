"""Parquet with a sidecar."""

from tractexp.extend import plugin

from ._table import _Table


@plugin
class Parquet(_Table):
    """A tidy Parquet table, numbers as they are, and a sidecar in JSON: units, base, channels,
    notes.

    Source: Apache Parquet format 2.6.
    Departures: none.
    """

    endings = (".parquet", ".json")
    usual = True
