"""The event to record next, chosen among those imagined: the mildest that is sure to leave one
rival, or the surest.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tractexp.discrepancy.next_event.imagined import (
    ImaginedDip,
    drive_imagined,
    imagine_dips,
    record_imagined,
)
from tractexp.discrepancy.next_event.same import prove_same
from tractexp.discrepancy.next_event.separation import (
    FEW,
    Separation,
    Side,
    linearize_side,
    view_events,
)
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.fitting import Refit, refit
from tractexp.inference.model_error import format_percent
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.model.drive import Drive
from tractexp.noise import Noise

# probability with which a recommended dip must tell tied sets apart: one miss in twenty
DECIDED = 0.95
CHECKED = 4  # events whose chances are reckoned again at refits, until one holds what it promised
LEAST_CHANCE = 0.5  # chance below which no event is said to tell a pair apart
WORTH = 0.1  # chance below which no refit is worth its time
REPEATED = (2, 3, 5, 10, 20)  # events of one kind together
NEARLY = 0.02  # of the chance: of events as sure as this the mildest is the surest


@dataclass(frozen=True, eq=False)
class EventTrial:
    """An event and how surely it leaves one rival: by which probability each alone where it is the
    truth (a,), and by which it denies others (a, a).
    """

    event: ImaginedDip
    alone: np.ndarray
    pairs: np.ndarray
    # whether rivals were refitted to it, not only linearised about their fits
    refitted: bool = False
    # how many such events are sure to, where one is not and so many are
    repeated: int | None = None

    @classmethod
    def from_draws(
        cls, event: ImaginedDip, denied: np.ndarray, ignored: np.ndarray, *, refitted: bool = False
    ) -> "EventTrial":
        """Of draws (a, a, b) that deny rivals, by the truth; pairs that are `ignored` (a, a) need
        not be told apart.
        """
        alone = (denied | ignored[:, :, None]).all(axis=1).mean(axis=1)
        return cls(event, alone, denied.mean(axis=2), refitted)

    @property
    def least(self) -> float:
        """The probability that the truth alone is left, the least over all rivals as the truth."""
        return float(self.alone.min())


@dataclass(frozen=True, eq=False)
class NextEvent:
    """What to record next for `rivals`, and how surely it leaves one of them; `tried` are all
    events, as imagined.

    `same` are pairs that no voltage at all tells apart, by their places among the rivals, and
    `hopeless` others that none of the events does.
    """

    rivals: tuple[str, ...]
    best: EventTrial
    tried: tuple[EventTrial, ...]
    criteria: Criteria
    same: tuple[tuple[int, int, dict[str, Any]], ...] = field(default=())
    hopeless: tuple[tuple[int, int, float], ...] = field(default=())
    error: float = 0.0  # what the rivals miss of the response, counted in all chances

    @property
    def probability(self) -> float:
        """The least over all rivals as the truth."""
        return self.best.least

    def sentence(self) -> str:
        """What to record, or why nothing need be."""
        sentences = [
            f"{self.rivals[a]} and {self.rivals[b]} cannot be told apart by any dip at this bus:"
            f" {proof['reason']}"
            for a, b, proof in self.same
        ]
        sentences += [
            f"none of the {len(self.tried)} events tried tells {self.rivals[a]} from"
            f" {self.rivals[b]}, the surest with"
            f" a probability of {p:.0%}"
            for a, b, p in self.hopeless
        ]
        if sentences and len(self.rivals) == 2:
            return sentences[0]
        return "; ".join([self._recommend_event(), *sentences])

    def to_dict(self) -> dict[str, Any]:
        """As `discrepancy.json` and `plan.json` have it."""
        return {
            "sentence": self.sentence(),
            "rivals": list(self.rivals),
            "model_error": self.error,
            "recommended": self._row(self.best),
            "indistinguishable": [
                {"pair": [self.rivals[a], self.rivals[b]]} | proof for a, b, proof in self.same
            ],
            "no_event_separates": [
                {"pair": [self.rivals[a], self.rivals[b]], "probability": p}
                for a, b, p in self.hopeless
            ],
            "tried": [
                {**t.event.to_dict(), "words": t.event.words, "probability": t.least}
                for t in self.tried
            ],
        }

    def _row(self, tried: EventTrial) -> dict[str, Any]:
        """What `discrepancy.json` holds of an event that was tried."""
        return {
            **tried.event.to_dict(),
            "words": tried.event.words,
            "probability": tried.least,
            "by_truth": dict(zip(self.rivals, tried.alone.tolist(), strict=True)),
            "refitted": tried.refitted,
            "repeated": tried.repeated,
        }

    def _recommend_event(self) -> str:
        """The event to record and how sure it tells the rivals apart, as a sentence."""
        first, *others = self.rivals
        them = (
            f"{first} from {others[0]}" if len(others) == 1 else f"these {len(self.rivals)} apart"
        )
        what = self.best.event.words
        p = self.probability
        missed = (
            f", where they miss {format_percent(self.error)} of a response" if self.error else ""
        )
        if p >= DECIDED:
            return f"record {what}: it tells {them} with a probability of {p:.0%}{missed}"
        several = f", {self.best.repeated} of them are sure to" if self.best.repeated else ""
        return (
            f"no event that was tried is sure to tell {them}; the surest, {what}, does so with a"
            f" probability of {p:.0%}{missed}{several}"
        )


def find_next_event(
    context: Context,
    noise: Noise,
    bare: Refit,
    rivals: Sequence[Refit],
    labels: Sequence[str],
    error: float = 0.0,
) -> NextEvent:
    """Choose what to record next, to tell two rivals or more apart.

    Parameters
    ----------
    context : Context
        The records and models.
    noise : Noise
        Under which all rivals were fitted.
    bare : Refit
        The base model's fit.
    rivals : sequence of Refit
        The sets that are tied.
    labels : sequence of str
        Their names in sentences.
    error : float
        What the best of the rivals misses of a response beyond the noise: it will miss as much of
        the next.

    Returns
    -------
    NextEvent
    """
    context.effort.say(f"choosing what to record next, to tell {len(rivals)} explanations apart")
    sides = [linearize_side(context, noise, fit) for fit in (bare, *rivals)]
    separation = Separation(sides, context.criteria, FEW)
    truths = range(1, len(sides))
    reads = context.catalogue.list_channels(name for fit in rivals for name in fit.names)
    events = []
    denied = []
    by_rate = sorted(imagine_dips(context, sorted(reads)), key=lambda e: e.rate)
    # sampled alike
    for group in (list(alike) for _, alike in itertools.groupby(by_rate, key=lambda e: e.rate)):
        for event, views in zip(
            group,
            zip(*(view_events(context, noise, s, group, error) for s in sides), strict=True),
            strict=True,
        ):
            events.append(event)
            denied.append(
                np.stack([separation.find_denied_rivals(views, truth) for truth in truths])
            )
    most = np.max([d.mean(axis=2) for d in denied], axis=0)  # (a, a)
    apart = [
        (a, b, float(min(most[a, b], most[b, a])))
        for a, b in itertools.combinations(range(len(rivals)), 2)
    ]
    open_pairs = [pair for pair in apart if pair[2] < LEAST_CHANCE]
    ignored = np.zeros(most.shape, bool)
    if len(open_pairs) < len(apart):  # what can be told apart shall be
        for a, b, _ in open_pairs:
            ignored[a, b] = ignored[b, a] = True
    tried = [EventTrial.from_draws(e, d, ignored) for e, d in zip(events, denied, strict=True)]
    best = _choose_mildest_event(context, noise, sides, tried, ignored, error)
    pairs = [(a, b, prove_same(context, rivals[a], rivals[b])) for a, b, _ in open_pairs]
    proved = tuple((a, b, s) for a, b, s in pairs if s is not None)
    hopeless = tuple(pair for pair, (*_, s) in zip(open_pairs, pairs, strict=True) if s is None)
    return NextEvent(tuple(labels), best, tuple(tried), context.criteria, proved, hopeless, error)


def pick_mildest(tried: Sequence[EventTrial], decided: float) -> EventTrial:
    """Of the events that are sure enough the one that asks for least, or else of the surest."""
    enough = [t for t in tried if t.least >= min(decided, max(t.least for t in tried) - NEARLY)]
    return min(enough, key=lambda t: t.event.burden)


def _choose_mildest_event(
    context: Context,
    noise: Noise,
    sides: Sequence[Side],
    tried: Sequence[EventTrial],
    ignored: np.ndarray,
    error: float,
) -> EventTrial:
    """The mildest event that is sure enough after refits, too."""
    left = list(tried)
    checked = []
    while left and len(checked) < CHECKED:
        best = pick_mildest(left, DECIDED)
        chance = best.least
        if checked and chance < min(LEAST_CHANCE, max(t.least for t in checked)):
            break
        left.remove(best)
        checked.append(
            _compute_refitted_chances(context, noise, sides, best, ignored, error)
            if chance >= WORTH
            else best
        )
        if checked[-1].least >= DECIDED:
            return checked[-1]
    return max(checked, key=lambda t: t.least)


def _compute_refitted_chances(
    context: Context,
    noise: Noise,
    sides: Sequence[Side],
    best: EventTrial,
    ignored: np.ndarray,
    error: float,
) -> EventTrial:
    """The chances of one event with rivals linearised where they fit it best, each in turn the
    truth.

    Only of phasors without further channels or rates, which the context has no records of: others
    stay linearised about their fits.
    """
    event = best.event
    plain = context.domain.recordable and context.records.window is None and not event.burden[0]
    places = []
    for a in range(1, len(sides)):
        moved = _fit_sides(context, noise, sides, sides[a], event) if plain else []
        there = [
            side if k == a or not moved else linearize_side(context, noise, moved[k])
            for k, side in enumerate(sides)
        ]
        views = [view_events(context, noise, side, [event], error)[0] for side in there]
        places.append((Separation(there, context.criteria), views))

    def repeat_event(times: int) -> EventTrial:
        denied = np.stack(
            [s.find_denied_rivals(views, a, times) for a, (s, views) in enumerate(places, 1)]
        )
        return EventTrial.from_draws(event, denied, ignored, refitted=plain)

    once = repeat_event(1)
    if once.least >= DECIDED:
        return once
    enough = (n for n in REPEATED if repeat_event(n).least >= DECIDED)
    return replace(once, repeated=next(enough, None))


def _fit_sides(
    context: Context, noise: Noise, sides: Sequence[Side], truth: Side, event: ImaginedDip
) -> list[Refit]:
    """Every side fitted to the records and one event more, in which `truth` holds exactly."""
    at = context.coordinates
    middle = at.without_faults(truth.fit.unit, ())
    power = context.kernels.simulate(
        truth.fit.names, middle[None], Drive.from_events([drive_imagined(context, event)])
    )[0]
    whole = context.move_to_events(
        (*context.records.recorded, record_imagined(context, event, power))
    )
    wide = [whole.coordinates.widen_coordinates(side.fit.unit) for side in sides]
    input_modes = (
        None if noise.input_modes is None else QuietNoise.from_context(whole, wide[0]).input_modes
    )
    both = noise.apply_to_events(whole.problem.power, input_modes)
    fits_by_name = {
        f.names: f
        for f in refit(whole, both, [(s.fit.names, u) for s, u in zip(sides, wide, strict=True)])
    }
    fits = [fits_by_name[s.fit.names] for s in sides]
    return [replace(f, unit=f.unit[: at.dimension]) for f in fits]
