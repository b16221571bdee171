"""Scott traction transformer."""

from tractexp.extend import plugin

from ._balanced import _Balanced


@plugin
class Scott(_Balanced):
    """One arm of a Scott transformer: alpha is the main (M) winding, across `pair`; beta the teaser
    (T).

        U_alpha = (V_b - V_c) / ratio, U_beta = (2 V_a - V_b - V_c) / (sqrt(3) ratio)
        I_alpha = ratio (I_b - I_c) / 2, I_beta = ratio sqrt(3)/2 I_a

    The teaser lies between the third phase and the middle of the main winding, with sqrt(3)/2 of
    its turns.

    Source: Chen and Guo 1996, Three phase models of specially connected transformers, IEEE Trans.
    Power Delivery 11(1).
    """
