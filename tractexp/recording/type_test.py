"""What a relay's report of a motor tells without a fit: a start, an unbalance, a trip and the
coasting after it are a type test.

    start, unbalance:   Z = |V1|/|I1| at standstill, |V2|/|I2| near it (slip 2 - s)
    after the breaker:  |V1|/f ~ exp(-t/T0')
    and at its opening: 2 H df/dt = -f_n P/S of before, while nothing but the load brakes, by a
                        torque of a power k of the speed: f^(1 - k) falls on a straight line

Impedances and H are per unit of the voltage before the trip (or the start) and of the apparent
power that the motor drew running. Of one that is tripped before it runs up impedances are in ohm:
what it draws running is not known. Source: Kundur 1994, ch. 7; IEEE 112-2017, tests of locked rotor
and retardation.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.record.change import find_runs
from tractexp.record.phasor import Phasors
from tractexp.record.phasor_measurement import FASTEST, SLOWEST
from tractexp.record.record import Record
from tractexp.record.regression import fit_line

CLOSED_SHARE = 0.05  # of the greatest current: what is less flows through no closed breaker
ALIVE_SHARE = 0.3  # of the greatest voltage: what is more is one
SWITCHING_CYCLES = 2.0  # cycles about a switching that windows blur
SHORTEST_PART = 3.0  # cycles that are measured at least
LONGEST_STANDSTILL = 0.2  # s after closing in which a motor hardly turns
LEAST_STARTING_CURRENT = 2.0  # times the current of running, that of a start
# of the power of a motor that stands still, the reactive share: a heater has less, a reactor more
LOCKED_SHARE = (0.75, 0.99)
# of the positive sequence, what the negative one has of current and of voltage
LEAST_SECOND_CURRENT, LEAST_SECOND_VOLTAGE = 0.03, 0.006
LEAST_DECAY = 0.9  # of the voltage at the opening, at the end of coasting
LEAST_LEFT = 0.1  # of it: with less the frequency is not measured
STEADY_CURRENT = 0.1  # of a current: by more it changes while a motor still runs up
LEAST_ERROR = 0.02  # of a value: of what transformers of measurement and windows leave
TWO_ERRORS = 2.0
# of the nominal frequency: down to where the voltage of a motor that coasts is followed
SLOWEST_COASTING = 0.6
BRAKING_LAWS = (0.0, 0.5, 1.0, 1.5, 2.0)  # powers of the speed by which a load's torque goes
MOST_WORSE_LAW = 2.0  # times what the best law leaves: what one leaves that may be it, too
# of the power drawn: what a stator loses, usually two to five percent, brakes no rotor
MOST_STATOR_LOSS = 0.06
FEWEST_PHASORS = 20


@dataclass(frozen=True)
class TypeValue:
    """One figure of a type test, with a 95 % interval; `how` it was measured."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    how: str

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        span = f"{self.low:.3g} to {self.high:.3g}"
        return f"{self.name} {self.value:.3g}{unit} ({span}) from {self.how}"


@dataclass(frozen=True)
class TypeTest:
    """What a report tells of a motor: `values`, per unit of `voltage` [kV] and `power` [MVA], at a
    nominal `frequency` [Hz]; `reactive` is the share of the reactance in the impedance at the
    start, 1 without one.
    """

    values: tuple[TypeValue, ...]
    voltage: float
    power: float
    frequency: float
    reactive: float = 1.0

    def __str__(self) -> str:
        told = ", ".join(map(str, self.values))
        return f"a type test: {told}; per unit of {self.power:.3g} MVA and {self.voltage:.4g} kV"

    def to_dict(self) -> dict[str, Any]:
        """The test as `look.json` has it."""
        return {
            "values": [vars(each) for each in self.values],
            "voltage": self.voltage,
            "power": self.power,
            "bounds": self.bounds,
            "sentence": str(self),
        }

    @property
    def bounds(self) -> dict[str, list[float]]:
        """The `model.bounds` of a motor that is fitted on this base: at standstill a machine is its
        transient reactance behind resistances.
        """
        by_name = {each.name: each for each in self.values}
        found = {}
        if (impedance := by_name.get("X_locked", by_name.get("X_2"))) is not None:
            found["X_prime"] = [impedance.low * self.reactive, impedance.high]
        if (H := by_name.get("H")) is not None:
            omega_n = 2 * np.pi * self.frequency
            found["M"] = [2 * H.low / omega_n, 2 * H.high / omega_n]  # M = 2 H/omega_n, pu s²/rad
        return found


