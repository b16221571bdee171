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

BEFORE_EVENT = "|_0"  # ends the LaTeX of a value before the event


def print_lines(eq: "Equations") -> list[str]:
    """The equations one a line: states, memories, named quantities, what is drawn, steady state."""
    moving = (*eq.states, *eq.memories)
    starts = {start_symbol(s): f"{{{eq.latex_names[s]}}}{BEFORE_EVENT}" for s in moving}
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
    """(line before, line after) of each equation that changed; None before one that is new.

    Equations are matched by their left side. Values before the event are left out: they follow from
    the others.
    """
    old = {line.partition("=")[0]: line for line in before}
    changed = [line for line in after if line not in before and BEFORE_EVENT not in line]
    return [(old.get(line.partition("=")[0]), line) for line in changed]


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
