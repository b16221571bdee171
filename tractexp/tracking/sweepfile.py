"""`sweep.json`, by which the jobs of a sweep, and later tasks, find its parent run."""

from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.storage import files

FILE = "sweep.json"
MULTIRUN = "multirun.yaml"  # the configuration that every sweeper leaves in a sweep's folder
PAGES = ("comparison.json", "comparison.html")  # of a sweep, written when its jobs have ended


def find_sweep_folder(job: Path) -> Path:
    """The folder of the sweep that a job's folder is of: `hydra.sweep.subdir` may put it several
    levels deep.
    """
    return next(
        (f for f in job.parents if (f / FILE).is_file() or (f / MULTIRUN).is_file()), job.parent
    )


def read_parent(folder: Path) -> str | None:
    """The run id of the sweep in `folder`; None where it is not logged."""
    return _read_content(folder).get("run")


def does_wait(folder: Path) -> bool:
    """Whether the run of the sweep in `folder` is still to be logged: its jobs then wait, too."""
    return "run" in (content := _read_content(folder)) and content["run"] is None


def _read_content(folder: Path) -> dict[str, Any]:
    """The content of the file of a sweep's folder; {} where it is none of ours."""
    try:
        content = files.read_json(folder / FILE, files.CONFIGURATION)
    except (OSError, UserError):
        return {}
    is_ours = isinstance(content, dict) and isinstance(content.get("run"), str | None)
    return content if is_ours else {}
