"""What stands beside the motors: the static load, converters, compensators, transformers, arcs.

A device is settled at the load's voltage before the event (`settled(V)` returns it with its states)
and then answers, instant by instant, what current it draws and how its states move (`flow(now, V,
x)`). Per unit of the record's base, times in s; currents are phasors in the frame that turns with
the bus voltage, positive when drawn.
"""

from dataclasses import dataclass, field, replace
from math import acos, cos, exp, pi, sin, sqrt

from hidden_effects.supply import Moment, Profile


def drawn(S: complex, V: complex) -> complex:
    """The current that carries the power S at the voltage V."""
    return (S / V).conjugate()


@dataclass(frozen=True)
class Device:
    """A part without states, in rest at once."""

    def settled(self, V: complex) -> tuple["Device", list[complex]]:
        """The device at rest on the voltage V, and its states."""
        return self, []

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        """Current [pu] and the time derivative of the states."""
        raise NotImplementedError


@dataclass(frozen=True)
class Static(Device):
    """Exponential static load that may depend on frequency, grow with time, or recover slowly.

    Recovery is that of Karlsson and Hill 1994: at first the exponent is `p_v`, in the end `p_v -
    recovery`.
    """

    p_v: float
    q_v: float
    S: complex = 0j  # pu, before the event
    V0: float = 1.0  # pu
    k_p: float = 0.0  # exponent of frequency, active power
    k_q: float = 0.0  # reactive power
    growth: complex = 0j  # pu/s
    grows_from: float | None = None  # s; None: from the start of the record
    recovery: float = 0.0
    pace: float = 1.0  # s, time constant of the recovery
    # 1/s, by which both exponents grow with time: other customers take their turn
    mixing: float = 0.0

    def sized(self, S: complex, V: complex) -> "Static":
        """The static load that draws S at V; ValueError where that would be a source of active
        power.
        """
        if S.real <= 0:
            raise ValueError(
                f"the other parts leave {S.real:.3g} pu to the static load; it must be positive"
            )
        return replace(self, S=S, V0=abs(V))

    def settled(self, V: complex) -> tuple["Static", list[complex]]:
        return self, [0j] if self.recovery else []

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        since = now.t if self.grows_from is None else max(now.t - self.grows_from, 0.0)
        u, S = abs(V) / self.V0, self.S + self.growth * since
        mixed = self.mixing * now.t
        P, Q = S.real * u ** (self.p_v + mixed), S.imag * u ** (self.q_v + mixed)
        if now.f != 1.0:
            P, Q = P * now.f**self.k_p, Q * now.f**self.k_q
        if not self.recovery:
            return drawn(complex(P, Q), V), []
        x_rate = -x[0].real / self.pace + S.real * (u ** (self.p_v - self.recovery) - u**self.p_v)
        return drawn(complex(P + x[0].real / self.pace, Q), V), [x_rate]


@dataclass(frozen=True)
class Converter(Device):
    """A four-quadrant converter of unity power factor that draws `power`, its voltage seen through
    a filter.

    Its power is held constant until the current reaches `limit` (of the current before); below
    `block` (of the voltage before) it is a conductance. A limit by line voltage applies where
    `full` is given: full power down to `full`, linearly to `rest` of it at `empty` (voltages over
    the one before), as EN 50388 asks of trains.
    """

    power: float
    limit: float = 10.0
    block: float = 0.3
    full: float = 0.0
    empty: float = 0.0
    rest: float = 0.0
    filter: float = 0.002  # s
    V0: float = 1.0

    def settled(self, V: complex) -> tuple["Converter", list[complex]]:
        return replace(self, V0=abs(V)), [complex(1.0)]

    def allowed(self, u: float) -> float:
        """Power the controls ask for, over the power before, at the filtered voltage u."""
        if u < self.block:
            return self.allowed(self.block) * (u / self.block) ** 2
        allowed = 1.0
        if self.full and u < self.full:
            allowed = max(
                self.rest, self.rest + (1 - self.rest) * (u - self.empty) / (self.full - self.empty)
            )
        return min(allowed, self.limit * u)

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        seen = max(x[0].real, 0.01)  # a solver's trial step may overshoot
        # The current is set from the filtered voltage, so that power slips with u/seen while the
        # filter follows.
        power = self.power * self.allowed(seen) * abs(V) / self.V0 / seen
        return drawn(complex(power), V), [(abs(V) / self.V0 - seen) / self.filter]


