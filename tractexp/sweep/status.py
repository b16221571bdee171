"""The state of a job of a sweep: `status.json` in its folder.

Where a job is done again, `status.json` tells of the earlier time until this one has ended: so
whoever ends the process leaves a state that is true of the results beside it. Until then another
file says how far it is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tractexp.errors import UserError, list_allowed
from tractexp.storage import files
from tractexp.storage.files import write_json

FILE = "status.json"
AGAIN = ".tractexp.next.status.json"  # of a job that is done again, until that has ended
SEARCHED = "search_objective"  # the metric by which optimizers are compared
ESTIMATED = "objective"
RUNNING, FINISHED, FAILED, INTERRUPTED = "running", "finished", "failed", "interrupted"
ENDED = (FINISHED, FAILED)
KINDS: Mapping[str, Any] = {  # of the entries, which somebody else may have written
    "status": str,
    "message": str,
    "configuration": str,
    "inputs": str,
    "seconds": (int, float),
    "choices": dict,
    "seed": int,
    "metrics": dict,
}


@dataclass(frozen=True)
class Status:
    """The content of `status.json`. A job that was killed has no end to report and
    stays "running".
    """

    status: str
    message: str  # a sentence where it failed, "" otherwise
    configuration: str  # SHA-256 of the settings of the job
    inputs: str  # SHA-256 of the code and the data files it worked with
    seconds: float
    choices: Mapping[str, str]
    seed: int
    # as logged; None: never reached
    metrics: Mapping[str, float | None] = field(default_factory=dict)

    def metric(self, name: str) -> float | None:
        """A measured metric; None where the job has not ended well or its task measures no such
        thing.
        """
        value = self.metrics.get(name)
        return float(value) if value is not None and self.status == FINISHED else None

    def begin(self, folder: Path) -> None:
        """Write the state of a job that has not ended; an earlier end stays."""
        again = (folder / AGAIN).exists() or (folder / FILE).exists()
        write_json(folder / (AGAIN if again else FILE), asdict(self))

    def end(self, folder: Path) -> None:
        """Write how a job has ended."""
        write_json(folder / FILE, asdict(self))
        forget(folder)


def forget(folder: Path) -> None:
    """Let the earlier end stand, of a job that was to be done again."""
    (folder / AGAIN).unlink(missing_ok=True)


def read_newest(folder: Path) -> Status | None:
    """The status of the newest time that the job in `folder` was done or is; None where there is
    none.
    """
    return read(folder, AGAIN if (folder / AGAIN).exists() else FILE)


def read(folder: Path, name: str = FILE) -> Status | None:
    """The status of the job in `folder`; None where there is none that can be read."""
    try:
        state = Status(**files.read_json(folder / name, files.CONFIGURATION))
    except (OSError, TypeError, UserError):
        return None
    fits = all(isinstance(getattr(state, name), kinds) for name, kinds in KINDS.items())
    return state if fits else None


def read_objective(folder: Path, name: str = SEARCHED) -> float | None:
    """A metric of the job in `folder`, by default where its search ended; None where
    there is none.
    """
    end = read(folder)
    return end.metric(name) if end is not None else None


def select_returned_metrics(
    metrics: Mapping[str, float | None], names: Sequence[str] | None
) -> float | list[float] | None:
    """The metrics of these names, one or a list, which a job gives back to whoever optimizes over
    jobs.

    Without names where its search ended; None where its task searches for nothing. What was never
    reached is infinite.
    Raises `UserError` for a metric that the task does not measure.
    """
    for name in names or ():
        if name not in metrics:
            raise UserError(
                f"sweep.returns names {name}, which this task does not"
                f" measure{list_allowed(name, metrics)}"
            )
    if not names and SEARCHED not in metrics:
        return None
    values = [
        float("inf") if (value := metrics[name]) is None else value for name in names or [SEARCHED]
    ]
    return values if len(values) > 1 else values[0]
