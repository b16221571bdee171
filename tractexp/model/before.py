"""What stands before an event, as texts of arithmetic (`arithmetic.evaluated`)."""

from sympy import Symbol
from sympy.printing.pycode import PythonCodePrinter

from tractexp.model.arithmetic import VALUES
from tractexp.model.equations import Equations


class _Printer(PythonCodePrinter):
    """Python that takes its numbers by name, so that no name is taken for another thing."""

    def _print_Symbol(self, expr: Symbol) -> str:
        return f"{VALUES}[{expr.name!r}]"


def stated(eq: Equations) -> dict[str, str]:
    """{quantity: text of its value before the event, of what stands above it}; phasors are left out."""
    printer, texts = _Printer({"strict": True}), dict[str, str]()
    for symbol in eq.definitions:
        value, imaginary = eq.parts(eq.before(symbol))
        if imaginary == 0:
            texts[symbol.name] = str(printer.doprint(value))
    return texts
