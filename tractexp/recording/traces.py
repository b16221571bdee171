"""What is drawn of sampled waveforms beside phasors: their RMS by the rule of power quality, and their spectrum."""

import numpy as np


def half_cycle_rms(waves: np.ndarray, rate: float, frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """RMS over one cycle, taken anew each half cycle (IEC 61000-4-30, U_rms(1/2)) of waves (K, N).

    Returns the times of the windows' centers (M,) [s] from the first sample on and the values (K, M).
    """
    n = waves.shape[-1]
    cycle = rate / frequency  # samples, not whole
    starts = np.arange(0.0, n - cycle + 1e-9, cycle / 2)
    total = np.concatenate([np.zeros((*waves.shape[:-1], 1)), np.cumsum(np.square(waves), axis=-1)], axis=-1)
    at = np.arange(n + 1)
    between = np.array([np.interp(starts + cycle, at, row) - np.interp(starts, at, row) for row in total])
    return (starts + (cycle - 1) / 2) / rate, np.sqrt(np.maximum(between, 0.0) / cycle)


def spectrum(wave: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (M,) [Hz] and RMS values (M,) of a wave (N,), by a Hann window (a sinusoid is right at its peak)."""
    window = np.hanning(len(wave) + 1)[:-1]
    made = np.fft.rfft((wave - wave.mean()) * window)
    return np.fft.rfftfreq(len(wave), 1 / rate), np.sqrt(2) * np.abs(made) / window.sum()
