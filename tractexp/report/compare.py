"""The figures of a comparison. A few variants share a panel; many get a small one each, with the first behind."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.comparison.runs import Variant
from tractexp.comparison.statistics import Ranks
from tractexp.comparison.summary import ECDF_TARGETS, Band, Floor, band, runtimes
from tractexp.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TOGETHER = len(style.PALETTE)  # more curves than colors are not told apart in one panel
COLUMNS = 4
Draw = Callable[["Axes", int, dict[str, Any]], None]  # panel, number of the variant, style of its line


def fitness(path: Path, variants: Sequence[Variant], by: str, floor: Floor) -> Path:
    """Median and quartile band of the best objective by "iterations" or "simulations", where a run finished."""
    variants = [variant for variant in variants if variant.finished]
    bands = [band(variant, by, 300 if len(variants) <= TOGETHER else 100) for variant in variants]

    def draw(panel: "Axes", i: int, line: dict[str, Any]) -> None:
        b = bands[i]
        panel.plot(b.x, b.median, drawstyle="steps-post", **line)
        if line["color"] != style.BEHIND:
            panel.fill_between(b.x, b.lower, b.upper, step="post", color=line["color"], alpha=0.18, linewidth=0)

    low, high = min(b.lower.min() for b in bands), max(_seen(b) for b in bands)

    def finish(panel: "Axes") -> None:
        style.logarithmic(panel, "y", low, high)
        panel.set_ylim(low / (high / low) ** 0.04, high)
        panel.axhline(floor.value, color=style.FAINT, linewidth=0.8, linestyle=(0, (2, 2)), zorder=0.6)

    return _panels(path, [v.name for v in variants], draw, finish, (by, "best objective [pu²]"))


def _seen(b: Band) -> float:
    """The top of the axis: the upper quartile after a hundredth of the search; the very start is off the page."""
    return float(b.upper[min(len(b.x) // 100, len(b.x) - 1)])


def ecdf(path: Path, variants: Sequence[Variant], floor: Floor) -> Path:
    """The share of all targets that all runs of a variant have reached, by simulations."""
    return runtime_curves(path, [v.name for v in variants], [runtimes(v, floor) for v in variants], "simulations")


def runtime_curves(path: Path, names: Sequence[str], costs: Sequence[np.ndarray], label: str) -> Path:
    """The ECDF of runtimes, sorted, inf where a target was not reached; `label` says what they are counted in."""
    reached = np.concatenate([cost[np.isfinite(cost)] for cost in costs])
    first, last = (reached.min(), reached.max()) if len(reached) else (1.0, 10.0)

    def draw(panel: "Axes", i: int, line: dict[str, Any]) -> None:
        x, counts = np.unique(costs[i][np.isfinite(costs[i])], return_counts=True)
        y = np.cumsum(counts) / len(costs[i])
        x, y = style.thin(x, y, 120)
        panel.plot([first, *x, 1.1 * last], [0, *y, *(y[-1:] if len(y) else [0])], drawstyle="steps-post", **line)

    def finish(panel: "Axes") -> None:
        style.logarithmic(panel, "x", first, last)
        panel.set_ylim(0, 1.02)

    return _panels(path, names, draw, finish, (label, "share of targets reached"))


def targets_told() -> str:
    """The targets of the ECDF in words."""
    return f"{len(ECDF_TARGETS)} targets from {ECDF_TARGETS[0]:.0f} to {ECDF_TARGETS[-1]:.2f} times the floor"


def _panels(
    path: Path, names: Sequence[str], draw: Draw, finish: Callable[["Axes"], None], labels: Sequence[str]
) -> Path:
    from matplotlib import rc_context

    with rc_context(style.SETTINGS):
        whole = _together if len(names) <= TOGETHER else _apart
        return style.save(whole(names, draw, finish, labels), path)


def _together(names: Sequence[str], draw: Draw, finish: Callable[["Axes"], None], labels: Sequence[str]) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    panel = figure.subplots()
    for i, (name, line) in enumerate(zip(names, style.lines(), strict=False)):
        draw(panel, i, line | {"label": name})
    finish(panel)
    panel.set(xlabel=labels[0], ylabel=labels[1])
    figure.legend(loc="outside right upper")
    return figure


def _apart(names: Sequence[str], draw: Draw, finish: Callable[["Axes"], None], labels: Sequence[str]) -> "Figure":
    """Small panels with the axes of the first, laid out by hand: Matplotlib's layout engines take seconds for many."""
    from matplotlib.figure import Figure

    rows = -(-len(names) // COLUMNS)
    height = 0.75 + 1.3 * rows
    figure = Figure(figsize=(8.6, height))
    panels = figure.subplots(rows, COLUMNS, sharex=True, sharey=True).ravel()
    figure.subplots_adjust(0.09, 0.55 / height, 0.99, 1 - 0.2 / height, wspace=0.08, hspace=0.28)
    for i, (panel, name) in enumerate(zip(panels, names, strict=False)):
        draw(panel, 0, {"color": style.BEHIND, "linewidth": 1.5, "linestyle": "-"})
        draw(panel, i, {"color": style.PALETTE[0], "linestyle": "-", "linewidth": 1.5})
        finish(panel)
        panel.set_title(name, fontsize=7.5, loc="left", pad=2, y=1.0)
        panel.tick_params(labelsize=7, labelbottom=i >= len(names) - COLUMNS)
        if panel.get_xscale() == "linear":
            panel.locator_params(axis="x", nbins=3, prune="upper")
    for panel in panels[len(names) :]:
        panel.remove()
    figure.text(0.54, 0.1 / height, labels[0], ha="center")
    figure.text(0.012, 0.5, labels[1], va="center", rotation="vertical")
    return figure


def boxes(path: Path, variants: Sequence[Variant], floor: Floor) -> Path:
    """Box plots of the final objective, one row per variant, every run a dot; failed runs are not drawn."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    variants = [variant for variant in variants if variant.finished]
    samples = [np.array([run.objective for run in variant.finished]) for variant in variants]
    everything = np.concatenate(samples)
    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(8.0, 0.9 + 0.27 * len(samples)), layout="constrained")
        panel = figure.subplots()
        rows = np.arange(len(samples))
        ink = {"color": style.PALETTE[0], "linewidth": 1.0}
        panel.boxplot(
            samples, positions=rows, orientation="horizontal", widths=0.55, showfliers=False, whis=(0, 100),
            medianprops={"color": style.PALETTE[1], "linewidth": 2}, boxprops=ink, whiskerprops=ink, capprops=ink,
        )  # fmt: skip
        for row, sample in zip(rows, samples, strict=True):
            offset = row + 0.16 * np.cos(np.pi * np.arange(len(sample)))  # two lines of dots: fewer hide each other
            panel.plot(sample, offset, ".", color=style.FAINT, markersize=2.5, alpha=0.5)
        panel.axvline(floor.value, color=style.FAINT, linewidth=0.8, linestyle=(0, (2, 2)))
        panel.set_yticks(rows, [variant.name for variant in variants])
        panel.invert_yaxis()
        panel.grid(axis="y", visible=False)
        style.logarithmic(panel, "x", everything.min(), everything.max())
        panel.set_xlabel("objective at the end of the search [pu²]")
        return style.save(figure, path)


def critical_difference(path: Path, ranks: Ranks) -> Path:
    """Mean ranks on an axis, best to the left; a bar joins variants that do not differ significantly (Nemenyi)."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    order = np.argsort(ranks.mean, kind="stable")
    half = -(-len(order) // 2)
    bars = len(ranks.groups)
    depth = 0.6 + 0.22 * bars + 0.3 * half
    with rc_context(style.SETTINGS | {"axes.grid": False}):
        figure = Figure(figsize=(8.0, 0.7 + depth))
        panel = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        panel.set_axis_off()
        label = 0.3 + 0.062 * max(map(len, ranks.names))  # inch, with its rank
        margin = (label + 0.3) * (len(order) - 1) / (8.0 - 2 * (label + 0.3))
        panel.set(xlim=(1 - margin, len(order) + margin), ylim=(depth, -0.7))
        _axis(panel, len(order), ranks.critical_difference)
        place = {ranks.names[i]: ranks.mean[i] for i in order}
        for k, group in enumerate(ranks.groups):
            ends = [place[group[0]], place[group[-1]]]
            pad = 0.004 * len(order)
            panel.plot(
                [ends[0] - pad, ends[1] + pad],
                [0.25 + 0.22 * k] * 2,
                color=style.ACTIVE,
                linewidth=3.5,
                solid_capstyle="butt",
            )
        for k, i in enumerate(order):
            left = k < half
            y = 0.4 + 0.22 * bars + 0.3 * (k if left else len(order) - 1 - k)
            x = 1 - 0.03 * len(order) if left else 1.03 * len(order)
            panel.plot([ranks.mean[i], ranks.mean[i], x], [0, y, y], color="#444444", linewidth=0.8)
            text = f"{ranks.names[i]}  {ranks.mean[i]:.2f} " if left else f" {ranks.mean[i]:.2f}  {ranks.names[i]}"
            panel.text(x, y, text, ha="right" if left else "left", va="center", fontsize=8.5)
        return style.save(figure, path)


def _axis(panel: "Axes", count: int, difference: float) -> None:
    """The axis of ranks, and above it the length of the critical difference."""
    panel.plot([1, count], [0, 0], color="black", linewidth=1)
    for rank in range(1, count + 1):
        panel.plot([rank, rank], [0, -0.07], color="black", linewidth=1)
        if count <= 15 or rank in (1, count) or rank % 5 == 0:
            panel.text(rank, -0.11, str(rank), ha="center", va="bottom", fontsize=8)
    panel.plot([1, 1 + difference], [-0.42, -0.42], color="black", linewidth=1.5, marker="|", markersize=7)
    panel.text(1 + difference / 2, -0.47, f"critical difference {difference:.2f}", ha="center", va="bottom", fontsize=8)
