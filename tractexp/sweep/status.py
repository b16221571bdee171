"""The state of a job of a sweep: `status.json` in its folder."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

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


def objective(folder: Path, *, of_search: bool = False) -> float | None:
    """The objective of the estimate in the job's `result.json`; None where its task writes none.

    Of the search: where that ended, by which optimizers are compared.
    """
    try:
        result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
        return float(((of_search and result.get("search")) or result)["objective"])
    except (OSError, ValueError, TypeError, KeyError):
        return None
