"""Harmonic currents of the load's own, which go on through the event."""

import numpy as np

from tractexp.extend import INPUTS, Measurement, Parameter, plugin

HIGHEST, CYCLES = 13, 2
# of the current: fewer harmonics before the event leave less than a twentieth of the usual error
HEARD = 0.03


@plugin
class HarmonicsSource(Measurement):
    """What is periodic in the recorded currents before the event, and not in the calculated ones,
    goes on.

        i(t) -> i(t) + h r(theta(t)),
        r = periodic part of (recorded - calculated) before the event

    r has harmonics up to the 13th of either sequence, found by least squares in the first two
    recorded cycles and there left alone, since it would fit their noise, too; theta is the angle of
    the frame. Rectifiers draw such currents; h = 1: they go on as they were. At h = 0 the base
    model.

    Source: Arrillaga, Watson 2003, Power System Harmonics: converters as sources of current.
    Departures: a converter's harmonics follow its current and voltage; here they do not change with
    the event.
    """

    harmonics = Parameter(
        0.0, (-0.5, 1.5), "1", "share that goes on", "Arrillaga, Watson 2003", "h", null=0.0
    )

    places, kind = ("bus",), "oscillation"
    waves_only = "phasors have no harmonics"
    relevant = {"harmonics": 0.2}
    confused_with = ("transformer_saturation",)

    def describe_sign(self, event):
        periodic = np.sqrt(max(event.levels[0] ** 2 - event.random[0] ** 2, 0.0) * 2)
        share = periodic * event.U0 / np.hypot(event.P0, event.Q0)
        return (
            f"harmonics and unbalance of {share:.1%} of the current before the dip"
            if share > HEARD
            else ""
        )

    def observe(self, power, drive, values):
        out = power.copy()
        for e in range(drive.events):
            part = drive.part(e)
            rows = dict(zip(INPUTS, drive.inputs[:, part], strict=True))
            angle = np.unwrap(np.arctan2(rows["turn_im"], rows["turn_re"]))
            recorded = drive.weights[:, part].any(axis=0)
            first = int(np.argmax(recorded))
            last = first + int(np.searchsorted(angle[first:] - angle[first], 2 * np.pi * CYCLES))
            basis = self._basis(angle)
            inverse = np.linalg.pinv(basis[first:last])  # (2 H + 1, W)
            basis[:last] = 0.0
            compared = drive.weights[:, part].any(axis=1)
            residual = drive.measurements[compared, None, part.start + first : part.start + last]
            residual = residual - power[compared, :, part.start + first : part.start + last]
            out[compared, :, part] += values["harmonics"][e][:, None] * (
                residual @ inverse.T @ basis.T
            )
        return out

    @staticmethod
    def _basis(angle):
        """(N, 2 H + 1): one, then cosine and sine of each harmonic."""
        several = np.outer(angle, np.arange(1, HIGHEST + 1))
        return np.concatenate([np.ones((len(angle), 1)), np.cos(several), np.sin(several)], axis=1)
