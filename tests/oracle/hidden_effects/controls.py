"""Devices whose controls are not those that the catalogue's formulas describe: what else stands at
such a bus.

Interfaces, units and signs are those of `devices`. u is the voltage over that before, power and
current likewise.
"""

from dataclasses import dataclass, field, replace
from math import asin, copysign, cos, pi, sin, sqrt

from hidden_effects.devices import Device, Inrush, drawn
from hidden_effects.supply import Moment, Profile
from independent.source import OMEGA


@dataclass(frozen=True)
class Rated(Device):
    """A device that draws `power` [pu] before the event, at the voltage V0 [pu]."""

    power: float
    V0: float = 1.0

    def rest(self) -> list[complex]:
        """The states before the event."""
        return []

    def settled(self, V: complex) -> tuple["Rated", list[complex]]:
        return replace(self, V0=abs(V)), self.rest()


@dataclass(frozen=True)
class Rectifier(Rated):
    """A diode bridge that feeds constant dc power up to a limit of its current; commutation costs
    voltage.

    The dc voltage falls by `overlap` of the current, u_d = u - k i, and so does the power factor,
    u_d/u. Source: Mohan, Undeland and Robbins 2003, section 5-6.
    """

    overlap: float = 0.12
    limit: float = 1.4  # of the current before

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, k = abs(V) / self.V0, self.overlap
        under = u**2 - 4 * k * (1 - k)
        i = min((u - sqrt(under)) / (2 * k), self.limit) if under > 0 else self.limit
        i = min(i, u / k)  # a bridge does not feed back
        P = i * (u - k * i)
        return drawn(self.power / (1 - k) * complex(P, sqrt((u * i) ** 2 - P**2)), V), []


