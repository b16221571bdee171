"""What a job of a sweep costs beyond its search: `python benchmarks/sweep.py [seeds]`.

Runs optimizers x seeds as a logged sweep in an empty folder and, in this process, the same searches by themselves.
CPU seconds are those of the whole tree of processes, so they hold on a shared machine too; wall seconds do not. What
every sweep spends once (start of the workers, the parent, the store) is measured by a sweep of one job per worker.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

OPTIMIZERS, BUDGET, WORKERS = ("issa", "ssa", "pso"), 15000, 2


def sweep(seeds: int, *more: str) -> tuple[float, float]:
    """Wall and CPU seconds of a sweep in an empty folder."""
    command = [sys.executable, "-m", "tractexp", "-m", f"budget={BUDGET}", f"seed=range(0,{seeds})", *more]
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [*command, f"hydra.launcher.n_jobs={WORKERS}"], cwd=folder, check=True, stdout=subprocess.DEVNULL
        )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter() - started, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def compute(seeds: int) -> float:
    """CPU seconds of the same searches by themselves."""
    for library in ("OPENBLAS", "OMP", "MKL"):  # as the program does, before NumPy is imported
        os.environ[f"{library}_NUM_THREADS"] = "1"
    from tractexp.identify.problem import Problem
    from tractexp.identify.search import Limits, search
    from tractexp.plugin import build
    from tractexp.tasks.task import Job

    data = {"name": "csv", "train": ["pkg://tractexp.data/tibet_50pct.csv"]}
    parts = {"motor": {"name": "electromechanical"}, "static": {"name": "exponential"}}
    job = Job({"data": data, "model": parts}, {}, Path())
    problem = Problem(job.model, job.events().train)
    problem.objective((problem.lower + problem.upper)[None] / 2)  # the kernel is loaded
    started = time.process_time()
    for name in OPTIMIZERS:
        for seed in range(seeds):
            search(problem, build("optimizer", {"name": name}), seed, Limits(BUDGET))
    return time.process_time() - started


def main(seeds: int = 20) -> None:
    swept = f"optimizer={','.join(OPTIMIZERS)}"
    wall, cpu = sweep(seeds, swept)
    _, once = sweep(1, "optimizer=pso,ssa", "budget=100")
    jobs, searched = len(OPTIMIZERS) * seeds, compute(seeds)
    beyond = (cpu - once - searched) / jobs
    print(f"{jobs} jobs of {BUDGET} simulations, {WORKERS} workers: {wall:.1f} s, {cpu:.1f} s of CPU")
    print(f"once per sweep {once:.1f} s of CPU; per job: search {searched / jobs:.3f} s, beyond it {beyond:.3f} s")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
