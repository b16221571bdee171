"""Effects that no catalogue entry describes: the right verdict on them is that nothing known
explains the record.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hidden_effects.devices import Arc, Ring, Ripple, Slope, Switched
from hidden_effects.hidden import Hidden, beside, motors, split
from hidden_effects.site import Site
from hidden_effects.supply import Profile
from independent.source import Dip


def after(site: Site, delay: float) -> float:
    """A time [s] that lies `delay` after the voltage has begun to return."""
    return site.dip.start + site.dip.duration + delay


@dataclass(frozen=True)
class RotorSkinEffect(Hidden):
    """A second, outer cage takes over at high slip; `amount` is its admittance over the inner
    cage's.
    """

    reference, largest, unit = 0.5, 4.0, "1"

    def apply(self, site: Site) -> Site:
        return motors(site, cage=self.amount)


@dataclass(frozen=True)
class StatorTransients(Hidden):
    """A share of the motors shows the stator's direct-current transient, with the small resistance
    that ends it.
    """

    reference, largest, unit = 0.5, 1.0, "1"
    resistance: float = 0.008

    def apply(self, site: Site) -> Site:
        first = site.motors[0]
        full = replace(
            first,
            machine=replace(first.machine, Rs=first.machine.Rs + self.resistance),
            stator=True,
        )
        return split(site, self.amount, full)


@dataclass(frozen=True)
class LoadStep(Hidden):
    """A customer switches on, unrelated to the dip; `amount` is its share of the power before."""

    reference, largest, unit = 0.02, 0.5, "1"
    delay: float = 0.5

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"delay": float(rng.uniform(0.2, 0.5))}

    def apply(self, site: Site) -> Site:
        profile = Profile.steps(0.0, (after(site, self.delay), 1.0))
        switched = beside(site, Switched(self.amount * site.S, profile))
        return replace(switched, breaks=(*site.breaks, *profile.times))


@dataclass(frozen=True)
class TwoLoadSteps(Hidden):
    """One customer switches on, another off, at times of their own and with power factors of their
    own.
    """

    reference, largest, unit = 0.02, 0.5, "1"
    delay: float = 0.3
    pause: float = 0.3

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"delay": float(rng.uniform(0.1, 0.3)), "pause": float(rng.uniform(0.1, 0.3))}

    def apply(self, site: Site) -> Site:
        on, off = after(site, self.delay), after(site, self.delay + self.pause)
        for S, t in ((self.amount * site.S.real, on), (-0.7j * self.amount * site.S.real, off)):
            profile = Profile.steps(0.0, (t, 1.0))
            site = beside(
                replace(site, breaks=(*site.breaks, *profile.times)), Switched(S, profile)
            )
        return site


@dataclass(frozen=True)
class SubsynchronousRing(Hidden):
    """A torsional mode elsewhere is heard, from a time that has nothing to do with the dip."""

    reference, largest, unit = 0.015, 0.5, "1"
    frequency: float = 15.0
    decay: float = 0.25
    delay: float = 0.3

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {
            "frequency": float(rng.uniform(9.0, 22.0)),
            "decay": float(rng.uniform(0.15, 0.4)),
            "delay": float(rng.uniform(0.2, 0.5)),
        }

    def apply(self, site: Site) -> Site:
        start = after(site, self.delay)
        ring = Ring(self.amount * site.S.real * (1 + 0.4j), start, self.frequency, self.decay)
        return replace(beside(site, ring), breaks=(*site.breaks, start))


@dataclass(frozen=True)
class TapChangerStep(Hidden):
    """A transformer between bus and load changes its ratio by `amount` after the dip."""

    reference, largest, unit = 0.0125, 0.1, "pu"
    delay: float = 0.4

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"delay": float(rng.uniform(0.2, 0.5))}

    def apply(self, site: Site) -> Site:
        return replace(site, tap=Profile.steps(1.0, (after(site, self.delay), 1.0 + self.amount)))


@dataclass(frozen=True)
class ArcLoad(Hidden):
    """Arc furnaces, which go out in deep dips, in place of static load; `amount` is their share of
    the power.
    """

    reference, largest, unit = 0.1, 0.6, "1"
    arc: float = 0.6

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"arc": float(rng.uniform(0.5, 0.75))}

    def apply(self, site: Site) -> Site:
        return beside(site, Arc(self.amount * site.S.real, self.arc))


@dataclass(frozen=True)
class VoltageGainDrift(Hidden):
    """A capacitive voltage transformer whose ratio drifts; `amount` is the gain per second."""

    reference, largest, unit = 0.01, 0.2, "1/s"

    def apply(self, site: Site) -> Site:
        return replace(site, recorder=replace(site.recorder, gain_drift=self.amount))


@dataclass(frozen=True)
class HarmonicRipple(Hidden):
    """Beats between harmonics ride on the power as long as the voltage is low."""

    reference, largest, unit = 0.02, 0.5, "1"
    frequency: float = 30.0

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"frequency": float(rng.uniform(20.0, 40.0))}

    def apply(self, site: Site) -> Site:
        return beside(site, Ripple(self.amount * abs(site.S) * (0.8 - 0.6j), self.frequency))


@dataclass(frozen=True)
class CurrentTransformerSaturation(Hidden):
    """A current transformer loses a share of what the current has beyond its value before the
    event.
    """

    reference, largest, unit = 0.1, 0.9, "1"

    def apply(self, site: Site) -> Site:
        return replace(site, recorder=replace(site.recorder, knee=self.amount))


@dataclass(frozen=True)
class PhaseJump(Hidden):
    """The angle of the voltage jumps with the dip, and no recorded frequency tells."""

    reference, unit = 0.05, "rad"

    def apply(self, site: Site) -> Site:
        return replace(site, angle=self.amount)


@dataclass(frozen=True)
class VoltageRate(Hidden):
    """Power that follows the slope of the voltage; `amount` [s] times the power before."""

    reference, unit = 0.005, "s"

    def apply(self, site: Site) -> Site:
        return beside(site, Slope(self.amount * site.S))


OUTSIDE = {
    "rotor_skin_effect": RotorSkinEffect,
    "stator_transients": StatorTransients,
    "load_step": LoadStep,
    "two_load_steps": TwoLoadSteps,
    "subsynchronous_ring": SubsynchronousRing,
    "tap_changer_step": TapChangerStep,
    "arc_load": ArcLoad,
    "voltage_gain_drift": VoltageGainDrift,
    "harmonic_ripple": HarmonicRipple,
    "current_transformer_saturation": CurrentTransformerSaturation,
    "phase_jump": PhaseJump,
    "voltage_rate": VoltageRate,
}
