"""Line-side converter of a traction vehicle (four-quadrant converter), averaged over
its switching.
"""

from tractexp.extend import Motor, Parameter, plugin

HARNEFORS = "Harnefors, Bongiorno, Lundberg 2007, IEEE Trans. Industrial Electronics 54(6) 3323"
STEIMEL = "Steimel 2008, Electric Traction: Motive Power and Energy Supply, ch. 9"
TEODORESCU = (
    "Teodorescu, Liserre, Rodriguez 2011, Grid Converters for Photovoltaic and Wind Power Systems"
)

CORNER = 0.05  # width of a limit's rounded corner


@plugin
class LineSideConverter(Motor):
    r"""Line-side converter behind its transformer's leakage, with current control, phase-locked
    loop and dc link.

    States: current i, converter voltage u_c, two of the resonant controller, all complex; the unit
    vector e of the phase-locked loop and its integrator x; the voltage u_f it measures; and the dc
    link's z = (U_dc/U_dc0)^2 - 1. Written in the stationary frame, with omega_0 the frequency
    before the event:

        X_c/omega_n di/dt = v - r X_c i - u_c
        T_d du_c/dt = v - K (h e - i) - y - u_c,      K = a_c X_c/omega_n
        y = K_r s/(s^2 + omega_0^2) (h e - i),        K_r = K a_c/10
        de/dt = j (omega_0 + sqrt(2) omega_p Im(v e*)/U_0 + x) e,    dx/dt = omega_p^2 Im(v e*)/U_0
        du_f/dt = omega_p (Re(v e*) - u_f),           T_dc dz/dt = Re(u_c i*) - P_l
        h = h_0 lim(U_0/u_f P_l/P_l0 - a_dc T_dc z/P_c),       P_l = P_l0 (1 + gamma min(z, 0))

    It draws constant power at unity power factor until its current limit b (lim, the smaller of two
    with a rounded corner); then the dc link's voltage falls, and its inverters draw less.
    Everything below the switching frequency is its answer: to harmonics of the voltage, which the
    control rejects but for its delay, as to dips.

    Of a single-phase load the imaginary part of v is the phase's voltage a quarter of a cycle ago,
    which is how such a converter makes its second axis. Circuit and current control have real
    coefficients, so the phase's current is that of a single-phase circuit. The dc link is that
    behind its filter of twice the frequency: its ripple, and the third harmonic a controller makes
    of it, are not there. A filter capacitor is the effect `shunt_capacitor`.

    Not to be confused with the effects `constant_power_converter`, `voltage_dependent_power_limit`
    and `dc_link_lag`, what phasors show of such a converter, one thing at a time.

    Source: Harnefors, Bongiorno, Lundberg 2007 (input admittance of converters: current control,
    feed-forward, phase-locked loop); Teodorescu, Liserre, Rodriguez 2011, ch. 9
    (proportional-resonant control); Steimel 2008, ch. 9 (four-quadrant converters of traction).
    Departures: the delay of computation and modulation is a lag of first order; dc voltage by a
    proportional control with feed-forward of the inverters' power; limits with rounded corners.
    """

    resistance: float = 0.05  # of the transformer and choke, over their reactance
    weakening: float = 5.0  # gamma: how fast the inverters give way to a falling dc voltage

    P_c = Parameter(
        0.7,
        (0.05, 2.0),
        "pu",
        "the converter's power before the event",
        STEIMEL,
        "P_c",
        power_exponent=1,
    )
    X_c = Parameter(
        0.3,
        (0.05, 1.5),
        "pu",
        "reactance between line and converter on the record's base",
        STEIMEL,
        "X_c",
        power_exponent=-1,
    )
    current_bandwidth = Parameter(
        800.0, (100.0, 3000.0), "rad/s", "bandwidth of the current control", HARNEFORS, "a_c"
    )
    control_delay = Parameter(
        4e-4, (1e-4, 2e-3), "s", "lag of computation and modulation", HARNEFORS, "T_d"
    )
    pll_bandwidth = Parameter(
        60.0, (10.0, 400.0), "rad/s", "of the phase-locked loop", TEODORESCU, r"\omega_p"
    )
    dc_link = Parameter(
        0.02,
        (0.002, 0.2),
        "s",
        "energy of the dc link over the base power",
        STEIMEL,
        "T_{dc}",
        power_exponent=1,
    )
    dc_bandwidth = Parameter(
        50.0, (5.0, 300.0), "rad/s", "bandwidth of the dc voltage's control", STEIMEL, "a_{dc}"
    )
    current_limit = Parameter(
        1.5, (1.02, 4.0), "1", "largest current over that before the event", STEIMEL, "b"
    )

    within_a_cycle = True
    waves_only = (
        "phasors show a converter's power and none of its control; take model/static=constant_power"
        " with model.effects=[voltage_dependent_power_limit,dc_link_lag]"
    )

    def declare(
        self,
        eq,
        P_c,
        X_c,
        current_bandwidth,
        control_delay,
        pll_bandwidth,
        dc_link,
        dc_bandwidth,
        current_limit,
    ):
        from sympy import I

        V, turning = eq.V, I * (eq.omega_n + eq.omega_s)
        i, u_c = (
            eq.lag_vector("converter_current", "i_c"),
            eq.lag_vector("converter_voltage", "u_c"),
        )
        reference = self._reference(
            eq, V, u_c, i, P_c, pll_bandwidth, dc_link, dc_bandwidth, current_limit
        )

        K = eq.define("current_gain", current_bandwidth * X_c / eq.omega_n, "K")
        off = eq.define("current_error", reference - i, r"\varepsilon")
        y, swing = eq.lag_vector("resonance", "y"), eq.lag_vector("resonance_swing", "y'")
        Z = X_c * (self.resistance + turning / eq.omega_n)
        i_0 = P_c / eq.U0
        u_0 = eq.U0 - eq.evaluate_before(Z) * i_0
        y_0 = eq.U0 - u_0 * (1 + eq.evaluate_before(turning) * control_delay)
        eq.moves(i, eq.omega_n / X_c * (V - u_c - Z * i), i_0)
        eq.moves(u_c, (V - K * off - y - u_c) / control_delay - turning * u_c, u_0)
        eq.moves(y, K * current_bandwidth / 10 * off + I * turning * swing - turning * y, y_0)
        eq.moves(swing, -I * turning * y - turning * swing, -I * y_0)
        for size in (
            P_c,
            X_c,
            current_bandwidth,
            control_delay,
            pll_bandwidth,
            dc_link,
            current_limit - 1,
        ):
            eq.require(size, f"{size} must be positive and is {{value:g}}")
        return i

    def _reference(self, eq, V, u_c, i, P_c, pll_bandwidth, dc_link, dc_bandwidth, current_limit):
        """The current asked for: as large as power and dc link want it, turning with
        the voltage.
        """
        from sympy import I, conjugate, im, re, sqrt

        e, x = eq.lag_vector("locked", "e"), eq.lag("locked_speed", "x")
        u_f, z = eq.lag("voltage_measured", "u_f"), eq.lag("dc_voltage", "z")
        ahead = eq.define("angle_ahead", im(V * conjugate(e)) / eq.U0, r"\sin\varphi")
        eq.moves(e, I * (sqrt(2) * pll_bandwidth * ahead + x) * e, 1)
        eq.moves(x, pll_bandwidth**2 * ahead, 0)
        eq.moves(u_f, pll_bandwidth * (re(V * conjugate(e)) - u_f), eq.U0)

        i_0 = P_c / eq.U0
        wanted = P_c - self.resistance * eq["X_c"] * i_0**2
        eq.require(wanted, "the converter's resistance takes more than its power; lower P_c or X_c")
        low = (z - sqrt(z**2 + CORNER**2) + CORNER) / 2  # the smaller of z and 0, and 0 where z is
        load = eq.define("inverters", 1 + self.weakening * low, "P_l/P_{l0}")
        eq.moves(z, (re(u_c * conjugate(i)) - wanted * load) / dc_link, 0)
        reference = eq.define(
            "current_asked", eq.U0 / u_f * load - dc_bandwidth * dc_link * z / P_c, "h^*/h_0"
        )
        limited = lambda a: a + current_limit - sqrt((a - current_limit) ** 2 + CORNER**2)  # noqa: E731
        return eq.define("current_reference", i_0 * limited(reference) / limited(1) * e, "h e")
