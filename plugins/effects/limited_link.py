"""Converters that control the voltage of their dc link, with a limit of their current."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._operators import larger, smaller

SOURCE = (
    "Hu et al. 2017, IEEE Trans. Power Electronics (four-quadrant converters), before linearisation"
)
LINK_CORNER = 0.02  # of the current: how rounded the corner at its limit is
EMPTY = 0.6  # of the dc voltage: below it the drives behind the link are resistances


@plugin
class LimitedLink(Effect):
    """A share of the static active power is drawn by converters that hold their dc voltage up to a
    limit of current.

        P_s -> (1 - s) P_s + s P_s0 u i,   u = U/U_0
        T_s v dv/dt = u i - v^2/max(v^2, v_e^2),   i = min(1 + (T_s/T_l) (1 - v), i_max)

    v is the voltage of the link over that before, T_s the energy that it stores over half the
    power. In a dip the power falls with the voltage and comes back, at most to i_max u; when the
    voltage returns it is too much for a while. Of a link that stores much (v stays near 1) T_l
    di/dt = 1 - u i, which is `dc_link_lag` at a = 1. Power factor one: Q is untouched. At s = 0 the
    base model, whatever the rest.

    Source: Hu et al. 2017: the balance of the stored energy and a proportional control of its
    voltage.
    Departures: the current follows its setpoint at once; drives whose link is nearly empty (v_e =
    0.6) take less, as a resistance does; the corner of the limit is rounded over 2 % of the
    current.
    """

    link_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_l", null=0.0
    )
    link_time = Parameter(
        0.05, (0.005, 0.5), "s", "time constant of dc link and its control", SOURCE, "T_l"
    )
    link_storage = Parameter(
        0.1, (0.02, 1.0), "s", "energy in the link over half the power", SOURCE, "T_s"
    )
    link_most = Parameter(
        1.5, (1.02, 4.0), "1", "largest current over that before", SOURCE, "i_{max}"
    )

    places, kind = ("converter share",), "lag"
    family, differs = "dc_link_lag", "with a limit of the current"
    grid = {"link_time": (0.02, 0.05, 0.15), "link_storage": (0.05, 0.3), "link_most": (1.1, 1.5)}
    relevant = {"link_share": 0.1}
    confused_with = ("exponential_recovery", "constant_power_converter", "feeder_impedance")

    def edit(self, eq, link_share, link_time, link_storage, link_most):
        u, v = eq[sites.static_voltage], eq.lag("link_voltage", "v_l")
        demand = 1 + link_storage / link_time * (1 - v)
        current = eq.define(
            "link_current",
            smaller(demand, link_most, LINK_CORNER) / smaller(1, link_most, LINK_CORNER),
            "i_l",
        )
        drive_power = lambda v: (  # noqa: E731
            v**2 / larger(v**2, EMPTY**2, LINK_CORNER)
        )
        eq.moves(
            v,
            (u * current - drive_power(v) / drive_power(1))
            / (link_storage * larger(v, 0.1, LINK_CORNER)),
            initial=1,
        )
        drawn = eq.P_s0 * u * current
        eq.edit(sites.P_static, lambda P: (1 - link_share) * P + link_share * drawn)
