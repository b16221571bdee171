"""`hydra/sweeper=grid`: every combination once, whatever launcher runs it."""

import itertools
import os
import sys
import webbrowser
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.core.plugins import Plugins
from hydra.plugins.sweeper import Sweeper
from omegaconf import OmegaConf

from tractexp.api.job import Job
from tractexp.blocks import Table
from tractexp.cli.chosen import refuse_unread
from tractexp.compat.hydra_plugins import NAMESPACE
from tractexp.configuration.plugin import build, get
from tractexp.configuration.refusal import get_first_line
from tractexp.errors import Stopped, UserError
from tractexp.storage import files
from tractexp.storage.run_folder import hold
from tractexp.sweep import status
from tractexp.sweep.compose import Composer
from tractexp.sweep.job import SweepJob, find_shared_overrides
from tractexp.sweep.launcher import Cores
from tractexp.sweep.live import PAGE, LivePage, keep_live
from tractexp.sweep.parent import open_parent_run
from tractexp.sweep.placing import await_end, is_finished, list_placing_overrides, place, settle
from tractexp.sweep.recorder import Recorder
from tractexp.sweep.status import FAILED, INTERRUPTED
from tractexp.text.progress import say
from tractexp.text.wording import count_noun
from tractexp.tracking.sweepfile import MULTIRUN, PAGES

REPEAT = "repeat the command to go on with the jobs that are left"


@dataclass
class GridConfig:
    """Schema of `hydra.sweeper`."""

    _target_: str = f"{NAMESPACE}.Grid"
    params: dict[str, str] | None = None  # as on the command line: {"seed": "range(0,30)"}
    redo: bool = False  # run finished jobs again
    compare: bool = True  # end a sweep of several variants and seeds with the page of task=compare
    # settings of that task for it: {bbob: 3}
    comparison: dict[str, Any] = field(default_factory=dict)
    open: bool = True  # show that page, where there is a desktop and somebody at it


class Grid(Sweeper):
    """Runs every combination of the swept values that is not finished yet, and says what became of
    them.

    Raises `UserError` for a sweep without jobs, and at its end where jobs have failed.
    """

    def __init__(
        self,
        params: Mapping[str, str] | None,
        redo: bool,
        compare: bool,
        comparison: Mapping[str, Any],
        open: bool,
    ):
        """A sweep over every combination of values, as `hydra.sweeper` says."""
        self.params, self.redo, self.open = params or {}, redo, open
        self.comparison = {**comparison} if compare else None
        self.page: LivePage | None = None  # None where there is nothing to run

    def setup(self, *, hydra_context: Any, task_function: Any, config: Any) -> None:
        """Take Hydra's loader and make the launcher."""
        self.loader = hydra_context.config_loader
        self.config: Any = config
        self.launcher: Any = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config
        )

    def sweep(self, arguments: list[str]) -> None:
        """Compose all jobs, run those that are not done, and compare what they came to."""
        arguments = [*(f"{key}={values}" for key, values in self.params.items()), *arguments]
        folder = Path(self.config.hydra.sweep.dir).absolute()
        comparison = self._comparison(folder)  # refused before the jobs, not after
        composed = self._compose_jobs(arguments)
        with hold(folder):  # of two processes with one command, the second ends
            jobs = place(composed, folder)
            self._perform(jobs, folder, arguments)
            self._conclude(jobs, comparison)

    def _perform(self, jobs: list[SweepJob], folder: Path, arguments: list[str]) -> None:
        """Run what remains of the jobs, and say what is kept."""
        remaining = [job for job in jobs if self.redo or not is_finished(job)]
        say(f"sweep: {count_noun(len(jobs), 'job')} in {folder}")
        if done := len(jobs) - len(remaining):
            say(f"  {done} of them are finished and kept; hydra.sweeper.redo=true runs them again")
        if remaining:
            # what an earlier sweep came to goes before its configuration does
            if (folder / MULTIRUN).exists():
                for name in PAGES:
                    (folder / name).unlink(missing_ok=True)
            files.write(folder / MULTIRUN, OmegaConf.to_yaml(self.config))
            self.page = LivePage(folder)
            self.page.print_address()
            self.page.add(jobs, remaining)
            with (
                open_parent_run(folder, jobs, arguments, afresh=self.redo) as recorder,
                keep_live(self.page),
            ):
                self._run(remaining, recorder)

    def _compose_jobs(self, arguments: list[str]) -> list[SweepJob]:
        """The jobs of the sweep, composed and without duplicates, not yet placed."""
        compose = Composer(self.loader, self.config)
        parsed = OverridesParser.create(self.loader).parse_overrides(arguments)
        choices = {override.get_key_element(): list_values(override) for override in parsed}
        jobs: dict[str, SweepJob] = {}
        for number, combination in enumerate(itertools.product(*choices.values())):
            overrides = [f"{key}={value}" for key, value in zip(choices, combination, strict=True)]
            job = SweepJob.from_composed(compose(overrides, number), overrides)
            refuse_unread(get("task", job.config["task"]["name"]), job.given)
            jobs.setdefault(job.configuration, job)
        return [replace(job, alone=len(jobs) == 1) for job in jobs.values()]

    def _comparison(self, folder: Path) -> Any:
        """The task that compares the variants at the end; None where it is not wanted."""
        if self.comparison is None:
            return None
        return build("task", {"name": "compare", "sweep": str(folder), **self.comparison})

    def _conclude(self, jobs: Sequence[SweepJob], comparison: Any) -> None:
        """Compare the variants, where there is something to compare, and say which jobs failed."""
        if comparison is None or not is_comparable(jobs):
            print_summary(jobs)
            first = jobs[0]
            pages = sorted(first.folder.glob("*.html")) if first.alone else [first.sweep / PAGE]
            for page in filter(Path.is_file, pages):
                say(f"  {page}")
                self._open_page(page)
        else:
            folder = jobs[0].sweep
            say()
            comparison.run(Job(jobs[0].config, jobs[0].choices, folder))
            if self.page is not None:
                self.page.write("ended")  # and leads to the comparison
            self._open_page(folder / "comparison.html")
        if failed := print_failures(jobs):
            raise UserError(failed)

    def _open_page(self, page: Path) -> None:
        """Show a page where that is wanted."""
        if self.open:
            open_page(page)

    def _run(self, jobs: Sequence[SweepJob], recorder: Recorder) -> None:
        """Run the jobs by the launcher; each has an end, whatever happens to its worker."""
        for job in jobs:
            await_end(job)
        end = FAILED
        problem = "it ended without a word: its worker was killed or never started"
        try:
            if isinstance(self.launcher, Cores):
                self.launcher.run(jobs, recorder)
            else:
                recorder.parent()  # which the jobs look up themselves
                batch = [[*job.overrides, *list_placing_overrides(job)] for job in jobs]
                self.launcher.launch(batch, initial_job_idx=0)
        except KeyboardInterrupt as stop:
            end = INTERRUPTED
            problem = ""
            raise Stopped(
                f"the sweep is interrupted; {REPEAT}", getattr(stop, "code", 130)
            ) from None
        except UserError:
            raise
        except Exception as error:
            problem = f"the launcher gave up: {get_first_line(error)}"
        finally:
            for job in jobs:
                if end != INTERRUPTED or job.folder.exists():  # a job that has not begun has no end
                    settle(job, end, problem)


