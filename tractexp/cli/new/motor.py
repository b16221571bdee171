"""A motor."""

from typing import TYPE_CHECKING

from tractexp.extend import Motor, Parameter, plugin

if TYPE_CHECKING:
    from tractexp.extend.symbols import Equations, Expr, Symbol

SOURCE = "author year, equation"  # of the bounds and the default


@plugin
class Example(Motor):
    r"""A motor that stands still: a resistance and a reactance.

        I = U/(R + j X)

    Source: author year, equation.
    Departures: none.
    """

    example_R = Parameter(2.0, (1.0, 10.0), "pu", "resistance", SOURCE, "R", power_exponent=-1)
    example_X = Parameter(3.0, (1.0, 10.0), "pu", "reactance", SOURCE, "X", power_exponent=-1)

    def declare(self, eq: "Equations", example_R: "Symbol", example_X: "Symbol") -> "Expr":
        from sympy import I

        return eq.V / (example_R + I * example_X)
