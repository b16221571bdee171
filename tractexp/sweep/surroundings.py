"""What Hydra puts around a job, where something of the user's reads it: loggers, and the callbacks
of others.
"""

import contextlib
import logging
import os
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from tractexp.sweep.status import FAILED, Status

if TYPE_CHECKING:
    from tractexp.sweep.job import SweepJob


@contextlib.contextmanager
def surround_job(job: "SweepJob") -> "Iterator[Callable[[Status], None]]":
    """Set up loggers, begin the callbacks, and yield what is to be told how the job ended.

    Where nothing of the user's reads Hydra's configuration, nothing is done.
    """
    if job.hydra is None:
        yield lambda end: None
        return
    config = _place_configuration(job)
    job.callbacks.on_job_start(config=config, task_function=None)

    def conclude(end: Status) -> None:
        job.callbacks.on_job_end(
            config=config, job_return=_convert_to_hydra_return(job, config, end)
        )

    yield conclude
    for handler in logging.getLogger().handlers:
        handler.flush()


def _place_configuration(job: "SweepJob") -> Any:
    """Hydra's configuration of the job, which ${hydra:...} refers to; its loggers are at work."""
    from hydra.core.hydra_config import HydraConfig
    from hydra.core.utils import configure_log
    from omegaconf import open_dict, read_write

    config = job.hydra
    with read_write(config.hydra.runtime), open_dict(config.hydra.runtime):
        config.hydra.runtime.output_dir = str(job.folder)
    HydraConfig.instance().set_config(config)
    configure_log(config.hydra.job_logging, config.hydra.verbose)
    return config


def _convert_to_hydra_return(job: "SweepJob", config: Any, end: Status) -> Any:
    """The end of a job in Hydra's terms."""
    from hydra.core.utils import JobReturn, JobStatus

    failed = end.status == FAILED
    status = JobStatus.FAILED if failed else JobStatus.COMPLETED
    value: Any = RuntimeError(end.message) if failed else job.select_returned(end)
    outcome = JobReturn(
        list(job.overrides), config, config, os.getcwd(), config.hydra.job.name, status
    )
    outcome.return_value = value
    return outcome
