"""Expressions as graphs: what occurs a thousand times in a nested expression is looked at once.

SymPy walks an expression as a tree. The steady state of a double cage, Newton's steps put into each other, is a small
graph and a tree of millions.
"""

from collections.abc import Iterator, Mapping

import sympy
from sympy import Basic, Symbol


def nodes(expression: Basic) -> Iterator[Basic]:
    """Each different part of an expression, itself first."""
    seen, waiting = {expression}, [expression]
    while waiting:
        found = waiting.pop()
        yield found
        new = [part for part in found.args if part not in seen]
        seen.update(new)
        waiting += new


def symbols_of(expression: Basic) -> set[Symbol]:
    """The symbols that an expression is made of."""
    return {part for part in nodes(expression) if isinstance(part, Symbol)}


def replaced(expression: sympy.Expr, known: Mapping[Symbol, sympy.Expr]) -> sympy.Expr:
    """The expression with symbols replaced, as `xreplace` does it."""
    made: dict[Basic, Basic] = dict(known)

    def visit(part: Basic) -> Basic:
        if part not in made:
            args = [visit(a) for a in part.args]
            same = all(a is b for a, b in zip(args, part.args, strict=True))
            made[part] = part if same else part.func(*args)
        return made[part]

    return visit(expression)  # type: ignore[return-value]
