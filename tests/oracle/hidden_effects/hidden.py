"""What a hidden effect is: a physical change of a site, of a size, with details drawn at random."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np

from hidden_effects.devices import Device
from hidden_effects.motor import Motor
from hidden_effects.site import Site
from independent.source import Dip


@dataclass(frozen=True)
class Hidden:
    """An effect of size `amount`; at 0 it leaves the site as it is. Further fields are
    its details.
    """

    amount: float

    reference: ClassVar[float]  # amount at size 1: what an engineer would call noticeable
    largest: ClassVar[float] = float("inf")  # amount beyond which it makes no physical sense
    unit: ClassVar[str]
    # what a dip must bring for it to show: "swing" (frequency), "negative" (unbalance)
    needs: ClassVar[str] = ""

    @classmethod
    def details(cls, rng: np.random.Generator, dips: Sequence[Dip]) -> dict[str, float]:
        """Details of one load, the same in all of its events."""
        return {}

    @classmethod
    def of(cls, size: float, rng: np.random.Generator, dips: Sequence[Dip]) -> "Hidden":
        """The effect at `size` times its reference; ValueError beyond the largest that
        makes sense.
        """
        amount = size * cls.reference
        if abs(amount) > cls.largest * (1 + 1e-12):
            raise ValueError(
                f"{cls.__name__} of {amount:.3g} {cls.unit} is beyond {cls.largest:g}; lower the"
                " size"
            )
        return cls(amount, **cls.details(rng, dips))

    def apply(self, site: Site) -> Site:
        """The site with this effect."""
        raise NotImplementedError

    def truth(self) -> dict[str, Any]:
        """What was hidden, for the sidecar file."""
        return {**asdict(self), "unit": self.unit}


def motors(site: Site, **changes: Any) -> Site:
    """The site with every motor changed alike."""
    return replace(site, motors=tuple(replace(m, **changes) for m in site.motors))


def beside(site: Site, *devices: Device) -> Site:
    """The site with further devices."""
    return replace(site, devices=(*site.devices, *devices))


def split(site: Site, share: float, second: Motor) -> Site:
    """The site with `share` of its first group of motors replaced by motors like `second`."""
    first, *others = site.motors
    groups = (
        replace(first, rating=(1 - share) * first.rating),
        replace(second, rating=share * first.rating),
    )
    return replace(site, motors=(*groups, *others))


def lowest(dips: Sequence[Dip]) -> float:
    """The deepest voltage of the dips, over the voltage before."""
    return min(1 - d.depth / d.before for d in dips)
