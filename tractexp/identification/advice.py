"""What to do next, computed from what an identification leaves open."""

from collections.abc import Sequence

import numpy as np

from tractexp.configuration.run_command import suggest_run
from tractexp.errors import UserError
from tractexp.identification.adequacy import Adequacy, Grade
from tractexp.identification.plan import DipShape, IntervalForecast, forecast_over_depth
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import (
    BOUND,
    HELD,
    IDENTIFIED_SHARE,
    UNIDENTIFIED,
    WEAK,
    choose_scale,
    format_half_width,
)
from tractexp.inference.bounds import BOUND_DISTANCE
from tractexp.inference.information import SHARE
from tractexp.inference.problem import Problem
from tractexp.record.change import find_runs


def advise(
    uncertainty: Uncertainty,
    adequacy: Adequacy,
    odd: Sequence[str] = (),
    data: str = "",
) -> list[str]:
    """What to do next, from what an identification leaves open.

    Of a model that does not describe the load nothing is said that would only hold if it did. What
    is missing is looked for in the domain that tells more, where there is one.

    Parameters
    ----------
    uncertainty : Uncertainty
        Values, intervals and verdicts.
    adequacy : Adequacy
        The grade of the model.
    odd : names
        Events that do not fit with the rest.
    data : str
        The choice of data that holds further events of the load; "" where none is known.

    Returns
    -------
    list of str
        Sentences, the most pressing first; never empty.
    """
    better = [
        f"{why}: {suggest_run('domain=waves')}"
        for why in advise_domain(uncertainty.likelihood.problem)
    ]
    sentences = [f"leave {name} out, or free what differs there by model.per_event" for name in odd]
    settings = ["task=discrepancy", f"data={data}"] if data else ["task=discrepancy"]
    search = suggest_run(*settings)
    if adequacy.grade is Grade.WRONG_MODEL:
        missing = f"find what is missing: {search}; or choose another model: tractexp list model"
        return [*(better or [missing]), *sentences]
    if adequacy.grade is Grade.EFFECT_MISSING and not better:
        sentences.insert(0, f"find the missing effect: {search}")
    sentences += [
        f"widen model.bounds.{name}, or ask whether the model is the right one"
        for name, verdict in uncertainty.verdicts.items()
        if verdict.word == BOUND
    ]
    for direction in uncertainty.information.unseen:
        tied = [
            n for n, share in zip(uncertainty.names, direction, strict=True) if abs(share) > SHARE
        ]
        if len(tied) > 1:
            sentences.append(
                f"fix one of {', '.join(tied)} by model.fixed: no record of this kind can tell them"
                " apart"
            )
        else:
            why = (
                HELD
                if tied[0] in uncertainty.information.held
                else "the record does not change with it"
            )
            sentences.append(f"fix {tied[0]} by model.fixed: {why}")
    sentences += _advise_depths(uncertainty)
    return (
        [*better, *sentences]
        if adequacy.grade is Grade.EFFECT_MISSING
        else [*sentences, *better]
        if sentences
        else ["nothing: every parameter is identified"]
    )


def advise_domain(problem: Problem) -> list[str]:
    """That another domain tells more of one of the events; [] where none does."""
    return [why for why in map(problem.domain.better, problem.events) if why][:1]


def _advise_depths(uncertainty: Uncertainty) -> list[str]:
    """Which further dip would identify what is open but not structurally so."""
    verdicts = uncertainty.verdicts
    poor = [n for n in uncertainty.names if verdicts[n].word in (WEAK, UNIDENTIFIED)]
    if not poor or not uncertainty.information.identifiable.all():
        return []
    problem = uncertainty.likelihood.problem
    named = ", ".join(poor)
    without_figures = (
        f"for {named}: record a dip of another depth and fit it together, or fix what stays open by"
        " model.fixed"
    )
    if problem.per_event:
        return [without_figures]
    deepest = int(np.argmax([e.depth for e in problem.events]))
    shape = DipShape.from_event(problem.events[deepest])
    noise = uncertainty.likelihood.noise.select_event(deepest)
    try:
        forecasts = forecast_over_depth(
            problem, uncertainty.values, shape, uncertainty.information, noise
        )
    except UserError:  # this model or these values cannot be planned with
        return [without_figures]
    others = "these" if len(problem.events) > 1 else "this one"
    together = f"for {1000 * shape.duration:.0f} ms, fitted together with {others},"
    return [
        _describe_depths(uncertainty, uncertainty.names.index(name), forecasts, together)
        for name in poor
    ]


def _describe_depths(
    uncertainty: Uncertainty, j: int, forecasts: Sequence[IntervalForecast], together: str
) -> str:
    """The depths of a further dip with which the interval of parameter `j` is narrow enough, in a
    sentence.

    They need not be all beyond one: a dip as deep as those recorded repeats them, a shallower one
    may tell more.
    """
    name, low, high = uncertainty.names[j], uncertainty.lower[j], uncertainty.upper[j]
    goal, bounds = _find_goal(uncertainty, j)
    half = np.array([f.half[j] for f in forecasts])
    width = lambda x: format_half_width(uncertainty.values[j], x, low, high)  # noqa: E731
    reached = (
        f"; its interval now reaches its bound {' and '.join(f'{b:g}' for b in bounds)}, "
        if bounds
        else ""
    )
    if (half <= goal).any():
        enough = half <= goal
        which = (
            "any further dip"
            if enough.all()
            else f"a further dip of {_format_spans(forecasts, enough)}"
        )
        still = (
            f"{reached}and if it does so then, ask whether model.bounds.{name} is right"
            if reached
            else ""
        )
        return f"for {name}: {which} {together} would give {width(goal)} or better{still}"
    best = int(half.argmin())
    leaves = (
        f"would give {width(half[best])}"
        if half[best] < (high - low) / 2
        else "would leave it open too"
    )
    bound = f"{reached}so ask whether model.bounds.{name} is right" if reached else ""
    return (
        f"for {name}: no single further dip {together} will do; the best, of"
        f" {100 * forecasts[best].shape.depth:.3g} %,"
        f" {leaves}; record several, or fix it or what it trades against by model.fixed{bound}"
    )


def _find_goal(uncertainty: Uncertainty, j: int) -> tuple[float, list[float]]:
    """Half an interval that is narrow enough, and the bounds that the present one reaches.

    Where it reaches one, half of what is inside the bounds is asked for. Where curvature calls it
    narrow enough already, it is the profile that does not, and half of what curvature says is asked
    for.
    """
    low = uncertainty.lower[j]
    high = uncertainty.upper[j]
    (a, b), enough = (
        uncertainty.intervals[j],
        IDENTIFIED_SHARE * choose_scale(uncertainty.values[j], low, high),
    )
    bounds = [
        bound
        for end, bound in ((a, low), (b, high))
        if abs(end - bound) < BOUND_DISTANCE * (high - low)
    ]
    asked = [
        enough,
        *([(b - a) / 4] if bounds else []),
        *([uncertainty.half[j] / 2] if uncertainty.half[j] <= enough else []),
    ]
    return min(asked), bounds


def _format_spans(forecasts: Sequence[IntervalForecast], enough: np.ndarray) -> str:
    """The depths of the forecasts (n,) that are `enough`, as text: '5 to 15 % or 27.5 to 95 %'."""
    depths = np.array([f.shape.depth for f in forecasts])
    spans = [(100 * depths[part][0], 100 * depths[part][-1]) for part in find_runs(enough)]
    return " or ".join(f"{a:.3g} to {b:.3g} %" if b > a else f"{a:.3g} %" for a, b in spans)
