"""A static load."""

from typing import TYPE_CHECKING

from tractexp.extend import Parameter, Static, plugin

if TYPE_CHECKING:
    from tractexp.extend.symbols import Expr, Symbol

SOURCE = "author year, equation"  # of the bounds and the default


@plugin
class Example(Static):
    r"""A static load whose power is linear in the voltage.

        P_s = P_s0 (1 + a (u - 1)),   Q_s = Q_s0 (1 + b (u - 1)),   u = U/U_0

    Source: author year, equation.
    Departures: none.
    """

    example_slope_p = Parameter(1.0, (0.0, 3.0), "1", "slope of the active power", SOURCE, "a")
    example_slope_q = Parameter(2.0, (0.0, 6.0), "1", "slope of the reactive power", SOURCE, "b")

    def law(
        self, u: "Symbol", example_slope_p: "Symbol", example_slope_q: "Symbol"
    ) -> "tuple[Expr, Expr]":
        return 1 + example_slope_p * (u - 1), 1 + example_slope_q * (u - 1)
