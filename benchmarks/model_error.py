"""Is the estimate good where the model is not exact? python benchmarks/model_error.py --only andes
--count 40

Each data set is identified by the public call, some events fitted and others held out, and judged
against what is known of it: `andes` sets of `andes_loads` by two models (of a double cage by one
that lacks it); `null` and `effect` from the generator `hidden_effects`, nothing missing or one
effect at multiples of its detection limit, three events, one held out; `record`, those at hand,
real ones and shipped ones, whose truth is not known. Stored for each: estimate, intervals and
errors, where the search ended, Eq. (8) of both, and the error in S: rms of calculated less measured
power over the rms of how far it moved from what it was before, from the dip's start on, of each
event at both. Rows are appended to a file, so that a study goes on where it stopped; `--tables`
prints what is stored. Thresholds may be looked at on the series `calibration`; its seeds are never
those of the series `final`, which is reported.
"""

import argparse
import itertools
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import andes_loads  # noqa: E402
import numpy as np  # noqa: E402
import oracle  # noqa: E402, F401
from andes_loads import StalledMotor  # noqa: E402
from model_error_tables import shift_lines, tables  # noqa: E402

from hidden_effects import cases  # noqa: E402
from hidden_effects.effects import CATALOG  # noqa: E402
from hidden_effects.generator import Case, make, truth  # noqa: E402
from hidden_effects.outside import OUTSIDE  # noqa: E402

SHARED = Path(os.environ.get("TRACTEXP_SHARED", Path(__file__).parents[2] / "shared"))
KINDS = ("record", "andes", "null", "effect")
EXPONENTIAL, ZIP = "third_order_exponential", "third_order_zip"
MULTIPLES = (1.0, 2.0, 4.0, 8.0)
EVENTS, TRAIN = 3, 2  # of a generated data set
# s, s: residuals of a block are one observation, fewer than ten are no sample
BLOCK, CYCLE, BLOCKS = 0.1, 0.02, 10


@dataclass(frozen=True)
class Data:
    """Events to fit and to hold out, the truth where it is known, and what a row says of them
    beside.
    """

    train: Sequence[Any]
    validate: Sequence[Any]
    truth: dict[str, float]
    about: dict[str, Any]
    domain: str | None = None


@dataclass(frozen=True)
class Task:
    """One identification. `name` and `seed` say of which data set; `multiple` is of the detection
    limit.
    """

    kind: str
    name: str
    model: str
    seed: int = 0
    multiple: float = 0.0
    series: str = ""

    @property
    def key(self) -> str:
        return f"{self.series}|{self.kind}|{self.name}|{self.model}|{self.multiple:g}|{self.seed}"


def tasks(
    series: str, count: int, multiples: Sequence[float], models: Sequence[str]
) -> Iterator[Task]:
    """Every identification of a series: `count` ANDES sets, nulls, and data sets of each effect at
    each multiple.
    """
    for name, model in itertools.product(RECORDS, models):
        if model == EXPONENTIAL or name.startswith("andes"):
            yield Task("record", name, model)
    for number, model in itertools.product(range(count), models):
        yield Task("andes", "set", model, number, series=series)
    noises = itertools.islice(itertools.cycle(cases.NOISES), count)
    seeds = {noise: cases.seeds(f"model error {series} null {noise}") for noise in cases.NOISES}
    yield from (
        Task("null", noise, EXPONENTIAL, next(seeds[noise]), series=series) for noise in noises
    )
    for multiple, name in itertools.product(multiples, (*CATALOG, *OUTSIDE)):
        some = itertools.islice(cases.seeds(f"model error {series} {name} {multiple:g}"), count)
        yield from (Task("effect", name, EXPONENTIAL, seed, multiple, series) for seed in some)


def data_of(task: Task, shared: Path = SHARED) -> Data:
    """The data set of a task; FileNotFoundError or UserError, with the reason, where it cannot be
    had.
    """
    if task.kind == "record":
        return RECORDS[task.name](shared)
    return andes_set(task) if task.kind == "andes" else generator_set(task)


def andes_set(task: Task) -> Data:
    """A load by ANDES; half of the sets have noise."""
    one = andes_loads.set_of(task.series, task.seed)
    rng = andes_loads.generator(task.series, task.seed, "noise")
    dips, level = one.dips, 0.0
    if rng.random() < 0.5:
        dips, level = andes_loads.noisy(dips, rng)
    events, k = andes_loads.events(dips, f"andes{task.seed} dip"), one.train
    about = {"motor": one.truth["kind"], "rate": one.truth["rate"], "noise": level}
    about |= {"R_s": one.truth["parameters"]["R_s"], "depths": one.truth["depths"], "train": k}
    values = one.truth["parameters"]
    return Data(events[:k], events[k:], values, about | {"floor": floor(values, events)})


