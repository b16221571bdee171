"""The induction machine: stator and rotor flux linkages in the stationary frame, and the swing of
the rotor.

Source: Krause, Wasynczuk and Sudhoff 2002, chapter 4 (per-unit flux-linkage form, stationary
frame).
"""

from dataclasses import dataclass

import numpy as np

from independent.source import OMEGA


class Stall(ValueError):
    """The load torque exceeds what the machine can develop: there is no steady state."""


@dataclass(frozen=True)
class Machine:
    """A single-cage machine, per unit of its own rating; the reactances are those at nominal
    frequency.
    """

    Rs: float
    Xs: float
    Xm: float
    Rr: float
    Xr: float
    H: float  # s

    @property
    def X(self) -> float:
        """Open-circuit reactance."""
        return self.Xs + self.Xm

    @property
    def X_prime(self) -> float:
        """Transient reactance, below Eq. (2)."""
        return self.Xs + self.Xm * self.Xr / (self.Xm + self.Xr)

    @property
    def T0_prime(self) -> float:
        """Rotor open-circuit time constant [s], below Eq. (2)."""
        return (self.Xm + self.Xr) / (OMEGA * self.Rr)

    def slip(self, voltage: float, torque: float) -> float:
        """Slip at which the equivalent circuit develops `torque`; raises `Stall` if none does.

        With the Thevenin source V, R + jX seen by Rr/s = y: torque (y^2 + 2 R y + R^2 + X^2) = V^2
        y, whose larger root y is the stable one; written for the slip, so that no torque gives no
        slip.
        """
        source = 1j * self.Xm / (self.Rs + 1j * self.X)
        impedance = source * (self.Rs + 1j * self.Xs) + 1j * self.Xr
        half = abs(source * voltage) ** 2 / 2 - torque * impedance.real
        root = half**2 - (torque * abs(impedance)) ** 2
        if half <= 0 or root < 0:
            raise Stall(
                f"a torque of {torque:g} pu exceeds the breakdown torque at a voltage of"
                f" {voltage:g} pu"
            )
        return torque * self.Rr / (half + np.sqrt(root))

    def currents(self, stator: complex, rotor: complex) -> tuple[complex, complex]:
        """Stator and rotor current of the two flux linkages, scalars or arrays of one shape."""
        X_r = self.Xm + self.Xr
        determinant = self.X * X_r - self.Xm**2
        return (X_r * stator - self.Xm * rotor) / determinant, (
            self.X * rotor - self.Xm * stator
        ) / determinant

    def steady_state(self, voltage: complex, torque: float) -> np.ndarray:
        """State (3,) complex: stator flux, rotor flux, speed, on a balanced voltage of nominal
        frequency.
        """
        slip = self.slip(abs(voltage), torque)
        # The rotor's row is multiplied by the slip, so that a slip of 0 is allowed.
        circuit = np.array(
            [
                [self.Rs + 1j * self.X, 1j * self.Xm],
                [1j * slip * self.Xm, self.Rr + 1j * slip * (self.Xm + self.Xr)],
            ]
        )
        stator, rotor = np.linalg.solve(circuit, [voltage, 0.0])
        fluxes = [self.X * stator + self.Xm * rotor, self.Xm * stator + (self.Xm + self.Xr) * rotor]
        return np.array([*fluxes, 1 - slip], dtype=complex)

    def derivative(self, state: np.ndarray, voltage: complex, torque: float) -> list[complex]:
        """Time derivative [1/s] of the state under an instantaneous voltage and a load torque."""
        stator_flux, rotor_flux, speed = state.tolist()
        stator, rotor = self.currents(stator_flux, rotor_flux)
        developed = (stator_flux.conjugate() * stator).imag
        return [
            OMEGA * (voltage - self.Rs * stator),
            OMEGA * (1j * speed * rotor_flux - self.Rr * rotor),
            (developed - torque) / (2 * self.H),
        ]
