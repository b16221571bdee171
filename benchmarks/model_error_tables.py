"""The tables of the study `model_error`, from its stored rows: python benchmarks/model_error.py
--tables --out FILE
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import oracle  # noqa: F401

from hidden_effects.effects import CATALOG

NAMES = ("T_prime", "X_prime", "M", "T_m", "p_v", "C", "q_v", "a_Z", "a_I", "b_Z", "b_I")
WORSE = 1.05  # times the search's end: an estimate beyond counts as worse


def group_of(row: dict[str, Any]) -> str:
    """The line of the tables that a row belongs to."""
    if row["kind"] == "andes":
        resistance = "without" if row["R_s"] < 1e-4 else "with"
        structure = "double cage" if row["motor"] == "Motor5" else f"{resistance} stator resistance"
        return f"andes, {row['model']}, {structure}"
    if row["kind"] == "effect":
        inside = "catalogue" if row["name"] in CATALOG else "outside"
        return f"effect of the {inside} at {row['multiple']:g} limits"
    return {"null": "nothing missing", "record": "records at hand"}[row["kind"]]


def coverage(
    rows: Sequence[dict[str, Any]], name: str
) -> tuple[int, int, list[float], list[float]]:
    """How many intervals of a parameter hold its truth, of how many; |z|, and half widths over the
    truth.
    """
    inside, z, width = [], [], []
    for row in rows:
        true, interval = row["truth"].get(name), row["intervals"].get(name)
        if true is None or interval is None or None in interval:
            continue
        inside.append(interval[0] <= true <= interval[1])
        width.append((interval[1] - interval[0]) / 2 / abs(true))
        if error := row["errors"].get(name):
            z.append(abs(row["parameters"][name] - true) / error)
    return sum(inside), len(inside), z, width


def middle(values: Sequence[float]) -> str:
    return f"{np.median(values):.2g}" if len(values) else "-"


def tables(rows: Sequence[dict[str, Any]]) -> str:
    """What the stored rows say."""
    complete = [row for row in rows if "parameters" in row]
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in complete:
        groups.setdefault(group_of(row), []).append(row)
    lines = [f"{len(rows)} rows, {len(complete)} judged", "", *coverage_lines(groups)]
    lines += ["", *deviation_lines(groups), "", *worse_lines(groups)]
    lines += ["", *record_lines(complete), ""]
    others = [
        (row, row.get(why)) for row in rows for why in ("absent", "skipped", "failed") if why in row
    ]
    lines += [f"{row['key']}: {reason}" for row, reason in others]
    return "\n".join(lines)


def coverage_lines(groups: dict[str, list[dict[str, Any]]]) -> list[str]:
    """Intervals of 95 % that hold the truth, the median of |z|, and of the half width over the
    truth.
    """
    lines = [
        "95 % intervals that hold the truth (median |z|; median half width over the truth)",
        "",
    ]
    lines += ["| sets | " + " | ".join(NAMES) + " |", "|---" * (len(NAMES) + 1) + "|"]
    for group, some in groups.items():
        cells = []
        for name in NAMES:
            inside, count, z, width = coverage(some, name)
            cells.append(f"{inside}/{count} ({middle(z)}; {middle(width)})" if count else "")
        if any(cells):
            lines.append(f"| {group} | " + " | ".join(cells) + " |")
    return lines


def deviation_lines(groups: dict[str, list[dict[str, Any]]]) -> list[str]:
    """How far from the truth the estimate and the search's end are: medians, a share
    of the truth.
    """
    lines = ["median distance from the truth over the truth: estimate; search's end", ""]
    lines += ["| sets | " + " | ".join(NAMES) + " |", "|---" * (len(NAMES) + 1) + "|"]
    for group, some in groups.items():
        cells = []
        for name in NAMES:
            pairs = [
                (
                    abs(row["parameters"][name] / true - 1),
                    abs(row["search"]["parameters"][name] / true - 1),
                )
                for row in some
                if (true := row["truth"].get(name)) and name in row["parameters"]
            ]
            cells.append(
                "; ".join(f"{100 * x:.2g} %" for x in np.median(pairs, axis=0)) if pairs else ""
            )
        if any(cells):
            lines.append(f"| {group} | " + " | ".join(cells) + " |")
    return lines


def worse_lines(groups: dict[str, list[dict[str, Any]]]) -> list[str]:
    """Estimate against the search's end: how often worse, the error in S of both, and the time
    taken.
    """
    lines = [
        "estimate against the search's end: worse by more than 5 % in Eq. (8), held out in S; by"
        " more than chance"
    ]
    lines += [
        "explains, fitted, held out and on all events; median error in S held out; wall and"
        " processor time",
        "",
    ]
    lines += [
        "| sets | n | Eq. (8) | held out | chance, fitted | held out | all | S estimate | S search"
        " | largest"
        " ratio | wall s | cpu s | grades |",
        "|---" * 13 + "|",
    ]
    for group, some in groups.items():
        held = [row["S"]["validate"] for row in some if "validate" in row["S"]]
        ratios = [one["all estimate"] / one["all search"] for one in held]
        roles = "train", "validate", "all"
        chance = [sum(bool(row["chance"].get(role, [False])[-1]) for row in some) for role in roles]
        grades: dict[str, int] = {}
        for row in some:
            grades[row["grade"]] = grades.get(row["grade"], 0) + 1
        errors = [
            100 * np.median([one[f"all {side}"] for one in held]) for side in ("estimate", "search")
        ]
        cells = [
            group,
            str(len(some)),
            str(sum(row["objective"] > WORSE * row["search"]["objective"] for row in some)),
            str(sum(ratio > WORSE for ratio in ratios)),
            *map(str, chance),
            *(f"{error:.2f} %" for error in errors),
            f"{max(ratios):.2f}",
            *(f"{np.median([row[key] for row in some]):.1f}" for key in ("wall", "cpu")),
            ", ".join(f"{grade} {count}" for grade, count in sorted(grades.items())),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def record_lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The records at hand, one by one."""
    lines = [
        "| record | Eq. (8) estimate | search | S fitted estimate | search | S held out estimate |"
        " search | worse"
        " than chance | at a bound |",
        "|---" * 9 + "|",
    ]
    for row in rows:
        if row["kind"] != "record":
            continue
        sizes = [
            f"{100 * row['S'][role][f'all {side}']:.2f} %" if role in row["S"] else ""
            for role in ("train", "validate")
            for side in ("estimate", "search")
        ]
        beyond = ", ".join(role for role, chance in row["chance"].items() if chance[-1])
        cells = [
            f"{row['name']}, {row['model']}",
            f"{row['objective']:.4g}",
            f"{row['search']['objective']:.4g}",
        ]
        lines.append(
            "| " + " | ".join([*cells, *sizes, beyond or "no", ", ".join(row["at_bound"])]) + " |"
        )
    return lines


