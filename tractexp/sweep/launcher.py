"""`hydra/launcher=cores`: the jobs of a sweep on worker processes that start once, here or on a Dask cluster."""

import contextlib
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher

from tractexp.compat.hydra_plugins import NAMESPACE
from tractexp.errors import UserError, check_choice, check_range
from tractexp.sweep import status
from tractexp.sweep.compose import Composer
from tractexp.sweep.job import SweepJob, work
from tractexp.sweep.progress import progress
from tractexp.sweep.status import FAILED, RUNNING, Status
from tractexp.workers import dask_cluster, processes

BARREN = 3  # times a pool may break before any job of it has started


@dataclass
class CoresConfig:
    """Schema of `hydra.launcher`."""

    _target_: str = f"{NAMESPACE}.Cores"
    backend: str = "processes"  # on this computer; "dask": workers of a Dask cluster
    n_jobs: int = -1  # workers; -1: one for each core this process may use
    address: str | None = None  # of a Dask scheduler, such as tcp://host:8786; null: a cluster of our own, here
    tries: int = 3  # how often a job is run whose worker is killed


class Cores(Launcher):
    """Runs jobs on worker processes. A job whose worker is killed is run again, by itself, so that it alone is blamed.

    Raises `UserError` for settings out of range, and where workers cannot be started.
    """

    def __init__(self, backend: str, n_jobs: int, address: str | None, tries: int):
        self.backend, self.n_jobs, self.address, self.tries = backend, n_jobs, address, tries

    def setup(self, *, hydra_context: Any, task_function: Any, config: Any) -> None:
        self.hydra_context, self.config = hydra_context, config
        check_choice("hydra.launcher.backend", self.backend, ("processes", "dask"))
        if self.n_jobs != -1:
            check_range("hydra.launcher.n_jobs", self.n_jobs, 1)
        check_range("hydra.launcher.tries", self.tries, 1)

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[JobReturn]:
        """As Hydra's other sweepers call it: the return value of a job is its objective."""
        compose = Composer(self.hydra_context.config_loader, self.config)
        folder = Path(self.config.hydra.sweep.dir).absolute()
        jobs = [
            SweepJob.of(*compose(overrides), overrides, folder / str(initial_job_idx + k))
            for k, overrides in enumerate(job_overrides)
        ]
        return [_returned(job, end) for job, end in zip(jobs, self.run(jobs), strict=True)]

    def run(self, jobs: Sequence[SweepJob]) -> list[Status]:
        """Run all jobs and return how they ended, in their order."""
        n_jobs = min(_cores() if self.n_jobs == -1 else self.n_jobs, len(jobs))
        warm(jobs)
        with progress(jobs) as ended:
            ends: dict[Path, Status] = {}

            def note(end: Status, job: SweepJob) -> None:
                ends[job.folder] = end
                ended(job, end)

            suspects = self._together(jobs, n_jobs, ends, note)
            for job in suspects:
                self._alone(job, note)
        return [ends[job.folder] for job in jobs]

    def _together(
        self, jobs: Sequence[SweepJob], n_jobs: int, ends: dict[Path, Status], note: Callable[[Status, SweepJob], None]
    ) -> list[SweepJob]:
        """Run jobs side by side and return those that had begun when a worker was killed."""
        suspects: list[SweepJob] = []
        left, barren = list(jobs), 0
        while left:
            with self._executor(n_jobs) as executor:
                whole = _collect(executor, left, note)
            left = [job for job in left if job.folder not in ends]
            begun = [job for job in left if _end(job, note) == RUNNING]
            suspects += begun
            left = [job for job in left if job.folder not in ends and job not in begun]
            barren = 0 if begun or whole else barren + 1
            if barren == BARREN:
                raise UserError(
                    "the workers of the sweep are killed before they begin: is there enough memory for them?"
                )
        return suspects

    def _alone(self, job: SweepJob, note: Callable[[Status, SweepJob], None]) -> None:
        """Run a job again that may have killed its worker, with nobody beside it."""
        for _ in range(self.tries - 1):
            with self._executor(1) as executor:
                if _collect(executor, [job], note) or _end(job, note) != RUNNING:
                    return
        message = f"its worker was killed each of the {self.tries} times it was run; is there enough memory for it?"
        end = replace(job.status, status=FAILED, message=message)
        end.write(job.folder)
        note(end, job)

    def _executor(self, n_jobs: int) -> AbstractContextManager[Executor]:
        return processes(n_jobs) if self.backend == "processes" else dask_cluster(n_jobs, self.address)


def _collect(executor: Executor, jobs: Sequence[SweepJob], note: Callable[[Status, SweepJob], None]) -> bool:
    """Note the ends of jobs as they come; False where a worker was killed."""
    whole, futures = True, {}
    with contextlib.suppress(BrokenExecutor):  # a worker was killed already: the futures tell
        for job in jobs:
            futures[executor.submit(work, job)] = job
    for future in as_completed(futures):
        try:
            note(future.result(), futures[future])
        except Exception as error:
            if not (isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"):
                raise
            whole = False
    return whole


def _end(job: SweepJob, note: Callable[[Status, SweepJob], None]) -> str | None:
    """How a job stands whose worker has not answered; its end is noted where it had written it."""
    end = status.read(job.folder)
    if end is None or end.status == RUNNING:
        return end and end.status
    note(end, job)
    return end.status


def _cores() -> int:
    """Cores this process may use, containers' limits considered."""
    from joblib import cpu_count

    return cpu_count()


def warm(jobs: Sequence[SweepJob]) -> None:
    """Compile the kernels of the jobs' models, once for each, so that the workers find them on disk."""
    import json

    from tractexp.api.task import Job

    seen = set()
    for job in jobs:
        key = json.dumps([job.config["model"], job.config["data"]], sort_keys=True)
        if key in seen:
            continue
        seen.add(key)
        with contextlib.suppress(Exception):  # the job itself will tell
            problem = Job(job.config, job.choices, job.folder).problem
            middle = (problem.lower + problem.upper)[None] / 2
            problem.objective(middle)
            problem.residuals(middle)


def _returned(job: SweepJob, end: Status) -> JobReturn:
    failed = end.status == FAILED
    value: Any = UserError(f"job {job.folder.name}: {end.message}") if failed else status.objective(job.folder)
    made = JobReturn(overrides=job.overrides, status=JobStatus.FAILED if failed else JobStatus.COMPLETED)
    made.return_value = value
    return made
