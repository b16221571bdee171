"""Verdicts and numbers of a fixed set of investigations and identifications, to tell whether a change moved them.

    python golden.py --write        make golden.jsonl, before a change of structure
    python golden.py                make everything again and tell each difference

Only the command line and the files it writes are used, so that the same script serves before and after any change
inside. Numbers are compared to `TOLERANCE`: a kernel whose operations are ordered otherwise rounds otherwise, and a
descent carries that on.
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

from hidden_effects import Case, Noise, write
from hidden_effects.cases import NOISES
from hidden_effects.effects import CATALOG

FILE = Path(__file__).parent / "golden.jsonl"
TOLERANCE = 1e-5  # relative
LOUD, QUIET = Noise(0.005), Noise(0.002)
NULLS = ("white 0.2 %", "white 2 %", "AR(1) 0.8", "voltage 0.5 %", "heavy tails", "wandering load", "quantized")
STRANGERS = (
    "load_step", "subsynchronous_ring", "voltage_rate", "rotor_skin_effect", "stator_transients", "tap_changer_step",
)  # fmt: skip
MODELS = (
    "first_order_exponential", "second_order_exponential", "third_order_zip", "fifth_order_stator_flux",
    "fifth_order_double_cage", "motor_alone", "static_exponential",
)  # fmt: skip
OPTIMIZERS = ("issa", "ssa", "pso", "multistart_least_squares", "differential_evolution", "issa_to_the_letter")
KEPT = (
    "verdict", "reason", "effects", "name_sets", "where", "gap", "left", "nearest", "recommendation", "noise",
    "phasor_window", "parameters", "simulations",
)  # fmt: skip
RESULT = (
    "parameters", "objective", "epsilon_p", "epsilon_q", "simulations", "refused", "iterations", "status", "events",
    "at_bound", "standard_errors", "intervals", "verdicts",
)  # fmt: skip


def investigations() -> Iterator[tuple[str, Case, int, list[str]]]:
    """Label, case, events held out, and the effects the catalogue is restricted to (none: all)."""
    for name in (
        "white 0.2 %",
        "white 2 %",
        "AR(1) 0.8",
        "voltage 0.5 %",
        "heavy tails",
        "wandering load",
        "quantized",
    ):
        yield f"null, {name}", Case(noise=NOISES[name], events=3), 1, []
    yield "null, recorder's window", Case(nuisances=(("phasor_window", 2.0),), noise=QUIET, events=3), 1, []
    for name in CATALOG:
        yield f"{name}, held out", Case(name, 2.0, events=3, noise=LOUD), 1, []
    for name in [*CATALOG][:8]:
        yield f"{name}, mild", Case(name, 1.0, events=2, noise=LOUD), 0, []
    for name in STRANGERS:
        yield f"stranger {name}", Case(name, 3.0, events=3, noise=QUIET), 1, []
    for pair in (("stator_resistance", "exponential_recovery"), ("shunt_capacitor", "speed_dependent_torque")):
        yield " and ".join(pair), Case(pair, (1.6, 1.6), events=4, noise=QUIET), 1, []
    for name in ("undervoltage_trip", "second_motor_group", "constant_power_converter"):
        yield f"{name}, left out", Case(name, 2.0, events=3, noise=QUIET), 1, [n for n in CATALOG if n != name]


def command(folder: Path, *arguments: str) -> dict[str, Any]:
    """Run tractexp in a folder; what it refuses is a row with its sentence."""
    told = [sys.executable, "-m", "tractexp", *arguments, "tracking.enabled=false", "hydra.run.dir=run"]
    done = subprocess.run(told, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        return {"refused": done.stderr.strip().splitlines()[-1]}
    file = folder / "run" / ("discrepancy.json" if "task=discrepancy" in arguments else "result.json")
    made = json.loads(file.read_text(encoding="utf-8"))
    if file.stem == "result":
        return {key: made[key] for key in RESULT}
    kept = {key: made[key] for key in KEPT}
    return kept | {"candidates": [[c["effects"], c["status"], c["likelihood_ratio"]] for c in made["candidates"]]}


def investigated(label: str, case: Case, held: int, only: list[str]) -> dict[str, Any]:
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
        data = ["data=csv", f"data.train=[{','.join(train)}]", f"data.validate=[{','.join(validate)}]"]
        restricted = [f"task.effects=[{','.join(only)}]"] if only else []
        return {"label": label, **command(folder, "task=discrepancy", *data, *restricted)}


def identified(label: str, *arguments: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as name:
        return {"label": label, **command(Path(name), *arguments)}


def jobs() -> Iterator[Any]:
    for told in investigations():
        yield delayed(investigated)(*told)
    for model in MODELS:
        yield delayed(identified)(f"model {model}", f"model={model}", "optimizer=multistart_least_squares", "seed=1")
    for optimizer in OPTIMIZERS:
        yield delayed(identified)(f"optimizer {optimizer}", f"optimizer={optimizer}", "seed=2", "data=tibet_30pct")
    three = "data.train=[pkg://tractexp.data/tibet_30pct.csv,pkg://tractexp.data/tibet_65pct.csv]"
    yield delayed(identified)("per event, robust", "data=csv", three, "model.per_event=[T_m]", "objective=huber")


def differences(before: Any, now: Any, at: str = "") -> Iterator[str]:
    """Where two JSON contents differ, one line each."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys((*before, *now)):
            yield from differences(before.get(key), now.get(key), f"{at}.{key}")
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for k, (old, new) in enumerate(zip(before, now, strict=True)):
            yield from differences(old, new, f"{at}[{k}]")
    elif isinstance(before, float | int) and isinstance(now, float | int):
        if not math.isclose(before, now, rel_tol=TOLERANCE, abs_tol=1e-12):
            yield f"{at}: {before!r} -> {now!r}"
    elif before != now:
        yield f"{at}: {before!r} -> {now!r}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--write", action="store_true", help="store what is made: the rows chosen by --only, and no label that is gone"
    )
    parser.add_argument("--only", default="", help="labels that contain this")
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    wanted = [job for job in jobs() if chosen.only in job[1][0]]
    rows = []
    known = {row["label"]: row for row in map(json.loads, FILE.read_text(encoding="utf-8").splitlines())}
    moved = 0
    for row in Parallel(n_jobs=chosen.jobs, return_as="generator")(wanted):
        rows.append(row)
        said = row.get("refused") or f"{row.get('verdict', row.get('status'))} {' '.join(row.get('effects', []))}"
        found = list(differences(known.get(row["label"]), row))
        moved += bool(found)
        print(f"{row['label']}: {said}", *(line[:150] for line in found[:12]), sep="\n    ", flush=True)
    print(f"{len(rows)} compared, {moved} differ")
    if not chosen.write:
        return int(moved > 0)
    known |= {row["label"]: row for row in rows}
    kept = [known[job[1][0]] for job in jobs() if job[1][0] in known]
    FILE.write_text("".join(json.dumps(row) + "\n" for row in kept), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
