"""Traction that gives up its power in stages at low line voltage, and takes it back
stage by stage.
"""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._operators import smaller
from ._relay import stages

SOURCE = "EN 50388-1, limitation of current or power at low line voltage"
STAGES = 3
STAGE_CORNER = 0.02  # of the power: how rounded the corner at the limit of the current is


@plugin
class StagedPowerLimit(Effect):
    """A share of the static active power is traction that relays reduce in three stages, and give
    back one by one.

        P_s -> (1 - s) P_s + s P_s0 min(1 - g, i_max u),   u = U/U_0

    g is the part that the relays hold open: each stage opens once the voltage has stayed below a
    level of its own for T_g, and returns within T_gb once it has stayed h_g above that for T_gr,
    each further stage T_gp later. The levels lie evenly between u_g1 and u_g3. Between the stages
    power is constant, up to the limit i_max of the current. At s = 0 the base model, whatever the
    rest.

    Source: EN 50388-1 leaves to the train how it reduces its power at low line voltage; stages are
    generic.
    Departures: levels count from the voltage before the event; thresholds are softened over 1 % of
    voltage and one sample, and the corner of the limit over 2 % of the power, so that derivatives
    exist.
    """

    staged_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_g", null=0.0
    )
    staged_first = Parameter(
        0.9, (0.75, 0.98), "1", "voltage of the first stage, over U_0", SOURCE, "u_{g1}"
    )
    staged_last = Parameter(
        0.7, (0.3, 0.95), "1", "voltage of the last stage, over U_0", SOURCE, "u_{g3}"
    )
    staged_delay = Parameter(
        0.02, (0.0, 0.5), "s", "time below its level before a stage opens", SOURCE, "T_g"
    )
    staged_wait = Parameter(
        0.3, (0.02, 2.0), "s", "time after recovery before the first returns", SOURCE, "T_{gr}"
    )
    staged_pause = Parameter(0.3, (0.0, 1.0), "s", "time until the next returns", SOURCE, "T_{gp}")
    staged_margin = Parameter(
        0.03, (0.01, 0.3), "1", "recovered is this much above the level", SOURCE, "h_g"
    )
    staged_ramp = Parameter(0.1, (0.0, 1.0), "s", "time in which a stage returns", SOURCE, "T_{gb}")
    staged_limit = Parameter(
        1.5, (1.05, 4.0), "1", "largest current over that before", SOURCE, "i_{max}"
    )

    order = 3
    places, kind = ("converter share",), "limit"
    family, differs = "voltage_dependent_power_limit", "in stages by relays"
    grid = {
        "staged_first": (0.85, 0.93),
        "staged_last": (0.5, 0.7),
        "staged_wait": (0.1, 0.4),
        "staged_pause": (0.0, 0.2),
    }
    relevant = {"staged_share": 0.1}
    confused_with = ("voltage_dependent_power_limit", "static_trip", "ramped_current")

    def edit(
        self,
        eq,
        staged_share,
        staged_first,
        staged_last,
        staged_delay,
        staged_wait,
        staged_pause,
        staged_margin,
        staged_ramp,
        staged_limit,
    ):
        waits = [staged_wait + k * staged_pause for k in range(STAGES)]
        gone = stages(
            eq, staged_first, staged_last, staged_delay, waits, staged_margin, staged_ramp, "stage"
        )
        allowed = lambda u, gone: smaller(1 - gone, staged_limit * u, STAGE_CORNER)  # noqa: E731
        power = eq.P_s0 * allowed(eq[sites.static_voltage], gone) / allowed(1, 0)
        eq.edit(sites.P_static, lambda P: (1 - staged_share) * P + staged_share * power)
