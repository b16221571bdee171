"""The events that contracts play: smooth dips with sagging frequency and an unbalance, steady
voltage; and in waves.
"""

from dataclasses import replace

import numpy as np

from tractexp.model.drive import WAVES, Drive, Excitation, WaveformDrive

P0, Q0 = 1.0, 0.6  # pu, drawn before every event


def dip(
    depth: float = 0.5, step: float = 1e-3, length: float = 0.6, edge: float = 0.02, at: float = 0.1
) -> Excitation:
    """A dip to 1 - `depth` pu for 0.15 s whose edges are halves of a cosine, `length` s long."""
    t = np.arange(round(length / step) + 1) * step
    rise = lambda begin: 0.5 - 0.5 * np.cos(np.pi * np.clip((t - begin) / edge, 0, 1))  # noqa: E731
    shape = rise(at) - rise(at + 0.15)
    return _event(1 - depth * shape, step, -3.0 * shape, 0.02 + 0.3 * depth * shape)


def flat(voltage: float = 0.97, speed: float = -1.5, samples: int = 300) -> Excitation:
    """A voltage [pu] and a synchronous speed [rad/s, relative to nominal] that do not move."""
    return _event(np.full(samples, voltage), 1e-3, np.full(samples, speed), np.full(samples, 0.03))


def wave_dip(
    depth: float = 0.5, rate: float = 3200.0, length: float = 0.28, edge: float = 0.002
) -> WaveformDrive:
    """Space vectors of a dip to 1 - `depth` pu for 50 ms, unbalanced, with a jump of the angle and
    a zero sequence.
    """
    t = np.arange(round(length * rate)) / rate
    rise = lambda begin: 0.5 - 0.5 * np.cos(np.pi * np.clip((t - begin) / edge, 0, 1))  # noqa: E731
    shape = depth * (rise(0.12) - rise(0.17))
    theta = (100 * np.pi - 1.5) * t
    v = 1 - shape * np.exp(0.2j) - 0.5 * shape * np.exp(0.5j - 2j * theta)
    return _waves(v, 0.1 * shape * np.cos(theta + 1.0), theta, rate)


def wave_flat(voltage: float = 0.97, rate: float = 3200.0, samples: int = 640) -> WaveformDrive:
    """A space vector that turns at one size and speed."""
    t = np.arange(samples) / rate
    return _waves(np.full(samples, voltage + 0j), np.zeros(samples), (100 * np.pi - 1.5) * t, rate)


def drive(*depths: float, domain: str = "", power: float = 1.0) -> Drive:
    """Dips of these depths, end to end; `power` is how many times P0 and Q0 are drawn
    before each.
    """
    shape = wave_dip if domain == WAVES else dip
    return Drive.from_events(
        [replace(one, P0=power * P0, Q0=power * Q0) for one in map(shape, depths)]
    )


def _waves(v: np.ndarray, v_zero: np.ndarray, theta: np.ndarray, rate: float) -> WaveformDrive:
    """A drive of sampled voltages (N,) that turn by theta (N,) [rad], at the power that tests
    share.
    """
    turn, n = np.exp(1j * theta), round(rate / 100)
    slow = np.convolve(np.concatenate([np.full(n - 1, v[0]), v]), np.full(n, 1 / n), "valid")
    U0, still = abs(v[0]), np.zeros((3, len(v)))
    return WaveformDrive(
        1 / rate, v, v_zero, turn, still, abs(slow), abs(v) - U0, U0, P0, Q0, -1.5, 100 * np.pi
    )


def _event(U: np.ndarray, step: float, speed: np.ndarray, U2: np.ndarray) -> Excitation:
    """A drive of phasors at the power that tests share."""
    P, Q = np.full(len(U), P0), np.full(len(U), Q0)
    return Excitation(step, U, P, Q, U[0], P0, Q0, speed, speed[0], U2=U2, U20=U2[0])
