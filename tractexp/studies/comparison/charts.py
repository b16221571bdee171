"""The charts of a comparison. Few variants have a color each; of many the first have, and the
others are gray.
"""

from collections.abc import Callable, Sequence

import numpy as np

from tractexp.blocks import style
from tractexp.blocks.chart import DECADE, Chart
from tractexp.studies.comparison.claims import format_number
from tractexp.studies.comparison.floor import Floor, Polished
from tractexp.studies.comparison.runs import SearchRun, Variant
from tractexp.studies.comparison.statistics import Ranks
from tractexp.studies.comparison.summary import ECDF_TARGETS, Band, compute_band, list_runtimes

TOGETHER = len(style.PALETTE)  # more curves than colors are not told apart in one panel
SMALL_CHART_HEIGHT = 230  # pixels, the height of a chart beside others
ROW = 20, 34  # pixels of a variant in a chart with a row for each, where there are many and few
PANEL = 135  # pixels of a parameter
ROUND = (1, 2, 3, 5), (1, 1.5, 2, 3, 4, 5, 6, 8)  # times a power of ten
DOT_JITTER = 0.3  # of a row: dots of equal height hide each other
INSIDE, OUTSIDE = style.PALETTE[0], style.PALETTE[1]
Curves = Sequence[tuple[np.ndarray, np.ndarray]]
# title and height -> a chart without curves, its axes as the others'
Blank = Callable[[str, int | None], Chart]


def draw_fitness(variants: Sequence[Variant], by: str, floor: Floor) -> tuple[Chart, list[Chart]]:
    """Median and quartile band of the best objective by "iterations" or "simulations", where a run
    finished.

    The whole; and where there are more variants than colors, one for each with the first behind it
    in gray.
    """
    variants = [variant for variant in variants if variant.finished_runs]
    names, bands = [v.name for v in variants], [compute_band(v, by) for v in variants]
    low, high = min(floor.value, *(b.lower.min() for b in bands)), max(b.top for b in bands)
    counted = by == "simulations"
    first = min(b.x[(b.lower <= high).argmax()] for b in bands)
    first, last = max(first, 1) if counted else 0, max(b.x[-1] for b in bands)

    def blank(title: str = "", pixels: int | None = None) -> Chart:
        label = "best objective [pu²]" if not title else "pu²"
        chart = Chart(
            by,
            [label],
            log_x=counted,
            log_y=True,
            hover="closest",
            title=title,
            pixels=pixels,
            legend=not title,
        )
        chart.limits(0, low / (high / low) ** 0.06, high).level(floor.value, "floor")
        return chart.limits(None, first, last)

    curves = [(b.x, b.median) for b in bands]
    whole = _draw_curves_together(
        blank("", _choose_height(names)), names, curves, [] if len(names) > TOGETHER else bands
    )
    return whole, _draw_curves_apart(blank, names, curves, bands) if len(names) > TOGETHER else []


def draw_ecdf(variants: Sequence[Variant], floor: Floor) -> tuple[Chart, list[Chart]]:
    """The share of all targets that all runs of a variant have reached, by simulations."""
    return draw_runtime_curves(
        [v.name for v in variants], [list_runtimes(v, floor) for v in variants], "simulations"
    )


def draw_runtime_curves(
    names: Sequence[str], costs: Sequence[np.ndarray], label: str
) -> tuple[Chart, list[Chart]]:
    """The ECDF of runtimes, sorted, inf where a target was not reached; `label` says what they are
    counted in.
    """
    reached = np.concatenate([cost[np.isfinite(cost)] for cost in costs])
    first, last = (reached.min(), reached.max()) if len(reached) else (1.0, 10.0)

    def blank(title: str = "", pixels: int | None = None) -> Chart:
        share = "share of targets reached" if not title else "share"
        chart = Chart(
            label,
            [share],
            log_x=True,
            hover="closest",
            title=title,
            pixels=pixels,
            legend=not title,
        )
        return chart.limits(0, 0, 1.02).limits(None, first, 1.1 * last)

    curves = [_step_shares(cost, first, 1.1 * last) for cost in costs]
    whole = _draw_curves_together(blank("", _choose_height(names)), names, curves, [])
    return whole, _draw_curves_apart(blank, names, curves, []) if len(names) > TOGETHER else []


