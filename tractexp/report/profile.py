"""The page of the profiles: how the fit worsens when one parameter is held, and what that says
about its interval.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import ACTIVE, FAINT, PALETTE
from tractexp.identification.profile import End, LikelihoodProfile, Profiles
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import IDENTIFIED, ParameterVerdict, format_half_width
from tractexp.record.identity import compose_title_of_records
from tractexp.text.wording import finish_sentence

LARGEST_END_DIFFERENCE = 0.2  # of the half interval by curvature: closer ends are the same interval
ABOVE = 2.2  # thresholds that a chart shows
BELOW = 0.12  # thresholds of room below the best fit
ENOUGH = "is enough"
SCATTER = (
    "More than noise is left, so these are intervals of least squares: they hold by how much the"
    " estimate scatters, not by how much what the model lacks moves it."
)
CURVE, PARABOLA, SHADE = PALETTE[0], FAINT, PALETTE[5]
CAPTION = (
    "Blue: the deviance (twice the fall of the log-likelihood) of the best fit for each value of"
    " the parameter, above the best of all, over what this parameter's may rise by in units of"
    " {threshold:.2f}. Dashed: the parabola of the curvature at the estimate. Where the blue curve"
    " crosses the line at {threshold:.2f}, the 95 % interval ends; it is shaded. The mark is the"
    " estimate."
)


def report(scan: Profiles, grade: str = "") -> Report:
    """The page.

    `grade` is the sentence that grades the identification.
    """
    uncertainty = scan.uncertainty
    verdicts = scan.verdicts
    names = compose_title_of_records(e.record for e in uncertainty.likelihood.problem.events)
    page = Report(
        f"Profile likelihood: {names}",
        "One parameter is held at value after value, all others are fitted again each time.",
    )
    says = {profile.name: describe_profile(scan, profile) for profile in scan.profiles}
    sentences = [
        *([SCATTER] if not uncertainty.exact else []),
        *_explain_curvature(says),
        *_list_unidentified(verdicts),
    ]
    graded = [finish_sentence(grade)] if grade else []
    page.verdict(
        *graded,
        *sentences,
        *(finish_sentence(note) for note in scan.notes),
        kind=_choose_kind(verdicts, uncertainty.exact),
    )
    titles = {name: f"{name}: {verdict.word}" for name, verdict in verdicts.items()}
    page.charts([_chart_profile(scan, profile, titles[profile.name]) for profile in scan.profiles])
    page.text(CAPTION.format(threshold=scan.threshold))
    page.heading("Intervals")
    page.table(
        [
            "parameter",
            "meaning",
            "estimate",
            "unit",
            "95 % by curvature",
            "95 % by profile",
            "what the profile says",
        ],
        [_build_row(scan, profile, says[profile.name]) for profile in scan.profiles],
        words=(1, 6),
    )
    page.heading("What it rests on").items(
        [
            "The interval by curvature is right where the deviance is a parabola; the profile is"
            " right wherever the model and the noise are, and needs no parabola.",
            f"{scan.simulations} simulations beyond the identification.",
            "An effect that the model lacks moves the estimates and is in neither interval.",
        ]
    )
    return page


def _build_row(scan: Profiles, profile: LikelihoodProfile, says: str) -> list[str]:
    """A profile's cells: value, both intervals, verdict."""
    value, half = _compute_curvature(scan, profile.name)
    about = find_declared_parameter(scan.uncertainty, profile.name)
    by_curvature = format_span(value - half, value + half) if np.isfinite(half) else "none"
    return [
        profile.name,
        about.about,
        f"{value:.4g}",
        about.unit,
        by_curvature,
        format_span(*profile.interval),
        says,
    ]


def describe_profile(scan: Profiles, profile: LikelihoodProfile) -> str:
    """The interval of a profile beside that of the curvature, in a sentence."""
    open_sides = _name_sides(profile, End.BOUND)
    short = _name_sides(profile, End.POINTS)
    low, high = profile.interval
    said = []
    if len(open_sides) == 2:
        said.append("no limit but the bounds: the record does not tell it")
    elif open_sides:
        at = low if open_sides == ["downwards"] else high
        said.append(f"no limit {open_sides[0]} but the bound {at:.4g}")
    if short:
        said.append(f"not followed to its end {' and '.join(short)}: raise points")
    if profile.minima:
        said.append(
            f"{' and '.join(f'{m:.4g}' for m in profile.minima)} fits about as well as the estimate"
        )
    if not said:
        said.append(_compare_half_widths(scan, profile))
    return finish_sentence("; ".join(said))


def _name_sides(profile: LikelihoodProfile, how: End) -> list[str]:
    """The sides on which a profile ends so."""
    sides = zip(profile.ends, ("downwards", "upwards"), strict=True)
    return [side for end, side in sides if end is how]


