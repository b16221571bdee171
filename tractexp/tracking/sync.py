"""Bring into a store what folders hold and it lacks: runs that could not be logged, or that a lost store had."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from tractexp import files
from tractexp.errors import UserError
from tractexp.tracking import runfile
from tractexp.tracking.run import finish_parent, log, reopen_parent, run_of, start_parent
from tractexp.tracking.runfile import RunFile
from tractexp.tracking.store import address, open_store, sentences
from tractexp.tracking.sweepfile import FILE, parent_of

PAGES = ("comparison.json", "comparison.html")  # of a sweep, written when its jobs have ended
THERE, BROUGHT, DELETED, NOT = "already there", "brought in", "deleted in MLflow and left so", "not logged"


def sync(root: Path, uri: str | None = None, tell: Callable[[str], None] = lambda line: None) -> Counter[str]:
    """Send every run file at `root` and below to its store, or to `uri`, unless it is there; counts by outcome.

    `tell` hears a sentence for each that could not be. Sending twice is harmless: its key identifies a run.
    """
    counts: Counter[str] = Counter()
    broken: dict[str, str] = {}  # {address: why it cannot be used}: nobody waits for it twice
    for folder in runfile.below(root):
        try:
            one = runfile.read(folder)
        except UserError as error:
            tell(str(error))
            counts[NOT] += 1
            continue
        if one is None:
            continue
        where = address(uri or one.uri)
        try:
            if where in broken:
                raise UserError(broken[where])
            counts[_sent(one, where)] += 1
        except UserError as error:
            counts[NOT] += 1
            if str(error) not in broken.values():
                tell(str(error))
            if "cannot be used" in str(error) or "another version" in str(error):
                broken[where] = str(error)
    return counts


def _sent(one: RunFile, uri: str) -> str:
    """Send one run; what became of it."""
    client = open_store(uri)
    parent = None if one.sweep else parent_of(one.folder.parent)
    one = replace(one, run=replace(one.run, parent=parent or one.run.parent))
    run_there = run_of(client, uri, one.run_id)
    if run_there is not None and run_there.info.lifecycle_stage == "deleted":
        return DELETED
    if one.sweep:
        return _sweep(one, run_there, uri)
    if run_there is not None and run_there.info.status == one.run.status:
        _below(client, uri, run_there, one.run.parent)
        return THERE
    model = one.run.model if one.run.model and one.run.model.exists() else None
    run = replace(one.run, artifacts=[path for path in one.run.artifacts if path.exists()], model=model)
    one.logged(log(run, uri, again=True), uri)
    return BROUGHT


def _sweep(one: RunFile, run_there: Any, uri: str) -> str:
    """The run of a sweep: it keeps its id where the store has it, for its jobs point to it."""
    if run_there is not None and run_there.info.status == one.run.status:
        return THERE
    run_id = one.run_id
    if run_there is None or not reopen_parent(run_id, uri):
        run_id = start_parent(replace(one.run, metrics={}), uri)
    pages = [path for name in PAGES if (path := one.folder / name).is_file()]
    finish_parent(run_id, uri, one.run.status, one.run.metrics, pages)
    one.logged(run_id, uri)
    sweep_file = one.folder / FILE
    files.write_json(sweep_file, {"run": run_id, "uri": uri, "overrides": one.run.tags.get("sweep", "").split()})
    return BROUGHT


def _below(client: Any, uri: str, run_there: Any, parent: str | None) -> None:
    """Let a run that was logged point to the run of its sweep, which was not then."""
    if parent and run_there.data.tags.get("mlflow.parentRunId") != parent:
        with sentences(uri):
            client.set_tag(run_there.info.run_id, "mlflow.parentRunId", parent)


def waiting(root: Path) -> int:
    """How many run files at `root` and below are in no store yet."""
    count = 0
    for folder in runfile.below(root):
        try:
            one = runfile.read(folder)
        except UserError:
            continue
        count += one is not None and not one.run_id
    return count
