"""What a kernel is made of: lowered equations, in real arithmetic, by when they must
be computed.
"""

from dataclasses import dataclass

import sympy

from tractexp.kernel.graph import Symbol, collect_symbols

Assignments = tuple[tuple[Symbol, sympy.Expr], ...]


@dataclass(frozen=True)
class Phase:
    """One group of expressions evaluated together, with the signals and the steps they need."""

    signals: Assignments
    steps: Assignments  # quantities computed once and then referred to, in order
    expressions: tuple[sympy.Expr, ...]


@dataclass(frozen=True)
class Lowered:
    """Everything the emitter writes, in real arithmetic."""

    parameters: tuple[Symbol, ...]
    inputs: tuple[Symbol, ...]  # sampled; those of `layout.INPUTS` that the equations use
    event: tuple[Symbol, ...]  # one number per event
    states: tuple[Symbol, ...]
    memories: tuple[Symbol, ...]
    starts: tuple[Symbol, ...]  # states and memories before the event
    start: Phase  # states and memories before the event, then the slack of each requirement
    # what vanishes before the event, where the start is only a guess: always with an effect
    rest: Phase | None
    constants: tuple[Symbol, ...]
    constant: Phase  # their values, which hold for a whole event
    derivative: Phase
    renewal: Phase
    output: Phase
    outputs: tuple[str, ...]  # what its expressions are called


def collect_phase_symbols(phase: Phase) -> set[Symbol]:
    """All symbols a phase reads or makes."""
    parts = (*phase.expressions, *(e for _, e in (*phase.steps, *phase.signals)))
    return set[Symbol]().union(*map(collect_symbols, parts))