def _compare_half_widths(scan: Profiles, profile: LikelihoodProfile) -> str:
    """Both sides closed, one minimum: whether ± half is enough."""
    (low, high), (value, half) = profile.interval, _compute_curvature(scan, profile.name)
    if not np.isfinite(half):
        return "the curvature gives no interval, the profile does"
    off = np.array([low - (value - half), high - (value + half)]) / half
    if np.abs(off).max() <= LARGEST_END_DIFFERENCE:
        declared = find_declared_parameter(scan.uncertainty, profile.name)
        return f"{format_half_width(value, half, *declared.bounds)} {ENOUGH}"
    if off[0] > LARGEST_END_DIFFERENCE and off[1] < -LARGEST_END_DIFFERENCE:
        return "narrower than by curvature"
    if off[0] < -LARGEST_END_DIFFERENCE and off[1] > LARGEST_END_DIFFERENCE:
        return "wider than by curvature"
    up = high - value
    down = value - low
    reach, side = (up / down, "up") if up > down else (down / up, "down")
    return f"lopsided: {reach:.1f} times as far {side}"


def _explain_curvature(says: Mapping[str, str]) -> list[str]:
    """Where curvature is enough, and where it misleads."""
    enough = [name for name, said in says.items() if said.endswith(f"{ENOUGH}.")]
    rest = [name for name in says if name not in enough]
    sentences = []
    if enough:
        every = "every parameter" if not rest else ", ".join(enough)
        sentences.append(
            f"For {every} the curvature's interval is enough: the likelihood is a parabola there."
        )
    if rest:
        sentences.append(
            f"For {', '.join(rest)} it misleads: there the profile's interval is the right one."
        )
    return sentences


def _choose_kind(verdicts: Mapping[str, ParameterVerdict], exact: bool) -> str:
    """ "good" where every parameter is identified, else "plain"."""
    return (
        "good"
        if exact and all(verdict.word == IDENTIFIED for verdict in verdicts.values())
        else "plain"
    )


def _list_unidentified(verdicts: Mapping[str, ParameterVerdict]) -> list[str]:
    """The parameters that are not identified, in words."""
    poor = [
        f"{name} is {verdict.word}"
        for name, verdict in verdicts.items()
        if verdict.word != IDENTIFIED
    ]
    return [finish_sentence("; ".join(poor)) if poor else "Every parameter is identified."]


def _compute_curvature(scan: Profiles, name: str) -> tuple[float, float]:
    """Estimate and half of the interval by curvature."""
    j = scan.uncertainty.names.index(name)
    return float(scan.uncertainty.values[j]), float(scan.uncertainty.half[j])


def _chart_profile(scan: Profiles, profile: LikelihoodProfile, title: str) -> Chart:
    """One profile, with the parabola, the threshold, the interval and the estimate."""
    value, half = _compute_curvature(scan, profile.name)
    top = ABOVE * scan.threshold
    x, y = _smooth(profile)
    chart = Chart(
        label_axis(scan.uncertainty, profile.name),
        ["deviance"],
        pixels=290,
        title=title,
        legend=False,
    )
    chart.shade(*profile.interval, SHADE, opacity=0.25)
    if np.isfinite(half):
        parabola = scan.threshold * ((x - value) / half) ** 2
        chart.line(
            "curvature", x, np.where(parabola < 2 * top, parabola, np.nan), PARABOLA, dash="dash"
        )
    chart.line("profile", x, y, CURVE).points("", profile.values, profile.deviance, CURVE, size=4)
    chart.points("", [value], [0.0], ACTIVE, size=9, hover=[f"estimate {value:.5g}"])
    chart.level(scan.threshold).ticks(
        0, [0.0, scan.threshold, 2 * scan.threshold], _label_marks(scan.threshold)
    )
    return chart.limits(0, -BELOW * scan.threshold, top).limits(None, x.min(), x.max())


def _label_marks(threshold: float) -> list[str]:
    """Labels of a profile's axis: the threshold's multiples."""
    return [f"{times * threshold:.2f}".rstrip("0").rstrip(".") for times in range(3)]


def _smooth(profile: LikelihoodProfile) -> tuple[np.ndarray, np.ndarray]:
    """The curve between the points fitted: straight on the signed root, as the
    interval is found.
    """
    x = np.linspace(profile.values.min(), profile.values.max(), 201)
    best = profile.values[profile.deviance.argmin()]
    root = np.sign(profile.values - best) * np.sqrt(np.maximum(profile.deviance, 0.0))
    x = np.union1d(x, profile.values)
    return x, np.interp(x, profile.values, root) ** 2


def find_declared_parameter(uncertainty: Uncertainty, name: str) -> Any:
    """The parameter (a `Parameter`) of a name, which may say its event."""
    return next(
        p for p in uncertainty.likelihood.problem.parameters if p.name == name.partition("[")[0]
    )


def label_axis(uncertainty: Uncertainty, name: str) -> str:
    """A parameter and its unit, as an axis says them."""
    unit = find_declared_parameter(uncertainty, name).unit
    return name if unit == "1" else f"{name} [{unit}]"


def format_span(low: float, high: float) -> str:
    """ "0.1 .. 0.2"."""
    return f"{low:.4g} .. {high:.4g}"
