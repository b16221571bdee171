"""Le Blanc traction transformer."""

import numpy as np

from tractexp.extend import plugin

from ._balanced import _Balanced


@plugin
class LeBlanc(_Balanced):
    """One arm of a Le Blanc transformer: delta primary on three legs, five secondary windings.

        U_alpha = 2/3 U_1 - (U_2 + U_3)/3, U_beta = (U_2 - U_3) / sqrt(3),
        U_1, U_2, U_3 those of the legs over ratio

    With U_1 = V_a - V_b, U_2 = V_b - V_c, U_3 = V_c - V_a, of sum zero, alpha is the voltage of
    `pair` and beta a quarter cycle from it, as the third phase is with its sign reversed:

        U_alpha = (V_a - V_b) / ratio, U_beta = -(2 V_c - V_a - V_b) / (sqrt(3) ratio)
        I_alpha = ratio (I_a - I_b) / 2, I_beta = -ratio sqrt(3)/2 I_c

    Source: Chen and Guo 1996, Three phase models of specially connected transformers, IEEE Trans.
    Power Delivery 11(1).
    """

    pair: str = "ab"  # of phases, that arm alpha lies across

    def rows(self) -> np.ndarray:
        alpha, beta = super().rows()
        return np.array([alpha, -beta])
