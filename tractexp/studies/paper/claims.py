"""The paper's claims, each with a verdict that the measurements of a `Study` decide."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.identification.result import ACCEPTED
from tractexp.studies.comparison.statistics import (
    LEAST_SEEDS,
    SIGNIFICANCE_LEVEL,
    holm,
    vargha_delaney,
    wilcoxon,
)
from tractexp.studies.paper import equations, maps, printed, why
from tractexp.studies.paper.printed import LABELS
from tractexp.studies.paper.study import BUDGETS, TARGETS, Study
from tractexp.text.wording import join_words

CONFIRMED, REFUTED = "confirmed", "not confirmed"
IMPOSSIBLE = "cannot be reproduced"
OPEN = f"not settled: a test needs {LEAST_SEEDS} seeds or more"
DEPENDS = "depends on the reading"
PAIRS = (("issa", "ssa"), ("issa", "pso"), ("ssa", "pso"))
# with an SSA read alike
BOTH = ("issa", "issa_10_perceivers", "issa_raw", "issa_raw_scalar", "issa_to_the_letter")
LARGER = 2  # times the operations of the others make a large one of Table 1
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


def count_verdicts(claims: Sequence[Claim]) -> str:
    """How many there are and how many got which verdict: "38 claims: 7 confirmed, 31 not
    confirmed".
    """
    counts = Counter(claim.word for claim in claims)
    phrases = {
        CONFIRMED: CONFIRMED,
        DEPENDS: "depending on the reading",
        REFUTED: REFUTED,
        IMPOSSIBLE: IMPOSSIBLE,
    }
    phrases |= {word: word for word in counts if word not in phrases}
    return f"{len(claims)} claims: " + ", ".join(
        f"{counts[word]} {said}" for word, said in phrases.items() if counts[word]
    )


def number(value: float) -> str:
    """Three digits, all of a large number's, or a word where there is none."""
    if not np.isfinite(value):
        return "never"
    if abs(value) >= 1000:
        return f"{value:,.0f}"
    return f"{value:.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.2e}"


def middle(values: Sequence[float] | np.ndarray) -> str:
    """The median and, in brackets, lowest and highest."""
    low, middle, high = np.quantile(values, (0, 0.5, 1))
    return f"{number(middle)} ({number(low)} .. {number(high)})"


def percent(value: float) -> str:
    """A fraction in percent with two digits."""
    return f"{100 * value:.2f} %"


def compare_ends(study: Study, first: str, second: str, by: str) -> tuple[str, str]:
    """Whether `first` ends lower than `second`, by every reading of both: the verdict and the
    numbers behind it.
    """
    verdicts = {}
    phrases = []
    for how, names in readings_of(first, second).items():
        verdicts[how], numbers = better(study, names, (first, second), by)
        phrases.append(f"{how} {numbers}")
    return merge_verdicts(verdicts), "; ".join(phrases)


def readings_of(first: str, second: str) -> dict[str, dict[str, str]]:
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


def better(
    study: Study, names: Mapping[str, str], pair: tuple[str, str], by: str
) -> tuple[str, str]:
    """Whether the first of a pair ends lower, the three optimizers read as `names` says."""
    three = [study.pair(names[a], names[b], by) for a, b in PAIRS]
    corrected = dict(zip(PAIRS, holm([each.p for each in three]), strict=True))
    p = corrected[pair]
    A = three[PAIRS.index(pair)].A
    medians = [float(np.median(study.objectives(names[name], by))) for name in pair]
    numbers = f"medians {number(medians[0])} and {number(medians[1])} pu², p = {p:.2g}, A = {A:.2f}"
    return _sure(study, p < SIGNIFICANCE_LEVEL and A > 0.5), numbers


def _is_ranked(best: float, second: float, worst: float) -> bool:
    """Whether three errors differ in this order."""
    return best * DIFFERENT < second and second * DIFFERENT < worst


