"""The recorder: six noisy, quantized channels, phasors by discrete Fourier transform, powers,
decimation.
"""

from dataclasses import dataclass

import numpy as np

from independent.load import Waveforms
from independent.source import NOMINAL_FREQUENCY

PHASES = np.exp(-2j * np.pi * np.arange(3) / 3)  # what turns a space vector onto phase a, b, c


@dataclass(frozen=True)
class Recorder:
    """A fault recorder with a phasor stage of `cycles` nominal cycles; noise is a standard
    deviation per sample.
    """

    samples: int = 1000  # of the record
    step: float = 0.001  # s, of the record
    # Hz, of the converter; a whole number of samples per record step and per window
    rate: float = 10_000.0
    cycles: float = 1.0
    voltage_noise: float = 0.0  # pu
    current_noise: float = 0.0  # pu
    bits: int | None = None  # None: no quantization
    voltage_range: float = 2.0  # pu, the converter's span is plus and minus this
    current_range: float = 8.0  # pu

    def __post_init__(self) -> None:
        for what, count in (
            ("window", self.cycles * self.rate / NOMINAL_FREQUENCY),
            ("step", self.step * self.rate),
        ):
            if abs(count - round(count)) > 1e-9 or count < 1:
                raise ValueError(
                    f"one {what} holds {count:g} samples at {self.rate:g} Hz; it must be a whole"
                    " number"
                )

    @property
    def window(self) -> int:
        """Samples of one window."""
        return round(self.cycles * self.rate / NOMINAL_FREQUENCY)

    @property
    def stride(self) -> int:
        """Samples from one record to the next."""
        return round(self.step * self.rate)

    def instants(self) -> np.ndarray:
        """Sampling times [s], such that the windows are centered on 0, step, 2 step, ..."""
        count = (self.samples - 1) * self.stride + self.window
        return (np.arange(count) - (self.window - 1) / 2) / self.rate

    def read(self, waveforms: Waveforms, rng: np.random.Generator) -> dict[str, np.ndarray]:
        """The record of waveforms sampled at `instants()`; see `independent.record` for what it
        holds.
        """
        voltage = self.phasors(
            self.channels(waveforms.voltage, self.voltage_noise, self.voltage_range, rng)
        )
        current = self.phasors(
            self.channels(waveforms.current, self.current_noise, self.current_range, rng)
        )
        positive, negative = np.conj(PHASES) @ voltage / 3, PHASES @ voltage / 3
        power = positive * np.conj(np.conj(PHASES) @ current / 3)
        deviation = np.gradient(np.unwrap(np.angle(positive)), self.step) / (2 * np.pi)
        return {
            "t": np.arange(self.samples) * self.step,
            "U": np.abs(positive),
            "P": power.real,
            "Q": power.imag,
            "f": NOMINAL_FREQUENCY + deviation,
            "U2": np.abs(negative),
        }

    def channels(
        self, vector: np.ndarray, noise: float, span: float, rng: np.random.Generator
    ) -> np.ndarray:
        """Phases a, b, c (3, n) of a space vector (n,), as the converter delivers them."""
        analog = (vector * PHASES[:, None]).real
        analog = analog + noise * rng.standard_normal(analog.shape)
        if self.bits is None:
            return analog
        least = 2 * span / 2**self.bits
        return np.clip(np.round(analog / least) * least, -span, span - least)

    def phasors(self, channels: np.ndarray) -> np.ndarray:
        """Phasors (3, samples) of channels (3, n): one value per window, its angle relative to
        nominal rotation.
        """
        windows = np.lib.stride_tricks.sliding_window_view(channels, self.window, axis=1)[
            :, :: self.stride
        ]
        turn = np.exp(-2j * np.pi * NOMINAL_FREQUENCY * self.instants())
        turns = np.lib.stride_tricks.sliding_window_view(turn, self.window)[:: self.stride]
        return 2 / self.window * np.einsum("pnw,nw->pn", windows, turns)
