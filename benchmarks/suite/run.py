"""Run methods over the numbered cases: python benchmarks/suite/run.py [--methods A.py B.py]
[--cases 1-20] [--seed 0] [--cores 2] [--out FOLDER] [--track sqlite:///mlflow.db]

A method is a file with `fit(events)` and `predict(model, event)`, and `name(model)` if it says what
is missing (README.md beside this file). By default all of `methods/` run over all cases. Written
are `suite.json`, a row a method and case, and the page `suite.html`; with `--track` each method is
a run in MLflow, too. Nothing of an unused dip
reaches a method but its voltage, its frequency and the power before it.
"""

import argparse
import importlib.util
import json
import os
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import numpy as np  # noqa: E402
from cases import MADE, RECORDS, Event, SuiteCase, make_cases  # noqa: E402
from joblib import Parallel, delayed  # noqa: E402
from page import measure, write_page  # noqa: E402

METHODS = HERE / "methods"


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
    row |= {"truth": None if case.truth is None else list(case.truth)}
    begun = time.process_time()
    try:
        method = read_method(path)
        model = method.fit(list(case.fitted))
        row["seconds"] = time.process_time() - begun
        row["named"] = sorted(method.name(model)) if hasattr(method, "name") else None
    except Exception as error:  # a method of others may raise anything
        return row | {"failed": describe_error(error)}
    return row | {"dips": [judge_dip(method, model, event) for event in case.unused]}


def judge_dip(method: ModuleType, model: Any, event: Event) -> dict[str, Any]:
    """The error of an unused dip in S, a share of the response from the dip on, and whether the
    band of P and of Q held its worst sample (None without a band).
    """
    try:
        P, Q, *band = method.predict(model, event.hide())
        left = np.stack([np.subtract(P, event.P), np.subtract(Q, event.Q)])[:, event.start :]
    except Exception as error:
        return {"error": None, "held": None, "failed": describe_error(error)}
    response = (event.P + 1j * event.Q - event.power_before)[event.start :]
    known = np.isfinite(response)
    left = left[:, known]
    error = float(np.linalg.norm(left) / np.linalg.norm(response[known]))
    held = None
    if band and band[0] is not None:
        held = (np.abs(left).max(axis=1) <= np.asarray(band[0], dtype=float)).tolist()
    return {"error": error if np.isfinite(error) else None, "held": held}


def describe_error(error: Exception) -> str:
    """The kind of an error, what it says, and the line of the method that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{type(error).__name__}: {error} (line {frames[-1].lineno} of {frames[-1].name})"


def read_numbers(text: str) -> list[int]:
    """ "1-20,51" as numbers. Raises `ValueError` for what is none."""
    numbers: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        numbers += range(int(first), int(last or first) + 1)
    if wrong := [n for n in numbers if n not in MADE and n not in RECORDS]:
        raise ValueError(f"there is no case {wrong[0]}; there are 1 to {RECORDS[-1]}")
    return numbers


def run_suite(
    methods: Sequence[Path], numbers: Sequence[int], seed: int, cores: int
) -> list[dict[str, Any]]:
    """A row for each method and case."""
    for path in methods:
        read_method(path)  # what is no method is told before anything runs
    cases = list(make_cases(numbers, seed))
    if absent := sorted(set(numbers) - {case.number for case in cases}):
        print(f"left out, for their files are not here: cases {', '.join(map(str, absent))}")
    jobs = [delayed(run_method)(path, case) for case in cases for path in methods]
    rows = Parallel(n_jobs=cores, verbose=1)(jobs)
    return list(rows)


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
    parser.add_argument("--out", type=Path, default=Path("suite"))
    parser.add_argument("--track", help="address of an MLflow store")
    asked = parser.parse_args(words)
    methods = [path.resolve() for path in asked.methods]
    rows = run_suite(methods, asked.cases, asked.seed, asked.cores)
    asked.out.mkdir(parents=True, exist_ok=True)
    content = {"seed": asked.seed, "rows": rows}
    (asked.out / "suite.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(write_page(rows, asked.seed, asked.out / "suite.html"))
    if asked.track:
        log_rows(rows, asked.seed, asked.track)


if __name__ == "__main__":
    main()
