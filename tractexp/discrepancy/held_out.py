"""What held-out events say of explanations that were found without them."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tractexp.discrepancy.all_events import AllEvents
from tractexp.discrepancy.decide import find_adequate, needs_all_events
from tractexp.discrepancy.evidence import Evidence, SetEvidence
from tractexp.discrepancy.explanations import Explanations
from tractexp.discrepancy.gap import (
    SHOWN,
    GapTest,
    compute_gain_beyond_chance,
    compute_gap,
    compute_pushed_changes,
)
from tractexp.inference.context import Context
from tractexp.inference.fitting import (
    Names,
    Refit,
    fit_initial_power,
    key_by_names,
    refit,
    refit_from,
)
from tractexp.inference.noise_in_quiet import QuietNoise, assume_white_noise
from tractexp.noise import Noise
from tractexp.record import Event
from tractexp.text.wording import count_noun

# of what an effect explains: no formula is exact to this, and a fault of the measurement mends it
MENDED = 0.05


def judge_held_out(
    evidence: Evidence, explained: Explanations, events: Sequence[Event], seed: int
) -> Evidence:
    """The table with the sets that leave nothing refitted without needless faults of the
    measurement, and judged on held-out events, if any.
    """
    context = explained.base.context
    noise = explained.last.noise
    criteria = explained.last.criteria
    at = context.coordinates
    start = at.without_faults(explained.steps[0].fit.unit, ())
    bare = refit_from(context, noise, (), start, faults=())
    faults = find_telling_faults(explained, bare)
    adequate = find_adequate(evidence, criteria)
    wanted = adequate or [row for row in evidence.rows if not criteria.rejects(row.behind)][:1]
    starts = [(row.fit.names, at.without_faults(row.fit.unit, faults)) for row in wanted]
    finals = key_by_names(refit(context, noise, starts, faults=faults))
    rows = [
        replace(
            row, final=finals.get(row.fit.names), names=tuple(sorted((*row.fit.names, *faults)))
        )
        for row in evidence.rows
    ]
    base = replace(evidence.base, fit=bare)
    evidence = replace(evidence, base=base, rows=tuple(rows), faults=faults)
    if not events:
        return evidence
    both = AllEvents(context, events, noise, faults, bare, explained.refits)
    if not any(row.fit.names or faults for row in adequate):
        is_empty = not explained.chosen.names and not explained.faults
        is_silent = context.domain.calibrated and is_empty and base.p_left >= criteria.adequate_p
        if is_silent and measure_open_gain(both) > criteria.shown:
            base = replace(base, p_of_all=both.p_left(explained.base.local_minima, seed))
        return replace(evidence, base=base)
    context.effort.say(f"judging {count_noun(len(adequate), 'explanation')} on the held-out events")
    judged = {row.fit.names: row for row in assess(both, find_adequate(evidence, criteria), seed)}
    return replace(evidence, rows=tuple(judged.get(row.fit.names, row) for row in evidence.rows))


def find_telling_faults(explained: Explanations, bare: Refit) -> Names:
    """The faults of the measurement that stand out, but for those that only mend the formula of an
    effect.

    Beside an effect of the load they must explain more, together with those left out before, than
    the part of all that is explained to which no formula is exact (`MENDED`).
    """
    context, noise, fit, faults = (
        explained.base.context,
        explained.last.noise,
        explained.chosen,
        explained.faults,
    )
    if not fit.names:
        return faults

    def fit_with(retained: Names) -> float:
        unit = context.coordinates.without_faults(fit.unit, retained)
        return refit_from(context, noise, fit.names, unit, retained).deviance

    most = fit_with(faults) if faults else 0.0
    while faults:
        fewer = {fit_with(rest): rest for rest in itertools.combinations(faults, len(faults) - 1)}
        if min(fewer) - most > MENDED * (bare.deviance - most):
            break
        faults = fewer[min(fewer)]
    return faults


def assess(both: AllEvents, rows: Sequence[SetEvidence], seed: int) -> list[SetEvidence]:
    """Rows judged on held-out events, and by a fit to all events where `decide` needs that.

    Of several effects each is judged against the others alone as the whole is against the base
    model. A fit to all events may also bear out what does not help as it was fitted, or leaves more
    than chance does, since the fitted events may leave a part of it open; such a row is judged and
    told as fitted to all.
    """
    criteria = both.fitted.criteria
    fits = [row.reported_fit for row in rows]
    without = {fit.names: both.without_each(fit) for fit in fits}
    judged = judge_fits(both, rows, fits, without)
    if not needs_all_events(judged, criteria):
        return judged
    joint = {one[0].names: one for one in both.compare(fits, seed)}
    best = min(fit.cost for fit, _ in joint.values())
    assessed = {}
    for row in judged:
        own, p_left = joint[row.fit.names]
        assessed[row.fit.names] = replace(row, p_of_all=p_left, behind_of_all=own.cost - best)
    again = []
    alone = key_by_names(fits)
    for names, (fit, p_left) in joint.items():
        row = assessed[names]
        assert row.gap is not None
        # shown as it was fitted, and nothing of the held-out events is left
        suffices = row.gap.left <= row.gap.shown and all(gap.outcome == SHOWN for gap in row.gaps)
        # all events speak louder for it than the fitted ones, and it leaves nothing of them
        louder = both.measure_loudness(fit, alone[names])
        is_borne_out = louder > 0 and p_left >= criteria.adequate_p
        if is_borne_out and not suffices and not criteria.rejects(row.behind_of_all):
            again.append(fit)
    if again:
        without_of_all = {fit.names: both.fit_to_all(without[fit.names]) for fit in again}
        chosen = [row for fit in again for row in rows if row.fit.names == fit.names]
        for row in judge_fits(both, chosen, again, without_of_all):
            assessed[row.fit.names] = replace(row, is_fitted_to_all=True)
    return [assessed[row.fit.names] for row in rows]


def judge_fits(
    both: AllEvents,
    rows: Sequence[SetEvidence],
    fits: Sequence[Refit],
    without: Mapping[Names, Mapping[str, Refit]],
) -> list[SetEvidence]:
    """Rows with what held-out events say of their fits (one a row), and of each of several effects.

    `without` {names: {member: fit}} are the sets without each member.
    """
    gaps = compare_on(both.fitted, both.events, both.bare, fits)
    judged = []
    for row, fit in zip(rows, fits, strict=True):
        fewer = without[fit.names]
        members = {
            name: compare_on(both.fitted, both.events, fewer[name], [fit])[fit.names]
            for name in fewer
        }
        judged.append(replace(row, final=fit, gap=gaps[fit.names], without=members))
    return judged


def measure_open_gain(both: AllEvents) -> float:
    """What perturbations of the base model would gain on the held-out events, beyond what noise
    leaves there.
    """
    there, (unit,), noise = carry_fits(both.fitted, both.events, [both.bare])
    changes = compute_pushed_changes(there, unit, (), noise)
    return compute_gain_beyond_chance(there, unit, (), noise, there.coordinates.before, changes)


def compare_on(
    context: Context, events: Sequence[Event], bare: Refit, extended: Sequence[Refit]
) -> dict[Names, GapTest]:
    """Compare a model and extended ones, as they were fitted, on held-out events, by the noise of
    the last.
    """
    other, units, noise = carry_fits(context, events, [bare, *extended])
    before = other.coordinates.before
    return {
        fit.names: compute_gap(other, units[0], unit, fit.names, noise, before, bare.names)
        for fit, unit in zip(extended, units[1:], strict=True)
    }


def carry_fits(
    context: Context, events: Sequence[Event], fits: Sequence[Refit]
) -> tuple[Context, list[np.ndarray], Noise]:
    """Carry fits over to held-out events: everything keeps its trained value but P0 and Q0 of each
    event.

    Returns the context of those events, the coordinates of each fit there, and the noise of the
    last one that has a steady state there.
    """
    other = context.move_to_events(events)
    at = other.coordinates.at_measured_power
    units = [
        fit_initial_power(other, at(fit.unit), assume_white_noise(other), fit.names) for fit in fits
    ]
    noise = assume_white_noise(other)
    for unit, fit in zip(reversed(units), reversed(fits), strict=True):
        if np.isfinite(left := other.residual(unit, fit.names)).all():
            noise = QuietNoise.from_context(other, unit).estimate_noise(unit, left)
            break
    return (
        other,
        [fit_initial_power(other, u, noise, fit.names) for u, fit in zip(units, fits, strict=True)],
        noise,
    )
