"""Verdicts and numbers of a fixed set of investigations and identifications, to tell whether a
change moved them.

    python golden.py --write        make golden.jsonl, before a change of structure
    python golden.py                make everything again and tell each difference

Results come from the command line and the files it writes, so that the same script serves before
and after any change inside. A row says on which processor it was made. There numbers are compared
to `SAME`; on another to `OTHER`, since kernels round otherwise and a descent carries that on.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from zlib import crc32

import oracle  # noqa: F401
from joblib import Parallel, delayed
from processor import processor

from hidden_effects import Case, Noise, write
from hidden_effects.cases import NOISES

FILE = Path(__file__).parent / "golden.jsonl"
SAME, OTHER = 1e-9, 1e-5  # relative
LOUD, QUIET = Noise(0.005), Noise(0.002)
NULLS = ("white 0.2 %", "wandering load")
HELD_OUT = (
    "stator_resistance",
    "undervoltage_trip",
    "negative_sequence_braking",
    "measurement_window",
)
MODELS = ("first_order_exponential", "third_order_zip", "fifth_order_double_cage")
OPTIMIZERS = ("issa", "multistart_least_squares", "differential_evolution")
INVESTIGATION = (
    "verdict",
    "reason",
    "effects",
    "name_sets",
    "where",
    "gap",
    "left",
    "nearest",
    "recommendation",
    "noise",
    "phasor_window",
    "parameters",
    "simulations",
)
RESULT = (
    "parameters",
    "objective",
    "epsilon_p",
    "epsilon_q",
    "simulations",
    "refused",
    "iterations",
    "status",
    "events",
    "at_bound",
    "standard_errors",
    "intervals",
    "verdicts",
)


def investigations() -> Iterator[tuple[str, Case, int]]:
    """Label, case, and how many events are held out."""
    for name in NULLS:
        yield f"null, {name}", Case(noise=NOISES[name], events=3), 1
    for name in HELD_OUT:
        yield f"{name}, held out", Case(name, 2.0, events=3, noise=LOUD), 1
    yield "magnetic_saturation, mild", Case("magnetic_saturation", 1.0, events=2, noise=LOUD), 0
    yield "stranger load_step", Case("load_step", 3.0, events=3, noise=QUIET), 1
    pair = ("shunt_capacitor", "speed_dependent_torque")
    yield " and ".join(pair), Case(pair, (1.6, 1.6), events=4, noise=QUIET), 1


def command(folder: Path, *arguments: str) -> dict[str, Any]:
    """Run tractexp in a folder; what it refuses is a row with its sentence."""
    line = [
        sys.executable,
        "-m",
        "tractexp",
        *arguments,
        "tracking.enabled=false",
        "hydra.run.dir=run",
    ]
    done = subprocess.run(line, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        return {"refused": done.stderr.strip().splitlines()[-1]}
    investigation = "task=discrepancy" in arguments
    file = folder / "run" / ("discrepancy.json" if investigation else "result.json")
    content = json.loads(file.read_text(encoding="utf-8"))
    row = {key: content[key] for key in (INVESTIGATION if investigation else RESULT)}
    if investigation:
        row["candidates"] = [
            [c["effects"], c["status"], c["likelihood_ratio"]] for c in content["candidates"]
        ]
    return row


def investigated(label: str, case: Case, held: int) -> dict[str, Any]:
    """One investigation. A size that makes no physical sense for what the seed draws is lowered."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        while True:
            try:
                write(case, crc32(f"golden {label}".encode()), folder)
                break
            except (ValueError, ArithmeticError):
                case = replace(case, size=tuple(0.8 * size for _, size in case.hidden))
        dips = [f"event{k + 1}.csv" for k in range(int(case.events))]
        train, validate = dips[: len(dips) - held], dips[len(dips) - held :]
        data = [
            "data=csv",
            f"data.train=[{','.join(train)}]",
            f"data.validate=[{','.join(validate)}]",
        ]
        return {"label": label, **command(folder, "task=discrepancy", *data)}


def identified(label: str, *arguments: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as name:
        return {"label": label, **command(Path(name), *arguments)}


def jobs() -> Iterator[Any]:
    for label, *investigation in investigations():
        yield delayed(investigated)(label, *investigation)
    for model in MODELS:
        yield delayed(identified)(
            f"model {model}", f"model={model}", "optimizer=multistart_least_squares", "seed=1"
        )
    for optimizer in OPTIMIZERS:
        yield delayed(identified)(
            f"optimizer {optimizer}", f"optimizer={optimizer}", "seed=2", "data=tibet_30pct"
        )
    three = "data.train=[pkg://tractexp.data/tibet_30pct.csv,pkg://tractexp.data/tibet_65pct.csv]"
    yield delayed(identified)(
        "per event, robust", "data=csv", three, "model.per_event=[T_m]", "objective=huber"
    )


def differences(before: Any, now: Any, at: str = "") -> Iterator[tuple[str, float]]:
    """Where two JSON contents differ, a line each, and by how much, relative: infinity where it is
    no number.
    """
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys((*before, *now)):
            yield from differences(before.get(key), now.get(key), f"{at}.{key}")
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for k, (old, new) in enumerate(zip(before, now, strict=True)):
            yield from differences(old, new, f"{at}[{k}]")
    elif before != now:
        numbers = isinstance(before, float | int) and isinstance(now, float | int)
        size = abs(before - now) / max(abs(before), abs(now)) if numbers else math.inf
        yield f"{at}: {before!r} -> {now!r}", size


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--write",
        action="store_true",
        help="store the rows chosen by --only, and no label that is gone",
    )
    parser.add_argument("--only", default="", help="labels that contain this")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    here, wanted = processor(), [job for job in jobs() if options.only in job[1][0]]
    stored = {
        row["label"]: row for row in map(json.loads, FILE.read_text(encoding="utf-8").splitlines())
    }
    rows, most = {}, 0.0
    for row in Parallel(n_jobs=options.jobs, return_as="generator")(wanted):
        before = dict(stored.get(row["label"], {}))
        elsewhere = before.pop("processor", here) != here
        moves = list(differences(before, row))
        most = max([most, *(size for _, size in moves)])
        large = [line[:150] for line, size in moves if size > (OTHER if elsewhere else SAME)]
        verdict = (
            row.get("refused")
            or f"{row.get('verdict', row.get('status'))} {' '.join(row.get('effects', []))}"
        )
        print(
            f"{row['label']}: {verdict}{', stored on another processor' * elsewhere}",
            *large[:12],
            sep="\n    ",
        )
        sys.stdout.flush()
        rows[row["label"]] = row | {"processor": here}, bool(large)
    moved = sum(large for _, large in rows.values())
    print(
        f"{len(rows)} compared, {moved} differ; the largest difference of a number is {most:.1e},"
        f" on {here}"
    )
    if not options.write:
        return int(moved > 0)
    stored |= {label: row for label, (row, _) in rows.items()}
    FILE.write_text(
        "".join(json.dumps(stored[job[1][0]]) + "\n" for job in jobs() if job[1][0] in stored),
        encoding="utf-8",
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
