"""Load that drifts by itself during the record."""

import numpy as np

from tractexp.extend import Measurement, Parameter, plugin
from tractexp.model.drive import INPUTS

SOURCE = "ordinary change of load; rates of feeders and trains stay below some percent a second"


@plugin
class LoadDrift(Measurement):
    """The load changes by itself while the event is recorded, for trains accelerate and others come and go.

        P -> P (1 + d_P t),   Q -> Q (1 + d_Q t),   t since the first sample of the event

    In waveforms the currents change so, their parts in phase with the voltage before the event by d_P, those across it
    by d_Q, and the zero sequence not at all. At d_P = d_Q = 0 the base model.

    Source: a straight line is the first term of any slow change.
    Departures: none.
    """

    drift_P = Parameter(0.0, (-0.05, 0.05), "1/s", "relative change of P per second", SOURCE, "d_P", null=0.0)
    drift_Q = Parameter(0.0, (-0.05, 0.05), "1/s", "relative change of Q per second", SOURCE, "d_Q", null=0.0)

    places, kind = ("bus",), "drift"
    relevant = {"drift_P": 0.003, "drift_Q": 0.003}
    confused_with = ("exponential_recovery", "undervoltage_trip", "frequency_dependence")

    def observe(self, power, drive, values):
        out = power.copy()
        for e in range(drive.events):
            part = drive.part(e)
            rows = dict(zip(INPUTS, drive.inputs[:, part], strict=False))
            drift = (values[name][e][:, None] * rows["t"] for name in ("drift_P", "drift_Q"))
            if "turn_re" not in rows:
                for channel, more in zip(out, drift, strict=True):
                    channel[:, part] *= 1 + more
                continue
            turn = rows["turn_re"] + 1j * rows["turn_im"]
            seen = (out[0, :, part] + 1j * out[1, :, part]) * np.conj(turn)
            along, across = drift
            seen = turn * (seen + along * seen.real + 1j * across * seen.imag)
            out[0, :, part], out[1, :, part] = seen.real, seen.imag
        return out
