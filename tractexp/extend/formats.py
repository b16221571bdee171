"""Parts of export formats: their base, and the symbols of states before the event and of the halves of phasors.

The symbols are imported at their first use, with SymPy.
"""

from typing import TYPE_CHECKING, Any

from tractexp.exchange.format import Format

if TYPE_CHECKING:
    from tractexp.model.symbols import phasor_parts, start_symbol

__all__ = ["Format", "phasor_parts", "start_symbol"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'tractexp.extend.formats' has no attribute '{name}'")
    from tractexp.model import symbols

    return getattr(symbols, name)