def list_values(override: Override) -> list[str]:
    """The values an override asks for: one, or those it sweeps over. Raises `UserError` where they
    cannot be listed.
    """
    if not override.is_sweep_override():
        return [override.get_value_element_as_str()]
    if not override.is_discrete_sweep():
        raise UserError(
            f"{override.input_line}: a sweep over a grid needs values to count, such as 0.1,0.2,0.5"
            " or range(0,1,0.1)"
        )
    values = [*override.sweep_string_iterator()]
    if not values:
        raise UserError(
            f"the sweep has no jobs: {override.input_line} is empty; a range ends before its second"
            " number, as range(0,30) is 0 to 29, and a glob needs a name that matches"
        )
    return values


def is_comparable(jobs: Sequence[SweepJob]) -> bool:
    """Whether a sweep holds several variants under several seeds, of which more than one job has
    ended well.
    """
    common = find_shared_overrides(jobs)
    variants = {job.variant(common) for job in jobs}
    if len(variants) < 2 or len({job.config["seed"] for job in jobs}) < 2:
        return False
    ended = (job for job in jobs if status.read_objective(job.folder) is not None)
    return len(list(itertools.islice(ended, 2))) > 1


def open_page(page: Path) -> None:
    """Open a page in the browser of a desktop; a terminal elsewhere, or none, is left alone."""
    desktop = sys.platform in ("darwin", "win32") or any(
        map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY"))
    )
    if sys.stdout.isatty() and desktop:
        webbrowser.open(page.absolute().as_uri())


def print_summary(jobs: Sequence[SweepJob]) -> None:
    """Print where the searches of a sweep ended, by variant and data."""
    common = find_shared_overrides(jobs)
    objectives: dict[str, list[float]] = {}
    for job in jobs:
        value = status.read_objective(job.folder)
        if value is not None:
            objectives.setdefault(job.variant(common), []).append(value)
    if objectives:
        say()
        rows = sorted((sorted(values), name) for name, values in objectives.items())
        cells = [[n, str(len(v)), *(f"{x:.4e}" for x in (v[0], median(v), v[-1]))] for v, n in rows]
        for line in str(
            Table(["optimizer", "jobs", "best objective", "median", "worst"], cells)
        ).splitlines():
            say(line)
        say("objectives in pu² at the end of the search, before the estimate is polished")


def print_failures(jobs: Sequence[SweepJob]) -> str:
    """Print which jobs failed and why; returns the sentence of the error, "" where none did."""
    common = find_shared_overrides(jobs)
    ends = [(job, status.read(job.folder)) for job in jobs]
    failed = [(job, end.message) for job, end in ends if end is not None and end.status == FAILED]
    if not failed:
        return ""
    say()
    say("failed jobs")
    for job, why in failed:  # not in columns: they would cut the sentences
        say(f"  {job.name:>4}  {' '.join(o for o in job.overrides if o not in common)}: {why}")
    return (
        f"{len(failed)} of {len(jobs)} jobs failed, as listed; what they printed is in output.txt"
        f" of their folders in {jobs[0].sweep}, an unexpected error in traceback.txt; {REPEAT}"
    )
