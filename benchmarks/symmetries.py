"""Two motors that no record can tell from their likes: a T-circuit, and one with a rating of its
own.

Both are the third-order motor of the paper in other parameters, so that which directions are
invisible is known: a T-circuit has four numbers for the three observables X, X' and T0', and a
rating only scales the others.
"""

import dataclasses
import functools

import numpy as np

from tractexp.configuration.plugin import get
from tractexp.model.model import Model, compose
from tractexp.model.parts import Motor
from tractexp.parameter import Parameter

OMEGA = 2 * np.pi * 50
HERE = "benchmarks/symmetries.py"


def third_order(eq, T_prime, X_prime, C, M, T_m):
    """Eqs. (1)-(3) of the paper in expressions of any parameters; returns the stator current."""
    import sympy
    from sympy import I, im

    U, U0 = eq.U, eq.U0
    E, omega = eq.flux("E", "E"), eq.speed()
    sine = 2 * T_m * X_prime / (C * U0**2)
    cosine = sympy.sqrt(sympy.Max(0, 1 - sine**2))
    eq.moves(
        E,
        (C * U - E) / T_prime + I * (omega - eq.omega_s) * E,
        C * U0 / 2 * (1 + cosine - I * sine),
    )
    eq.moves(omega, (-U * im(E) / X_prime - T_m) / M, eq.omega_s0 - sine / (1 + cosine) / T_prime)
    eq.require(
        1 - sympy.Abs(sine), "no steady state: |2 T_m X'/(C U0²)| is {value:.3g}", sympy.Abs(sine)
    )
    return (eq.V - E) / (I * X_prime)


class TCircuit(Motor):
    """The motor by its equivalent circuit; X, X' and T0' are what its terminals show."""

    X_s = Parameter(0.16, (0.05, 0.5), "pu", "stator leakage", HERE)
    X_m = Parameter(2.0, (1.0, 5.0), "pu", "magnetizing reactance", HERE)
    X_r = Parameter(0.2, (0.05, 0.5), "pu", "rotor leakage", HERE)
    R_r = Parameter(0.03, (0.005, 0.1), "pu", "rotor resistance", HERE)
    M = Parameter(0.006, (0.0005, 0.03), "pu s²/rad", "inertia constant", HERE)
    T_m = Parameter(0.4, (0.05, 1.0), "pu", "load torque", HERE)

    def declare(self, eq, X_s, X_m, X_r, R_r, M, T_m):
        X, X_prime = X_s + X_m, X_s + X_m * X_r / (X_m + X_r)
        T0_prime = (X_m + X_r) / (OMEGA * R_r)
        return third_order(eq, X_prime / X * T0_prime, X_prime, (X - X_prime) / X, M, T_m)


class Rated(Motor):
    """The motor per unit of a rating that is a parameter of its own: reactances and inertia scale
    with it.
    """

    T_prime = Parameter(0.1, (0.02, 0.3), "s", "transient time constant", HERE)
    x_prime = Parameter(0.2, (0.1, 0.5), "pu of the rating", "transient reactance", HERE)
    C = Parameter(0.85, (0.3, 0.99), "1", "(X - X')/X", HERE)
    inertia = Parameter(0.01, (0.004, 0.03), "pu of the rating s²/rad", "inertia constant", HERE)
    T_m = Parameter(0.4, (0.05, 1.0), "pu", "load torque on the record's base", HERE)
    rating = Parameter(0.6, (0.4, 1.0), "pu", "rating", HERE)

    def declare(self, eq, T_prime, x_prime, C, inertia, T_m, rating):
        return third_order(eq, T_prime, x_prime / rating, C, inertia * rating, T_m)


@functools.cache
def load(motor: type[Motor]) -> Model:
    """The motor in parallel with the exponential load; not registered, so that no user meets it."""
    made = dataclasses.dataclass(frozen=True, kw_only=True)(motor)
    made.name = motor.__name__.lower()
    made.parameters = tuple(p for p in vars(motor).values() if isinstance(p, Parameter))
    return compose(made(), get("model/static", "exponential")())
