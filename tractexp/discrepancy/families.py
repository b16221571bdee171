"""Members of families: the kind of a textbook effect at another place, or its place with another
law.

All are tried beside the best single textbook effect, whether or not that leaves nothing: a wrong
formula may suffice where the right one is that of a member. A member that leaves nothing takes its
place where it explains more beyond what its further parameters cost, or where it fits nearly as
well and the textbook effect leaves something. Beside an effect that suffices those that were
searched are rivals, whether or not they explain more.
"""

import itertools
from collections.abc import Container, Mapping, Sequence

import numpy as np
from scipy.special import chdtrc

from tractexp.discrepancy.disagreement import Disagreement, examine_fit
from tractexp.inference.base_fit import BaseFit
from tractexp.inference.catalogue import Candidate
from tractexp.inference.context import Context
from tractexp.inference.fit_effort import NEAR_BEST
from tractexp.inference.fitting import Names, Refit, Start, move_off_bounds
from tractexp.inference.wide_fit import refit_sets_widely
from tractexp.noise import Noise

NEAREST = 4  # members that are searched to the end
EXAMINED = 3  # members whose remainder is tested
BEGUN = 0.5  # smallest relevant sizes at which a size without a textbook value starts


def compare_members(
    base: BaseFit, tests: Disagreement, refits: Mapping[Names, Refit], seed: int
) -> tuple[Disagreement, list[Refit]]:
    """The tests at the best member that leaves nothing and takes the place of the best textbook
    effect, or `tests`.

    With the fits of the members that are held against it: none where neither leaves nothing, since
    what no effect has a member imitates best, nor where nothing is missing.
    """
    if tests.suffices and not tests.fit.names:
        return tests, []
    context = base.context
    noise = tests.noise
    fits = fit_members(context, noise, refits, {m.effect.family for m in context.catalogue.members})
    for k, fit in enumerate(fits[:EXAMINED]):
        near = not tests.suffices and fit.cost < tests.fit.cost + NEAR_BEST
        if not near and not is_worth(fit, tests.fit, context.criteria.further_name_p):
            continue
        there = examine_fit(base.quiet, fit, noise, seed + k)
        if there.suffices:
            return there, [there.fit, *(f for f in fits if f is not fit)]
    return tests, fits if tests.suffices else []


def fit_members(
    context: Context, noise: Noise, refits: Mapping[Names, Refit], families: Container[str]
) -> list[Refit]:
    """Members of some families, the nearest of them searched to the end; the best first."""
    members = [m for m in context.catalogue.members if m.effect.family in families]
    if not members or not context.domain.calibrated:
        return []
    context.effort.say(f"trying {len(members)} other places and laws")
    wanted = [list_member_starts(context, member, refits) for member in members]
    return refit_sets_widely(context, noise, wanted, NEAREST, refits.values())


def is_worth(larger: Refit, other: Refit, p: float) -> bool:
    """Whether a set or member explains more than another by more than its further parameters
    cost.
    """
    further = max(larger.parameters - other.parameters, 1)
    gained = other.deviance - larger.deviance
    return gained > 0 and float(chdtrc(further, gained)) < p


def list_member_starts(
    context: Context, member: Candidate, refits: Mapping[Names, Refit]
) -> list[Start]:
    """Starts of a member: from the textbook's fit, with every setting that it leaves open and its
    size told whole or shared, and where the member does not nest that, from the base model's with
    every setting, since the textbook's fit may have gone astray.
    """
    at, effect, bare = context.coordinates, member.effect, refits[()].unit
    textbook = refits.get((effect.family,)) if effect.as_textbook else None
    begun: list[tuple[np.ndarray, dict[str, float]]] = []
    if textbook is not None:
        ground = at.remove_effects(textbook.unit, [effect.family])
        textbook_values = {
            own: at.value(theirs, textbook.unit) for own, theirs in effect.as_textbook.items()
        }
        begun += [
            (ground, textbook_values),
            *(
                (ground, textbook_values | shared)
                for shared in _share_textbook_size(member, textbook_values)
            ),
        ]
    if textbook is None or not effect.nests_textbook:
        begun += [(unit, {}) for unit in (bare, *move_off_bounds(context, bare))]
    wanted = []
    for ground, textbook_values in begun:
        start = dict(textbook_values)
        for size in member.sizes:
            start.setdefault(size.name, member.compute_sized_value(size, 0.0, BEGUN))
        for setting in open_settings(member, tuple(start)):
            values = {p.name: (setting | start).get(p.name, p.default) for p in effect.parameters}
            wanted.append(((member.name,), at.place_values(ground, values)))
    return wanted


def _share_textbook_size(
    member: Candidate, textbook_values: Mapping[str, float]
) -> list[dict[str, float]]:
    """The textbook's size in equal parts, where a member has further sizes: a small second one
    beside the whole first may end as a patch of it. None where it has no further one.
    """
    mine = [textbook_values[p.name] for p in member.sizes if p.name in textbook_values]
    part = sum(mine) / len(member.sizes)
    return [{p.name: part for p in member.sizes}] if 0 < len(mine) < len(member.sizes) else []


def open_settings(member: Candidate, start: Sequence[str]) -> list[dict[str, float]]:
    """Every combination of the scanned values of the parameters that the textbook's fit does not
    tell.
    """
    grid = {name: values for name, values in member.effect.grid.items() if name not in start}
    return [dict(zip(grid, choice, strict=True)) for choice in itertools.product(*grid.values())]
