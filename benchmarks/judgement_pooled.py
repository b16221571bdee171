"""Judgement sets of several versions together: python judgement_pooled.py [--keep FROZEN]

A row of 12 data sets has an interval of 26 points to either side, seven sets together one of 4 to
11. Of each set the rows are kept in short in judgement_pooled.jsonl: what was hidden and what was
said, no seed twice. `--keep` adds those of judgement.jsonl, or of another file of rows (`--rows`),
before a later set takes their place. Without it the table is written into docs/judgement.md.

What is said counts by label, and by class: effects of one class predict alike, so that records
show the class and not which of its members is there. The classes are those in which 1,196 data sets
of earlier versions took one effect for another; they were fixed before the newest set was drawn.
"""

import argparse
import itertools
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import hidden_effects_evidence as evidence
import hidden_effects_study as study
import marked
import numpy as np

STORED = Path(__file__).with_suffix(".jsonl")
KEPT = ("frozen", "group", "label", "seed", "truth", "verdict", "sets")
MARK = "benchmarks/judgement_pooled.py"
CLASSES = (
    ("stator_resistance", "feeder_impedance"),
    (
        "constant_power_converter",
        "voltage_dependent_power_limit",
        "dc_link_lag",
        "exponential_recovery",
    ),
    (
        "magnetic_saturation",
        "static_var_compensator",
        "shunt_capacitor",
        "polynomial_static_load",
    ),
    ("second_motor_group", "speed_dependent_torque", "low_frequency_oscillation"),
)
# what every load has of which no model is exact (`hidden_effects.imperfections`), in the names of
# the catalogue: a broken torque, a bounded flux, motors of another make
IMPERFECT = ("magnetic_saturation", "second_motor_group", "speed_dependent_torque")
CLASS_OF = {name: one[0] for one in CLASSES for name in one}
GROUPS = {  # lines of the table, by the groups of rows
    "nothing": lambda group: group.startswith("null, ") and "error" not in group,
    "nothing, no model exact to 1 %": lambda group: "error" in group,
    "one effect, 4 x": lambda group: group in ("4 x", "law 4 x", "field 4 x"),
    "one effect, 4 x, no model exact to 2 %": lambda group: group == "loud 4 x",
    "two effects, 4 x": lambda group: group == "pairs 4 x",
    "left out of the catalogue, 8 x": lambda group: group == "left out 8 x",
}
SILENT = ("none", "unexplained")
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
    "silent",
    "closed in an unused event",
]
Row = dict[str, Any]


def find_class(names: Iterable[str]) -> list[str]:
    """The classes of effects, by one member each."""
    return sorted(CLASS_OF.get(name, name) for name in names)


def is_inexact(row: Row) -> bool:
    """Whether nothing is hidden in a load of which no model is exact."""
    return "error" in row["group"]


def is_right(row: Row, by_class: bool = False) -> bool:
    """Whether what is said is what is hidden: by label the one set, by class one of those tied, and
    of an effect that was left out of the catalogue another one of its class.
    """
    hidden = [row["label"]] if row["group"].startswith(study.LEFT_OUT) else row["truth"]
    sets = row["sets"] if row["verdict"] not in SILENT else []
    if not by_class:
        return len(sets) == 1 and sorted(sets[0]) == sorted(hidden)
    return any(find_class(names) == find_class(hidden) for names in sets)


def is_wrong(row: Row, by_class: bool = False) -> bool:
    """Whether something is said that is not hidden, even in part: of sets that are tied, by all. By
    class what makes a load inexact is there.
    """
    hidden = [row["label"]] if row["group"].startswith(study.LEFT_OUT) else row["truth"]
    sets = row["sets"] if row["verdict"] not in SILENT else []
    if by_class and is_inexact(row):
        return bool(sets) and not any({*names} <= {*IMPERFECT} for names in sets)
    if not by_class:
        return bool(sets) and not any({*names} <= {*hidden} for names in sets)
    there = {*find_class(hidden)}
    return bool(sets) and not any({*find_class(names)} <= there for names in sets)


def is_reached(row: Row) -> bool:
    """Whether the effect could be made as large as it was to be."""
    multiple = float(row["group"].split()[-2]) if row["group"].endswith(" x") else 0.0
    return evidence.reached(row, multiple) if multiple else True


def make_table(rows: list[Row], newest: str) -> str:
    """A line for what is hidden, earlier sets together and the newest; Markdown."""
    lines = []
    for (what, belongs), is_newest in itertools.product(GROUPS.items(), (False, True)):
        own = [
            row
            for row in rows
            if belongs(row["group"]) and row["reached"] and (row["frozen"] == newest) == is_newest
        ]
        if not own:
            continue
        counts = [
            sum(counted(row, by_class) for row in own)
            for counted in (is_right, is_wrong)
            for by_class in (False, True)
        ]
        # of nothing hidden silence is right, which has a column
        cells = [evidence.share(count, len(own)) for count in counts]
        if not any(row["truth"] or row["group"].startswith(study.LEFT_OUT) for row in own):
            cells[:2] = "", ""
        named = sum(row["verdict"] == "named" and is_wrong(row, by_class=True) for row in own)
        candidates = sum(row["verdict"] == "candidate" for row in own)
        silent = sum(row["verdict"] in SILENT for row in own)
        version = newest[:8] if is_newest else "before"
        told = [*cells, named, candidates, silent, describe_unused(own)]
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
    return {key: row[key] for key in KEPT} | known


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
    asked = parser.parse_args()
    if asked.keep:
        keep(evidence.read(asked.rows))
        return
    rows = evidence.read(STORED)
    newest = rows[-1]["frozen"]
    marked.replace(study.ROOT / "docs" / evidence.PAGE, MARK, make_table(rows, newest))


if __name__ == "__main__":
    main()