def floor(values: dict[str, float], events: Sequence[Any]) -> float:
    """Error in S at the truth of the third order with its ZIP load: what sampling and stator
    resistance leave.
    """
    import tractexp

    model = tractexp.compose(ZIP)
    simulation = tractexp.simulate(
        model, {name: values[name] for name in model.parameters}, records=list(events)
    )
    squares = [Compared.of(e, r) for e, r in zip(events, simulation.responses, strict=True)]
    return overall(squares)


def generator_set(task: Task) -> Data:
    """Nothing missing under one of the generator's noises, or an effect at a multiple of its
    detection limit.
    """
    if task.kind == "null":
        return events_of(Case(noise=cases.NOISES[task.name], events=EVENTS), task.seed)
    trial = cases.at_limit((task.name,), task.multiple, task.seed, events=EVENTS)
    return events_of(trial.case, task.seed, trial.multiples[0])


def events_of(case: Case, seed: int, multiple: float = 0.0) -> Data:
    """The events of a case of the generator, the last one held out."""
    import tractexp

    events = [
        tractexp.read(**columns, name=f"event{k}")[0]
        for k, columns in enumerate(make(case, seed), 1)
    ]
    return Data(
        events[:TRAIN], events[TRAIN:], truth(case, seed)["load"], {"multiple_hidden": multiple}
    )


def andes_dips(shared: Path) -> Data:
    """The three dips at hand, on the base of the load before the fault."""
    import tractexp

    events = []
    for letter in "abc":
        path = shared / "cases" / "andes" / f"dip_{letter}.csv"
        t, U, P, Q, f = np.loadtxt(path, delimiter=",", skiprows=1).T
        events += tractexp.read(
            t=t, U=U, P=P / 5.05, Q=Q / 5.05, f=f, name=path.stem, frequency=60.0
        )
    values = {
        "T_prime": 0.0411,
        "X_prime": 0.363,
        "C": 0.938,
        "M": 0.00221,
        "T_m": 0.4156,
        "p_v": 1.3,
    }
    return Data(events[:1], events[1:], values, {})


def station(
    voltages: Sequence[int], currents: Sequence[int], domain: str | None
) -> Callable[[Path], Data]:
    """A transformer of station xtz: its first dip fitted, its second held out."""

    def data(shared: Path) -> Data:
        import tractexp

        path = shared / "data" / "dfr220kv-shandong" / "xtz.cfg"
        events = tractexp.read(path_of(path), voltages=voltages, currents=currents)
        return Data(events[:1], events[1:], {}, {}, domain)

    return data


def pole_slip(currents: Sequence[int]) -> Callable[[Path], Data]:
    """A feeder of the 110 kV station: the first of its steady swings fitted, the two after it held
    out.
    """

    def data(shared: Path) -> Data:
        import tractexp

        path = shared / "data" / "async110kv-wisp" / "async110.cfg"
        dips = {
            e.record.name: e
            for e in tractexp.read(path_of(path), voltages=[0, 1, 2], currents=currents)
        }
        events = [dips[f"async110_dip{k}"] for k in (15, 16, 17)]
        return Data(events[:1], events[1:], {}, {})

    return data


def keating(shared: Path) -> Data:
    """The low-voltage feeder, which holds no dip so far."""
    import tractexp

    events = tractexp.read(path_of(shared / "data" / "keating-lv" / "keating_1999.cfg"))
    return Data(events[:1], events[1:], {}, {})


def tibet(*depths: int) -> Callable[[Path], Data]:
    """Shipped dips: these fitted, the others held out."""

    def data(shared: Path) -> Data:
        import tractexp

        others = [depth for depth in (30, 50, 65) if depth not in depths]
        of = lambda some: [tractexp.read(f"tibet_{depth}pct")[0] for depth in some]  # noqa: E731
        return Data(of(depths), of(others), {}, {})

    return data


def path_of(path: Path) -> str:
    """The path of a file that is there; FileNotFoundError otherwise."""
    if not path.exists():
        raise FileNotFoundError(f"there is no {path.parent.name}/{path.name} beside the repository")
    return str(path)


RECORDS: dict[str, Callable[[Path], Data]] = {
    "andes a": andes_dips,
    "xtz T1 phasors": station([0, 1, 2], [16, 17, 18], None),
    "xtz T2 phasors": station([4, 5, 6], [8, 9, 10], None),
    "xtz T1 waves": station([0, 1, 2], [16, 17, 18], "waves"),
    "xtz T2 waves": station([4, 5, 6], [8, 9, 10], "waves"),
    "async110 VL2": pole_slip([15, 16, 17]),
    "async110 VL3": pole_slip([19, 20, 21]),
    "keating": keating,
    "tibet": tibet(50, 30),
    "tibet_50pct": tibet(50),
}


