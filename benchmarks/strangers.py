"""Loads of simulators that nobody here wrote, as judges of names: python benchmarks/strangers.py
[--count 60] [--minutes 9] [--simulator DPsim] [--again wrong] [--docs]

Loads of motulator, ANDES, DPsim and HERMESS (`strangers_motulator`, `andes_loads`,
`strangers_dpsim`, `strangers_hermess`) in turn, three dips each of which the last is held out, with
noise of 0.05 to 1 %. `--simulator` takes those of one. What a load has that the base model lacks is
known. What is said of it is *right* where every effect named is there, a *class* where that holds
for one of the sets that are tied, *silent* where nothing is named though something is missing.
Where nothing is missing to say nothing is *rightly silent*, and to say that something is, without a
name, *doubted*. All else is *wrong*. Rows are appended to strangers.jsonl, so that a run
goes on where it stopped; `--again` judges what another version gave an outcome, and replaces its
row. The seeds are of the series `SERIES`, none left out.
"""

import argparse
import itertools
import json
import os
import subprocess
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import andes_loads  # noqa: E402
import hidden_effects_evidence as evidence  # noqa: E402
import marked  # noqa: E402
import numpy as np  # noqa: E402
import strangers_dpsim as dpsim  # noqa: E402
import strangers_hermess as hermess  # noqa: E402
import strangers_motulator as motulator  # noqa: E402

from hidden_effects.noise import Noise  # noqa: E402
from tractexp.errors import UserError  # noqa: E402

STORED = Path(__file__).with_suffix(".jsonl")
PAGE, MARK = STORED.with_suffix(".md"), "benchmarks/strangers.py --docs"
SERIES = "strangers"
DIPS = 3
LEVELS = (0.0005, 0.01)  # pu, of the noise of P and Q
MOST_TOLD = 8  # sets whose errors a row holds
RIGHT, CLASS, SILENT, WRONG = "right", "class", "silent", "wrong"
RIGHTLY_SILENT, DOUBTED = "rightly silent", "doubted"
OUTCOMES = (RIGHT, CLASS, RIGHTLY_SILENT, SILENT, DOUBTED, WRONG)
BESIDE = {"DPsim": dpsim, "HERMESS": hermess}  # what is beside a machine of motulator's
SIMULATORS = ("motulator", "ANDES", *BESIDE)
Columns = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Stranger:
    """Dips of a load, what it has that the base model lacks, and whether it has what no effect is.

    `truth` holds all of these effects: one that moves little need not be named.
    """

    simulator: str
    kind: str
    model: str
    frequency: float
    dips: list[Columns]
    truth: tuple[str, ...]
    outside: bool = False


def make_strangers() -> Iterator[tuple[int, str]]:
    """Numbers and simulators in turn, without end; those of ANDES and HERMESS are odd."""
    for number in itertools.count(0, 2):
        yield from ((number + k % 2, name) for k, name in enumerate(SIMULATORS))


