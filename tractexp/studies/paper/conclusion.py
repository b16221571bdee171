"""What the measurements come to, in sentences: of the whole page, of the ranking, and of the valley
at a bound.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from tractexp.studies.paper import equations, why
from tractexp.studies.paper.printed import COMPARED, LABELS
from tractexp.studies.paper.study import FLOOR_FACTOR, NARROW, TRADED, WIDE, Study
from tractexp.studies.paper.verdict import (
    CONFIRMED,
    DEPENDS,
    PAIRS,
    Claim,
    compare_ends,
    format_number,
)
from tractexp.text.wording import join_words

# times the lowest objective: a valley that a search might take for the right one
LARGEST_NEAR_RATIO = 2.0


def write_conclusion(study: Study, claims: Sequence[Claim]) -> list[str]:
    """The conclusion of the page, of as many of its parts as there are."""
    parts: Mapping[str, list[Claim]] = {
        c.part: [d for d in claims if d.part == c.part] for c in claims
    }
    paragraphs = []
    if parts.keys() & {"table2", "table4", "table5"}:
        paragraphs.append(_describe_errors(parts))
    if "equations" in parts or "table3" in parts:
        paragraphs.append(_describe_values())
    if "table3" in parts:
        paragraphs.append(_describe_ranking(study))
    if "figure9" in parts:
        paragraphs.append(f"{_lack(study)} {_describe_random(study)}")
    if "readings" in parts:
        paragraphs.append(_describe_readings(parts["readings"]))
    return paragraphs


def _describe_errors(parts: Mapping[str, list[Claim]]) -> str:
    """On which dips the identified model's errors are acceptable: the fitted one, a milder and a
    deeper one.
    """
    where = {"table2": ("the fitted", 2), "table4": ("the milder", 0), "table5": ("the deeper", 0)}
    verdicts = {dip: parts[part][k].verdict for part, (dip, k) in where.items() if part in parts}
    good = [dip for dip, verdict in verdicts.items() if verdict == CONFIRMED]
    said = []
    if good:
        said.append(
            f"describes {join_words(good)} dip with errors below 5 %, with every seed and reading"
            " tried"
        )
    said += [
        f"of {dip} dip this {verdict}" if verdict.startswith(DEPENDS) else f"not {dip} dip"
        for dip, verdict in verdicts.items()
        if verdict != CONFIRMED
    ]
    return f"The load model that ISSA identifies {'; '.join(said)}."


def _describe_values() -> str:
    """That the printed parameters do not satisfy the printed equations."""
    checks = equations.check_printed_numbers()
    failed = sum(not check.holds for check in checks)
    return (
        "The parameters printed are not those of the equations printed: Eq. (3) has no steady state"
        f" for any column of Table 3, and of {len(checks)} checks of the print against itself"
        f" {failed} fail."
    )


def _describe_ranking(study: Study) -> str:
    """How the optimizers rank by iterations and by simulations."""
    parts = []
    for by, budget in (
        ("iterations", "After 300 iterations"),
        ("simulations", f"after {study.equal:,} simulations each"),
    ):
        order = sorted(COMPARED, key=lambda name: np.median(study.objectives(name, by)))
        medians = ", ".join(
            f"{LABELS[n]} {format_number(float(np.median(study.objectives(n, by))))}" for n in order
        )
        apart = [
            f"between {LABELS[a]} and {LABELS[b]}"
            for a, b in PAIRS
            if not _do_differ(study, a, b, by)
        ]
        rest = (
            f" (no significant difference {join_words(apart)})"
            if apart
            else " (all differences significant)"
        )
        parts.append(f"{budget} the median objectives are {medians} pu²{rest}")
    verdict, _ = compare_ends(study, "issa", "ssa", "iterations")
    reading = f" Whether ISSA ends lower than SSA {verdict}." if verdict.startswith(DEPENDS) else ""
    return "; ".join(parts) + "." + reading


def _do_differ(study: Study, first: str, second: str, by: str) -> bool:
    """Whether two optimizers differ by more than chance."""
    pair = PAIRS[[set(p) for p in PAIRS].index({first, second})]
    three = [study.pair(a, b, by) for a, b in PAIRS]
    flipped = [study.pair(b, a, by) for a, b in PAIRS]
    return why.is_significant(three, PAIRS.index(pair)) or why.is_significant(
        flipped, PAIRS.index(pair)
    )


def _lack(study: Study) -> str:
    """The reasons why the sparrow searches rank behind PSO, in a sentence."""
    said = why.answer(why.compare_with_ssa(study))
    return (
        f"That convergence at the end, not exploration, is what the sparrow searches lack {said}."
    )


def _describe_random(study: Study) -> str:
    """How often each search ends in the best valley, beside random points."""
    shares, control = {name: study.shares(name) for name in COMPARED}, study.control_shares
    there = ", ".join(f"{LABELS[n]} {s.valley} of {s.n}" for n, s in shares.items())
    above = ", ".join(f"{LABELS[n]} {np.median(study.above_bottom(n)):.2f}" for n in COMPARED)
    return (
        f"In the valley of the lowest objective end {there} searches, and {control.valley} of"
        f" {control.n} random points descend there; the median objective over that at the bottom of"
        f" the search's own valley is {above}."
    )


def _describe_readings(claims: Sequence[Claim]) -> str:
    """Which of the claims about readings and ingredients hold."""
    held = [claim.text for claim in claims if claim.verdict == CONFIRMED]
    if held:
        return f"Of what the improvement rests on, this holds: {'; '.join(held)}."
    return (
        f"None of what the improvement rests on holds: {'; '.join(claim.text for claim in claims)}."
    )


def explain_ranks(study: Study) -> list[str]:
    """Why the three rank as they do, tested."""
    paragraphs = [
        f"Is it convergence at the end, and not exploration, that the sparrows lack? {_lack(study)}"
        f" {_describe_random(study)}"
    ]
    paragraphs += [_describe_lack(lack) for lack in why.compare_with_ssa(study)]
    rival, limited, control = (
        study.shares(why.RIVAL),
        study.shares("pso_limited"),
        study.control_shares,
    )
    p = why.run_fisher_test(rival, control, "valley")
    word = "more" if rival.valley * control.n > control.valley * rival.n else "less"
    word = word if p < why.SIGNIFICANCE_LEVEL else f"not significantly {word}"
    paragraphs.append(
        f"PSO is in the right valley {word} often than random points (p = {p:.2g}); with its"
        f" velocity limited to 0.2 in {limited.valley} of {limited.n} searches."
    )
    return paragraphs


def _describe_lack(lack: why.Lack) -> str:
    """The reasons of one search, in a sentence."""
    farther = "" if lack.convergence.lacks else "not "
    others = {
        "PSO": lack.valley,
        "random points": lack.random,
        "the best of as many random points": lack.best,
    }
    lost = [name for name, test in others.items() if test.lacks]
    often, than = ("", join_words(lost)) if lost else ("not ", join_words(list(others), "or"))
    ended = "not significantly different from"
    if lack.polished.p < why.SIGNIFICANCE_LEVEL:
        ended = f"significantly {'higher' if lack.polished.less else 'lower'} than"
    return (
        f"{LABELS[lack.name]} ends {farther}significantly farther above the bottom of its own"
        f" valley than PSO, and is {often}significantly less often in the right valley than {than}."
        f" Once least squares have ended both, it is {ended} PSO."
    )


def compute_static_reactive(study: Study, values: np.ndarray) -> np.ndarray | None:
    """Q_s0 [pu], what the motor leaves of Q0 to the static load, of free values (n, free); None for
    other motors.
    """
    names, event = study.problem.model.names, study.problem.events[0]
    if not {"T_m", "X_prime", "C"} <= set(names):
        return None
    whole = [dict(zip(names, row, strict=True)) for row in study.problem.full(values)]
    return np.array(
        [event.Q0 - equations.compute_motor_reactive(value, event.U0) for value in whole]
    )


def describe_valley(study: Study) -> list[str]:
    """What the second valley is, where it lies and why searches go there; as much of it as this
    model shows.
    """
    groups, names = study.control.group_valleys(), study.problem.space.names
    if len(groups) < 2:
        return [
            f"All random points descend to {format_number(groups[0][0])} pu²: there is one valley."
        ]
    (lowest, _, right), (second, count, other) = groups[:2]
    column = names.index(TRADED)
    low, high = next(p.bounds for p in study.problem.parameters if p.name == TRADED)
    at_bound = other[column] - low < 0.01 * (high - low)
    ended = {
        n: int(np.sum(np.abs(study.ends[n].objective / second - 1) < FLOOR_FACTOR - 1))
        for n in COMPARED
    }
    where = (
        f"on the lower bound of {TRADED}, {low:g}"
        if at_bound
        else f"at {TRADED} = {other[column]:.3g}"
    )
    each = ", ".join(f"{LABELS[n]} {k}" for n, k in ended.items())
    paragraphs = [
        f"{sum(ended.values())} of {3 * study.seeds} searches ({each}) end in a valley whose bottom"
        f" lies {where}, with {second / lowest:.2f} times the lowest objective, which is at"
        f" {TRADED} = {right[column]:.3g}; {count} of {len(study.control.objective)} random points"
        " of the bounds descend there."
    ]
    if at_bound and second < LARGEST_NEAR_RATIO * lowest and right[column] > other[column]:
        paragraphs += _explain_attraction(study, lowest, right, other)
    return [*paragraphs, _describe_bounds(study, (low, high), lowest)]


def _explain_attraction(
    study: Study, lowest: float, lowest_valley: np.ndarray, second_valley: np.ndarray
) -> list[str]:
    """Why the lower bound attracts: what lies between the two valleys, bottoms (d,) in physical
    units, and which parameters trade along the second.
    """
    grid, path = study.path
    column = study.problem.space.names.index(TRADED)
    between = np.flatnonzero((grid > second_valley[column]) & (grid < lowest_valley[column]))
    ridge = int(between[np.argmax(path.objective[between])])
    static = compute_static_reactive(study, np.stack((lowest_valley, second_valley)))
    remark = (
        " There the static load's part of the reactive power, Q_s0 = Q0 - Q_d0, changes its sign:"
        f" {static[0]:+.2f} pu in the lowest valley, {static[1]:+.2f} pu in the other, which stands"
        " for a source such as a capacitor."
        if static is not None and static[0] * static[1] < 0
        else ""
    )
    paragraphs = [
        f"Between the two lies a ridge: at {TRADED} = {grid[ridge]:.2f} the best fit has"
        f" {path.objective[ridge] / lowest:.1f} times the lowest objective.{remark}"
    ]
    along = np.flatnonzero((grid < grid[ridge]) & (path.objective < LARGEST_NEAR_RATIO * lowest))
    if len(along) > 1 and (np.diff(path.objective[along]) > 0).all():
        paragraphs.append(
            _describe_trade(
                study, along, int(np.abs(grid - second_valley[column]).argmin()), lowest
            )
        )
    return paragraphs


def _describe_trade(study: Study, along: np.ndarray, here: int, lowest: float) -> str:
    """The sentence on the parameters that trade along the valley, which `along` are points of the
    path; its bottom within the bounds is `here`.
    """
    grid, path = study.path
    names = study.problem.space.names
    sentence = f"Along the valley the objective falls with {TRADED}"
    far, near = along[[0, -1]]
    places = [near, here, far]
    sentence += (
        f", {join_words([f'{path.objective[k] / lowest:.2f}' for k in places])} times the lowest at"
        f" {join_words([f'{grid[k]:.2f}' for k in places])}, and has no minimum inside: whatever"
        " the bound, it attracts."
    )
    if "X_prime" in names:
        ratio = path.values[along, names.index("X_prime")] / path.values[along, names.index(TRADED)]
        sentence += (
            f" {TRADED} trades against X': X'/{TRADED} stays {np.median(ratio):.3f} (within"
            f" {50 * np.ptp(ratio) / np.median(ratio):.1f} %), so that the motor draws the same"
            " active power."
        )
    if {"X_prime", "q_v"} <= set(names):
        q_v = path.values[:, names.index("q_v")]
        sentence += (
            " As the U²/X' of its reactive power grows, the static load takes it off again, with"
            " its exponent approaching that of the motor's term, 2: q_v is"
            f" {join_words([f'{q_v[k]:.2f}' for k in places])} there."
        )
    return sentence


def _describe_bounds(study: Study, own: tuple[float, float], lowest: float) -> str:
    """How often searches reach the floor within the paper's bounds and within others."""
    shares = {
        bounds: np.mean(ends.objective <= FLOOR_FACTOR * lowest)
        for bounds, ends in study.ends_by_bounds.items()
    }
    listed = ", ".join(f"{shares[b]:.0%} from {b[0]:g}" for b in (WIDE, own, NARROW))
    helps = shares[NARROW] > 1.5 * shares[own] and shares[WIDE] < 1.1 * shares[own]
    return (
        f"Of random points, these descend to the lowest objective by the lower bound of {TRADED}:"
        f" {listed}, where induction motors have it"
        + (". Wider bounds do not help, narrower ones do." if helps else ".")
    )
