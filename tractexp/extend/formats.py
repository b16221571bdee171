"""Parts of export formats: their base, and the symbols of states before the event and of the halves of phasors."""

from tractexp.exchange.format import Format
from tractexp.model.symbols import phasor_parts, start_symbol

__all__ = ["Format", "phasor_parts", "start_symbol"]
