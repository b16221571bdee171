"""Loads of motulator's induction machine (MIT), which nobody here wrote, as a phasor recorder sees
them; `strangers` is what judges them.

The equations of the machine and of its shaft are motulator's; SciPy integrates them in the stator's
frame. On a base of 1 pu of the voltage's peak, the machine's torque is 1.5 times power over speed.
The recorder takes one-cycle phasors of voltage and current, stamped at the window's center.
"""

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

FREQUENCY, RATE, FINE = 50.0, 500.0, 10_000.0  # Hz: of the record, and of what is averaged
OMEGA = 2 * np.pi * FREQUENCY
SCALE = 1.5  # of torque and of power
BEFORE, AFTER = 0.4, 1.2  # s
EDGE = 0.004  # s, in which the voltage falls
# What is drawn for each machine: pu of its rating, and s
RANGES = {
    "R_s": (0.01, 0.03),
    "R_r": (0.01, 0.03),
    "X_s": (2.3, 4.0),
    "X_transient": (0.16, 0.28),
    "inertia": (0.4, 1.2),
    "loading": (0.45, 0.8),
}
# each load has the stator's transients and resistance
ALWAYS = ("stator_transients", "stator_resistance")
KINDS = {  # what a load has beside them, by the names of the catalogue
    "constant torque": (),
    "torque of speed squared": ("speed_dependent_torque",),
    "saturation": ("magnetic_saturation",),
    "two machines": ("second_motor_group",),
    "two masses": (),
}
OUTSIDE = ("two masses",)  # that no effect of the catalogue is
KNEE, SATURATED = 0.9, 2.5  # pu: flux from which the inductance falls, and how fast


@dataclass(frozen=True)
class Dip:
    """The voltage [pu] falls by `depth` and turns by `jump` [rad] for `length` [s] from t = 0."""

    depth: float
    length: float
    jump: float

    def find_voltage(self, t: np.ndarray) -> np.ndarray:
        """The voltage at times t in the frame that turns with its frequency."""

        def rise(x: Any) -> Any:
            return 0.5 - 0.5 * np.cos(np.pi * np.clip(x, 0, 1))

        there = rise(t / EDGE) - rise((t - self.length) / EDGE)
        return (1 - self.depth * there) * np.exp(1j * self.jump * there)


class Machine:
    """One of motulator's machines with its shaft, as differential equations of `order` states."""

    def __init__(self, drawn: dict[str, float], kind: str) -> None:
        from motulator.drive.model import InductionMachine, StiffMechanicalSystem
        from motulator.drive.model import TwoMassMechanicalSystem as TwoMasses

        X, X_1 = drawn["X_s"], drawn["X_transient"]
        self.leakage = X * X_1 / (X - X_1) / OMEGA
        L_s: Any = X / OMEGA
        if kind == "saturation":
            flux = KNEE / OMEGA

            def L_s(psi: Any) -> Any:
                return X / OMEGA / (1 + SATURATED * np.maximum(psi / flux - 1, 0.0))

        par = {"n_p": 1, "R_s": drawn["R_s"], "R_r": drawn["R_r"], "L_ell": self.leakage}
        self.machine = InductionMachine(SimpleNamespace(**par, L_s=L_s))
        torque, J = SCALE * drawn["loading"] / OMEGA, SCALE * 2 * drawn["inertia"] / OMEGA**2
        constant = {"tau_L": lambda t: torque}
        if kind == "torque of speed squared":
            self.shaft = StiffMechanicalSystem(J=J, B_L=lambda w: torque * w / OMEGA**2)
        elif kind == "two masses":
            stiffness = (2 * np.pi * 9.0) ** 2 * J / 4  # two equal halves ring at 9 Hz
            halves = {"J_M": J / 2, "J_L": J / 2, "K_S": stiffness, "C_S": 0.01 * J * OMEGA}
            self.shaft = TwoMasses(SimpleNamespace(**halves, B_L=0), **constant)
        else:
            self.shaft = StiffMechanicalSystem(J=J, **constant)
        self.is_double = kind == "two masses"
        self.order = 5 if self.is_double else 3

    def find_rates(self, y: np.ndarray, u: complex) -> tuple[np.ndarray, complex]:
        """Rates (order,) of both fluxes, the speed and, of two masses, the other speed and the
        angle between them; and the stator's current.
        """
        machine, shaft = self.machine, self.shaft
        machine.state.psi_ss, machine.state.psi_rs = y[0], y[1]
        shaft.state.w_M = y[2].real
        if self.is_double:
            shaft.state.w_L, shaft.state.theta_ML = y[3].real, y[4].real
        machine.set_outputs(0.0)
        shaft.set_outputs(0.0)
        machine.inp.u_ss, machine.inp.w_M = u, shaft.state.w_M
        shaft.inp.tau_M = machine.out.tau_M
        mechanical = shaft.rhs()
        moved = [mechanical[0], *mechanical[2:]]  # without the angle of the rotor
        return np.array([*machine.rhs(), *moved], dtype=complex), machine.out.i_ss

    def find_steady_state(self) -> np.ndarray:
        """The states at which nothing moves in the frame of a voltage of 1 pu."""
        from scipy.optimize import root

        def unpack(x: np.ndarray) -> np.ndarray:
            fluxes = (x[0] + 1j * x[1]) / OMEGA, (x[2] + 1j * x[3]) / OMEGA
            return np.array([*fluxes, x[4] * OMEGA, *[x[4] * OMEGA, *x[5:]][: 2 * self.is_double]])

        def find_missed(x: np.ndarray) -> list[float]:
            y = unpack(x)
            rates, _ = self.find_rates(y, 1.0)
            turning = rates[:2] - 1j * OMEGA * y[:2]
            speeds = rates[2:4].real / OMEGA if self.is_double else rates[2:3].real / OMEGA
            return [*turning.real, *turning.imag, *speeds]

        start = [0.0, -1.0, 0.0, -1.0, 0.98, *([0.0] * self.is_double)]
        found = root(find_missed, start, tol=1e-12)
        if not found.success or found.x[4] < 0.9:
            raise ArithmeticError("the machine has no steady state")
        return unpack(found.x)

    def play(self, voltage: Callable[[np.ndarray], np.ndarray], t: np.ndarray) -> np.ndarray:
        """The current (N,) [pu] at times t (N,) in the frame of the voltage."""
        from scipy.integrate import solve_ivp

        turn = np.exp(1j * OMEGA * t)
        start = self.find_steady_state()
        start[:2] *= turn[0]

        def find_rates(now: float, y: np.ndarray) -> np.ndarray:
            u = complex(voltage(np.array(now))) * np.exp(1j * OMEGA * now)
            return self.find_rates(y, u)[0]

        settings = {"rtol": 1e-7, "atol": 1e-9, "max_step": 2e-3}
        states = solve_ivp(find_rates, (t[0], t[-1]), start, "DOP853", t, **settings).y
        currents = [self.find_rates(y, 0.0)[1] for y in states.T]
        return np.array(currents) / turn


