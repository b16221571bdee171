"""Lowered equations for people to read."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import sympy

    from tractexp.kernel.lowered import Lowered, Phase

MOST_PRINTED_NODES = 500  # nodes of an expression: no one reads more


def list_equations(lowered: "Lowered") -> Iterator[str]:
    """The equations as they were lowered, a line each, by when they are computed."""
    yield from _list_phase("before the event", [f"{s}" for s in lowered.starts], lowered.start)
    if lowered.rest is not None:
        yield from _list_phase(
            "zero before the event", [f"balance {s}" for s in lowered.states], lowered.rest
        )
    yield from _list_phase("over an event", [f"{s}" for s in lowered.constants], lowered.constant)
    yield from _list_phase(
        "in each stage of a step", [f"d {s}/dt" for s in lowered.states], lowered.derivative
    )
    yield from _list_phase(
        "at each sample, memories", [f"{s}" for s in lowered.memories], lowered.renewal
    )
    yield from _list_phase("at each sample", list(lowered.outputs), lowered.output)


def _list_phase(when: str, names: Sequence[str], phase: "Phase") -> Iterator[str]:
    """The lines of one phase: what is computed there, by name."""
    if not phase.expressions:
        return
    yield f"{when}:"
    yield from (f"  {s} = {_print_expression(e)}" for s, e in (*phase.signals, *phase.steps))
    slacks = (f"slack {k}" for k in range(1, len(phase.expressions) - len(names) + 1))
    yield from (
        f"  {name} = {_print_expression(e)}"
        for name, e in zip((*names, *slacks), phase.expressions, strict=True)
    )


def _print_expression(expression: "sympy.Expr") -> str:
    """An expression as text, or how many terms it has where that would be long."""
    nodes, waiting = 0, [expression]
    while waiting and nodes <= MOST_PRINTED_NODES:  # a small graph may be a tree of millions
        nodes += 1
        waiting += waiting.pop().args  # type: ignore[arg-type]
    return str(expression) if nodes <= MOST_PRINTED_NODES else f"({nodes} terms and more)"
