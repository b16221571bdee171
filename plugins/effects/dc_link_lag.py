"""Converters whose power follows the voltage through a dc link."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = (
    "small-signal models of four-quadrant converters, Hu et al. 2017, IEEE Trans. Power Electronics"
)


@plugin
class DcLinkLag(Effect):
    """A share of the static active power is drawn by converters whose dc link stores energy: their
    control comes late.

        P_s -> (1 - s) P_s + s u^a (P_s0 + x),   T_dc dx/dt = a P_s0 + (1 - a) P_s - u^a (P_s0 + x),
        u = U/U_0

    P_s0 + x is what the control asks for by the energy that the link lacks. At a = 1 it sets the
    current and the demand behind the link is constant: the power falls with the voltage and comes
    back. At a = 0 it sets the power and the demand follows the voltage as the static load does: the
    power falls late. Power factor one: Q is untouched. At s = 0 the base model, whatever T_dc and
    a.

    Source: Hu et al. 2017: C U_dc dU_dc/dt = P_ac - P_inv, a proportional controller of the stored
    energy.
    Departures: the current follows its setpoint at once; a between 0 and 1 stands for a mixture of
    controls.
    """

    lag_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_{dc}", null=0.0
    )
    lag_time = Parameter(
        0.05, (0.005, 0.5), "s", "time constant of dc link and its control", SOURCE, "T_{dc}"
    )
    held_current = Parameter(
        1.0,
        (0.0, 1.0),
        "1",
        "how far the control holds current, not power",
        SOURCE,
        "a",
        natural_ends=(1.0,),
    )

    places, kind = ("converter share",), "lag"
    grid = {"lag_time": (0.01, 0.03, 0.1, 0.3), "held_current": (0.0, 1.0)}
    relevant = {"lag_share": 0.1}
    confused_with = ("feeder_impedance", "stator_resistance", "time_skew")

    def edit(self, eq, lag_share, lag_time, held_current):
        more = eq.lag("link_power", "x_{dc}")
        drawn = (eq.U / eq.U0) ** held_current * (eq.P_s0 + more)
        demand = held_current * eq.P_s0 + (1 - held_current) * eq.expression(sites.P_static)
        eq.moves(more, (demand - drawn) / lag_time, 0)
        eq.edit(sites.P_static, lambda P: (1 - lag_share) * P + lag_share * drawn)
