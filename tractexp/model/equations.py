"""A load model's equations, declared once as symbols.

Motor, static and effect plugins write into one `Equations`: parameters, named quantities, states with their
derivatives and steady state, and the power they draw. Kernel, steady state, parameter table and LaTeX are
derived from it. A named quantity can be edited after it was declared: that is what a missing effect does.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import sympy
from sympy import I, Symbol, im, re

from tractexp.parameter import Parameter


@dataclass
class State:
    """A continuous state: d(symbol)/dt = derivative, and its value in the steady state before the event."""

    symbol: Symbol
    latex: str
    derivative: sympy.Expr | None = None
    initial: sympy.Expr | None = None


@dataclass(frozen=True)
class Requirement:
    """`slack` >= 0 is needed for a steady state; `sentence` says what is violated, `shown` is printed in it."""

    slack: sympy.Expr
    sentence: str
    shown: sympy.Expr


class Equations:
    """The declaration of one composite load, Eq. (7) of Wu et al. 2022.

    Symbols given, all per unit of the record's base except angular speeds [rad/s], which are relative to the
    nominal synchronous speed `omega_n`:

    - inputs, recorded: `U` voltage, `omega_s` synchronous speed (0 where the frequency is not recorded);
    - before the event: `U0`, `omega_s0`, `P0`, `Q0`;
    - `omega_n`, the nominal synchronous speed.

    A phasor state is one complex symbol; its real and imaginary part become two real states of the kernel.
    """

    def __init__(self) -> None:
        self.U, self.omega_s = _real("U"), _real("omega_s")
        self.U0, self.omega_s0 = _real("U0"), _real("omega_s0")
        self.P0, self.Q0 = _real("P0"), _real("Q0")
        self.omega_n = _real("omega_n")
        self.parameters: dict[str, Parameter] = {}
        self.definitions: dict[Symbol, sympy.Expr] = {}
        self.states: dict[Symbol, State] = {}
        self.requirements: list[Requirement] = []
        self.latex_names: dict[Symbol, str] = {
            self.omega_s: r"\omega_s", self.U0: "U_0", self.omega_s0: r"\omega_{s0}",
            self.P0: "P_0", self.Q0: "Q_0", self.omega_n: r"\omega_n",
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

    def define(self, name: str, expression: sympy.Expr, latex: str) -> Symbol:
        """Name a quantity (real or complex), so that later expressions use it and effects can edit it."""
        expression = sympy.sympify(expression)
        symbol = Symbol(name, real=True) if expression.is_real else Symbol(name, complex=True)
        self.latex_names[symbol] = latex
        self.definitions[symbol] = expression
        return symbol

    def symbol(self, name: str) -> Symbol:
        """The defined quantity or state called `name`; KeyError where this model has none."""
        return next(s for s in (*self.definitions, *self.states) if s.name == name)

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

    def moves(self, state: Symbol, derivative: sympy.Expr, initial: sympy.Expr) -> None:
        """Give a state its time derivative and its steady state before the event."""
        self.states[state].derivative = sympy.sympify(derivative)
        self.states[state].initial = sympy.sympify(initial)

    def require(self, slack: sympy.Expr, sentence: str, shown: sympy.Expr) -> None:
        """A steady state exists only where `slack` >= 0. `{value}` in the sentence prints `shown`."""
        self.requirements.append(Requirement(sympy.sympify(slack), sentence, sympy.sympify(shown)))

    def consume(self, P: sympy.Expr, Q: sympy.Expr) -> None:
        """Add power to what the load draws, P and Q positive when consumed."""
        self.P, self.Q = self.P + P, self.Q + Q

    def before(self, expression: sympy.Expr) -> sympy.Expr:
        """An expression's value in the steady state before the event, as an expression of constants."""
        at_start = {self.U: self.U0, self.omega_s: self.omega_s0}
        at_start |= {state: start_symbol(state) for state in self.states}
        return self.expand(expression).xreplace(at_start)

    def expand(self, expression: sympy.Expr) -> sympy.Expr:
        """The expression with every named quantity replaced by what it stands for."""
        expression = sympy.sympify(expression)
        while named := expression.free_symbols & self.definitions.keys():
            expression = expression.xreplace({s: self.definitions[s] for s in named})
        return expression

    def real_states(self) -> list[tuple[Symbol, sympy.Expr, sympy.Expr]]:
        """(symbol, derivative, initial) of each real state, phasors split in two, names expanded."""
        rows = []
        for state in self.states.values():
            derivative, initial = self.expand(state.derivative), self.expand(state.initial)
            if state.symbol.is_real:
                rows.append((state.symbol, self.real(derivative), self.real(initial)))
                continue
            parts = zip(phasor_parts(state.symbol), self.parts(derivative), self.parts(initial), strict=True)
            rows.extend(parts)
        return rows

    def parts(self, expression: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
        """Real and imaginary part, with phasor symbols replaced by their real parts."""
        split = {}
        for state in self.states:
            if not state.is_real:
                a, b = phasor_parts(state)
                a0, b0 = phasor_parts(start_symbol(state))
                split |= {state: a + I * b, start_symbol(state): a0 + I * b0}
        lowered = expression.xreplace(split)
        return (lowered, sympy.Integer(0)) if lowered.is_real else lowered.as_real_imag()

    def real(self, expression: sympy.Expr) -> sympy.Expr:
        """The real part of an expression that is meant to be real."""
        return self.parts(expression)[0]

    def latex(self) -> list[str]:
        """The equations one a line: states, named quantities, power, steady state."""
        show = {"symbol_names": self.latex_names, "imaginary_unit": "j", "mul_symbol": r" \, "}
        tex = lambda e: sympy.latex(e, **show)  # noqa: E731
        lines = [rf"\frac{{d {s.latex}}}{{dt}} = {tex(s.derivative)}" for s in self.states.values()]
        lines += [f"{tex(symbol)} = {tex(expression)}" for symbol, expression in self.definitions.items()]
        lines += [f"P = {tex(self.P)}", f"Q = {tex(self.Q)}"]
        starts = {start_symbol(s.symbol): f"{{{s.latex}}}|_0" for s in self.states.values()}
        show["symbol_names"] = self.latex_names | starts
        return lines + [f"{starts[start_symbol(s.symbol)]} = {tex(s.initial)}" for s in self.states.values()]


def _real(name: str) -> Symbol:
    return Symbol(name, real=True)


def start_symbol(state: Symbol) -> Symbol:
    """The symbol of a state's value before the event."""
    return Symbol(f"{state.name}_before", **({"real": True} if state.is_real else {"complex": True}))


def phasor_parts(state: Symbol) -> tuple[Symbol, Symbol]:
    """The two real symbols behind a phasor."""
    return _real(f"{state.name}_re"), _real(f"{state.name}_im")


__all__ = ["Equations", "I", "Requirement", "State", "im", "phasor_parts", "re", "start_symbol"]
