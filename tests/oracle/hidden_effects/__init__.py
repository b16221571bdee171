"""Records in which an effect is hidden, made by equations and solvers that the product does not
share.

Nothing of `tractexp` or of its plugins is imported. See README.md for what each case is.
"""

from hidden_effects.effects import CATALOG, MEASUREMENT, NUISANCES, PHYSICAL
from hidden_effects.generator import EFFECTS, Case, Scene, make, scene, truth, write
from hidden_effects.imperfections import IMPERFECTIONS
from hidden_effects.noise import Noise
from hidden_effects.outside import OUTSIDE
from hidden_effects.recorder import Recorder

__all__ = [
    "CATALOG",
    "EFFECTS",
    "IMPERFECTIONS",
    "MEASUREMENT",
    "NUISANCES",
    "OUTSIDE",
    "PHYSICAL",
    "Case",
    "Noise",
    "Recorder",
    "Scene",
    "make",
    "scene",
    "sizes",
    "truth",
    "write",
]


def sizes() -> dict[str, tuple[float, str]]:
    """What size 1 is of every effect: (amount, unit), on the record's base."""
    return {name: (effect.reference, effect.unit) for name, effect in EFFECTS.items()}
