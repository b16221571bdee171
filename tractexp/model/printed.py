"""Equations in LaTeX, and quantities before the event as texts of arithmetic
(`arithmetic.evaluated`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import sympy
from sympy.printing.pycode import PythonCodePrinter

from tractexp.model.arithmetic import VALUES
from tractexp.model.symbols import phasor_parts, start_symbol

if TYPE_CHECKING:
    from tractexp.model.equations import Equations


def lines(eq: "Equations") -> list[str]:
    """The equations one a line: states, memories, named quantities, what is drawn, steady state."""
    starts = {start_symbol(s): f"{{{eq.latex_names[s]}}}|_0" for s in (*eq.states, *eq.memories)}
    names = eq.latex_names | starts
    for s in eq.states:
        halves = phasor_parts(start_symbol(s))
        names |= zip(
            halves,
            (rf"\operatorname{{{part}}} {starts[start_symbol(s)]}" for part in ("Re", "Im")),
            strict=True,
        )
    tex = lambda e: sympy.latex(e, symbol_names=names, imaginary_unit="j", mul_symbol=r" \, ")  # noqa: E731
    equations = [rf"\frac{{d {s.latex}}}{{dt}} = {tex(s.derivative)}" for s in eq.states.values()]
    equations += [rf"{m.latex} \leftarrow {tex(m.renewal)}" for m in eq.memories.values()]
    equations += [
        f"{tex(s)} = {tex(eq.shown.get(s, expression))}" for s, expression in eq.definitions.items()
    ]
    equations += [f"{site.latex} = {tex(drawn)}" for site, drawn in eq._drawn.items()]
    return equations + [
        f"{starts[start_symbol(s.symbol)]} = {tex(s.initial)}" for s in eq.states.values()
    ]


def list_changed_lines(before: Sequence[str], after: Sequence[str]) -> list[tuple[str | None, str]]:
    """(line before, line after) of equations that are not as they were; None before one that came
    in.

    What holds before the event is left out: it follows from the others.
    """
    old = {line.split("=")[0]: line for line in before}
    return [
        (old.get(line.split("=")[0]), line)
        for line in after
        if line not in before and "|_0" not in line
    ]


class _Printer(PythonCodePrinter):
    """Python that takes its numbers by name, so that no name is taken for another thing."""

    def _print_Symbol(self, expr: sympy.Symbol) -> str:
        """A symbol as a look-up of its value."""
        return f"{VALUES}[{expr.name!r}]"


def list_stated_quantities(eq: "Equations") -> dict[str, str]:
    """{quantity: text of its value before the event, of what stands above it}; phasors are left
    out.
    """
    printer, texts = _Printer({"strict": True}), dict[str, str]()
    for symbol in eq.definitions:
        value, imaginary = eq.parts(eq.evaluate_before(symbol))
        if imaginary == 0:
            texts[symbol.name] = str(printer.doprint(value))
    return texts
