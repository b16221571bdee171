"""The paper beside our measurements: one section for each of its tables and figures, and a verdict for each claim."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.style import PALETTE
from tractexp.report.events import CAPTION, CalculatedCurve, event_chart
from tractexp.studies.comparison import charts
from tractexp.studies.comparison.floor import Floor
from tractexp.studies.comparison.runs import SearchRun, Variant
from tractexp.studies.paper import conclusion, equations, figures, maps, printed, why
from tractexp.studies.paper.claims import BOTH, PAIRS, Claim, counted, number
from tractexp.studies.paper.printed import COMPARED, LABELS, LITERAL, READINGS, TEN
from tractexp.studies.paper.study import AT_FLOOR, BUDGETS, LEVEL, RANDOM, TARGETS, TRADED, Study
from tractexp.wording import as_sentence

TITLE = "The paper, table by table"
LEAD = (
    "Wu, Fan and Zou, “Traction Load Modeling and Parameter Identification Based on Improved Sparrow Search"
    " Algorithm”, Energies 2022, 15(14), 5034: what it prints, and what we measure. Written by task=paper."
)
SHOWN = ("0.3", "0.5", "0.7")  # alphas whose orbits are drawn


def report(study: Study, parts: Sequence[str], claims: Sequence[Claim]) -> Report:
    """Measure `parts`, and report them with their claims."""
    sheet = Report(TITLE, LEAD)
    _top(sheet, study, claims)
    for part in parts:
        study.tell(f"writing {_place(part)}")
        SECTIONS[part](sheet, study)
    return sheet


def _top(sheet: Report, study: Study, claims: Sequence[Claim]) -> None:
    """What the reader must know first, and the verdicts."""
    sheet.verdict(
        f"Of {counted(claims)}." if claims else "The parts chosen hold no claim.",
        *conclusion.sentences(study, claims),
    )
    events = (*study.train, *study.held_out)
    notes = dict.fromkeys(note for event in events for note in event.record.notes)
    names = ", ".join(event.record.name for event in events)
    seeds = f"{study.seeds} seeds; one run means seed 0." + (
        f" Searches were stopped at {study.limits.simulations} simulations, so these are not the paper's 300"
        " iterations." if study.limits and study.limits.simulations else ""
    )  # fmt: skip
    sheet.text(
        "The paper's record was never published. Our numbers are measured on other records, so no value can equal"
        " the paper's: what can be checked is which statements hold, on data of this kind.",
        f"Records: {names}" + (f" ({'; '.join(notes)})" if notes else "") + ".",
        f"{seeds} Where the text can be read in two ways, the tables follow section 4.3: 20 of 50 sparrows perceive"
        " danger (section 4.2 has 10), and velocities of particles have no limit, for none is printed. The other"
        " readings stand beside it, and a verdict that depends on the reading says so.",
    )
    if not claims:
        return
    sheet.heading("The claims")
    sheet.table(
        ["where", "the paper's claim", "verdict", "measured"],
        [[_place(c.part), c.text, c.verdict, c.measured] for c in claims],
        "Where the paper does not say it in so many words, a claim is what its argument needs. p: Wilcoxon's"
        " signed-rank test over paired seeds, by Holm's correction; A: the probability that the first ends lower"
        " (Vargha and Delaney).",
        words=(1, 2, 3),
    )


def _place(part: str) -> str:
    """ "table1" -> "Table 1"."""
    kind = part.rstrip("0123456789")
    return f"{kind.capitalize()} {part[len(kind) :]}".strip()


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def _middle(values: Sequence[float] | np.ndarray) -> str:
    """The median and, in brackets, lowest and highest."""
    low, middle, high = np.quantile(values, (0, 0.5, 1))
    return f"{number(middle)} ({number(low)} .. {number(high)})"


def table1(sheet: Report, study: Study) -> None:
    sheet.heading("Table 1: three orders of the motor")
    sheet.text(
        "The paper grades the models in words and shows no numbers. Here each is fitted to the same record by least"
        " squares from many starts, with the same static load, and judged on the dips it has not seen."
    )
    rows, sizes = [], []
    for motor, order in study.orders.items():
        fitted, held = (", ".join(map(_percent, order.spread(role))) for role in ("train", "validate"))
        rows.append([
            motor, ", ".join(printed.TABLE_1[motor][:4]), fitted, held if study.held_out else "-",
            f"{order.condition:.1e}", f"{order.finite} of {order.free}", f"{order.identified} of {order.free}",
        ])  # fmt: skip
        micro = f"{order.nanoseconds * study.problem.drive.samples / 1000:.3g}"
        sizes.append([motor, printed.TABLE_1[motor][4], f"{order.step.total:.0f}", str(order.substeps),
                      f"{order.per_sample.total:.0f}", micro])  # fmt: skip
    sheet.table(
        ["motor", "the paper: P, Q, stability, identifiability", "epsilon_p, epsilon_q", "held out", "condition",
         "finite intervals", "identified"],
        rows,
        "Condition: of the information matrix, parameters in units of their ranges. Finite intervals: 95 %, inside the"
        " bounds. Identified: within ± 20 %.",
        words=(1,),
    )  # fmt: skip
    sheet.table(
        ["motor", "the paper: calculation size", "operations per step", "steps per sample", "operations per sample",
         "µs per simulation"],
        sizes,
        "Operations: additions, multiplications, divisions and others of the compiled equations for one candidate, four"
        " stages and the powers of the static load included; a step is as short as the accuracy asks for. The time, on"
        " this machine and among many candidates at once, decides nothing.",
    )  # fmt: skip
    verdicts = [f"{m}: {n} {v}" for m, o in study.orders.items() for n, v in o.uncertainty.verdicts.items()
                if v.word != "identified"]  # fmt: skip
    if verdicts:
        sheet.items(verdicts)


def _rows_of_parameters(study: Study, columns: Sequence[tuple[str, str]]) -> list[list[str]]:
    """One row for each parameter and error; a column is a reading and "paper", "one" (seed 0) or "median" of it."""
    index = {n: k for k, n in enumerate(study.problem.space.names)}
    bounds = {p.name: f"{p.bounds[0]:g} .. {p.bounds[1]:g}" for p in study.problem.parameters}
    rows = []
    for k, parameter in enumerate(printed.NAMES):
        row = [parameter, bounds[parameter] if parameter in index else "-"]
        for name, what in columns:
            values = [f.values[index[parameter]] for f in study.searched(name)] if parameter in index else []
            row.append(f"{printed.TABLE_3[name][k]:g}" if what == "paper" else _one(values, what))
        rows.append(row)
    for label, table in (("epsilon_p", printed.EPSILON_P), ("epsilon_q", printed.EPSILON_Q)):
        errors = [_one([getattr(fits[0], label) for fits in study.fits(n)], w, table, n) for n, w in columns]
        rows.append([label, "", *errors])
    rows.append(["Obj.E [pu²]", "", *(_one(study.objectives(n), w, printed.OBJECTIVE, n) for n, w in columns)])
    return rows


def _one(values: Any, what: str, table: Any = None, name: str = "") -> str:
    """A cell: what the paper prints, the value of seed 0, or the median."""
    if what == "paper":
        return f"{table[name]:g}"
    return number(float(values[0] if what == "one" else np.median(values))) if len(values) else "-"


def _label(name: str) -> str:
    """ "issa_10_perceivers" -> "ISSA, 10 perceivers (section 4.2)"; the three of the tables are named alone."""
    reading = READINGS[name]
    return LABELS[name] if name in LABELS else f"{LABELS[reading.optimizer]}, {reading.words}"


def _parameters(sheet: Report, study: Study, columns: Sequence[tuple[str, str]], caption: str) -> None:
    captions = {"paper": "the paper", "one": "one run", "median": "median"}
    heads = [f"{_label(name)}, {captions[what]}" for name, what in columns]
    sheet.table(["", "bounds", *heads], _rows_of_parameters(study, columns), caption)


THREE = ("paper", "one", "median")


def table2(sheet: Report, study: Study) -> None:
    sheet.heading("Table 2: what ISSA identifies")
    others = [(name, "median") for name in (TEN["issa"], LITERAL["issa"])]
    _parameters(
        sheet, study, [*(("issa", what) for what in THREE), *others],
        f"The lowest objective known on this record is {number(study.reference.objective)} pu², found by least squares"
        f" from many starts in {study.reference.simulations:,} simulations. Errors are fractions. Bounds are ours, in"
        " s, pu, 1, pu s²/rad, pu, 1 and 1: the paper prints none. " + TO_THE_LETTER,
    )  # fmt: skip


TO_THE_LETTER = (
    "To the letter: Eqs. (4), (12) and (15) as they are printed, in raw units, every move taken, SD = 20, one step per"
    " sample; the objective is that of this model."
)


def table3(sheet: Report, study: Study) -> None:
    sheet.heading("Table 3: ISSA, SSA and PSO")
    _parameters(
        sheet, study, [(name, what) for name in COMPARED for what in THREE],
        "SD = 20, no velocity limit. Medians are taken for each row by itself, over searches that end in different"
        " valleys (see Figure 9). Bounds are ours; the paper prints none.",
    )  # fmt: skip
    others = (*TEN.values(), "pso_limited", *LITERAL.values())
    _parameters(sheet, study, [(name, "median") for name in others], f"The other readings. {TO_THE_LETTER}")
    sheet.table(
        ["", "objective after 300 iterations", "simulations", "per iteration", "at the floor",
         f"objective after {study.equal:,} simulations", "s per search"],
        [_spent(study, name) for name in (*LEVEL, *LITERAL.values())],
        f"Median (best .. worst) of {study.seeds} seeds. The floor is {number(study.floor)} pu²; at the floor means"
        f" within {AT_FLOOR:g} times. ISSA simulates its flock about twice in an iteration: by iterations it has twice"
        f" the means. Searches of {study.equal:,} simulations are laid out for them, so that every schedule runs"
        " whole.",
    )  # fmt: skip
    rows = []
    for by in BUDGETS:
        for a, b in PAIRS:
            pair = study.pair(a, b, by)
            rows.append([f"{LABELS[a]} and {LABELS[b]}, by {by}", f"{pair.p:.2g}", f"{pair.A:.2f}"])
    sheet.table(["pair", "p", "A"], rows, "SD = 20, no velocity limit; p is not corrected here.")


def _spent(study: Study, name: str) -> list[str]:
    """A row of what searches of a reading spend and where they end."""
    searches, literal = study.searched(name), READINGS[name].literal
    ends = study.objectives(name)
    each = np.median([f.simulations / max(f.iterations, 1) for f in searches])
    return [
        _label(name), _middle(ends), f"{np.median([f.simulations for f in searches]):,.0f}", f"{each:.0f}",
        "-" if literal else f"{study.floor_share(ends):.0%}",
        "-" if literal else _middle(study.objectives(name, "simulations")),
        f"{np.median([f.seconds for f in searches]):.2f}",
    ]  # fmt: skip


def _generalized(number_: str, kind: str, table: dict[str, tuple[float, float]]) -> Callable[..., None]:
    def section(sheet: Report, study: Study) -> None:
        residuals = study.residuals(kind)
        names = ", ".join((*study.train, *study.held_out)[e].record.name for e in study.held(kind))
        sheet.heading(f"Table {number_}: {kind}")
        rows = []
        for name, ours in residuals.items():
            own = table.get(name)
            cells = [cell for c in (0, 1)
                     for cell in (f"{own[c]:g}" if own else "", number(ours[0, c]), _middle(ours[:, c]))]  # fmt: skip
            rows.append([_label(name), *cells])
        sheet.table(
            ["", *(f"{c}, {what}" for c in "PQ" for what in ("the paper", "one run", "median (lowest .. highest)"))],
            rows,
            f"Mean absolute residual of Eq. (21) [pu] on {names}, with the parameters identified on"
            f" {', '.join(e.record.name for e in study.train)}.",
        )
        if kind == "extrapolation":
            sheet.text("Section 4.4.2 says “less than 50 %” of the dip to extrapolate to; a deeper one must be meant.")

    return section


def figure3(sheet: Report, study: Study) -> None:
    sheet.heading("Figure 3: the tent map")
    orbits = {f"alpha = {a}": maps.tent_orbit(float(a), 200, 1, np.random.default_rng(0))[:, 0] for a in SHOWN}
    where, flock = next(iter(study.uniformity.items()))
    sheet.chart(figures.orbits(orbits), "Orbits of Eq. (14).")
    sheet.chart(figures.evenness(flock), f"How even a flock is: {where}, 200 flocks, median and 5 to 95 %.")
    sheet.table(
        ["way to scatter", *study.uniformity],
        [[way, *(_middle(kind[way]) for kind in study.uniformity.values())] for way in flock],
        "Centered discrepancy (Hickernell 1998), median (lowest .. highest). With alpha = 0.5 an orbit reaches 0 in"
        " about 53 steps of binary arithmetic; it is then started anew.",
    )


def figure4(sheet: Report, study: Study) -> None:
    sheet.heading("Figure 4: Lévy flights")
    sheet.chart(figures.flights(maps.flights("mantegna", 300, 3, seed=1)), "Steps of Eq. (15), three dimensions.")
    sheet.chart(figures.tails(study.tails), "How large the steps of the two readings of Eq. (15) become.")
    rows = []
    for formula, steps in study.tails.items():
        size = np.abs(steps)
        cells = [number(float(np.median(size))), *(f"{np.mean(size > x):.2%}" for x in (10, 100))]
        rows.append([formula, *cells, f"{maps.tail_exponent(steps):.2f}"])
    sheet.table(["formula", "median |s|", "|s| > 10", "|s| > 100", "tail exponent"], rows)


def figure6(sheet: Report, study: Study) -> None:
    event = study.train[0]
    record = event.record
    sheet.heading("Figure 6: the record")
    caption = [f"{record.name}, a dip of {100 * event.depth:.0f} %", *record.notes]
    sheet.chart(figures.record(record.t, record.U, record.P, record.Q), ": ".join(caption))


def _fit(sheet: Report, fit: Any, role: str) -> None:
    record = fit.event.record
    caption = f"{record.name} ({role}), ISSA, one run: epsilon_p {fit.epsilon_p:.2%}, epsilon_q {fit.epsilon_q:.2%}."
    curve = CalculatedCurve("calculated", np.stack((fit.P, fit.Q)), PALETTE[1])
    sheet.chart(event_chart(fit.event, [curve]), " ".join([caption, CAPTION, *map(as_sentence, record.notes)]))


def figure8(sheet: Report, study: Study) -> None:
    sheet.heading("Figure 8: the fit")
    _fit(sheet, study.first("issa")[0], "fitted")


def figure9(sheet: Report, study: Study) -> None:
    sheet.heading("Figure 9: the searches")
    floor = Floor(study.floor, "")
    one = [_variant(study, name, "iterations", 1) for name in COMPARED]
    sheet.chart(charts.fitness(one, "iterations", floor)[0], "One run, seed 0, as the paper shows it.")
    for by in BUDGETS:
        all_ = [_variant(study, name, by, study.seeds) for name in COMPARED]
        sheet.chart(
            charts.fitness(all_, by, floor)[0],
            f"Median and quartiles of {study.seeds} seeds, by {by}; the line is the lowest objective known.",
        )
    rows = []
    for name in LEVEL:
        rows.append([_label(name), *(number(study.running_time(name, t, by)) for by in BUDGETS for t in TARGETS)])
    sheet.table(
        ["", *(f"{by} to {t:g} × floor" for by in BUDGETS for t in TARGETS)], rows,
        "Expected running times: all that was spent until the target, per search that reached it; by simulations of"
        f" the searches that are laid out for {study.equal:,}.",
    )  # fmt: skip
    _reasons(sheet, study)
    if study.traded:
        _valleys(sheet, study)


def _variant(study: Study, name: str, by: str, seeds: int) -> Variant:
    data = study.train[0].record.name
    return Variant(_label(name), name, {}, tuple(
        SearchRun(name, data, seed, {}, "", f.objective, simulations=f.history.simulations, seconds=f.history.seconds,
            history=f.history.objective) for seed, f in enumerate(study.searched(name, by)[:seeds])))  # fmt: skip


def _reasons(sheet: Report, study: Study) -> None:
    sheet.heading("Why they rank so", 3)
    sheet.text(*conclusion.reasons(study))
    rows = []
    for name in (*LEVEL, "random_search"):
        share = study.shares(name)
        rows.append([_label(name), *(f"{k} of {share.n}" for k in (share.valley, share.floor, share.done)),
                     _middle(study.above_bottom(name))])  # fmt: skip
    control = study.control_shares
    rows.append(["a random point", f"{control.valley} of {control.n}", "-", "-", "-"])
    sheet.table(
        ["300 iterations", "in the valley of the lowest objective", "at the floor", "at the bottom of its own valley",
         "objective over that of the bottom"], rows,
        f"In a valley is a search from whose end least squares reach its bottom; at a bottom or at the floor means"
        f" within {AT_FLOOR:g} times of it. The control: {RANDOM} random points of the bounds, and the best of"
        f" {study.equal:,} of them.",
    )  # fmt: skip
    sheet.table(
        ["beside PSO", "as deep in its own valley", "as often in the right valley", "as often there as random points",
         "as often there as the best of them", "as low once least squares have ended both"],
        [[LABELS[k.name], *(f"p = {t.p:.2g}" for t in (k.convergence, k.valley, k.random, k.best, k.polished))]
         for k in why.lacks(study)],
        "First and last Wilcoxon's test over paired seeds, the others Fisher's exact test; two-sided, all by Holm's"
        " correction. SD = 20, no velocity limit.",
    )  # fmt: skip


def _valleys(sheet: Report, study: Study) -> None:
    sheet.heading(f"The valleys along {TRADED}", 3)
    sheet.text(*conclusion.valley(study))
    grid, path = study.path
    index = {name: k for k, name in enumerate(study.problem.space.names)}
    shown = {"objective / lowest": path.objective / study.floor}
    shown |= {"q_v": path.values[:, index["q_v"]]} if "q_v" in index else {}
    if (static := conclusion.static_reactive(study, path.values)) is not None:
        shown["Q_s0 [pu]"] = static
    own = next(p.bounds for p in study.problem.parameters if p.name == TRADED)
    bottoms = [(float(v[index[TRADED]]), f / study.floor) for f, _, v in study.control.grouped()[:2]]
    sheet.chart(
        figures.along(TRADED, grid, shown, own, bottoms),
        f"The best fit for each value of {TRADED}, all other parameters fitted again. Dots: the two valleys. Shaded:"
        f" beyond the bounds of {TRADED}. Q_s0 is what is left of Q before the dip to the static load.",
    )
    names = study.problem.space.names
    every = {name: study.ends[name].grouped() for name in COMPARED}
    rows = []
    for f, n, values in study.control.grouped()[:4]:
        ended = [sum(k for g, k, _ in groups if abs(g / f - 1) < 0.02) for groups in every.values()]
        rows.append([number(f), *(str(k) for k in ended), str(n), *map(number, values)])
    sheet.table(
        ["valley: objective", *(LABELS[n] for n in every), "random points", *names],
        rows,
        f"Where least squares lead the {study.seeds} searches of each and {RANDOM} random points; of the latter the"
        " lowest four.",
    )
    rows = []
    for (low, high), ends in study.rebounded.items():
        right = ends.objective <= AT_FLOOR * study.floor
        second = ends.grouped()[1:2]
        at = f"{number(second[0][0])} at {TRADED} = {number(float(second[0][2][index[TRADED]]))}" if second else "-"
        rows.append([f"{low:g} .. {high:g}", f"{np.mean(right):.0%}", at, str(second[0][1]) if second else "0"])
    sheet.table(
        [f"bounds of {TRADED}", "random points in the right valley", "the next valley", "of them there"],
        rows, f"{RANDOM} random points of each box, from which least squares descend.",
    )  # fmt: skip


def _held_figure(figure: str, kind: str) -> Callable[..., None]:
    def section(sheet: Report, study: Study) -> None:
        sheet.heading(f"Figure {figure}: {kind}")
        fits = study.first("issa")
        for e in study.held(kind):
            _fit(sheet, fits[e], kind)

    return section


def equations_section(sheet: Report, study: Study) -> None:
    sheet.heading("What is printed, in the printed equations")
    sheet.table(
        ["where", "printed", "what the equation gives", "verdict"],
        [[c.where, c.printed, c.gives, "agrees" if c.holds else "does not agree"] for c in equations.checks()],
        "Table 2 is the first column of Table 3. Order: measured on an oscillator. Tail exponent: of 200,000 steps.",
        words=(1, 2, 3),
    )
    sheet.heading("What the model says to Table 3", 3)
    refusals = equations.refusals(study.problem.model, study.problem.drive)
    sheet.items([f"{LABELS[name]}: {sentence or 'accepted'}" for name, sentence in refusals.items()])
    sheet.text(
        "T_m is the motor's power before the event, in per unit of a load normalized to about 1; Table 3 has 3.38, 3.02"
        " and 1.23. Mantegna's step and the classical Runge-Kutta method are used unless levy_formula=printed and"
        " model.integration=printed are chosen; experiment=to_the_letter takes all as printed."
    )


def readings_section(sheet: Report, study: Study) -> None:
    sheet.heading("The readings of the text")
    rows = [[READINGS[name].words, *(_middle(study.objectives(n)) for n in (name.replace("issa", "ssa", 1), name))]
            for name in BOTH]  # fmt: skip
    alone = ("issa_by_stage", "issa_printed_levy")
    rows += [[READINGS[name].words, "", _middle(study.objectives(name))] for name in alone]
    sheet.table(
        ["reading", "SSA", "ISSA"], rows,
        "Objective after 300 iterations [pu²], median (best .. worst). Unless said: unit cube, better-only,"
        f" element-wise, SD = 20. {TO_THE_LETTER} A⁺L in Eq. (12) is one number as printed; step 5 chooses between"
        " Gaussian variation and tent perturbation by fitness, section 3.2.3 by stage of the search.",
    )  # fmt: skip
    sheet.heading("ISSA without one of its ingredients", 3)
    rows = [["ISSA", *_costs(study, "issa")]]
    for name, (_, label) in printed.INGREDIENTS.items():
        rows.append([f"without {label}", *_costs(study, f"issa_no_{name}")])
    sheet.table(
        ["", "objective after 300 iterations [pu²]", "simulations"], rows,
        "SD = 20. By iterations, an ingredient that costs simulations is paid for by nobody: experiment=ablation"
        " compares at equal simulations too, adds each to SSA, and crosses them.",
    )  # fmt: skip
    sheet.heading("Drawn to zero", 3)
    sheet.table(
        ["sphere in ten dimensions, raw units", "optimum at zero", "one unit away"],
        [[LABELS[n], f"{near:.0e}", f"{far:.0e}"] for n, (near, far) in study.bias.items()],
        "Median error of 7 seeds after 10,000 evaluations, the sparrow searches with one scalar for A⁺L, as printed."
        " Eq. (11) multiplies by numbers below one, and half of the flock starves to Q (1, ..., 1).",
    )


def _costs(study: Study, name: str) -> tuple[str, str]:
    spent = np.median([search.simulations for search in study.searched(name)])
    return _middle(study.objectives(name)), f"{spent:,.0f}"


SECTIONS: dict[str, Callable[[Report, Study], None]] = {
    "table1": table1,
    "table2": table2,
    "table3": table3,
    "table4": _generalized("4", "interpolation", printed.INTERPOLATION),
    "table5": _generalized("5", "extrapolation", printed.EXTRAPOLATION),
    "figure3": figure3,
    "figure4": figure4,
    "figure6": figure6,
    "figure8": figure8,
    "figure9": figure9,
    "figure10": _held_figure("10", "interpolation"),
    "figure11": _held_figure("11", "extrapolation"),
    "equations": equations_section,
    "readings": readings_section,
}
