"""The tables of docs/optimizers.md, from the stored result of benchmarks/optimizers.py and nothing
else.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import marked
import numpy as np

from tractexp.studies.comparison.statistics import (
    Ranks,
    compute_vargha_delaney,
    correct_by_holm,
    rank_by_friedman,
    run_wilcoxon_test,
)

DOCS = Path(__file__).resolve().parents[1] / "docs" / "optimizers.md"
MAKER = "benchmarks/optimizers.py"
REFERENCE = "issa"
NEAR = (0.01, 0.1)  # of the floor
TARGETS = 10.0 ** np.arange(2, -9, -1)  # distances, as task=benchmark has them
AT_END = {"record": 1e-4, "bbob": 1e-8}  # where every search ends: nearer is no better

Stored = Mapping[str, Any]


class Kind:
    """The runs of one series on its records or on its functions of BBOB."""

    def __init__(self, series: Stored, kind: str):
        self.kind, self.budgets = kind, series["plan"]["budgets"]
        self.problems = {
            name: p["runs"] for name, p in series["problems"].items() if p["kind"] == kind
        }
        have = {key for runs in self.problems.values() for key in runs}
        self.optimizers = [
            o for o in series["plan"]["optimizers"] if any(f"{o} {b}" in have for b in self.budgets)
        ]

    def at(self, budget: int) -> list[str]:
        """The optimizers that were run with a budget."""
        first = next(iter(self.problems.values()))
        return [o for o in self.optimizers if f"{o} {budget}" in first]

    def excess(self, optimizer: str, budget: int) -> np.ndarray:
        """(problems, seeds) over the floor, or to the optimum; never below where every
        search ends.
        """
        rows = [runs[f"{optimizer} {budget}"]["excess"] for runs in self.problems.values()]
        return np.maximum(np.array(rows), AT_END[self.kind])

    def valley(self, optimizer: str, budget: int) -> float:
        """The share of searches that ended in the right valley."""
        return float(
            np.mean([runs[f"{optimizer} {budget}"]["valley"] for runs in self.problems.values()])
        )

    def medians(self, optimizer: str, budget: int) -> np.ndarray:
        """(problems,) logarithms of the median over the seeds, which are what is
        ranked and tested.
        """
        return np.log10(np.median(self.excess(optimizer, budget), axis=1))

    def ranks(self, budget: int) -> Ranks:
        """Mean ranks over the problems."""
        names = self.at(budget)
        return rank_by_friedman(names, np.column_stack([self.medians(o, budget) for o in names]))

    def rank(self, optimizer: str, budget: int) -> float:
        ranks = self.ranks(budget)
        return ranks.mean[ranks.names.index(optimizer)]

    def against(self, budget: int) -> dict[str, tuple[float, float]]:
        """{optimizer: (A, p)} against the reference: mean A within problems, Wilcoxon over problems
        with Holm.
        """
        others = [o for o in self.at(budget) if o != REFERENCE]
        p = correct_by_holm(
            [
                run_wilcoxon_test(self.medians(o, budget), self.medians(REFERENCE, budget))[0]
                for o in others
            ]
        )
        base = self.excess(REFERENCE, budget)
        effects = [
            np.mean(
                [
                    compute_vargha_delaney(a, b)
                    for a, b in zip(self.excess(o, budget), base, strict=True)
                ]
            )
            for o in others
        ]
        return dict(zip(others, zip(map(float, effects), map(float, p), strict=True), strict=True))


def percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def over_floor(excess: float) -> str:
    """1 + excess, as many digits as it takes to see that it is not 1."""
    return (
        "1.000" if excess <= 5e-4 else f"{1 + excess:.3f}" if excess < 0.1 else f"{1 + excess:.2g}"
    )


def cells(of: Kind, optimizer: str, told: Callable[[int], str]) -> str:
    """One cell with a figure for each budget, a dash where the optimizer was not run."""
    return "/".join(told(b) if optimizer in of.at(b) else "–" for b in of.budgets)


def compared(of: Kind, optimizer: str) -> str:
    """A against the reference, with a star where Wilcoxon's p after Holm is below 0.05."""
    if optimizer == REFERENCE:
        return "reference"
    found = {b: of.against(b) for b in of.budgets}
    return cells(
        of,
        optimizer,
        lambda b: f"{found[b][optimizer][0]:.2f}" + "*" * (found[b][optimizer][1] < 0.05),
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(
        "| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)
    ).replace("| --- ", "|---")


def ordered(of: Kind) -> list[str]:
    """The optimizers, best mean rank at the middle budget first."""
    middle = of.budgets[len(of.budgets) // 2]
    return sorted(of.optimizers, key=lambda o: of.rank(o, middle))


def records(of: Kind) -> str:
    def row(o: str) -> list[str]:
        return [
            f"`{o}`",
            cells(of, o, lambda b: over_floor(float(np.median(of.excess(o, b))))),
            *(
                cells(of, o, lambda b, n=near: f"{100 * np.mean(of.excess(o, b) <= n):.0f}")
                for near in NEAR
            ),
            cells(of, o, lambda b: f"{100 * of.valley(o, b):.0f}"),
            cells(of, o, lambda b: f"{of.rank(o, b):.1f}"),
            compared(of, o),
        ]

    head = (
        "optimizer",
        "objective / floor, median",
        "% within 1 %",
        "% within 10 %",
        "% in its valley",
        "mean rank",
    )
    return table((*head, f"A against `{REFERENCE}`"), [row(o) for o in ordered(of)])


def functions(of: Kind) -> str:
    def row(o: str) -> list[str]:
        return [
            f"`{o}`",
            cells(of, o, lambda b: f"{np.median(of.excess(o, b)):.1g}"),
            cells(of, o, lambda b: f"{100 * np.mean(of.excess(o, b)[..., None] <= TARGETS):.0f}"),
            cells(of, o, lambda b: f"{100 * np.mean(of.excess(o, b) <= AT_END['bbob']):.0f}"),
            cells(of, o, lambda b: f"{of.rank(o, b):.1f}"),
            compared(of, o),
        ]

    head = (
        "optimizer",
        "distance, median",
        "% of targets met",
        "% of runs within 1e-8",
        "mean rank",
    )
    return table((*head, f"A against `{REFERENCE}`"), [row(o) for o in ordered(of)])


def caption(series: Stored, of: Kind) -> str:
    """What was run, and how far apart mean ranks must be."""
    plan = series["plan"]
    budgets = " / ".join(f"{b:,}" for b in of.budgets)
    apart = " / ".join(f"{of.ranks(b).critical_difference:.1f}" for b in of.budgets)
    many = (
        f"{plan['seeds']} seeds" if of.kind == "record" else f"{len(plan['instances'])} instances"
    )
    what = (
        f"{len(of.problems)} {'records' if of.kind == 'record' else 'functions (24, d = 5 and 7)'},"
        f" {many} each"
    )
    return (
        f"{what}; {budgets} simulations. Critical difference of the mean ranks (Nemenyi, 5 %):"
        f" {apart}."
    )


def answer(series: Stored) -> str:
    """The first three lines."""
    of, on = Kind(series, "record"), Kind(series, "bbob")
    budgets = " / ".join(f"{b:,}" for b in of.budgets)

    def at_floor(o: str) -> str:
        return cells(of, o, lambda b: f"{100 * np.mean(of.excess(o, b) <= NEAR[0]):.0f}") + " %"

    def share(o: str, budget: int) -> float:
        return float(np.mean(on.excess(o, budget)[..., None] <= TARGETS))

    def met(o: str) -> str:
        return cells(on, o, lambda b: f"{100 * share(o, b):.0f}") + " %"

    first = min(of.optimizers, key=lambda o: of.rank(o, of.budgets[1]))
    free = max(on.at(on.budgets[-1]), key=lambda o: share(o, on.budgets[-1]))
    told = [f"`{o}` {at_floor(o)}" for o in ("issa", "ssa", "pso")]
    return "\n".join(
        (
            f"- **To fit a record take `{first}`**: after {budgets} simulations {at_floor(first)}"
            " of its"
            " searches are within 1 % of the lowest objective known.",
            f"- **Without a sum of squares take `{free}`**: {at_floor(free)}, and {met(free)} of"
            " BBOB's targets;"
            f" `cobyqa` where simulations are dear: {at_floor('cobyqa')}.",
            "- **Of the sparrow searches take `covariant_sparrow`**:"
            f" {at_floor('covariant_sparrow')}, and"
            f" {met('covariant_sparrow')} of the targets; {', '.join(told)}.",
        )
    )


def readings(series: Stored) -> str:
    """Median and worst objective over the floor on the three shipped records, `ssa`
    beside `issa`.
    """
    of = Kind(series, "record")
    (budget,) = of.budgets

    def cell(name: str) -> str:
        if name not in of.optimizers:
            return ""
        found = of.excess(name, budget)
        at = percent(float(np.mean(found <= NEAR[0])))
        return f"{over_floor(float(np.median(found)))} ({over_floor(float(found.max()))}), {at}"

    names = list(
        dict.fromkeys(o.removeprefix("i").removeprefix("ssa").lstrip("_") for o in of.optimizers)
    )
    rows = [
        [f"`*_{n}`" if n else "default", *(cell(f"{o}_{n}" if n else o) for o in ("ssa", "issa"))]
        for n in names
    ]
    return table(("reading", "`ssa`", "`issa`"), rows)


def blocks(stored: Stored) -> dict[str, str]:
    """What stands between the marks of the page."""
    final = stored["final"]
    of, on = Kind(final, "record"), Kind(final, "bbob")
    return {
        "answer": answer(final),
        "records": f"{caption(final, of)}\n\n{records(of)}",
        "bbob": f"{caption(final, on)}\n\n{functions(on)}",
        "readings": readings(stored["readings"]),
    }


def filled(page: str, stored: Stored) -> str:
    """The page with the text between the marks of every block made anew."""
    for name, text in blocks(stored).items():
        before, _, after = marked.parted(page, f"{MAKER}, {name}")
        page = f"{before}\n{text}\n\n{after}"
    return page
