"""Which optimizer to take: all of them at equal simulations, on records and on BBOB. See
docs/optimizers.md.

    python benchmarks/optimizers.py --series choice
        # problems on which settings and ideas may be chosen
    python benchmarks/optimizers.py --series final
        # others, looked at once, after everything is chosen
    python benchmarks/optimizers.py --series readings
        # the readings of the paper, on the shipped records
    python benchmarks/optimizers.py --docs
        # write docs/optimizers.md's tables from the stored result

A problem is a record of a random load (`drawn_records`) or a function of BBOB; the series share no
record, no instance and no seed. A search that ends by itself is started again from new random
numbers until its budget is spent, and all end where the floor is reached: within 0.01 % of the
lowest objective that a long multi-start knows, within 1e-8 on BBOB. The result is stored whole in
`benchmarks/optimizers.json`. Each problem is one task, whose runs do not depend on the others.
"""

import os

# the matrices are small, and the cores have tasks to do
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import platform
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import drawn_records
import numpy as np
import yaml

from tractexp.cache import provenance
from tractexp.configuration.plugin import build
from tractexp.identification.search import Limits, SearchResult, search
from tractexp.inference.problem import Problem
from tractexp.storage import files
from tractexp.studies.bbob import runs as bbob
from tractexp.studies.comparison import floor
from tractexp.studies.comparison.runs import SearchRun

ROOT = Path(__file__).resolve().parents[1]
STORED = ROOT / "benchmarks" / "optimizers.json"
BUDGETS = (500, 2000, 15000)
AT_END = 1e-4  # of the floor: a search that is so near has nothing left to find
SOLVED = 1e-8  # distance to a BBOB function's optimum
LONG = {"name": "multistart_least_squares", "scatter": 3000, "starts": 60, "tolerance": 1e-12}
SHIPPED = ("tibet_50pct", "tibet_30pct", "tibet_65pct")
# need a sum of squares, which no BBOB function is
RESIDUALS = ("multistart_least_squares", "issa_polish")
ALL = (
    "random_search",
    "ssa",
    "issa",
    "covariant_sparrow",
    "pso",
    "differential_evolution",
    "cmaes",
    "cobyqa",
    *RESIDUALS,
)
ABLATED = (
    "issa_no_tent_init",
    "issa_no_levy",
    "issa_no_gaussian",
    "issa_no_tent_perturbation",
    "issa_by_stage",
)
# which no choice was about, and which takes longest
TRIED = tuple(o for o in (*ALL, *ABLATED) if o != "cobyqa")
READINGS = ("", "_10_perceivers", "_scalar", "_raw", "_raw_scalar", "_to_the_letter")


@dataclass(frozen=True)
class Series:
    """Which problems, seeds and optimizers. `key` opens the seed of every random number in it."""

    key: int
    records: int  # drawn
    shipped: tuple[str, ...]
    seeds: int  # on each record
    instances: tuple[int, ...]  # of each BBOB function
    dimensions: tuple[int, ...]
    optimizers: tuple[str, ...]
    budgets: tuple[int, ...] = BUDGETS
    left_out: Mapping[str, str] = field(default_factory=dict)  # {"optimizer bbob budget": why}

    def problems(self) -> list[str]:
        """Names: "record 3", "tibet_50pct", "f7 d5"."""
        made = [f"record {k}" for k in range(self.records)]
        functions = bbob.FUNCTIONS if self.instances else ()
        return [*self.shipped, *made, *(f"f{f} d{d}" for d in self.dimensions for f in functions)]


SLOW = {"cobyqa bbob 15000": "a millisecond per evaluation"}
SERIES = {
    "choice": Series(161, 12, (), 4, (11, 12), (5, 7), TRIED),
    "final": Series(162, 12, SHIPPED, 4, (1, 2), (5, 7), ALL, left_out=SLOW),
    "readings": Series(
        163,
        0,
        SHIPPED,
        10,
        (),
        (),
        (
            *(f"{name}{r}" for r in READINGS for name in ("ssa", "issa")),
            "issa_by_stage",
            "issa_printed_levy",
        ),
        (15000,),
    ),
}


def settings(name: str) -> dict[str, Any]:
    """The settings of an optimizer or of a variant with a YAML of its own."""
    path = ROOT / "conf" / "optimizer" / f"{name}.yaml"
    if not path.is_file():
        return {"name": name}
    chosen = yaml.safe_load(path.read_text(encoding="utf-8"))
    return {"name": chosen.pop("defaults")[0], **chosen}


@dataclass(frozen=True)
class Ended:
    """Where one optimizer's searches of one budget ended."""

    objective: float
    values: np.ndarray
    simulations: int
    seconds: float


def restarted(
    problem: Any, optimizer: Any, seeds: Sequence[int], budget: int, target: float
) -> Ended:
    """Search, and search again from new random numbers, until the budget is spent or the target
    reached.
    """
    spent, seconds, best = 0, 0.0, None
    while spent < budget and (best is None or best.objective > target):
        found: SearchResult = search(
            problem,
            optimizer,
            bbob.compute_seed(*seeds, spent),
            Limits(budget - spent, target=target),
        )
        spent, seconds = spent + found.simulations, seconds + found.seconds
        if best is None or found.objective < best.objective:
            best = found
    assert best is not None
    return Ended(best.objective, best.values, spent, seconds)


