"""Expressions changed as the graphs they are: symbols replaced, real and imaginary parts taken."""

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from tractexp.kernel.graph import Basic, Symbol


def replace_symbols(expression: sympy.Expr, substitutes: Mapping[Symbol, sympy.Expr]) -> sympy.Expr:
    """The expression with symbols replaced, as `xreplace` does it; maxima and minima are not looked
    into.
    """
    new: dict[Basic, Basic] = {**substitutes}

    def visit(part: Basic) -> Basic:
        if part not in new:
            args = [visit(a) for a in part.args]
            same = all(a is b for a, b in zip(args, part.args, strict=True))
            new[part] = part if same else _rebuild(part, args)
        return new[part]

    return visit(expression)  # pyright: ignore[reportReturnType] # an expression's parts give one again


def _rebuild(part: Basic, args: Sequence[Basic]) -> Any:
    """A function with other arguments. SymPy compares those of a maximum with each other, which
    takes seconds.
    """
    if isinstance(part, sympy.Max | sympy.Min) and not all(a.is_number for a in args):
        return part.func(*args, evaluate=False)
    return part.func(*args)


def split_real_imag(expression: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
    """Real and imaginary part of an expression in real symbols, products multiplied out, as SymPy
    takes them.

    Of some quotients it leaves a part as it is; those are split as `halves` does.
    """
    both: Any = expression.as_real_imag()
    return split_halves(expression) if any(half.has(sympy.re, sympy.im) for half in both) else both


def split_halves(expression: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
    """Real and imaginary part of an expression in real symbols, products left as products.

    SymPy multiplies out what it splits, which of a product of many sums takes minutes.
    """
    pairs: dict[Basic, tuple[sympy.Expr, sympy.Expr]] = {}

    def visit(part: Basic) -> tuple[sympy.Expr, sympy.Expr]:
        if part not in pairs:
            pairs[part] = _combine_halves(part, [visit(a) for a in part.args])
        return pairs[part]

    return visit(expression)


def _multiply_halves(factors: list[tuple[sympy.Expr, sympy.Expr]]) -> tuple[sympy.Expr, sympy.Expr]:
    """Real and imaginary part of a product of such pairs."""
    real, imaginary = sympy.Mul(*(a for a, b in factors if b == 0)), sympy.Integer(0)
    for a, b in ((a, b) for a, b in factors if b != 0):
        real, imaginary = real * a - imaginary * b, real * b + imaginary * a
    return real, imaginary


def _combine_halves(
    part: Basic, args: list[tuple[sympy.Expr, sympy.Expr]]
) -> tuple[sympy.Expr, sympy.Expr]:
    """Those of one node from those of its arguments."""
    zero = sympy.Integer(0)
    if isinstance(part, sympy.Add):
        return sympy.Add(*(a for a, _ in args)), sympy.Add(*(b for _, b in args))
    if isinstance(part, sympy.Mul):
        return _multiply_halves(args)
    if isinstance(part, sympy.re | sympy.im):
        return args[0][isinstance(part, sympy.im)], zero
    if isinstance(part, sympy.conjugate):
        return args[0][0], -args[0][1]
    if isinstance(part, sympy.Abs) and args[0][1] != 0:
        return sympy.sqrt(args[0][0] ** 2 + args[0][1] ** 2), zero
    if part.args and all(b == 0 for _, b in args):
        return _rebuild(part, [a for a, _ in args]), zero
    if isinstance(part, sympy.Pow) and part.exp == -1:
        (a, b), _ = args
        return a / (a**2 + b**2), -b / (a**2 + b**2)
    if isinstance(part, sympy.Pow) and part.exp.is_Integer and part.exp > 1:
        return _multiply_halves([args[0]] * int(part.exp))
    if not isinstance(part, sympy.Expr):  # the condition True of a piece
        return part, zero  # pyright: ignore[reportReturnType]
    return part.as_real_imag()  # pyright: ignore[reportReturnType] # SymPy's own types allow for None
