"""V/v traction transformer."""

from dataclasses import field

import numpy as np

from tractexp.extend import plugin

from ._arms import _Arms
from ._phases import check_pairs, line


@plugin
class VV(_Arms):
    """One arm of a V/v transformer: two single-phase transformers between two pairs of phases.

        U_alpha = (V_a - V_b) / ratio, U_beta = (V_b - V_c) / ratio
        I_alpha = ratio I_a, I_beta = -ratio I_c

    `pairs` says which pair feeds which arm, and with which sign. Equal arms leave a negative
    sequence of half the positive one.

    Source: Chen and Guo 1996, Three phase models of specially connected transformers, IEEE Trans.
    Power Delivery 11(1).
    """

    pairs: list[str] = field(default_factory=lambda: ["ab", "bc"])  # that feed alpha and beta

    def check(self) -> None:
        super().check()
        check_pairs(self.pairs, 2, "of alpha and beta")

    def rows(self) -> np.ndarray:
        return np.array([line(pair) for pair in self.pairs])
