"""Least squares."""

from tractexp.extend import Loss, plugin


@plugin
class Squares(Loss):
    """Mean squared error of P plus that of Q.

    Source: Wu, Fan, Zou 2022, Eq. (8).
    Departures: P and Q may be weighted; missing samples are left out of the sum.
    """
