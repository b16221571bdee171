"""The base of export formats."""

from tractexp.exchange.format import Format

__all__ = ["Format"]
