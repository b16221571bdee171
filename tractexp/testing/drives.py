"""The events that contracts play: smooth dips with a sagging frequency and an unbalance, and steady voltage."""

import numpy as np

from tractexp.model.drive import Drive, Excitation

P0, Q0 = 1.0, 0.6  # pu, drawn before every event


def dip(depth: float = 0.5, step: float = 1e-3, length: float = 0.6, edge: float = 0.02, at: float = 0.1) -> Excitation:
    """A dip to 1 - `depth` pu for 0.15 s whose edges are halves of a cosine, `length` s long."""
    t = np.arange(round(length / step) + 1) * step
    rise = lambda begin: 0.5 - 0.5 * np.cos(np.pi * np.clip((t - begin) / edge, 0, 1))  # noqa: E731
    shape = rise(at) - rise(at + 0.15)
    return _event(1 - depth * shape, step, -3.0 * shape, 0.02 + 0.3 * depth * shape)


def flat(voltage: float = 0.97, speed: float = -1.5, samples: int = 300) -> Excitation:
    """A voltage [pu] and a synchronous speed [rad/s, relative to nominal] that do not move."""
    return _event(np.full(samples, voltage), 1e-3, np.full(samples, speed), np.full(samples, 0.03))


def drive(*depths: float) -> Drive:
    """Dips of these depths, end to end."""
    return Drive.of([dip(depth) for depth in depths])


def _event(U: np.ndarray, step: float, speed: np.ndarray, U2: np.ndarray) -> Excitation:
    P, Q = np.full(len(U), P0), np.full(len(U), Q0)
    return Excitation(step, U, P, Q, U[0], P0, Q0, speed, speed[0], U2=U2, U20=U2[0])
