"""What `declare`, `law` and `edit` take and return, for annotations and for formats. SymPy is
imported with it.
"""

from sympy import Expr, Symbol

from tractexp.model.equations import Equations
from tractexp.model.symbols import phasor_parts, start_symbol

__all__ = ["Equations", "Expr", "Symbol", "phasor_parts", "start_symbol"]
