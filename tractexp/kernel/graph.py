"""Expressions as graphs: what occurs a thousand times in a nested expression is looked at once.

SymPy walks an expression as a tree. The steady state of a double cage, Newton's steps put into each
other, is a small graph and a tree of millions.
"""

from collections.abc import Iterator

import sympy

# by name: type checkers take what is imported from an untyped package for unknown
Basic = sympy.Basic
Symbol = sympy.Symbol


def walk_nodes(expression: Basic) -> Iterator[Basic]:
    """Each different part of an expression, itself first."""
    visited, waiting = {expression}, [expression]
    while waiting:
        node = waiting.pop()
        yield node
        new = [part for part in node.args if part not in visited]
        visited.update(new)
        waiting += new


def collect_symbols(expression: Basic) -> set[Symbol]:
    """The symbols that an expression is made of."""
    return {part for part in walk_nodes(expression) if isinstance(part, Symbol)}


def list_arguments(expression: sympy.Expr) -> tuple[sympy.Expr, ...]:
    """The arguments of an expression, which are expressions."""
    return expression.args  # pyright: ignore[reportReturnType] # SymPy calls them `Basic`, as those of a set are


def count_operations(expression: Basic) -> int:
    """How many operations compute an expression, each different part of it once."""
    return sum(max(len(part.args) - 1, 1) for part in walk_nodes(expression) if part.args)