@dataclass(frozen=True)
class FailedStart(TypeTest):
    """What a report tells of a motor that was tripped before it ran up: impedances in ohm, at the
    `voltage` [kV] and `power` [MVA] of the start; its rating is not known.
    """

    def __str__(self) -> str:
        told = ", ".join(map(str, self.values))
        return (
            f"a start that failed, if it is a motor: {told}; it drew {self.power:.3g} MVA at"
            f" {self.voltage:.4g} kV"
        )

    @property
    def bounds(self) -> dict[str, list[float]]:
        """None: they would be per unit of what it draws running."""
        return {}


@dataclass(frozen=True, eq=False)
class MotorCourse:
    """A motor over time: t (N,) [s], voltage U and its negative sequence U2 [kV, line to line],
    currents I and I2 [kA] of one phase, power S [MVA], complex, frequency f [Hz], followed down to
    `slowest` of the nominal one; `U2` and `I2` are None where a record has not both.
    """

    t: np.ndarray
    U: np.ndarray
    I: np.ndarray
    S: np.ndarray
    f: np.ndarray
    U2: np.ndarray | None = None
    I2: np.ndarray | None = None
    slowest: float = SLOWEST

    @classmethod
    def from_phasors(cls, phasors: Phasors, nominal: float) -> "MotorCourse":
        """The course of phasors of three phases.

        A mean over one cycle of a frequency that is tracked no further lessens the voltage of a
        motor that turns slower, by as much as can be told.
        """
        current = np.abs(phasors.I1)
        second = np.abs(phasors.I2)
        tracked = np.clip(phasors.f, SLOWEST * nominal, FASTEST * nominal)
        return cls(
            phasors.t,
            phasors.U / np.sinc(phasors.f / tracked - 1),
            current,
            phasors.S,
            phasors.f,
            phasors.U2,
            second,
            SLOWEST_COASTING,
        )

    @classmethod
    def from_record(cls, record: Record) -> "MotorCourse | None":
        """The course of a record in kV, kA and MVA; None if the record does not say how many kV and
        MVA its per unit is, if no frequency was recorded, or if U, P or Q is missing or U is not
        positive somewhere.
        """
        if record.f is None or not record.is_from_field:
            return None
        U = record.base.voltage * record.U
        S = record.base.power * (record.P + 1j * record.Q)
        if not (np.isfinite(S).all() and (U > 0).all()):
            return None
        current = np.abs(S) / (np.sqrt(3) * U)
        return cls(
            record.t,
            U,
            current,
            S,
            record.f,
        )


def find_type_test(course: MotorCourse, nominal: float) -> TypeTest | None:
    """The type test that a motor's course shows; None where it shows none, or where it is not known
    what it draws running.
    """
    if len(course.t) < FEWEST_PHASORS:
        return None
    report = _Report(course, nominal)
    running = report.find_running()
    if running is None:
        return None
    voltage = float(np.median(course.U[running]))
    power = float(np.median(np.abs(course.S[running])))
    if report.is_locked(running):
        seen = (report.measure_locked(running), report.measure_unbalance(1.0, "ohm"))
        return FailedStart(tuple(filter(None, seen)), voltage, power, nominal)
    ohm = voltage**2 / power
    values = [
        report.measure_start(running, ohm),
        report.measure_unbalance(ohm),
        *report.measure_coasting(running, power),
    ]
    found = tuple(each for each in values if each is not None)
    reactive = report.find_reactive_share() if values[0] else 1.0
    return TypeTest(found, voltage, power, nominal, reactive) if found else None


