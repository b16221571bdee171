"""What the network imposes on the load, at one instant: the scalar, fast twin of
`independent.Dip`.
"""

from bisect import bisect_right
from dataclasses import dataclass, replace
from math import cos, exp, pi, sin
from typing import NamedTuple

import numpy as np

from independent.source import NOMINAL_FREQUENCY, Dip

JUMP = 1e-4  # s: how long a contactor, a tap changer or a step takes


class Moment(NamedTuple):
    """The bus at one instant."""

    t: float  # s
    U: float  # pu, positive-sequence voltage
    f: float  # frequency over nominal
    U2: float  # pu, negative-sequence voltage
    rate: float  # pu/s, dU/dt
    missing: float  # share of the dip's depth that is missing, 0..1


@dataclass(frozen=True)
class Supply:
    """The bus voltage of one dip, instant by instant."""

    dip: Dip

    @property
    def breaks(self) -> list[float]:
        """Times [s] at which a derivative of the voltage or the frequency jumps."""
        back = self.dip.start + self.dip.duration
        return [self.dip.start, self.dip.start + self.dip.fall, back, back + self.dip.rise]

    def at(self, t: float) -> Moment:
        """The bus at time t [s]; the formulas of `independent.Dip`, with the rate in
        closed form.
        """
        d = self.dip
        x, back = t - d.start, t - d.start - d.duration
        fall, fall_rate = _edge(x, d.fall)
        rise, rise_rate = _edge(back, d.rise)
        soft = d.sag * exp(-max(back, 0.0) / d.settle)
        left = (1 - d.sag) * (1 - rise) + soft
        left_rate = -(1 - d.sag) * rise_rate - (soft / d.settle if back > 0 else 0.0)
        missing, missing_rate = fall * left, fall_rate * left + fall * left_rate
        f = 1.0
        if d.swing and x > 0:
            f += (
                d.swing
                * sin(2 * pi * d.swing_rate * x)
                * exp(-x / d.swing_decay)
                / NOMINAL_FREQUENCY
            )
        return Moment(
            t,
            d.before - d.depth * missing,
            f,
            d.negative * missing,
            -d.depth * missing_rate,
            missing,
        )


def _edge(x: float, length: float) -> tuple[float, float]:
    """A raised cosine from 0 to 1 and its derivative."""
    if not 0 < x < length:
        return float(x > 0), 0.0
    return 0.5 - 0.5 * cos(pi * x / length), 0.5 * pi / length * sin(pi * x / length)


@dataclass(frozen=True)
class Profile:
    """A quantity that follows straight lines between knots (t [s], value), constant
    outside them.
    """

    times: tuple[float, ...] = (0.0,)
    values: tuple[float, ...] = (0.0,)

    def __call__(self, t: float) -> float:
        k = bisect_right(self.times, t)
        if k in (0, len(self.times)):
            return self.values[0 if k == 0 else -1]
        share = (t - self.times[k - 1]) / (self.times[k] - self.times[k - 1])
        return self.values[k - 1] + share * (self.values[k] - self.values[k - 1])

    def __rmul__(self, share: float) -> "Profile":
        """A share of it."""
        return replace(self, values=tuple(share * v for v in self.values))

    @classmethod
    def steps(cls, before: float, *changes: tuple[float, float]) -> "Profile":
        """The value `before`, then at each (t, value) a change that takes `JUMP`."""
        times, values, level = [], [], before
        for t, value in changes:
            times += [t, t + JUMP]
            values += [level, value]
            level = value
        return cls(tuple(times), tuple(values))


@dataclass(frozen=True)
class Relay:
    """An undervoltage relay with two timers, and contactors that come back along a ramp.

    It opens once the voltage has stayed below `level` (of the voltage before) for `delay`; once it
    has stayed above `reset` for `wait`, what was opened returns within `ramp`. Each timer starts
    anew whenever its condition breaks.
    """

    level: float
    reset: float
    delay: float  # s
    wait: float  # s
    ramp: float  # s

    def opened(self, dip: Dip, end: float, step: float = 1e-4) -> Profile:
        """What is open, 0..1, up to time `end` [s]; the voltage is scanned every `step`."""
        t = np.arange(0.0, end, step)
        U = dip.magnitude(t) / dip.before
        low = _held(self.level > U, round(self.delay / step))
        high = _held(self.reset < U, round(self.wait / step))
        if not low.any():
            return Profile()
        out = int(np.argmax(low))
        times, values = [t[out], t[out] + JUMP], [0.0, 1.0]
        again = np.flatnonzero(high[out:])
        if len(again):
            back = max(t[out + again[0]], times[-1] + JUMP)
            times += [back, back + self.ramp]
            values += [1.0, 0.0]
        return Profile(tuple(map(float, times)), tuple(values))


def _held(condition: np.ndarray, samples: int) -> np.ndarray:
    """Where a condition (n,) has held for `samples` samples in a row."""
    index = np.arange(len(condition))
    last_break = np.maximum.accumulate(np.where(condition, -1, index))
    return condition & (index - last_break >= max(samples, 1))
