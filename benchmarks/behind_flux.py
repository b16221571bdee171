"""What stator flux hides: python benchmarks/behind_flux.py [--count 9] [--minutes 9] [--docs]

Loads of motulator's machine as in `strangers.py`, investigated from the third order, which lacks
the stator's transients and resistance: the strongest effect. In two of three loads a weaker one is
beside it, a torque of speed squared or a saturation; in every third there is none, and one that is
told is a false candidate. Three dips, the last held out. Rows are appended to behind_flux.jsonl;
`--docs` writes their table into strangers.md. The seeds are those of the series `SERIES`, none left
out.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import andes_loads
import marked
import strangers
import strangers_motulator as motulator

STORED = Path(__file__).with_suffix(".jsonl")
MARK = "benchmarks/behind_flux.py --docs"
SERIES = "calibration"
KINDS = ("torque of speed squared", "saturation", "constant torque")
STRONGEST = motulator.ALWAYS
TOLD, NEAREST, FOUND, FALSE = "strongest alone", "in the nearest set", "hidden one told", "false"


def make_load(number: int) -> strangers.Stranger:
    """The load of this number, whose base model is the third order."""
    rng = andes_loads.generator(SERIES, number, "behind flux")
    kind = KINDS[number % len(KINDS)]
    load = motulator.draw_load(kind, rng)
    dips = [motulator.record_dip(load, dip) for dip in motulator.draw_dips(rng, 3, jumps=False)]
    truth = motulator.KINDS[kind] + motulator.ALWAYS
    return strangers.Stranger(
        "motulator", kind, "third_order_exponential", motulator.FREQUENCY, dips, truth
    )


def find_told(row: dict[str, Any]) -> dict[str, bool]:
    """What a row says of the strongest effect, of the hidden one, and of what is not there.

    *In the nearest set*: the set that predicts the held-out dip best has the hidden effect.
    """
    told = {name for names in row["sets"] for name in names}
    hidden = {*row["truth"]} - {*STRONGEST}
    nearest = {*row["nearest"][0][0]} if row["nearest"] else set()
    return {
        TOLD: bool(told & {*STRONGEST}) and not told & hidden,
        NEAREST: bool(hidden & nearest),
        FOUND: bool(told & hidden),
        FALSE: bool(told - {*row["truth"]}),
    }


def make_table(rows: list[dict[str, Any]]) -> str:
    """Each kind of load, and how many rows say what."""
    lines = []
    for kind in KINDS:
        own = [row for row in rows if row.get("kind") == kind and "outcome" in row]
        told = [find_told(row) for row in own]
        counts = [sum(one[what] for one in told) for what in (TOLD, FOUND, NEAREST, FALSE)]
        lines.append([kind, len(own), *counts])
    return marked.table(["load", "sets", TOLD, FOUND, NEAREST, FALSE], lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=9)
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no further set after")
    parser.add_argument("--docs", action="store_true", help="write the stored rows into the page")
    asked = parser.parse_args()
    rows = strangers.read_rows(STORED)
    if asked.docs:
        marked.replace(strangers.PAGE, MARK, make_table(rows))
        return
    end = time.monotonic() + 60 * asked.minutes
    for number in range(asked.count):
        if number in {row["number"] for row in rows} or time.monotonic() > end:
            continue
        rng = andes_loads.generator(SERIES, number, "behind flux, noise")
        row = {"number": number, "version": strangers.find_version()}
        row |= strangers.judge_load(make_load(number), rng)
        rows.append(row)
        with STORED.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        told = row.get("refused") or f"{row['verdict']} {row['sets']}"
        print(f"{number} {row['kind']}: {told}", flush=True)
    print(make_table(rows))


if __name__ == "__main__":
    main()
