"""Claims of the paper's tables, and of the ranking that they give."""

from collections.abc import Callable, Mapping

import numpy as np

from tractexp.identification.result import ACCEPTED
from tractexp.studies.comparison.statistics import compute_vargha_delaney
from tractexp.studies.paper import equations, printed
from tractexp.studies.paper.printed import LABELS
from tractexp.studies.paper.study import BUDGETS, Study
from tractexp.studies.paper.verdict import (
    CONFIRMED,
    DIFFERENT,
    IMPOSSIBLE,
    PAIRS,
    REFUTED,
    Claim,
    compare_ends,
    compare_final_values,
    decide,
    format_fraction,
    format_number,
    list_readings,
    lower,
    merge_verdicts,
)

# with an SSA read alike
BOTH = ("issa", "issa_10_perceivers", "issa_raw", "issa_raw_scalar", "issa_to_the_letter")
LARGER = 2  # times the operations of the others make a large one of Table 1


def _is_ranked(best: float, second: float, worst: float) -> bool:
    """Whether three errors differ in this order."""
    return best * DIFFERENT < second and second * DIFFERENT < worst


def claim_table1(study: Study) -> list[Claim]:
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
            "epsilon_p " + said.format(*map(format_fraction, P)),
            CONFIRMED if ranked_P else REFUTED,
        ),
        Claim(
            "table1",
            "Q: the electromechanical model is better, the voltage model good, the mechanical bad",
            "epsilon_q " + said.format(*map(format_fraction, Q)),
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


def claim_table2(study: Study) -> list[Claim]:
    """The values ISSA identifies and their errors."""
    phrases = []
    worst = {}
    for name in ("issa", printed.TEN["issa"], printed.LITERAL["issa"]):
        fits = [several[0] for several in study.fits(name)]
        P, Q = (np.array([getattr(f, e) for f in fits]) for e in ("epsilon_p", "epsilon_q"))
        worst[describe_reading(name)] = max(P.max(), Q.max())
        phrases.append(
            f"{describe_reading(name)} medians {format_fraction(np.median(P))} and "
            f"{format_fraction(np.median(Q))}, worst"
            f" {format_fraction(worst[describe_reading(name)])}"
        )
    sine = equations.compute_steady_state_sine(printed.TABLE_3["issa"])
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


def describe_reading(name: str) -> str:
    """A reading as a sentence has it."""
    return {"issa": "with SD = 20", printed.TEN["issa"]: "with 10 perceivers"}.get(
        name, printed.READINGS[name].words
    )


def claim_table3(study: Study) -> list[Claim]:
    """Which optimizer ends lower, after as many iterations and after as many simulations."""
    claims = [*_compare_pairs(study), _compare_to_the_letter(study)]
    P, Q = (
        {n: np.median([getattr(s[0], e) for s in study.fits(n)]) for n in printed.COMPARED}
        for e in ("epsilon_p", "epsilon_q")
    )
    said = "; ".join(f"{LABELS[n]} {format_fraction(P[n])}, {format_fraction(Q[n])}" for n in P)
    claims.append(
        Claim(
            "table3",
            "Q is described more accurately than P",
            f"median epsilon_p, epsilon_q: {said}",
            CONFIRMED if all(Q[n] < P[n] for n in P) else REFUTED,
        )
    )
    gap = equations.check_consistency()
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
    letter = [
        (pair, *compare_final_values(study, printed.LITERAL, pair, "iterations"))
        for pair in PAIRS[:2]
    ]
    measured = "; ".join(f"{LABELS[a]} and {LABELS[b]}: {said}" for (a, b), _, said in letter)
    won = all(verdict == CONFIRMED for _, verdict, _ in letter)
    text = "to the letter, ISSA is more accurate than SSA and PSO, after 300 iterations"
    return Claim("table3", text, measured, decide(study, won))


def claim_generalization(
    part: str, kind: str, table: dict[str, tuple[float, float]]
) -> Callable[[Study], list[Claim]]:

    def claims(study: Study) -> list[Claim]:
        residuals = study.residuals(kind)
        own = [min(table, key=lambda n, c=c: table[n][c]) for c in (0, 1)]
        verdicts, phrases, good, worst = {}, [], {}, []
        for how, names in list_readings("issa", "ssa").items():
            errors = [
                getattr(fits[e], name)
                for fits in study.fits(names["issa"])
                for e in study.select_held_out(kind)
                for name in ("epsilon_p", "epsilon_q")
            ]
            good[how] = CONFIRMED if max(errors) < ACCEPTED else REFUTED
            worst.append(f"{how} {format_fraction(max(errors))}")
            verdicts[how] = _judge_residuals(study, {n: residuals[names[n]] for n in names})
            middle = {n: np.median(residuals[names[n]], axis=0) for n in names}
            pairs = (
                f"{LABELS[n]} {format_number(r[0])}, {format_number(r[1])}"
                for n, r in middle.items()
            )
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


def _judge_residuals(study: Study, residuals: Mapping[str, np.ndarray]) -> str:
    """The word on whether ISSA's residuals (seeds, 2), of P and Q, are lower than both others'."""
    rivals = [
        (residuals["issa"][:, c], residuals[name][:, c]) for name in ("ssa", "pso") for c in (0, 1)
    ]
    return decide(study, all(lower(rivals)))


def claim_readings(study: Study) -> list[Claim]:
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
        f"{what} × {np.median(ends) / np.median(whole):.2f}"
        f" (A = {compute_vargha_delaney(whole, ends):.2f}"
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
            decide(study, all(issa)),
        ),
        Claim(
            "readings",
            "each of the four ingredients improves the search",
            "with SD = 20, median objective without it over that of ISSA, both after 300"
            f" iterations: {factors}",
            decide(study, all(helps)),
        ),
        Claim(
            "readings",
            "SSA searches the space without preference",
            "error on the sphere with the optimum one unit off zero over that at zero: SSA"
            f" {zero['ssa']:.0e}, ISSA {zero['issa']:.0e}, PSO {zero['pso']:.1g}",
            CONFIRMED if zero["ssa"] < 100 else REFUTED,
        ),
    ]


def claim_agreement(study: Study) -> list[Claim]:
    """The claims on printed values against the printed equations."""
    checks = equations.check_printed_numbers()
    failed = [check for check in checks if not check.holds]
    wrong = equations.order(equations.step_as_printed)
    right = equations.order(equations.step_classically)
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
