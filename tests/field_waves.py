"""Waveforms of feeders, made by the tests of what a recording says."""

import numpy as np

from tractexp.recording import Channel, Recording, Segment

A = np.exp(2j * np.pi / 3)
KV, KA = 110 / np.sqrt(3), 0.2  # phase to ground, and of the load


def phases(one, two=0.0, zero=0.0):
    """Phasors (3, N) of phases a, b, c from sequence components (N,)."""
    one, two, zero = np.broadcast_arrays(*(np.asarray(x, dtype=complex) for x in (one, two, zero)))
    return np.array([zero + one + two, zero + A**2 * one + A * two, zero + A * one + A**2 * two])


def load(one, two=0.0, lag=np.pi / 6, exponent=2.0, two_lag=1.2, two_size=3.0):
    """Currents (3, N) of a load of 0.2 kA: |P| and |Q| go as U^exponent, and I2 is that of its
    motors.
    """
    u = np.maximum(np.abs(one) / KV, 1e-9)
    first = KA * u ** (exponent - 1) * np.exp(1j * (np.angle(one) - lag))
    second = two_size * KA * np.asarray(two) / KV * np.exp(-1j * two_lag)
    return phases(first, second)


def wave(t, phasors, f=50.0):
    """Waveforms (K, N) of RMS phasors (K, N)."""
    return np.sqrt(2) * (phasors * np.exp(2j * np.pi * f * t)).real


def recording(
    waves,
    rate=3200.0,
    names=None,
    units=None,
    labels=None,
    frequency=50.0,
    source="made.cfg",
    **more,
):
    """A recording of waveforms (K, N) in kV and kA."""
    K = len(waves)
    names = names or ["Ua", "Ub", "Uc", "Ia", "Ib", "Ic"][:K]
    units = units or [
        "kV" if name.lower().lstrip("0123456789-_f ")[:1] in "uv" else "kA" for name in names
    ]
    quantity = {"kV": "voltage", "kA": "current"}
    channels = [
        Channel(name, np.asarray(x, dtype=float), unit, quantity.get(unit, ""), phase)
        for name, x, unit, phase in zip(names, waves, units, labels or [""] * K, strict=True)
    ]
    n = np.asarray(waves).shape[1]
    return Recording(source, channels, (Segment(0, n, rate, 0.0),), frequency, **more)


def dip(t, start=0.4, end=0.6, depth=0.4):
    """Positive-sequence voltage [kV] of a dip."""
    return KV * np.where((t >= start) & (t < end), 1 - depth, 1.0)


def noise(shape, share=0.002, seed=0):
    return share * np.random.default_rng(seed).standard_normal(shape)
