"""What a recorder adds to a clean record: colored, heavy-tailed, quantized noise, and the load's
own restlessness.
"""

from dataclasses import dataclass, fields

import numpy as np


@dataclass(frozen=True)
class Noise:
    """Noise of one record. Levels are standard deviations, of P and Q over P0, of U over U0."""

    level: float = 0.005
    phi: float = 0.0  # of a first-order autoregression from sample to sample
    voltage: float = 0.0  # of the voltage channel: in the record only, the load does not see it
    tails: float = 0.0  # degrees of freedom of Student's t, more than 2; 0: Gaussian
    quantum: float = 0.0  # step of the converter, over P0
    wander: float = 0.0  # slow fluctuation of the load, Ornstein-Uhlenbeck
    wander_time: float = 1.0  # s

    def __post_init__(self) -> None:
        for item in fields(self):
            if not getattr(self, item.name) >= 0:
                raise ValueError(
                    f"noise {item.name} = {getattr(self, item.name)} must not be negative"
                )
        if self.phi >= 1:
            raise ValueError(f"noise phi = {self.phi} must be below 1")
        if 0 < self.tails <= 2:
            raise ValueError(f"noise tails = {self.tails} must exceed 2, for a variance to exist")

    def add(self, clean: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        """A copy of a record (arrays (n,), step taken from `t`) with noise on U, P and Q."""
        step = float(clean["t"][1] - clean["t"][0])
        noisy, P0 = dict(clean), abs(float(clean["P"][0]))
        n = len(clean["t"])
        fluctuation = self.wander * autoregressive(
            rng.standard_normal(n), np.exp(-step / self.wander_time)
        )
        for name in ("P", "Q"):
            meter = P0 * self.level * autoregressive(self.white(n, rng), self.phi)
            noisy[name] = clean[name] * (1 + fluctuation) + meter
            if self.quantum:
                noisy[name] = np.round(noisy[name] / (self.quantum * P0)) * self.quantum * P0
        noisy["U"] = clean["U"] + self.voltage * float(clean["U"][0]) * rng.standard_normal(n)
        return noisy

    def white(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """White noise (n,) of unit variance."""
        if self.tails:
            return rng.standard_t(self.tails, n) * np.sqrt((self.tails - 2) / self.tails)
        return rng.standard_normal(n)


def autoregressive(white: np.ndarray, phi: float) -> np.ndarray:
    """Stationary first-order autoregression (n,) of unit variance, driven by white noise (n,) of
    unit variance.
    """
    from scipy.signal import lfilter

    driven = np.sqrt(1 - phi**2) * white
    driven[0] = white[0]
    return lfilter([1.0], [1.0, -phi], driven)
