"""What makes every model of a load inexact: small departures of several kinds, no
plugin's formula.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hidden_effects.hidden import Hidden, motors, split
from hidden_effects.laws import FroelichSaturation
from hidden_effects.site import Site
from independent.source import Dip


@dataclass(frozen=True)
class BrokenTorque(Hidden):
    """A share of the driven machines has a torque of a broken power of the speed above a
    stand-still speed.
    """

    reference, largest, unit = 0.3, 1.0, "1"
    power: float = 1.4
    head: float = 0.3

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        return {"power": float(rng.uniform(1.2, 3.0)), "head": float(rng.uniform(0.1, 0.6))}

    def apply(self, site: Site) -> Site:
        return motors(site, fan=self.amount, fan_power=self.power, head=self.head)


@dataclass(frozen=True)
class BoundedFlux(FroelichSaturation):
    """Froelich's magnetizing curve, of half the amount that is noticeable."""

    reference = 0.2


@dataclass(frozen=True)
class MixingExponents(Hidden):
    """The exponents of the static load grow while the record lasts."""

    reference, largest, unit = 0.2, 5.0, "1/s"

    def apply(self, site: Site) -> Site:
        return replace(site, static=replace(site.static, mixing=self.amount))


@dataclass(frozen=True)
class OtherMotors(Hidden):
    """A share of the motors is of another make: resistance, leakage and inertia differ."""

    reference, largest, unit = 0.1, 0.9, "1"
    resistance: float = 1.5
    leakage: float = 0.8
    inertia: float = 0.6

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        ratios = np.exp(rng.uniform(-0.6, 0.6, 3))
        return dict(zip(("resistance", "leakage", "inertia"), ratios.tolist(), strict=True))

    def apply(self, site: Site) -> Site:
        first = site.motors[0]
        m = first.machine
        other = replace(m, Rr=self.resistance * m.Rr, Xr=self.leakage * m.Xr, H=self.inertia * m.H)
        return split(site, self.amount, replace(first, machine=other))


IMPERFECTIONS: dict[str, type[Hidden]] = {
    "broken_torque": BrokenTorque,
    "bounded_flux": BoundedFlux,
    "mixing_exponents": MixingExponents,
    "other_motors": OtherMotors,
}
# what is of no family of the catalogue: a law of the static load, three of what rides on the power,
# three of the measurement
FOREIGN = (
    "mixing_exponents",
    "voltage_rate",
    "harmonic_ripple",
    "subsynchronous_ring",
    "current_transformer_saturation",
    "voltage_gain_drift",
    "phase_jump",
)
