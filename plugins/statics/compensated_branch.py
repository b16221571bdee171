"""Static load without a negative element: a conductance, an inductive branch and a capacitor."""

from tractexp.extend import Parameter, Static, plugin

SOURCE = "Kundur 1994, Power System Stability and Control, section 7.1.1"


@plugin
class CompensatedBranch(Static):
    r"""Static load of elements none of which is negative: a conductance G, a resistance and a
    reactance in series, and a capacitor that supplies what their reactive power is over.

        P_s = P_s0 (U/U_0)^2        Q_s = Q_s0 (U/U_0)^2

    In phasors it is `constant_impedance`. In waveforms the branch draws the share a of P_s0 and
    Q_L with it, the conductance the rest, and the capacitor makes up the balance of Q before the
    event:

        Q_L = max(a P_s0/r, Q_s0),   Q_C = Q_L - Q_s0,   b = Q_C/U_0^2
        dpsi/dt = omega_n (v - (r + j omega/omega_n) psi)
        i_s = G v + B psi + b (dv/dt/omega_n + j omega/omega_n v)

    with B and G as of `branch`. So the capacitor is not identified: a load that supplies reactive
    power has one that its Q_0 tells. Parameters for which P_s0 or G would be negative have no
    steady state.

    Not to be confused with `branch`, whose B is negative where the load supplies reactive power.

    Source: Kundur 1994, section 7.1.1, for constant impedances; the circuit's differential
    equation.
    Departures: none.
    """

    branch_resistance = Parameter(
        0.5, (0.05, 10.0), "1", "resistance of the branch over its reactance", SOURCE, "r"
    )
    branch_share = Parameter(0.3, (0.02, 1.0), "1", "share of the branch in P_s0", SOURCE, "a_L")

    def law(self, u, branch_resistance, branch_share):
        return u**2, u**2

    def compute_damping(self, branch_resistance):
        return branch_resistance

    def compute_compensation(self, branch_resistance, branch_share, P_s0, Q_s0):
        from sympy import Max

        return Max(0, branch_share * P_s0 / branch_resistance - Q_s0)

    def require(self, branch_resistance, branch_share, P_s0, Q_s0):
        yield P_s0, "the static load would generate {value:.3g} pu; lower T_m or R_s"
        sentence = (
            "the branch of the static load would draw more active power than there is, {value:.3g}"
            " pu; lower branch_resistance"
        )
        yield P_s0 - branch_resistance * Q_s0, sentence, branch_resistance * Q_s0