@dataclass(frozen=True)
class CurrentControlled(Rated):
    """A converter with an inner current loop of first order and an outer integrator of its power.

    z' = k (1 - u i) without windup, i' = (min(z, limit) - i)/tau. Source: Yazdani and Iravani 2010,
    section 8.4.
    """

    tau: float = 0.004  # s
    rate: float = 80.0  # 1/s
    limit: float = 1.3

    def rest(self) -> list[complex]:
        return [1 + 0j, 1 + 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, asked, i = abs(V) / self.V0, x[0].real, x[1].real
        missing = 1 - u * i
        moves = 0.0 if asked >= self.limit and missing > 0 else self.rate * missing
        return drawn(complex(self.power * u * i), V), [
            moves,
            (min(asked, self.limit) - i) / self.tau,
        ]


@dataclass(frozen=True)
class VoltageLink(Rated):
    """A converter whose dc voltage v, not its energy, is controlled, and whose current has a limit.

    T v v' = u i - 1, i = min(limit, 1 + g (1 - v)). Source: Hu et al. 2017, before linearisation.
    """

    storage: float = 0.06  # s, T
    gain: float = 1.0
    limit: float = 1.5

    def rest(self) -> list[complex]:
        return [1 + 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, v = abs(V) / self.V0, max(x[0].real, 0.1)
        i = min(self.limit, max(0.0, 1 + self.gain * (1 - v)))
        demand = min(1.0, (v / 0.5) ** 2)  # drives let go where the link is nearly empty
        return drawn(complex(self.power * u * i), V), [(u * i - demand) / (self.storage * v)]


@dataclass(frozen=True)
class IntegralLink(Rated):
    """A converter whose dc voltage v has a proportional and an integral control, and whose current
    has a limit.

    T v v' = u i - 1, i = min(limit, 1 + z + 2 zeta w T (1 - v)), z' = w^2 T (1 - v), which stands
    still at the limit.
    Source: Yazdani and Iravani 2010, Voltage-Sourced Converters in Power Systems, section 8.6
    (dc-bus control).
    """

    storage: float = 0.06  # s, T
    frequency: float = 4.0  # Hz, w / 2 pi
    damping: float = 0.7  # zeta
    limit: float = 1.5

    def rest(self) -> list[complex]:
        return [1 + 0j, 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, v, z = abs(V) / self.V0, max(x[0].real, 0.1), x[1].real
        w, T = 2 * pi * self.frequency, self.storage
        asked = 1 + z + 2 * self.damping * w * T * (1 - v)
        i = min(self.limit, max(0.0, asked))
        demand = min(1.0, (v / 0.5) ** 2)  # drives let go where the link is nearly empty
        grows = 0.0 if asked != i and (asked > i) == (v < 1) else w**2 * T * (1 - v)
        return drawn(complex(self.power * u * i), V), [(u * i - demand) / (T * v), grows]


@dataclass(frozen=True)
class Ramped(Rated):
    """A converter that may lower its current at once and raises it along a ramp.

    Source: WECC 2014, generic converter model REGC_A: low-voltage current limit and recovery ramp,
    of a load.
    """

    rate: float = 5.0  # 1/s
    lag: float = 0.004  # s

    def rest(self) -> list[complex]:
        return [1 + 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, i = abs(V) / self.V0, x[0].real
        allowed = min(1.0, max(0.0, (u - 0.4) / 0.5))
        return drawn(complex(self.power * u * i), V), [min((allowed - i) / self.lag, self.rate)]


@dataclass(frozen=True)
class InputFilter(Rated):
    """A drive of constant power behind a filter of L and C, which hardly damps: its resistance is
    negative.

    i' = w (u (1 + R) - v - R i)/Z, v' = w Z (i - j(v)), j = 1/v down to v = 0.85, there a
    conductance; the damping ratio is (R/Z - Z)/2. Source: Middlebrook 1976.
    """

    frequency: float = 4.0  # Hz
    damping: float = 0.08
    impedance: float = 0.15  # Z

    @property
    def resistance(self) -> float:
        return self.impedance * (2 * self.damping + self.impedance)

    def rest(self) -> list[complex]:
        return [1 + 0j, 1 + 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, i, v = abs(V) / self.V0, x[0].real, x[1].real
        w, Z, R = 2 * pi * self.frequency, self.impedance, self.resistance
        taken = 1 / v if v > 0.85 else v / 0.85**2
        rates = [w / Z * (u * (1 + R) - v - R * i), w * Z * (i - taken)]
        return drawn(complex(self.power * u * i), V), rates


@dataclass(frozen=True)
class SynchronousMotor(Rated):
    """A rotary frequency converter, seen as a synchronous motor behind its transient reactance,
    swings on the bus.

    P = E u sin(d)/X, Q = (u^2 - E u cos(d))/X, d' = w_0 (f - w), 2 H w' = P + D (f - w) - P_0; its
    powers per unit of its rating, of which it is loaded to 0.7. Source: Kundur 1994, section 12.3.
    """

    frequency: float = 2.5  # Hz of the swing
    damping: float = 0.08
    X: float = 0.35
    emf: float = 1.15
    loaded: float = 0.7

    @property
    def angle(self) -> float:
        """Before the event [rad]."""
        return asin(self.loaded * self.X / self.emf)

    def rest(self) -> list[complex]:
        return [complex(self.angle), 1 + 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, d, speed = abs(V) / self.V0, x[0].real, x[1].real
        natural = 2 * pi * self.frequency
        twice_H = OMEGA * self.emf * cos(self.angle) / self.X / natural**2
        P = self.emf * u * sin(d) / self.X
        Q = (u**2 - self.emf * u * cos(d)) / self.X
        slip = now.f - speed
        rates = [OMEGA * slip, (P - self.loaded) / twice_H + 2 * self.damping * natural * slip]
        return drawn(self.power / self.loaded * complex(P, Q), V), rates


@dataclass(frozen=True)
class SusceptanceControl(Device):
    """A thyristor-controlled compensator: the voltage is measured late, its susceptance integrated
    with a droop.

    m' = (u - m)/T_m, b' = K (1 - m - s b) without windup, within -1..1, of the rating. Source:
    Kundur 1994, 11.2.
    """

    rating: float  # pu of susceptance
    integral: float = 120.0  # 1/s
    droop: float = 0.05
    measured: float = 0.015  # s
    V0: float = 1.0

    def settled(self, V: complex) -> tuple["SusceptanceControl", list[complex]]:
        return replace(self, V0=abs(V)), [1 + 0j, 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        seen, b = x[0].real, x[1].real
        wanted = self.integral * (1 - seen - self.droop * b)
        stuck = (b >= 1 and wanted > 0) or (b <= -1 and wanted < 0)
        rates = [(abs(V) / self.V0 - seen) / self.measured, 0.0 if stuck else wanted]
        return 1j * self.rating * max(-1.0, min(1.0, b)) * V, rates


@dataclass(frozen=True)
class DeadBand(Device):
    """A compensator of current that sleeps within a band of the voltage and moves no faster than
    its rate.

    Of the rating: i' = (K (|1 - u| - band)_+ sign(1 - u) - i)/T, within -1..1 and no faster than
    `rate`. Source: generic; dead bands and limited rates are usual in such regulators.
    """

    rating: float  # pu of current
    band: float = 0.08
    gain: float = 6.0
    lag: float = 0.02  # s
    rate: float = 10.0  # 1/s
    V0: float = 1.0

    def settled(self, V: complex) -> tuple["DeadBand", list[complex]]:
        return replace(self, V0=abs(V)), [0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        off, i = 1 - abs(V) / self.V0, x[0].real
        aim = copysign(min(1.0, self.gain * max(0.0, abs(off) - self.band)), off)
        moves = max(-self.rate, min(self.rate, (aim - i) / self.lag))
        return 1j * self.rating * i * V / abs(V), [moves]


@dataclass(frozen=True)
class SwitchedBanks(Device):
    """Capacitor banks that relays switch in and out: `profile` of the susceptance
    `b` [pu] is in.
    """

    b: float
    profile: Profile = field(default_factory=Profile)

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        return 1j * self.b * self.profile(now.t) * V, []


@dataclass(frozen=True)
class Thermostat(Rated):
    """Heating under thermostats: what is switched on grows until the heat is what it was, P = g
    u^2.

    g' = (1 - g u^2)/T, g at most 1.5. Source: Kundur 1994, section 7.1 (thermostatically controlled
    loads).
    """

    pace: float = 0.5  # s

    def rest(self) -> list[complex]:
        return [1 + 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, g = abs(V) / self.V0, x[0].real
        moves = (1 - g * u**2) / self.pace
        return drawn(complex(self.power * g * u**2), V), [0.0 if g >= 1.5 and moves > 0 else moves]


@dataclass(frozen=True)
class TwoPaces(Rated):
    """Load that falls with u^2 and comes back to a constant current, half of it soon and half of it
    late.

    P = u^2 + x + y, T x' = (u - u^2)/2 - x and likewise y. Source: two loads of Karlsson and Hill
    1994 side by side.
    """

    soon: float = 0.1  # s
    late: float = 1.0  # s

    def rest(self) -> list[complex]:
        return [0j, 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u = abs(V) / self.V0
        rates: list[complex] = [
            ((u - u**2) / 2 - y) / T for y, T in zip(x, (self.soon, self.late), strict=True)
        ]
        return drawn(complex(self.power * (u**2 + sum(y.real for y in x))), V), rates


@dataclass(frozen=True)
class Tapped(Rated):
    """An impedance behind a transformer whose ratio is `profile` above that before: tap changers
    restore its power.
    """

    profile: Profile = field(default_factory=Profile)

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u = abs(V) / self.V0 * (1 + self.profile(now.t))
        return drawn(complex(self.power * u**2), V), []


@dataclass(frozen=True)
class Held(Rated):
    """Traction that gives up power quickly on its way down a curve, and asks for it again only once
    the line is back.

    P = m, m falls to 1 - (full - u)/(full - off) within 10 ms; it rises at `rate` while u is above
    `back`.
    Source: EN 50388-1 has power given back slowly, so that trains do not swing with the line.
    """

    full: float = 0.9
    off: float = 0.6
    back: float = 0.93
    rate: float = 1.0  # 1/s

    def rest(self) -> list[complex]:
        return [1 + 0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, m = abs(V) / self.V0, x[0].real
        aim = min(1.0, max(0.0, 1 - (self.full - u) / (self.full - self.off)))
        rises = self.rate if u > self.back and m < 1 else 0.0
        return drawn(complex(self.power * m), V), [(aim - m) / 0.01 if aim < m else rises]


@dataclass(frozen=True)
class Staged(Rated):
    """Traction that takes back its power in stages, `profile` of it by now; between them power is
    held.
    """

    profile: Profile = field(default_factory=Profile)
    limit: float = 1.5

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        allowed = min(1 - self.profile(now.t), self.limit * abs(V) / self.V0)
        return drawn(complex(self.power * allowed), V), []


@dataclass(frozen=True)
class ResistiveInrush(Inrush):
    """Inrush whose offset is driven back by the resistance that the unidirectional current meets.

    The offset falls with the mean of the saturated current, fast at first and ever slower, beside a
    slow decay.
    """

    resistance: float = 20.0  # 1/s of flux per pu of mean current

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        current, (rate,) = super().flow(now, V, x)
        angle, U = self.saturated(x[0].real, abs(V)), abs(V)
        mean = U * (sin(angle) - angle * cos(angle)) / pi
        return current, [rate - self.resistance * mean]
