"""The figures of the paper as charts, made of our own measurements."""

from collections.abc import Mapping, Sequence

import numpy as np

from tractexp.blocks.chart import Chart
from tractexp.blocks.style import ACTIVE, FAINT, PALETTE, REACTIVE, VOLTAGE

ORBIT_ITERATIONS = 150  # shown of an orbit
SURVIVAL_POINTS = 400  # of a survival curve


def orbits(values: Mapping[str, np.ndarray]) -> Chart:
    """Figure 3: orbits {label: (n,)} in [0, 1], one below the other."""
    chart = Chart(
        "iteration",
        [f"z, {label}" for label in values],
        legend=False,
        pixels=90 + 130 * len(values),
    )
    for k, (label, orbit) in enumerate(values.items()):
        shown = orbit[:ORBIT_ITERATIONS]
        chart.line(label, np.arange(len(shown)), shown, PALETTE[k], k, width=0.8).limits(
            k, -0.03, 1.03
        )
    return chart


def evenness(spread: Mapping[str, np.ndarray]) -> Chart:
    """Figure 3: the discrepancies {way: (draws,)} of flocks, median and 5 to 95 %."""
    chart = Chart(
        "centered discrepancy",
        [""],
        legend=False,
        log_x=True,
        pixels=90 + 30 * len(spread),
        hover="closest",
    )
    rows = -np.arange(float(len(spread)))
    low, middle, high = np.array(
        [np.quantile(values, (0.05, 0.5, 0.95)) for values in spread.values()]
    ).T
    labels = [
        f"{way}: {m:.3g}, 5 to 95 % {a:.3g} .. {b:.3g}"
        for way, a, m, b in zip(spread, low, middle, high, strict=True)
    ]
    chart.points("", middle, rows, PALETTE[0], hover=labels, spans=np.stack((low, high), axis=1))
    chart.ticks(None, [k * 10.0**n for n in range(-4, 1) for k in (1, 2, 5)])
    return chart.ticks(0, rows.tolist(), list(spread)).limits(0, rows[-1] - 0.6, 0.6)


def flights(steps: np.ndarray) -> Chart:
    """Figure 4: Lévy steps (n, k) by iteration."""
    chart = Chart("iteration", ["step s (Mantegna)"])
    for k, column in enumerate(steps.T):
        chart.line(f"dimension {k + 1}", np.arange(len(column)), column, PALETTE[k], width=1)
    return chart


def tails(drawn: Mapping[str, np.ndarray]) -> Chart:
    """Figure 4: the share of steps {formula: (n,)} that are larger than x."""
    names = {"mantegna": "Mantegna, |nu|^(1/beta)", "printed": "as printed, |nu|^beta"}
    chart = Chart("x", ["share with |s| > x"], log_x=True, log_y=True, pixels=340)
    for k, (formula, steps) in enumerate(drawn.items()):
        size = np.sort(np.abs(steps))
        share = 1 - np.arange(len(size)) / len(size)
        points = np.unique(len(size) - np.geomspace(1, len(size), SURVIVAL_POINTS).astype(int))
        chart.line(names[formula], size[points], share[points], PALETTE[k])
    return chart.limits(None, 0.1, 1e6).limits(0, 1e-5, 1.2)


def record(t: np.ndarray, U: np.ndarray, P: np.ndarray, Q: np.ndarray) -> Chart:
    """Figure 6: the recorded voltage and power (N,) [pu] over time [s]."""
    chart = Chart("t [s]", ["pu"], pixels=330)
    for name, values, color in (("U", U, VOLTAGE), ("P", P, ACTIVE), ("Q", Q, REACTIVE)):
        chart.line(name, t, values, color)
    return chart.limits(None, float(t[0]), float(t[-1]))


def chart_objective_along(
    name: str,
    grid: np.ndarray,
    panels: Mapping[str, np.ndarray],
    bounds: tuple[float, float],
    valleys: Sequence[tuple[float, float]],
) -> Chart:
    """The best fit at each value (n,) of a parameter: its objective over the lowest first, then
    others {label: (n,)}.

    What lies beyond the parameter's bounds is shaded; `valleys` are values and relative objectives
    of the two.
    """
    chart = Chart(name, list(panels), heights=[1.5] + [1.0] * (len(panels) - 1), legend=False)
    for k, (label, values) in enumerate(panels.items()):
        chart.line(label, grid, values, PALETTE[k], k)
    low, high = float(grid[0]), float(grid[-1])
    for start, end in ((low, bounds[0]), (bounds[1], high)):
        if end > start:
            chart.shade(start, end, FAINT, opacity=0.12)
    labels = [f"valley at {name} = {x:.3g}: {y:.3g} times the lowest objective" for x, y in valleys]
    chart.points("", [x for x, _ in valleys], [y for _, y in valleys], ACTIVE, size=9, hover=labels)
    return chart.limits(None, low, high)