def on_record(series: Series, name: str) -> dict[str, Any]:
    """Every optimizer on one record: excess over the floor, right valley or not, simulations and
    seconds.
    """
    if name in SHIPPED:
        problem, number = (
            drawn_records.problem(drawn_records.shipped(name)),
            1000 + SHIPPED.index(name),
        )
    else:
        number = int(name.split()[1])
        problem = drawn_records.problem(drawn_records.drawn((series.key, number))[0])
    long = search(problem, build("optimizer", LONG), series.key)
    target = (1 + AT_END) * long.objective
    ended = {
        (optimizer, budget): [
            restarted(
                problem,
                build("optimizer", settings(optimizer)),
                (series.key, number, s),
                budget,
                target,
            )
            for s in range(series.seeds)
        ]
        for optimizer in series.optimizers
        for budget in series.budgets
    }
    runs = {
        key: [_run(problem, key, s, run) for s, run in enumerate(group)]
        for key, group in ended.items()
    }
    polished = floor.polish(
        problem, [run for group in runs.values() for run in group], lambda n: lambda: None
    )
    assert polished is not None
    lowest = min(
        long.objective,
        polished.objective,
        *(run.objective for group in ended.values() for run in group),
    )
    return {
        "kind": "record",
        "floor": lowest,
        "runs": {
            f"{optimizer} {budget}": {
                **_told(group, [run.objective / lowest - 1 for run in group]),
                "valley": [
                    int(polished.reached[run] <= (1 + floor.FLOOR_SHARE) * lowest)
                    for run in runs[key]
                ],
            }
            for key, group in ended.items()
            for optimizer, budget in [key]
        },
    }


def _run(problem: Problem, key: tuple[str, int], seed: int, ended: Ended) -> SearchRun:
    values = dict(zip(problem.space.names, map(float, ended.values), strict=True))
    return SearchRun(f"{key[0]} {key[1]}", "", seed, {}, "", ended.objective, parameters=values)


def on_function(series: Series, name: str) -> dict[str, Any]:
    """Every optimizer on the instances of one function of BBOB: distance to the optimum,
    simulations and seconds.
    """
    function, dimension = (int(part[1:]) for part in name.split())
    runs = {}
    for optimizer in series.optimizers:
        for budget in series.budgets:
            if optimizer in RESIDUALS or f"{optimizer} bbob {budget}" in series.left_out:
                continue
            problems = [bbob.Bbob(function, dimension, i, [SOLVED]) for i in series.instances]
            group = [
                restarted(
                    p,
                    build("optimizer", settings(optimizer)),
                    (series.key, function, dimension, i),
                    budget,
                    p.optimum + SOLVED,
                )
                for p, i in zip(problems, series.instances, strict=True)
            ]
            runs[f"{optimizer} {budget}"] = _told(group, [p.best - p.optimum for p in problems])
    return {"kind": "bbob", "runs": runs}


def _told(group: Sequence[Ended], excess: Sequence[float]) -> dict[str, Any]:
    return {
        "excess": [float(f"{max(e, 0.0):.4g}") for e in excess],
        "simulations": [run.simulations for run in group],
        "seconds": float(f"{sum(run.seconds for run in group):.3g}"),
    }


def run(series: Series, name: str) -> tuple[str, dict[str, Any]]:
    """All runs on one problem."""
    return name, (on_function if name[0] == "f" else on_record)(series, name)


def perform(name: str, processes: int, only: Sequence[str] = ()) -> dict[str, Any]:
    """All runs of a series."""
    from joblib import Parallel, delayed

    series, commit, started = SERIES[name], provenance.find_commit(), time.time()
    done: Any = Parallel(n_jobs=processes, verbose=5)(
        delayed(run)(series, problem)
        for problem in series.problems()
        if not only or problem in only
    )
    return {
        "commit": commit,
        "versions": {p: version(p) for p in ("tractexp", "numpy", "scipy", "cma", "ioh")},
        "python": platform.python_version(),
        "plan": vars(series),
        "settings": {optimizer: settings(optimizer) for optimizer in series.optimizers},
        "wall_seconds": round(time.time() - started),
        "problems": dict(done),
    }


def store(name: str, result: Mapping[str, Any], path: Path = STORED) -> None:
    """Put a series into the stored result, a problem on each line."""
    kept = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    kept[name] = files.make_plain(result)
    files.write(path, _text(kept))


def _text(kept: Mapping[str, Any]) -> str:
    """JSON with a line for each problem."""
    blocks = []
    for name, series in sorted(kept.items()):
        head = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in series.items() if k != "problems"]
        lines = [f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in series["problems"].items()]
        body = ",\n ".join([*head, '"problems": {\n' + ",\n".join(lines) + "\n }"])
        blocks.append(f"{json.dumps(name)}: {{\n {body}\n}}")
    return "{\n" + ",\n".join(blocks) + "\n}\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--series", choices=SERIES, help="run it and put it into the stored result")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument(
        "--docs", action="store_true", help="write the tables of docs/optimizers.md"
    )
    given = parser.parse_args()
    if given.series:
        store(given.series, perform(given.series, given.processes))
    if given.docs:
        from optimizers_tables import DOCS, filled

        files.write(
            DOCS,
            filled(
                DOCS.read_text(encoding="utf-8"), json.loads(STORED.read_text(encoding="utf-8"))
            ),
        )


if __name__ == "__main__":
    main()