@dataclass(frozen=True)
class Link(Device):
    """A converter behind a dc link: the stored energy W sets the current, W' = U i - P.

    i = i_0 + k (W_0 - W) + c z, z' = W_0 - W: without c the power lags by 1/(k U), with it the link
    rings.
    Source: energy balance of the dc link of a four-quadrant converter.
    """

    power: float
    k: float  # 1/s
    c: float = 0.0  # 1/s²
    V0: float = 1.0

    @classmethod
    def lagging(cls, power: float, lag: float) -> "Link":
        """Power comes back with the time constant `lag` [s]."""
        return cls(power, 1 / lag)

    @classmethod
    def ringing(cls, power: float, frequency: float, damping: float) -> "Link":
        """Power rings at `frequency` [Hz] with the damping ratio `damping`."""
        natural = 2 * pi * frequency
        return cls(power, 2 * damping * natural, natural**2)

    def settled(self, V: complex) -> tuple["Link", list[complex]]:
        return replace(self, V0=abs(V)), [0j, 0j] if self.c else [0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, missing = abs(V) / self.V0, x[0].real  # W_0 - W over the power
        current = 1 + self.k * missing + (self.c * x[1].real if self.c else 0.0)
        rates = [1 - u * current, missing] if self.c else [1 - u * current]
        return drawn(complex(self.power * u * current), V), rates


@dataclass(frozen=True)
class Capacitor(Device):
    """A fixed shunt bank of susceptance `b` [pu]."""

    b: float

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        return 1j * self.b * now.f * V, []


@dataclass(frozen=True)
class Inrush(Device):
    """Transformers whose core flux is offset by a returning voltage; the offset decays and the core
    desaturates.

    A core of saturated susceptance `b` carries current while its flux U cos(theta) + offset exceeds
    the knee; its fundamental is reactive. Source: Blume et al. 1951, inrush of a core with a
    two-slope magnetizing curve.
    """

    b: float
    depth: float  # pu, of the dip: how much voltage returns
    decay: float = 0.3  # s
    offset: float = 0.8  # pu of flux, where all of the depth returns at once
    knee: float = 1.15

    def settled(self, V: complex) -> tuple["Inrush", list[complex]]:
        return self, [0j]

    def saturated(self, offset: float, U: float) -> float:
        """Half the angle [rad] over which the core is saturated in a cycle."""
        reach = (self.knee - offset) / U
        return acos(max(-1.0, reach)) if reach < 1 else 0.0

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        offset, U = x[0].real, abs(V)
        angle = self.saturated(offset, U)
        Q = self.b * U**2 * (angle - sin(angle) * cos(angle)) / pi
        return drawn(complex(0.0, Q), V), [
            -offset / self.decay + self.offset * max(now.rate, 0.0) / self.depth
        ]


@dataclass(frozen=True)
class Statcom(Device):
    """A static compensator: reactive current against a falling voltage, proportional, delayed,
    limited to `rating`.
    """

    rating: float  # pu of current
    gain: float = 10.0  # of the rating, per pu of voltage
    delay: float = 0.03  # s
    V0: float = 1.0

    def settled(self, V: complex) -> tuple["Statcom", list[complex]]:
        return replace(self, V0=abs(V)), [0j]

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        wanted = max(-1.0, min(1.0, self.gain * (self.V0 - abs(V))))
        given = self.rating * x[0].real
        return drawn(complex(0.0, -given * abs(V)), V), [(wanted - x[0].real) / self.delay]


@dataclass(frozen=True)
class Arc(Device):
    """Arcs of constant arc voltage behind a reactance, which go out where the supply cannot feed
    them.

    The arc voltage a is in phase with the current: a² + (x i)² = u², P = a i, Q = x i², all over
    their values before.
    """

    power: float
    arc: float = 0.6
    V0: float = 1.0

    def settled(self, V: complex) -> tuple["Arc", list[complex]]:
        return replace(self, V0=abs(V)), []

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        u, full = abs(V) / self.V0, sqrt(1 - self.arc**2)
        i = sqrt(u**2 - self.arc**2) / full if u > self.arc else 0.0
        return drawn(self.power * complex(i, full / self.arc * i**2), V), []


@dataclass(frozen=True)
class Switched(Device):
    """An admittance that is switched: draws S (U/U_0)² times a profile in time, which
    starts at 0.
    """

    S: complex
    profile: Profile = field(default_factory=Profile)
    V0: float = 1.0

    def settled(self, V: complex) -> tuple["Switched", list[complex]]:
        return replace(self, V0=abs(V)), []

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        return drawn(self.S * self.profile(now.t) * (abs(V) / self.V0) ** 2, V), []


@dataclass(frozen=True)
class Ring(Device):
    """A decaying oscillation of power that begins by itself at `start`, whatever the
    voltage does.
    """

    S: complex
    start: float
    frequency: float  # Hz
    decay: float  # s

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        since = now.t - self.start
        if since <= 0:
            return 0j, []
        return drawn(
            self.S * exp(-since / self.decay) * sin(2 * pi * self.frequency * since), V
        ), []


@dataclass(frozen=True)
class Ripple(Device):
    """A beat between harmonics that lasts as long as the voltage is low."""

    S: complex
    frequency: float  # Hz

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        return drawn(self.S * now.missing * sin(2 * pi * self.frequency * now.t), V), []


@dataclass(frozen=True)
class Slope(Device):
    """Power that follows the slope of the voltage: S dU/dt."""

    S: complex

    def flow(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        return drawn(self.S * now.rate, V), []
