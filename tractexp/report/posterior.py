"""The page of a sample of the posterior: how likely each value is, beside what the
fit says of it.
"""

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import ACTIVE, FAINT, PALETTE
from tractexp.identification.posterior import ENOUGH, PosteriorSample
from tractexp.identification.uncertainty import Uncertainty
from tractexp.record.identity import compose_title_of_records
from tractexp.report.profile import (
    LARGEST_END_DIFFERENCE,
    SCATTER,
    find_declared_parameter,
    format_span,
    label_axis,
)
from tractexp.text.wording import finish_sentence

HISTOGRAM_BINS = 60  # of a histogram
DOTS = 1500  # draws shown of a pair
CAPTION = (
    "Blue: how often the draws fall on each value. Dashed: the normal distribution that the"
    " curvature at the estimate stands for. Shaded: the 95 % interval of the posterior. Dotted: the"
    " estimate."
)


def report(uncertainty: Uncertainty, drawn: PosteriorSample, grade: str = "") -> Report:
    """The page. `grade` as on the page of the profiles."""
    names = compose_title_of_records(e.record for e in uncertainty.likelihood.problem.events)
    page = Report(
        f"Posterior: {names}",
        f"A flat prior within the bounds; {len(drawn.draws)} draws of {drawn.steps} steps of"
        " emcee's ensemble.",
    )
    sentences = (
        ([finish_sentence(grade)] if grade else [])
        + [_tell_agreement(uncertainty, drawn)]
        + ([SCATTER] if not uncertainty.exact else [])
    )
    page.verdict(
        *sentences,
        _describe_chain_length(drawn),
        kind="good" if uncertainty.exact and drawn.has_converged else "plain",
    )
    page.charts([_chart_draws(uncertainty, drawn, j) for j in range(len(drawn.names))])
    page.text(CAPTION)
    page.heading("Intervals")
    page.table(
        ["parameter", "meaning", "estimate", "unit", "95 % by the fit", "95 % by the posterior"],
        [
            [name, p.about, f"{value:.4g}", p.unit, format_span(*own), format_span(*interval)]
            for name, value, own, interval in zip(
                drawn.names, uncertainty.values, uncertainty.intervals, drawn.intervals, strict=True
            )
            for p in (find_declared_parameter(uncertainty, name),)
        ],
        words=(1,),
    )
    a, b = _find_closest_pair(drawn)
    page.heading(f"{drawn.names[a]} and {drawn.names[b]} depend on each other most")
    r = np.corrcoef(drawn.draws[:, [a, b]].T)[0, 1]
    page.chart(
        _chart_pair(uncertainty, drawn, a, b),
        f"{min(DOTS, len(drawn.draws))} of the draws; their correlation is {r:+.2f}.",
    )
    return page


def _tell_agreement(uncertainty: Uncertainty, drawn: PosteriorSample) -> str:
    """Whose intervals the posterior confirms."""
    off = np.abs(drawn.intervals - uncertainty.intervals).max(axis=1) / np.maximum(
        np.ptp(uncertainty.intervals, axis=1) / 2, 1e-300
    )
    moved = [
        name
        for name, far in zip(drawn.names, off, strict=True)
        if not far <= LARGEST_END_DIFFERENCE
    ]
    if not moved:
        return "The posterior confirms the intervals of the fit."
    return (
        f"The posterior confirms the intervals of the fit but those of {', '.join(moved)}: take the"
        " posterior's."
    )


def _describe_chain_length(drawn: PosteriorSample) -> str:
    """Whether the chain is long enough, in a sentence."""
    lasts = f"The chain lasts {drawn.steps / drawn.autocorrelation:.0f} autocorrelation times"
    return (
        f"{lasts}." if drawn.has_converged else f"{lasts}; {ENOUGH:.0f} are asked for: raise steps."
    )


def _chart_draws(uncertainty: Uncertainty, drawn: PosteriorSample, j: int) -> Chart:
    """A parameter's draws as a histogram, with both intervals."""
    draws, value, half = drawn.draws[:, j], uncertainty.values[j], uncertainty.half[j]
    low, high = drawn.intervals[j]
    density, edges = np.histogram(draws, HISTOGRAM_BINS, density=True)
    chart = Chart(label_axis(uncertainty, drawn.names[j]), ["density"], pixels=250, legend=False)
    chart.shade(float(low), float(high), PALETTE[5], opacity=0.25)
    if np.isfinite(half):
        at, error = (
            np.linspace(edges[0], edges[-1], 151),
            uncertainty.information.standard_errors[j],
        )
        normal = np.exp(-(((at - value) / error) ** 2) / 2) / (error * np.sqrt(2 * np.pi))
        chart.line("curvature", at, normal, FAINT, dash="dash")
    chart.line("posterior", edges, np.append(density, density[-1]), PALETTE[0], step=True)
    return chart.edge(float(value), ACTIVE).limits(None, edges[0], edges[-1])


def _find_closest_pair(drawn: PosteriorSample) -> tuple[int, int]:
    """The two parameters that go together most."""
    r = np.abs(np.atleast_2d(np.corrcoef(drawn.draws.T)))
    np.fill_diagonal(r, -1.0)
    a, b = np.unravel_index(r.argmax(), r.shape)
    return int(min(a, b)), int(max(a, b))


def _chart_pair(uncertainty: Uncertainty, drawn: PosteriorSample, a: int, b: int) -> Chart:
    """Draws of two parameters."""
    some = drawn.draws[:: max(1, len(drawn.draws) // DOTS)][:DOTS]
    chart = Chart(
        label_axis(uncertainty, drawn.names[a]),
        [label_axis(uncertainty, drawn.names[b])],
        pixels=420,
    )
    chart.points("draws", some[:, a], some[:, b], PALETTE[5], size=3)
    return chart.points(
        "estimate", [uncertainty.values[a]], [uncertainty.values[b]], ACTIVE, size=10
    )
