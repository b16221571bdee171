"""From a composed configuration to a task that runs."""

import contextlib
from pathlib import Path
from typing import Any

from tractexp.api.job import Job
from tractexp.cli import configuration
from tractexp.cli.chosen import collect_chosen_settings, refuse_unread
from tractexp.configuration import run_command
from tractexp.configuration.plugin import build, get
from tractexp.errors import Stopped, UserError
from tractexp.storage import credentials
from tractexp.storage.run_folder import RunFolder, run_folder

TERMINATED = 143  # the exit code of a process that SIGTERM ended


def run(config: Any) -> None:
    """Run the task of a composed configuration by itself. A refused job leaves no folder behind."""
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    hydra = HydraConfig.get()
    folder, choices = Path(hydra.runtime.output_dir), dict(hydra.runtime.choices)
    try:
        plain: Any = OmegaConf.to_container(config, resolve=True)
        credentials.check("", plain)
    except UserError:
        with contextlib.suppress(OSError):  # where it is not empty
            folder.rmdir()
        raise
    with run_folder(
        folder, configuration.list_contents(config), configuration.list_named_files(plain)
    ) as place:
        try:
            run_command.remember_folder(folder)
            run_command.remember_roles(plain["data"].get("train"), plain["data"].get("validate"))
            perform(
                Job(
                    plain,
                    choices,
                    folder,
                    given=collect_chosen_settings(hydra.overrides.task, choices),
                    placed=place.place,
                )
            )
            place.conclude()
        except KeyboardInterrupt as stop:
            saved = keep_best_so_far(stop, place)
            raise Stopped(
                f"{_describe_stop(stop)}; {saved or describe_stopped_task(config)}",
                getattr(stop, "code", 130),
            ) from None


def _describe_stop(stop: KeyboardInterrupt) -> str:
    """How a run was ended."""
    return "ended by SIGTERM" if getattr(stop, "code", 130) == TERMINATED else "interrupted"


def keep_best_so_far(stop: KeyboardInterrupt, place: RunFolder) -> str:
    """Keep what a search had found when it was stopped; a sentence on it, "" where there is
    nothing.
    """
    if (state := getattr(stop, "result", None)) is None:
        return ""
    from tractexp.identification.result import write_history

    path, _ = place.place(
        lambda folder: [
            state.result.write(folder / "interrupted.json"),
            write_history(folder / "history.csv", state.search_result.history),
        ]
    )
    return (
        f"the best of {state.result.simulations} simulations so far, objective"
        f" {state.result.objective:.4g} pu², is in {path}; it is neither polished nor judged, and"
        " not logged"
    )


def describe_stopped_task(config: Any) -> str:
    """The sentence on a task that was stopped and has kept nothing in its folder."""
    if getattr(get("task", config["task"]["name"]), "resumes", False):
        return "the same command goes on where it was"
    return "nothing was logged for this run"


def perform(job: Job) -> None:
    """Check a job's configuration and run its task: the same for a single job and for one of a
    sweep.
    """
    from tractexp.configuration.schema import check

    check(job.config)
    task = build("task", job.config["task"])
    refuse_unread(task, job.given, task.needless())
    task.run(job)
