"""The two domains: what a model is compared with, and everything that follows from that.

`PHASORS` compares P and Q, `WAVES` sampled currents. Models and events say which they belong to;
whatever depends on it is asked of the domain.
"""

from tractexp.domain.domain import Domain as Domain
from tractexp.domain.phasors import PhasorDomain
from tractexp.domain.playback import Playback as Playback
from tractexp.domain.waves import WaveDomain
from tractexp.model.model import Model
from tractexp.record import Event

PHASORS, WAVES = PhasorDomain(), WaveDomain()
DOMAINS: dict[str, Domain] = {domain.name: domain for domain in (PHASORS, WAVES)}


def find_domain(of: Model | Event) -> Domain:
    """The domain of a model or an event."""
    return DOMAINS[of.domain]
