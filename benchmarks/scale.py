"""Time and memory against size: python benchmarks/scale.py [--case NAME ...] [--tables]

Each case is a command as users type it, on inputs of several sizes that are made here: the rows of
a table with twenty dips, the events of one fit, the jobs of a sweep, the files of a survey, the
samples of waveforms, and the commands that begin side by side on an empty cache. CPU seconds are
those of the whole tree of processes, so they hold on a shared machine too, wall seconds do not; the
peak is that of the command's own process. The slope is that of log CPU over log size between two
sizes, less what the command takes for nothing (`--help`): 1 is linear. Rows are stored in
scale.json case by case, and docs/benchmarks.md has its table from there.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import log
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import tractexp

tractexp.__version__  # noqa: B018

import marked  # noqa: E402
import numpy as np  # noqa: E402
import survey  # noqa: E402
import wave_records  # noqa: E402

from tractexp.storage import files  # noqa: E402

STORED = Path(__file__).with_suffix(".json")
PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"
MOTOR = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "p_v": 1.4,
    "q_v": 3.0,
}
DIPS = 20  # of a table
RATE = 50.0  # Hz, of a table
NOISE = 1e-3  # pu
FIT = ("optimizer=multistart_least_squares", "tracking.enabled=false", "hydra.run.dir=run")
SMALL = ("optimizer=pso", "optimizer.population=20", "budget=200")


@dataclass(frozen=True)
class Use:
    """What a command took: seconds, those of processors, and the greatest memory [MB] of its own
    process.
    """

    wall: float
    cpu: float
    peak: float


def use(folder: Path, arguments: Sequence[str], **environment: str) -> Use:
    """Run `python -m tractexp` in a folder. Raises `RuntimeError` with what it printed where it
    fails.
    """
    with (folder / "printed.txt").open("w+") as printed:
        started = time.perf_counter()
        command = [sys.executable, "-m", "tractexp", *arguments]
        process = subprocess.Popen(
            command, cwd=folder, stdout=printed, stderr=printed, env=os.environ | environment
        )
        peaks: list[float] = []
        watch = threading.Thread(target=watched, args=(process.pid, peaks))
        watch.start()
        _, status, spent = os.wait4(process.pid, 0)
        wall = time.perf_counter() - started
        process.returncode = os.waitstatus_to_exitcode(status)
        watch.join()
        if process.returncode:
            printed.seek(0)
            raise RuntimeError(f"exit {process.returncode}: {printed.read()[-500:]}")
    return Use(wall, spent.ru_utime + spent.ru_stime, max(peaks))


def watched(pid: int, peaks: list[float]) -> None:
    """Add the greatest memory of a process [MB] so far until it ends; a parent's own does not count
    as with rusage.
    """
    while True:
        try:
            lines = Path(f"/proc/{pid}/status").read_text().splitlines()
        except OSError:
            return
        peak = [int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM")]
        if not peak:
            return  # it has ended, and nobody has waited for it yet
        peaks += peak
        time.sleep(0.02)


# What is measured: each makes its input in a folder and gives the arguments of a command


def dip(rate: float, length: float, depth: float = 0.4) -> tuple[np.ndarray, ...]:
    """t [s], U, P, Q [pu] (N,) of a motor and a static load in a dip in the middle."""
    settings = {"depth": depth, "duration": 0.3, "fall": 0.1, "recovery": 0.1, "start": length / 2}
    made = (
        tractexp.simulate(tractexp.compose(), MOTOR, rate=rate, length=length, **settings)
        .responses[0]
        .to_frame()
    )
    return tuple(made[name].to_numpy() for name in "tUPQ")


def write(
    path: Path, t: np.ndarray, U: np.ndarray, P: np.ndarray, Q: np.ndarray, seed: int
) -> None:
    """A table with noise in P and Q."""
    noise = NOISE * np.random.default_rng(seed).standard_normal((2, len(t)))
    table = np.column_stack([t, U, P + noise[0], Q + noise[1]])
    np.savetxt(path, table, ["%.9g", *["%.6g"] * 3], ",", header="t,U,P,Q", comments="")


def table(folder: Path, rows: int) -> None:
    """`long.csv`: so many rows at 50 Hz, with twenty dips evenly in them."""
    one = dip(RATE, min(10.0, rows / RATE / DIPS))[1:]
    n = len(one[0])
    columns = [np.full(rows, values[0]) for values in one]
    for k in range(DIPS):
        first = round((k + 0.5) * rows / DIPS) - n // 2
        for column, values in zip(columns, one, strict=True):
            column[first : first + n] = values[: rows - first]
    write(folder / "long.csv", np.arange(rows) / RATE, *columns, seed=1)


def looked(folder: Path, rows: int) -> list[str]:
    table(folder, rows)
    return ["look", "long.csv"]


def identified(folder: Path, rows: int) -> list[str]:
    table(folder, rows)
    return ["data=csv", "data.train=[long.csv]", *FIT]


def events(folder: Path, count: int) -> list[str]:
    names = [f"dip{k:03d}.csv" for k in range(count)]
    for k, name in enumerate(names):
        write(folder / name, *dip(200.0, 2.0, depth=0.3 + 0.2 * k / count), seed=k)
    return ["data=csv", f"data.train=[{','.join(names)}]", *FIT]


def jobs(folder: Path, count: int) -> list[str]:
    return [
        "-m",
        *SMALL,
        f"seed=range(0,{count})",
        "hydra.sweep.dir=sweep",
        "hydra.launcher.n_jobs=2",
    ]


def archive(folder: Path, count: int) -> list[str]:
    survey.archive(folder / "archive", count)
    return ["task=survey", "data.path=archive", "task.cores=1"]


def waveforms(folder: Path, samples: int) -> list[str]:
    """A dip recorded at 10 kHz, before it as many whole cycles as it takes."""
    from datetime import datetime

    from tractexp.filetypes.comtrade_writer import write as write_comtrade
    from tractexp.recording import Channel, Recording, Segment

    rate, cycle = 10_000.0, 200
    case = wave_records.case([48, 4])
    fault = replace(case.faults[0], frequency=50.0)
    sampler = replace(case.sampler, rate=rate, noise=0.0, offsets=(0.0,) * 6)
    (x,) = wave_records.samples(replace(case, faults=(fault,), sampler=sampler), [48, 4])
    x = np.concatenate([np.tile(x[:, :cycle], max(0, samples - x.shape[1]) // cycle), x], axis=1)
    x = x + NOISE * np.random.default_rng(1).standard_normal(x.shape)
    peak = wave_records.BASE_VOLTAGE * np.sqrt(2 / 3)
    sizes = np.repeat([peak, 2 * wave_records.BASE_POWER / (3 * peak)], 3)
    channels = []
    for k, row in enumerate(x * sizes[:, None]):
        gain, quantity = float(np.abs(row).max() / 32000), "voltage" if k < 3 else "current"
        unit, whole = "kV" if k < 3 else "kA", np.round(row / gain).astype(np.int16)
        channels.append(
            Channel(f"{'UI'[k // 3]}{'ABC'[k % 3]}", whole, unit, quantity, "ABC"[k % 3], gain=gain)
        )
    segment, start = Segment(0, x.shape[1], rate, 0.0), datetime(2026, 1, 1)
    made = Recording("", channels, [segment], 50.0, station="made", start=start)
    write_comtrade(made, folder / "waves.cfg", "BINARY", 1999)
    return [
        "data=comtrade",
        "data.path=waves.cfg",
        "domain=waves",
        "model=fifth_order_branch",
        *FIT,
    ]


Prepare = Callable[[Path, int], list[str]]


def one(prepare: Prepare) -> Callable[[int], Use]:
    """A command by itself, on an input of some size; the kernels are in the cache."""

    def measure(size: int) -> Use:
        with tempfile.TemporaryDirectory(prefix="scale") as name:
            return use(Path(name), prepare(Path(name), size))

    return measure


def cold(count: int) -> Use:
    """So many commands begun at once on one empty cache: all of them must end well, with the same
    result.
    """
    with tempfile.TemporaryDirectory(prefix="scale") as name:
        cache, found = str(Path(name, "cache")), {}

        def begin(k: int) -> None:
            folder = Path(name, str(k))
            folder.mkdir()
            found[k] = use(folder, ["data=tibet_50pct", *FIT], TRACTEXP_CACHE_DIR=cache)

        threads = [threading.Thread(target=begin, args=(k,)) for k in range(count)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        results = {
            json.dumps(json.loads(p.read_text())["parameters"])
            for p in Path(name).glob("*/run/result.json")
        }
    if len(found) != count or len(results) != 1:
        raise RuntimeError(
            f"{len(found)} of {count} commands ended well, with {len(results)} different results"
        )
    uses = list(found.values())
    return Use(max(u.wall for u in uses), sum(u.cpu for u in uses), max(u.peak for u in uses))


@dataclass(frozen=True)
class Case:
    """What grows, in words, how it is measured, and at which sizes."""

    of: str
    measure: Callable[[int], Use]
    sizes: tuple[int, ...]


CASES = {
    "look": Case("rows of a table, `look`", one(looked), (450_000, 900_000, 1_800_000)),
    "identify": Case(
        "rows of a table, fitted about its first dip",
        one(identified),
        (450_000, 900_000, 1_800_000),
    ),
    "events": Case("events in one fit", one(events), (5, 50, 500)),
    "sweep": Case("jobs of a sweep, logged", one(jobs), (20, 200, 2000)),
    "survey": Case("files of a survey", one(archive), (50, 500, 5000)),
    "waves": Case("samples of waveforms in one fit", one(waveforms), (10_000, 100_000, 1_000_000)),
    "cold": Case("commands at once on an empty cache", cold, (1, 6)),
}


def nothing() -> float:
    """CPU seconds of a command that has nothing to do."""
    with tempfile.TemporaryDirectory(prefix="scale") as name:
        return use(Path(name), ["--help"]).cpu


def row(case: str, size: int) -> dict[str, Any]:
    """What is stored of a case at one size."""
    spent = CASES[case].measure(size)
    load = round(os.getloadavg()[0], 1)
    figures = {"wall": round(spent.wall, 2), "cpu": round(spent.cpu, 2), "peak": round(spent.peak)}
    return {"size": size} | figures | {"load": load}


def slopes(rows: Sequence[dict[str, Any]], idle: float) -> list[float | None]:
    """Of log CPU beyond `idle` over log size, from each size to the next; None where nothing is
    beyond it.
    """
    beyond = [(one["size"], one["cpu"] - idle) for one in rows]
    return [
        log(b[1] / a[1]) / log(b[0] / a[0]) if min(a[1], b[1]) > 0 else None
        for a, b in pairwise(beyond)
    ]


def text(stored: dict[str, Any]) -> str:
    """The table of the page."""
    lines = ["| what grows | size | CPU, s | peak, MB | slope |", "|---|---|---|---|---|"]
    for name, case in CASES.items():
        rows = stored.get(name, [])
        for k, (found, slope) in enumerate(
            zip(rows, [None, *slopes(rows, stored["idle"])], strict=False)
        ):
            last = "" if slope is None else f"{slope:.2f}"
            cells = f"{found['size']:,} | {found['cpu']:.1f} | {found['peak']} | {last}"
            lines.append(f"| {'' if k else case.of} | {cells} |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--case", nargs="*", choices=CASES, default=list(CASES))
    parser.add_argument("--most", type=int, help="leave larger sizes out")
    parser.add_argument(
        "--tables", action="store_true", help="write the page from what is stored, and run nothing"
    )
    chosen = parser.parse_args()
    stored = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
    if not chosen.tables:
        stored["idle"] = round(nothing(), 2)
    for name in () if chosen.tables else chosen.case:
        stored[name] = []
        for size in (s for s in CASES[name].sizes if chosen.most is None or s <= chosen.most):
            stored[name].append(row(name, size))
            print(name, stored[name][-1], flush=True)
            files.write(STORED, json.dumps(stored, indent=1) + "\n")
    print(marked.replace(PAGE, "benchmarks/scale.py", text(stored)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
