"""The paper's tables beside our measurements, a section each."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.studies.paper import printed
from tractexp.studies.paper.printed import COMPARED, LABELS, LITERAL, READINGS, TEN, label
from tractexp.studies.paper.study import BUDGETS, FLOOR_FACTOR, LEVEL, Study
from tractexp.studies.paper.verdict import PAIRS, format_middle, format_number

TO_THE_LETTER = (
    "To the letter: Eqs. (4), (12) and (15) as they are printed, in raw units, every move taken, SD"
    " = 20, one step per sample; the objective is that of this model."
)

THREE = ("paper", "one", "median")


def add_table1(sheet: Report, study: Study) -> None:
    """Add three orders of the motor."""
    sheet.heading("Table 1: three orders of the motor")
    sheet.text(
        "The paper grades the models in words and shows no numbers. Here each is fitted to the same"
        " record by least squares from many starts, with the same static load, and judged on the"
        " dips it has not seen."
    )
    rows, sizes = [], []
    for motor, order in study.orders.items():
        fitted, held = (
            ", ".join(f"{100 * e:.3g} %" for e in order.spread(role))
            for role in ("train", "validate")
        )
        rows.append(
            [
                motor,
                ", ".join(printed.TABLE_1[motor][:4]),
                fitted,
                held if study.held_out else "-",
                f"{order.condition:.1e}",
                f"{order.finite} of {order.free}",
                f"{order.identified_count} of {order.free}",
            ]
        )
        micro = f"{order.nanoseconds * study.problem.drive.samples / 1000:.3g}"
        sizes.append(
            [
                motor,
                printed.TABLE_1[motor][4],
                f"{order.step.total:.0f}",
                str(order.substeps),
                f"{order.per_sample.total:.0f}",
                micro,
            ]
        )
    sheet.table(
        [
            "motor",
            "the paper: P, Q, stability, identifiability",
            "epsilon_p, epsilon_q",
            "held out",
            "condition",
            "finite intervals",
            "identified",
        ],
        rows,
        "Condition: of the information matrix, parameters in units of their ranges. Finite"
        " intervals: 95 %, inside the bounds. Identified: within ± 20 %.",
        words=(1,),
    )
    sheet.table(
        [
            "motor",
            "the paper: calculation size",
            "operations per step",
            "steps per sample",
            "operations per sample",
            "µs per simulation",
        ],
        sizes,
        "Operations: additions, multiplications, divisions and others of the compiled equations for"
        " one candidate, four stages and the powers of the static load included; a step is as short"
        " as the accuracy asks for. The time, on this machine and among many candidates at once,"
        " decides nothing.",
    )
    verdicts = [
        f"{m}: {n} {v}"
        for m, o in study.orders.items()
        for n, v in o.uncertainty.verdicts.items()
        if v.word != "identified"
    ]
    if verdicts:
        sheet.items(verdicts)


def _list_values(study: Study, reading: str, place: int | None) -> list[float]:
    """The values of the parameter at a place that the searches of a reading found; [] where it has
    none.
    """
    return [] if place is None else [one.values[place] for one in study.run_searches(reading)]


def _list_parameter_rows(study: Study, columns: Sequence[tuple[str, str]]) -> list[list[str]]:
    """One row for each parameter and error; a column is a reading and "paper", "one" (seed 0) or
    "median" of it.
    """
    index = {n: k for k, n in enumerate(study.problem.space.names)}
    bounds = {p.name: f"{p.bounds[0]:g} .. {p.bounds[1]:g}" for p in study.problem.parameters}
    rows = []
    for k, parameter in enumerate(printed.NAMES):
        row = [parameter, bounds[parameter] if parameter in index else "-"]
        for name, what in columns:
            values = _list_values(study, name, index.get(parameter))
            row.append(
                f"{printed.TABLE_3[name][k]:g}" if what == "paper" else _render_cell(values, what)
            )
        rows.append(row)
    for error, table in (("epsilon_p", printed.EPSILON_P), ("epsilon_q", printed.EPSILON_Q)):
        rows.append([error, "", *_list_errors(study, columns, error, table)])
    ends = [_render_cell(study.objectives(n), w, printed.OBJECTIVE, n) for n, w in columns]
    return [*rows, ["Obj.E [pu²]", "", *ends]]


def _list_errors(
    study: Study, columns: Sequence[tuple[str, str]], error: str, table: Mapping[str, Any]
) -> list[str]:
    """A row's cells of one error of the first dip."""
    found = {name: [getattr(fits[0], error) for fits in study.fits(name)] for name, _ in columns}
    return [_render_cell(found[name], what, table, name) for name, what in columns]


def _render_cell(values: Any, what: str, table: Any = None, name: str = "") -> str:
    """A cell: what the paper prints, the value of seed 0, or the median."""
    if what == "paper":
        return f"{table[name]:g}"
    return (
        format_number(float(values[0] if what == "one" else np.median(values)))
        if len(values)
        else "-"
    )


