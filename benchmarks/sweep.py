"""What a job of a sweep costs beyond its search: `python benchmarks/sweep.py [seeds]`.

Runs optimizers x seeds as a logged sweep in an empty folder and then, in this process, the same
searches by themselves. CPU seconds are those of the whole tree of processes, so they hold on a
shared machine too; wall seconds do not. What every sweep spends once (start of the workers, the
parent, the store) is measured by a sweep of one job per worker.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

OPTIMIZERS, BUDGET, WORKERS = ("issa", "ssa", "pso"), 15000, 2


def sweep(folder: Path, *arguments: str) -> tuple[float, float]:
    """Wall and CPU seconds of a sweep in `folder`."""
    command = [
        sys.executable,
        "-m",
        "tractexp",
        "-m",
        f"hydra.launcher.n_jobs={WORKERS}",
        *arguments,
    ]
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (
        time.perf_counter() - started,
        after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    )


def compute(folder: Path) -> float:
    """CPU seconds of the searches of the sweep in `folder`, by themselves."""
    for library in ("OPENBLAS", "OMP", "MKL"):  # as the program does, before NumPy is imported
        os.environ[f"{library}_NUM_THREADS"] = "1"
    import yaml

    from tractexp.api.job import Job
    from tractexp.identification.search import Limits, search

    spent, problem = 0.0, None
    for path in folder.glob("*/.hydra/config.yaml"):
        job = Job(yaml.safe_load(path.read_text()), {}, path.parent)
        if problem is None:  # it is the same for all
            problem = job.problem
            problem.objective((problem.lower + problem.upper)[None] / 2)  # the kernel is loaded
        started = time.process_time()
        search(problem, job.optimizer, job.seed, Limits(BUDGET))
        spent += time.process_time() - started
    return spent


def main(seeds: int = 20) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder, jobs = Path(name), len(OPTIMIZERS) * seeds
        swept = (f"optimizer={','.join(OPTIMIZERS)}", f"seed=range(0,{seeds})", f"budget={BUDGET}")
        _, once = sweep(folder, "optimizer=pso,ssa", "budget=100", "hydra.sweep.dir=small")
        wall, cpu = sweep(folder, *swept, "hydra.sweep.dir=large")
        searched = compute(folder / "large")
    print(
        f"{jobs} jobs of {BUDGET} simulations, {WORKERS} workers: {wall:.1f} s, {cpu:.1f} s of CPU"
    )
    beyond = (cpu - once - searched) / jobs
    print(
        f"once per sweep {once:.1f} s of CPU; per job: search {searched / jobs:.3f} s, beyond it"
        f" {beyond:.3f} s"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
