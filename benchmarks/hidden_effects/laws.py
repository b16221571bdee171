"""Effects of the catalogue's kinds by other laws and at other places: what nature does that uses no formula of ours.

Each belongs to the family of a catalogue's effect, `FAMILY` says which; its formula is not that of any plugin, textbook
or not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hidden_effects.effects import UndervoltageTrip
from hidden_effects.hidden import Hidden, motors
from hidden_effects.site import Site
from hidden_effects.supply import Profile, Relay
from independent.source import Dip


def times(share: float, opened: Profile) -> Profile:
    """A share of what a relay opens."""
    return replace(opened, values=tuple(share * v for v in opened.values))


@dataclass(frozen=True)
class StaticTrip(UndervoltageTrip):
    """The relay opens a share of the static load only: contactors of lighting and electronics."""

    reference, largest, unit = 0.1, 0.9, "1"

    def apply(self, site: Site) -> Site:
        relay = Relay(self.level, self.reset, self.delay, self.wait, self.ramp)
        return replace(site, static_opened=times(self.amount, relay.opened(site.dip, site.recorder.duration)))


@dataclass(frozen=True)
class MotorTrip(UndervoltageTrip):
    """The relay opens a share of the motors only."""

    reference, largest, unit = 0.1, 0.9, "1"

    def apply(self, site: Site) -> Site:
        relay = Relay(self.level, self.reset, self.delay, self.wait, self.ramp)
        return replace(site, motors_opened=times(self.amount, relay.opened(site.dip, site.recorder.duration)))


@dataclass(frozen=True)
class TwoStageTrip(UndervoltageTrip):
    """A second relay, later and for deeper dips, opens as much again; both return as the first does."""

    reference, largest, unit = 0.05, 0.45, "1"
    further: float = 0.85  # level of the second relay over that of the first
    later: float = 0.1  # s, delay of the second beyond the first

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {**super().details(rng, dips), "later": float(rng.uniform(0.03, 0.08))}

    def apply(self, site: Site) -> Site:
        first = Relay(self.level, self.reset, self.delay, self.wait, self.ramp)
        second = replace(first, level=self.further * self.level, delay=self.delay + self.later, wait=self.wait + 0.15)
        opened = [r.opened(site.dip, site.recorder.duration) for r in (first, second)]
        knots = sorted({t for profile in opened for t in profile.times})
        values = tuple(self.amount * sum(profile(t) for profile in opened) for t in knots)
        return replace(site, opened=Profile(tuple(knots), values))


@dataclass(frozen=True)
class DriftFromDip(Hidden):
    """Customers switch on after they noticed the dip: the static load grows steadily from its beginning."""

    reference, largest, unit = 0.02, 0.3, "1/s"

    def apply(self, site: Site) -> Site:
        static = replace(site.static, growth=self.amount * site.S, grows_from=site.dip.start)
        return replace(site, static=static, breaks=(*site.breaks, site.dip.start))


@dataclass(frozen=True)
class KneeSaturation(Hidden):
    """A magnetizing table with a knee: straight below it, a line up to the flux before the event.

    `amount` is by how much the magnetizing admittance falls until the knee is reached.
    """

    reference, largest, unit = 0.3, 0.9, "1"
    knee: float = 0.8

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"knee": float(rng.uniform(0.75, 0.9))}

    def apply(self, site: Site) -> Site:
        return motors(site, saturation=self.amount, knee=self.knee)


LAWS = {
    "static_part_trip": StaticTrip,
    "motor_share_trip": MotorTrip,
    "trip_in_two_stages": TwoStageTrip,
    "drift_that_begins_at_the_dip": DriftFromDip,
    "knee_saturation": KneeSaturation,
}
FAMILY = {
    "static_part_trip": "undervoltage_trip",
    "motor_share_trip": "undervoltage_trip",
    "trip_in_two_stages": "undervoltage_trip",
    "drift_that_begins_at_the_dip": "load_drift",
    "knee_saturation": "magnetic_saturation",
}
