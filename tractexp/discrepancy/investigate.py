"""The whole investigation, from records to a verdict: none, named, tied or unexplained."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.catalogue import Catalogue, catalogue
from tractexp.discrepancy.gap import Gap, curves, gap
from tractexp.discrepancy.held_out import Judged, carried, weighed
from tractexp.discrepancy.kernels import Family
from tractexp.discrepancy.recommend import Decider, deciding_event
from tractexp.discrepancy.recorder import opened
from tractexp.discrepancy.study import Refit, Study
from tractexp.discrepancy.sure import Rival, surviving
from tractexp.discrepancy.where import Place, where
from tractexp.discrepancy.which import Explanation, Stage, explain
from tractexp.errors import UserError
from tractexp.model.model import Model
from tractexp.noise.model import Noise
from tractexp.record import Event


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
class Finding:
    """Everything the investigation found. `names` are the effects added, `sets` all sets not rejected."""

    verdict: str  # none, named, tied, unexplained
    reason: str
    names: tuple[str, ...]
    sets: list[tuple[str, ...]]
    places: list[Place]
    catalogue: Catalogue
    study: Study
    explanation: Explanation
    rivals: list[Rival]
    bare: Refit  # the base model alone
    extended: Refit  # with the names added
    train: Gap
    held_out: Judged | None
    refitted: bool  # whether the extended model was fitted to the held-out events, too
    decider: Decider | None
    nearest: Nearest | None  # where the verdict is "unexplained"
    alpha: float

    @property
    def validate(self) -> Gap | None:
        """The gap on the held-out events."""
        return None if self.held_out is None else self.held_out.gap

    @property
    def first(self) -> Stage:
        """The tests of the base model."""
        return self.explanation.stages[0]

    @property
    def last(self) -> Stage:
        """The tests once the chosen effects are in."""
        return self.explanation.stages[-1]


def check_events(train: Sequence[Event], validate: Sequence[Event]) -> None:
    """Raise `UserError` for events that do not belong together."""
    held = [e.record.where for e in validate]
    for event in train:
        if event.record.where in held:
            raise UserError(f"{event.record.where} is both in data.train and in data.validate; hold out another event")
    for event in (*train, *validate):
        for channel in ("f", "U2"):
            has, first = getattr(event.record, channel) is not None, train[0]
            if has != (getattr(first.record, channel) is not None):
                one, other = (event, first) if has else (first, event)
                raise UserError(
                    f"{one.record.where} has the channel {channel} and {other.record.where} has not: events of one"
                    " investigation need the same channels; remove the column or add it"
                )


def investigate(
    model: Model,
    train: Sequence[Event],
    validate: Sequence[Event],
    bounds: Mapping[str, Sequence[float]],
    fixed: Mapping[str, float],
    *,
    only: Sequence[str] = (),
    alpha: float = 0.05,
    seed: int = 0,
    tell: Callable[[str], None] = lambda line: None,
) -> Finding:
    """Find where model and records disagree, name what is missing, add it, and measure how the gap shrinks.

    `alpha` is the probability of naming anything where nothing is missing. Raises `UserError` for wrong events or
    names.
    """
    check_events(train, validate)
    known = catalogue(model.motor, model.static, model.effects, train, only)
    tell(f"testing {len(known.candidates)} effects, {len(known.untestable)} more cannot be tested on these events")
    Family(model, known).compile(tell)
    study, first = opened(model, known, train, bounds, fixed, seed, tell)
    naming = 0.8 * alpha  # the rest is spent on the adequacy test
    explanation = explain(study, first, naming, seed, tell)
    survivors, rivals = surviving(study, explanation, seed)
    chain = tuple(explanation.stages[-1].chain(naming))
    noise = explanation.stages[-1].noise
    bare = study.refit(noise, [((), _unchained(study, explanation.stages[0].fit, ()))], chain=())[0]
    adequate = [s for s in survivors if s.adequate] if survivors[0].adequate else []
    wanted = [(s.fit.names, _unchained(study, s.fit, chain)) for s in (adequate or survivors[:1])]
    exact = {f.names: f for f in study.refit(noise, wanted, chain=chain)}
    extended = {names: exact[names] for names, _ in wanted}
    found, together = {}, []
    if validate and any(s.fit.names or chain for s in adequate):
        tell(f"judging {len(adequate)} explanation{'s' * (len(adequate) > 1)} on the held-out events")
        found, together = weighed(
            study, validate, bare, list(extended.values()), noise, chain, seed, doubted=not first.adequate
        )
        extended |= {f.names: f for f in together}
    kept = [s for s in adequate if s.fit.names not in found or found[s.fit.names].helps]
    verdict, reason = _verdict(explanation, survivors, adequate, kept, chain, alpha)
    if together and kept:
        reason += "; what the fitted events leave open of it was fitted to the held-out ones, too"
    if study.phasors is not None:
        reason += f"; {study.phasors.describe()}, which is taken into account"
    chosen = (kept or adequate or survivors)[0]
    sets = [tuple(sorted((*s.fit.names, *chain))) for s in kept] if verdict in ("named", "tied") else []
    names = sets[0] if sets else ()
    after = extended[chosen.fit.names] if names else bare
    last = chosen.stage or explanation.stages[-1]
    if resting := (last if names else first).resting:
        reason += f"; on a bound: {', '.join(resting)}"
    fitted = [*study.base, *study.before, *study.parameters(names)]
    return Finding(
        verdict, reason, names, sets,
        where(first.projection, first.null, alpha) if verdict != "none" else [],
        known, study, explanation, rivals, bare, after,
        gap(study, bare.unit, after.unit, after.names, last.noise, fitted),
        found.get(chosen.fit.names) if names else None, bool(together and kept),
        deciding_event(study, kept) if verdict == "tied" else None,
        _nearest(study, bare, rivals, noise, validate) if verdict == "unexplained" else None, alpha,
    )  # fmt: skip


def _nearest(
    study: Study, bare: Refit, rivals: list[Rival], noise: Noise, validate: Sequence[Event]
) -> Nearest | None:  # fmt: skip
    if not rivals[0].fit.names:
        return None
    before, after = curves(study, bare.unit, noise), curves(study, rivals[0].fit.unit, noise)
    excess = max(before.deviance - study.likelihood.samples, 1e-300)
    held = float("nan")
    if validate:
        other, units, level = carried(study, validate, [bare, rivals[0].fit])
        there = [curves(other, u, level).deviance for u in units]
        held = (there[0] - there[1]) / max(there[0] - other.likelihood.samples, 1e-300)
    others = [(r.fit.names, (before.deviance - r.fit.deviance) / excess) for r in rivals[1:4]]
    share = (before.deviance - after.deviance) / excess
    return Nearest(rivals[0].fit.names, float(share), float(held), after.calculated, others)


def _unchained(study: Study, fit: Refit, chain: Sequence[str]) -> np.ndarray:
    """A fit's coordinates with the insignificant part of the measurement chain back at its null."""
    unit = fit.unit.copy()
    for name in study.catalogue.chain:
        if name not in chain:
            unit[study.parameters([name])] = study.null[study.parameters([name])]
    return unit


