"""Events in waveforms, made by the tests from a voltage's space vector."""

import numpy as np

from tractexp.model.drive import WaveformDrive

OMEGA = 2 * np.pi * 50.0


def event(
    u,
    u_zero=None,
    rate=5000.0,
    length=0.5,
    f0=50.0,
    angle=0.0,
    U0=1.0,
    P0=1.0,
    Q0=0.6,
    omega_n=OMEGA,
):
    """The voltage u(t) [pu] in the stationary frame, sampled; the cycle before t = 0 is U0 exp(j 2
    pi f0 t).

    All of it is turned by `angle` [rad]. u_zero(t) is its zero sequence. Every current is compared
    with 0.
    """
    t = np.arange(round((length + 1 / f0) * rate) + 1) / rate - 1 / f0
    turn = np.exp(2j * np.pi * f0 * t)
    v = np.where(t < 0, U0 * turn, u(t)) / turn
    turn = turn * np.exp(1j * angle)
    zero = np.zeros(len(t)) if u_zero is None else np.where(t < 0, 0.0, u_zero(t))
    return WaveformDrive(
        step=1 / rate,
        v=v,
        v_zero=zero,
        turn=turn,
        currents=np.zeros((3, len(t))),
        U=_slow(v, rate, f0),
        U2=_slow(np.conj(v * turn) / turn, rate, f0),
        U0=U0,
        P0=P0,
        Q0=Q0,
        omega_s0=2 * np.pi * f0 - omega_n,
        omega_n=omega_n,
    )


def times(made):
    """The samples' times (N,) [s] of an event, 0 where it begins."""
    return np.arange(len(made.v)) * made.step - 2 * np.pi / (made.omega_s0 + made.omega_n)


def smooth(x):
    """A step from 0 to 1 whose slope is smooth."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(x, 0, 1))


def dip(depth=0.4, jump=0.0, negative=0.0, end=0.1, edge=0.004, f0=50.0, U0=1.0):
    """A dip of the positive sequence with a jump of its angle [rad], and a negative sequence as
    long as it lasts.
    """

    def u(t):
        there = smooth(t / edge) - smooth((t - end) / edge)
        turn = np.exp(2j * np.pi * f0 * t)
        return U0 * (1 - depth * there) * np.exp(
            1j * jump * there
        ) * turn + negative * there * np.conj(turn)

    return u


def vector(response, lane=0):
    """The space vector (N,) of calculated currents in the stationary frame."""
    return response.outputs[0, lane] + 1j * response.outputs[1, lane]


def _slow(v, rate, f0):
    """|mean over the last half cycle|, as `record.wave_event` takes it."""
    n = max(1, round(rate / f0 / 2))
    total = np.cumsum(np.concatenate([np.full(n, v[:n].mean()), v]))
    return np.abs((total[n:] - total[:-n]) / n)
