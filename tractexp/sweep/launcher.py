"""`hydra/launcher=cores`: the jobs of a sweep on the workers of a joblib backend, here or on a
cluster.
"""

import atexit
import contextlib
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from omegaconf import OmegaConf

from tractexp.api.job import Job
from tractexp.compat.hydra_plugins import NAMESPACE
from tractexp.errors import UserError, check_choice, check_range
from tractexp.process.workers import Workers, list_backends
from tractexp.storage.run_folder import hold
from tractexp.sweep import status
from tractexp.sweep.compose import Composer
from tractexp.sweep.elsewhere import pack_job, unpack_job, work_elsewhere
from tractexp.sweep.job import SweepJob, work
from tractexp.sweep.live import LivePage, keep_live
from tractexp.sweep.parent import open_parent_run
from tractexp.sweep.placing import await_end, is_finished, place
from tractexp.sweep.progress import show_progress
from tractexp.sweep.recorder import Recorder
from tractexp.sweep.status import ENDED, FAILED, FINISHED, RUNNING, Status

# backends whose workers would inherit a half-done import of another thread
FORKING = ("multiprocessing",)
DISTANT = ("dask",)  # backends whose workers may be other computers
SPELLINGS = {"processes": "loky"}  # of a backend in earlier versions


@dataclass
class CoresConfig:
    """Schema of `hydra.launcher`."""

    _target_: str = f"{NAMESPACE}.Cores"
    # of joblib: "loky" (processes), "dask" (of a cluster), "threading", or a registered one
    backend: str = "loky"
    n_jobs: int = -1  # workers; -1: one for each core this process may use, or all of a cluster
    # of a Dask scheduler, such as tcp://host:8786; null: a cluster of our own, here
    address: str | None = None
    tries: int = 3  # how often a job is run whose worker is killed


