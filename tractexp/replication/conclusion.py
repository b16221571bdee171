"""What the measurements come to, in sentences: of the whole page, of the ranking, and of the valley at a bound."""

from collections.abc import Mapping, Sequence

import numpy as np

from tractexp.replication import equations, why
from tractexp.replication.claims import CONFIRMED, PAIRS, Claim, number
from tractexp.replication.printed import COMPARED, LABELS
from tractexp.replication.study import AT_FLOOR, NARROW, TRADED, WIDE, Study
from tractexp.wording import joined


def sentences(study: Study, judged: Sequence[Claim]) -> list[str]:
    """The conclusion of the page, of as many of its parts as there are."""
    parts: Mapping[str, list[Claim]] = {c.part: [d for d in judged if d.part == c.part] for c in judged}
    made = []
    if parts.keys() & {"table2", "table4", "table5"}:
        made.append(_model(parts))
    if "equations" in parts or "table3" in parts:
        made.append(_values())
    if "table3" in parts:
        made.append(_ranking(study))
    if "figure9" in parts:
        made.append(f"{_lack(study)[0]} {_random(study)}")
    if "readings" in parts:
        made.append(_readings(parts["readings"]))
    return made


def _model(parts: Mapping[str, list[Claim]]) -> str:
    """Whether the errors are acceptable, on the fitted dip and on others."""
    where = {"table2": ("fitted dip", 2), "table4": ("milder dip", 0), "table5": ("deeper dip", 0)}
    good = [told for part, (told, k) in where.items() if part in parts and parts[part][k].verdict == CONFIRMED]
    bad = [told for part, (told, _) in where.items() if part in parts and told not in good]
    said = [f"describes the {joined(good)} with errors below 5 %, as the paper says"] * bool(good)
    said += [f"does not describe the {joined(bad)} so well with every reading and seed"] * bool(bad)
    return f"The load model that ISSA identifies {', but '.join(said)}."


def _values() -> str:
    checks = equations.checks()
    failed = sum(not check.holds for check in checks)
    return (
        "The parameters printed are not those of the equations printed: Eq. (3) has no steady state for any column of"
        f" Table 3, and of {len(checks)} checks of the print against itself {failed} fail."
    )


def _ranking(study: Study) -> str:
    """How the three rank by both budgets."""
    made = []
    for by, told in (
        ("iterations", "After 300 iterations"),
        ("simulations", f"after {study.equal:,} simulations each"),
    ):
        order = sorted(COMPARED, key=lambda name: np.median(study.objectives(name, by)))
        medians = ", ".join(f"{LABELS[n]} {number(float(np.median(study.objectives(n, by))))}" for n in order)
        apart = [f"{LABELS[a]} and {LABELS[b]}" for a, b in PAIRS if not _differ(study, a, b, by)]
        rest = f" (no significant difference between {joined(apart)})" if apart else " (all differences significant)"
        made.append(f"{told} the median objectives are {medians} pu²{rest}")
    return "; ".join(made) + "."


def _differ(study: Study, first: str, second: str, by: str) -> bool:
    """Whether either ends lower."""
    pair = PAIRS[[set(p) for p in PAIRS].index({first, second})]
    three = [study.pair(a, b, by) for a, b in PAIRS]
    flipped = [study.pair(b, a, by) for a, b in PAIRS]
    return why.significant(three, PAIRS.index(pair)) or why.significant(flipped, PAIRS.index(pair))


def _lack(study: Study) -> tuple[str, list[why.Lack]]:
    found = why.lacks(study)
    said = why.answer(found)
    return f"That the sparrow searches lack convergence at the end and not exploration {said}.", found


def _random(study: Study) -> str:
    shares, control = {name: study.shares(name) for name in COMPARED}, study.control_shares
    there = ", ".join(f"{LABELS[n]} {s.valley} of {s.n}" for n, s in shares.items())
    done = ", ".join(f"{LABELS[n]} {s.done} of {s.n}" for n, s in shares.items())
    return (
        f"In the valley of the lowest objective end {there}, and {control.valley} of {control.n} random points descend"
        f" there; at the bottom of whichever valley they are in, {done}."
    )


def _readings(judged: Sequence[Claim]) -> str:
    held = [claim.text for claim in judged if claim.verdict == CONFIRMED]
    if held:
        return f"Of what the improvement is said to rest on holds: {joined(held)}."
    return "What the improvement is said to rest on does not hold: " + joined(
        [claim.text[0].lower() + claim.text[1:] if claim.text[1].islower() else claim.text for claim in judged]
    ) + "."  # fmt: skip


def reasons(study: Study) -> list[str]:
    """Why the three rank as they do, tested."""
    told, found = _lack(study)
    made = [f"Is it convergence at the end, and not exploration, that the sparrows lack? {told} {_random(study)}"]
    for lack in found:
        label, ratio = LABELS[lack.name], study.objectives(lack.name) / study.ends[lack.name].objective
        convergence = "less often than PSO" if lack.convergence else "not significantly less often than PSO"
        exploration = "less often than PSO or a random point" if lack.exploration else "not significantly less often"
        made.append(
            f"{label} is at the bottom of its own valley {convergence} (median {np.median(ratio):.2f} times its"
            f" objective), and in the right valley {exploration}. Ended by least squares, it is"
            f" {'not ' if lack.polished >= why.ALPHA else ''}significantly {'lower' if lack.A > 0.5 else 'higher'} than"
            f" PSO ended so (p = {lack.polished:.2g}, A = {lack.A:.2f})."
        )
    best = study.shares("random_search")
    made.append(
        f"The best of {study.equal:,} random points, of pure exploration, lies in the right valley"
        f" in {best.valley} of {best.n} searches."
    )
    return made