def _verdict(
    explanation: Explanation, survivors: list[Rival], adequate: list[Rival], kept: list[Rival],
    chain: tuple[str, ...], alpha: float,
) -> tuple[str, str]:  # fmt: skip
    """The verdict and the sentence behind it."""
    base = explanation.stages[0]
    nothing = not explanation.chosen.names and not chain
    if nothing and base.adequate:
        return "none", f"no disagreement above the noise, at a false-alarm rate of {alpha:.0%}"
    if not adequate:
        return "unexplained", (
            "the model and the records disagree, and nothing in the catalogue explains it: what is left after the best"
            f" explanation would come about by chance with p = {survivors[0].stage.p_left:.2g}; what stands out most:"
            f" {survivors[0].stage.loudest}"
        )
    if not kept and base.adequate:
        return "none", (
            "what seemed to help on the fitted events does not help on the held-out ones, and what the base model"
            " leaves is no more than chance leaves"
        )
    if not kept:
        return "unexplained", "what explains the fitted events does not hold on the held-out ones"
    names = " and ".join(sorted((*kept[0].fit.names, *chain)))
    if len(kept) == 1:
        return "named", f"{names} explains the disagreement, and no other set of this size does"
    return "tied", f"{len(kept)} explanations fit equally well on these events and cannot be told apart"
