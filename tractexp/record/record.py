"""A recorded event: the measured voltage and the power the load drew from it."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Base:
    """What one per unit stands for. Voltage is line-to-line RMS; power is three-phase."""

    voltage: float = 1.0  # kV
    power: float = 1.0  # MVA
    frequency: float = 50.0  # Hz, nominal


@dataclass(frozen=True, eq=False)
class Record:
    """Positive-sequence voltage and power of one event, P and Q positive when consumed.

    Arrays have shape (N,), are finite except where `P` or `Q` is missing (nan: a gap, left out of every sum),
    and are sampled uniformly. `source` says where the record came from, `notes` what was done to it or found
    odd about it, one sentence each.
    """

    name: str
    t: np.ndarray  # s
    U: np.ndarray  # pu
    P: np.ndarray  # pu
    Q: np.ndarray  # pu
    f: np.ndarray | None = None  # Hz
    U2: np.ndarray | None = None  # pu, negative-sequence voltage
    base: Base = Base()
    source: str = ""
    notes: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        return len(self.t)

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))
