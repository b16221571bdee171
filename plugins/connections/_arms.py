"""A traction transformer seen from its three-phase side: one arm's voltage and current.

The transformer is ideal: its arms' voltages are rows N of the phase voltages, U = N V / ratio, rows
of sum zero, and as it neither takes nor gives power its primary currents are I = N^T I_arms /
ratio. A three-wire primary has two independent currents, as there are two arms, so that I_arms =
ratio (N N^T)^-1 N I. What really lies between, its leakage and magnetising current, stays on the
load's side of the record.

Source: Chen and Guo 1996, Three phase models of specially connected transformers, IEEE Trans. Power
Delivery 11(1).
"""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from tractexp.extend import SINGLE, Connection, check_choice, check_range

ARMS = ("alpha", "beta")


@dataclass(frozen=True, kw_only=True)
class _Arms(Connection):
    """Three phase voltages and currents of the primary, and the arm that is looked at."""

    arm: str = "alpha"  # alpha or beta
    # primary line voltage over the arm's voltage; 1 leaves the arm referred to the primary
    ratio: float = 1.0

    def check(self) -> None:
        check_choice("data.connection.arm", self.arm, ARMS)
        check_range("data.connection.ratio", self.ratio, 1e-3, 1e4)

    @abstractmethod
    def rows(self) -> np.ndarray:
        """(2, 3): the voltages of alpha and beta from the phase voltages, for ratio 1."""

    @property
    def notes(self) -> tuple[str, ...]:
        origin = (
            f"arm {self.arm} of an ideal {self.name} transformer, told from its three-phase side"
        )
        return (
            f"{origin}, ratio {self.ratio:g}: the transformer's own impedance counts to the load",
            SINGLE,
        )

    def voltage(self) -> np.ndarray:
        return self.rows()[[ARMS.index(self.arm)]] / self.ratio

    def current(self) -> np.ndarray:
        return self.ratio * np.linalg.pinv(self.rows().T)[[ARMS.index(self.arm)]]
