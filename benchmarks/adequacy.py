"""Are the grades right, and the intervals where the first grade is given? python benchmarks/adequacy.py [--count 8]

Records come from the independent generator (`hidden_effects`): nothing missing under each of its kinds of noise, and
one effect missing, of the catalogue or outside it, at four and eight times its detection limit. Each set is read,
searched and judged as `task=identify` does it, all its events fitted. A grade is right where it is `adequate` if and
only if nothing is missing. Rows are appended to a file, so that a study goes on where it stopped. The seeds of
`--series calibration`, on which thresholds may be looked at, are not those of the series that is reported.
"""

import argparse
import itertools
import json
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import oracle  # noqa: E402, F401

from hidden_effects import cases  # noqa: E402
from hidden_effects.effects import CATALOG  # noqa: E402
from hidden_effects.generator import Case, make, truth  # noqa: E402
from hidden_effects.outside import OUTSIDE  # noqa: E402

MULTIPLES = (4.0, 8.0)
LEAST = 2.0  # detection limits: effects that physics keeps smaller than this are not counted as missing


def tasks(series: str, count: int, events: int) -> Iterator[tuple[str, str, float, int, int]]:
    """(kind, name, multiple, seed, events) of every data set."""
    for noise in cases.NOISES:
        label = f"adequacy {series} null {noise}"
        yield from (("null", noise, 0.0, s, events) for s in itertools.islice(cases.seeds(label), count))
    for multiple, name in itertools.product(MULTIPLES, (*CATALOG, *OUTSIDE)):
        label = f"adequacy {series} {name} {multiple:g}"
        some = max(1, round(count / 4))
        yield from (("effect", name, multiple, s, events) for s in itertools.islice(cases.seeds(label), some))


def run(task: tuple[str, str, float, int, int]) -> dict:
    """One data set identified. What fails is a row with its message."""
    import tractexp
    from tractexp.errors import UserError
    from tractexp.record import Record, detect

    kind, name, multiple, seed, events = task
    row = {"kind": kind, "name": name, "multiple": multiple, "seed": seed, "events": events}
    started = time.perf_counter()
    try:
        if kind == "null":
            case = Case(noise=cases.NOISES[name], events=events)
        else:
            trial = cases.at_limit((name,), multiple, seed, events=events)
            case, row["multiple"] = trial.case, trial.multiples[0]
        dips = [detect(Record(f"event{k + 1}", **r, source=f"{k}").check()) for k, r in enumerate(make(case, seed))]
        row["made"] = time.perf_counter() - started
        fit = tractexp.identify(dips, model="third_order_exponential", optimizer="pso", budget=5000, progress=False)
        row |= {"grade": fit.grade, "p": fit.result.adequacy["p"], "loudest": fit.judged.estimated.surprise.loudest}
        row["epsilon"] = [fit.result.epsilon_p, fit.result.epsilon_q]
        row["inside"], row["z"], row["wide"] = {}, {}, {}
        for parameter, true in truth(case, seed)["load"].items():
            low, high = fit.result.intervals[parameter]
            error = fit.result.standard_errors[parameter]
            row["inside"][parameter] = bool(low <= true <= high)
            row["z"][parameter] = (fit.result.parameters[parameter] - true) / error if error else None
            row["wide"][parameter] = (high - low) / 2 / true
    except (UserError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        row["failed"] = f"{type(error).__name__}: {error}"
    return row | {"seconds": time.perf_counter() - started}


def told(rows: list[dict]) -> str:
    """The tables."""
    done = [r for r in rows if "failed" not in r]
    nulls = [r for r in done if r["kind"] == "null"]
    effects = [r for r in done if r["kind"] == "effect" and r["multiple"] >= LEAST]
    right = [(r["grade"] == "adequate") == (r["kind"] == "null") for r in (*nulls, *effects)]
    lines = [f"{len(rows)} data sets, {len(rows) - len(done)} failed, {len(right)} judged",
             f"grade right: {sum(right)} of {len(right)} ({np.mean(right):.1%})"]  # fmt: skip
    for label, some in (("nothing missing", nulls), ("an effect missing", effects)):
        good = [(r["grade"] == "adequate") == (r["kind"] == "null") for r in some]
        lines.append(f"  {label}: {sum(good)} of {len(good)}")
    first = [r for r in (*nulls, *effects) if r["grade"] == "adequate"]
    inside = np.array([list(r["inside"].values()) for r in first])
    if len(first):
        lines.append(f"coverage where adequate: {inside.mean():.1%} of {inside.size}")
        names = list(first[0]["inside"])
        lines.append("  " + ", ".join(f"{n} {x:.1%}" for n, x in zip(names, inside.mean(axis=0), strict=True)))
    for group, some in itertools.groupby(sorted(nulls, key=lambda r: r["name"]), key=lambda r: r["name"]):
        some = list(some)
        covered = np.mean([list(r["inside"].values()) for r in some])
        grades = sum(r["grade"] == "adequate" for r in some)
        lines.append(f"  {group}: adequate {grades} of {len(some)}, coverage {covered:.1%}, least p "
                     f"{min(r['p'] if r['p'] is not None else 1 for r in some):.2g}")  # fmt: skip
    wrong = [r for r in effects if r["grade"] == "adequate"]
    lines += [f"  missed: {r['name']} at {r['multiple']:.1f} limits, seed {r['seed']}, p {r['p']:.2g}" for r in wrong]
    lines += [f"  failed: {r['name']} {r['seed']}: {r['failed'][:120]}" for r in rows if "failed" in r]
    lines.append(f"median seconds: {np.median([r['seconds'] for r in rows]):.2f}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=8, help="data sets of each noise, and a quarter of each effect")
    parser.add_argument("--events", type=int, default=3)
    parser.add_argument("--series", default="reported")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("adequacy.jsonl"))
    chosen = parser.parse_args()
    kept = [json.loads(line) for line in chosen.out.read_text().splitlines()] if chosen.out.exists() else []
    done = {(r["kind"], r["name"], r["seed"], r["events"]) for r in kept}
    wanted = [t for t in tasks(chosen.series, chosen.count, chosen.events) if (t[0], t[1], t[3], t[4]) not in done]
    with ProcessPoolExecutor(chosen.jobs) as pool, chosen.out.open("a") as out:
        for k, row in enumerate(pool.map(run, wanted), start=1):
            kept.append(row)
            out.write(json.dumps(row) + "\n")
            out.flush()
            print(f"\r{k} of {len(wanted)}", end="", file=sys.stderr, flush=True)
    print(told(kept))
    return 0


if __name__ == "__main__":
    sys.exit(main())
