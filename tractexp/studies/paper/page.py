"""The paper beside our measurements: one section for each of its tables and figures, and a verdict
for each claim.
"""

from collections.abc import Callable, Sequence

import numpy as np

from tractexp.blocks import Report
from tractexp.studies.paper import conclusion, equations, printed
from tractexp.studies.paper.claims import count_verdicts
from tractexp.studies.paper.figure_sections import (
    add_figure3,
    add_figure4,
    add_figure6,
    add_figure8,
    add_figure9,
    explain_held_out_figure,
)
from tractexp.studies.paper.printed import LABELS, READINGS
from tractexp.studies.paper.study import Study
from tractexp.studies.paper.table_claims import BOTH
from tractexp.studies.paper.table_sections import (
    TO_THE_LETTER,
    add_generalization_table,
    add_table1,
    add_table2,
    add_table3,
)
from tractexp.studies.paper.verdict import Claim, format_middle

TITLE = "The paper, table by table"

LEAD = (
    "Wu, Fan and Zou, “Traction Load Modeling and Parameter Identification Based on Improved"
    " Sparrow Search Algorithm”, Energies 2022, 15(14), 5034: what it prints, and what we measure."
    " Written by task=paper."
)


def report(study: Study, parts: Sequence[str], claims: Sequence[Claim]) -> Report:
    """Measure `parts`, and report them with their claims."""
    sheet = Report(TITLE, LEAD)
    _add_top(sheet, study, claims)
    for part in parts:
        study.tell(f"writing {_place(part)}")
        SECTIONS[part](sheet, study)
    return sheet


def _add_top(sheet: Report, study: Study, claims: Sequence[Claim]) -> None:
    """Add the verdicts, and what the reader must know first."""
    sheet.verdict(
        f"Of {count_verdicts(claims)}." if claims else "The parts chosen hold no claim.",
        *conclusion.write_conclusion(study, claims),
    )
    events = (*study.train, *study.held_out)
    notes = dict.fromkeys(note for event in events for note in event.record.notes)
    names = ", ".join(event.record.name for event in events)
    seeds = f"{study.seeds} seeds; one run means seed 0." + (
        f" Searches were stopped at {study.limits.simulations} simulations, so these are not the"
        " paper's 300 iterations."
        if study.limits and study.limits.simulations
        else ""
    )
    sheet.text(
        "The paper's record was never published. Our numbers are measured on other records, so no"
        " value can equal the paper's: what can be checked is which statements hold, on data of"
        " this kind.",
        f"Records: {names}" + (f" ({'; '.join(notes)})" if notes else "") + ".",
        f"{seeds} Where the text can be read in two ways, the tables follow section 4.3: 20 of 50"
        " sparrows perceive danger (section 4.2 has 10), and velocities of particles have no limit,"
        " for none is printed. The other readings stand beside it, and a verdict that depends on"
        " the reading says so.",
    )
    if not claims:
        return
    sheet.heading("The claims")
    sheet.table(
        ["where", "the paper's claim", "verdict", "measured"],
        [[_place(c.part), c.text, c.verdict, c.measured] for c in claims],
        "Where the paper does not say it in so many words, a claim is what its argument needs. p:"
        " Wilcoxon's signed-rank test over paired seeds, by Holm's correction; A: the probability"
        " that the first ends lower (Vargha and Delaney).",
        words=(1, 2, 3),
    )


def _place(part: str) -> str:
    """ "table1" -> "Table 1"."""
    kind = part.rstrip("0123456789")
    return f"{kind.capitalize()} {part[len(kind) :]}".strip()


def add_equations(sheet: Report, study: Study) -> None:
    """Add what the printed values give in the printed equations."""
    sheet.heading("What is printed, in the printed equations")
    sheet.table(
        ["where", "printed", "what the equation gives", "verdict"],
        [
            [c.where, c.printed, c.gives, "agrees" if c.holds else "does not agree"]
            for c in equations.check_printed_numbers()
        ],
        "Table 2 is the first column of Table 3. Order: measured on an oscillator. Tail exponent:"
        " of 200,000 steps.",
        words=(1, 2, 3),
    )
    sheet.heading("What the model says to Table 3", 3)
    refusals = equations.list_refusals(study.problem.model, study.problem.drive)
    sheet.items(
        [f"{LABELS[name]}: {sentence or 'accepted'}" for name, sentence in refusals.items()]
    )
    sheet.text(
        "T_m is the motor's power before the event, in per unit of a load normalized to about 1;"
        " Table 3 has 3.38, 3.02 and 1.23. Mantegna's step and the classical Runge-Kutta method are"
        " used unless levy_formula=printed and model.integration=printed are chosen;"
        " experiment=to_the_letter takes all as printed."
    )


def add_readings(sheet: Report, study: Study) -> None:
    """Add how the text was read."""
    sheet.heading("The readings of the text")
    rows = [
        [
            READINGS[name].words,
            *(format_middle(study.objectives(n)) for n in (name.replace("issa", "ssa", 1), name)),
        ]
        for name in BOTH
    ]
    alone = ("issa_by_stage", "issa_printed_levy")
    rows += [[READINGS[name].words, "", format_middle(study.objectives(name))] for name in alone]
    sheet.table(
        ["reading", "SSA", "ISSA"],
        rows,
        "Objective after 300 iterations [pu²], median (best .. worst). Unless said: unit cube,"
        f" better-only, element-wise, SD = 20. {TO_THE_LETTER} A⁺L in Eq. (12) is one number as"
        " printed; step 5 chooses between Gaussian variation and tent perturbation by fitness,"
        " section 3.2.3 by stage of the search.",
    )
    sheet.heading("ISSA without one of its ingredients", 3)
    rows = [["ISSA", *_format_costs(study, "issa")]]
    for name, (_, label) in printed.INGREDIENTS.items():
        rows.append([f"without {label}", *_format_costs(study, f"issa_no_{name}")])
    sheet.table(
        ["", "objective after 300 iterations [pu²]", "simulations"],
        rows,
        "SD = 20. By iterations, an ingredient that costs simulations is paid for by nobody:"
        " experiment=ablation compares at equal simulations too, adds each to SSA, and crosses"
        " them.",
    )
    sheet.heading("Drawn to zero", 3)
    sheet.table(
        ["sphere in ten dimensions, raw units", "optimum at zero", "one unit away"],
        [[LABELS[n], f"{near:.0e}", f"{far:.0e}"] for n, (near, far) in study.bias.items()],
        "Median error of 7 seeds after 10,000 evaluations, the sparrow searches with one scalar for"
        " A⁺L, as printed. Eq. (11) multiplies by numbers below one, and half of the flock starves"
        " to Q (1, ..., 1).",
    )


def _format_costs(study: Study, name: str) -> tuple[str, str]:
    """The median objective and simulations of an optimizer."""
    spent = np.median([search.simulations for search in study.run_searches(name)])
    return format_middle(study.objectives(name)), f"{spent:,.0f}"


SECTIONS: dict[str, Callable[[Report, Study], None]] = {
    "table1": add_table1,
    "table2": add_table2,
    "table3": add_table3,
    "table4": add_generalization_table("4", "interpolation", printed.INTERPOLATION),
    "table5": add_generalization_table("5", "extrapolation", printed.EXTRAPOLATION),
    "figure3": add_figure3,
    "figure4": add_figure4,
    "figure6": add_figure6,
    "figure8": add_figure8,
    "figure9": add_figure9,
    "figure10": explain_held_out_figure("10", "interpolation"),
    "figure11": explain_held_out_figure("11", "extrapolation"),
    "equations": add_equations,
    "readings": add_readings,
}