def table1(study: Study) -> list[Claim]:
    """Accuracy, identifiability and size of the three motor orders."""
    third, first, second = (study.orders[m] for m in ("electromechanical", "mechanical", "voltage"))
    P, Q = ([o.spread("train")[c] for o in (third, first, second)] for c in (0, 1))
    said = "electromechanical {}, mechanical {}, voltage {}"
    ranked_P = _is_ranked(P[0], P[1], P[2])
    ranked_Q = _is_ranked(Q[0], Q[2], Q[1])
    identified = [f"{o.identified_count} of {o.free}" for o in (third, first, second)]
    alone = (
        third.identified_count == third.free
        and first.identified_count < first.free
        and second.identified_count < second.free
    )
    steps, sizes = (
        [getattr(o, each).total for o in (third, first, second)] for each in ("step", "per_sample")
    )
    times = [f"{o.nanoseconds:.2g}" for o in (third, first, second)]
    return [
        Claim(
            "table1",
            "P: the electromechanical model is better, the mechanical good, the voltage model bad",
            "epsilon_p " + said.format(*map(percent, P)),
            CONFIRMED if ranked_P else REFUTED,
        ),
        Claim(
            "table1",
            "Q: the electromechanical model is better, the voltage model good, the mechanical bad",
            "epsilon_q " + said.format(*map(percent, Q)),
            CONFIRMED if ranked_Q else REFUTED,
        ),
        Claim(
            "table1",
            "stability accuracy: better, better, good",
            "the paper neither defines this column nor says how it was found",
            IMPOSSIBLE,
        ),
        Claim(
            "table1",
            "only the electromechanical model is identifiable",
            "parameters identified: " + said.format(*identified),
            CONFIRMED if alone else REFUTED,
        ),
        Claim(
            "table1",
            "the electromechanical model is large to compute, the others small",
            "operations of the compiled equations in a Runge-Kutta step: "
            + said.format(*(f"{n:.0f}" for n in steps))
            + "; in a sample with all its steps: "
            + said.format(*(f"{n:.0f}" for n in sizes))
            + "; measured beside it, ns: "
            + said.format(*times),
            CONFIRMED if sizes[0] > LARGER * max(sizes[1:]) else REFUTED,
        ),
    ]


def table2(study: Study) -> list[Claim]:
    """The values ISSA identifies and their errors."""
    phrases = []
    worst = {}
    for name in ("issa", printed.TEN["issa"], printed.LITERAL["issa"]):
        fits = [several[0] for several in study.fits(name)]
        P, Q = (np.array([getattr(f, e) for f in fits]) for e in ("epsilon_p", "epsilon_q"))
        worst[how_read(name)] = max(P.max(), Q.max())
        phrases.append(
            f"{how_read(name)} medians {percent(np.median(P))} and {percent(np.median(Q))}, worst"
            f" {percent(worst[how_read(name)])}"
        )
    sine = equations.steady_state_sine(printed.TABLE_3["issa"])
    accepted = {how: CONFIRMED if error < ACCEPTED else REFUTED for how, error in worst.items()}
    return [
        Claim(
            "table2",
            "the identified values",
            f"with them Eq. (3) asks for the arcsine of {sine:.2f}, and C = (X - X')/X = -2.62 is"
            " no ratio of reactances; the record is not public",
            IMPOSSIBLE,
        ),
        Claim(
            "table2",
            "all identified parameters are within reasonable ranges",
            "C lies outside (0, 1), where its definition puts it",
            REFUTED,
        ),
        Claim(
            "table2",
            "the errors of P and Q are below 5 %: the model is acceptable",
            f"epsilon_p and epsilon_q: {'; '.join(phrases)}",
            merge_verdicts(accepted),
        ),
    ]


def how_read(name: str) -> str:
    """A reading as a sentence has it."""
    return {"issa": "with SD = 20", printed.TEN["issa"]: "with 10 perceivers"}.get(
        name, printed.READINGS[name].words
    )


