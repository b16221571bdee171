"""The recorder's side of waveforms: current transformers, anti-alias filter, offsets, noise,
quantization.
"""

from dataclasses import dataclass

import numpy as np

from independent.circuit import Instants
from independent.source import OMEGA


@dataclass(frozen=True)
class CurrentTransformer:
    """A core that saturates at the flux `knee` [pu of what 1 pu of current needs at nominal
    frequency].

    The burden is resistive; beyond the knee the excess of flux is not passed on.
    """

    knee: float
    leak: float = 0.3  # 1/s, by which the flux decays

    def passed(self, current: np.ndarray, step: float) -> np.ndarray:
        """The secondary current (3, n) of primary ones [pu]."""
        flux, seen = np.zeros(3), np.empty_like(current)
        for k in range(current.shape[1]):
            flux = flux * (1 - self.leak * step) + OMEGA * step * current[:, k]
            over = np.sign(flux) * np.maximum(np.abs(flux) - self.knee, 0.0)
            seen[:, k] = current[:, k] - over / (OMEGA * step)
            flux = flux - over
        return seen


@dataclass(frozen=True)
class Sampler:
    """Six channels at `rate` [Hz]; noise is a standard deviation, offsets are of the peak, spans
    plus and minus.
    """

    rate: float
    noise: float = 0.0  # of a channel's rms before the event
    offsets: tuple[float, ...] = (0.0,) * 6  # pu
    bits: int | None = None
    voltage_span: float = 2.0  # pu
    current_span: float = 20.0  # pu
    cutoff: float | None = 0.4  # of the rate; of the anti-alias filter, Butterworth of second order
    transformer: CurrentTransformer | None = None
    finer: int = 12  # instants that are calculated between samples

    def instants(self, start: float, length: float) -> np.ndarray:
        """Times [s] at which waveforms are wanted, so that samples begin at `start`."""
        early = round(0.03 * self.rate) * self.finer  # in which the filter settles
        return start + np.arange(-early, round(length * self.rate) * self.finer) / (
            self.rate * self.finer
        )

    def read(self, made: Instants, start: float, rng: np.random.Generator) -> np.ndarray:
        """Samples (6, n) [pu] of waveforms at `instants`: three voltages to ground,
        three currents.
        """
        turn = np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]
        voltage = (made.voltage * turn).real + made.voltage_zero
        current = (made.current * turn).real + made.current_zero
        if self.transformer:
            current = self.transformer.passed(current, float(made.t[1] - made.t[0]))
        seen = self._filtered(np.concatenate([voltage, current]))
        first = round((start - made.t[0]) * self.rate * self.finer)
        seen = seen[:, first :: self.finer]
        before = seen[:, : round(0.04 * self.rate)]
        seen = seen + self.noise * np.sqrt(
            np.mean(before**2, axis=1, keepdims=True)
        ) * rng.standard_normal(seen.shape)
        seen += np.array(self.offsets)[:, None]
        if self.bits is None:
            return seen
        spans = np.repeat([self.voltage_span, self.current_span], 3)[:, None]
        least = 2 * spans / 2**self.bits
        return np.clip(np.round(seen / least) * least, -spans, spans - least)

    def _filtered(self, x: np.ndarray) -> np.ndarray:
        from scipy.signal import butter, sosfilt

        if self.cutoff is None:
            return x
        return sosfilt(butter(2, 2 * self.cutoff / self.finer, output="sos"), x, axis=1)
