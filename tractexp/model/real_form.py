"""Expressions of complex quantities as pairs of real ones: a kernel knows real numbers only."""

import itertools
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import sympy
from sympy import I

from tractexp.kernel.graph import Symbol, collect_symbols, count_operations, walk_nodes
from tractexp.model.graph import replace_symbols, split_halves, split_real_imag
from tractexp.model.symbols import is_real, make_real_symbol, phasor_parts, start_symbol

MOST_EXPANDED_NODES = 300  # nodes of an expression
Halves = tuple[sympy.Expr, sympy.Expr]


def expand_definitions(
    expression: sympy.Expr,
    definitions: Mapping[Symbol, sympy.Expr],
    named: Callable[[Symbol], bool] = lambda _: True,
) -> sympy.Expr:
    """The expression with the defined symbols that are `named` (by default all) replaced by what
    they stand for.
    """
    while names := {s for s in collect_symbols(expression) & definitions.keys() if named(s)}:
        expression = replace_symbols(expression, {s: definitions[s] for s in names})
    return expression


class RealForm:
    """Real and imaginary parts in real symbols of expressions in names with `definitions` and in
    complex `states`.

    A name that stands for something real is lowered by itself and put in last: products are not
    expanded across it, so that it stays one common subexpression. `by_name` that holds for complex
    names, too, as space vectors need it: there products across names are long. What was split once
    is not split again, until a definition changes (`forget`): a derivative is asked for as what
    moves, and as what vanishes before the event.
    """

    def __init__(
        self, definitions: Mapping[Symbol, sympy.Expr], states: Iterable[Symbol], *, by_name: bool
    ):
        """Split complex expressions into real ones: definitions by their names or written out."""
        self.definitions, self.states, self.by_name = definitions, states, by_name
        self._split: dict[sympy.Expr, Halves] = {}

    def forget(self) -> None:
        """Split anew what is asked for from now on."""
        self._split.clear()

    def parts(self, expression: sympy.Expr) -> Halves:
        """Real and imaginary part, names expanded."""
        if expression not in self._split:
            way = self._name_by_name if self.by_name else self._at_once
            self._split[expression] = way(sympy.sympify(expression))
        return self._split[expression]

    def real(self, expression: sympy.Expr) -> sympy.Expr:
        """The real part of an expression that is meant to be real."""
        if isinstance(expression, Symbol) and expression in self.definitions:
            expression = self.definitions[expression]
        return self.parts(expression)[0]

    def _complex_states(self) -> dict[Symbol, sympy.Expr]:
        """The expressions for complex states and for their values before the event."""
        both = (
            s for state in self.states if not state.is_real for s in (state, start_symbol(state))
        )
        return {s: a + I * b for s in both for a, b in [phasor_parts(s)]}

    def _at_once(self, expression: sympy.Expr) -> Halves:
        """Complex names are expanded first."""
        whole = expand_definitions(expression, self.definitions, lambda s: not s.is_real)
        lowered = replace_symbols(whole, self._complex_states())
        if is_real(lowered):
            both = (lowered if lowered.is_real else _choose_shorter(lowered), sympy.Integer(0))
        else:
            both = map(_choose_shorter, split_real_imag(lowered))
        real, imaginary = (replace_symbols(e, self._map_real_names(e)) for e in both)
        return real, imaginary

    def _name_by_name(self, expression: sympy.Expr) -> Halves:
        """Every name, real or complex, is lowered by itself."""
        pairs = {
            s: phasor_parts(s)
            for s in collect_symbols(expression) & self.definitions.keys()
            if not s.is_real
        }
        lowered = replace_symbols(
            expression, self._complex_states() | {s: a + I * b for s, (a, b) in pairs.items()}
        )
        values: dict[Symbol, sympy.Expr] = {}
        for s, pair in pairs.items():
            values |= zip(pair, self.parts(self.definitions[s]), strict=True)
        real, imaginary = (
            replace_symbols(_choose_shorter(e), values | self._map_real_names(e))
            for e in split_halves(lowered)
        )
        return real, imaginary

    def _map_real_names(self, expression: sympy.Expr) -> dict[Symbol, sympy.Expr]:
        """The expressions that the real names in an expression stand for."""
        return {s: self.real(s) for s in collect_symbols(expression) & self.definitions.keys()}


def _choose_shorter(expression: sympy.Expr) -> sympy.Expr:
    """The expression or its expansion, whichever has fewer operations: products of phasors cancel
    when expanded.

    Long ones stay as they are: they gain nothing, and expanding them takes seconds.
    """
    first = itertools.islice(sympy.preorder_traversal(expression), MOST_EXPANDED_NODES + 1)
    if len(list(first)) > MOST_EXPANDED_NODES:
        return expression
    if not any(
        isinstance(part, sympy.Mul | sympy.Pow) and any(a.is_Add for a in part.args)
        for part in walk_nodes(expression)
    ):
        return expression
    extremes = [part for part in walk_nodes(expression) if isinstance(part, sympy.Max | sympy.Min)]
    hidden: dict[Any, Any] = {
        part: make_real_symbol(f"_extreme{k}") for k, part in enumerate(extremes)
    }
    # SymPy compares the arguments of a maximum for seconds
    plain: Any = expression.xreplace(hidden)
    expanded = plain.expand(power_exp=False, power_base=False, log=False, basic=False)
    chosen: Any = min(plain, expanded, key=count_operations)
    return chosen.xreplace({symbol: part for part, symbol in hidden.items()})
