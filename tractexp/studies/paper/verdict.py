"""The verdicts on claims of the paper, by tests over paired seeds and all readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.studies.comparison.statistics import (
    LEAST_SEEDS,
    SIGNIFICANCE_LEVEL,
    compute_vargha_delaney,
    correct_by_holm,
    run_wilcoxon_test,
)
from tractexp.studies.paper import printed
from tractexp.studies.paper.study import Study
from tractexp.text.wording import join_words

CONFIRMED, REFUTED = "confirmed", "not confirmed"
IMPOSSIBLE = "cannot be reproduced"
OPEN = f"not settled: a test needs {LEAST_SEEDS} seeds or more"
DEPENDS = "depends on the reading"
PAIRS = (("issa", "ssa"), ("issa", "pso"), ("ssa", "pso"))
DIFFERENT = 1.1  # accuracies within a tenth of each other count as equal in Table 1


@dataclass(frozen=True)
class Claim:
    """A statement of the paper and its place, our measurement, and the verdict."""

    part: str  # the table or figure it belongs to
    text: str
    measured: str
    verdict: str

    @property
    def word(self) -> str:
        """The verdict without its reason."""
        return self.verdict.partition(":")[0]


def format_number(value: float) -> str:
    """Three digits, all of a large number's, or a word where there is none."""
    if not np.isfinite(value):
        return "never"
    if abs(value) >= 1000:
        return f"{value:,.0f}"
    return f"{value:.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.2e}"


def format_middle(values: Sequence[float] | np.ndarray) -> str:
    """The median and, in brackets, lowest and highest."""
    low, middle, high = np.quantile(values, (0, 0.5, 1))
    return f"{format_number(middle)} ({format_number(low)} .. {format_number(high)})"


def format_fraction(value: float) -> str:
    """A fraction in percent with two digits."""
    return f"{100 * value:.2f} %"


def compare_ends(study: Study, first: str, second: str, by: str) -> tuple[str, str]:
    """Whether `first` ends lower than `second`, by every reading of both: the verdict and the
    numbers behind it.
    """
    verdicts = {}
    phrases = []
    for how, names in list_readings(first, second).items():
        verdicts[how], numbers = compare_final_values(study, names, (first, second), by)
        phrases.append(f"{how} {numbers}")
    return merge_verdicts(verdicts), "; ".join(phrases)


def list_readings(first: str, second: str) -> dict[str, dict[str, str]]:
    """How the paper can be read where it matters to these two: {how: {optimizer: reading}}."""
    own = {name: name for name in printed.COMPARED}
    readings = {"with SD = 20 (section 4.3)": own}
    if {first, second} & printed.TEN.keys():
        readings["with the 10 perceivers of section 4.2"] = own | printed.TEN
    if "pso" in (first, second):
        readings["with PSO's velocity limited to 0.2"] = own | {"pso": "pso_limited"}
    return readings


def merge_verdicts(verdicts: Mapping[str, str]) -> str:
    """One verdict for all readings, or that it depends on them and which confirm it."""
    different = set(verdicts.values())
    if len(different) == 1 or OPEN in different:
        return OPEN if OPEN in different else different.pop()
    return (
        f"{DEPENDS}: {CONFIRMED} only"
        f" {join_words([how for how, v in verdicts.items() if v == CONFIRMED])}"
    )


def compare_final_values(
    study: Study, names: Mapping[str, str], pair: tuple[str, str], by: str
) -> tuple[str, str]:
    """Whether the first of a pair ends lower, the three optimizers read as `names` says."""
    three = [study.pair(names[a], names[b], by) for a, b in PAIRS]
    corrected = dict(zip(PAIRS, correct_by_holm([each.p for each in three]), strict=True))
    p = corrected[pair]
    A = three[PAIRS.index(pair)].A
    medians = [float(np.median(study.objectives(names[name], by))) for name in pair]
    lower, higher = map(format_number, medians)
    numbers = f"medians {lower} and {higher} pu², p = {p:.2g}, A = {A:.2f}"
    return decide(study, p < SIGNIFICANCE_LEVEL and A > 0.5), numbers


def decide(study: Study, holds: bool) -> str:
    """The verdict: open with too few seeds."""
    return OPEN if study.seeds < LEAST_SEEDS else CONFIRMED if holds else REFUTED


def lower(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[bool]:
    """Whether the first values (seeds,) of each pair are lower than the second, corrected for all
    pairs.
    """
    corrected = correct_by_holm([run_wilcoxon_test(a, b)[0] for a, b in pairs])
    return [
        p < SIGNIFICANCE_LEVEL and compute_vargha_delaney(a, b) > 0.5
        for p, (a, b) in zip(corrected, pairs, strict=True)
    ]
