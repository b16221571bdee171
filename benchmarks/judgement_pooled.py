"""Judgement sets of several versions together: python judgement_pooled.py [--keep FROZEN]

A row of 12 data sets has an interval of 26 points to either side, seven sets together one of 4 to
11. Of each set the rows are kept in short in judgement_pooled.jsonl: what was hidden and what was
said, no seed twice. `--keep` adds those of judgement.jsonl, or of another file of rows (`--rows`),
before a later set takes their place. Without it the table is written into docs/judgement.md.

What is said counts by label, and by class: effects of one class predict alike, so that records
show the class and not which of its members is there. The classes come from a simulation on other
seeds (`imitations.py`). In a load of which no model is exact the part that dominates counts as what
is hidden: what is right is its family, or one of its class. `--parts` finds those of sets that were
drawn before rows held them.
"""

import argparse
import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import hidden_effects_evidence as evidence
import hidden_effects_study as study
import imitations
import marked
import numpy as np

from hidden_effects.limits import part_misfits
from tractexp.storage import files

STORED = Path(__file__).with_suffix(".jsonl")
KEPT = ("frozen", "group", "label", "seed", "truth", "verdict", "sets")
MARK = "benchmarks/judgement_pooled.py"
IMITATORS = imitations.find_imitators(evidence.read(imitations.STORED))
FAMILIES = {  # of what makes a load inexact; what is missing here is of none
    "broken_torque": "speed_dependent_torque",
    "bounded_flux": "magnetic_saturation",
    "other_motors": "second_motor_group",
}
GROUPS = {  # lines of the table, by the groups of rows
    "nothing": lambda group: group.startswith("null, ") and "error" not in group,
    "nothing, no model exact to 1 %": lambda group: group.startswith("null, error"),
    "nothing, inexact to 1 % by no family": lambda group: group.startswith("null, foreign"),
    "one effect, 4 x": lambda group: group in ("4 x", "law 4 x", "field 4 x"),
    "one effect, 4 x, no model exact to 2 %": lambda group: group == "loud 4 x",
    "two effects, 4 x": lambda group: group == "pairs 4 x",
    "left out of the catalogue, 8 x": lambda group: group == "left out 8 x",
}
SILENT = ("none", "unexplained")
EVENTS = 4  # of a data set
FORECASTS = "9423c711"  # the first set judged since an event must confirm a name
HEAD = [
    "hidden",
    "version",
    "data sets",
    "right",
    "right by class",
    "wrong",
    "wrong by class",
    "of these named",
    "candidates",
    "closed in an unused event",
]
Row = dict[str, Any]


def find_hidden(row: Row) -> list[str]:
    """What is hidden: of an inexact load the family of the part that dominates, of what was left
    out of the catalogue what that was.
    """
    if is_inexact(row):
        family = FAMILIES.get(row.get("dominates", ""))
        return [family] if family else []
    return [row["label"]] if row["group"].startswith(study.LEFT_OUT) else row["truth"]


def find_said(row: Row) -> list[list[str]]:
    """The sets that are told, tied ones side by side."""
    return row["sets"] if row["verdict"] not in SILENT else []


def find_class(name: str) -> set[str]:
    """An effect and those that imitate it."""
    return {name, *IMITATORS.get(name, ())}


def is_inexact(row: Row) -> bool:
    """Whether nothing is hidden in a load of which no model is exact."""
    return "error" in row["group"]


def is_right(row: Row, by_class: bool = False) -> bool:
    """Whether what is said is what is hidden: by label the one set, by class one of those tied,
    with a member of the class of each effect.
    """
    hidden, sets = find_hidden(row), find_said(row)
    if not by_class:
        return bool(hidden) and len(sets) == 1 and sorted(sets[0]) == sorted(hidden)
    return bool(hidden) and any(is_of_classes(names, hidden) for names in sets)


def is_of_classes(names: Sequence[str], hidden: Sequence[str]) -> bool:
    """Whether each name is of the class of another hidden effect, and none is left."""
    return len(names) == len(hidden) and any(
        all(name in find_class(effect) for name, effect in zip(names, order, strict=True))
        for order in itertools.permutations(hidden)
    )