@dataclass(frozen=True, eq=False)
class Compared:
    """Squares [pu²] from the dip's start on, (N,) each: of what is missed in S, and of how far S
    moved; t [s].
    """

    t: np.ndarray
    missed: np.ndarray
    moved: np.ndarray

    @classmethod
    def of(cls, event: Any, response: Any) -> "Compared":
        """An event against a response of `predict` or `simulate`; gaps of the record left out."""
        P, Q = response.measured
        here = (response.t >= event.t_start) & np.isfinite(P) & np.isfinite(Q)
        missed = (response.P - P) ** 2 + (response.Q - Q) ** 2
        moved = (P - event.P0) ** 2 + (Q - event.Q0) ** 2
        return cls(response.t[here], missed[here], moved[here])

    @property
    def error(self) -> float:
        return float(np.sqrt(self.missed.mean() / self.moved.mean()))


def overall(some: Sequence[Compared]) -> float:
    """The error in S over several events."""
    missed, moved = (
        np.concatenate([getattr(one, name) for one in some]) for name in ("missed", "moved")
    )
    return float(np.sqrt(missed.mean() / moved.mean()))


def block_difference(
    estimate: Sequence[Compared], search: Sequence[Compared]
) -> tuple[float, float, float]:
    """Mean difference of the squared error in S (estimate less search), its standard error, and the
    search's mean.

    All over the mean square of how far S moved. Differences are paired by sample and averaged over
    blocks of 0.1 s, whose scatter gives the standard error; of a short record over tenths of it,
    but no less than a cycle.
    """
    means, sizes = [], []
    block = float(np.clip(min(one.t[-1] - one.t[0] for one in search) / BLOCKS, CYCLE, BLOCK))
    for one, other in zip(estimate, search, strict=True):
        difference = one.missed - other.missed
        number = ((one.t - one.t[0]) / block).astype(int)
        sizes += np.bincount(number).tolist()
        means += (np.bincount(number, difference) / np.maximum(np.bincount(number), 1)).tolist()
    weight = np.array(sizes) / np.sum(sizes)
    mean = float(weight @ means)
    blocks = np.count_nonzero(weight)
    deviation = float(
        np.sqrt(np.sum(weight**2 * (np.array(means) - mean) ** 2) * blocks / max(blocks - 1, 1))
    )
    moved = float(np.concatenate([one.moved for one in search]).mean())
    missed = float(np.concatenate([one.missed for one in search]).mean())
    return mean / moved, deviation / moved, missed / moved


def worse_than_chance(estimate: Sequence[Compared], search: Sequence[Compared]) -> bool:
    """Whether the estimate is worse by more than chance explains, and by more than 1 % of the
    error.

    The mean difference exceeds twice its standard error, and the error in S grows by more than 1 %.
    """
    mean, deviation, missed = block_difference(estimate, search)
    return mean > 2 * deviation and mean > (1.01**2 - 1) * missed


