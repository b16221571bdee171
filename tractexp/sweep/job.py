"""One job of a sweep, and how it is run: isolated, silent, with its end on disk."""

import shutil
import time
import traceback
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tractexp import credentials, files
from tractexp.api.task import Job, variant
from tractexp.cli.chosen import given
from tractexp.errors import UserError
from tractexp.sweep import identity
from tractexp.sweep.output import printing_to
from tractexp.sweep.status import FAILED, FINISHED, RUNNING, Status
from tractexp.tracking.sweepfile import parent_of

OUTPUT, TRACEBACK = "output.txt", "traceback.txt"


@dataclass(frozen=True)
class SweepJob:
    """What a worker is sent. `configuration` and `inputs` say whether two jobs are the same."""

    config: Mapping[str, Any]
    choices: Mapping[str, str]
    overrides: tuple[str, ...]
    configuration: str
    inputs: str
    folder: Path
    given: Mapping[str, str] = field(default_factory=dict)  # what the user chose, {"optimizer": "pso"}

    @classmethod
    def of(cls, config: Mapping[str, Any], choices: Mapping[str, str], overrides: Any, folder: Path) -> "SweepJob":
        """A job from its composed configuration; Hydra's own choices are left out. Raises `UserError` for passwords."""
        credentials.check("", config)
        groups = {g: c for g, c in sorted(choices.items()) if c and g != "experiment" and not g.startswith("hydra/")}
        digest = identity.configuration(config, groups)
        chosen = given(overrides, choices)
        return cls(config, groups, tuple(overrides), digest, identity.inputs(config), folder, chosen)

    def variant(self, common: Collection[str]) -> str:
        """What the optimizer is called with the settings that it does not share with all jobs: the `common` ones."""
        own = given((text for text in self.overrides if text not in common), self.choices)
        data = f" on {self.choices['data']}" if "data" in own else ""
        return variant(self.choices["optimizer"], own) + data

    @property
    def status(self) -> Status:
        """How this job stands when it starts."""
        return Status(RUNNING, "", self.configuration, self.inputs, 0.0, self.choices, self.config["seed"])


def shared(jobs: Sequence[SweepJob]) -> set[str]:
    """The overrides that all jobs of a sweep have; none of a sweep of one."""
    return set.intersection(*(set(job.overrides) for job in jobs)) if len(jobs) > 1 else set()


def work(job: SweepJob) -> Status:
    """Run a job in its own folder, emptied before. Never raises: what goes wrong is in the status returned.

    What the task prints goes to `output.txt`; an unexpected error leaves its `traceback.txt`.
    """
    _prepare(job)
    job.status.write(job.folder)
    started = time.perf_counter()
    output = files.Transcript(job.folder / OUTPUT)
    with output, printing_to(output):
        message = _run(job)
    status = FAILED if message else FINISHED
    ended = replace(job.status, status=status, message=message, seconds=time.perf_counter() - started)
    ended.write(job.folder)
    return ended


def run_job(config: Any) -> Status:
    """Run a job that another launcher of Hydra's has composed and placed, as on a cluster."""
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    hydra = HydraConfig.get()
    plain: Any = OmegaConf.to_container(config, resolve=True)
    overrides: Any = OmegaConf.to_container(hydra.overrides.task)
    return work(SweepJob.of(plain, dict(hydra.runtime.choices), overrides, Path(hydra.runtime.output_dir)))


def _run(job: SweepJob) -> str:
    """Run the task; returns what went wrong, in one line, or ""."""
    from tractexp.cli.run import perform

    try:
        perform(Job(job.config, job.choices, job.folder, parent_of(job.folder.parent), in_sweep=True, given=job.given))
    except UserError as error:
        return str(error)
    except (Exception, SystemExit) as error:
        files.write(job.folder / TRACEBACK, traceback.format_exc())
        return traceback.format_exception_only(error)[-1].strip() or type(error).__name__
    return ""


def _prepare(job: SweepJob) -> None:
    """An empty folder with the files a Hydra job has in `.hydra`."""
    import yaml

    if job.folder.exists():
        shutil.rmtree(job.folder)
    hydra = job.folder / ".hydra"
    runtime = {"cwd": str(Path.cwd()), "output_dir": str(job.folder), "choices": dict(job.choices)}
    around = {"hydra": {"mode": "MULTIRUN", "overrides": {"task": list(job.overrides)}, "runtime": runtime}}
    contents = {"config": dict(job.config), "overrides": list(job.overrides), "hydra": around}
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # ten times as fast, where PyYAML was built with it
    for name, content in contents.items():
        text = yaml.dump(content, Dumper=dumper, sort_keys=False, allow_unicode=True)
        files.write(hydra / f"{name}.yaml", text, lasting=False)
