"""`hydra/launcher=slurm` and `slurm_local`: the launchers `submitit_slurm` and `submitit_local` of
hydra-submitit-launcher, with several jobs of a sweep in one task.

A task waits in a queue and then imports for seconds; short jobs share one by
`hydra.launcher.jobs_per_task`. One that fails does not touch those after it.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hydra.core.utils import JobReturn
from hydra_plugins.hydra_submitit_launcher.config import LocalQueueConf, SlurmQueueConf
from hydra_plugins.hydra_submitit_launcher.submitit_launcher import (
    BaseSubmititLauncher,
    LocalLauncher,
    SlurmLauncher,
)

from tractexp.compat.hydra_plugins import NAMESPACE
from tractexp.errors import check_range


@dataclass
class SlurmBatchesConfig(SlurmQueueConf):
    """Schema of `hydra.launcher`."""

    _target_: str = f"{NAMESPACE}.SlurmBatches"
    jobs_per_task: int = 1  # run one after another in one task of the job array


@dataclass
class LocalBatchesConfig(LocalQueueConf):
    """Schema of `hydra.launcher`."""

    _target_: str = f"{NAMESPACE}.LocalBatches"
    jobs_per_task: int = 1  # run one after another in one process


class Batches(BaseSubmititLauncher):
    """Hands each task as many jobs as `jobs_per_task` says, their overrides as JSON.

    Raises `UserError` for a number below 1.
    """

    def __init__(self, jobs_per_task: int, **params: Any):
        """A launcher of tasks of so many jobs each."""
        super().__init__(**params)
        self.jobs_per_task = jobs_per_task

    def setup(self, *, hydra_context: Any, task_function: Any, config: Any) -> None:
        """Raise `UserError` for fewer jobs a task than one."""
        check_range("hydra.launcher.jobs_per_task", self.jobs_per_task, 1)
        super().setup(hydra_context=hydra_context, task_function=task_function, config=config)

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Submit the jobs in tasks, and return what each came to."""
        numbered = enumerate(job_overrides, start=initial_job_idx)
        jobs = [json.dumps([number, list(overrides)]) for number, overrides in numbered]
        size = self.jobs_per_task
        tasks = [jobs[k : k + size] for k in range(0, len(jobs), size)]
        returned: Any = super().launch(tasks, initial_job_idx)
        return [one for of_task in returned for one in of_task]

    def __call__(
        self,
        sweep_overrides: list[str],
        job_dir_key: str,
        job_num: int,
        job_id: str,
        singleton_state: Any,
    ) -> Any:
        """Run one task: its jobs one after the other, in one process."""
        run = super().__call__
        returned = []
        for number, overrides in map(json.loads, sweep_overrides):
            returned.append(run(overrides, job_dir_key, number, job_id, singleton_state))
        return returned

    def __reduce__(self) -> Any:
        """How another process makes it again."""
        return _restore, (type(self).__name__, vars(self))


class SlurmBatches(Batches, SlurmLauncher):
    """Tasks of a SLURM job array."""


class LocalBatches(Batches, LocalLauncher):
    """Processes of this computer."""


LAUNCHERS = {
    "slurm": (SlurmBatches, SlurmBatchesConfig),
    "slurm_local": (LocalBatches, LocalBatchesConfig),
}


def _restore(name: str, state: dict[str, Any]) -> Batches:
    """A launcher in the process of a task, where the module that Hydra looks it up in is not."""
    (cls,) = (cls for cls, _ in LAUNCHERS.values() if cls.__name__ == name)
    launcher = cls.__new__(cls)
    vars(launcher).update(state)
    return launcher
