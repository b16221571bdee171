"""The figures of the paper, drawn from our own measurements. Arrays in, a file out."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tractexp.comparison.runs import Variant
from tractexp.comparison.summary import band
from tractexp.report import style

ITERATIONS = 150  # shown of an orbit
POINTS = 400  # of a survival curve


def maps(path: Path, orbits: Mapping[str, np.ndarray], spread: Mapping[str, np.ndarray], *, caption: str) -> Path:
    """Figure 3: orbits {label: (n,)} in [0, 1], and the discrepancies {way: (draws,)} of flocks as box plots."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(8.0, 0.9 + 1.05 * len(orbits)), layout="constrained")
        grid = figure.add_gridspec(len(orbits), 2, width_ratios=(1.5, 1.0))
        for k, (label, orbit) in enumerate(orbits.items()):
            panel = figure.add_subplot(grid[k, 0])
            shown = orbit[:ITERATIONS]
            panel.plot(np.arange(len(shown)), shown, color=style.PALETTE[k], linewidth=0.6, marker=".", markersize=3)
            panel.set(ylim=(-0.03, 1.03), ylabel="z")
            panel.set_title(label, loc="left", pad=2)
            last = k == len(orbits) - 1
            panel.tick_params(labelbottom=last)
            panel.set_xlabel("iteration" if last else "")
        panel = figure.add_subplot(grid[:, 1])
        ink = {"color": style.PALETTE[0], "linewidth": 1.0}
        panel.boxplot(
            list(spread.values()), orientation="horizontal", widths=0.6, showfliers=False, whis=(5, 95),
            medianprops={"color": style.PALETTE[1], "linewidth": 2}, boxprops=ink, whiskerprops=ink, capprops=ink,
        )  # fmt: skip
        panel.set_yticks(range(1, len(spread) + 1), list(spread))
        panel.invert_yaxis()
        middle = [np.quantile(values, (0.05, 0.95)) for values in spread.values()]
        style.logarithmic(panel, "x", np.min(middle), np.max(middle))
        panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panel.set_xlabel("centered discrepancy")
        panel.set_title(caption, loc="left", pad=2)
        return style.save(figure, path)


def flights(path: Path, steps: np.ndarray, tails: Mapping[str, np.ndarray]) -> Path:
    """Figure 4: Lévy steps (n, 3) by iteration, and the share of steps {formula: (m,)} that are larger than x."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(8.0, 3.6), layout="constrained")
        left, right = figure.subplots(1, 2)
        for k, column in enumerate(steps.T):
            left.plot(column, color=style.PALETTE[k], linewidth=0.8, label=f"dimension {k + 1}")
        left.set_yscale("symlog", linthresh=5)
        left.set_yticks([-100, -10, 0, 10, 100], ["-100", "-10", "0", "10", "100"])
        left.set(xlabel="iteration", ylabel="step s (Mantegna)")
        left.legend(loc="upper left", ncols=3, handlelength=1.2)
        for k, (formula, drawn) in enumerate(tails.items()):
            size = np.sort(np.abs(drawn))
            share = 1 - np.arange(len(size)) / len(size)
            kept = np.unique(len(size) - np.geomspace(1, len(size), POINTS).astype(int))
            label = "Mantegna, |nu|^(1/beta)" if formula == "mantegna" else "as printed, |nu|^beta"
            right.plot(size[kept], share[kept], color=style.PALETTE[k], label=label)
        right.set_xlim(left=0.1)
        style.logarithmic(right, "x", 0.1, 1e6)
        style.logarithmic(right, "y", 1e-5, 1)
        right.set(xlabel="x", ylabel="share of steps with |s| > x")
        right.legend(loc="upper right")
        return style.save(figure, path)


def searches(path: Path, variants: Sequence[Variant], by: str, floor: float) -> Path:
    """Figure 9 over all seeds: median and quartile band of the best objective by "iterations" or "simulations"."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    bands = [band(variant, by) for variant in variants]
    low, high = min(floor, *(b.lower.min() for b in bands)), max(b.top for b in bands)
    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(8.0, 4.2), layout="constrained")
        panel = figure.subplots()
        for variant, b, color in zip(variants, bands, style.PALETTE, strict=False):
            panel.plot(b.x, b.median, drawstyle="steps-post", color=color, label=variant.name)
            panel.fill_between(b.x, b.lower, b.upper, step="post", color=color, alpha=0.18, linewidth=0)
        style.logarithmic(panel, "y", low, high)
        panel.set_ylim(low / (high / low) ** 0.04, high)
        panel.axhline(floor, color=style.FAINT, linewidth=0.8, linestyle=(0, (2, 2)), zorder=0.6)
        if by == "simulations":
            style.logarithmic(panel, "x", min(b.x[0] for b in bands), max(b.x[-1] for b in bands))
        panel.set(xlabel=by, ylabel="best objective [pu²]")
        figure.legend(loc="outside right upper")
        return style.save(figure, path)


def record(path: Path, t: np.ndarray, curves: Mapping[str, np.ndarray], *, title: str) -> Path:
    """Figure 6: the recorded voltage and power (N,) [pu] over time [s]."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(8.0, 3.2), layout="constrained")
        panel = figure.subplots()
        for (label, values), color in zip(curves.items(), (style.VOLTAGE, style.ACTIVE, style.REACTIVE), strict=True):
            panel.plot(*style.thin(t, values), color=color, label=label)
        panel.set(xlabel="t [s]", ylabel="pu")
        panel.set_title(title, loc="left")
        panel.legend(loc="lower right", ncols=3)
        return style.save(figure, path)