def _step_shares(cost: np.ndarray, first: float, last: float) -> tuple[np.ndarray, np.ndarray]:
    """The steps of a distribution of costs between two ends."""
    x, counts = np.unique(cost[np.isfinite(cost)], return_counts=True)
    x, y = style.thin(x, np.cumsum(counts) / len(cost), 240)
    return np.array([first, *x, last]), np.array([0, *y, *(y[-1:] if len(y) else [0])])


def describe_targets() -> str:
    """Which targets the curves count."""
    return (
        f"{len(ECDF_TARGETS)} targets from {ECDF_TARGETS[0]:.0f} to {ECDF_TARGETS[-1]:.2f} times"
        " the floor"
    )


def _draw_curves_together(
    chart: Chart, names: Sequence[str], curves: Curves, bands: Sequence[Band]
) -> Chart:
    """All curves in one chart, the first ones in color and on top; bands where they are given."""
    for name, (x, y) in list(zip(names, curves, strict=True))[TOGETHER:]:
        chart.line(name, x, y, style.BEHIND, step=True, legend=False)
    for b, color in zip(bands, style.PALETTE, strict=False):
        chart.band("", b.x, b.lower, b.upper, color, step=True)
    for name, (x, y), color in zip(names, curves, style.PALETTE, strict=False):
        chart.line(name, x, y, color, step=True, width=2)
    return chart


