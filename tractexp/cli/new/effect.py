"""An effect that a load model may lack."""

from typing import TYPE_CHECKING

from tractexp.extend import Effect, Parameter, plugin, sites

if TYPE_CHECKING:
    from tractexp.extend.symbols import Equations, Symbol

SOURCE = "author year, equation"  # of the bounds and the default


@plugin
class Example(Effect):
    r"""The active power of the static load has a part that follows the square of the voltage.

        P_s -> P_s (1 + k (u^2 - 1)),   u = U/U_0

    At k = 0 the base model.

    Source: author year, equation.
    Departures: none.
    """

    example_share = Parameter(
        0.0, (0.0, 1.0), "1", "share that follows the square", SOURCE, "k", null=0.0
    )

    places, kind = ("static P",), "law"
    relevant = {"example_share": 0.05}

    def edit(self, eq: "Equations", example_share: "Symbol") -> None:
        u = eq[sites.static_voltage]
        eq.edit(sites.P_static, lambda P: P * (1 + example_share * (u**2 - 1)))