class Cores(Launcher):
    """Runs jobs on workers. A job whose worker is killed is run again, by itself, so that it alone
    is blamed.

    Raises `UserError` for settings out of range, and where workers cannot be started.
    """

    def __init__(self, backend: str, n_jobs: int, address: str | None, tries: int):
        """A launcher that runs jobs on the workers of a joblib backend."""
        self.workers, self.tries = (
            Workers(n_jobs, SPELLINGS.get(backend, backend), address, apart=True),
            tries,
        )
        # for a sweeper that is not ours
        self.launched: dict[Path, SweepJob] = {}
        self.page: LivePage | None = None

    def setup(self, *, hydra_context: Any, task_function: Any, config: Any) -> None:
        """Raise `UserError` for a backend or numbers that cannot be."""
        self.hydra_context, self.config = hydra_context, config
        self.compose = Composer(hydra_context.config_loader, config)
        check_choice("hydra.launcher.backend", self.workers.backend, list_backends())
        if self.workers.n_jobs != -1:
            check_range("hydra.launcher.n_jobs", self.workers.n_jobs, 1)
        check_range("hydra.launcher.tries", self.tries, 1)

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run a batch of jobs, as Hydra's other sweepers call it: what a job returns is what
        `sweep.returns` names.

        A job that was done before, in this sweep or an earlier one in the same folder, is not run
        again.
        """
        folder = Path(self.config.hydra.sweep.dir).absolute()
        numbered = enumerate(job_overrides, start=initial_job_idx)
        jobs = place(
            [SweepJob.from_composed(self.compose(texts, k), texts) for k, texts in numbered], folder
        )
        self.launched |= {job.folder: job for job in jobs}
        asked: Any = OmegaConf.to_container(self.config.hydra.overrides.task)
        of_batch = {job.folder: job for job in jobs}.values()
        remaining = [job for job in of_batch if not is_finished(job)]
        page = self._show(folder, jobs, remaining)
        with (
            hold(folder),
            open_parent_run(folder, [*self.launched.values()], asked, afresh=False) as recorder,
            keep_live(page, more=True),
        ):
            for job in remaining:
                await_end(job)
            self.run(remaining, recorder)
        return [_build_job_return(job, status.read(job.folder)) for job in jobs]

    def _show(
        self, folder: Path, jobs: Sequence[SweepJob], remaining: Sequence[SweepJob]
    ) -> LivePage:
        """The page of all batches so far. Which is the last nobody tells a launcher: the page says
        so when the process ends.
        """
        if self.page is None:
            self.page = LivePage(folder)
            self.page.print_address()
            atexit.register(self.page.write, "ended")
        self.page.add(jobs, remaining)
        return self.page

    def run(self, jobs: Sequence[SweepJob], recorder: Recorder) -> list[Status]:
        """Run all jobs, have each logged, and return how they ended, in their order."""
        compile_kernels(jobs)
        if self.workers.backend in FORKING:
            recorder.parent()
        callbacks = self.hydra_context.callbacks
        jobs = [job if job.hydra is None else replace(job, callbacks=callbacks) for job in jobs]
        ends: dict[Path, Status] = {}
        results = self._results(jobs)
        waiting = {job.folder for job in jobs}  # to be logged
        try:
            with show_progress(jobs) as note, contextlib.closing(results):
                for job, end in results:
                    ends[job.folder] = end or self._record_kill(job)
                    note(job, ends[job.folder])
                    recorder.log(job.folder)
                    waiting.discard(job.folder)
        except KeyboardInterrupt:
            for folder in filter(_has_ended, waiting):  # the few that ended since
                recorder.log(folder)
            raise
        return [ends[job.folder] for job in jobs]

    def _results(
        self, jobs: Sequence[SweepJob]
    ) -> Generator[tuple[SweepJob, Status | None], None, None]:
        """Each job and how it ended, as they are done; None where its worker was killed each time.

        What workers of a cluster have done comes through it: they may share no disk with this one.
        """
        if self.workers.backend not in DISTANT:
            yield from self.workers.results(work, jobs, self.tries, _find_end)
            return
        packed = [pack_job(job) for job in jobs]
        results = self.workers.results(work_elsewhere, packed, self.tries)
        with contextlib.closing(results):
            for job, delivery in results:
                yield job, delivery and unpack_job(job, delivery)

    def _record_kill(self, job: SweepJob) -> Status:
        """The end of a job that killed its worker each time."""
        message = (
            f"its worker was killed each of the {self.tries} times it was run; is there enough"
            " memory for it?"
        )
        end = replace(job.status, status=FAILED, message=message)
        end.end(job.folder)
        return end


def _find_end(job: SweepJob) -> Status | bool:
    """The end that a job has written whose worker did not answer, or whether it had begun."""
    state = status.read_newest(job.folder)
    if state is not None and state.status in ENDED:
        return state
    return state is not None and state.status == RUNNING


def _has_ended(folder: Path) -> bool:
    """Whether the job in a folder has ended well."""
    state = status.read_newest(folder)
    return state is not None and state.status == FINISHED


def compile_kernels(jobs: Sequence[SweepJob]) -> None:
    """Compile the kernels of the jobs' models, once for each, so that the workers find them on
    disk.
    """
    import json

    seen = set()
    for job in jobs:
        key = json.dumps([job.config["model"], job.config["data"]], sort_keys=True)
        if key in seen:
            continue
        seen.add(key)
        with contextlib.suppress(Exception):  # the job itself will say
            problem = Job(job.config, job.choices, job.folder).problem
            middle = (problem.lower + problem.upper)[None] / 2
            problem.objective(middle)
            problem.residuals(middle)


class Ended(JobReturn):
    """How a job ended, without the line that Hydra prints beside the error."""

    @property
    def return_value(self) -> Any:
        """The value that the job returned; what it raised is raised where it failed."""
        if self.status == JobStatus.FAILED:
            raise self._return_value
        return self._return_value

    @return_value.setter
    def return_value(self, value: Any) -> None:
        self._return_value = value


def _build_job_return(job: SweepJob, end: Status | None) -> JobReturn:
    """How a job ended, in Hydra's terms."""
    if end is not None and end.status != FAILED:
        return Ended(
            job.overrides, status=JobStatus.COMPLETED, _return_value=job.select_returned(end)
        )
    why = end.message if end else "its worker was killed or never started"
    return Ended(
        job.overrides, status=JobStatus.FAILED, _return_value=UserError(f"job {job.name}: {why}")
    )