def table3(study: Study) -> list[Claim]:
    """Which optimizer ends lower, after as many iterations and after as many simulations."""
    claims = [*_compare_pairs(study), _compare_to_the_letter(study)]
    P, Q = (
        {n: np.median([getattr(s[0], e) for s in study.fits(n)]) for n in printed.COMPARED}
        for e in ("epsilon_p", "epsilon_q")
    )
    said = "; ".join(f"{LABELS[n]} {percent(P[n])}, {percent(Q[n])}" for n in P)
    claims.append(
        Claim(
            "table3",
            "Q is described more accurately than P",
            f"median epsilon_p, epsilon_q: {said}",
            CONFIRMED if all(Q[n] < P[n] for n in P) else REFUTED,
        )
    )
    gap = equations.consistency()
    worst = max(gap.misses, key=lambda n: abs(gap.misses[n]))
    claims.append(
        Claim(
            "table3",
            "the three columns are fits to one record",
            "errors and objective of a column give mean P² and Q²; ISSA's and SSA's give a mean Q²"
            f" of {gap.pairs['issa and ssa'][1]:.2f}, and the best common pair misses"
            f" {LABELS[worst]}'s objective by {100 * abs(gap.misses[worst]):.0f} %",
            IMPOSSIBLE,
        )
    )
    return claims


def _compare_pairs(study: Study) -> list[Claim]:
    """Which optimizer of each pair ends lower, by each budget."""
    claims = []
    for first, second in PAIRS:
        for by in BUDGETS:
            verdict, measured = compare_ends(study, first, second, by)
            at = "300 iterations" if by == "iterations" else f"{study.equal:,} simulations each"
            text = f"{LABELS[first]} is more accurate than {LABELS[second]}, after {at}"
            claims.append(Claim("table3", text, measured, verdict))
    return claims


def _compare_to_the_letter(study: Study) -> Claim:
    """Whether the paper's optimizer ends lower when it is read to the letter."""
    letter = [(pair, *better(study, printed.LITERAL, pair, "iterations")) for pair in PAIRS[:2]]
    measured = "; ".join(f"{LABELS[a]} and {LABELS[b]}: {said}" for (a, b), _, said in letter)
    won = all(verdict == CONFIRMED for _, verdict, _ in letter)
    text = "to the letter, ISSA is more accurate than SSA and PSO, after 300 iterations"
    return Claim("table3", text, measured, _sure(study, won))


def figure9(study: Study) -> list[Claim]:
    """Speed, and local optima."""
    claims = []
    targets = " and ".join(f"{t:g}" for t in TARGETS)
    for first, second in PAIRS:
        for by in BUDGETS:
            verdicts = {}
            phrases = []
            for how, names in readings_of(first, second).items():
                verdicts[how], numbers = faster(study, names[first], names[second], by)
                phrases.append(f"{how} {LABELS[first]} {numbers[0]}, {LABELS[second]} {numbers[1]}")
            text = f"{LABELS[first]} converges faster than {LABELS[second]}, by {by}"
            measured = f"expected {by} to {targets} times the floor: {'; '.join(phrases)}"
            claims.append(Claim("figure9", text, measured, merge_verdicts(verdicts)))
    claims.append(_jumps(study))
    return claims


def faster(study: Study, first: str, second: str, by: str) -> tuple[str, list[str]]:
    """Whether `first` reaches every target with less, over paired seeds, and the expected running
    times of both.
    """
    p = []
    A = []
    for target in TARGETS:
        a, b = (
            np.where(*_mark_reached_cost(study.spent(name, target, by))) for name in (first, second)
        )
        p.append(wilcoxon(a, b)[0])
        A.append(vargha_delaney(a, b))
    times = [
        ", ".join(number(study.running_time(name, t, by)) for t in TARGETS)
        for name in (first, second)
    ]
    return _sure(study, max(holm(p)) < SIGNIFICANCE_LEVEL and min(A) > 0.5), times


