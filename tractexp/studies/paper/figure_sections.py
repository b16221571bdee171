"""The paper's figures drawn again, a section each."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.style import PALETTE
from tractexp.report.events import CAPTION, CalculatedCurve, draw_event
from tractexp.studies.comparison import charts
from tractexp.studies.comparison.floor import Floor
from tractexp.studies.comparison.runs import SearchRun, Variant
from tractexp.studies.paper import conclusion, figures, maps, why
from tractexp.studies.paper.printed import COMPARED, LABELS, label
from tractexp.studies.paper.study import (
    BUDGETS,
    FLOOR_FACTOR,
    LEVEL,
    RANDOM,
    TARGETS,
    TRADED,
    Study,
)
from tractexp.studies.paper.verdict import format_middle, format_number
from tractexp.text.wording import finish_sentence

SHOWN = ("0.3", "0.5", "0.7")  # alphas whose orbits are drawn


def add_figure3(sheet: Report, study: Study) -> None:
    """Add the tent map."""
    sheet.heading("Figure 3: the tent map")
    orbits = {
        f"alpha = {a}": maps.compute_tent_orbit(float(a), 200, 1, np.random.default_rng(0))[:, 0]
        for a in SHOWN
    }
    where, flock = next(iter(study.uniformity.items()))
    sheet.chart(figures.orbits(orbits), "Orbits of Eq. (14).")
    sheet.chart(
        figures.evenness(flock), f"How even a flock is: {where}, 200 flocks, median and 5 to 95 %."
    )
    sheet.table(
        ["way to scatter", *study.uniformity],
        [[way, *(format_middle(kind[way]) for kind in study.uniformity.values())] for way in flock],
        "Centered discrepancy (Hickernell 1998), median (lowest .. highest). With alpha = 0.5 an"
        " orbit reaches 0 in about 53 steps of binary arithmetic; it is then started anew.",
    )


def add_figure4(sheet: Report, study: Study) -> None:
    """Add Lévy flights."""
    sheet.heading("Figure 4: Lévy flights")
    sheet.chart(
        figures.flights(maps.draw_flights("mantegna", 300, 3, seed=1)),
        "Steps of Eq. (15), three dimensions.",
    )
    sheet.chart(
        figures.tails(study.tails), "How large the steps of the two readings of Eq. (15) become."
    )
    rows = []
    for formula, steps in study.tails.items():
        size = np.abs(steps)
        cells = [
            format_number(float(np.median(size))),
            *(f"{np.mean(size > x):.2%}" for x in (10, 100)),
        ]
        rows.append([formula, *cells, f"{maps.estimate_tail_exponent(steps):.2f}"])
    sheet.table(["formula", "median |s|", "|s| > 10", "|s| > 100", "tail exponent"], rows)


def add_figure6(sheet: Report, study: Study) -> None:
    """Add the record."""
    event = study.train[0]
    record = event.record
    sheet.heading("Figure 6: the record")
    caption = [f"{record.name}, a dip of {100 * event.depth:.0f} %", *record.notes]
    sheet.chart(figures.record(record.t, record.U, record.P, record.Q), ": ".join(caption))


def _fit(sheet: Report, fit: Any, role: str) -> None:
    """Add measured and calculated power of one event."""
    record = fit.event.record
    caption = (
        f"{record.name} ({role}), ISSA, one run: epsilon_p {fit.epsilon_p:.2%}, epsilon_q"
        f" {fit.epsilon_q:.2%}."
    )
    curve = CalculatedCurve("calculated", np.stack((fit.P, fit.Q)), PALETTE[1])
    sheet.chart(
        draw_event(fit.event, [curve]),
        " ".join([caption, CAPTION, *map(finish_sentence, record.notes)]),
    )


def add_figure8(sheet: Report, study: Study) -> None:
    """Add the fit."""
    sheet.heading("Figure 8: the fit")
    _fit(sheet, study.first("issa")[0], "fitted")


def add_figure9(sheet: Report, study: Study) -> None:
    """Add the searches."""
    sheet.heading("Figure 9: the searches")
    floor = Floor(study.floor, "")
    one = [_collect_variant(study, name, "iterations", 1) for name in COMPARED]
    sheet.chart(
        charts.draw_fitness(one, "iterations", floor)[0], "One run, seed 0, as the paper shows it."
    )
    for by in BUDGETS:
        all_ = [_collect_variant(study, name, by, study.seeds) for name in COMPARED]
        sheet.chart(
            charts.draw_fitness(all_, by, floor)[0],
            f"Median and quartiles of {study.seeds} seeds, by {by}; the line is the lowest"
            " objective known.",
        )
    rows = []
    for name in LEVEL:
        rows.append(
            [
                label(name),
                *(
                    format_number(study.running_time(name, t, by))
                    for by in BUDGETS
                    for t in TARGETS
                ),
            ]
        )
    sheet.table(
        ["", *(f"{by} to {t:g} × floor" for by in BUDGETS for t in TARGETS)],
        rows,
        "Expected running times: all that was spent until the target, per search that reached it;"
        f" by simulations of the searches that are laid out for {study.equal:,}.",
    )
    _reasons(sheet, study)
    if study.has_traded_parameter:
        _valleys(sheet, study)


def _collect_variant(study: Study, name: str, by: str, seeds: int) -> Variant:
    """The searches of an optimizer, laid out by one of `BUDGETS`, as a variant to compare."""
    data = study.train[0].record.name
    return Variant(
        label(name),
        name,
        {},
        tuple(
            SearchRun(
                name,
                data,
                seed,
                {},
                "",
                f.objective,
                simulations=f.history.simulations,
                seconds=f.history.seconds,
                history=f.history.objective,
            )
            for seed, f in enumerate(study.run_searches(name, by)[:seeds])
        ),
    )


def _reasons(sheet: Report, study: Study) -> None:
    """Add why the searches rank as they do."""
    sheet.heading("Why they rank so", 3)
    sheet.text(*conclusion.explain_ranks(study))
    rows = []
    for name in (*LEVEL, "random_search"):
        share = study.shares(name)
        rows.append(
            [
                label(name),
                *(f"{k} of {share.n}" for k in (share.valley, share.floor, share.done)),
                format_middle(study.above_bottom(name)),
            ]
        )
    control = study.control_shares
    rows.append(["a random point", f"{control.valley} of {control.n}", "-", "-", "-"])
    sheet.table(
        [
            "300 iterations",
            "in the valley of the lowest objective",
            "at the floor",
            "at the bottom of its own valley",
            "objective over that of the bottom",
        ],
        rows,
        "In a valley is a search from whose end least squares reach its bottom; at a bottom or at"
        f" the floor means within {FLOOR_FACTOR:g} times of it. The control: {RANDOM} random points"
        f" of the bounds, and the best of {study.equal:,} of them.",
    )
    sheet.table(
        [
            "beside PSO",
            "as deep in its own valley",
            "as often in the right valley",
            "as often there as random points",
            "as often there as the best of them",
            "as low once least squares have ended both",
        ],
        [
            [
                LABELS[k.name],
                *(
                    f"p = {t.p:.2g}"
                    for t in (k.convergence, k.valley, k.random, k.best, k.polished)
                ),
            ]
            for k in why.compare_with_ssa(study)
        ],
        "First and last Wilcoxon's test over paired seeds, the others Fisher's exact test;"
        " two-sided, all by Holm's correction. SD = 20, no velocity limit.",
    )


def _valleys(sheet: Report, study: Study) -> None:
    """Add the valleys along the parameters that trade."""
    sheet.heading(f"The valleys along {TRADED}", 3)
    sheet.text(*conclusion.describe_valley(study))
    grid, path = study.path
    index = {name: k for k, name in enumerate(study.problem.space.names)}
    shown = {"objective / lowest": path.objective / study.floor}
    shown |= {"q_v": path.values[:, index["q_v"]]} if "q_v" in index else {}
    if (static := conclusion.compute_static_reactive(study, path.values)) is not None:
        shown["Q_s0 [pu]"] = static
    own = next(p.bounds for p in study.problem.parameters if p.name == TRADED)
    bottoms = [
        (float(v[index[TRADED]]), f / study.floor) for f, _, v in study.control.group_valleys()[:2]
    ]
    sheet.chart(
        figures.chart_objective_along(TRADED, grid, shown, own, bottoms),
        f"The best fit for each value of {TRADED}, all other parameters fitted again. Dots: the two"
        f" valleys. Shaded: beyond the bounds of {TRADED}. Q_s0 is what is left of Q before the dip"
        " to the static load.",
    )
    _add_ends(sheet, study)
    _add_valleys_by_bounds(sheet, study, index[TRADED])


def _add_ends(sheet: Report, study: Study) -> None:
    """Add in which valley the searches ended."""
    names = study.problem.space.names
    every = {name: study.ends[name].group_valleys() for name in COMPARED}
    rows = []
    for f, n, values in study.control.group_valleys()[:4]:
        ended = [sum(k for g, k, _ in groups if abs(g / f - 1) < 0.02) for groups in every.values()]
        rows.append(
            [
                format_number(f),
                *(str(k) for k in ended),
                str(n),
                *map(format_number, values),
            ]
        )
    sheet.table(
        ["valley: objective", *(LABELS[n] for n in every), "random points", *names],
        rows,
        f"Where least squares lead the {study.seeds} searches of each and {RANDOM} random points;"
        " of the latter the lowest four.",
    )


def _add_valleys_by_bounds(sheet: Report, study: Study, traded: int) -> None:
    """Add how often random points lead to the right valley, by the bounds of the parameter that
    trades, of that number.
    """
    rows = []
    for (low, high), ends in study.ends_by_bounds.items():
        right = ends.objective <= FLOOR_FACTOR * study.floor
        at, count = "-", 0
        for f, n, values in ends.group_valleys()[1:2]:
            at = f"{format_number(f)} at {TRADED} = {format_number(float(values[traded]))}"
            count = n
        rows.append([f"{low:g} .. {high:g}", f"{np.mean(right):.0%}", at, str(count)])
    sheet.table(
        [
            f"bounds of {TRADED}",
            "random points in the right valley",
            "the next valley",
            "of them there",
        ],
        rows,
        f"{RANDOM} random points of each box, from which least squares descend.",
    )


def explain_held_out_figure(figure: str, kind: str) -> Callable[..., None]:
    def section(sheet: Report, study: Study) -> None:
        sheet.heading(f"Figure {figure}: {kind}")
        fits = study.first("issa")
        for e in study.select_held_out(kind):
            _fit(sheet, fits[e], kind)

    return section
