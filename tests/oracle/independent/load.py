"""The load at the recorder's bus: a machine beside a static load, and the waveforms
they produce.
"""

from dataclasses import dataclass

import numpy as np

from independent.machine import Machine
from independent.source import OMEGA, Dip


@dataclass(frozen=True)
class Static:
    """Exponential static load: P (U/U0)^p_v + j Q (U/U0)^q_v, `P` and `Q` what it
    draws at U0 [pu].
    """

    P: float
    Q: float
    p_v: float
    q_v: float

    def current(self, dip: Dip, t: np.ndarray) -> np.ndarray:
        """Space vector of the current [pu]: an admittance that follows the positive-sequence
        magnitude at once.

        The admittance acts as a quasi-stationary one on either sequence; it has no dynamics of its
        own, which is what "static" means.
        """
        positive, negative = dip.sequences(t)
        U = dip.magnitude(t)
        admittance = (
            self.P * (U / dip.before) ** self.p_v - 1j * self.Q * (U / dip.before) ** self.q_v
        ) / U**2
        return admittance * positive + np.conj(admittance) * negative


@dataclass(frozen=True)
class Load:
    """A machine of `rating` [pu of the record's base] that drives `torque` [pu of its rating], and
    a static load.
    """

    machine: Machine
    rating: float
    torque: float
    static: Static

    def truth(self) -> dict[str, float]:
        """What the third-order model of Eqs. (1)-(7) calls this load, on the record's base."""
        m = self.machine
        return {
            "T_prime": m.X_prime / m.X * m.T0_prime,
            "X_prime": m.X_prime / self.rating,
            "C": (m.X - m.X_prime) / m.X,
            "M": 2 * m.H * self.rating / OMEGA,
            "T_m": self.torque * self.rating,
            "p_v": self.static.p_v,
            "q_v": self.static.q_v,
        }

    def steady_power(self, voltage: float) -> complex:
        """Power of the machine before the event [pu]: its P is `T_m` where the stator resistance is
        zero.
        """
        stator_flux, rotor_flux, _ = self.machine.steady_state(voltage, self.torque)
        current, _ = self.machine.currents(stator_flux, rotor_flux)
        return complex(self.rating * voltage * np.conj(current))


@dataclass(frozen=True, eq=False)
class Waveforms:
    """Instantaneous space vectors at the bus, stationary frame, and the machine's states behind
    them.
    """

    t: np.ndarray  # (n,) s
    voltage: np.ndarray  # (n,) complex, pu
    current: np.ndarray  # (n,) complex, pu
    states: np.ndarray  # (3, n) complex: stator flux, rotor flux, speed, pu of the machine


def simulate(load: Load, dip: Dip, t: np.ndarray) -> Waveforms:
    """Waveforms at times t (n,) [s], increasing, the first before the dip; SciPy DOP853 from the
    steady state.

    Raises `Stall` when there is no steady state.
    """
    from scipy.integrate import solve_ivp

    def derivative(now: float, state: np.ndarray) -> list[complex]:
        return load.machine.derivative(state, complex(sum(dip.sequences(now))), load.torque)

    begin = load.machine.steady_state(complex(dip.sequences(t[0])[0]), load.torque)
    # A quarter cycle at most, so that no step passes over an edge unseen.
    solved = solve_ivp(
        derivative, (t[0], t[-1]), begin, "DOP853", t, rtol=1e-10, atol=1e-12, max_step=0.005
    )
    if not solved.success:
        raise RuntimeError(f"the simulation stopped: {solved.message}")
    motor, _ = load.machine.currents(solved.y[0], solved.y[1])
    return Waveforms(
        t, sum(dip.sequences(t)), load.rating * motor + load.static.current(dip, t), solved.y
    )
