"""Sampled waveforms of one load, as a fault recorder took them, from which a record's phasors were
measured.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Waves:
    """Voltages [kV, phase to ground; of a single-phase load its own] and as many currents [kA],
    into the load.

    `samples` (2 K, M), K three or one, begins at `start` [s] of the record's time; an array, or
    what is read when it is sliced like one. `late` (2 K,) [s] is how much later than stamped each
    channel is sampled; at the times `bridged` [s] a single sample was missing. `estimator` names
    what phasors were measured by, so that those of calculated waveforms compare with them.
    """

    samples: Any
    start: float
    rate: float  # samples per second
    estimator: Any = None
    late: np.ndarray | None = None
    bridged: tuple[float, ...] = ()

    @property
    def phases(self) -> int:
        """Three or one."""
        return self.samples.shape[0] // 2

    @property
    def end(self) -> float:
        """Time of the last sample [s]."""
        return self.start + (self.samples.shape[1] - 1) / self.rate

    def between(self, first: float, last: float) -> "Waves":
        """The samples from time `first` to `last` [s], as an array."""
        a = max(0, int(np.ceil((first - self.start) * self.rate - 1e-6)))
        b = min(self.samples.shape[1], int(np.floor((last - self.start) * self.rate + 1e-6)) + 1)
        return replace(
            self, samples=np.asarray(self.samples[:, a:b]), start=self.start + a / self.rate
        )

    def to_dict(self) -> dict[str, Any]:
        """The waves as JSON holds them, without their samples."""
        late = None if self.late is None else self.late.tolist()
        fields = {"start": self.start, "rate": self.rate, "estimator": self.estimator, "late": late}
        fields |= {"bridged": list(self.bridged)} if self.bridged else {}
        return {"samples": np.asarray(self.samples[:, :]), **fields}

    @classmethod
    def from_content(cls, content: Mapping[str, Any]) -> "Waves":
        """From the content of `to_dict`."""
        late = content["late"] if content["late"] is None else np.array(content["late"])
        samples = np.array(content["samples"], dtype=float)
        bridged = tuple(content.get("bridged", ()))
        return cls(samples, content["start"], content["rate"], content["estimator"], late, bridged)
