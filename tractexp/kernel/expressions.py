"""SymPy's expressions written as values of a function."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import itemgetter
from typing import Any, TypeGuard

import sympy
from sympy.logic.boolalg import Boolean, BooleanFalse, BooleanTrue

from tractexp.errors import UserError
from tractexp.kernel import math as lanes
from tractexp.kernel.graph import Symbol
from tractexp.kernel.lowered import Phase

RELATIONS = {
    sympy.StrictLessThan: "olt",
    sympy.LessThan: "ole",
    sympy.StrictGreaterThan: "ogt",
    sympy.GreaterThan: "oge",
    sympy.Equality: "oeq",
    sympy.Unequality: "une",
}
NAMES = ("exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")
OURS: dict[type, Callable[..., Any]] = {
    getattr(sympy, name): getattr(lanes, name) for name in NAMES
}
LLVMS = {sympy.Abs: "fabs", sympy.floor: "floor", sympy.ceiling: "ceil"}
HALF = sympy.Rational(1, 2)


class Expressions:
    """Values of expressions in symbols whose values are in scope, each part of them written once.

    `numbers` is the arithmetic: of lanes (`numbers.Numbers`) or of arrays (`arrays.Arrays`).
    """

    def __init__(self, numbers: Any, scope: Mapping[Symbol, Any]):
        """Write expressions with `numbers`, whose symbols have the values of `scope`."""
        self.numbers, self.scope = numbers, dict(scope)
        self._values: dict[sympy.Basic, Any] = {}

    def evaluate_phase(self, phase: Phase) -> list[Any]:
        """The values of a phase's expressions."""
        for symbol, expression in phase.steps:
            self.scope[symbol] = self(expression)
        return [self(e) for e in phase.expressions]

    def __call__(self, e: sympy.Basic) -> Any:
        """Its value. Raises `UserError` for a function that kernels do not know."""
        if e not in self._values:
            self._values[e] = self._written(e)
        return self._values[e]

    def _written(self, e: sympy.Basic) -> Any:
        """The value of an expression that was not written yet."""
        n = self.numbers
        if isinstance(e, Symbol):
            return self.scope[e]
        if isinstance(e, sympy.Number | sympy.NumberSymbol):
            return n.constant(float(e))
        if isinstance(e, sympy.Add):
            return self._sum(e.args)
        if isinstance(e, sympy.Mul):
            return self._product(*e.as_coeff_Mul())
        if isinstance(e, sympy.Pow):
            return self._power(e.base, e.exp)
        if isinstance(e, sympy.Max | sympy.Min):
            return self._extreme(e)
        if isinstance(e, sympy.Piecewise):
            return self._piecewise(e.args)
        return self._function(e)

    def _function(self, e: sympy.Basic) -> Any:
        """The value of a function: ours, one of LLVM's, or a step."""
        n = self.numbers
        if type(e) in OURS:
            return OURS[type(e)](n, *map(self, e.args))
        if type(e) in LLVMS:
            return n.call(LLVMS[type(e)], self(e.args[0]))
        if isinstance(e, sympy.sign | sympy.Heaviside):
            above, below = (1.0, -1.0) if isinstance(e, sympy.sign) else (1.0, 0.0)
            x = self(e.args[0])
            zero = n.constant(0.0)
            at = zero if isinstance(e, sympy.sign) else self(e.args[1])
            rest = n.select(n.compare("olt", x, zero), n.constant(below), at)
            return n.select(n.compare("ogt", x, zero), n.constant(above), rest)
        functions = ", ".join(sorted(kind.__name__ for kind in (*OURS, *LLVMS)))
        raise UserError(
            f"the equations contain {type(e).__name__}, in {e}, which kernels cannot compute; write"
            f" it by sums, products, powers, Max, Min, Piecewise, sign, Heaviside or {functions}"
        )

    # Sums, products, powers

    def _sum(self, terms: Sequence[sympy.Basic]) -> Any:
        """Single terms first, then the products one by one: each a fused multiplication and
        addition.
        """
        single = []
        products = []
        for term in terms:
            coefficient, rest = term.as_coeff_Mul()  # type: ignore[attr-defined]
            item = bool(coefficient < 0), abs(coefficient), rest
            fuses = isinstance(rest, sympy.Mul) or (
                coefficient not in (1, -1) and rest is not sympy.S.One
            )
            (products if fuses else single).append(item)
        items = sorted(single, key=itemgetter(0)) + sorted(products, key=itemgetter(0))
        first = next((k for k, item in enumerate(items) if not item[0]), 0)
        items.insert(0, items.pop(first))
        n = self.numbers
        total = self._product(*items[0][1:])
        if items[0][0]:
            total = n.negative(total)
        for negative, coefficient, rest in items[1:]:
            value = self._product(coefficient, rest)
            total = n.subtract(total, value) if negative else n.add(total, value)
        return total

    def _product(self, coefficient: sympy.Expr, rest: sympy.Expr) -> Any:
        """A coefficient times factors, over the product of those that divide."""
        n, above, below = self.numbers, [], []
        for factor in sympy.Mul.make_args(rest):
            if _divides(factor):
                below.append((factor.base, -factor.exp))
            elif factor is not sympy.S.One:
                above.append(factor)
        value = self._multiply_values(map(self, above))
        if value is None:
            value = n.constant(float(coefficient))
        elif coefficient == -1:
            value = n.negative(value)
        elif coefficient != 1:
            value = n.multiply(n.constant(float(coefficient)), value)
        divisor = self._multiply_values(self._power(*factor) for factor in below)
        return value if divisor is None else n.divide(value, divisor)

    def _multiply_values(self, values: Iterable[Any]) -> Any:
        """Their product; None of none."""
        product = None
        for value in values:
            product = value if product is None else self.numbers.multiply(product, value)
        return product

    def _power(self, base: sympy.Expr, exponent: sympy.Expr) -> Any:
        """The value of a power: by products where the exponent is whole, by roots where it is a
        half, else by exp and ln.
        """
        n = self.numbers
        if base == sympy.E:
            return lanes.exp(n, self(exponent))
        if not isinstance(exponent, sympy.Number):
            return lanes.exp(n, n.multiply(self(exponent), lanes.log(n, self(base))))
        if exponent.is_negative:
            return n.divide(n.constant(1.0), self._power(base, -exponent))
        x = self(base)
        whole = math.floor(exponent)
        if exponent == whole:
            return self._multiply_power(x, whole)
        if exponent - whole == HALF:
            return self._multiply_power(x, whole, n.root(x))
        return lanes.power(n, x, float(exponent))

    def _multiply_power(self, x: Any, times: int, by: Any = None) -> Any:
        """x multiplied by itself, and by another value."""
        n = self.numbers
        while times:
            if times % 2:
                by = x if by is None else n.multiply(by, x)
            times //= 2
            if times:
                x = n.multiply(x, x)
        return n.constant(1.0) if by is None else by

    # Choices

    def _extreme(self, e: sympy.Max | sympy.Min) -> Any:
        """The value of the largest or the smallest of several."""
        choose = self.numbers.larger if isinstance(e, sympy.Max) else self.numbers.smaller
        first, *others = sorted(e.args, key=sympy.default_sort_key)
        value = self(first)
        for other in others:
            value = choose(value, self(other))
        return value

    def _piecewise(self, pieces: Sequence[sympy.Basic]) -> Any:
        """nan where no condition holds."""
        value = self.numbers.constant(math.nan)
        for piece in reversed(pieces):
            expression, condition = piece.args
            there = self(expression)
            always = condition == sympy.true
            value = (
                there if always else self.numbers.select(self._condition(condition), there, value)
            )
        return value

    def _condition(self, condition: Boolean | sympy.Basic) -> Any:
        """The truth of a condition in every lane."""
        n = self.numbers
        if isinstance(condition, BooleanTrue | BooleanFalse):
            return n.truth(bool(condition))
        if how := RELATIONS.get(type(condition)):
            return n.compare(how, self(condition.args[0]), self(condition.args[1]))
        if isinstance(condition, sympy.Not):
            return n.logic("xor", self._condition(condition.args[0]), n.truth(True))
        if isinstance(condition, sympy.And | sympy.Or):
            operation = "and" if isinstance(condition, sympy.And) else "or"
            first, *others = (
                self._condition(a) for a in sorted(condition.args, key=sympy.default_sort_key)
            )
            for other in others:
                first = n.logic(operation, first, other)
            return first
        raise UserError(
            f"the equations contain the condition {condition}, which kernels cannot decide; compare"
            " numbers"
        )


def _divides(factor: sympy.Basic) -> TypeGuard[sympy.Pow]:
    """Whether a factor is a power with a negative number as its exponent."""
    if not isinstance(factor, sympy.Pow):
        return False
    return isinstance(factor.exp, sympy.Number) and bool(factor.exp.is_negative)