def draw_load(kind: str, rng: np.random.Generator) -> tuple[list[Machine], list[float], Any]:
    """Machines, their shares of the load's rating, and the static part's P + jQ of |u|."""
    count = 2 if kind == "two machines" else 1
    machines = []
    for place in range(count):
        drawn = {name: float(rng.uniform(*limits)) for name, limits in RANGES.items()}
        if place:  # a group that differs is lighter
            drawn["inertia"] *= 0.25
        machines.append(Machine(drawn, kind))
    share = float(rng.uniform(0.5, 0.7))
    p, q, slope_p, slope_q = (
        float(rng.uniform(*x)) for x in ((0.2, 0.4), (0.05, 0.2), (1, 2), (2, 3))
    )
    return machines, [share / count] * count, lambda U: p * U**slope_p + 1j * q * U**slope_q


def draw_dips(rng: np.random.Generator, count: int, jumps: bool) -> list[Dip]:
    """Dips whose depths are spread from 10 to 45 %."""
    depths = 0.1 + 0.35 * (rng.permutation(count) + rng.random(count)) / count
    lengths = np.exp(rng.uniform(np.log(0.08), np.log(0.3), count))
    turned = rng.uniform(-0.2, 0.2, count) * jumps
    return [
        Dip(*row) for row in zip(depths.tolist(), lengths.tolist(), turned.tolist(), strict=True)
    ]


def record_dip(load: tuple[list[Machine], list[float], Any], dip: Dip) -> dict[str, np.ndarray]:
    """Columns t [s], U, P, Q [pu], f [Hz] (N,) of one-cycle phasors, without noise."""
    _, _, static = load
    t = find_times()
    u = dip.find_voltage(t)
    i = play_machines(load, dip.find_voltage, t) + np.conj(static(np.abs(u)) / u)
    return sample_phasors(t, u, i)


def find_times() -> np.ndarray:
    """The times (N,) [s] at which a simulator tells voltage and current."""
    return np.arange(round((BEFORE + AFTER) * FINE)) / FINE - BEFORE


def play_machines(
    load: tuple[list[Machine], list[float], Any],
    voltage: Callable[[np.ndarray], np.ndarray],
    t: np.ndarray,
) -> np.ndarray:
    """The current (N,) [pu] of a load's machines at times t (N,) in the frame of the voltage."""
    machines, shares, _ = load
    pairs = zip(machines, shares, strict=True)
    return np.sum([share * one.play(voltage, t) for one, share in pairs], axis=0)


def sample_phasors(t: np.ndarray, u: np.ndarray, i: np.ndarray) -> dict[str, np.ndarray]:
    """Columns t [s], U, P, Q [pu], f [Hz] (N,) of one-cycle phasors of voltage and current [pu] at
    the times of `find_times`, in the frame that turns with nominal frequency.
    """
    cycle = round(FINE / FREQUENCY)
    middle = np.arange(cycle // 2, len(t) - cycle // 2, round(FINE / RATE))
    U, current = (average(x, cycle)[middle - cycle // 2] for x in (u, i))
    S = U * np.conj(current)
    f = FREQUENCY + np.gradient(np.unwrap(np.angle(U))) * RATE / (2 * np.pi)
    return {"t": t[middle], "U": np.abs(U), "P": S.real, "Q": S.imag, "f": f}


def average(x: np.ndarray, samples: int) -> np.ndarray:
    """Means of so many steps (N - samples,) by the trapezoidal rule."""
    total = np.concatenate([[0.0], np.cumsum((x[1:] + x[:-1]) / 2)])
    return (total[samples:] - total[:-samples]) / samples
