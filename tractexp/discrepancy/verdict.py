"""What it comes to: none, named, tied or unexplained, and the sentence behind it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.explanations import Explanations
from tractexp.discrepancy.fitting import Refit
from tractexp.discrepancy.gap import curves
from tractexp.discrepancy.held_out import HeldOut, carried
from tractexp.discrepancy.next_dip import NextDip, next_dip
from tractexp.discrepancy.survivors import Rival, Survivors
from tractexp.noise import Noise
from tractexp.record import Event

NONE, NAMED, TIED, UNEXPLAINED = "none", "named", "tied", "unexplained"


@dataclass(frozen=True, eq=False)
class Nearest:
    """Where nothing explains the disagreement: the set that comes nearest, and what it leaves.

    Shares are of the deviance in excess of the noise, on the fitted and on the held-out events (nan without any).
    """

    names: tuple[str, ...]
    fitted: float
    held_out: float
    calculated: np.ndarray  # (2, N) pu, of the fitted events end to end
    others: list[tuple[tuple[str, ...], float]]  # the next ones, with their shares on the fitted events


@dataclass(frozen=True, eq=False)
class Verdict:
    """One of four words, the sentence behind it, and what belongs to it.

    `names` are the effects added, `sets` all sets not rejected, `chosen` the set that the extended model has.
    """

    word: str
    reason: str
    names: tuple[str, ...]
    sets: tuple[tuple[str, ...], ...]
    chosen: Rival
    next_dip: NextDip | None  # that would tell tied sets apart
    nearest: Nearest | None  # where nothing explains


def verdict(weighed: HeldOut, validate: Sequence[Event]) -> Verdict:
    """Weigh what remains."""
    left = weighed.survivors
    explained = left.explanations
    bench, first = explained.base.bench, explained.steps[0]
    word, reason = _worded(explained, left, weighed)
    if weighed.together and weighed.kept:
        reason += "; what the fitted events leave open of it was fitted to the held-out ones, too"
    if (window := bench.records.window) is not None:
        reason += f"; {window.describe()}, which is taken into account"
    chosen = (weighed.kept or left.adequate or left.kept)[0]
    sets: tuple[tuple[str, ...], ...] = ()
    if word in (NAMED, TIED):
        sets = tuple(tuple(sorted((*s.fit.names, *weighed.faults))) for s in weighed.kept)
    names = sets[0] if sets else ()
    at = (chosen.tests or explained.last) if names else first
    if at.resting:
        reason += f"; on a bound: {', '.join(at.resting)}"
    return Verdict(
        word=word,
        reason=reason,
        names=names,
        sets=sets,
        chosen=chosen,
        next_dip=next_dip(bench, weighed.kept) if word == TIED else None,
        nearest=_nearest(bench, weighed.bare, left.rivals, weighed.noise, validate) if word == UNEXPLAINED else None,
    )


def _worded(explained: Explanations, left: Survivors, weighed: HeldOut) -> tuple[str, str]:
    """The word and its reason."""
    first, criteria = explained.steps[0], explained.base.bench.criteria
    if explained.empty and first.adequate:
        return NONE, f"no disagreement above the noise, at a false-alarm rate of {criteria.false_alarms:.0%}"
    if not left.adequate:
        tests = left.kept[0].tests
        assert tests is not None
        return UNEXPLAINED, (
            "the model and the records disagree, and nothing in the catalogue explains it: what is left after the best"
            f" explanation would come about by chance with p = {tests.p_left:.2g}; what stands out most:"
            f" {tests.loudest}"
        )
    if not weighed.kept and first.adequate:
        return NONE, (
            "what seemed to help on the fitted events does not help on the held-out ones, and what the base model"
            " leaves is no more than chance leaves"
        )
    if not weighed.kept:
        return UNEXPLAINED, "what explains the fitted events does not hold on the held-out ones"
    if len(weighed.kept) == 1:
        names = " and ".join(sorted((*weighed.kept[0].fit.names, *weighed.faults)))
        return NAMED, f"{names} explains the disagreement, and no other set of this size does"
    return TIED, f"{len(weighed.kept)} explanations fit equally well on these events and cannot be told apart"


def _nearest(
    bench: Bench, bare: Refit, rivals: Sequence[Rival], noise: Noise, validate: Sequence[Event]
) -> Nearest | None:  # fmt: skip
    best = rivals[0].fit
    if not best.names:
        return None
    before, after = curves(bench, bare.unit, noise), curves(bench, best.unit, noise)
    excess = max(before.deviance - bench.samples, 1e-300)
    held = float("nan")
    if validate:
        other, units, level = carried(bench, validate, [bare, best])
        there = [curves(other, u, level).deviance for u in units]
        held = (there[0] - there[1]) / max(there[0] - other.samples, 1e-300)
    others = [(r.fit.names, (before.deviance - r.fit.deviance) / excess) for r in rivals[1:4]]
    share = (before.deviance - after.deviance) / excess
    return Nearest(best.names, float(share), float(held), after.calculated, others)
