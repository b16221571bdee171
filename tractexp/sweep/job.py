"""One job of a sweep, and how it is run: isolated, silent, with its end on disk."""

import contextlib
import functools
import json
import time
import traceback
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tractexp.api.job import Job, name_variant, read_events
from tractexp.cli.chosen import collect_chosen_settings
from tractexp.cli.configuration import list_named_files
from tractexp.configuration import run_command
from tractexp.errors import UserError
from tractexp.storage import credentials, files
from tractexp.storage.run_folder import RunFolder, find_holder, run_folder
from tractexp.sweep import identity, status
from tractexp.sweep.output import redirect_prints
from tractexp.sweep.status import FAILED, FINISHED, RUNNING, Status, select_returned_metrics
from tractexp.sweep.surroundings import surround_job
from tractexp.tracking.sweepfile import find_sweep_folder, read_parent

OUTPUT, TRACEBACK = "output.txt", "traceback.txt"
MOST_KEPT_RECORDS = 4  # choices of data that a worker keeps: the jobs of a sweep share one


@dataclass(frozen=True)
class Composed:
    """One job of a sweep, resolved. `subdir` is "" where its number is its folder's name.

    `hydra` is Hydra's own whole configuration of the job where something of the user's reads it: a
    callback, a logger.
    """

    config: Mapping[str, Any]
    choices: Mapping[str, str]
    subdir: str = ""
    hydra: Any = None


@dataclass(frozen=True)
class SweepJob:
    """A job as a worker is sent it. `configuration` and `inputs` say whether two jobs are
    the same.
    """

    config: Mapping[str, Any]
    choices: Mapping[str, str]
    overrides: tuple[str, ...]
    configuration: str
    inputs: str
    folder: Path
    # what the user chose, {"optimizer": "pso"}
    given: Mapping[str, str] = field(default_factory=dict)
    subdir: str = ""  # the folder's name within the sweep's; "": the job's number
    alone: bool = False  # the only job of its sweep: somebody looks at it
    # its whole configuration, where a callback or a logger of the user's reads that
    hydra: Any = None
    callbacks: Any = None  # of Hydra's, where there is `hydra`
    events: Any = None  # its records (`Events`), for a worker that cannot read them
    command: tuple[str, ...] = ()  # the arguments of the sweep's command, for other processes

    @classmethod
    def from_composed(
        cls, composed: Composed, overrides: Sequence[str], folder: Path = Path()
    ) -> "SweepJob":
        """A job as it was composed; Hydra's own choices are left out. Raises `UserError` for
        passwords.
        """
        config, choices = composed.config, composed.choices
        credentials.check("", config)
        groups = {
            g: c
            for g, c in sorted(choices.items())
            if c and g != "experiment" and not g.startswith("hydra/")
        }
        return cls(
            config,
            groups,
            tuple(overrides),
            identity.hash_configuration(config, groups),
            identity.hash_inputs(config),
            folder,
            collect_chosen_settings(overrides, choices),
            composed.subdir,
            hydra=composed.hydra,
            command=run_command.list_arguments(),
        )

    @property
    def sweep(self) -> Path:
        """The folder of the sweep."""
        return (
            self.folder.parents[len(Path(self.subdir).parts) - 1]
            if self.subdir
            else self.folder.parent
        )

    @property
    def name(self) -> str:
        """The job's name within its sweep."""
        return self.subdir or self.folder.name

    def variant(self, common: Collection[str]) -> str:
        """The name of the optimizer with the settings that it does not share with all jobs: the
        `common` ones.
        """
        own = collect_chosen_settings(
            (text for text in self.overrides if text not in common), self.choices
        )
        data = f" on {self.choices['data']}" if "data" in own else ""
        return name_variant(self.choices["optimizer"], own) + data

    @property
    def returns(self) -> Sequence[str] | None:
        """The metrics that it gives back."""
        return self.config.get("sweep", {}).get("returns")

    def select_returned(self, end: Status) -> float | list[float] | None:
        """The metrics that an ended job gives back to an optimizer over jobs."""
        return (
            select_returned_metrics(end.metrics, self.returns) if end.status == FINISHED else None
        )

    @property
    def status(self) -> Status:
        """How this job stands when it starts."""
        return Status(
            RUNNING, "", self.configuration, self.inputs, 0.0, self.choices, self.config["seed"]
        )


def find_shared_overrides(jobs: Sequence[SweepJob]) -> set[str]:
    """The overrides that all jobs of a sweep have; none of a sweep of one."""
    return set.intersection(*(set(job.overrides) for job in jobs)) if len(jobs) > 1 else set()


def work(job: SweepJob, logs: bool = False) -> Status:
    """Run a job in its own folder. Never raises: what goes wrong is in the status returned.

    Results of an earlier time are there until the new ones are whole, as those of a single run; a
    job that fails leaves them. Unless it `logs`, it leaves that to who reads its folder
    (`recorder`): to import MLflow takes longer than many jobs.

    What the task prints goes to `output.txt`; an unexpected error leaves its `traceback.txt`.
    """
    try:
        with open_folder(job) as place:
            return _work_there(job, place, logs)
    except UserError as error:
        ended = replace(job.status, status=FAILED, message=str(error))
        if not find_holder(job.folder):
            with contextlib.suppress(UserError):
                ended.end(job.folder)
        return ended