def make_stranger(number: int, simulator: str) -> Stranger:
    """The load of this number. Raises what its simulator raises where there is none."""
    rng = andes_loads.generator(SERIES, number, simulator)
    if simulator in BESIDE:
        return make_beside(number // 2, simulator, rng)
    make = make_machine if simulator == "motulator" else make_system
    return make(number // 2, rng)


def make_machine(number: int, rng: np.random.Generator) -> Stranger:
    """A load of motulator's; in every second round the base model has what all of these have, and
    in every third the angle of the voltage jumps.
    """
    kinds = list(motulator.KINDS)
    kind, turn = kinds[number % len(kinds)], number // len(kinds)
    load = motulator.draw_load(kind, rng)
    drawn = motulator.draw_dips(rng, DIPS, jumps=number % 3 == 2)
    dips = [motulator.record_dip(load, dip) for dip in drawn]
    whole = turn % 2 == 0
    model = "fifth_order_stator_flux" if whole else "third_order_exponential"
    truth = motulator.KINDS[kind] + (() if whole else motulator.ALWAYS)
    outside = kind in motulator.OUTSIDE
    return Stranger("motulator", kind, model, motulator.FREQUENCY, dips, truth, outside)


def make_beside(number: int, simulator: str, rng: np.random.Generator) -> Stranger:
    """A load of another simulator beside a machine, which the base model has."""
    own = BESIDE[simulator]
    kind = list(own.KINDS)[number % len(own.KINDS)]
    load = own.draw_load(kind, rng)
    dips = [own.record_dip(load, dip) for dip in motulator.draw_dips(rng, DIPS, jumps=False)]
    model, outside = "fifth_order_stator_flux", kind in own.OUTSIDE
    return Stranger(simulator, kind, model, motulator.FREQUENCY, dips, own.KINDS[kind], outside)


def make_system(number: int, rng: np.random.Generator) -> Stranger:
    """A load of ANDES's, the frequency with the jumps of the angle in every second set: without
    them the record lacks what the load saw, which no effect is.
    """
    one = andes_loads.make(SERIES, number)
    chosen = "f" if rng.integers(2) else "f_smooth"
    dips = [
        {key: dip[key] for key in ("t", "U", "P", "Q")} | {"f": dip[chosen]} for dip in one.dips
    ]
    kind = one.truth["kind"]
    truth = ("second_cage",) if kind == "Motor5" else ()
    truth += ("stator_resistance",) if one.truth["motor"]["rs"] > 1e-3 else ()
    told = f"{kind}, {'with' if 'stator_resistance' in truth else 'without'} stator resistance"
    model, outside = "third_order_zip", chosen == "f_smooth"
    return Stranger("ANDES", told, model, andes_loads.FREQUENCY, dips, truth, outside)


def judge_stranger(number: int, simulator: str) -> dict[str, Any]:
    """A row: what is said of the load of this number and what that is worth, or why there is
    none.
    """
    row: dict[str, Any] = {"number": number, "simulator": simulator, "version": find_version()}
    try:
        stranger = make_stranger(number, simulator)
    except (andes_loads.StalledMotor, RuntimeError, ArithmeticError) as error:
        return row | {"refused": f"{type(error).__name__}: {error}"}
    return row | judge_load(stranger, andes_loads.generator(SERIES, number, f"{simulator} noise"))


def judge_load(stranger: Stranger, rng: np.random.Generator) -> dict[str, Any]:
    """What is said of a load under drawn noise and what that is worth, or why nothing is."""
    import tractexp

    level = float(np.exp(rng.uniform(*np.log(LEVELS))))
    row: dict[str, Any] = {"kind": stranger.kind, "model": stranger.model}
    row |= {"truth": list(stranger.truth), "outside": stranger.outside, "noise": level}
    begun = sum(os.times()[:4])
    try:
        dips = [
            tractexp.read(
                **Noise(level).add(dip, rng), name=f"dip {k}", frequency=stranger.frequency
            )[0]
            for k, dip in enumerate(stranger.dips, 1)
        ]
        found = tractexp.investigate(dips[:-1], stranger.model, validate=dips[-1:], progress=False)
    except UserError as error:
        return row | {"refused": f"UserError: {error}"}
    told = {"verdict": found.verdict, "sets": found.content["name_sets"], "reason": found.reason}
    told["error"] = found.content["gap"]["validate"]["before"]["model_error"]["value"]
    told["nearest"] = rank_nearest(found.steps.evidence)
    row |= told | {"outcome": rate(told, stranger.truth, stranger.outside)}
    return row | {"seconds": sum(os.times()[:4]) - begun}


def rank_nearest(evidence: Any) -> list[tuple[list[str], float]]:
    """The sets that predict best and the base model, each with its error on the held-out dip; none
    where names went by the likelihood.
    """
    if not evidence.is_predicted:
        return []
    every = sorted(evidence.every, key=lambda row: row.prediction.excess)
    return [([*row.family], row.prediction.error) for row in (*every[:MOST_TOLD], evidence.base)]


def find_version() -> str:
    """The commit whose product judges."""
    git = ("git", "-C", str(STORED.parent), "rev-parse", "--short=8", "HEAD")
    return subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()


def rate(told: dict[str, Any], truth: tuple[str, ...], outside: bool) -> str:
    """What a verdict is worth; a candidate is a name."""
    if told["verdict"] in ("none", "unexplained"):
        if truth or outside:
            return SILENT
        return RIGHTLY_SILENT if told["verdict"] == "none" else DOUBTED
    right = [bool(names) and set(names) <= set(truth) for names in told["sets"]]
    if not any(right):
        return WRONG
    return RIGHT if len(right) == 1 else CLASS


def make_tables(rows: list[dict[str, Any]]) -> str:
    """A row a simulator and kind of load, then of all together how many say nothing wrong and how
    many are named wrongly, with intervals; Markdown.
    """
    judged = [row for row in rows if "outcome" in row]
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in judged:
        groups.setdefault((row["simulator"], row["kind"]), []).append(row)
    lines = [[*group, len(own), *count_outcomes(own)] for group, own in sorted(groups.items())]
    lines.append(["all", "", len(judged), *count_outcomes(judged)])
    wrong = sum(row["outcome"] == WRONG for row in judged)
    named = sum(row["outcome"] == WRONG and row["verdict"] == "named" for row in judged)
    doubted = sum(row["outcome"] == DOUBTED for row in judged)
    shares = (
        ("right, class or silent", len(judged) - wrong - doubted),
        ("no wrong name", len(judged) - wrong),
        ("wrong", wrong),
        ("wrong, and named instead of a candidate or tied", named),
    )
    told = [f"{what}: {evidence.share(count, len(judged))}" for what, count in shares]
    table = marked.table(["simulator", "load", "sets", *OUTCOMES], lines)
    return f"{table}\n\n{'; '.join(told)}"


def count_outcomes(rows: list[dict[str, Any]]) -> list[int]:
    """How many rows have each outcome."""
    counted = Counter(row["outcome"] for row in rows)
    return [counted[one] for one in OUTCOMES]


def read_rows(stored: Path = STORED) -> list[dict[str, Any]]:
    """The rows of a file, none where it is not there."""
    if not stored.exists():
        return []
    return [json.loads(line) for line in stored.read_text(encoding="utf-8").splitlines()]


def store(row: dict[str, Any], rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """All rows, this one in the place of an earlier one of its load, and the file of them."""
    load = (row["number"], row["simulator"])
    places = {(one["number"], one["simulator"]): k for k, one in enumerate(rows)}
    k = places.get(load, len(rows))
    every = [*rows[:k], row, *rows[k + 1 :]]
    text = "".join(json.dumps(one) + "\n" for one in every)
    STORED.write_text(text, encoding="utf-8")
    return every


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no further set after")
    parser.add_argument("--simulator", choices=SIMULATORS, help="default: all in turn")
    parser.add_argument("--again", choices=OUTCOMES, nargs="*", default=[])
    parser.add_argument(
        "--docs", action="store_true", help="write the stored rows into the page, and stop"
    )
    asked = parser.parse_args()
    rows = read_rows()
    if asked.docs:
        marked.replace(PAGE, MARK, make_tables(rows))
    else:
        version = find_version()
        rejudged = [
            row
            for row in rows
            if row.get("outcome") in asked.again and row.get("version") != version
        ]
        done = {(row["number"], row["simulator"]) for row in rows if row not in rejudged}
        end = time.monotonic() + 60 * asked.minutes
        for number, simulator in itertools.islice(make_strangers(), asked.count):
            is_asked = asked.simulator in (None, simulator)
            if not is_asked or (number, simulator) in done or time.monotonic() > end:
                continue
            row = judge_stranger(number, simulator)
            rows = store(row, rows)
            told = row.get("refused") or f"{row['outcome']}: {row['verdict']} {row['sets']}"
            print(f"{number} {simulator}, {row.get('kind')}: {told}", flush=True)
    print(make_tables(rows))


if __name__ == "__main__":
    main()
