"""What a sweep takes on clusters of this machine: python benchmarks/clusters.py [--engine NAME ...]
[--workers 1 2 4] [--jobs 24] [--tables]

The same jobs, not logged, by the processes of joblib, by a Dask cluster over TCP whose workers have
folders of their own, and by a SLURM whose `sbatch` is a script here, each task with its share of
the jobs. Seconds of wall time and of processors: those of the command and of all that works for it,
its start included, since that is what a worker costs. Rows are stored in clusters.json with the
load of the machine, and docs/sweeps.md has its table from there: from cores that others use, wall
times say little.
"""

import argparse
import contextlib
import ctypes
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import marked

from tractexp.storage import files

STORED = Path(__file__).with_suffix(".json")
PAGE = Path(__file__).parents[1] / "docs" / "sweeps.md"
JOB = ("optimizer=issa", "budget=15000", "tracking.enabled=false", "hydra.sweeper.compare=false")
ADOPT = 36  # PR_SET_CHILD_SUBREAPER: what `sbatch` starts is waited for here
LONGEST_WAIT = 50  # looks at processes that are about to end
COMMANDS = {
    "sbatch": """
script = pathlib.Path(sys.argv[-1])
array = re.search(r"--array=0-([0-9]+)", script.read_text())
one = dict.fromkeys(("NODEID", "PROCID", "LOCALID"), "0")
one |= {"JOB_NUM_NODES": "1", "NTASKS": "1", "JOB_NODELIST": "here"}
for k in range(int(array[1]) + 1 if array else 1):
    own = {**one, "JOB_ID": str(9 + k)}
    own |= {"ARRAY_JOB_ID": "9", "ARRAY_TASK_ID": str(k)} if array else {}
    names = {f"SLURM_{name}": text for name, text in own.items()}
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.Popen(["bash", script], env={**os.environ, **names}, **silent)
print("Submitted batch job 9")
""",
    "srun": """
options = {"--unbuffered": 1, "--output": 2, "--error": 2}
words = sys.argv[1:]
while words[0] in options:
    del words[:options[words[0]]]
os.execv(words[0], words)
""",
    "sacct": 'print("JobID|State|NodeList")',
}


@contextlib.contextmanager
def loky(folder: Path, workers: int, jobs: int) -> Iterator[tuple[str, ...]]:
    """Processes of joblib: the settings that choose them."""
    yield (f"hydra.launcher.n_jobs={workers}",)


@contextlib.contextmanager
def dask(folder: Path, workers: int, jobs: int) -> Iterator[tuple[str, ...]]:
    """A scheduler and workers over TCP, each worker in a folder of its own."""
    from distributed import LocalCluster

    local: Any = LocalCluster
    with contextlib.ExitStack() as stack:
        cluster = stack.enter_context(local(n_workers=0, dashboard_address=None, protocol="tcp"))
        command = [sys.executable, "-m", "distributed.cli.dask_worker", cluster.scheduler_address]
        for k in range(workers):
            (own := folder / f"worker_{k}").mkdir()
            one = [*command, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
            worker = subprocess.Popen(one, cwd=own, stderr=subprocess.DEVNULL)
            stack.callback(worker.wait, 60)
            stack.callback(worker.terminate)
        cluster.wait_for_workers(workers, timeout=120)
        yield "hydra/launcher=dask", f"hydra.launcher.address={cluster.scheduler_address}"


def write_commands(folder: Path) -> None:
    """Write the commands of a SLURM that is this computer."""
    for name, body in COMMANDS.items():
        head = f"#!{sys.executable}\nimport os, pathlib, re, subprocess, sys\n"
        (path := folder / name).write_text(head + body)
        path.chmod(0o755)


@contextlib.contextmanager
def slurm(folder: Path, workers: int, jobs: int) -> Iterator[tuple[str, ...]]:
    """A job array with so many tasks, each with its share of the jobs."""
    write_commands(folder)
    before = os.environ["PATH"]
    os.environ["PATH"] = os.pathsep.join([str(folder), before])
    try:
        share = f"hydra.launcher.jobs_per_task={-(-jobs // workers)}"
        yield "hydra/launcher=slurm", share, "hydra.launcher.timeout_min=30"
    finally:
        os.environ["PATH"] = before


Engine = Callable[[Path, int, int], contextlib.AbstractContextManager[tuple[str, ...]]]
ENGINES: dict[str, Engine] = {"loky": loky, "dask": dask, "slurm": slurm}
NAMES = {
    "loky": "processes, `loky`",
    "dask": "`dask`, over TCP",
    "slurm": "`slurm`, a task a worker",
}


def spent() -> float:
    """CPU seconds of all processes that have been waited for, those without a parent included."""
    with contextlib.suppress(ChildProcessError):
        for _ in range(LONGEST_WAIT):
            if not os.waitpid(-1, os.WNOHANG)[0]:
                time.sleep(0.1)
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def measure(engine: str, workers: int, jobs: int) -> dict[str, Any]:
    """The row of one sweep. Raises `RuntimeError` where a job did not end well."""
    with tempfile.TemporaryDirectory() as name:
        folder, before = Path(name), spent()
        with ENGINES[engine](folder, workers, jobs) as chosen:
            swept = (*JOB, f"seed=range(0,{jobs})", "hydra.sweep.dir=sweep", *chosen)
            command = [sys.executable, "-m", "tractexp", "-m", *swept]
            started = time.perf_counter()
            subprocess.run(command, cwd=folder, stdout=subprocess.DEVNULL, check=True)
            wall = time.perf_counter() - started
        cpu = spent() - before
        ends = [json.loads(path.read_text()) for path in folder.glob("sweep/*/status.json")]
    if [end["status"] for end in ends] != ["finished"] * jobs:
        raise RuntimeError(f"{len(ends)} of {jobs} jobs have ended, or not well")
    row = {"engine": engine, "workers": workers, "jobs": jobs}
    times = {"wall": round(wall, 1), "cpu": round(cpu, 1)}
    return row | times | {"load": round(os.getloadavg()[0], 1)}


def stored() -> list[dict[str, Any]]:
    """The rows so far."""
    return json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else []


def store(row: dict[str, Any]) -> None:
    """Put a row in the place of the one of the same engine and workers."""
    which = row["engine"], row["workers"]
    others = [one for one in stored() if (one["engine"], one["workers"]) != which]
    files.write(STORED, json.dumps([*others, row], indent=1) + "\n")


def text(rows: list[dict[str, Any]]) -> str:
    """The table of the page."""
    counts = sorted({row["workers"] for row in rows})
    cpu = {(row["engine"], row["workers"]): row["cpu"] for row in rows}
    head = ["", *(f"{n} worker{'s' if n > 1 else ''}" for n in counts)]
    lines = [
        [NAMES[engine], *(f"{cpu[engine, n]:.0f}" if (engine, n) in cpu else "" for n in counts)]
        for engine in ENGINES
    ]
    return marked.table(head, lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engine", nargs="*", choices=ENGINES, default=list(ENGINES))
    parser.add_argument("--workers", nargs="*", type=int, default=[1, 2, 4])
    parser.add_argument("--jobs", type=int, default=24)
    parser.add_argument("--tables", action="store_true", help="run nothing")
    chosen = parser.parse_args()
    if not chosen.tables:
        ctypes.CDLL(None).prctl(ADOPT, 1)
        for engine in chosen.engine:
            for workers in chosen.workers:
                store(row := measure(engine, workers, chosen.jobs))
                print(row, flush=True)
    print(marked.replace(PAGE, "benchmarks/clusters.py", text(stored())))


if __name__ == "__main__":
    main()
