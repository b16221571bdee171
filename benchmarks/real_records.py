"""What an investigation says of real records, each dip fitted in turn: python
benchmarks/real_records.py [--docs]

The records are those of a 220 kV fault recorder (station xtz: two transformers, two dips), as
phasors and as waveforms, and of a load in ANDES that lacks a stator resistance and has a ZIP static
load. Stored are the verdict, its names and the model's error before and after, fitted and held out;
`--docs` writes them into docs/judgement.md.
"""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import marked  # noqa: E402
from model_error import RECORDS, SHARED  # noqa: E402

from tractexp.storage import files  # noqa: E402

FIRST, LAST = "all but the last", "all but the first"  # dips that are fitted
STORED = Path(__file__).with_suffix(".json")
DOCS = Path(__file__).parents[1] / "docs" / "judgement.md"
MARK = "benchmarks/real_records.py --docs"
MOST_SETS = 3  # of a tie that the table has
ASKED = ("xtz T1 phasors", "xtz T2 phasors", "xtz T1 waves", "xtz T2 waves", "andes a")


def row(name: str, fitted: str) -> dict[str, Any]:
    """One investigation."""
    import tractexp

    data = RECORDS[name](SHARED)
    events = [*data.train, *data.validate]
    train, validate = (events[:-1], events[-1:]) if fitted == FIRST else (events[1:], events[:1])
    started = time.perf_counter()
    found = tractexp.investigate(train, validate=validate, domain=data.domain, progress=False)
    verdict = {"verdict": found.verdict, "complete": found.complete, "names": list(found.names)}
    near = found.content["nearest"]
    return {
        "record": name,
        "fitted": fitted,
        **verdict,
        "reason": found.reason,
        "sets": found.content["name_sets"],
        "grade": found.content["adequacy"]["grade"],
        "nearest": near and near["effects"],
        "gap": found.content["gap"],
        "near_gap": near and near.get("gap"),
        "seconds": time.perf_counter() - started,
    }


def percent(misfit: Mapping[str, Any] | None) -> str:
    """The model's error, in percent of the response."""
    return "-" if misfit is None else f"{100 * misfit['model_error']['value']:.1f}"


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown: a line for each investigation."""
    head = [
        "record",
        "dips fitted",
        "verdict",
        "names",
        "fitted: before, after [%]",
        "held out: before, after [%]",
    ]
    lines = []
    for one in rows:
        names, gaps = list_sets(one["sets"]), one["gap"]
        whole = ", complete" if one["complete"] else ", incomplete"
        if not one["names"]:
            names, gaps, whole = f"nearest: {joined(one['nearest'])}", one["near_gap"], ""
        both = (gaps["train"], gaps["validate"])
        errors = [f"{percent(g['before'])}, {percent(g['after'])}" if g else "-" for g in both]
        lines.append([one["record"], one["fitted"], one["verdict"] + whole, names, *errors])
    return marked.table(head, lines)


def list_sets(sets: list[list[str]]) -> str:
    """Sets as code: the first of them, and how many more there are."""
    more = len(sets) - MOST_SETS
    return "; ".join([*map(joined, sets[:MOST_SETS]), *([f"{more} more"] if more > 0 else [])])


def joined(names: list[str]) -> str:
    """Effects as code."""
    return ", ".join(f"`{n}`" for n in names) or "-"


def main() -> None:
    chosen = marked.read_command(__doc__ or "", ASKED)
    rows = marked.read_rows(STORED)
    for name in () if chosen.docs else chosen.only:
        for fitted in (FIRST, LAST):
            rows = [r for r in rows if (r["record"], r["fitted"]) != (name, fitted)] + [
                row(name, fitted)
            ]
            files.write_json(
                STORED, sorted(rows, key=lambda r: (ASKED.index(r["record"]), r["fitted"]))
            )
            print(table(rows[-1:]), f"{rows[-1]['seconds']:.0f} s", flush=True)
    if chosen.docs:
        marked.replace(DOCS, MARK, table(rows))


if __name__ == "__main__":
    main()