def _choose_height(names: Sequence[str]) -> int:
    """Pixels of a chart of curves: their names may take several lines of the legend."""
    letters = sum(6 + len(name) for name in names[:TOGETHER])
    return 310 + 22 * (letters // 36)


def _draw_curves_apart(
    blank: Blank, names: Sequence[str], curves: Curves, bands: Sequence[Band]
) -> list[Chart]:
    """One small chart for each curve, the first curve behind it."""
    charts = []
    for k, (name, (x, y)) in enumerate(zip(names, curves, strict=True)):
        chart = blank(name, SMALL_CHART_HEIGHT)
        chart.line(names[0], *curves[0], style.BEHIND, step=True, legend=False)
        for b in bands[k : k + 1]:
            chart.band("", b.x, b.lower, b.upper, style.PALETTE[0], step=True)
        charts.append(chart.line(name, x, y, style.PALETTE[0], step=True, legend=False))
    return charts


def draw_spread(variants: Sequence[Variant], floor: Floor) -> Chart:
    """Where every finished run ended, one row for each variant, with the median and the quartiles
    of each.
    """
    variants = [variant for variant in variants if variant.finished_runs]
    chart = _draw_rows("objective [pu²]", [v.name for v in variants], log=True)
    dots = [(run, row + shift) for row, v in enumerate(variants) for run, shift in _spread_runs(v)]
    labels = [
        f"{run.optimizer}, seed {run.seed}: {format_number(run.objective, 4)} pu²"
        for run, _ in dots
    ]
    ends = np.array([run.objective for run, _ in dots])
    chart.points("every run", ends, [y for _, y in dots], style.FAINT, size=4, hover=labels)
    ended = [[run.objective for run in v.finished_runs] for v in variants]
    lower, middle, upper = np.array([np.quantile(values, (0.25, 0.5, 0.75)) for values in ended]).T
    labels = [
        f"{v.name}: median {format_number(m, 4)} pu²" for v, m in zip(variants, middle, strict=True)
    ]
    chart.points(
        "median and quartiles",
        middle,
        np.arange(len(variants)),
        style.PALETTE[0],
        hover=labels,
        spans=np.column_stack((lower, upper)),
        symbol="diamond",
        size=9,
    )
    margin = max(ends.max() / floor.value, 1.2) ** 0.04
    low, high = min(floor.value, ends.min()) / margin, ends.max() * margin
    # Plotly's own are as long as 0.4 times 10 to the -4
    if high < DECADE * low and len(at := round_numbers(low, high)) > 2:
        chart.ticks(
            None, at, [f"{value:.1e}".replace(".0", "").replace("e-0", "e-") for value in at]
        )
    return chart.edge(floor.value, dash="dash").limits(None, low, high)


def round_numbers(low: float, high: float) -> list[float]:
    """Round numbers between two ends, for an axis in powers of ten."""
    few, more = (
        [m * 10.0**k for k in range(-20, 5) for m in marks if low <= m * 10.0**k <= high]
        for marks in ROUND
    )
    return few if len(few) > 2 else more


def _spread_runs(variant: Variant) -> list[tuple[SearchRun, float]]:
    """The finished runs with a share of a row by which each is moved, so that equal
    ones are seen.
    """
    done = variant.finished_runs
    return list(zip(done, DOT_JITTER * np.cos(2.4 * np.arange(len(done))), strict=True))


def _draw_rows(label: str, names: Sequence[str], *, log: bool = False) -> Chart:
    """A chart with a row for each name, the first on top."""
    chart = Chart(
        label,
        [""],
        log_x=log,
        pixels=140 + ROW[len(names) <= TOGETHER] * len(names),
        hover="closest",
    )
    return chart.ticks(0, range(len(names)), names).limits(0, len(names) - 0.4, -0.6)


def draw_mean_ranks(ranks: Ranks, label: str = "mean rank over the seeds (1 is best)") -> Chart:
    """Mean ranks with half of Nemenyi's critical difference to either side, the best on top."""
    order = np.argsort(ranks.mean, kind="stable")
    names, mean = [ranks.names[k] for k in order], np.array(ranks.mean)[order]
    half = ranks.critical_difference / 2
    chart = _draw_rows(label, names)
    labels = [f"{name}: {rank:.2f}" for name, rank in zip(names, mean, strict=True)]
    spans = np.column_stack((mean - half, mean + half))
    chart.points("", mean, np.arange(len(names)), style.PALETTE[0], hover=labels, spans=spans)
    return chart.limits(None, min(1, spans.min()) - 0.1, max(len(names), spans.max()) + 0.1)


def _choose_axis_ends(values: Sequence[float]) -> tuple[float, float]:
    """The ends of an axis for these values: all of them, and of equal ones a neighbourhood."""
    low, high = min(values), max(values)
    edge = 0.08 * (high - low) or 1e-3 * max(abs(high), 1e-9)
    return low - edge, high + edge


def draw_parameters(variants: Sequence[Variant], polished: Polished) -> Chart:
    """The parameters at which every run ended, a panel for each, and where the floor's lie."""
    variants = [v for v in variants if not polished.reached.keys().isdisjoint(v.finished_runs)]
    names = list(polished.parameters)
    labels = [
        f"{name} [{polished.units[name]}]" if polished.units[name] != "1" else name
        for name in names
    ]
    turned = sum(4 + len(v.name) for v in variants) > 40  # characters side by side on a phone
    room = 6 * max(len(v.name) for v in variants) if turned else 0
    chart = Chart("", labels, pixels=100 + PANEL * len(names) + room, hover="closest")
    dots = [
        (run, k + shift)
        for k, v in enumerate(variants)
        for run, shift in _spread_runs(v)
        if run in polished.reached
    ]
    elsewhere = [(run, x) for run, x in dots if polished.in_valley(run) is False]
    inside = [(run, x) for run, x in dots if polished.in_valley(run) is True]
    for panel, name in enumerate(names):
        _add_ends(chart, panel, name, "elsewhere", elsewhere, OUTSIDE)
        _add_ends(chart, panel, name, "in the floor's valley", inside, INSIDE)
        floor = polished.parameters[name]
        chart.level(floor, panel=panel, color=INSIDE).limits(
            panel, *_choose_axis_ends([floor, *(run.parameters[name] for run, _ in dots)])
        )
    chart.ticks(None, range(len(variants)), [v.name for v in variants], turned)
    return chart.limits(None, -0.6, len(variants) - 0.4)


def _add_ends(
    chart: Chart,
    panel: int,
    name: str,
    label: str,
    dots: Sequence[tuple[SearchRun, float]],
    color: str,
) -> None:
    """Add the values of a parameter at which runs ended, [(run, place)], to a panel."""
    labels = [
        f"{run.optimizer}, seed {run.seed}: {name} {run.parameters[name]:.4g}" for run, _ in dots
    ]
    values = [run.parameters[name] for run, _ in dots]
    chart.points(label, [x for _, x in dots], values, color, panel, size=5, hover=labels)