def _mark_reached_cost(
    spent: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray, float]:
    """The arguments of `numpy.where`: whether the target was reached, the cost there, else
    infinity.
    """
    return spent[1], spent[0], np.inf


def _jumps(study: Study) -> Claim:
    """Whether ISSA ends in the valley of the lowest objective more often than the two others do."""
    verdicts = {}
    phrases = []
    for how, names in readings_of("issa", "ssa").items():
        shares = {name: study.shares(names[name]) for name in printed.COMPARED}
        tests = [why.fisher(shares["issa"], shares[name], "valley") for name in ("ssa", "pso")]
        more = all(shares["issa"].valley > shares[name].valley for name in ("ssa", "pso"))
        verdicts[how] = _sure(study, more and max(holm(tests)) < SIGNIFICANCE_LEVEL)
        phrases.append(
            f"{how} "
            + ", ".join(
                f"{LABELS[n]} {s.valley} of {s.n} (at its floor {s.floor})"
                for n, s in shares.items()
            )
        )
    control = study.control_shares
    phrases.append(f"of random points {control.valley} of {control.n} descend there")
    return Claim(
        "figure9",
        "SSA and PSO are caught in local optima, ISSA jumps out of them",
        f"searches that end in the valley of the lowest objective: {'; '.join(phrases)}",
        merge_verdicts(verdicts),
    )


def _sure(study: Study, holds: bool) -> str:
    """The verdict: open with too few seeds."""
    return OPEN if study.seeds < LEAST_SEEDS else CONFIRMED if holds else REFUTED


def claim_generalization(
    part: str, kind: str, table: dict[str, tuple[float, float]]
) -> Callable[[Study], list[Claim]]:

    def claims(study: Study) -> list[Claim]:
        residuals = study.residuals(kind)
        own = [min(table, key=lambda n, c=c: table[n][c]) for c in (0, 1)]
        verdicts, phrases, good, worst = {}, [], {}, []
        for how, names in readings_of("issa", "ssa").items():
            errors = [
                getattr(fits[e], name)
                for fits in study.fits(names["issa"])
                for e in study.select_held_out(kind)
                for name in ("epsilon_p", "epsilon_q")
            ]
            good[how] = CONFIRMED if max(errors) < ACCEPTED else REFUTED
            worst.append(f"{how} {percent(max(errors))}")
            verdicts[how] = _has_lowest_residuals(study, {n: residuals[names[n]] for n in names})
            middle = {n: np.median(residuals[names[n]], axis=0) for n in names}
            pairs = (f"{LABELS[n]} {number(r[0])}, {number(r[1])}" for n, r in middle.items())
            phrases.append(f"{how} {', '.join(pairs)}")
        return [
            Claim(
                part,
                f"ISSA's model has good {kind} ability",
                "epsilon_p and epsilon_q of the held-out dip, worst of all seeds:"
                f" {'; '.join(worst)}",
                merge_verdicts(good),
            ),
            Claim(
                part,
                f"ISSA's model has the best {kind} overall",
                f"median residuals of P, Q [pu]: {'; '.join(phrases)}. The paper's own table has"
                f" {LABELS[own[0]]} lowest in P",
                merge_verdicts(verdicts),
            ),
        ]

    return claims


def _has_lowest_residuals(study: Study, residuals: Mapping[str, np.ndarray]) -> str:
    """Whether ISSA's residuals (seeds, 2), of P and of Q, are lower than those of both others."""
    rivals = [
        (residuals["issa"][:, c], residuals[name][:, c]) for name in ("ssa", "pso") for c in (0, 1)
    ]
    return _sure(study, all(lower(rivals)))


