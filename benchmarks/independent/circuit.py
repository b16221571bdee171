"""Instantaneous currents of a load of several devices, integrated in the stationary frame by SciPy's DOP853.

Each device has states of its own (complex flux linkages, speed) and draws a space vector of current at the voltage's.
Per unit of the record's base, peaks; the voltage is given, so devices do not feel each other.
"""

from dataclasses import dataclass, replace

import numpy as np

from independent.fault import Fault
from independent.machine import Machine
from independent.source import NOMINAL_FREQUENCY, OMEGA

EARLY = 0.55  # s before the record at which a simulation begins
SETTLED = 60  # of the repeated substitutions in a saturated air gap, at most


@dataclass(frozen=True)
class Group:
    """Induction motors of `rating` [pu] that drive `torque` [pu of the rating]; further fields are off at 0.

    `fan` is the share of the torque that grows with the square of the speed, `saturation` the relative growth of the
    magnetizing current per pu² of air-gap flux beyond that before the event.
    """

    machine: Machine
    rating: float
    torque: float
    fan: float = 0.0
    saturation: float = 0.0
    speed: float = 1.0  # pu, before the event; these two are set by `settled`
    flux: float = 1.0  # pu², square of the air gap's

    def settled(self, voltage: complex, frequency: float) -> tuple["Group", np.ndarray]:
        """The group at rest on a voltage [pu] of a frequency over nominal, and its states; raises `Stall`."""
        m, w = self.machine, frequency
        scaled = replace(m, Xs=m.Xs * w, Xm=m.Xm * w, Xr=m.Xr * w)
        stator, rotor, turning = scaled.steady_state(abs(voltage), self.torque * w)
        turn = voltage / abs(voltage)
        states = np.array([stator / w * turn, rotor / w * turn, turning * w])
        gap = self._linear(*states[:2])
        return replace(self, speed=states[2].real, flux=abs(gap) ** 2), states

    def _linear(self, stator: complex, rotor: complex) -> complex:
        m = self.machine
        return (stator / m.Xs + rotor / m.Xr) / (1 / m.Xs + 1 / m.Xr + 1 / m.Xm)

    def gap(self, stator: complex, rotor: complex) -> complex:
        """The air-gap flux, scalars or arrays: where leakages and magnetizing branch meet."""
        gap = self._linear(stator, rotor)
        if not self.saturation:
            return gap
        m, source = self.machine, stator / self.machine.Xs + rotor / self.machine.Xr
        for _ in range(SETTLED):
            last = gap
            excess = self.saturation * (abs(gap) ** 2 - self.flux)
            gap = 0.5 * gap + 0.5 * source / (1 / m.Xs + 1 / m.Xr + (1 + excess) / m.Xm)
            if np.max(abs(gap - last)) < 1e-12:
                break
        return gap

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        """Time derivatives of stator flux, rotor flux and speed [1/s]."""
        m, gap, speed = self.machine, self.gap(x[0], x[1]), x[2].real
        stator, rotor = (x[0] - gap) / m.Xs, (x[1] - gap) / m.Xr
        load = self.torque * (1 - self.fan + self.fan * (speed / self.speed) ** 2)
        developed = (x[0].conjugate() * stator).imag
        return [
            OMEGA * (v - m.Rs * stator),
            OMEGA * (1j * speed * x[1] - m.Rr * rotor),
            (developed - load) / (2 * m.H),
        ]

    def current(self, x: np.ndarray, v: np.ndarray, slope: np.ndarray) -> np.ndarray:
        return self.rating * (x[0] - self.gap(x[0], x[1])) / self.machine.Xs

    def truth(self) -> dict[str, float]:
        """What the fifth-order model calls this group, on the record's base."""
        m = self.machine
        return {
            "T_prime": m.X_prime / m.X * m.T0_prime, "X_prime": m.X_prime / self.rating,
            "C": (m.X - m.X_prime) / m.X, "M": 2 * m.H * self.rating / OMEGA, "T_m": self.torque * self.rating,
            "R_s": m.Rs / self.rating,
        }  # fmt: skip


@dataclass(frozen=True)
class Branch:
    """Resistance and reactance in series [pu]."""

    R: float
    X: float

    def settled(self, voltage: complex, frequency: float) -> tuple["Branch", np.ndarray]:
        return self, np.array([self.X * voltage / (self.R + 1j * self.X * frequency)])

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return [OMEGA * (v - self.R * x[0] / self.X)]

    def current(self, x: np.ndarray, v: np.ndarray, slope: np.ndarray) -> np.ndarray:
        return x[0] / self.X


@dataclass(frozen=True)
class Shunt:
    """Conductance and capacitive susceptance [pu]; no states."""

    G: float = 0.0
    B: float = 0.0

    def settled(self, voltage: complex, frequency: float) -> tuple["Shunt", np.ndarray]:
        return self, np.empty(0, dtype=complex)

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return []

    def current(self, x: np.ndarray, v: np.ndarray, slope: np.ndarray) -> np.ndarray:
        return self.G * v + self.B * slope / OMEGA


