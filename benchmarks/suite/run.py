"""Run methods over the numbered cases: python benchmarks/suite/run.py [--methods A.py B.py]
[--cases 1-20] [--seed 0] [--cores 2] [--minutes 9] [--out FOLDER] [--track sqlite:///mlflow.db]

A method is a file with `fit(events)` and `predict(model, event)`, and `name(model)` if it says what
is missing (README.md beside this file). By default all of `methods/` run over all cases. Written
are `suite.jsonl`, a row a method and case, and the page `suite.html`; with `--track` each method is
a run in MLflow, too. Repeat the command to go on where it stopped: what a changed method's file
said before is not kept. Nothing of an unused dip reaches a method but its voltage, its frequency
and the power before it.
"""

import argparse
import hashlib
import importlib.util
import itertools
import json
import os
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import numpy as np  # noqa: E402
from cases import MADE, RECIPES, RECORDS, SHARED, Event, SuiteCase, make_cases  # noqa: E402,F401
from joblib import Parallel, delayed  # noqa: E402
from page import measure, write_page  # noqa: E402

METHODS = HERE / "methods"
DRAWN = range(len(RECIPES) + 1, MADE[-1] + 1)  # the cases that follow a seed
Row = dict[str, Any]


def read_method(path: Path) -> ModuleType:
    """The module of a method's file. Raises SystemExit where it lacks one of its two functions."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise SystemExit(f"{path}: there is no such Python file; give the path of a method")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for function in ("fit", "predict"):
        if not callable(getattr(module, function, None)):
            raise SystemExit(f"{path}: a method needs a function {function}; see README.md")
    return module


def run_method(path: Path, case: SuiteCase) -> dict[str, Any]:
    """One method on one case: errors of the unused dips, whether its band held them, what it named,
    and the processor time of its fit. What it raises is a row, too.
    """
    row: dict[str, Any] = {"method": path.stem, "case": case.number}
    row |= {"truth": None if case.truth is None else list(case.truth), "inexact": case.inexact}
    begun = measure_spent_time()
    try:
        method = read_method(path)
        model = method.fit(list(case.fitted))
        row["seconds"] = measure_spent_time() - begun
        row["named"] = read_names(method, model)
    except Exception as error:  # a method of others may raise anything
        return row | {"failed": describe_error(error)}
    return row | {"dips": [judge_dip(method, model, event) for event in case.unused]}


def measure_spent_time() -> float:
    """Processor time [s] of this process and of those that it started and that have ended."""
    return sum(os.times()[:4])


def judge_dip(method: ModuleType, model: Any, event: Event) -> dict[str, Any]:
    """The error of an unused dip in S, a share of the response from the dip on, and whether the
    band of P and of Q held its worst sample (None without a band).
    """
    try:
        powers, band = read_powers(method.predict(model, event.hide()), len(event.P))
        left = (powers - np.stack([event.P, event.Q]))[:, event.start :]
    except Exception as error:
        return {"error": None, "held": None, "failed": describe_error(error)}
    response = (event.P + 1j * event.Q - event.power_before)[event.start :]
    known = np.isfinite(response)
    left = left[:, known]
    error = float(np.linalg.norm(left) / np.linalg.norm(response[known]))
    held = None
    if band is not None:
        held = (np.abs(left).max(axis=1) <= np.asarray(band, dtype=float)).tolist()
    return {"error": error if np.isfinite(error) else None, "held": held}


def read_names(method: ModuleType, model: Any) -> list[list[str]] | None:
    """Sets of effects that a method names as missing; None where it says nothing of that.

    Raises `TypeError` for what is no list of lists of names.
    """
    if not hasattr(method, "name"):
        return None
    sets = method.name(model)
    well_formed = not isinstance(sets, str) and all(
        not isinstance(names, str) and all(isinstance(name, str) for name in names)
        for names in sets
    )
    if not well_formed:
        raise TypeError(
            f"name() returned {sets!r}, but must return lists of names, such as [['a']]"
        )
    return sort_sets(sets)


def read_powers(given: Any, samples: int) -> tuple[np.ndarray, Any]:
    """P and Q (2, samples) that a method predicts, and its band, None without one.

    Raises `TypeError` for what is none.
    """
    if not isinstance(given, tuple | list) or len(given) not in (2, 3):
        raise TypeError(f"predict() returned {type(given).__name__}, but must return P, Q[, band]")
    powers = np.array([np.asarray(one, dtype=float) for one in given[:2]])
    if powers.shape != (2, samples):
        raise TypeError(f"predict() returned {len(powers[0])} samples, but the event has {samples}")
    return powers, given[2] if len(given) == 3 else None


def sort_sets(sets: Sequence[Sequence[str]]) -> list[list[str]]:
    """Sets of effects, of which one is said to be missing, as they are compared."""
    return sorted(sorted(names) for names in sets)


def describe_error(error: Exception) -> str:
    """The kind of an error, what it says, and the line of the method that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{type(error).__name__}: {error} (line {frames[-1].lineno} of {frames[-1].name})"


