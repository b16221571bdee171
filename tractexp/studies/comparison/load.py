"""Where the runs of a comparison come from: the folders of a sweep, or runs found in MLflow."""

import json
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.configuration.composition import list_leaves
from tractexp.errors import TASK, UserError
from tractexp.identification.result import name_by_event, parse_history
from tractexp.storage import files, yaml_files
from tractexp.studies.comparison.runs import SearchRun
from tractexp.tracking.sweepfile import find_sweep_folder

FITTING = "identify"  # the task whose runs are compared
# what a job's status.json says
FINISHED, RUNNING, INTERRUPTED = "finished", "running", "interrupted"
# what MLflow says of a run that neither finished nor failed
UNDER_WAY = ("RUNNING", "SCHEDULED", "KILLED")
MEND = "run this job again, or remove its folder"
ENDED = ("objective", "epsilon_p", "epsilon_q")


def find_newest_sweep(folder: Path) -> Path:
    """The sweep under `folder` begun last. Raises `UserError` where there is none."""
    sweeps = [path for path in folder.iterdir() if _list_jobs(path)] if folder.is_dir() else []
    if not sweeps:
        raise UserError(
            f"there is no sweep under {folder} to compare; make one, such as tractexp -m"
            f" optimizer=issa,ssa,pso 'seed=range(0,30)', or name one by {TASK.sweep}=FOLDER"
        )
    return max(
        sweeps, key=lambda path: (max(job.stat().st_mtime for job in _list_jobs(path)), path.name)
    )


def read_sweep(folder: Path) -> list[SearchRun]:
    """The runs of a sweep's job folders. Raises `UserError` where there is none."""
    if not folder.is_dir():
        raise UserError(
            f"{TASK.sweep}={folder} is not a folder; a sweep writes one under outputs/sweeps"
        )
    jobs = _list_jobs(folder)
    if not jobs:
        raise UserError(
            f"the sweep {folder} is empty: none of its folders holds a job (.hydra/config.yaml)"
        )
    runs = [run for run in map(_load_job, jobs) if run is not None]
    if not runs:
        raise UserError(
            f"the sweep {folder} has no job of task={FITTING}, the only one whose runs can be"
            " compared"
        )
    return runs


def _list_jobs(folder: Path) -> list[Path]:
    """The folders of a sweep's own jobs, at any depth: `hydra.sweep.subdir` names them. Numbers are
    in order.
    """
    found = (config.parents[1] for config in folder.rglob(".hydra/config.yaml"))
    own = [job for job in found if job != folder and find_sweep_folder(job) == folder]
    seen = [job for job in own if not _is_hidden(job, folder)]
    return sorted(seen, key=lambda job: [*map(_order_name, job.relative_to(folder).parts)])


def _is_hidden(job: Path, folder: Path) -> bool:
    """Whether a part of the path from one folder to another begins with a dot."""
    return any(name.startswith(".") for name in job.relative_to(folder).parts)


def _order_name(name: str) -> tuple[float, str]:
    """By which names are sorted: numbers by size, then others by their letters."""
    return (int(name) if name.isdigit() else np.inf, name)


def _load_job(folder: Path) -> SearchRun | None:
    """The run of a sweep's folder; None for what is no search."""
    with _refuse_unreadable(folder):
        return _read_job(folder)


def _read_job(folder: Path) -> SearchRun | None:
    """The run of one job's folder in a sweep; None if its task is no search. Exceptions of reading
    are the caller's.
    """
    config = _read_yaml(folder / ".hydra" / "config.yaml")
    if config["task"]["name"] != FITTING:
        return None
    status = _read_status(folder)
    unfinished = _explain_missing_result(folder, status)
    of_hydra = folder / ".hydra" / "hydra.yaml"
    runtime: Mapping[str, Any]
    if unfinished and status.get("choices") and not of_hydra.is_file():
        runtime = {"choices": status["choices"]}  # a job that ended at once left its status only
    else:
        runtime = _read_yaml(of_hydra)["hydra"]["runtime"]
    choices = runtime["choices"]
    fields: dict[str, Any] = {
        "optimizer": choices["optimizer"],
        "data": choices["data"],
        "seed": int(config["seed"]),
        "config": flatten_settings(config),
        "where": folder.relative_to(find_sweep_folder(folder)).as_posix(),
        "folder": runtime.get("cwd", ""),
    }
    if unfinished:
        return SearchRun(**fields, **unfinished)
    with _refuse_unreadable(folder / "result.json") as path:
        result = files.read_json(path)
        ended = find_search_end(result)
        fields |= {key: float(ended[key]) for key in ENDED} | {"parameters": list_parameters(ended)}
        fields["code"] = describe_code(result)
    with _refuse_unreadable(folder / "history.csv") as path:
        return SearchRun(**fields, **_read_history(files.read_text(path, files.RESULT)))


def _read_history(text: str) -> dict[str, Any]:
    """The search by iteration, of a `history.csv`."""
    simulations, seconds, history = parse_history(text)
    return {"simulations": simulations, "seconds": seconds, "history": history}