@dataclass(frozen=True)
class Core:
    """A transformer's core without load: beyond `knee` [pu of flux] each limb draws by the air's reactance `X` [pu]."""

    knee: float
    X: float
    R: float  # of the winding, pu: what makes offsets decay

    def settled(self, voltage: complex, frequency: float) -> tuple["Core", np.ndarray]:
        return self, np.array([voltage / (1j * frequency)])

    def _drawn(self, flux: np.ndarray) -> np.ndarray:
        limbs = np.stack([(flux * np.exp(-2j * np.pi / 3 * k)).real for k in range(3)])
        over = np.sign(limbs) * np.maximum(abs(limbs) - self.knee, 0.0) / self.X
        return 2 / 3 * np.tensordot(np.exp(2j * np.pi / 3 * np.arange(3)), over, 1)

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return [OMEGA * (v - self.R * complex(self._drawn(x[0])))]

    def current(self, x: np.ndarray, v: np.ndarray, slope: np.ndarray) -> np.ndarray:
        return self._drawn(x[0])


@dataclass(frozen=True)
class Earthed:
    """Resistance and reactance [pu] between neutral and earth as the zero sequence sees them; draws nothing else."""

    R: float
    X: float

    def settled(self, voltage: complex, frequency: float) -> tuple["Earthed", np.ndarray]:
        return self, np.zeros(1, dtype=complex)

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return [OMEGA * (zero - self.R * x[0] / self.X)]

    def current(self, x: np.ndarray, v: np.ndarray, slope: np.ndarray) -> np.ndarray:
        return np.zeros_like(v)

    def zero(self, x: np.ndarray) -> np.ndarray:
        """The zero sequence (n,) that it draws."""
        return x[0].real / self.X


@dataclass(frozen=True)
class Switched:
    """A share of a device that is off between two times [s]: a relay's doing."""

    device: Branch | Shunt | Group
    share: float
    off: float
    on: float
    ramp: float = 0.02  # s, in which it returns

    def settled(self, voltage: complex, frequency: float) -> tuple["Switched", np.ndarray]:
        device, states = self.device.settled(voltage, frequency)
        return replace(self, device=device), states

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return self.device.rates(x, v, zero)

    def left(self, t: np.ndarray) -> np.ndarray:
        """What of the device is connected at times t (n,)."""
        return 1 - self.share * ((t >= self.off) * (1 - np.clip((t - self.on) / self.ramp, 0, 1)))


Device = Group | Branch | Shunt | Core | Earthed | Switched


@dataclass(frozen=True, eq=False)
class Instants:
    """Space vectors and zero sequences (n,) [pu] at the bus at times t (n,) [s]."""

    t: np.ndarray
    voltage: np.ndarray
    voltage_zero: np.ndarray
    current: np.ndarray
    current_zero: np.ndarray


def drawn(devices: tuple[Device, ...], fault: Fault, t: np.ndarray) -> Instants:
    """What devices draw at uniform times t (n,) [s], the first before the fault. Raises `Stall`."""
    from scipy.integrate import solve_ivp

    early = round(EARLY / (t[1] - t[0]))
    begin, w = t[0] - early * (t[1] - t[0]), fault.frequency / NOMINAL_FREQUENCY
    made = [d.settled(fault.before * np.exp(2j * np.pi * fault.frequency * begin), w) for d in devices]
    devices = tuple(d for d, _ in made)
    ends = np.cumsum([0, *(len(states) for _, states in made)]).tolist()
    parts = list(zip(devices, ends[:-1], ends[1:], strict=True))
    grid = begin + (t[1] - t[0]) * np.arange(early + len(t))
    v, zero = fault.at(grid)
    smooth_v, smooth_zero = Smooth(grid, v), Smooth(grid, zero)

    def slopes(now: float, state: np.ndarray) -> list[complex]:
        here, zero, x = smooth_v(now), smooth_zero(now), state.tolist()
        return [rate for d, a, b in parts for rate in d.rates(x[a:b], here, zero)]

    start = np.concatenate([states for _, states in made])
    y = np.empty((0, len(t)))
    if len(start):
        # So short that no edge is passed over unseen.
        solved = solve_ivp(slopes, (begin, t[-1]), start, "DOP853", t, rtol=1e-8, atol=1e-10, max_step=0.004)
        if not solved.success:
            raise RuntimeError(f"the simulation stopped: {solved.message}")
        y = solved.y
    v, zero, slope = v[early:], zero[early:], np.gradient(v, grid)[early:]
    current, current_zero = np.zeros_like(v), np.zeros(len(t))
    for d, a, b in parts:
        x, device = y[a:b], d.device if isinstance(d, Switched) else d
        current += device.current(x, v, slope) * (d.left(t) if isinstance(d, Switched) else 1.0)
        current_zero += device.zero(x) if isinstance(device, Earthed) else 0.0
    return Instants(t, v, zero, current, current_zero)


class Smooth:
    """A cubic spline through values (n,) at uniform times (n,) [s], read one time after the other."""

    def __init__(self, t: np.ndarray, values: np.ndarray) -> None:
        from scipy.interpolate import CubicSpline

        self.begin, self.per_second, self.last = float(t[0]), float(1 / (t[1] - t[0])), len(t) - 2
        self.pieces = CubicSpline(t, values).c.T.tolist()
        self.step = float(t[1] - t[0])

    def __call__(self, now: float) -> complex:
        k = min(max(int((now - self.begin) * self.per_second), 0), self.last)
        x = now - self.begin - k * self.step
        a, b, c, d = self.pieces[k]
        return ((a * x + b) * x + c) * x + d