def read_numbers(text: str) -> list[int]:
    """ "1-20,51" as numbers. Raises `argparse.ArgumentTypeError` for what is none."""
    numbers: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        if not (first.isdecimal() and (last or first).isdecimal()):
            raise argparse.ArgumentTypeError(f"'{part}' is no case; give numbers, such as 1-20,51")
        numbers += range(int(first), int(last or first) + 1)
    if wrong := [n for n in numbers if n not in MADE and n not in RECORDS]:
        raise argparse.ArgumentTypeError(
            f"there is no case {wrong[0]}; there are 1 to {RECORDS[-1]}"
        )
    return numbers


def run_suite(
    methods: Sequence[Path], numbers: Sequence[int], seed: int, kept: Sequence[Row] = ()
) -> Iterator[Any]:
    """Jobs, one a case, that give the rows of the methods which have none among those kept."""
    for path in methods:
        read_method(path)  # what is no method is told before anything runs
    done = {(row["file"], row["case"], row["seed"]) for row in kept}
    for number in numbers:
        own = seed if number in DRAWN else None
        left = [path for path in methods if (digest(path), number, own) not in done]
        if left:
            yield delayed(run_case)(number, own, left)


def run_case(number: int, seed: int | None, methods: Sequence[Path]) -> list[Row]:
    """A row for each method on one case; none where the files of a record are not there."""
    about = {"seed": seed}
    return [
        run_method(path, case) | about | {"file": digest(path)}
        for case in make_cases([number], seed or 0)
        for path in methods
    ]


def digest(path: Path) -> str:
    """What a method's file holds, in short: of another content its rows are others."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:12]


def read_rows(path: Path) -> list[Row]:
    """The rows kept in a file, none where there is none."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def collect_rows(
    path: Path, methods: Sequence[Path], numbers: Sequence[int], seed: int, cores: int, end: float
) -> list[Row]:
    """The rows of methods and cases: those kept in a file, and those still to be run until a
    time `end` [s], which are added to it.
    """
    kept = read_rows(path)
    jobs = run_suite(methods, numbers, seed, kept)
    in_time = itertools.takewhile(lambda job: time.monotonic() < end, jobs)
    parallel = Parallel(n_jobs=cores, pre_dispatch=cores, return_as="generator_unordered")
    with path.open("a", encoding="utf-8") as file:
        for rows in parallel(in_time):
            kept += rows
            file.writelines(json.dumps(row) + "\n" for row in rows)
            file.flush()
            if rows:
                spent = sum(row.get("seconds", 0.0) for row in rows)
                print(f"case {rows[0]['case']}: {spent:.0f} s", flush=True)
            for row in rows:
                for why in list_failures(row):
                    print(f"  {row['method']}: {why}", flush=True)
    wanted = {
        (digest(one), number, seed if number in DRAWN else None)
        for one in methods
        for number in numbers
    }
    return [row for row in kept if (row["file"], row["case"], row["seed"]) in wanted]


def list_failures(row: Row) -> list[str]:
    """Why a method has no prediction of a case: what its fit or its predictions raised."""
    dips = [dip["failed"] for dip in row.get("dips", ()) if "failed" in dip]
    return list(dict.fromkeys([*([row["failed"]] if "failed" in row else []), *dips]))


def log_rows(rows: Sequence[dict[str, Any]], seed: int, uri: str) -> None:
    """A run in MLflow for each method, with what it reached as metrics."""
    from tractexp import tracking
    from tractexp.tracking import TrackedRun

    for method in sorted({row["method"] for row in rows}):
        own = [row for row in rows if row["method"] == method]
        metrics = {key: value for key, value in measure(own).items() if np.isfinite(value)}
        cases = [row["case"] for row in own]
        parameters = {"method": method, "seed": seed, "cases": str(cases)}
        tracking.log(TrackedRun("suite", method, parameters=parameters, metrics=metrics), uri)


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--methods", nargs="*", type=Path, default=sorted(METHODS.glob("*.py")))
    parser.add_argument("--cases", type=read_numbers, default=[*MADE, *RECORDS])
    parser.add_argument("--seed", type=int, default=0, help="of cases 21 to 50")
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no further case after")
    parser.add_argument("--out", type=Path, default=Path("suite"))
    parser.add_argument("--track", help="address of an MLflow store")
    asked = parser.parse_args(words)
    methods = [path.resolve() for path in asked.methods]
    asked.out.mkdir(parents=True, exist_ok=True)
    end = time.monotonic() + 60 * asked.minutes
    store = asked.out / "suite.jsonl"
    rows = collect_rows(store, methods, asked.cases, asked.seed, asked.cores, end)
    if absent := sorted(set(asked.cases) - {row["case"] for row in rows}):
        left = ", ".join(map(str, absent))
        print(f"without rows, for their files are not here or time was up: cases {left}")
    if rows:
        print(write_page(rows, asked.out / "suite.html"))
    if rows and asked.track:
        log_rows(rows, asked.seed, asked.track)


if __name__ == "__main__":
    main()