def is_wrong(row: Row, by_class: bool = False) -> bool:
    """Whether something is said that is not hidden, even in part: of sets that are tied, by all."""
    hidden, sets = find_hidden(row), find_said(row)
    there = {*hidden} if not by_class else {*itertools.chain(*map(find_class, hidden))}
    return bool(sets) and not any({*names} <= there for names in sets)


def is_reached(row: Row) -> bool:
    """Whether the effect could be made as large as it was to be."""
    multiple = float(row["group"].split()[-2]) if row["group"].endswith(" x") else 0.0
    return evidence.reached(row, multiple) if multiple else True


def make_table(rows: list[Row]) -> str:
    """A line for what is hidden, of the sets before names were forecasts and of those since, in the
    order of `rows`; Markdown.
    """
    lines = []
    first = next(k for k, row in enumerate(rows) if row["frozen"].startswith(FORECASTS))
    parts = {"before": rows[:first], "since": rows[first:]}
    for (what, belongs), version in itertools.product(GROUPS.items(), parts):
        own = [row for row in parts[version] if belongs(row["group"]) and row["reached"]]
        if not own:
            continue
        counts = [
            sum(counted(row, by_class) for row in own)
            for counted in (is_right, is_wrong)
            for by_class in (False, True)
        ]
        cells = [evidence.share(count, len(own)) for count in counts]
        if not any(map(find_hidden, own)):  # silence is right, which has a column
            cells[:2] = "", ""
        named = sum(row["verdict"] == "named" and is_wrong(row, by_class=True) for row in own)
        candidates = sum(row["verdict"] == "candidate" for row in own)
        told = [*cells, named, candidates, describe_unused(own)]
        lines.append([what, version, len(own), *told])
    return marked.table(HEAD, lines)


def describe_unused(rows: Iterable[Row]) -> str:
    """The median of the share of squares that a name takes away of an event which nothing chose by,
    and of how many rows; "" where none has one.
    """
    shares = [row["unused"] for row in rows if row.get("unused") is not None]
    return f"{np.median(shares):.0%} of {len(shares)}" if shares else ""


def shorten(row: Row) -> Row:
    """What is kept of a row."""
    known = {"reached": is_reached(row), "unused": row.get("closed_unused")}
    kept = {key: row[key] for key in KEPT} | known
    return kept | {"dominates": find_largest(row["parts"])} if is_inexact(row) else kept


def find_largest(parts: Mapping[str, float]) -> str:
    """The part that leaves most of the response alone."""
    return max(parts, key=lambda name: parts[name])


def find_dominating(row: Row) -> str:
    """The part that dominates an inexact load, made anew from the series of its set."""
    salt = int(row["frozen"][:12], 16)
    planned = next(
        one
        for one in study.cases.inexact(study.ERROR, salt, events=EVENTS)
        if one.seed == row["seed"]
    )
    return find_largest(part_misfits(planned.make().case, planned.seed))


def add_parts() -> None:
    """Write into the stored rows of inexact loads in which something is said which part dominates,
    where they lack it.
    """
    rows = evidence.read(STORED)
    for row in rows:
        if is_inexact(row) and find_said(row) and "dominates" not in row:
            row["dominates"] = find_dominating(row)
    files.write(STORED, "".join(json.dumps(row) + "\n" for row in rows))


def keep(rows: Iterable[Row]) -> None:
    """Add rows that are not there yet; those of which nothing was said are left out."""
    there = evidence.read(STORED) if STORED.exists() else []
    done = {(row["frozen"], row["group"], row["label"], row["seed"]) for row in there}
    new = [shorten(row) for row in rows if "verdict" in row]
    new = [r for r in new if (r["frozen"], r["group"], r["label"], r["seed"]) not in done]
    with STORED.open("a", encoding="utf-8") as file:
        file.writelines(json.dumps(row) + "\n" for row in new)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--keep", action="store_true", help="add rows, and stop")
    parser.add_argument("--rows", type=Path, default=study.NEWEST)
    parser.add_argument(
        "--parts", action="store_true", help="find the parts that dominate, and stop"
    )
    asked = parser.parse_args()
    if asked.parts:
        add_parts()
        return
    if asked.keep:
        keep(evidence.read(asked.rows))
        return
    rows = evidence.read(STORED)
    marked.replace(study.ROOT / "docs" / evidence.PAGE, MARK, make_table(rows))


if __name__ == "__main__":
    main()
