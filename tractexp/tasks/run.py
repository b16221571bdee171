"""From a composed configuration to a task that runs."""

import shutil
from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.plugin import build
from tractexp.tasks.given import given, refuse_unread
from tractexp.tasks.task import Job


def run(config: Any) -> None:
    """Run the task of a composed configuration by itself. A refused job leaves no folder behind."""
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    hydra = HydraConfig.get()
    folder, choices = Path(hydra.runtime.output_dir), dict(hydra.runtime.choices)
    try:
        plain: Any = OmegaConf.to_container(config, resolve=True)
        perform(Job(plain, choices, folder, given=given(hydra.overrides.task, choices)))
    except UserError:
        if {p.name for p in folder.iterdir()} <= {".hydra"}:
            shutil.rmtree(folder)
        raise


def perform(job: Job) -> None:
    """Check a job's configuration and run its task: the same for a single job and for one of a sweep."""
    from tractexp.schema import check

    check(job.config)
    task = build("task", job.config["task"])
    refuse_unread(task, job.given, task.needless())
    task.run(job)
