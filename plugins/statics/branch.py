"""Static load of a conductance beside a branch of resistance and reactance."""

from tractexp.extend import Parameter, Static, plugin

SOURCE = "Kundur 1994, Power System Stability and Control, section 7.1.1"


@plugin
class Branch(Static):
    r"""Static load of fixed elements: a conductance G beside a resistance and a reactance in
    series.

        P_s = P_s0 (U/U_0)^2        Q_s = Q_s0 (U/U_0)^2

    In phasors it is `constant_impedance`. In waveforms the branch's flux linkage psi [pu] is a
    state, so that an offset that a dip leaves in it decays, and negative sequence and harmonics see
    what they would see of it:

        dpsi/dt = omega_n (v - (r + j omega/omega_n) psi),   i_s = G v + B psi,
        B = Q_s0 (1 + r^2)/U_0^2

    with r its resistance over its reactance and G what P_s0 needs beside the branch. A load that is
    capacitive before the event gets a negative B; its capacitor is the effect `shunt_capacitor`.

    Not to be confused with `constant_impedance`, whose branch has r = 0.05 and nothing to identify.

    Source: Kundur 1994, section 7.1.1, for constant impedances; the circuit's differential
    equation.
    Departures: none.
    """

    branch_resistance = Parameter(
        0.3, (0.01, 3.0), "1", "resistance of the branch over its reactance", SOURCE, "r"
    )

    def law(self, u, branch_resistance):
        return u**2, u**2

    def compute_damping(self, branch_resistance):
        return branch_resistance
