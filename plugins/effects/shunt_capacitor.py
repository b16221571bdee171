"""Shunt capacitor bank."""

import numpy as np

from tractexp.extend import Effect, Parameter, plugin

SOURCE = "WECC composite load model (Bss, Bfdr)"
SUPPLIED = 0.05  # of the apparent power: what no motor and no reactance would supply


@plugin
class ShuntCapacitor(Effect):
    """A capacitor bank at the bus, whose reactive power falls with the square of the voltage.

        Q -> Q - b U^2 (omega_s + omega_n)/omega_n
        i -> i + b (dv/dt/omega_n + j (omega_s + omega_n)/omega_n v)      in waveforms

    Q_0 includes the bank, so the static load has b U_0^2 more. At b = 0 the base model. An exponent
    q_v near 2 hides it in phasors: without a switching of the bank or a change of frequency it is
    hardly seen. In waveforms every edge and every harmonic of the voltage shows it.

    Source: WECC composite load model specification (Bss, Bfdr).
    Departures: none.
    """

    capacitor = Parameter(
        0.0,
        (0.0, 1.0),
        "pu",
        "susceptance on the record's base",
        SOURCE,
        "b",
        null=0.0,
        power_exponent=1,
    )
    places, kind = ("bus",), "law"
    relevant = {"capacitor": 0.05}
    confused_with = ("static_var_compensator", "negative_sequence_braking")

    def describe_sign(self, event):
        supplied = -event.Q0 / np.hypot(event.P0, event.Q0)
        return (
            f"the load supplies Q, {supplied:.0%} of S, before the dip"
            if supplied > SUPPLIED
            else ""
        )

    def refusal(self, eq):
        return "its static load has a capacitor already" if "compensation" in eq else None

    def edit(self, eq, capacitor):
        eq.draw(eq.capacitor(capacitor))
