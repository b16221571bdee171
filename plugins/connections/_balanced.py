"""Transformers that make two voltages a quarter cycle apart from three phases, and balanced
currents of equal arms.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.extend import check_choice

from ._arms import _Arms
from ._phases import PAIRS, PHASES, line


@dataclass(frozen=True, kw_only=True)
class _Balanced(_Arms):
    """Arm alpha across a pair of phases, beta on the third phase; equal arms leave no negative
    sequence.
    """

    pair: str = "bc"  # of phases, that arm alpha lies across

    def check(self) -> None:
        super().check()
        check_choice("data.connection.pair", self.pair, PAIRS)

    def rows(self) -> np.ndarray:
        third = np.array([2.0 if phase not in self.pair else -1.0 for phase in PHASES])
        return np.array([line(self.pair), third / np.sqrt(3)])
