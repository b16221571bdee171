"""Runs read back from the store as plain data."""

import contextlib
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tractexp.errors import TASK, UserError, list_allowed
from tractexp.storage import files
from tractexp.tracking.owner import search
from tractexp.tracking.store import open_store, raise_sentences

CURVES = ("fitness_by_simulations",)
FILES = ("result.json", "history.csv")


@dataclass(frozen=True)
class Logged:
    """One run as it lies in MLflow. `curves` are {name: (steps (n,), values (n,))}, by increasing
    step.

    `files` is the text of its artifacts {"result.json": ...}, without those that it never had or
    that are gone.
    """

    run_id: str
    name: str
    status: str
    experiment: str
    parameters: Mapping[str, str]
    metrics: Mapping[str, float]
    tags: Mapping[str, str]
    curves: Mapping[str, tuple[np.ndarray, np.ndarray]]
    files: Mapping[str, str] = field(default_factory=dict)


def find(
    uri: str, filter: str, experiment: str | None = None, curves: tuple[str, ...] = CURVES
) -> list[Logged]:
    """Runs that match MLflow's `filter`, such as "tags.data = 'tibet_50pct'", oldest first, in one
    experiment or all.

    Raises `UserError` where there is no such experiment or the filter is not one; an empty list
    where none match.
    """
    client = open_store(uri)
    with raise_sentences(uri):
        names = {one.experiment_id: one.name for one in client.search_experiments()}
    if experiment is not None:
        chosen = [key for key, name in names.items() if name == experiment]
        if not chosen:
            raise UserError(
                f"the MLflow store {uri} has no experiment"
                f" '{experiment}'{list_allowed(experiment, names.values())}"
            )
        names = {chosen[0]: experiment}
    with raise_sentences(uri):
        runs = _search(client, list(names), filter)
        return [
            _read_logged_run(client, run, names[run.info.experiment_id], curves) for run in runs
        ]


def _search(client: Any, experiments: list[str], filter: str) -> list[Any]:
    """The runs that a filter finds. Raises `UserError` for a filter that MLflow cannot read."""
    from mlflow.exceptions import MlflowException

    try:
        return search(client, experiments, filter, ("start_time",))
    except MlflowException as error:
        if error.error_code != "INVALID_PARAMETER_VALUE":
            raise
        reason = str(error).strip().partition("\n")[0]
        raise UserError(
            f"{TASK.filter}={filter} is not a filter that MLflow understands ({reason}); one is"
            " \"tags.data = 'tibet_50pct' and tags.optimizer = 'issa'\""
        ) from error


def _read_logged_run(client: Any, run: Any, experiment: str, curves: tuple[str, ...]) -> Logged:
    """A run as it was logged, with the curves asked for."""
    read = {
        name: _read_curve(client, run.info.run_id, name)
        for name in curves
        if name in run.data.metrics
    }
    return Logged(
        run.info.run_id,
        run.info.run_name,
        run.info.status,
        experiment,
        dict(run.data.params),
        dict(run.data.metrics),
        dict(run.data.tags),
        read,
        _find_files(client, run.info.run_id),
    )


def _find_files(client: Any, run_id: str) -> dict[str, str]:
    """Artifacts lie by absolute path, so those of a folder that was moved are missing."""
    from mlflow.exceptions import MlflowException

    texts = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in FILES:
            with contextlib.suppress(MlflowException, OSError, ValueError, UserError):
                texts[name] = files.read_text(
                    client.download_artifacts(run_id, name, folder), files.RESULT
                )
    return texts


def _read_curve(client: Any, run_id: str, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Steps and values of a metric, in order."""
    points = np.array(
        [(m.step, m.value) for m in client.get_metric_history(run_id, name)], dtype=float
    )
    points = points[np.argsort(points[:, 0], kind="stable")]
    return points[:, 0], points[:, 1]