def figure3(study: Study) -> list[Claim]:
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
            f"{measured}tent {number(middle[own])}, logistic {number(middle['logistic'])}",
            CONFIRMED if middle[own] < middle["logistic"] else REFUTED,
        ),
        Claim(
            "figure3",
            "with alpha = 0.3 it is relatively uniform",
            f"lowest of the alphas tried: {best.partition(', ')[2]} with {number(tent[best])}; 0.3"
            f" has {number(tent[own])}",
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


def figure4(study: Study) -> list[Claim]:
    """The claims on the Lévy flight."""
    slopes = {formula: maps.tail_exponent(steps) for formula, steps in study.tails.items()}
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


def lower(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> list[bool]:
    """Whether the first values (seeds,) of each pair are lower than the second, corrected for all
    pairs.
    """
    corrected = holm([wilcoxon(a, b)[0] for a, b in pairs])
    return [
        p < SIGNIFICANCE_LEVEL and vargha_delaney(a, b) > 0.5
        for p, (a, b) in zip(corrected, pairs, strict=True)
    ]


def readings(study: Study) -> list[Claim]:
    """Whether the ranking survives the readings, and whether the ingredients help."""
    both = [
        (study.objectives(name), study.objectives(name.replace("issa", "ssa", 1))) for name in BOTH
    ]
    issa = lower(both)
    ssa = lower([(b, a) for a, b in both])
    whole = study.objectives("issa")
    without = {
        label: study.objectives(f"issa_no_{name}")
        for name, (_, label) in printed.INGREDIENTS.items()
    }
    helps = lower([(whole, ends) for ends in without.values()])
    factors = ", ".join(
        f"{what} × {np.median(ends) / np.median(whole):.2f} (A = {vargha_delaney(whole, ends):.2f}"
        + (")" if helped else ", not significant)")
        for (what, ends), helped in zip(without.items(), helps, strict=True)
    )
    zero = {n: far / max(near, 1e-300) for n, (near, far) in study.bias.items()}
    return [
        Claim(
            "readings",
            "ISSA is better than SSA, whatever the reading of Eqs. (11) to (13)",
            f"of {len(both)} readings, at 300 iterations, ISSA ends significantly lower in"
            f" {sum(issa)}, SSA in {sum(ssa)}",
            _sure(study, all(issa)),
        ),
        Claim(
            "readings",
            "each of the four ingredients improves the search",
            "with SD = 20, median objective without it over that of ISSA, both after 300"
            f" iterations: {factors}",
            _sure(study, all(helps)),
        ),
        Claim(
            "readings",
            "SSA searches the space without preference",
            "error on the sphere with the optimum one unit off zero over that at zero: SSA"
            f" {zero['ssa']:.0e}, ISSA {zero['issa']:.0e}, PSO {zero['pso']:.1g}",
            CONFIRMED if zero["ssa"] < 100 else REFUTED,
        ),
    ]


def agreement(study: Study) -> list[Claim]:
    """The claims on printed values against the printed equations."""
    checks = equations.checks()
    failed = [check for check in checks if not check.holds]
    wrong = equations.order(equations.as_printed)
    right = equations.order(equations.classical)
    return [
        Claim(
            "equations",
            "what is printed agrees with the printed equations",
            f"{len(failed)} of {len(checks)} checks fail",
            REFUTED if failed else CONFIRMED,
        ),
        Claim(
            "equations",
            "Eq. (4) is the fourth-order Runge-Kutta method",
            f"measured order {wrong:.2f} as printed, {right:.2f} of the classical method",
            CONFIRMED if wrong > 3.5 else REFUTED,
        ),
    ]


BY_PART: dict[str, Callable[[Study], Sequence[Claim]]] = {
    "table1": table1,
    "table2": table2,
    "table3": table3,
    "table4": claim_generalization("table4", "interpolation", printed.INTERPOLATION),
    "table5": claim_generalization("table5", "extrapolation", printed.EXTRAPOLATION),
    "figure3": figure3,
    "figure4": figure4,
    "figure9": figure9,
    "equations": agreement,
    "readings": readings,
}


def claims(study: Study, parts: Sequence[str]) -> list[Claim]:
    """The claims of some parts."""
    return [claim for part in parts if part in BY_PART for claim in BY_PART[part](study)]
