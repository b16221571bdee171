"""What stands before an event, as names and texts of arithmetic (`arithmetic.evaluated`)."""

from sympy import Symbol
from sympy.printing.pycode import PythonCodePrinter

from tractexp.model.arithmetic import VALUES
from tractexp.model.equations import Equations, phasor_parts, start_symbol


class _Printer(PythonCodePrinter):
    """Python that takes its numbers by name, so that no name is taken for another thing."""

    def _print_Symbol(self, expr: Symbol) -> str:
        return f"{VALUES}[{expr.name!r}]"


def starts(eq: Equations) -> list[str]:
    """Names of the states and memories before the event, as the kernel lists them: phasors by their parts."""
    symbols = [start_symbol(symbol) for symbol in (*eq.states, *eq.memories)]
    return [part.name for s in symbols for part in ((s,) if s.is_real else phasor_parts(s))]


def stated(eq: Equations) -> dict[str, str]:
    """{quantity: text of its value before the event, of what stands above it}; phasors are left out."""
    printer, texts = _Printer({"strict": True}), dict[str, str]()
    for symbol in eq.definitions:
        value, imaginary = eq.parts(eq.before(symbol))
        if imaginary == 0:
            texts[symbol.name] = str(printer.doprint(value))
    return texts
