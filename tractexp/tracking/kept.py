"""`mlflow.json`: what is to be logged of a folder, kept beside its results until the store has it, and after.

It is written before anything is sent. So a server that is away, a locked store or a lost one costs nothing: `sync`
sends what a store lacks, and sends nothing twice.
"""

import json
import time
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from tractexp import files
from tractexp.errors import UserError
from tractexp.tracking.run import CURVE_POINTS, Line, Run, flatten

FILE = "mlflow.json"


@dataclass(frozen=True)
class Kept:
    """The content of `mlflow.json`: a run, where it is to be logged, and under which id it is; "" where it is not yet.

    `sweep` marks the run of a whole sweep, below which those of its jobs are.
    """

    folder: Path
    run: Run
    uri: str
    run_id: str = ""
    sweep: bool = False

    def write(self) -> "Kept":
        """Write it. Raises `UserError` where that is impossible."""
        told = {"uri": self.uri, "run_id": self.run_id, "sweep": self.sweep, "run": _plain(self.run, self.folder)}
        files.write(self.folder / FILE, json.dumps(told, ensure_ascii=False, default=str) + "\n")
        return self

    def logged(self, run_id: str, uri: str | None = None) -> "Kept":
        """Note that it is in the store."""
        return replace(self, run_id=run_id, uri=uri or self.uri).write()


def keep(folder: Path, run: Run, uri: str, sweep: bool = False) -> Kept:
    """Write down what is to be logged, with a key by which it is known again, and when the run ended."""
    key, ended = run.key or uuid.uuid4().hex, run.ended or time.time()
    return Kept(folder, replace(run, key=key, ended=ended), uri, sweep=sweep).write()


def read(folder: Path) -> Kept | None:
    """What is kept in a folder; None where nothing is. Raises `UserError` for a damaged file."""
    path = folder / FILE
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        return Kept(folder, _run(told["run"], folder), told["uri"], told["run_id"], told["sweep"])
    except FileNotFoundError:
        return None
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UserError(f"{path} is damaged ({error}); remove it, or run its command again") from error


def below(root: Path) -> list[Path]:
    """The folders at `root` and below in which something is kept, those above first."""
    return sorted((path.parent for path in root.rglob(FILE)), key=lambda folder: (len(folder.parts), folder))


def _plain(run: Run, folder: Path) -> dict[str, Any]:
    """A run as JSON knows it; paths within the folder are relative, so that it may be moved."""
    told: dict[str, Any] = {field.name: getattr(run, field.name) for field in fields(Run)}
    told["parameters"] = flatten(run.parameters)
    told["metrics"] = {name: float(value) for name, value in run.metrics.items()}
    told["curves"] = {name: _thin(*curve) for name, curve in run.curves.items()}
    told["artifacts"] = [_relative(path, folder) for path in run.artifacts]
    told["model"] = None if run.model is None else _relative(run.model, folder)
    told["records"] = [dict(record) for record in run.records]
    told["children"] = [_plain(child, folder) for child in run.children]
    return told


def _thin(steps: Line, values: Line) -> list[list[float]]:
    """A curve with as many points as are logged."""
    import numpy as np

    kept = np.unique(np.linspace(0, len(steps) - 1, min(len(steps), CURVE_POINTS)).round().astype(int))
    return [[float(line[k]) for k in kept] for line in (steps, values)]


def _relative(path: Path, folder: Path) -> str:
    path = Path(path).absolute()
    return path.relative_to(folder.absolute()).as_posix() if path.is_relative_to(folder.absolute()) else str(path)


def _run(told: Mapping[str, Any], folder: Path) -> Run:
    there = {
        "artifacts": [folder / path for path in told["artifacts"]],
        "model": None if told["model"] is None else folder / told["model"],
        "curves": {name: (steps, values) for name, (steps, values) in told["curves"].items()},
        "children": [_run(child, folder) for child in told["children"]],
    }
    return Run(**{**told, **there})