def shift_lines(rows: Sequence[dict[str, Any]], before: Sequence[dict[str, Any]]) -> list[str]:
    """How far estimates moved from those of another file, in its standard errors, and how wide
    intervals are to its.
    """
    lines = [
        "largest move of a parameter in standard errors of before: median over the sets, and the"
        " most; median"
    ]
    lines += [
        "half width over that of before; by set",
        "",
        "| sets | n | median | most | width |",
        "|---" * 5 + "|",
    ]
    others = {row["key"]: row for row in before if "parameters" in row}
    groups: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if "parameters" not in row or row["key"] not in others:
            continue
        other = others[row["key"]]
        errors = {name: error for name, error in other["errors"].items() if error}
        moves = [
            abs(row["parameters"][n] - other["parameters"][n]) / error
            for n, error in errors.items()
        ]
        spans = (
            [row["intervals"].get(n) for n in errors],
            [other["intervals"].get(n) for n in errors],
        )
        ratios = [
            np.ptp(a) / np.ptp(b)
            for a, b in zip(*spans, strict=True)
            if a and b and None not in (*a, *b)
        ]
        groups.setdefault(group_of(row), []).append(
            (max(moves, default=np.nan), float(np.median(ratios or [np.nan])))
        )
    for group, some in groups.items():
        moves, ratios = np.array(some).T
        numbers = f"{np.nanmedian(moves):.2g} | {np.nanmax(moves):.2g} | {np.nanmedian(ratios):.2f}"
        lines.append(f"| {group} | {len(some)} | {numbers} |")
    return lines


# parameters of the table in docs/coverage.md
TOLD = ("T_prime", "X_prime", "M", "T_m", "p_v", "C")


def documented(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The lines of the table in docs/coverage.md: how many intervals hold the truth, of how
    many, and the grades.
    """
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        if "intervals" in row and row["kind"] != "record":
            groups.setdefault(_documented_group(row), []).append(row)
    lines = []
    for label, some in groups.items():
        held = [coverage(some, name)[:2] for name in TOLD]
        cells = [f"{inside}/{count}" if count else "" for inside, count in held]
        lines.append(
            f"| {label} | {' | '.join(cells)} |"
            f" {sum(r['grade'] == 'adequate' for r in some)}/{len(some)} |"
        )
    return lines


def _documented_group(row: dict[str, Any]) -> str:
    """The line of that table which a row belongs to."""
    if row["kind"] == "andes":
        static = row["model"].removeprefix("third_order_")
        return (
            f"ANDES, {'two cages' if row['motor'] == 'Motor5' else 'one cage'}, fitted with"
            f" `{static}`"
        )
    return (
        "nothing missing"
        if row["kind"] == "null"
        else f"an effect at {row['multiple']:g} times its limit"
    )
