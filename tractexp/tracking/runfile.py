"""`mlflow.json`: what is to be logged of a folder, stored beside its results until the store has
it, and after.

It is written before anything is sent. So a server that is away, a locked store or a lost one costs
nothing: `sync` sends what a store lacks, and sends nothing twice.
"""

import json
import re
import time
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.storage import files
from tractexp.storage.run_folder import find_run, settle
from tractexp.tracking.run import Line, TrackedRun, choose_curve_points, flatten

FILE = "mlflow.json"
MOST_CHILDREN = 1000  # runs below one: sets of effects, optimizers
NUMBER = (int, float)
SHAPES: Mapping[str, Any] = {  # kinds of the entries of a run that are no texts
    "parameters": dict,
    "metrics": dict,
    "curves": dict,
    "tags": dict,
    "artifacts": list,
    "records": list,
    "children": list,
    "model_metrics": list,
    "model": (str, type(None)),
    "parent": (str, type(None)),
    "seconds": NUMBER,
    "ended": (*NUMBER, type(None)),  # None of a run below another, which ends with it
}
INNER: Mapping[str, Any] = {  # and of what these hold
    "metrics": NUMBER,
    "tags": str,
    "artifacts": str,
    "records": dict,
    "children": dict,
    "curves": list,
    "model_metrics": str,
}
KEY = re.compile(r"[\w-]*", re.ASCII)  # what may stand in MLflow's filter


@dataclass(frozen=True)
class RunFile:
    """The content of `mlflow.json`: a run, where it is to be logged, and under which id it is; ""
    where it is not yet.

    `sweep` marks the run of a whole sweep, below which those of its jobs are.
    """

    folder: Path
    run: TrackedRun
    uri: str
    run_id: str = ""
    sweep: bool = False

    def write(self, place: Path | None = None) -> "RunFile":
        """Write it, into another `place` where its folder is still to get it. Raises `UserError`
        where that is impossible.
        """
        content = {
            "uri": self.uri,
            "run_id": self.run_id,
            "sweep": self.sweep,
            "run": _describe_run(self.run, self.folder),
        }
        files.write(
            (place or self.folder) / FILE,
            json.dumps(content, ensure_ascii=False, default=str) + "\n",
            private=True,
        )
        return self

    def mark_logged(self, run_id: str, uri: str | None = None) -> "RunFile":
        """Note that it is in the store."""
        return replace(self, run_id=run_id, uri=uri or self.uri).write()


def save(
    folder: Path, run: TrackedRun, uri: str, sweep: bool = False, place: Path | None = None
) -> RunFile:
    """Write down what is to be logged, with a key that identifies it, and the time at which the run
    ended; into another `place` where the folder is still to get it.
    """
    key = run.key or uuid.uuid4().hex
    ended = run.ended or time.time()
    return RunFile(folder, replace(run, key=key, ended=ended), uri, sweep=sweep).write(place)


def read(folder: Path) -> RunFile | None:
    """The file of a folder; None where there is none. Raises `UserError` for a damaged file."""
    path = folder / FILE
    settle(folder)
    try:
        content = files.read_json(path)
        uri, run_id = _check_texts(content, "uri", "run_id")
        return RunFile(
            folder, _read_run(content["run"], folder), uri, run_id, bool(content["sweep"])
        )
    except FileNotFoundError:
        return None
    except UserError as error:
        raise UserError(
            f"{path} is damaged ({error}); remove it, or run its command again"
        ) from error
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise UserError(
            f"{path} is damaged ({error}); remove it, or run its command again"
        ) from error


def list_run_folders(root: Path) -> list[Path]:
    """The folders at `root` and below that have such a file, those above first."""
    found = {run for path in root.rglob(FILE) if (run := find_run(path.parent)) is not None}
    return sorted(found, key=lambda folder: (len(folder.parts), folder))


def _describe_run(run: TrackedRun, folder: Path) -> dict[str, Any]:
    """A run as JSON knows it; paths within the folder are relative, so that it may be moved."""
    content: dict[str, Any] = {field.name: getattr(run, field.name) for field in fields(TrackedRun)}
    content["parameters"] = flatten(run.parameters)
    content["metrics"] = {name: float(value) for name, value in run.metrics.items()}
    content["curves"] = {name: _thin(*curve) for name, curve in run.curves.items()}
    content["artifacts"] = [_make_relative(path, folder) for path in run.artifacts]
    content["model_metrics"] = list(run.model_metrics)
    content["model"] = None if run.model is None else _make_relative(run.model, folder)
    content["records"] = [dict(record) for record in run.records]
    content["children"] = [_describe_run(child, folder) for child in run.children]
    return content


def _thin(steps: Line, values: Line) -> list[list[float]]:
    """A curve with as many points as are logged."""
    points = choose_curve_points(len(steps))
    return [[float(line[k]) for k in points] for line in (steps, values)]


def _make_relative(path: Path, folder: Path) -> str:
    """A path as it is called within a folder, else whole."""
    path = Path(path).absolute()
    return (
        path.relative_to(folder.absolute()).as_posix()
        if path.is_relative_to(folder.absolute())
        else str(path)
    )


def _check_texts(content: Mapping[str, Any], *names: str) -> list[str]:
    """Entries that are texts; raises `TypeError` where one is none."""
    for name in names:
        if not isinstance(content[name], str):
            raise TypeError(f"its {name} is {content[name]!r:.60}")
    return [content[name] for name in names]


def _read_run(content: Mapping[str, Any], folder: Path) -> TrackedRun:
    """The run that a file holds. Raises ValueError for what no run has."""
    content = {"model_metrics": [], **content}  # which earlier versions did not write
    key, *_ = _check_texts(content, "key", "experiment", "name", "status", "description")
    if not KEY.fullmatch(key):
        raise ValueError(f"its key is {key!r:.60}")
    _check_shapes(content)
    if len(content["children"]) > MOST_CHILDREN:
        raise ValueError(
            f"it has {len(content['children'])} runs below it, and at most {MOST_CHILDREN} can be"
        )
    there = {
        "artifacts": [folder / path for path in content["artifacts"]],
        "model": None if content["model"] is None else folder / content["model"],
        "curves": {name: (steps, values) for name, (steps, values) in content["curves"].items()},
        "children": [_read_run(child, folder) for child in content["children"]],
    }
    return TrackedRun(**{**content, **there})


def _check_shapes(content: Mapping[str, Any]) -> None:
    """Raise TypeError for a field of another form than runs have."""
    for name, kinds in SHAPES.items():
        if not isinstance(content[name], kinds):
            raise TypeError(f"its {name} is {content[name]!r:.60}")
    for name, kinds in INNER.items():
        each = content[name].values() if isinstance(content[name], dict) else content[name]
        if not all(isinstance(value, kinds) for value in each):
            raise TypeError(f"its {name} hold what they cannot: {content[name]!r:.60}")
