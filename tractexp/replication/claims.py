"""The paper's claims, each with a verdict that the measurements of a `Study` decide."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.comparison.statistics import ALPHA, LEAST_SEEDS, holm, vargha_delaney, wilcoxon
from tractexp.identification.result import ACCEPTED
from tractexp.replication import equations, maps, printed
from tractexp.replication.study import TARGETS, Study

CONFIRMED, REFUTED = "confirmed", "not confirmed"
IMPOSSIBLE = "cannot be reproduced"
OPEN = f"not settled: a test needs {LEAST_SEEDS} seeds or more"
DIFFERENT = 1.1  # accuracies within a tenth of each other count as equal in Table 1


@dataclass(frozen=True)
class Claim:
    """What the paper says and where, what we measured, and the verdict."""

    part: str  # the table or figure it belongs to
    text: str
    measured: str
    verdict: str


def number(value: float) -> str:
    """Three digits, all of a large number's, or a word where there is none."""
    if not np.isfinite(value):
        return "never"
    if abs(value) >= 1000:
        return f"{value:,.0f}"
    return f"{value:.3g}" if abs(value) >= 1e-3 or value == 0 else f"{value:.2e}"


def percent(value: float) -> str:
    return f"{100 * value:.2f} %"


def median(study: Study, name: str, by: str = "iterations") -> float:
    return float(np.median(study.objectives(name, by)))


def better(study: Study, first: str, second: str, by: str) -> tuple[str, str]:
    """Whether `first` ends lower than `second`: the verdict and the numbers behind it."""
    pairs = [study.pair(a, b, by) for a, b in (("issa", "ssa"), ("issa", "pso"), ("ssa", "pso"))]
    corrected = dict(zip([(p.first, p.second) for p in pairs], holm([p.p for p in pairs]), strict=True))
    p, A = corrected[(first, second)], next(q.A for q in pairs if (q.first, q.second) == (first, second))
    told = f"medians {number(median(study, first, by))} and {number(median(study, second, by))} pu²"
    told += f", p = {p:.2g} (Wilcoxon, Holm), A = {A:.2f}"
    if study.seeds < LEAST_SEEDS:
        return OPEN, told
    return CONFIRMED if p < ALPHA and A > 0.5 else REFUTED, told


def table1(study: Study) -> list[Claim]:
    """Accuracy, identifiability and size of the three motor orders."""
    third, first, second = (study.orders[m] for m in ("electromechanical", "mechanical", "voltage"))
    P, Q = ([o.spread("train")[c] for o in (third, first, second)] for c in (0, 1))
    said = "electromechanical {}, mechanical {}, voltage {}"
    ranked_P = P[0] * DIFFERENT < P[1] and P[1] * DIFFERENT < P[2]
    ranked_Q = Q[0] * DIFFERENT < Q[2] and Q[2] * DIFFERENT < Q[1]
    identified = [f"{o.identified} of {o.free}" for o in (third, first, second)]
    alone = third.identified == third.free and first.identified < first.free and second.identified < second.free
    sizes = [o.nanoseconds for o in (third, first, second)]
    return [
        Claim("table1", "P: the electromechanical model is better, the mechanical good, the voltage model bad",
              "epsilon_p " + said.format(*map(percent, P)), CONFIRMED if ranked_P else REFUTED),
        Claim("table1", "Q: the electromechanical model is better, the voltage model good, the mechanical bad",
              "epsilon_q " + said.format(*map(percent, Q)), CONFIRMED if ranked_Q else REFUTED),
        Claim("table1", "stability accuracy: better, better, good",
              "the paper neither defines this column nor says how it was found", IMPOSSIBLE),
        Claim("table1", "only the electromechanical model is identifiable",
              "parameters identified: " + said.format(*identified), CONFIRMED if alone else REFUTED),
        Claim("table1", "the electromechanical model is large to compute, the others small",
              "ns per sample and candidate: " + said.format(*(f"{s:.2g}" for s in sizes)),
              CONFIRMED if sizes[0] > 2 * max(sizes[1:]) else REFUTED),
    ]  # fmt: skip


