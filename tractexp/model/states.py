"""What equations hold beside named quantities: states, memories, and what a steady
state requires.
"""

from dataclasses import dataclass
from typing import Literal

import sympy

from tractexp.kernel.graph import Symbol

UNSAID = Symbol("unsaid")  # where nothing has told yet how a state moves or what a memory becomes


@dataclass
class State:
    """A continuous state: d(symbol)/dt = derivative, and its value in the steady state before the
    event.

    `role` says what it is, `writer` which part declared it (`motor`, or an effect's name).
    `balance` is what vanishes in that steady state, where it is not the derivative.
    """

    symbol: Symbol
    latex: str
    role: Literal["flux", "speed", "lag"]
    writer: str
    derivative: sympy.Expr = UNSAID
    initial: sympy.Expr = UNSAID
    balance: sympy.Expr | None = None
    # `initial` is written in what moves, and taken before the event once all parts have declared
    derived: bool = False


@dataclass(frozen=True)
class Requirement:
    """`slack` >= 0 is needed for a steady state; `sentence` says what is violated, `shown` is
    printed in it.
    """

    slack: sympy.Expr
    sentence: str
    shown: sympy.Expr


@dataclass
class Memory:
    """A discrete memory, such as a relay: renewed once a sample, before the power of that sample is
    read.
    """

    symbol: Symbol
    latex: str
    renewal: sympy.Expr = UNSAID
    initial: sympy.Expr = UNSAID
