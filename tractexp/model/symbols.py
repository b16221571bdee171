"""Symbols of a model: real ones and complex ones, their parts, and what they start from."""

import sympy
from sympy import I

from tractexp.kernel.graph import Symbol, walk_nodes


def is_real(expression: sympy.Expr) -> bool:
    """Whether an expression is made of real symbols, or SymPy knows it to be real wherever it is
    finite.
    """
    all_real = I not in (parts := set(walk_nodes(expression))) and all(
        s.is_real for s in parts if isinstance(s, Symbol)
    )
    return all_real or bool(expression.is_real)  # SymPy's answer may take a second


def make_real_symbol(name: str) -> Symbol:
    """A symbol of something real."""
    return Symbol(name, real=True)


def make_vector_symbol(name: str) -> Symbol:
    """A symbol of something complex."""
    return Symbol(name, complex=True)


def start_symbol(state: Symbol) -> Symbol:
    """The symbol of a state's value before the event."""
    return (make_real_symbol if state.is_real else make_vector_symbol)(f"{state.name}_before")


def phasor_parts(state: Symbol) -> tuple[Symbol, Symbol]:
    """The two real symbols behind a phasor."""
    return make_real_symbol(f"{state.name}_re"), make_real_symbol(f"{state.name}_im")