def find_search_end(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Where the optimizer itself ended, of a `result.json`: in early ones, that was the whole of
    it.
    """
    return result.get("search") or result


def describe_code(result: Mapping[str, Any]) -> str:
    """The version and commit of the package, of a `result.json`: "0.4.0 at 1c2d3e4f"; "" in early
    ones.
    """
    version = result.get("tractexp_version", "")
    commit = result.get("commit", "")
    dirty = "-dirty" if commit.endswith("-dirty") else ""
    return f"{version} at {commit[:8]}{dirty}" if version and commit else version


def list_parameters(ended: Mapping[str, Any]) -> dict[str, float]:
    """{name: value}, where it differs by event {"T_m[1]": value, ...} as well."""
    return name_by_event(ended.get("parameters", {}), ended.get("per_event", {}))


@contextmanager
def _refuse_unreadable(path: Path) -> Iterator[Path]:
    """Turn what goes wrong with a job's file into a sentence."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # NumPy's about a file without a row, which raises next
            yield path
    except (OSError, ValueError, LookupError, TypeError, AttributeError, UserError) as error:
        if MEND in str(error):  # of a file within
            raise
        reason = str(error).strip().partition("\n")[0] or type(error).__name__
        raise UserError(f"{path} cannot be read: {reason}; {MEND}") from error


def _read_status(folder: Path) -> Mapping[str, Any]:
    """The content of `status.json`; {} where the job was none of a sweep of ours, or
    has not begun.
    """
    if not (folder / "status.json").is_file():
        return {}
    with _refuse_unreadable(folder / "status.json") as path:
        content = files.read_json(path, files.CONFIGURATION)
        return {"message": "", **content, "status": str(content["status"])}


def _explain_missing_result(folder: Path, status: Mapping[str, Any]) -> dict[str, Any]:
    """Why a job has no result: {"failure": ...} or {"interruption": ...}; {} where it has one."""
    # early sweeps: "failed", with this message
    if INTERRUPTED in (status.get("status"), status.get("message")):
        return {"interruption": "its sweep was interrupted"}
    if status and status["status"] not in (FINISHED, RUNNING):
        return {"failure": status["message"] or f"its status is {status['status']}"}
    if (folder / "result.json").is_file() and (folder / "history.csv").is_file():
        return {}
    return {"interruption": "it left no result: it was ended, or still runs"}


def _read_yaml(path: Path) -> Any:
    """The content of a file of a run."""
    with _refuse_unreadable(path):
        return yaml_files.read_yaml(path)


def flatten_settings(node: Mapping[str, Any]) -> dict[str, Any]:
    """A nested configuration as {"optimizer.population": 50}, without mappings that are empty."""
    return {key: value for key, value in list_leaves(node) if not isinstance(value, dict)}


def nest_keys(flattened: Mapping[str, Any]) -> dict[str, Any]:
    """The reverse of `flat`; a mapping that was empty is not there."""
    config: dict[str, Any] = {}
    for key, value in flattened.items():
        *path, last = key.split(".")
        node = config
        for part in path:
            node = node.setdefault(part, {})
        node[last] = value
    return config


def read_logged(logged: Iterable[Any], source: str) -> list[SearchRun]:
    """Runs from what `tractexp.tracking.find` returns, oldest first; only identifications count, no
    parent runs.

    Where the artifacts of a run are missing, its search is known by the curve in MLflow alone,
    which has fewer points and no seconds: what the search took is divided evenly over its
    simulations. Raises `UserError` where there is none.
    """
    runs = [
        _read_logged_run(one)
        for one in logged
        if one.tags.get("task") == FITTING and "optimizer" in one.tags
    ]
    if not runs:
        raise UserError(
            f"{source} matches no run of task={FITTING}; the tags to filter by are task, model,"
            f" optimizer, data and seed, as in {TASK.filter}=\"tags.data = 'tibet_50pct'\""
        )
    return runs


def _read_logged_run(one: Any) -> SearchRun:
    """A run as MLflow has it."""
    fields: dict[str, Any] = {
        "optimizer": one.tags["optimizer"],
        "data": one.tags["data"],
        "seed": int(one.tags["seed"]),
        "config": {key: _parse_value(text) for key, text in one.parameters.items()},
        "where": one.name,
    }
    curve = one.curves.get("fitness_by_simulations")
    ended = {}
    if one.status in UNDER_WAY:
        return SearchRun(**fields, interruption=f"its status in MLflow is {one.status}")
    if one.status != "FINISHED" or "objective" not in one.metrics or curve is None:
        return SearchRun(**fields, failure=f"its status in MLflow is {one.status}")
    # early runs have one value of each, the search's
    for key in (*ENDED, "simulations", "seconds"):
        ended[key] = one.metrics.get(f"search_{key}", one.metrics.get(key, np.nan))
    result = files.parse_json(one.files.get("result.json", "{}"), f"the result.json of {one.name}")
    details = {
        "parameters": list_parameters(find_search_end(result)),
        "code": describe_code(result),
    }
    total = ended.pop("simulations")
    seconds = ended.pop("seconds")
    if "history.csv" in one.files:
        return SearchRun(**fields, **ended, **_read_history(one.files["history.csv"]), **details)
    simulations = np.fmin(curve[0], total)
    spent = seconds * simulations / simulations[-1]
    return SearchRun(
        **fields, **ended, simulations=simulations, seconds=spent, history=curve[1], **details
    )


def _parse_value(text: str) -> Any:
    """A parameter of MLflow as the value that it was."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text
