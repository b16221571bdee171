"""A run as plain data, and how it is written: at its end and in one go.

MLflow knows no transaction over a whole run. One whose writer is killed meanwhile stays RUNNING
until the store is opened next, which closes it (`owner`); its content is stored beside the results
(`runfile`).
"""

import contextlib
import getpass
import json
import math
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from tractexp.cache import provenance
from tractexp.errors import UserError, check_choice
from tractexp.tracking import owner
from tractexp.tracking.store import find_database, open_store, raise_sentences

if TYPE_CHECKING:
    import numpy as np

STATUSES = ("FINISHED", "FAILED", "KILLED")
KEY = "tractexp.key"  # a tag
NOTE = "mlflow.note.content"  # the tag that MLflow shows as a description
FITTED = "train"  # the role of a record
PER_DECADE = 40  # steps that curves share
CURVE_POINTS = 1000  # a longer curve is thinned evenly; the files of the run keep every point
# MLflow takes at most 1000 entries a batch, 100 of them parameters
BATCH_METRICS, BATCH_PARAMETERS = 900, 100
VALUE_LENGTH = 6000  # characters MLflow stores of a parameter
Line: TypeAlias = "Sequence[float] | np.ndarray"  # (n,), steps or values of a curve


@dataclass(frozen=True)
class TrackedRun:
    """The entry of one job in MLflow.

    `parameters` is the flattened configuration, `metrics` the figures of the result. An infinite
    one, of what was never reached, is left out: a database keeps the largest number there is in its
    place. `curves` maps a name to (steps (n,) whole numbers, values (n,)), such as "fitness" by
    iteration. `artifacts` are files or folders to be copied. `parent` is the run id of the sweep.
    `seconds` is what the job took: MLflow shows it as the run's duration. `model` is a result file
    that `tractexp.identification.result.load` reads; with it the run offers a model for
    `mlflow.pyfunc.load_model`. `description` is Markdown. `children` are logged below this run.
    """

    experiment: str
    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    metrics: Mapping[str, float] = field(default_factory=dict)
    curves: Mapping[str, tuple[Line, Line]] = field(default_factory=dict)
    tags: Mapping[str, str] = field(default_factory=dict)
    artifacts: Sequence[Path] = ()
    description: str = ""
    parent: str | None = None
    status: str = "FINISHED"
    seconds: float = 0.0
    model: Path | None = None
    model_metrics: Sequence[str] = ()  # those of `metrics` that are on the model's page, too
    records: "Sequence[Mapping[str, str]]" = ()  # name, role, sha256: MLflow's inputs
    children: "Sequence[TrackedRun]" = ()
    key: str = ""  # identifies a run that is sent again
    ended: float | None = None  # s since 1970; None: now

    def check(self) -> None:
        """Raise `UserError` for a missing name, an unknown status, a file that is not there or a
        lopsided curve.
        """
        for key in ("experiment", "name"):
            if not getattr(self, key).strip():
                raise UserError(f"tracking: a run needs {key}, which is empty")
        check_choice("status", self.status, STATUSES)
        for path in (*self.artifacts, *([self.model] if self.model else [])):
            if not Path(path).exists():
                raise UserError(
                    f"tracking: the artifact {path} of run '{self.name}' does not exist"
                )
        for name, (steps, values) in self.curves.items():
            if len(steps) != len(values):
                raise UserError(
                    f"tracking: the curve '{name}' has {len(steps)} steps and {len(values)} values"
                )


