"""Claims of the paper's figures."""

import numpy as np

from tractexp.studies.comparison.statistics import (
    SIGNIFICANCE_LEVEL,
    compute_vargha_delaney,
    correct_by_holm,
    run_wilcoxon_test,
)
from tractexp.studies.paper import maps, printed, why
from tractexp.studies.paper.printed import LABELS
from tractexp.studies.paper.study import BUDGETS, TARGETS, Study
from tractexp.studies.paper.verdict import (
    CONFIRMED,
    DIFFERENT,
    PAIRS,
    REFUTED,
    Claim,
    decide,
    format_number,
    list_readings,
    merge_verdicts,
)


def claim_figure9(study: Study) -> list[Claim]:
    """Speed, and local optima."""
    claims = []
    targets = " and ".join(f"{t:g}" for t in TARGETS)
    for first, second in PAIRS:
        for by in BUDGETS:
            verdicts = {}
            phrases = []
            for how, names in list_readings(first, second).items():
                verdicts[how], numbers = compare_speed(study, names[first], names[second], by)
                phrases.append(f"{how} {LABELS[first]} {numbers[0]}, {LABELS[second]} {numbers[1]}")
            text = f"{LABELS[first]} converges faster than {LABELS[second]}, by {by}"
            measured = f"expected {by} to {targets} times the floor: {'; '.join(phrases)}"
            claims.append(Claim("figure9", text, measured, merge_verdicts(verdicts)))
    claims.append(_claim_best_valley(study))
    return claims


def compare_speed(study: Study, first: str, second: str, by: str) -> tuple[str, list[str]]:
    """Whether `first` reaches every target with less, over paired seeds, and the expected running
    times of both.
    """
    p = []
    A = []
    for target in TARGETS:
        a, b = (
            np.where(*_mark_reached_cost(study.spent(name, target, by))) for name in (first, second)
        )
        p.append(run_wilcoxon_test(a, b)[0])
        A.append(compute_vargha_delaney(a, b))
    times = [
        ", ".join(format_number(study.running_time(name, t, by)) for t in TARGETS)
        for name in (first, second)
    ]
    return decide(study, max(correct_by_holm(p)) < SIGNIFICANCE_LEVEL and min(A) > 0.5), times


def _mark_reached_cost(
    spent: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, float]:
    """The arguments of `numpy.where`: whether the target was reached, the cost there, else
    infinity.
    """
    return spent[1], spent[0], np.inf


def _claim_best_valley(study: Study) -> Claim:
    """The claim of figure 9: ISSA ends in the valley of the lowest objective more often than SSA
    and PSO do. It holds by Fisher's exact tests with Holm's correction, for each reading of the
    paper.
    """
    verdicts = {}
    phrases = []
    for reading, names in list_readings("issa", "ssa").items():
        counts = {name: study.shares(names[name]) for name in printed.COMPARED}
        others = [counts["ssa"], counts["pso"]]
        p_values = [why.run_fisher_test(counts["issa"], other, "valley") for other in others]
        is_more = all(counts["issa"].valley > other.valley for other in others)
        is_significant = max(correct_by_holm(p_values)) < SIGNIFICANCE_LEVEL
        verdicts[reading] = decide(study, is_more and is_significant)
        told = [
            f"{LABELS[name]} {count.valley} of {count.n} (at its floor {count.floor})"
            for name, count in counts.items()
        ]
        phrases.append(f"{reading} {', '.join(told)}")
    control = study.control_shares
    phrases.append(f"of random points {control.valley} of {control.n} descend there")
    return Claim(
        "figure9",
        "SSA and PSO are caught in local optima, ISSA jumps out of them",
        f"searches that end in the valley of the lowest objective: {'; '.join(phrases)}",
        merge_verdicts(verdicts),
    )


def claim_figure3(study: Study) -> list[Claim]:
    """How even the maps are."""
    flock, *_ = study.uniformity.values()
    middle = {name: float(np.median(values)) for name, values in flock.items()}
    tent = {name: value for name, value in middle.items() if name.startswith("tent")}
    own = f"tent, alpha = {printed.TENT_ALPHA:g}"
    best = min(tent, key=lambda name: tent[name])
    measured = f"median centered discrepancy of {next(iter(study.uniformity))}: "
    far = np.median(flock[own]) / np.median(flock["uniform"])
    return [
        Claim(
            "figure3",
            "the tent map is more uniform than the logistic map",
            f"{measured}tent {format_number(middle[own])},"
            f" logistic {format_number(middle['logistic'])}",
            CONFIRMED if middle[own] < middle["logistic"] else REFUTED,
        ),
        Claim(
            "figure3",
            "with alpha = 0.3 it is relatively uniform",
            f"lowest of the alphas tried: {best.partition(', ')[2]} with"
            f" {format_number(tent[best])}; 0.3 has {format_number(tent[own])}",
            CONFIRMED if tent[own] < DIFFERENT * tent[best] else REFUTED,
        ),
        Claim(
            "figure3",
            "initializing by the tent map makes the flock more even",
            f"{far:.2f} times the discrepancy of plain random numbers,"
            f" {middle[own] / middle['Sobol']:.1f} times that of Sobol points",
            CONFIRMED if far < 1 / DIFFERENT else REFUTED,
        ),
    ]


def claim_figure4(study: Study) -> list[Claim]:
    """The claims on the Lévy flight."""
    slopes = {formula: maps.estimate_tail_exponent(steps) for formula, steps in study.tails.items()}
    even = {formula: float(np.mean(steps > 0)) for formula, steps in study.tails.items()}
    return [
        Claim(
            "figure4",
            "Lévy steps have good randomness in size and direction",
            f"Mantegna's: {even['mantegna']:.1%} of the steps positive, tail exponent"
            f" {slopes['mantegna']:.2f}",
            CONFIRMED if abs(even["mantegna"] - 0.5) < 0.01 and slopes["mantegna"] < 2 else REFUTED,
        ),
        Claim(
            "figure4",
            "Eq. (15) gives Lévy steps with beta = 3/2",
            f"as printed the tail exponent is {slopes['printed']:.2f} (2/3 in theory), which a Lévy"
            " flight of exponent 3/2 has not; Mantegna's |nu|^(1/beta) has"
            f" {slopes['mantegna']:.2f}",
            CONFIRMED if abs(slopes["printed"] - 1.5) < 0.2 else REFUTED,
        ),
    ]
