"""Two mild dips of the independent generator of `tests/oracle/hidden_effects`, in which effects
look alike, and fits of effects of which two are one.
"""

import functools

import numpy as np
from made_context import bench
from made_dips import SLOW, base
from sympy import I

from hidden_effects import Case, Noise
from hidden_effects.generator import scene
from independent import Dip
from tractexp.extend import Effect, Parameter, sites
from tractexp.inference.base_fit import fit_base_model
from tractexp.inference.catalogue import Catalogue, build_candidate
from tractexp.inference.fitting import refit
from tractexp.inference.kernels import Family
from tractexp.record import Record, detect

MILD = (Dip(depth=0.32, start=0.5, duration=0.14), Dip(depth=0.33, start=0.5, duration=0.22))
NOISE, SEED = Noise(0.002), 931034


class LeakageLoss(Effect):
    """The stator's resistance told as a share of the leakage reactance: the same equation in
    another parameter.
    """

    name = "leakage_loss"
    loss = Parameter(
        0.0, (-0.2, 1.5), "1", "resistance over reactance of the stator", "a test", null=0.0
    )
    parameters = (loss,)
    places, kind = ("stator impedance",), "law"

    def edit(self, eq, loss):
        eq.edit(sites.stator_impedance, lambda Z: Z - I * loss * Z)


def hidden(*dips, effect="speed_dependent_torque", size=0.9):
    """A load that has the effect, and the dips that it sees."""
    return scene(Case(effect, size, events=dips, noise=NOISE, recorder=SLOW), SEED)


def recorded(made):
    """Its records, with noise, as events."""
    noisy = [
        NOISE.add(r, np.random.default_rng([SEED, 2, k])) for k, r in enumerate(made.records())
    ]
    return [
        detect(Record(f"event{k}", **r, source=f"made {k}").check()) for k, r in enumerate(noisy, 1)
    ]


@functools.cache
def fitted_alike():
    """A context of three effects of which two are one, with the noise, the base model's fit and
    {name: fit} of each effect, for two dips of a load that has a stator resistance.
    """
    made = recorded(hidden(*MILD, effect="stator_resistance", size=1.0))
    few = bench(base(), made, ("stator_resistance", "speed_dependent_torque"))
    effects = Catalogue((*few.catalogue.candidates, build_candidate(LeakageLoss())), {})
    context = few.rebuild(effects, few.records, few.effort, Family)
    found, at = fit_base_model(context), context.coordinates
    starts = [
        ((name,), at.place_values(found.fit.unit, {label: value}))
        for name, label, value in (
            ("stator_resistance", "R_s", 0.01),
            ("leakage_loss", "loss", 0.05),
            ("speed_dependent_torque", "quadratic_share", 0.2),
        )
    ]
    fits = refit(context, found.noise, starts)
    (bare,) = refit(context, found.noise, [((), found.fit.unit)])
    return context, found.noise, bare, {fit.names[0]: fit for fit in fits}
