"""Load that drifts by itself during the record."""

import numpy as np

from tractexp.extend import INPUTS, Measurement, Parameter, plugin

SOURCE = "ordinary change of load; rates of feeders and trains stay below some percent a second"


@plugin
class LoadChange(Measurement):
    """The load changes by itself while the event is recorded, for trains accelerate and others come
    and go.

        P -> P (1 + d_P t),   Q -> Q (1 + d_Q t),   t since the first sample of the event

    In waveforms the currents change so, their parts in phase with the voltage before the event by
    d_P, those across it by d_Q, and the zero sequence not at all. At d_P = d_Q = 0 the base model.

    Source: a straight line is the first term of any slow change.
    Departures: none.
    """

    drift_P = Parameter(
        0.0, (-0.05, 0.05), "1/s", "relative change of P per second", SOURCE, "d_P", null=0.0
    )
    drift_Q = Parameter(
        0.0, (-0.05, 0.05), "1/s", "relative change of Q per second", SOURCE, "d_Q", null=0.0
    )

    places, kind = ("bus",), "drift"
    relevant = {"drift_P": 0.003, "drift_Q": 0.003}
    confused_with = ("exponential_recovery", "undervoltage_trip", "frequency_dependence")

    def observe(self, power, drive, values):
        from ._recorder import add_drift

        rate = np.stack([values["drift_P"], values["drift_Q"]], axis=1)
        if not drive.of_waves:
            add_drift(power, drive, rate)
            return power
        for e in range(drive.events):
            part = drive.part(e)
            rows, drawn = dict(zip(INPUTS, drive.inputs[:, part], strict=True)), power[:, :, part]
            turn = rows["turn_re"] + 1j * rows["turn_im"]
            rotating = (drawn[0] + 1j * drawn[1]) * np.conj(turn)
            P, Q = rate[e, :, :, None] * rows["t"]
            rotating = turn * (rotating + P * rotating.real + 1j * Q * rotating.imag)
            drawn[0], drawn[1] = rotating.real, rotating.imag
        return power
