"""The state of a job of a sweep: `status.json` in its folder."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tractexp.files import write_json

FILE = "status.json"
RUNNING, FINISHED, FAILED, INTERRUPTED = "running", "finished", "failed", "interrupted"


@dataclass(frozen=True)
class Status:
    """The content of `status.json`. A job that was killed has no end to report and stays "running"."""

    status: str
    message: str  # a sentence where it failed, "" otherwise
    configuration: str  # SHA-256 of the settings of the job
    inputs: str  # SHA-256 of the code and the data files it worked with
    seconds: float
    choices: Mapping[str, str]
    seed: int

    def write(self, folder: Path) -> None:
        write_json(folder / FILE, asdict(self))


def read(folder: Path) -> Status | None:
    """The status of the job in `folder`; None where there is none that can be read."""
    try:
        return Status(**json.loads((folder / FILE).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def objective(folder: Path) -> float | None:
    """The objective of the estimate in the job's `result.json`; None where its task writes none."""
    return _objective(folder, lambda result: result)


def search_objective(folder: Path) -> float | None:
    """The objective where the job's search ended, by which optimizers are compared."""
    return _objective(folder, lambda result: result.get("search") or result)


def _objective(folder: Path, of: Callable[[Any], Any]) -> float | None:
    try:
        return float(of(json.loads((folder / "result.json").read_text(encoding="utf-8")))["objective"])
    except (OSError, ValueError, TypeError, KeyError):
        return None