def run(task: Task, shared: Path = SHARED) -> dict[str, Any]:
    """One data set identified. What fails, or is absent, is a row with its message."""
    from tractexp.errors import UserError

    row = {
        "key": task.key,
        "kind": task.kind,
        "name": task.name,
        "model": task.model,
        "seed": task.seed,
    }
    row |= {"multiple": task.multiple, "series": task.series}
    try:
        data = data_of(task, shared)
    except FileNotFoundError as error:
        return row | {"absent": str(error)}
    except (StalledMotor, UserError, ValueError) as error:
        return row | {"skipped": f"{type(error).__name__}: {error}".replace(str(shared), "shared")}
    try:
        return row | data.about | judgement(task, data)
    except (UserError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        return row | {"failed": f"{type(error).__name__}: {error}".replace(str(shared), "shared")}


def judgement(task: Task, data: Data) -> dict[str, Any]:
    """What an identification says of a data set, against what is known of it."""
    fit, wall, cpu = identification(task, data)
    result = fit.result
    content = {
        "wall": wall,
        "cpu": cpu,
        "grade": fit.grade,
        "headline": fit.headline,
        "parameters": result.parameters,
        "errors": result.standard_errors,
        "intervals": result.intervals,
        "at_bound": result.at_bound,
        "verdicts": {name: verdict.partition(" (")[0] for name, verdict in result.verdicts.items()},
        "objective": result.objective,
        "epsilon": [result.epsilon_p, result.epsilon_q],
        "search": {key: result.search[key] for key in ("parameters", "objective", "at_bound")},
        "model_error": getattr(result, "model_error", None),
        "truth": data.truth,
    }
    return content | size_of_error(fit, data)


def identification(task: Task, data: Data) -> tuple[Any, float, float]:
    """The identification by the public call, its wall and its processor time [s]."""
    import tractexp

    wall, cpu = time.perf_counter(), time.process_time()
    fit = tractexp.identify(
        data.train,
        model=task.model,
        validate=data.validate,
        domain=data.domain,
        optimizer="multistart_least_squares",
        frequency_swing=0.0,  # the generator's voltages turn evenly,
        unbalance=0.0,  # as a positive sequence alone
        progress=False,
    )
    return fit, time.perf_counter() - wall, time.process_time() - cpu


def comparisons(fit: Any, data: Data) -> dict[str, tuple[list[Compared], list[Compared]]]:
    """Of the fitted, of the held-out and of all events: at the estimate, and where the search
    ended.

    An event that one of them gives no steady state raises `UserError`.
    """
    import tractexp

    sides: dict[str, tuple[list[Compared], list[Compared]]] = {}
    for role, events in (("train", data.train), ("validate", data.validate)):
        if not events:
            continue
        simulation = tractexp.simulate(
            fit.model, fit.result.search["parameters"], records=list(events)
        ).responses
        here = [Compared.of(event, fit.predict(event)) for event in events]
        sides[role] = (
            here,
            [
                Compared.of(event, response)
                for event, response in zip(events, simulation, strict=True)
            ],
        )
    here, there = (
        list(itertools.chain.from_iterable(some)) for some in zip(*sides.values(), strict=True)
    )
    return sides | {"all": (here, there)}


def size_of_error(fit: Any, data: Data) -> dict[str, Any]:
    """The error in S of each event, at the estimate and where the search ended, and whether chance
    explains more.
    """
    content: dict[str, Any] = {"S": {}, "chance": {}}
    for role, (here, there) in comparisons(fit, data).items():
        sides = {"estimate": here, "search": there}
        content["chance"][role] = [*block_difference(here, there), worse_than_chance(here, there)]
        if role == "all":
            continue
        content["S"][role] = {name: [one.error for one in some] for name, some in sides.items()}
        content["S"][role] |= {f"all {name}": overall(some) for name, some in sides.items()}
    return content


def six_digits(value: Any) -> Any:
    """Floats to six digits, so that a row stays short; what is not finite is None."""
    if isinstance(value, float | np.floating):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    if isinstance(value, dict):
        return {key: six_digits(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [six_digits(one) for one in value]
    return bool(value) if isinstance(value, np.bool_) else value


def rows_of(path: Path) -> list[dict[str, Any]]:
    """The rows of a file; none where it is absent."""
    return (
        [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        if path.exists()
        else []
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--series", default="calibration", help="of seeds")
    parser.add_argument(
        "--count", type=int, default=8, help="ANDES sets, nulls, and data sets of each effect"
    )
    parser.add_argument(
        "--only", nargs="*", default=KINDS, help=f"kinds ({', '.join(KINDS)}) or names of data sets"
    )
    parser.add_argument(
        "--multiples", nargs="*", type=float, default=MULTIPLES, help="of the detection limit"
    )
    parser.add_argument("--models", nargs="*", default=(EXPONENTIAL, ZIP), help="of ANDES sets")
    parser.add_argument("--shared", type=Path, default=SHARED, help="folder of the records at hand")
    parser.add_argument("--out", type=Path, default=Path("model_error.jsonl"))
    parser.add_argument(
        "--tables", action="store_true", help="print what is stored, and run nothing"
    )
    parser.add_argument(
        "--against", type=Path, help="a file of rows before: how far estimates moved"
    )
    options = parser.parse_args()
    rows = rows_of(options.out)
    if options.tables:
        print(tables(rows))
        if options.against:
            print("", *shift_lines(rows, rows_of(options.against)), sep="\n")
        return 0
    keys = {row["key"] for row in rows}
    every = tasks(options.series, options.count, options.multiples, options.models)
    rest = [t for t in every if {t.kind, t.name} & {*options.only} and t.key not in keys]
    with options.out.open("a", encoding="utf-8") as out:
        for k, task in enumerate(rest, start=1):
            row = six_digits(run(task, options.shared))
            if "absent" not in row:
                out.write(json.dumps(row, ensure_ascii=False, separators=(",", ":")) + "\n")
                out.flush()
            rows.append(row)
            print(f"\r{k} of {len(rest)}: {task.key}", end="", file=sys.stderr, flush=True)
    print(tables(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
