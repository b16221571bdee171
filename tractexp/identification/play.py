"""A voltage that no record holds played through a model: the power it draws."""

from collections.abc import Mapping

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.problem import excited
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import Model
from tractexp.record.synthetic import synthetic_event

FINEST = 64  # samples per cycle at least, of a voltage that is played in waveforms


def play(
    model: Model, values: np.ndarray, t: np.ndarray, U: np.ndarray, before: Mapping[str, float],
    omega_s: np.ndarray | None = None, omega_s0: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """P and Q (N,) [pu] that a load draws from a voltage U (N,) [pu] at uniform times t (N,) [s].

    `before` has U0, P0, Q0 [pu] and the nominal `frequency` [Hz]; omega_s (N,) [rad/s] is the synchronous speed
    relative to it, `omega_s0` that before. In waveforms the voltage is balanced, its phase turning as omega_s says, and
    the power is instantaneous: that of three phases, with the oscillation of decaying offsets. Raises `UserError` where
    there is no steady state.
    """
    if model.waves:
        return _in_waveforms(model, values, t, U, before, omega_s, omega_s0)
    unknown = np.full(len(U), np.nan)
    event = Excitation(
        step=float((t[-1] - t[0]) / (len(t) - 1)), U=U, P=unknown, Q=unknown, U0=before["U0"], P0=before["P0"],
        Q0=before["Q0"], omega_s=omega_s, omega_s0=omega_s0, omega_n=2 * np.pi * before["frequency"],
    )  # fmt: skip
    made = _simulated(model, values, Drive.of([event]))
    return made[0], made[1]


def _in_waveforms(
    model: Model, values: np.ndarray, t: np.ndarray, U: np.ndarray, before: Mapping[str, float],
    omega_s: np.ndarray | None, omega_s0: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """As `play`; between its samples the voltage is a straight line."""
    nominal, every = before["frequency"], max(1, int(np.ceil((t[1] - t[0]) * before["frequency"] * FINEST)))
    fine = np.linspace(t[0], t[-1], every * (len(t) - 1) + 1)
    v = np.interp(fine, t, U).astype(complex)
    if omega_s is not None:
        speed = np.interp(fine, t, omega_s) - omega_s0
        v *= np.exp(1j * np.cumsum(np.concatenate([[0.0], (speed[1:] + speed[:-1]) / 2 * np.diff(fine)])))
    known = before["U0"], before["P0"], before["Q0"]
    event = synthetic_event("played", fine, v, known, nominal + omega_s0 / (2 * np.pi), 1, len(fine) - 1)
    i = _simulated(model, values, Drive.of([excited(event, model)]))
    power = (v * np.conj((i[0] + 1j * i[1]) / event.turn))[::every]
    return power.real, power.imag


def _simulated(model: Model, values: np.ndarray, drive: Drive) -> np.ndarray:
    """What is compared (C, N)."""
    if refusal := model.refusal(values, drive):
        raise UserError(refusal)
    return model.simulate(drive, values, model.substeps(drive, values)[0]).outputs[:, 0]