def table2(study: Study) -> list[Claim]:
    """The values ISSA identifies and their errors."""
    fits = [several[0] for several in study.fits("issa")]
    P, Q = (np.array([getattr(f, e) for f in fits]) for e in ("epsilon_p", "epsilon_q"))
    errors = f"medians {percent(np.median(P))} and {percent(np.median(Q))}, worst {percent(max(P.max(), Q.max()))}"
    sine = equations.steady_state_sine(printed.TABLE_3["issa"])
    return [
        Claim("table2", "the identified values", f"with them Eq. (3) asks for the arcsine of {sine:.2f}, and C ="
              " (X - X')/X = -2.62 is no ratio of reactances; the record is not public", IMPOSSIBLE),
        Claim("table2", "all identified parameters are within reasonable ranges",
              "C lies outside (0, 1), where its definition puts it", REFUTED),
        Claim("table2", "the errors of P and Q are below 5 %: the model is acceptable",
              f"epsilon_p and epsilon_q: {errors}",
              CONFIRMED if max(P.max(), Q.max()) < ACCEPTED else REFUTED),
    ]  # fmt: skip


def table3(study: Study) -> list[Claim]:
    """Which of the three ends lowest."""
    claims = []
    for first, second, said in (
        ("issa", "ssa", "ISSA is more accurate than SSA"),
        ("issa", "pso", "ISSA is more accurate than PSO"),
        ("ssa", "pso", "SSA is more accurate than PSO"),
    ):
        for by in ("iterations", "simulations"):
            verdict, told = better(study, first, second, by)
            at = "300 iterations" if by == "iterations" else f"{study.equal:,} simulations each"
            claims.append(Claim("table3", f"{said}, after {at}", told, verdict))
    P, Q = ({n: np.median([getattr(s[0], e) for s in f]) for n, f in study.fitted.items()}
            for e in ("epsilon_p", "epsilon_q"))  # fmt: skip
    said = "; ".join(f"{n.upper()} {percent(P[n])}, {percent(Q[n])}" for n in P)
    claims.append(
        Claim("table3", "Q is described more accurately than P", f"median epsilon_p, epsilon_q: {said}",
              CONFIRMED if all(Q[n] < P[n] for n in P) else REFUTED)
    )  # fmt: skip
    gap = equations.consistency()
    worst = max(gap.misses, key=lambda n: abs(gap.misses[n]))
    claims.append(
        Claim("table3", "the three columns are fits to one record",
              "errors and objective of a column give mean P² and Q²; ISSA's and SSA's give a mean Q² of"
              f" {gap.pairs['issa and ssa'][1]:.2f}, and the best common pair misses {worst.upper()}'s objective by"
              f" {100 * abs(gap.misses[worst]):.0f} %", IMPOSSIBLE)
    )  # fmt: skip
    return claims


def figure9(study: Study) -> list[Claim]:
    """Speed, and local optima."""
    claims = []
    for first, second in (("issa", "ssa"), ("issa", "pso"), ("ssa", "pso")):
        for cost in ("iterations", "simulations"):
            times = {n: [study.running_time(n, t, cost) for t in TARGETS] for n in (first, second)}
            wins = all(a < b for a, b in zip(times[first], times[second], strict=True))
            told = "; ".join(f"{n.upper()} {', '.join(map(number, t))}" for n, t in times.items())
            text = f"{first.upper()} converges faster than {second.upper()}, by {cost}"
            targets = " and ".join(f"{t:g}" for t in TARGETS)
            measured = f"expected {cost} to {targets} times the floor: {told}"
            claims.append(Claim("figure9", text, measured, CONFIRMED if wins else REFUTED))
    ends = {n: study.found_floor(study.objectives(n, "iterations")) for n in printed.COMPARED}
    after = {n: study.found_floor(d.deviance) for n, d in study.descents.items()}
    told = "; ".join(f"{n.upper()} {after[n]:.0%} (at its floor {ends[n]:.0%})" for n in ends)
    holds = after["issa"] > max(0.5, after["ssa"], after["pso"])
    text = "SSA and PSO are caught in local optima, ISSA jumps out of them"
    measured = f"searches that end in the valley of the lowest objective: {told}"
    claims.append(Claim("figure9", text, measured, _sure(study, holds)))
    return claims


