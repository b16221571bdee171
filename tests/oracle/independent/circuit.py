"""Instantaneous currents of a load of several devices, integrated in the stationary frame by
SciPy's DOP853.

Each device has states of its own (complex flux linkages, speed) and draws a space vector of current
at the voltage's. Per unit of the record's base, peaks; the voltage is given, so devices do not feel
each other.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from independent.fault import Fault, vector
from independent.machine import Machine
from independent.source import NOMINAL_FREQUENCY, OMEGA

EARLY = 0.55  # s before the record at which a simulation begins
SETTLED = 60  # of the repeated substitutions in a saturated air gap, at most


@dataclass(frozen=True, eq=False)
class Scene:
    """What a device feels at times t (n,) [s]: space vector, its slope [1/s] and zero sequence (n,)
    of the voltage.
    """

    t: np.ndarray
    v: np.ndarray
    slope: np.ndarray
    zero: np.ndarray
    fault: Fault

    @property
    def turn(self) -> np.ndarray:
        """A space vector of 1 that is in phase with the voltage before the fault (n,)."""
        before = self.fault.before / abs(self.fault.before)
        return before * np.exp(2j * np.pi * self.fault.frequency * self.t)


class Stateless:
    """A device that remembers nothing."""

    def settled(self, voltage: complex, frequency: float) -> tuple[Self, np.ndarray]:
        return self, np.empty(0, dtype=complex)

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return []


@dataclass(frozen=True)
class Group:
    """Induction motors of `rating` [pu] that drive `torque` [pu of the rating]; further fields are
    off at 0.

    `fan` is the share of the torque that grows with the square of the speed, `saturation` the
    relative growth of the magnetizing current per pu² of air-gap flux beyond that before the event.
    """

    machine: Machine
    rating: float
    torque: float
    fan: float = 0.0
    saturation: float = 0.0
    speed: float = 1.0  # pu, before the event; these two are set by `settled`
    flux: float = 1.0  # pu², square of the air gap's

    def settled(self, voltage: complex, frequency: float) -> tuple["Group", np.ndarray]:
        """The group at rest on a voltage [pu] of a frequency over nominal, and its states; raises
        `Stall`.
        """
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

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return self.rating * (x[0] - self.gap(x[0], x[1])) / self.machine.Xs

    def truth(self) -> dict[str, float]:
        """What the fifth-order model calls this group, on the record's base."""
        m = self.machine
        return {
            "T_prime": m.X_prime / m.X * m.T0_prime,
            "X_prime": m.X_prime / self.rating,
            "C": (m.X - m.X_prime) / m.X,
            "M": 2 * m.H * self.rating / OMEGA,
            "T_m": self.torque * self.rating,
            "R_s": m.Rs / self.rating,
        }


@dataclass(frozen=True)
class Branch:
    """Resistance and reactance in series [pu]."""

    R: float
    X: float

    def settled(self, voltage: complex, frequency: float) -> tuple["Branch", np.ndarray]:
        return self, np.array([self.X * voltage / (self.R + 1j * self.X * frequency)])

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return [OMEGA * (v - self.R * x[0] / self.X)]

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return x[0] / self.X


@dataclass(frozen=True)
class Shunt(Stateless):
    """Conductance and capacitive susceptance [pu]; no states."""

    G: float = 0.0
    B: float = 0.0

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return self.G * at.v + self.B * at.slope / OMEGA


@dataclass(frozen=True)
class Core:
    """A transformer's core without load: beyond `knee` [pu of flux] each limb draws by the air's
    reactance `X` [pu].
    """

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

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return self._drawn(x[0])


@dataclass(frozen=True)
class Earthed:
    """Resistance and reactance [pu] between neutral and earth as the zero sequence sees them; draws
    nothing else.
    """

    R: float
    X: float

    def settled(self, voltage: complex, frequency: float) -> tuple["Earthed", np.ndarray]:
        return self, np.zeros(1, dtype=complex)

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return [OMEGA * (zero - self.R * x[0] / self.X)]

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return np.zeros_like(at.v)

    def zero(self, x: np.ndarray, at: Scene) -> np.ndarray:
        """The zero sequence (n,) that it draws."""
        return x[0].real / self.X


@dataclass(frozen=True)
class Across:
    """Resistance and reactance [pu] in series between phases b and c: a load of one phase."""

    R: float
    X: float

    def settled(self, voltage: complex, frequency: float) -> tuple["Across", np.ndarray]:
        a, z = np.exp(2j * np.pi / 3), self.R + 1j * self.X * frequency
        drawn = voltage * (a**2 - a) / z  # phasor of what flows from b to c
        return self, np.array([complex((self.X * drawn).real)])

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return [OMEGA * (np.sqrt(3) * v.imag - self.R * x[0] / self.X)]  # u_b - u_c

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return 2j / np.sqrt(3) * x[0].real / self.X