def _add_parameters(
    sheet: Report, study: Study, columns: Sequence[tuple[str, str]], caption: str
) -> None:
    captions = {"paper": "the paper", "one": "one run", "median": "median"}
    heads = [f"{label(name)}, {captions[what]}" for name, what in columns]
    sheet.table(["", "bounds", *heads], _list_parameter_rows(study, columns), caption)


def add_table2(sheet: Report, study: Study) -> None:
    """Add what ISSA identifies."""
    sheet.heading("Table 2: what ISSA identifies")
    others = [(name, "median") for name in (TEN["issa"], LITERAL["issa"])]
    _add_parameters(
        sheet,
        study,
        [*(("issa", what) for what in THREE), *others],
        "The lowest objective known on this record is"
        f" {format_number(study.reference.objective)} pu², found by least squares from"
        f" many starts in {study.reference.simulations:,} simulations."
        " Errors are fractions. Bounds are ours, in s, pu, 1, pu s²/rad, pu, 1 and 1: the paper"
        " prints none. " + TO_THE_LETTER,
    )


def add_table3(sheet: Report, study: Study) -> None:
    """Add ISSA, SSA and PSO."""
    sheet.heading("Table 3: ISSA, SSA and PSO")
    _add_parameters(
        sheet,
        study,
        [(name, what) for name in COMPARED for what in THREE],
        "SD = 20, no velocity limit. Medians are taken for each row by itself, over searches that"
        " end in different valleys (see Figure 9). Bounds are ours; the paper prints none.",
    )
    others = (*TEN.values(), "pso_limited", *LITERAL.values())
    _add_parameters(
        sheet, study, [(name, "median") for name in others], f"The other readings. {TO_THE_LETTER}"
    )
    sheet.table(
        [
            "",
            "objective after 300 iterations",
            "simulations",
            "per iteration",
            "at the floor",
            f"objective after {study.equal:,} simulations",
            "s per search",
        ],
        [_list_spent(study, name) for name in (*LEVEL, *LITERAL.values())],
        f"Median (best .. worst) of {study.seeds} seeds. The floor is {format_number(study.floor)}"
        f" pu²; at the floor means within {FLOOR_FACTOR:g} times. ISSA simulates its flock about"
        f" twice in an iteration: by iterations it has twice the means. Searches of {study.equal:,}"
        " simulations are laid out for them, so that every schedule runs whole.",
    )
    rows = []
    for by in BUDGETS:
        for a, b in PAIRS:
            pair = study.pair(a, b, by)
            rows.append([f"{LABELS[a]} and {LABELS[b]}, by {by}", f"{pair.p:.2g}", f"{pair.A:.2f}"])
    sheet.table(["pair", "p", "A"], rows, "SD = 20, no velocity limit; p is not corrected here.")


def _list_spent(study: Study, name: str) -> list[str]:
    """A row of what searches of a reading spend and where they end."""
    searches, literal = study.run_searches(name), READINGS[name].literal
    ends = study.objectives(name)
    each = np.median([f.simulations / max(f.iterations, 1) for f in searches])
    return [
        label(name),
        format_middle(ends),
        f"{np.median([f.simulations for f in searches]):,.0f}",
        f"{each:.0f}",
        "-" if literal else f"{np.mean(ends <= FLOOR_FACTOR * study.floor):.0%}",
        "-" if literal else format_middle(study.objectives(name, "simulations")),
        f"{np.median([f.seconds for f in searches]):.2f}",
    ]


def add_generalization_table(
    number_: str, kind: str, table: dict[str, tuple[float, float]]
) -> Callable[..., None]:
    def section(sheet: Report, study: Study) -> None:
        residuals = study.residuals(kind)
        names = ", ".join(
            (*study.train, *study.held_out)[e].record.name for e in study.select_held_out(kind)
        )
        sheet.heading(f"Table {number_}: {kind}")
        rows = []
        for name, ours in residuals.items():
            own = table.get(name)
            cells = [
                cell
                for c in (0, 1)
                for cell in (
                    f"{own[c]:g}" if own else "",
                    format_number(ours[0, c]),
                    format_middle(ours[:, c]),
                )
            ]
            rows.append([label(name), *cells])
        sheet.table(
            [
                "",
                *(
                    f"{c}, {what}"
                    for c in "PQ"
                    for what in ("the paper", "one run", "median (lowest .. highest)")
                ),
            ],
            rows,
            f"Mean absolute residual of Eq. (21) [pu] on {names}, with the parameters identified on"
            f" {', '.join(e.record.name for e in study.train)}.",
        )
        if kind == "extrapolation":
            sheet.text(
                "Section 4.4.2 says “less than 50 %” of the dip to extrapolate to; a deeper one"
                " must be meant."
            )

    return section