def _sure(study: Study, holds: bool) -> str:
    return OPEN if study.seeds < LEAST_SEEDS else CONFIRMED if holds else REFUTED


def generalized(part: str, kind: str, table: dict[str, tuple[float, float]]) -> Callable[[Study], list[Claim]]:
    """The claims of Table 4 or 5."""

    def claims(study: Study) -> list[Claim]:
        residuals = {n: np.median(r, axis=0) for n, r in study.residuals(kind).items()}
        lowest = [min(residuals, key=lambda n, c=c: residuals[n][c]) for c in (0, 1)]
        own = [min(table, key=lambda n, c=c: table[n][c]) for c in (0, 1)]
        errors = [getattr(fits[e], name) for fits in study.fitted["issa"] for e in study.held(kind)
                  for name in ("epsilon_p", "epsilon_q")]  # fmt: skip
        told = "; ".join(f"{n.upper()} {number(r[0])}, {number(r[1])}" for n, r in residuals.items())
        both = lowest == ["issa", "issa"]
        return [
            Claim(part, f"ISSA's model has good {kind} ability",
                  f"epsilon_p and epsilon_q of the held-out dip: worst of all seeds {percent(max(errors))}",
                  CONFIRMED if max(errors) < ACCEPTED else REFUTED),
            Claim(part, f"ISSA's model has the best {kind} overall",
                  f"median residuals of P, Q [pu]: {told}. The paper's own table has {own[0].upper()} lowest in P",
                  _sure(study, both)),
        ]  # fmt: skip

    return claims


def figure3(study: Study) -> list[Claim]:
    """How even the maps are."""
    flock, *_ = study.uniformity.values()
    middle = {name: float(np.median(values)) for name, values in flock.items()}
    tent = {name: value for name, value in middle.items() if name.startswith("tent")}
    own = f"tent, alpha = {printed.ALPHA:g}"
    best = min(tent, key=lambda name: tent[name])
    told = f"median centered discrepancy of {next(iter(study.uniformity))}: "
    far = np.median(flock[own]) / np.median(flock["uniform"])
    return [
        Claim("figure3", "the tent map is more uniform than the logistic map",
              f"{told}tent {number(middle[own])}, logistic {number(middle['logistic'])}",
              CONFIRMED if middle[own] < middle["logistic"] else REFUTED),
        Claim("figure3", "with alpha = 0.3 it is relatively uniform",
              f"lowest of the alphas tried: {best.partition(', ')[2]} with {number(tent[best])}; 0.3 has"
              f" {number(tent[own])}", CONFIRMED if tent[own] < DIFFERENT * tent[best] else REFUTED),
        Claim("figure3", "initializing by the tent map makes the flock more even",
              f"{far:.2f} times the discrepancy of plain random numbers, {middle[own] / middle['Sobol']:.1f} times"
              " that of Sobol points", CONFIRMED if far < 1 / DIFFERENT else REFUTED),
    ]  # fmt: skip