def flatten(config: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """A nested configuration as {"optimizer.population": "50"}; lists stay whole, values are
    spelled as in JSON.
    """
    flat: dict[str, str] = {}
    for key, value in config.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = _shorten_text(value)
    return flat


def _shorten_text(value: Any) -> str:
    """A value as MLflow stores a parameter."""
    if isinstance(value, str):
        return value
    if hasattr(value, "tolist"):  # an array, or a number of one
        value = value.tolist()
    if value is None or isinstance(value, bool | int | float | list | tuple):
        return json.dumps(value, default=str, ensure_ascii=False)
    return str(value)


def name_metric(text: str) -> str:
    """Text as MLflow takes it for the name of a metric: "median issa levy=false" has a colon for
    the sign.
    """
    return re.sub(r"[^\w.\- :/]", "_", text.replace("=", ":"), flags=re.ASCII)


def choose_curve_points(count: int) -> "np.ndarray":
    """The points of a curve of `count` points that are logged: `CURVE_POINTS` of them, evenly
    spread, or all.
    """
    import numpy as np

    return np.unique(np.linspace(0, count - 1, min(count, CURVE_POINTS)).round().astype(int))


def resample_to_common_steps(
    steps: "np.ndarray", values: "np.ndarray"
) -> "tuple[np.ndarray, np.ndarray]":
    """A curve (n,) of what was reached, by steps (n,) above 0, at steps that all such curves share.

    MLflow averages runs step by step: where each has its own, the average jumps from one run to the
    next.
    """
    import numpy as np

    first, last = (int(np.ceil(PER_DECADE * np.log10(step))) for step in (steps[0], steps[-1]))
    common = np.unique(np.ceil(10 ** (np.arange(first, last + 1) / PER_DECADE)))
    common = common[common >= steps[0]]
    return common, values[np.searchsorted(steps, common, side="right") - 1]


def log(run: TrackedRun, uri: str, *, again: bool = False) -> str:
    """Write one finished run and return its id. Raises `UserError`; nothing is logged for a run
    that fails `check`.

    A run that is sent `again` is written once: the rest of an earlier attempt is deleted, a whole
    run stays.
    """
    run.check()
    client = open_store(uri)
    with raise_sentences(uri):
        if again and (whole := _find_whole_run(client, run)):
            return whole
        run_id, ended = _create(client, run, uri), _count_milliseconds(run.ended)
        try:
            _write(client, run_id, run)
            for child in run.children:
                log(replace(child, parent=run_id, ended=run.ended), uri)
        except BaseException:
            with contextlib.suppress(Exception):  # of a store that is away the first word counts
                client.set_terminated(run_id, "FAILED")
            raise
        client.set_terminated(run_id, run.status, end_time=ended)
    return run_id


def _find_whole_run(client: Any, run: TrackedRun) -> str:
    """The run of this key where the store has it whole, else ""; the rest of an earlier attempt is
    deleted.
    """
    experiments = [one.experiment_id for one in client.search_experiments()]
    for one in client.search_runs(experiments, f"tags.`{KEY}` = '{run.key}'") if run.key else ():
        if one.info.status in (run.status, STATUSES[0]):
            return one.info.run_id
        for child in client.search_runs(
            experiments, f"tags.`mlflow.parentRunId` = '{one.info.run_id}'"
        ):
            client.delete_run(child.info.run_id)
        client.delete_run(one.info.run_id)
    return ""


def run_of(client: Any, uri: str, run_id: str) -> Any:
    """MLflow's run of this id, deleted or not; None where the store has none."""
    from mlflow.exceptions import MlflowException

    if not run_id:
        return None
    with raise_sentences(uri):
        try:
            return client.get_run(run_id)
        except MlflowException as error:
            if error.error_code != "RESOURCE_DOES_NOT_EXIST":
                raise
            return None


def attach(run_id: str, uri: str, paths: Sequence[Path]) -> bool:
    """Copy files to the artifacts of a run that has ended; False where the store has no such run
    (any more).
    """
    client = open_store(uri)
    run = run_of(client, uri, run_id)
    if run is None or run.info.lifecycle_stage == "deleted":
        return False
    with raise_sentences(uri):
        for path in paths:
            client.log_artifact(run_id, str(path))
    return True


def start_parent(run: TrackedRun, uri: str) -> str:
    """Create the MLflow run of a sweep as a whole, which those of its jobs stand under, and return
    its id, for `TrackedRun.parent` of each job.

    It stays open: `finish_parent` closes it, called in a `finally`.
    """
    run.check()
    client = open_store(uri)
    with raise_sentences(uri):
        run_id = _create(client, run, uri)
        _write(client, run_id, run)
    return run_id


def reopen_parent(run_id: str, uri: str) -> bool:
    """Mark the run of a sweep that goes on as running again; False where the store
    has it no more.
    """
    client = open_store(uri)
    from mlflow.exceptions import MlflowException

    try:
        if client.get_run(run_id).info.lifecycle_stage == "deleted":
            return False
        client.set_tag(run_id, owner.TAG, owner.sign_process())
        client.update_run(run_id, status="RUNNING")
    except MlflowException:
        return False
    return True


def finish_parent(
    run_id: str,
    uri: str,
    status: str,
    metrics: Mapping[str, float] | None = None,
    artifacts: Sequence[Path] = (),
) -> None:
    """Close the run of a sweep with its status, adding the figures and files of the sweep as a
    whole.
    """
    run = TrackedRun("sweep", run_id, metrics=metrics or {}, artifacts=artifacts, status=status)
    run.check()
    client = open_store(uri)
    with raise_sentences(uri):
        _write(client, run_id, run)
        client.set_terminated(run_id, status)


def tag_experiment(experiment: str, tags: Mapping[str, str], uri: str) -> str:
    """Set tags on an experiment, such as a stored view of its runs, and return the
    experiment's id.
    """
    client = open_store(uri)
    with raise_sentences(uri):
        experiment_id = _get_experiment(client, experiment, uri)
        for key, value in tags.items():
            client.set_experiment_tag(experiment_id, key, value)
    return experiment_id


def _create(client: Any, run: TrackedRun, uri: str) -> str:
    """Create a run with its tags; its id."""
    tags = {
        "mlflow.user": _find_user(),
        "mlflow.source.name": "tractexp",
        "mlflow.source.type": "LOCAL",
        "mlflow.source.git.commit": provenance.find_commit(),
        NOTE: run.description,
        "mlflow.parentRunId": run.parent or "",
        KEY: run.key,
        owner.TAG: owner.sign_process(),
    }
    tags = {key: value for key, value in tags.items() if value} | {
        k: str(v) for k, v in run.tags.items()
    }
    started = _count_milliseconds(run.ended) - round(1000 * run.seconds)
    return client.create_run(
        _get_experiment(client, run.experiment, uri), started, tags, run.name
    ).info.run_id


def _write(client: Any, run_id: str, run: TrackedRun) -> None:
    """Write parameters, metrics and curves of a run."""
    from mlflow.entities import Metric, Param

    now = _count_milliseconds(run.ended)
    points = [(name, value, 0) for name, value in run.metrics.items() if not math.isinf(value)]
    for name, (steps, values) in run.curves.items():
        points += [(name, values[i], steps[i]) for i in choose_curve_points(len(steps))]
    of_model = _log_inputs_and_model(client, run_id, run)
    metrics = [
        Metric(name, float(value), now, int(step), **of_model.get(name, {}))
        for name, value, step in points
    ]
    parameters = [
        Param(key, _shorten_text(value)[:VALUE_LENGTH]) for key, value in run.parameters.items()
    ]
    chunks = zip_longest(
        _cut_in_chunks(metrics, BATCH_METRICS),
        _cut_in_chunks(parameters, BATCH_PARAMETERS),
        fillvalue=[],
    )
    for some_metrics, some_parameters in chunks:
        client.log_batch(run_id, some_metrics, some_parameters)
    for path in run.artifacts:
        client.log_artifact(run_id, str(path))


def _log_inputs_and_model(client: Any, run_id: str, run: TrackedRun) -> dict[str, dict[str, str]]:
    """Log what a run has read and the model that it has made; by the names of the metrics that are
    the model's, whose they are and, where one record was fitted, of what.
    """
    inputs = [_describe_input(record) for record in run.records]
    if inputs:
        _log_inputs(client, run_id, inputs)
    if run.model is None:
        return {}
    from tractexp.tracking.model import log_model

    parameters = {k: _shorten_text(v) for k, v in run.parameters.items() if k.startswith("model.")}
    whose = {"model_id": log_model(client, run_id, run.model, parameters, run.description)}
    fitted = [one.dataset for one in inputs if one.tags[0].value == FITTED]
    if len(fitted) == 1:
        whose |= {"dataset_name": fitted[0].name, "dataset_digest": fitted[0].digest}
    return dict.fromkeys(run.model_metrics, whose)


def _log_inputs(client: Any, run_id: str, datasets: list[Any]) -> None:
    """Log what a run has read. Of two processes that register a record at once, one is refused and
    tries again.
    """
    from mlflow.exceptions import MlflowException

    try:
        client.log_inputs(run_id, datasets=datasets)
    except MlflowException:
        client.log_inputs(run_id, datasets=datasets)


def _describe_input(record: Mapping[str, str]) -> Any:
    """One record as MLflow lists what a run has read: its digest is the SHA-256 of its channels,
    shortened.
    """
    from mlflow.entities import Dataset, DatasetInput, InputTag

    source = json.dumps({"sha256": record["sha256"]})
    dataset = Dataset(record["name"][:500], record["sha256"][:36], "tractexp record", source)
    return DatasetInput(dataset, [InputTag("mlflow.data.context", record["role"])])


def _cut_in_chunks(items: list[Any], size: int) -> list[list[Any]]:
    """Items in lists of at most `size`."""
    return [items[i : i + size] for i in range(0, len(items), size)]


def _get_experiment(client: Any, name: str, uri: str) -> str:
    """The id of the experiment `name`, created if need be; artifacts lie beside the database
    wherever this runs.
    """
    from mlflow.exceptions import MlflowException

    experiment = client.get_experiment_by_name(name)
    if experiment is None:
        database = find_database(uri)
        folder = re.sub(r"[^\w.-]+|^\.+", "_", name)
        location = (database.parent / "mlartifacts" / folder).as_uri() if database else None
        try:
            return _create_experiment(client, name, location)
        except MlflowException:  # another process created it first; if not, the next line raises
            experiment = client.get_experiment_by_name(name)
            if experiment is None:
                raise
    if experiment.lifecycle_stage == "deleted":
        raise UserError(
            f"the experiment '{name}' in {uri} was deleted: restore it with 'mlflow experiments"
            f" restore --experiment-id {experiment.experiment_id}' or log under another name"
        )
    return experiment.experiment_id


def _create_experiment(client: Any, name: str, location: str | None) -> str:
    """The id of a new experiment, which opens on the columns that matter."""
    from tractexp.tracking.view import tag_new_experiment

    experiment_id = client.create_experiment(name, artifact_location=location)
    for key, value in tag_new_experiment(experiment_id).items():
        client.set_experiment_tag(experiment_id, key, value)
    return experiment_id


def _count_milliseconds(time_of: float | None = None) -> int:
    """A time, by default now, as MLflow counts it."""
    return round(1000 * (time.time() if time_of is None else time_of))


def _find_user() -> str:
    """Who runs this; "" where the system does not know."""
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # a container without an entry for this user
        return ""