def open_folder(job: SweepJob) -> contextlib.AbstractContextManager[RunFolder]:
    """The folder of a job, held for this process. Raises `UserError` where another one is at work
    there.
    """
    return run_folder(job.folder, _describe_configuration(job), list_named_files(job.config))


def _work_there(job: SweepJob, place: RunFolder, logs: bool) -> Status:
    """Run a job in the folder that is held for it."""
    job.status.begin(job.folder)
    (job.folder / TRACEBACK).unlink(missing_ok=True)
    started = time.perf_counter()
    output = files.Transcript(job.folder / OUTPUT)
    measured: dict[str, float] = {}
    with output, redirect_prints(output), surround_job(job) as conclude:
        message = _run_task(job, place, measured, logs)
        seconds = time.perf_counter() - started
        ended = replace(
            job.status,
            status=FAILED if message else FINISHED,
            message=message,
            seconds=seconds,
            metrics=files.make_plain(measured),
        )
        conclude(ended)
    ended.end(job.folder)
    return ended


def run_job(config: Any) -> float | list[float] | None:
    """Run a job that another launcher of Hydra's has composed and placed, as on a cluster; returns
    what it is worth.

    Raises `UserError` where its folder is another job's, and where it failed and the sweeper is not
    ours, which reads how jobs ended from their folders.
    """
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    from tractexp.compat.hydra_plugins import NAMESPACE

    hydra = HydraConfig.get()
    plain: Any = OmegaConf.to_container(config, resolve=True)
    overrides: Any = OmegaConf.to_container(hydra.overrides.task)
    composed = Composed(plain, dict(hydra.runtime.choices), str(hydra.sweep.subdir))
    job = SweepJob.from_composed(composed, overrides, Path(hydra.runtime.output_dir))
    there = status.read(job.folder)
    if there is not None and there.configuration != job.configuration:
        raise UserError(
            f"{job.folder} holds a job of another sweep; name another folder by hydra.sweep.dir"
        )
    end = work(job, logs=True)
    if end.status == FAILED and not str(hydra.sweeper.get("_target_")).startswith(NAMESPACE):
        raise UserError(f"job {job.name}: {end.message}")
    return job.select_returned(end)


def _run_task(job: SweepJob, place: RunFolder, measured: dict[str, float], logs: bool) -> str:
    """Run the task, which notes what it measures; returns what went wrong, in one line, or ""."""
    from tractexp.cli.run import perform

    if not run_command.get_command():  # in a process that no command started
        run_command.remember_command([*job.command])
    try:
        parent, of_many = read_parent(find_sweep_folder(job.folder)), not job.alone
        about: Any = {
            "in_sweep": True,
            "of_many": of_many,
            "logs": logs,
            "given": job.given,
            "measured": measured,
            "read_events": functools.partial(_read_events, job),
            "placed": place.place,
        }
        perform(Job(job.config, job.choices, job.folder, parent, **about))
        select_returned_metrics(measured, job.returns)
    except UserError as error:
        return str(error)
    except (Exception, SystemExit) as error:
        files.write(job.folder / TRACEBACK, traceback.format_exc())
        return traceback.format_exception_only(error)[-1].strip() or type(error).__name__
    return ""


def _read_events(job: SweepJob, data: Mapping[str, Any]) -> Any:
    """The events of a choice of data as a job has them."""
    brought = job.events is not None and data == job.config["data"]
    return job.events if brought else read_shared_events(data, job.inputs)


def read_shared_events(data: Mapping[str, Any], inputs: str) -> Any:
    """The events of a choice of data, which the jobs of a worker share; `inputs` is of its
    files.
    """
    return _read_once(json.dumps(data, sort_keys=True, default=str), inputs)


@functools.lru_cache(MOST_KEPT_RECORDS)
def _read_once(data: str, inputs: str) -> Any:
    """The events of a configuration of data, read once in a process while the files stay as they
    are.
    """
    return read_events(json.loads(data))


def _describe_configuration(job: SweepJob) -> dict[str, str]:
    """The files that a Hydra job has in `.hydra`, by their names."""
    import yaml

    runtime = {"cwd": str(Path.cwd()), "output_dir": str(job.folder), "choices": dict(job.choices)}
    around = {
        "hydra": {
            "mode": "MULTIRUN",
            "overrides": {"task": list(job.overrides)},
            "runtime": runtime,
        }
    }
    contents = {"config": dict(job.config), "overrides": list(job.overrides), "hydra": around}
    # ten times as fast, where PyYAML was built with it
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    return {
        f"{name}.yaml": yaml.dump(content, Dumper=dumper, sort_keys=False, allow_unicode=True)
        for name, content in contents.items()
    }
