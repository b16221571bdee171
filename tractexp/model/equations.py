"""A load model's equations, declared once as symbols.

Motor, static and effect plugins write into one `Equations`: parameters, named quantities, states with their
derivatives and steady state, and the power they draw. Kernel, steady state, parameter table and LaTeX are
derived from it. A named quantity can be edited after it was declared: that is what a missing effect does.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import sympy
from sympy import I, Symbol, conjugate, im, re

from tractexp.model.drive import EVENT, INPUTS
from tractexp.parameter import Parameter

LONG = 300  # nodes of an expression
LONG_AGO = -(10**6)  # s: the time at which a load rests before the event


@dataclass
class State:
    """A continuous state: d(symbol)/dt = derivative, and its value in the steady state before the event.

    `balance` is what vanishes in that steady state, where it is not the derivative.
    """

    symbol: Symbol
    latex: str
    derivative: sympy.Expr | None = None
    initial: sympy.Expr | None = None
    balance: sympy.Expr | None = None


@dataclass(frozen=True)
class Requirement:
    """`slack` >= 0 is needed for a steady state; `sentence` says what is violated, `shown` is printed in it."""

    slack: sympy.Expr
    sentence: str
    shown: sympy.Expr


@dataclass
class Memory:
    """A discrete memory, such as a relay: renewed once a sample, before the power of that sample is read."""

    symbol: Symbol
    latex: str
    renewal: sympy.Expr | None = None
    initial: sympy.Expr | None = None


class Equations:
    """The declaration of one composite load, Eq. (7) of Wu et al. 2022.

    Symbols given, all per unit of the record's base except angular speeds [rad/s], which are relative to the
    nominal synchronous speed `omega_n`:

    - inputs, recorded: `U` voltage, `omega_s` synchronous speed (0 where the frequency is not recorded), `U2`
      negative-sequence voltage; and `U_rate`, the slope of U [pu/s], `t`, the time since the first sample [s];
    - before the event: `U0`, `omega_s0`, `U20`, `P0`, `Q0`;
    - `omega_n`, the nominal synchronous speed; `step`, the time between samples [s];
    - `P_s0`, `Q_s0`, what all other parts leave to the static load before the event.

    A phasor state is one complex symbol; its real and imaginary part become two real states of the kernel.
    `settled` says whether the states' `initial` values are exact; where an effect has edited the equations they
    are only a first guess, and the kernel solves for the steady state.
    """

    def __init__(self) -> None:
        self.U, self.omega_s, self.U_rate, self.U2, self.t = map(_real, INPUTS)
        self.U0, self.omega_s0, self.U20, self.omega_n, self.step = map(_real, EVENT)
        self.P0, self.Q0 = _real("P0"), _real("Q0")
        self.P_s0, self.Q_s0 = _real("P_s0"), _real("Q_s0")
        self.settled = True
        self.parameters: dict[str, Parameter] = {}
        self.definitions: dict[Symbol, sympy.Expr] = {}
        self.steps: dict[Symbol, sympy.Expr] = {}
        self.known_before: dict[Symbol, sympy.Expr] = {}
        self.shown: dict[Symbol, sympy.Expr] = {}
        self.states: dict[Symbol, State] = {}
        self.memories: dict[Symbol, Memory] = {}
        self.requirements: list[Requirement] = []
        self.latex_names: dict[Symbol, str] = {
            self.omega_s: r"\omega_s", self.U0: "U_0", self.omega_s0: r"\omega_{s0}",
            self.P0: "P_0", self.Q0: "Q_0", self.omega_n: r"\omega_n", self.U2: "U_2", self.U20: "U_{20}",
            self.P_s0: "P_{s0}", self.Q_s0: "Q_{s0}", self.U_rate: r"\dot U", self.step: r"\Delta t",
        }  # fmt: skip
        self.P: sympy.Expr = sympy.Integer(0)
        self.Q: sympy.Expr = sympy.Integer(0)

    def declare(self, parameters: Iterable[Parameter]) -> list[Symbol]:
        """The symbols of a plugin's parameters, in their order."""
        symbols = []
        for parameter in parameters:
            if parameter.name in self.parameters:
                raise ValueError(f"two plugins of this model declare a parameter '{parameter.name}'")
            self.parameters[parameter.name] = parameter
            symbol = _real(parameter.name)
            self.latex_names[symbol] = parameter.symbol
            symbols.append(symbol)
        return symbols

    def define(self, name: str, expression: sympy.Expr, latex: str, phasor: bool = False) -> Symbol:
        """Name a quantity (real or complex), so that later expressions use it and effects can edit it.

        `phasor` makes one complex that is real as it stands, so that an effect may turn it.
        """
        expression = sympy.sympify(expression)
        symbol = Symbol(name, complex=True) if phasor or not _is_real(expression) else _real(name)
        self.latex_names[symbol] = latex
        self.definitions[symbol] = expression
        return symbol

    def compute(self, name: str, expression: sympy.Expr, before: sympy.Expr | None = None) -> Symbol:
        """A real quantity that is computed once and then referred to, such as a step of an unrolled iteration.

        `before` is its value before the event, needed where the steady state or the static load's share depends on
        it: there the iteration has converged.
        """
        symbol = _real(name)
        self.steps[symbol] = sympy.sympify(expression)
        if before is not None:
            self.known_before[symbol] = self.real(self.before(before))
        self.latex_names[symbol] = name
        return symbol

    def has(self, name: str) -> bool:
        """Whether this model has a quantity, state or parameter called `name`."""
        return any(s.name == name for s in self._symbols())

    def symbol(self, name: str) -> Symbol:
        """The quantity, state or parameter called `name`; KeyError where this model has none."""
        for symbol in self._symbols():
            if symbol.name == name:
                return symbol
        raise KeyError(name)

    def _symbols(self) -> list[Symbol]:
        return [*self.definitions, *self.states, *self.memories, *map(_real, self.parameters)]

    def edit(self, name: str, change: Callable[[sympy.Expr], sympy.Expr], shown: sympy.Expr | None = None) -> None:
        """Replace the expression behind a named quantity by `change` of it: what a missing effect does.

        The quantity keeps its name, so effects stack in any order. A quantity that was real must stay real. `shown`
        is what LaTeX prints where the change is the solution of an equation.
        """
        symbol = self.symbol(name)
        if shown is not None:
            self.shown[symbol] = shown
        self.definitions[symbol] = sympy.sympify(change(self.definitions[symbol]))
        self.settled = False

    def state(self, name: str, latex: str) -> Symbol:
        """A real state."""
        return self._state(_real(name), latex)

    def phasor(self, name: str, latex: str) -> Symbol:
        """A complex state in the synchronous frame of the terminal voltage."""
        return self._state(Symbol(name, complex=True), latex)

    def _state(self, symbol: Symbol, latex: str) -> Symbol:
        self.states[symbol] = State(symbol, latex)
        self.latex_names[symbol] = latex
        return symbol

    def moves(
        self, state: Symbol, derivative: sympy.Expr, initial: sympy.Expr, balance: sympy.Expr | None = None
    ) -> None:
        """Give a state its time derivative and its steady state before the event.

        `balance` vanishes there where the derivative does not tell it: for a state that stays where it was.
        """
        moved = self.states[state]
        moved.derivative, moved.initial = sympy.sympify(derivative), sympy.sympify(initial)
        moved.balance = None if balance is None else sympy.sympify(balance)

    def memory(self, name: str, latex: str) -> Symbol:
        """A discrete memory (real)."""
        symbol = _real(name)
        self.memories[symbol] = Memory(symbol, latex)
        self.latex_names[symbol] = latex
        return symbol

    def renews(self, memory: Symbol, renewal: sympy.Expr, initial: sympy.Expr) -> None:
        """Give a memory its value at a sample, from itself, inputs and states there, and its value before."""
        self.memories[memory].renewal = sympy.sympify(renewal)
        self.memories[memory].initial = sympy.sympify(initial)

    def require(self, slack: sympy.Expr, sentence: str, shown: sympy.Expr) -> None:
        """A steady state exists only where `slack` >= 0. `{value}` in the sentence prints `shown`."""
        self.requirements.append(Requirement(sympy.sympify(slack), sentence, sympy.sympify(shown)))

    def consume(self, P: sympy.Expr, Q: sympy.Expr) -> None:
        """Add a part that draws P and Q (positive when consumed); before the event the static load gives way."""
        self.P, self.Q = self.P + P, self.Q + Q

    def close(self) -> None:
        """Give the static load what the other parts leave before the event. Called once all parts have declared."""
        without_static = {self.P_s0: sympy.Integer(0), self.Q_s0: sympy.Integer(0)}
        others = [self.real(self.before(self.expand(power).xreplace(without_static))) for power in (self.P, self.Q)]
        self.definitions[self.P_s0] = self.P0 - others[0]
        self.definitions[self.Q_s0] = self.Q0 - others[1]

    def before(self, expression: sympy.Expr) -> sympy.Expr:
        """An expression's value in the steady state before the event, as an expression of constants."""
        at_start = {symbol: start_symbol(symbol) for symbol in (*self.states, *self.memories)}
        for symbol, start in list(at_start.items()):
            if not symbol.is_real:
                at_start |= zip(phasor_parts(symbol), phasor_parts(start), strict=True)
        return self.expand(expression).xreplace(self.at_rest() | at_start)

    def at_rest(self) -> dict[Symbol, sympy.Expr]:
        """The values before the event of inputs and computed quantities."""
        still = {self.U_rate: sympy.Integer(0), self.t: sympy.Integer(LONG_AGO)}
        return {self.U: self.U0, self.omega_s: self.omega_s0, self.U2: self.U20} | still | self.known_before

    def expand(self, expression: sympy.Expr, named: Callable[[Symbol], bool] = lambda _: True) -> sympy.Expr:
        """The expression with the quantities that are `named` (by default all) replaced by what they stand for."""
        expression = sympy.sympify(expression)
        while found := {s for s in expression.free_symbols & self.definitions.keys() if named(s)}:
            expression = expression.xreplace({s: self.definitions[s] for s in found})
        return expression

    def real_states(self) -> list[tuple[Symbol, sympy.Expr, sympy.Expr]]:
        """(symbol, derivative, initial) of each real state, phasors split in two, names expanded."""
        rows = []
        for state in self.states.values():
            own = (state.symbol,) if state.symbol.is_real else phasor_parts(state.symbol)
            rows.extend(zip(own, self.parts(state.derivative), self.parts(state.initial), strict=False))
        return rows

    def real_balances(self) -> list[sympy.Expr]:
        """What vanishes in the steady state before the event, one for each real state."""
        rows: list[sympy.Expr] = []
        for state in self.states.values():
            balance = self.parts(state.derivative if state.balance is None else state.balance)
            rows.extend(balance[:1] if state.symbol.is_real else balance)
        return rows

    def parts(self, expression: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
        """Real and imaginary part in real symbols, names expanded.

        A name that stands for something real is lowered by itself and put in last: products are not expanded
        across it, so that it stays one common subexpression.
        """
        split: dict[Symbol, sympy.Expr] = {}
        for state in self.states:
            if not state.is_real:
                a, b = phasor_parts(state)
                a0, b0 = phasor_parts(start_symbol(state))
                split |= {state: a + I * b, start_symbol(state): a0 + I * b0}
        lowered = self.expand(expression, lambda s: not s.is_real).xreplace(split)
        if _is_real(lowered):
            both = (lowered if lowered.is_real else _shorter(lowered), sympy.Integer(0))
        else:
            both = map(_shorter, lowered.as_real_imag())
        real, imaginary = (e.xreplace({s: self.real(s) for s in self._names(e)}) for e in both)
        return real, imaginary

    def _names(self, expression: sympy.Expr) -> set[Symbol]:
        return expression.free_symbols & self.definitions.keys()

    def real(self, expression: sympy.Expr) -> sympy.Expr:
        """The real part of an expression that is meant to be real."""
        named = self.definitions.get(expression)
        return self.parts(expression if named is None else named)[0]

    def latex(self) -> list[str]:
        """The equations one a line: states, memories, named quantities, power, steady state."""
        starts = {start_symbol(s): f"{{{self.latex_names[s]}}}|_0" for s in (*self.states, *self.memories)}
        names = self.latex_names | starts
        for s in self.states:
            halves = phasor_parts(start_symbol(s))
            names |= zip(
                halves, (rf"\operatorname{{{part}}} {starts[start_symbol(s)]}" for part in ("Re", "Im")), strict=True
            )
        tex = lambda e: sympy.latex(e, symbol_names=names, imaginary_unit="j", mul_symbol=r" \, ")  # noqa: E731
        lines = [rf"\frac{{d {s.latex}}}{{dt}} = {tex(s.derivative)}" for s in self.states.values()]
        lines += [rf"{m.latex} \leftarrow {tex(m.renewal)}" for m in self.memories.values()]
        lines += [f"{tex(s)} = {tex(self.shown.get(s, expression))}" for s, expression in self.definitions.items()]
        lines += [f"P = {tex(self.P)}", f"Q = {tex(self.Q)}"]
        return lines + [f"{starts[start_symbol(s.symbol)]} = {tex(s.initial)}" for s in self.states.values()]


def _shorter(expression: sympy.Expr) -> sympy.Expr:
    """The expression or its expansion, whichever has fewer operations: products of phasors cancel when expanded.

    Long ones stay as they are: they gain nothing, and expanding them takes seconds.
    """
    if sum(1 for _ in sympy.preorder_traversal(expression)) > LONG:
        return expression
    return min(expression, sympy.expand(expression), key=sympy.count_ops)


def _is_real(expression: sympy.Expr) -> bool:
    """Whether an expression is real wherever it is finite."""
    return bool(expression.is_real) or not (expression.has(I) or any(not s.is_real for s in expression.free_symbols))


def _real(name: str) -> Symbol:
    return Symbol(name, real=True)


def start_symbol(state: Symbol) -> Symbol:
    """The symbol of a state's value before the event."""
    return Symbol(f"{state.name}_before", **({"real": True} if state.is_real else {"complex": True}))


def phasor_parts(state: Symbol) -> tuple[Symbol, Symbol]:
    """The two real symbols behind a phasor."""
    return _real(f"{state.name}_re"), _real(f"{state.name}_im")


__all__ = [
    "Equations", "I", "Memory", "Requirement", "State",
    "conjugate", "im", "phasor_parts", "re", "start_symbol", "sympy",
]  # fmt: skip