class _Report:
    """The course of one motor, where its breaker is closed, and where that changes."""

    def __init__(self, course: MotorCourse, nominal: float):
        self.course = course
        self.nominal = nominal
        step = float(course.t[1] - course.t[0])
        cycle = 1 / (nominal * step)  # samples
        self.edge = max(round(SWITCHING_CYCLES * cycle), 1)
        self.least = max(SHORTEST_PART * cycle, 4)
        self.standstill = round(LONGEST_STANDSTILL / step)
        self.current = course.I
        self.voltage = course.U
        closed = self.current > CLOSED_SHARE * self.current.max(initial=0.0)
        spans = find_runs(closed, int(self.least) + 2 * self.edge)
        self.closed = spans[0] if len(spans) == 1 else None

    def find_running(self) -> slice | None:
        """The last samples before the breaker opens, or of the record, where the current is
        steady; None where it is not, and where it flows in several spans or throughout.
        """
        span = self.closed
        if span is None:
            return None
        last = len(self.current) - self.edge
        if span.start <= self.edge and span.stop >= last:
            return None
        stop = span.stop - self.edge
        part = slice(max(span.start + self.edge, stop - self.standstill), stop)
        current = self.current[part]
        if len(current) < self.least or np.ptp(current) > STEADY_CURRENT * current.max():
            return None
        return part

    @property
    def has_start(self) -> bool:
        """Whether the breaker closes within the record, onto a voltage."""
        assert self.closed is not None
        first = self.closed.start
        alive = self.voltage[first] >= ALIVE_SHARE * self.voltage.max()
        return first >= self.least and bool(alive)

    def is_locked(self, running: slice) -> bool:
        """Whether the current of a start has not fallen when the breaker opens, and is that of a
        motor that stands still.
        """
        assert self.closed is not None
        opens = self.closed.stop < len(self.current) - self.edge
        current = self.current[self.start_part]
        if not (opens and self.has_start and len(current)):
            return False
        usual = float(np.median(self.current[running]))
        drawn = self.course.S[running]
        share = float(np.median(np.sin(np.angle(drawn))))
        least, most = LOCKED_SHARE
        return bool(np.ptp([*current, usual]) < STEADY_CURRENT * usual) and least < share < most

    def measure_locked(self, running: slice) -> TypeValue:
        """The impedance [ohm] of a motor that never turns, until its breaker opens."""
        impedance = self.voltage[running] / (np.sqrt(3) * self.current[running])
        return _measure("Z_locked", impedance, "U/I before the trip", "ohm")

    def measure_start(self, running: slice, ohm: float) -> TypeValue | None:
        """The impedance at standstill; None where no start is recorded."""
        part = self.start_part
        current = self.current[part]
        usual = float(np.median(self.current[running]))
        falls = len(current) and current.min() >= LEAST_STARTING_CURRENT * usual
        if not (self.has_start and falls):
            return None
        impedance = self.voltage[part] / (np.sqrt(3) * current)
        return _measure("X_locked", impedance / ohm, "U/I at the start")

    @property
    def start_part(self) -> slice:
        """The samples after the breaker closes in which a motor hardly turns."""
        assert self.closed is not None
        first = self.closed.start + self.edge
        return slice(first, first + self.standstill // 2)

    def find_reactive_share(self) -> float:
        """The share of the reactance in the impedance at the start."""
        drawn = self.course.S[self.start_part]
        return float(np.median(np.abs(np.sin(np.angle(drawn)))))

    def measure_unbalance(self, ohm: float, unit: str = "pu") -> TypeValue | None:
        """The impedance of the negative sequence; None where there is hardly any."""
        assert self.closed is not None
        part = slice(self.closed.start + self.edge, self.closed.stop - self.edge)
        if self.course.U2 is None or self.course.I2 is None:
            return None
        voltage = self.course.U2[part]
        current = self.course.I2[part]
        seen = current > LEAST_SECOND_CURRENT * self.current[part]
        seen &= voltage > LEAST_SECOND_VOLTAGE * self.voltage[part]
        if np.count_nonzero(seen) < self.least:
            return None
        impedance = voltage[seen] / (np.sqrt(3) * current[seen])
        return _measure("X_2", impedance / ohm, "U2/I2", unit)

    def measure_coasting(self, running: slice, power: float) -> list[TypeValue | None]:
        """T0' and H of what follows the opening of the breaker; nothing where the voltage stays, or
        is gone at once.
        """
        assert self.closed is not None
        first = self.closed.stop + self.edge
        V = self.voltage[first:]
        if len(V) < self.least or V[0] < ALIVE_SHARE * self.voltage.max():
            return []
        f = self.course.f[first:]
        t = self.course.t[first:] - self.course.t[self.closed.stop]
        # phasors follow a frequency so far
        seen = (LEAST_LEFT * V[0] < V) & (f > self.course.slowest * self.nominal)
        left = int(np.argmin([*seen, False]))
        V, f, t = V[:left], f[:left], t[:left]
        if len(V) < self.least or V[-1] > LEAST_DECAY * V[0] or f[-1] >= f[0]:
            return []
        drawn = float(np.median(np.real(self.course.S[running]))) / power
        before = float(np.median(self.course.f[running]))
        decays = _fit_slopes(t, np.log(V / f))
        times = [-1 / slope for slope in decays if slope < 0]
        inertias = [-drawn / (2 * slope) for slope in _fit_braking(t, f / before) if slope < 0]
        inertias += [(1 - MOST_STATOR_LOSS) * H for H in inertias[:1]]
        constant = _tell("T0'", times, "the decay of U/f after the trip")
        inertia = _tell("H", inertias, "df/dt at the trip")
        return [constant, inertia]


def _measure(name: str, samples: np.ndarray, how: str, unit: str = "pu") -> TypeValue:
    """The mean of samples (n,) and how far it moves where blocks are left out."""
    level = np.ones((len(samples), 1))
    (value,), (error,) = fit_line(level, samples)
    half = max(TWO_ERRORS * float(error), LEAST_ERROR * float(value))
    middle = float(value)
    return TypeValue(
        name,
        middle,
        middle - half,
        middle + half,
        unit,
        how,
    )


def _tell(name: str, values: list[float], how: str) -> TypeValue | None:
    """The first of times [s], and an interval over all; None of none."""
    if not values:
        return None
    first = values[0]
    half = LEAST_ERROR * first
    low = min(*values, first - half)
    high = max(*values, first + half)
    return TypeValue(
        name,
        first,
        low,
        high,
        "s",
        how,
    )


def _fit_slopes(t: np.ndarray, y: np.ndarray) -> list[float]:
    """The slope of a straight line through y (n,), then both ends of its 95 % interval."""
    X = np.vander(t, 2, increasing=True)
    fit, errors = fit_line(X, y)
    slope = float(fit[1])
    half = TWO_ERRORS * float(errors[1])
    return [slope, slope - half, slope + half]


def _fit_braking(t: np.ndarray, speed: np.ndarray) -> list[float]:
    """Slopes at t = 0 of a speed (n,) that a load brakes, with both ends of their 95 % intervals:
    those of the law that fits best, then those of all that may be it.
    """
    fits = sorted(_fit_law(t, speed, k) for k in BRAKING_LAWS)
    least, _ = fits[0]
    return [slope for left, slopes in fits if left <= MOST_WORSE_LAW * least for slope in slopes]


def _fit_law(t: np.ndarray, speed: np.ndarray, k: float) -> tuple[float, list[float]]:
    """What the torque of a power k of the speed (n,) leaves, and the slopes at t = 0 by it."""
    from scipy.special import boxcox, inv_boxcox

    straight = boxcox(speed, 1 - k)
    slopes = _fit_slopes(t, straight)
    level = float(np.mean(straight - slopes[0] * t))
    left = float(np.std(straight - slopes[0] * t))
    start = float(inv_boxcox(level, 1 - k))
    return left, [start**k * slope for slope in slopes]
