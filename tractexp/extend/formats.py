"""The base of export formats, and how each language quotes a text."""

from tractexp import quoting
from tractexp.exchange.format import Format

__all__ = ["Format", "quoting"]
