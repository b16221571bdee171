"""Recordings that tests write themselves: waveforms of a load, as a recorder at its bus would keep
them.
"""

from datetime import datetime

import numpy as np

import tractexp
from tractexp.recording import Channel, Recording, Segment

RATE = 3200.0  # Hz
BASE = (110.0, 50.0)  # kV line to line, MVA
LOAD = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55, "p_v": 1.4, "q_v": 3.0}


def waves(t, U, P, Q, f=50.0):
    """(6, N) kV and kA of a balanced load; U (N,), P and Q are per unit of `BASE`."""
    V = BASE[0] / np.sqrt(3) * np.asarray(U, dtype=complex)
    I = np.conj(BASE[1] * (np.asarray(P) + 1j * np.asarray(Q)) / (3 * V))
    turn = np.exp(1j * (2 * np.pi * f * t - 2 * np.pi / 3 * np.arange(3)[:, None]))
    return np.sqrt(2) * np.concatenate([V * turn, I * turn]).real


def recording(values, names=("UA", "UB", "UC", "IA", "IB", "IC"), rate=RATE, **more):
    """Channels (6 or more, N) [kV, kA] in 16 bits; the first three are voltages, unless their names
    begin with I.
    """
    channels = []
    for name, row in zip(names, values, strict=True):
        gain = max(float(np.abs(row).max()), 1e-9) / 32000
        volts = "I" not in name
        channels.append(
            Channel(
                name,
                np.round(row / gain).astype(np.int16),
                "kV" if volts else "kA",
                "voltage" if volts else "current",
                name[-1],
                gain=gain,
            )
        )
    segment = Segment(0, values.shape[1], rate, 0.0)
    told = {"station": "North", "start": datetime(2026, 3, 1, 10, 0, 0), "frequency": 50.0, **more}
    return Recording("", channels, [segment], **told)


def motor_dip(depth, duration=0.2, seed=0, noise=1e-3, length=2.0):
    """(6, N) waveforms of a motor and a static load that see a dip after 0.5 s, with noise of the
    channels.
    """
    made = tractexp.simulate(
        tractexp.compose(), LOAD, depth=depth, duration=duration, rate=RATE, length=length
    )
    r = made.responses[0]
    values = waves(r.t - r.t[0], r.U, r.P, r.Q)
    return values + noise * np.abs(values).max(axis=1, keepdims=True) * np.random.default_rng(
        seed
    ).standard_normal(values.shape)


def constant(depth=0.4, start=0.5, end=0.7, length=1.0, power=0.8 + 0.3j):
    """(6, N) waveforms of a constant impedance that sees a rectangular dip."""
    t = np.arange(round(length * RATE)) / RATE
    U = np.where((t >= start) & (t < end), 1 - depth, 1.0)
    return waves(t, U, power.real * U**2, power.imag * U**2)
