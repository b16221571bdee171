"""Resistance and inductance in series within the static load, whose current has a state."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "Kundur 1994, Power System Stability and Control, section 7.1.1"
EMPTY_VOLTAGE = 0.05  # pu: below it the branch rests at no more current


@plugin
class InductiveStaticLoad(Effect):
    r"""A share of the static active power is drawn by resistance and inductance in series, whose
    current follows the voltage late and swings at supply frequency.

        L di/dt = v - R i - j (omega_n + omega_s) L i,     T_L = L/R

    By the share s_L, the voltage u = U/U_0, and P_s0 + y, which is the current before the event at
    its phase then and y what has changed of it:

        dy/dt = a_0 P_s/u - (1/T_L + j (omega_n + omega_s)) (P_s0 + y),
        a_0 = 1/T_L + j (omega_n + omega_s0)
        P_s + j Q_s -> P_s + j Q_s + s_L T_L a_0 (u conj(P_s0 + y) - P_s)

    At an exponent of 2, P_s/u is P_s0 u and this is the branch itself. At any other it rests, at
    the frequency before the event, at what the static load draws, so that no steady state tells of
    the effect. The branch's Q over its P before the event is (omega_n + omega_s0) T_L; what else
    the static load draws of Q follows at once. A step of the voltage leaves an offset of the
    current, which turns backwards in the frame of the voltage and dies within T_L. At s_L = 0, and
    at T_L -> 0, the base model.

    Phasors averaged over a cycle show of it what is slower: a lag of 1/a_0, of P and of Q.

    Not to be confused with `time_skew`, which shifts all power, nor with `dc_link_lag`, which has
    no Q and lasts longer.

    Source: Kundur 1994, section 7.1.1, for constant impedances; the circuit's differential
    equation.
    Departures: the branch's resistance follows the static law where its exponent is not 2; below
    5 % of the voltage before its current grows no further; behind a feeder its frame is that of the
    bus.
    """

    inductive_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_L", null=0.0
    )
    inductive_time = Parameter(
        0.002, (0.0005, 0.03), "s", "inductance over resistance", SOURCE, "T_L"
    )

    places, kind = ("static P", "static Q"), "lag"
    phasors_only = "in waveforms it is the static load 'branch'"
    grid = {"inductive_time": (0.001, 0.003, 0.01)}
    relevant = {"inductive_share": 0.1}
    confused_with = ("time_skew", "feeder_impedance", "dc_link_lag", "stator_transients")

    def edit(self, eq, inductive_share, inductive_time):
        import sympy
        from sympy import I, im, re

        u, P_s = eq[sites.static_voltage], eq.expression(sites.P_static)
        more = eq.lag_vector("inductive_current", "y")
        turn_0 = eq.omega_n + eq.omega_s0
        pole_0 = 1 / inductive_time + I * turn_0
        pole = 1 / inductive_time + I * (eq.omega_n + eq.omega_s)
        at_rest = P_s / sympy.Max(u, EMPTY_VOLTAGE)
        eq.moves(more, pole_0 * at_rest - pole * (eq.P_s0 + more), 0)
        # s_L T_L a_0 (u conj(P_s0 + y) - P_s) by its parts: the power of a voltage is real
        in_phase = u * (eq.P_s0 + re(more)) - P_s
        across = u * im(more)
        reactance = inductive_time * turn_0
        eq.edit(sites.P_static, lambda P: P + inductive_share * (in_phase + reactance * across))
        eq.edit(sites.Q_static, lambda Q: Q + inductive_share * (reactance * in_phase - across))