@dataclass(frozen=True)
class Held:
    """A converter that draws `power` [pu] whatever the voltage, which it knows with the lag `lag`
    [s], up to `most`.
    """

    power: complex
    lag: float = 0.004
    most: float = 2.0  # times the current before

    def settled(self, voltage: complex, frequency: float) -> tuple["Held", np.ndarray]:
        return self, np.array([complex(voltage)])

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return [(v - x[0]) / self.lag + 1j * OMEGA * x[0]]

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        # The lag turns a voltage of nominal frequency by nothing; where the frequency is off,
        # hardly.
        wanted, most = np.conj(self.power / x[0]), self.most * abs(self.power)
        return wanted * np.minimum(1.0, most / np.abs(wanted))


@dataclass(frozen=True)
class Arc(Stateless):
    """A conductance [pu] to earth in each phase, there while the fault is."""

    G: float

    def _burning(self, at: Scene) -> np.ndarray:
        return self.G * ((at.t >= at.fault.start) & (at.t < at.fault.end))

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return self._burning(at) * at.v

    def zero(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return self._burning(at) * at.zero


@dataclass(frozen=True)
class Rectifier(Stateless):
    """Currents of fifth and seventh order [pu] that go on through the fault."""

    fifth: complex
    seventh: complex

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return self.fifth * at.turn.conj() ** 5 + self.seventh * at.turn**7


@dataclass(frozen=True)
class Relay:
    """Off `after` [s] after the fault's start; back, along a `ramp` [s], `back` [s]
    after its end.
    """

    after: float
    back: float = np.inf
    ramp: float = 0.02

    def off(self, at: Scene) -> np.ndarray:
        """1 while off, 0 while on, (n,)."""
        gone = at.t >= at.fault.start + self.after
        return gone * (1 - np.clip((at.t - at.fault.end - self.back) / self.ramp, 0, 1))


@dataclass(frozen=True)
class Switched:
    """A share of a device that a relay disconnects; its states run on."""

    device: "Branch | Shunt | Group"
    share: float
    relay: Relay

    def settled(self, voltage: complex, frequency: float) -> tuple["Switched", np.ndarray]:
        device, states = self.device.settled(voltage, frequency)
        return replace(self, device=device), states

    def rates(self, x: list[complex], v: complex, zero: float) -> list[complex]:
        return self.device.rates(x, v, zero)

    def current(self, x: np.ndarray, at: Scene) -> np.ndarray:
        return self.device.current(x, at) * (1 - self.share * self.relay.off(at))


@dataclass(frozen=True)
class Breaker(Stateless):
    """Takes away a share of each phase's current of the whole load, as a relay says."""

    shares: tuple[float, float, float]
    relay: Relay

    def passed(
        self, current: np.ndarray, zero: np.ndarray, at: Scene
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is left of a space vector and a zero sequence (n,)."""
        phases = (current * np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]).real + zero
        return vector(phases * (1 - np.array(self.shares)[:, None] * self.relay.off(at)))


Device = (
    Group | Branch | Shunt | Core | Earthed | Across | Held | Arc | Rectifier | Switched | Breaker
)


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
    made = [
        d.settled(fault.before * np.exp(2j * np.pi * fault.frequency * begin), w) for d in devices
    ]
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
        solved = solve_ivp(
            slopes, (begin, t[-1]), start, "DOP853", t, rtol=1e-8, atol=1e-10, max_step=0.004
        )
        if not solved.success:
            raise RuntimeError(f"the simulation stopped: {solved.message}")
        y = solved.y
    at = Scene(t, v[early:], np.gradient(v, grid)[early:], zero[early:], fault)
    current, current_zero = np.zeros_like(at.v), np.zeros(len(t))
    for d, a, b in parts:
        if not isinstance(d, Breaker):
            current += d.current(y[a:b], at)
            current_zero += d.zero(y[a:b], at) if isinstance(d, Earthed | Arc) else 0.0
    for d in devices:
        if isinstance(d, Breaker):
            current, current_zero = d.passed(current, current_zero, at)
    return Instants(t, at.v, at.zero, current, current_zero)


class Smooth:
    """A cubic spline through values (n,) at uniform times (n,) [s], read one time
    after the other.
    """

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
