"""Woodbridge traction transformer."""

from tractexp.extend import plugin

from ._balanced import _Balanced


@plugin
class Woodbridge(_Balanced):
    """One arm of a (modified) Woodbridge transformer: star primary, two deltas, and a booster on
    arm beta.

        U_alpha = (V_b - V_c) / ratio, U_beta = (2 V_a - V_b - V_c) / (sqrt(3) ratio)
        I_alpha = ratio (I_b - I_c) / 2, I_beta = ratio sqrt(3)/2 I_a

    Alpha lies across the legs of `pair`; beta is in phase with the leg of the third phase, and the
    booster raises it to alpha's voltage. At the terminals an ideal one is a Scott transformer.

    Source: Chen and Guo 1996, Three phase models of specially connected transformers, IEEE Trans.
    Power Delivery 11(1).
    """
