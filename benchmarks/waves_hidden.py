"""Are effects hidden in waveforms named, and nothing where nothing is? python benchmarks/waves_hidden.py [--count 2]

Loads of `wave_records` with one thing more, by laws of `independent.circuit`: two dips each, one held out, investigated
as a user does it with `domain="waves"`. Rows are appended to a file, so that a study goes on where it stopped; --store
writes what was named beside this file. Nothing is calibrated on these seeds.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import wave_records as waves  # noqa: E402

from independent import Machine, Stall  # noqa: E402
from independent.circuit import Core, Earthed, Group, Shunt, Switched  # noqa: E402
from independent.sampler import CurrentTransformer  # noqa: E402

STORED = Path(__file__).with_suffix(".json")
SERIES = 3
MODEL = "fifth_order_branch"
NULL = "nothing"


def _fan(case: waves.Case) -> waves.Case:
    return replace(case, site=replace(case.site, group=replace(case.site.group, fan=1.0)))


def _saturation(case: waves.Case) -> waves.Case:
    return replace(case, site=replace(case.site, group=replace(case.site.group, saturation=0.8)))


def _second(case: waves.Case) -> waves.Case:
    second = Group(Machine(Rs=0.03, Xs=0.09, Xm=2.6, Rr=0.05, Xr=0.09, H=0.15), 0.4, 0.6)
    return replace(case, site=replace(case.site, more=(second,)))


def _capacitor(case: waves.Case) -> waves.Case:
    return replace(case, site=replace(case.site, more=(Shunt(B=0.3),)))


def _core(case: waves.Case) -> waves.Case:
    return replace(case, site=replace(case.site, more=(Core(knee=1.15, X=0.6, R=0.02),)))


def _earthed(case: waves.Case) -> waves.Case:
    faults = tuple(replace(f, delta=False) for f in case.faults)
    return replace(case, faults=faults, site=replace(case.site, more=(Earthed(R=0.2, X=1.0),)))


def _trip(case: waves.Case) -> waves.Case:
    """Half of the conductance opens 35 ms after the dip's start and comes back after 0.25 s."""
    at = case.faults[0].start  # every dip of a case starts at the same time, as relays must know
    more = Switched(Shunt(G=0.4), 1.0, at + 0.035, at + 0.25)
    return replace(case, faults=tuple(replace(f, start=at) for f in case.faults), site=replace(case.site, more=(more,)))


def _transformer(case: waves.Case) -> waves.Case:
    return replace(case, sampler=replace(case.sampler, transformer=CurrentTransformer(knee=2.5)))


HIDDEN: dict[str, Callable[[waves.Case], waves.Case]] = {
    NULL: lambda case: case,
    "second_motor_group": _second,
    "shunt_capacitor": _capacitor,
    "zero_sequence_path": _earthed,
    "speed_dependent_torque": _fan,
    "transformer_saturation": _core,
    "undervoltage_trip": _trip,
    "magnetic_saturation": _saturation,
    "current_transformer_saturation": _transformer,
}


def events(name: str, seed: Sequence[int], rate: float = 3200.0):
    """Two dips of a load with something hidden: the first two of a draw, of two and three phases, at one rate."""
    from tractexp.errors import UserError

    for attempt in range(50):
        case = waves.case([*seed, attempt], dips=2)
        rng = np.random.default_rng([*seed, attempt, 9])
        kinds = ("phase to earth", "three phases") if name == "zero_sequence_path" else waves.KINDS[1:]
        faults = tuple(waves.fault(rng, kind)[0] for kind in kinds)
        sampler = replace(case.sampler, rate=rate, bits=16)
        made = HIDDEN[name](replace(case, faults=faults, sampler=sampler))
        try:
            return made, waves.events(made, [*seed, attempt])
        except (Stall, UserError):
            continue
    raise RuntimeError(f"nothing can be drawn from seed {list(seed)}")


def run(name: str, seed: int, only: Sequence[str] = ()) -> dict:
    """One investigation. What fails is a row with its message."""
    import tractexp
    from tractexp.errors import UserError

    row = {"hidden": name, "seed": seed}
    clock = time.perf_counter()
    try:
        _, dips = events(name, [SERIES, seed])
        clock = time.perf_counter()
        chosen = {"effects": [*only]} if only else {}
        found = tractexp.investigate(
            dips[:1], validate=dips[1:], model=MODEL, domain="waves", progress=False, **chosen
        )  # fmt: skip
        row |= {"verdict": str(found.verdict), "names": list(found.names)}
        row["gap"] = json.loads(json.dumps(found.gap, default=lambda x: getattr(x, "__dict__", str(x))))
    except (UserError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        row["failed"] = f"{type(error).__name__}: {error}"
    return row | {"seconds": time.perf_counter() - clock}


def summary(rows: list[dict]) -> dict:
    """What was said of each kind of load."""
    told = {}
    for name in HIDDEN:
        mine = [r for r in rows if r["hidden"] == name]
        said = [r.get("failed") or f"{r['verdict']}: {', '.join(r['names']) or '-'}" for r in mine]
        right = [("failed" not in r) and (name in r["names"] if name != NULL else not r["names"]) for r in mine]
        told[name] = {"investigated": len(mine), "right": sum(right), "said": said}
    done = [r for r in rows if "failed" not in r]
    return {"loads": told, "median_seconds": float(np.median([r["seconds"] for r in done])) if done else None}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=2, help="data sets of each")
    parser.add_argument("--names", nargs="+", default=list(HIDDEN), choices=list(HIDDEN))
    parser.add_argument("--out", type=Path, default=Path("waves_hidden.jsonl"))
    parser.add_argument("--store", action="store_true", help=f"write the summary into {STORED.name}")
    chosen = parser.parse_args()
    rows = [json.loads(line) for line in chosen.out.read_text().splitlines()] if chosen.out.exists() else []
    done = {(r["hidden"], r["seed"]) for r in rows}
    with chosen.out.open("a") as file:
        for seed in range(chosen.count):
            for name in chosen.names:
                if (name, seed) in done:
                    continue
                rows.append(run(name, seed))
                file.write(json.dumps(rows[-1]) + "\n")
                file.flush()
                told = {k: v for k, v in rows[-1].items() if k != "gap"}
                print(told, file=sys.stderr, flush=True)
    print(json.dumps(summary(rows), indent=1))
    if chosen.store:
        STORED.write_text(json.dumps(summary(rows), indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
