"""Converters whose power follows the voltage through a dc link."""

from tractexp.model.parts import Effect
from tractexp.parameter import Parameter
from tractexp.plugin import plugin

SOURCE = "small-signal models of four-quadrant converters, Hu et al. 2017, IEEE Trans. Power Electronics"


@plugin
class DcLinkLag(Effect):
    """A share of the static active power follows the voltage with a lag, for a dc link stores energy in between.

        T_dc dx/dt = u (P_s - P_s0 - x),   P_s -> (1 - s) P_s + s (P_s0 + x),   u = U/U_0

    A positive share falls late. A negative one falls more than it settles at: converters that hold their current at
    first and bring the power back while the dc-link controller acts. The control acts by the current, so by less
    power where the voltage is low. Power factor one: Q is untouched. At s = 0 the base model, whatever T_dc.

    Source: Hu et al. 2017: C U_dc dU_dc/dt = P_ac - P_inv with a controller of the dc voltage, linearized.
    Departures: controller and dc link are one time constant.
    """

    lag_share = Parameter(0.0, (-1.0, 1.0), "1", "share in the static active power", SOURCE, "s_{dc}", null=0.0)
    lag_time = Parameter(0.05, (0.005, 0.5), "s", "time constant of dc link and its control", SOURCE, "T_{dc}")

    needs = ("P_static",)
    grid = {"lag_time": (0.01, 0.03, 0.1, 0.3)}
    relevant = {"lag_share": 0.1}
    confused_with = ("feeder_impedance", "stator_resistance", "time_skew")

    def edit(self, eq):
        share, time = eq.declare(self.parameters)
        late = eq.state("late_power", "x_{dc}")
        eq.moves(late, eq.U / eq.U0 * (eq.definitions[eq.symbol("P_static")] - eq.P_s0 - late) / time, 0)
        eq.edit("P_static", lambda P: (1 - share) * P + share * (eq.P_s0 + late))
