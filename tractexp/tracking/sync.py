"""Bring into a store what folders hold and it lacks: runs that could not be logged, or that a lost
store had.
"""

import os
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.storage import files
from tractexp.storage.run_folder import find_holder
from tractexp.text import quoting
from tractexp.tracking import runfile
from tractexp.tracking.run import (
    KEY,
    TrackedRun,
    finish_parent,
    log,
    reopen_parent,
    run_of,
    start_parent,
)
from tractexp.tracking.runfile import RunFile
from tractexp.tracking.store import open_store, raise_sentences, resolve_address
from tractexp.tracking.sweepfile import FILE, PAGES, find_sweep_folder, read_parent

THERE, BROUGHT, DELETED, WORKS, NOT = (
    "already there",
    "brought in",
    "deleted in MLflow and left so",
    "still at work",
    "not logged",
)

# of a file, by which MLflow knows a folder as a model; small, as some file systems have it
MODEL = "mlmodel"
RESERVED = ("mlflow.", "tractexp.")  # how tags begin that MLflow and this package set


def sync(
    root: Path,
    uri: str | None = None,
    tell: Callable[[str], None] = lambda line: None,
    own: str | None = None,
) -> Counter[str]:
    """Send every run file at `root` and below to its store, or to `uri`, unless it is there; counts
    by outcome.

    `tell` hears a sentence for each that could not be. Sending twice is harmless: its key
    identifies a run. Where the folder may be somebody else's, `own` is the only store that what
    stands in it may name. Of a run nothing is sent that does not lie in its folder, and nothing of
    one that is still at work.
    """
    counts: Counter[str] = Counter()
    said: set[str] = set()
    broken: dict[str, str] = {}  # {address: why it cannot be used}: nobody waits for it twice
    for folder in runfile.list_run_folders(root):
        try:
            one = runfile.read(folder)
        except UserError as error:
            tell(str(error))
            counts[NOT] += 1
            continue
        if one is None:
            continue
        if any(map(find_holder, (folder,) if one.sweep else (folder, find_sweep_folder(folder)))):
            counts[WORKS] += 1  # which logs it itself
            continue
        where = uri or one.uri
        try:
            where = resolve_address(where)
            if uri is None and own not in (None, where):
                raise UserError(
                    f"the MLflow store {where} is named in {root} alone, not by you:"
                    f" {_describe_store(where)}"
                )
            if where in broken:
                raise UserError(broken[where])
            counts[
                _send(replace(one, run=_keep_files_inside(one.run, one.folder, tell)), where)
            ] += 1
        except UserError as error:
            counts[NOT] += 1
            if str(error) not in said:
                tell(str(error))
            said.add(str(error))
            if "cannot be used" in str(error) or "another version" in str(error):
                broken[where] = str(error)
    return counts


def _describe_store(uri: str) -> str:
    """How to say that a store is meant."""
    return f"where it is yours, {quoting.shell('tractexp', 'sync', '--uri', uri)} sends it there"


def _keep_files_inside(run: TrackedRun, folder: Path, tell: Callable[[str], None]) -> TrackedRun:
    """The run with those of its files, and of the runs below it, that are there and lie in its
    folder.

    Nothing goes along that MLflow would obey: a model that it loads, a tag of its own, Markdown of
    others.
    """
    artifacts = [path for path in run.artifacts if _may_go(path, folder, tell)]
    model = run.model
    if model and not (_may_go(model, folder, tell) and _can_be_loaded(model, tell)):
        model = None
    return replace(
        run,
        artifacts=artifacts,
        model=model,
        children=[_keep_files_inside(child, folder, tell) for child in run.children],
        tags={name: text for name, text in run.tags.items() if not name.startswith(RESERVED)},
        description=quoting.markdown_again(run.description),
    )


def _may_go(path: Path, folder: Path, tell: Callable[[str], None]) -> bool:
    """Whether a file of a run is there, lies in its folder and is no model of MLflow's; `tell`
    hears why not.
    """
    if not os.path.exists(path):
        return False
    if not files.is_inside(path, folder):
        tell(f"{path} is not sent: it does not lie in the folder {folder} of its run")
        return False
    if any(one.name.lower() == MODEL for one in (path, *path.rglob("*"))):
        tell(
            f"{path} is not sent: MLflow would load it as a model, and run what its maker put into"
            " it"
        )
        return False
    return True


def _can_be_loaded(path: Path, tell: Callable[[str], None]) -> bool:
    """Whether a file holds a result that a model can be made of; `tell` hears why not."""
    from tractexp.identification.result import load

    try:
        load(path)
    except UserError as error:
        tell(f"no model is made of {path}: {error}")
        return False
    return True


def _send(one: RunFile, uri: str) -> str:
    """Send one run; what became of it."""
    client = open_store(uri)
    parent = None if one.sweep else read_parent(find_sweep_folder(one.folder))
    one = replace(one, run=replace(one.run, parent=parent or one.run.parent))
    run_there = run_of(client, uri, one.run_id)
    if run_there is not None and not _is_same_run(one, run_there):
        run_there = None
    if run_there is not None and run_there.info.lifecycle_stage == "deleted":
        return DELETED
    if one.sweep:
        return _log_sweep_run(one, run_there, uri)
    if run_there is not None and run_there.info.status == one.run.status:
        _link_to_sweep(client, uri, run_there, one.run.parent)
        return THERE
    one.mark_logged(log(one.run, uri, again=True), uri)
    return BROUGHT


def _is_same_run(one: RunFile, run_there: Any) -> bool:
    """Whether a run in the store is that of the file, whose id may be anybody's."""
    tags = run_there.data.tags
    if one.sweep:
        return (run_there.info.run_name, tags.get("sweep")) == (
            one.run.name,
            one.run.tags.get("sweep"),
        )
    return tags.get(KEY) == one.run.key


def _log_sweep_run(one: RunFile, run_there: Any, uri: str) -> str:
    """Log the run of a sweep, and return what became of it; it keeps its id where the store has it,
    for its jobs point to it.
    """
    if run_there is not None and run_there.info.status == one.run.status:
        return THERE
    run_id = one.run_id
    if run_there is None or not reopen_parent(run_id, uri):
        run_id = start_parent(replace(one.run, metrics={}), uri)
    pages = [
        path
        for name in PAGES
        if (path := one.folder / name).is_file() and files.is_inside(path, one.folder)
    ]
    finish_parent(run_id, uri, one.run.status, one.run.metrics, pages)
    one.mark_logged(run_id, uri)
    sweep_file = one.folder / FILE
    files.write_json(
        sweep_file,
        {"run": run_id, "uri": uri, "overrides": one.run.tags.get("sweep", "").split()},
        private=True,
    )
    return BROUGHT


def _link_to_sweep(client: Any, uri: str, run_there: Any, parent: str | None) -> None:
    """Let a run that was logged point to the run of its sweep, which was not then."""
    if parent and run_there.data.tags.get("mlflow.parentRunId") != parent:
        with raise_sentences(uri):
            client.set_tag(run_there.info.run_id, "mlflow.parentRunId", parent)


def count_unsynced(root: Path) -> int:
    """How many run files at `root` and below are in no store yet."""
    count = 0
    for folder in runfile.list_run_folders(root):
        try:
            one = runfile.read(folder)
        except UserError:
            continue
        count += one is not None and not one.run_id
    return count