def static_reactive(study: Study, values: np.ndarray) -> np.ndarray | None:
    """Q_s0 [pu], what the motor leaves of Q0 to the static load, of free values (n, free); None for other motors."""
    names, event = study.problem.model.names, study.problem.events[0]
    if not {"T_m", "X_prime", "C"} <= set(names):
        return None
    whole = [dict(zip(names, row, strict=True)) for row in study.problem.full(values)]
    return np.array([event.Q0 - equations.motor_reactive(value, event.U0) for value in whole])


def valley(study: Study) -> list[str]:
    """What the second valley is, where it lies and why searches go there."""
    groups = study.control.grouped()
    names, grid, path = list(study.problem.space.names), *study.path
    own = next(p.bounds for p in study.problem.parameters if p.name == TRADED)
    if len(groups) < 2 or "X_prime" not in names:
        return [f"Random points descend to {number(groups[0][0])} pu²; there is one valley."]
    (lowest, _, right), (second, count, left) = groups[:2]
    column, reactance = names.index(TRADED), names.index("X_prime")
    ended = {n: int(np.sum(np.abs(study.ends[n].objective / second - 1) < AT_FLOOR - 1)) for n in COMPARED}
    at_bound = abs(left[column] - own[0]) < 0.01 * (own[1] - own[0])
    where = f"on the lower bound of {TRADED}, {own[0]:g}" if at_bound else f"at {TRADED} = {left[column]:.3g}"
    each = ", ".join(f"{LABELS[n]} {k}" for n, k in ended.items())
    made = [
        f"{sum(ended.values())} of {3 * study.seeds} searches ({each}) end in a valley whose bottom lies {where}, with"
        f" {second / lowest:.2f} times the lowest objective, which is at {TRADED} = {right[column]:.3g};"
        f" {count} of {len(study.control.objective)} random points of the bounds descend there."
    ]
    between = (grid > min(left[column], right[column])) & (grid < max(left[column], right[column]))
    ridge = int(np.flatnonzero(between)[np.argmax(path.objective[between])])
    side = grid < grid[ridge] if left[column] < right[column] else grid > grid[ridge]
    ratio = path.values[side, reactance] / path.values[side, column]
    static = static_reactive(study, np.stack((right, left)))
    told = (
        f" There the static load's part of the reactive power, Q_s0 = Q0 - Q_d0, changes its sign: {static[0]:+.2f} pu"
        f" in the lowest valley, {static[1]:+.2f} pu in the other, which stands for a source such as a capacitor."
        if static is not None and static[0] * static[1] < 0
        else ""
    )
    made.append(
        f"Between the two lies a ridge: at {TRADED} = {grid[ridge]:.2f} the best fit has"
        f" {path.objective[ridge] / lowest:.1f} times the lowest objective.{told}"
    )
    ends = side.nonzero()[0][[0, -1]]
    far = ends[np.argmin(path.objective[ends])]
    inside = int(np.abs(grid - left[column]).argmin())
    made.append(
        f"Along the valley {TRADED} trades against X' and q_v: X'/{TRADED} stays {np.median(ratio):.3f}"
        f" (within {100 * np.ptp(ratio[np.isfinite(ratio)]) / np.median(ratio) / 2:.1f} %), so that the motor draws the"
        " same active power, and as the U²/X' of its reactive power grows, the static load takes it off again, its"
        f" exponent q_v going from {path.values[inside, names.index('q_v')]:.2f} to"
        f" {path.values[far, names.index('q_v')]:.2f}, ever closer to 2. The objective falls all the way, from"
        f" {path.objective[inside] / lowest:.2f} to {path.objective[far] / lowest:.2f} times the lowest at {TRADED} ="
        f" {grid[far]:.2f}, and has no minimum inside: whatever the bound, it attracts."
        if "q_v" in names
        else f"Along the valley X'/{TRADED} stays {np.median(ratio):.3f}."
    )
    wide, narrow = (study.rebounded[bounds] for bounds in (WIDE, NARROW))
    fallen = wide.objective[(wide.objective > AT_FLOOR * lowest) & (wide.objective < 2 * lowest)]
    there = int(np.sum(np.abs(narrow.objective / second - 1) < AT_FLOOR - 1))
    still = f", with {fallen.min() / lowest:.2f} times the lowest objective" if len(fallen) else ""
    made.append(
        f"Wider bounds do not help: with {TRADED} from {WIDE[0]:g}, {len(fallen)} of {len(wide.objective)} random"
        f" points end at the new bound{still}. Narrower ones do: with {TRADED} from {NARROW[0]:g}, as induction motors"
        f" have it, {there} do."
    )
    return made