def figure4(study: Study) -> list[Claim]:
    """What the Lévy flight is."""
    slopes = {formula: maps.tail_exponent(steps) for formula, steps in study.tails.items()}
    even = {formula: float(np.mean(steps > 0)) for formula, steps in study.tails.items()}
    return [
        Claim("figure4", "Lévy steps have good randomness in size and direction",
              f"Mantegna's: {even['mantegna']:.1%} of the steps positive, tail exponent {slopes['mantegna']:.2f}",
              CONFIRMED if abs(even["mantegna"] - 0.5) < 0.01 and slopes["mantegna"] < 2 else REFUTED),
        Claim("figure4", "Eq. (15) gives Lévy steps with beta = 3/2",
              f"as printed the tail exponent is {slopes['printed']:.2f} (2/3 in theory), which a Lévy flight of"
              f" exponent 3/2 has not; Mantegna's |nu|^(1/beta) has {slopes['mantegna']:.2f}",
              CONFIRMED if abs(slopes["printed"] - 1.5) < 0.2 else REFUTED),
    ]  # fmt: skip


def ends_lower(pairs: Sequence[tuple[Sequence[Any], Sequence[Any]]]) -> list[bool]:
    """Whether the first searches of each pair end lower than the second, over paired seeds, corrected for all pairs."""
    ends = [[np.array([f.objective for f in found]) for found in pair] for pair in pairs]
    corrected = holm([wilcoxon(a, b)[0] for a, b in ends])
    return [p < ALPHA and vargha_delaney(a, b) > 0.5 for p, (a, b) in zip(corrected, ends, strict=True)]


def readings(study: Study) -> list[Claim]:
    """Whether the ranking survives the readings, and whether the ingredients help."""
    both = [found for found in study.readings.values() if "ssa" in found]
    issa = ends_lower([(found["issa"], found["ssa"]) for found in both])
    ssa = ends_lower([(found["ssa"], found["issa"]) for found in both])
    helps = ends_lower([(study.compared["issa"], found) for found in study.ablations.values()])
    whole = median(study, "issa")
    told = ", ".join(
        f"{printed.INGREDIENTS[key]} × {np.median([f.objective for f in found]) / whole:.2f}"
        + ("" if helped else " (not significant)")
        for (key, found), helped in zip(study.ablations.items(), helps, strict=True)
    )
    zero = {n: far / max(near, 1e-300) for n, (near, far) in study.bias.items()}
    return [
        Claim("equations", "ISSA is better than SSA, whatever the reading of Eqs. (11) to (13)",
              f"of {len(both)} readings, at 300 iterations, ISSA ends significantly lower in {sum(issa)}, SSA in"
              f" {sum(ssa)}", _sure(study, all(issa))),
        Claim("equations", "each of the four ingredients improves the search",
              f"median objective without it over that of ISSA: {told}",
              _sure(study, all(helps))),
        Claim("equations", "SSA searches the space without preference",
              f"error on the sphere with the optimum one unit off zero over that at zero: SSA {zero['ssa']:.0e},"
              f" ISSA {zero['issa']:.0e}, PSO {zero['pso']:.1g}", CONFIRMED if zero["ssa"] < 100 else REFUTED),
    ]  # fmt: skip


def eq4(study: Study) -> list[Claim]:
    """Eq. (4)."""
    right, wrong = equations.order(equations.classical), equations.order(equations.as_printed)
    return [
        Claim("equations", "Eq. (4) is the fourth-order Runge-Kutta method",
              f"measured order {wrong:.2f} as printed, {right:.2f} of the classical method",
              CONFIRMED if wrong > 3.5 else REFUTED)
    ]  # fmt: skip


BY_PART: dict[str, Callable[[Study], Sequence[Claim]]] = {
    "table1": table1,
    "table2": table2,
    "table3": table3,
    "table4": generalized("table4", "interpolation", printed.INTERPOLATION),
    "table5": generalized("table5", "extrapolation", printed.EXTRAPOLATION),
    "figure3": figure3,
    "figure4": figure4,
    "figure9": figure9,
    "equations": lambda study: [*eq4(study), *readings(study)],
}


def claims(study: Study, parts: Sequence[str]) -> list[Claim]:
    """The claims of these parts, judged."""
    return [claim for part in parts if part in BY_PART for claim in BY_PART[part](study)]
