"""Path of the zero sequence to earth."""

import numpy as np

from tractexp.extend import Effect, Parameter, plugin

SOURCE = (
    "Kundur 1994, section 3.4 (sequence networks of transformers); IEC 60909-0, zero-sequence"
    " impedances"
)


@plugin
class ZeroSequencePath(Effect):
    """The zero sequence of the voltage drives a current through an earthed neutral: R_0 + j X_0 to
    earth.

        dpsi_0/dt = omega_n (v_0 - r_0 psi_0),   i_0 -> i_0 + b_0 psi_0,   b_0 = 1/X_0,
        r_0 = R_0/X_0

    The flux linkage psi_0 is a state: an offset that a fault leaves in it decays with 1/(omega_n
    r_0). A transformer that is earthed on this side with a delta winding has X_0 near its leakage.
    At b_0 = 0 the base model, whatever r_0.

    Source: Kundur 1994, section 3.4; IEC 60909-0.
    Departures: none.
    """

    zero_susceptance = Parameter(
        0.0,
        (0.0, 100.0),
        "pu",
        "1/X_0 on the record's base",
        SOURCE,
        "b_0",
        null=0.0,
        power_exponent=1,
    )
    zero_resistance = Parameter(0.05, (0.003, 3.0), "1", "R_0/X_0", SOURCE, "r_0")

    places, kind = ("bus",), "law"
    waves_only = "phasors of the positive sequence show nothing of the zero sequence"
    reads = ("I0",)
    grid = {"zero_resistance": (0.02, 0.1, 0.5)}
    relevant = {"zero_susceptance": 0.1}

    def describe_sign(self, event):
        if not event.compared_channels[2]:
            return ""
        dip = slice(event.start, event.end)
        drawn, before = (
            np.sqrt(2 * np.mean(event.currents[2, dip] ** 2)),
            np.hypot(event.P0, event.Q0) / event.U0,
        )
        driven = np.abs(event.v_zero[dip]).max() / event.U0
        return (
            f"zero sequence, {driven:.0%} of the voltage in the dip, drives {drawn / before:.2g}"
            " times the current"
        )

    def edit(self, eq, zero_susceptance, zero_resistance):
        psi = eq.lag("zero_flux", r"\psi_0")
        eq.moves(psi, eq.omega_n * (eq.v_zero - zero_resistance * psi), 0)
        eq.draw(0, zero_susceptance * psi)
