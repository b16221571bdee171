"""The T-circuit of a motor from what an identification finds, and back.

Records determine X, X', T0' (and X'', T0'' of a second cage), one number fewer than the circuit has
elements. The convention that closes the gap, with R_s = 0 unless identified: stator and rotor
leakage are equal, X_s = X_1, so that X_m = X sqrt(C) and X_s = X (1 - sqrt(C)). Where a second cage
leaves no room for that, X'' <= X_s, the stator takes half of X''. Any other split gives the same P
and Q.

Source: Wu, Fan, Zou 2022, below Eq. (2) for X, X', T0'; Milano 2010, ch. 15 for X'', T0''.
"""

from dataclasses import dataclass
from math import sqrt
from typing import TypeVar

Number = TypeVar("Number", float, complex)


@dataclass(frozen=True)
class TCircuit:
    """The T-circuit of a motor of one or two cages.

    Attributes
    ----------
    omega_n : float [rad/s]
        Nominal synchronous speed, at which the reactances are told.
    R_s, X_s : float [pu]
        Of the stator, on the record's base.
    X_m : float [pu]
        Magnetizing reactance.
    R_1, X_1 : float [pu]
        Of the first cage.
    R_2, X_2 : float or None [pu]
        Of the second cage; None where there is one only.
    """

    omega_n: float
    R_s: float
    X_s: float
    X_m: float
    R_1: float
    X_1: float
    R_2: float | None = None
    X_2: float | None = None

    @classmethod
    def single(
        cls, T_prime: float, X_prime: float, C: float, omega_n: float, R_s: float = 0.0
    ) -> "TCircuit":
        """The circuit of one cage.

        Parameters
        ----------
        T_prime : float [s]
            Transient time constant T' = X'/X T0'.
        X_prime : float [pu]
            Transient reactance.
        C : float
            (X - X')/X, between 0 and 1.
        omega_n : float [rad/s]
            Nominal synchronous speed.
        R_s : float [pu]
            Stator resistance.

        Returns
        -------
        TCircuit

        Examples
        --------
        >>> circuit = TCircuit.single(0.05, 0.2, 0.9, 314.16)
        >>> round(circuit.X, 3), round(circuit.X_prime, 3)
        (2.0, 0.2)
        """
        X = X_prime / (1 - C)
        X_s = X * (1 - sqrt(C))
        return cls(omega_n, R_s, X_s, X - X_s, X * (1 - C) / (omega_n * T_prime), X_s)

    @classmethod
    def double(
        cls,
        T_prime: float,
        X_prime: float,
        C: float,
        T_second: float,
        X_second: float,
        omega_n: float,
        R_s: float = 0.0,
    ) -> "TCircuit":
        """The circuit of two cages in parallel.

        Parameters
        ----------
        T_prime, X_prime, C, omega_n, R_s
            As of `single`.
        T_second : float [s]
            Subtransient time constant T''.
        X_second : float [pu]
            Subtransient reactance, less than X'.

        Returns
        -------
        TCircuit
        """
        X = X_prime / (1 - C)
        equal = X * (1 - sqrt(C))
        X_s = equal if equal < X_second else X_second / 2
        X_m, behind = X - X_s, X_prime - X_s
        X_1 = behind * X_m / (X_m - behind)
        X_2 = 1 / (1 / (X_second - X_s) - 1 / behind)
        R_1 = (X_1 + X_m) * (1 - C) / (omega_n * T_prime)
        R_2 = (X_2 + behind) * X_second / (X_prime * omega_n * T_second)
        return cls(omega_n, R_s, X_s, X_m, R_1, X_1, R_2, X_2)

    @property
    def X(self) -> float:
        """The open-circuit reactance [pu]."""
        return self.X_s + self.X_m

    @property
    def X_prime(self) -> float:
        """The transient reactance [pu]."""
        return self.X_s + _connect_parallel(self.X_m, self.X_1)

    @property
    def X_second(self) -> float:
        """The subtransient reactance [pu] of two cages; of one, the transient reactance."""
        return (
            self.X_prime
            if self.X_2 is None
            else self.X_s + _connect_parallel(_connect_parallel(self.X_m, self.X_1), self.X_2)
        )

    @property
    def T0_prime(self) -> float:
        """The open-circuit time constant [s] of the first cage."""
        return (self.X_1 + self.X_m) / (self.omega_n * self.R_1)

    @property
    def T0_second(self) -> float:
        """The open-circuit time constant [s] of the second cage; 0 where there is none."""
        if self.X_2 is None or self.R_2 is None:
            return 0.0
        return (self.X_2 + _connect_parallel(self.X_m, self.X_1)) / (self.omega_n * self.R_2)

    def parameters(self) -> dict[str, float]:
        """{name: value} of what an identification finds of such a motor: the inverse of `single`
        and `double`.

        Examples
        --------
        >>> found = TCircuit.double(0.05, 0.2, 0.9, 0.004, 0.12, 314.16).parameters()
        >>> {name: round(value, 6) for name, value in found.items()}
        {'T_prime': 0.05, 'X_prime': 0.2, 'C': 0.9, 'T_second': 0.004, 'X_second': 0.12}
        """
        X, X_prime, X_second = self.X, self.X_prime, self.X_second
        values = {
            "T_prime": self.T0_prime * X_prime / X,
            "X_prime": X_prime,
            "C": (X - X_prime) / X,
        }
        if self.X_2 is not None:
            values |= {"T_second": self.T0_second * X_second / X_prime, "X_second": X_second}
        return values

    def impedance(self, slip: float) -> complex:
        """The impedance [pu] seen from the terminals at a slip, per unit of the synchronous
        speed and not 0.
        """
        rotor = complex(self.R_1 / slip, self.X_1)
        if self.X_2 is not None and self.R_2 is not None:
            rotor = _connect_parallel(rotor, complex(self.R_2 / slip, self.X_2))
        return complex(self.R_s, self.X_s) + _connect_parallel(complex(0.0, self.X_m), rotor)


def _connect_parallel(a: Number, b: Number) -> Number:
    """Two impedances in parallel."""
    return a * b / (a + b)
