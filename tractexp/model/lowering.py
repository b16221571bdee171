"""From declared equations to the expressions a kernel evaluates: hoisted, split by when they must
be computed.

What depends on parameters only is computed once per candidate (a *constant*), what depends on the
recorded input only once per sample (a *signal*); the rest is left for the inner loop. A power with
a symbolic exponent becomes exp(exponent * log(base)), whose logarithm is then a signal.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import sympy

from tractexp.errors import UserError
from tractexp.kernel.arrays import evaluate_phase
from tractexp.kernel.graph import Symbol, collect_symbols, list_arguments
from tractexp.kernel.layout import EVENT, INPUTS
from tractexp.kernel.lowered import Lowered, Phase, collect_phase_symbols
from tractexp.model.equations import Equations
from tractexp.model.graph import replace_symbols

POINTS, TRIES = 5, 200  # admissible points looked at, of so many that are drawn
# of a balance [pu/s, rad/s²]: above what doubles leave of zero, below what a guess misses by
BALANCE_ROUNDING = 1e-7
EVENTS: Mapping[str, tuple[float, float]] = {
    "U0": (0.9, 1.1),
    "omega_s0": (-3.0, 3.0),
    "U20": (0.01, 0.05),
    "omega_n": (310.0, 380.0),
    "step": (1e-3, 1e-2),
    "P0": (0.5, 1.5),
    "Q0": (0.3, 0.9),
}


class _Hoister:
    """Collects constants and signals while rewriting expressions."""

    def __init__(self, lane: set[Symbol], event: set[Symbol], inputs: set[Symbol]):
        """Sort expressions by what they hold: `lane` symbols of a candidate, `event` ones of an
        event, `inputs` of a sample.
        """
        self.lane, self.event, self.inputs = lane, event, inputs
        self.constants: dict[sympy.Expr, Symbol] = {}
        self.signals: dict[sympy.Expr, Symbol] = {}
        self._rewrites: dict[sympy.Expr, sympy.Expr] = {}  # what was rewritten already
        self._symbols: dict[sympy.Expr, frozenset[Symbol]] = {}

    def symbols(self, e: sympy.Expr) -> frozenset[Symbol]:
        """The symbols of an expression, those of each of its parts found once."""
        if e not in self._symbols:
            own = frozenset[Symbol]((e,) if isinstance(e, Symbol) else ())
            self._symbols[e] = own.union(*map(self.symbols, list_arguments(e)))
        return self._symbols[e]

    def is_constant(self, e: sympy.Expr) -> bool:
        """Whether an expression is the same all along an event."""
        return self.symbols(e) <= self.lane | self.event

    def is_signal(self, e: sympy.Expr) -> bool:
        """Whether an expression is the same for all candidates."""
        return self.symbols(e) <= self.inputs | self.event

    def constant(self, e: sympy.Expr) -> sympy.Expr:
        """The symbol by which a constant is computed once per candidate."""
        if e.is_number or e in self.lane:
            return e
        return self.constants.setdefault(e, Symbol(f"_c{len(self.constants)}", real=True))

    def signal(self, e: sympy.Expr) -> sympy.Expr:
        """The symbol by which a signal is computed once per sample."""
        if e.is_number or e in self.inputs or -e in self.inputs:
            return e
        return self.signals.setdefault(e, Symbol(f"_s{len(self.signals)}", real=True))

    def __call__(self, e: sympy.Expr) -> sympy.Expr:
        """The expression with its constants and signals replaced by their symbols."""
        if e not in self._rewrites:
            self._rewrites[e] = self._rewritten(e)
        return self._rewrites[e]

    def _rewritten(self, e: sympy.Expr) -> sympy.Expr:
        """The rewritten form of an expression that was not met before."""
        if not isinstance(e, sympy.Expr):  # pyright: ignore[reportUnnecessaryIsInstance] # a piece, or its condition
            return e.func(*map(self, list_arguments(e)))
        if self.is_constant(e):
            return self.constant(e)
        if self.is_signal(e):
            return self.signal(e)
        if e.is_Symbol:
            return e
        if isinstance(e, sympy.Pow) and not e.exp.is_number:
            return self(sympy.exp(e.exp * sympy.log(e.base)))
        if isinstance(e, sympy.Add | sympy.Mul):
            return self._group_arguments(e)
        return e.func(*map(self, list_arguments(e)))

    def _group_arguments(self, e: sympy.Expr) -> sympy.Expr:
        """A sum or product whose constant and whose sampled arguments are one symbol each."""
        constant, signal, rest = [], [], []
        for argument in list_arguments(e):
            if self.is_constant(argument):
                constant.append(argument)
            elif self.is_signal(argument):
                signal.append(argument)
            else:
                rest.append(self(argument))
        if constant:
            rest.append(self.constant(e.func(*constant)))
        if signal:
            rest.append(self.signal(e.func(*signal)))
        return e.func(*rest)


def lower(eq: Equations) -> Lowered:
    """Lower a complete declaration. Raises `UserError` where a symbol is used that nothing
    declares.
    """
    rows = eq.real_states()
    states = tuple(symbol for symbol, _, _ in rows)
    memories = tuple(eq.memories)
    starts = tuple(eq.real_starts())
    parameters = tuple(map(_make_symbol, eq.parameters))
    lane = {*parameters, eq.P0, eq.Q0, *starts}
    event = tuple(map(_make_symbol, EVENT))
    inputs = tuple(map(_make_symbol, INPUTS))

    hoist = _Hoister(lane, set(event), set(inputs))
    steps = {symbol: eq.real(e) for symbol, e in eq.steps.items()}
    derivative = _build_phase(hoist, [d for _, d, _ in rows], steps)
    renewal = _build_phase(hoist, [eq.real(m.renewal) for m in eq.memories.values()], steps)
    outputs = eq.outputs()
    output = _build_phase(hoist, [eq.real(e) for e in outputs.values()], steps)
    first = [i for _, _, i in rows] + [eq.real(m.initial) for m in eq.memories.values()]
    begin = dict(zip(starts, first, strict=True))
    slack = [replace_symbols(eq.expand(r.slack), begin) for r in eq.requirements]
    start = _build_phase(None, first + slack)
    at_rest = eq.at_rest() | dict(zip((*states, *memories), starts, strict=True))
    balances = _build_phase(None, [replace_symbols(b, at_rest) for b in eq.real_balances()])
    phases = (derivative, renewal, output)
    read = {eq.v}.union(*map(collect_phase_symbols, phases))
    used = tuple(s for s in inputs if s in read)
    lowered = Lowered(
        parameters,
        used,
        event,
        states,
        memories,
        starts,
        start,
        balances,
        tuple(hoist.constants.values()),
        _build_phase(None, list(hoist.constants)),
        *phases,
        tuple(outputs),
    )
    _check_closed(lowered, lane)
    if not eq.edits and _is_steady_state_exact(eq, start, balances, starts):
        return replace(lowered, rest=None)
    return lowered


def _is_steady_state_exact(
    eq: Equations, start: Phase, rest: Phase, starts: Sequence[Symbol]
) -> bool:
    """Whether the steady state that the parts declare is exact, and no first guess that the kernel
    has to solve for.

    Every balance vanishes there, at random parameters and events. `start` computes `starts` and
    then the slack of each requirement, `rest` the balances from them.
    """
    ranges = {**{name: p.bounds for name, p in eq.parameters.items()}, **EVENTS}
    low, high = np.array([*ranges.values()]).T
    drawn = np.random.default_rng(0).uniform(low, high, (TRIES, len(ranges))).T
    given = {_make_symbol(name): values for name, values in zip(ranges, drawn, strict=True)}
    values = evaluate_phase(start, given, TRIES)
    first = values[: len(starts)]
    slacks = values[len(starts) :]
    balances = evaluate_phase(rest, given | dict(zip(starts, first, strict=True)), TRIES)
    finite = np.isfinite(np.array([*first, *slacks, *balances])).all(axis=0)
    admissible = finite & (np.array([np.ones(TRIES), *slacks]) >= 0).all(axis=0)
    points = np.flatnonzero(admissible)[:POINTS]
    missed = np.abs(np.array([np.zeros(TRIES), *balances])[:, points]).max(axis=0)
    return len(points) == POINTS and bool((missed < BALANCE_ROUNDING).all())


def _build_phase(
    hoist: _Hoister | None,
    expressions: list[sympy.Expr],
    steps: Mapping[Symbol, sympy.Expr] | None = None,
) -> Phase:
    """The steps of one phase that its expressions need, with constants and signals taken out."""
    signals = ()
    needed = _select_needed_steps(expressions, steps or {})
    targets = list(needed)
    expressions = [*needed.values(), *expressions]
    if hoist is not None:
        expressions = [hoist(e) for e in expressions]
        used = set().union(*map(collect_symbols, expressions))
        signals = tuple((s, e) for e, s in hoist.signals.items() if s in used)
    computed = [*zip(targets, expressions, strict=False)]
    return Phase(signals, _sort_assignments(computed), tuple(expressions[len(targets) :]))


def _select_needed_steps(
    expressions: list[sympy.Expr], steps: Mapping[Symbol, sympy.Expr]
) -> dict[Symbol, sympy.Expr]:
    """The steps that some expressions need, and those that these need in turn."""
    needed: set[Symbol] = set()
    new = set().union(*map(collect_symbols, expressions)) & steps.keys()
    while new:
        needed |= new
        new = set().union(*(collect_symbols(steps[s]) for s in new)) & steps.keys() - needed
    return {symbol: e for symbol, e in steps.items() if symbol in needed}


def _sort_assignments(
    assignments: list[tuple[Symbol, sympy.Expr]],
) -> tuple[tuple[Symbol, sympy.Expr], ...]:
    """Assignments rearranged so that each comes after those it reads."""
    waiting = list(assignments)
    ordered = []
    while waiting:
        open_symbols = {s for s, _ in waiting}
        ready = [(s, e) for s, e in waiting if not collect_symbols(e) & open_symbols]
        ordered += ready
        waiting = [(s, e) for s, e in waiting if s not in {r for r, _ in ready}]
    return tuple(ordered)


def _check_closed(lowered: Lowered, lane: set[Symbol]) -> None:
    """Raise AssertionError for a symbol that nothing has computed before it is used."""
    defined = lane | {*lowered.inputs, *lowered.event, *lowered.states, *lowered.memories}
    for phase in (
        lowered.start,
        lowered.rest,
        lowered.constant,
        lowered.derivative,
        lowered.renewal,
        lowered.output,
    ):
        if phase is None:
            continue
        own = {*lowered.constants, *(s for s, _ in (*phase.steps, *phase.signals))}
        if stray := collect_phase_symbols(phase) - defined - own:
            raise UserError(
                f"the equations use {', '.join(sorted(map(str, stray)))}, which no part of the"
                " model declares"
            )


def _make_symbol(name: str) -> Symbol:
    """A real symbol of that name."""
    return Symbol(name, real=True)
