"""From a composed configuration to a task that runs: the same for a single job and for one of a sweep."""

import os
import shutil
from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.plugin import build
from tractexp.tasks.task import Job

SWEEP = "TRACTEXP_SWEEP"  # environment variable that carries the sweep's run id to its jobs


def run(config: Any) -> None:
    """Check the configuration and run its task. A refused job leaves no folder behind."""
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    from tractexp.config import check

    hydra = HydraConfig.get().runtime
    folder = Path(hydra.output_dir)
    try:
        plain: Any = OmegaConf.to_container(config, resolve=True)
        check(plain)
        job = Job(plain, dict(hydra.choices), folder, os.environ.get(SWEEP) or None)
        build("task", plain["task"]).run(job)
    except UserError:
        if {p.name for p in folder.iterdir()} <= {".hydra"}:
            shutil.rmtree(folder)
        raise
