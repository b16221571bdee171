"""The parent run of a sweep in MLflow."""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from tractexp import tracking
from tractexp.api.job import Job
from tractexp.cache import provenance
from tractexp.errors import UserError
from tractexp.storage.files import write_json
from tractexp.sweep.recorder import Recorder
from tractexp.sweep.status import ESTIMATED, FAILED, FINISHED, INTERRUPTED, SEARCHED, read
from tractexp.text import quoting
from tractexp.text.progress import say
from tractexp.tracking.runfile import save
from tractexp.tracking.sweepfile import FILE, read_parent


@contextmanager
def open_parent_run(
    folder: Path, jobs: list[Any], overrides: list[str], afresh: bool
) -> Iterator[Recorder]:
    """Open the parent run of a sweep's jobs, or open it again, and close it with the status the
    sweep ends with.

    It is opened while the workers start, for to import MLflow takes seconds; what is yielded logs
    jobs below it. FINISHED where every job is, KILLED where the sweep is interrupted, FAILED
    otherwise. What could not be logged is then sent, but where it is interrupted: who ends a sweep
    does not wait. `afresh` never opens an old one again.
    """
    node = jobs[0].config["tracking"]
    if not node["enabled"]:
        (folder / FILE).unlink(missing_ok=True)
        yield Recorder(folder)
        return

    uri, run = tracking.resolve_address(node["uri"]), _describe_sweep(folder, jobs, overrides)
    content = {"uri": uri, "jobs": len(jobs), "overrides": overrides}
    with ThreadPoolExecutor(1) as thread:
        recorder = Recorder(folder, thread.submit(_open_run, folder, run, uri, afresh, content))
        status = "FAILED"
        try:
            yield recorder
            if all((s := read(job.folder)) is not None and s.status == FINISHED for job in jobs):
                status = "FINISHED"
        except KeyboardInterrupt:
            status = "KILLED"
            raise
        finally:
            _close_parent_run(
                folder,
                replace(run, status=status, metrics=compute_metrics(jobs)),
                recorder.parent(),
                uri,
            )
            if status != "KILLED":
                _send(folder, uri)


def _open_run(
    folder: Path, run: Any, uri: str, afresh: bool, content: Mapping[str, Any]
) -> str | None:
    """Open the run and note its id, by which jobs find it; None where the store cannot be used."""
    run_id = _open_parent_run(folder, run, uri, afresh)
    write_json(folder / FILE, {"run": run_id, **content}, private=True)
    return run_id


def _open_parent_run(folder: Path, run: Any, uri: str, afresh: bool) -> str | None:
    """The id of the parent run, opened or opened again; None, and a sentence, where the store
    cannot be used.
    """
    try:
        run_id = read_parent(folder)
        if afresh or run_id is None or not tracking.reopen_parent(run_id, uri):
            run_id = tracking.start_parent(run, uri)
    except UserError as error:
        say(f"not logged yet: {error}")
        return None
    return run_id


def _close_parent_run(folder: Path, run: Any, run_id: str | None, uri: str) -> None:
    """Log what the whole sweep came to, and end its run."""
    try:
        entry = save(folder, run, uri, sweep=True)
        if run_id is not None:
            tracking.finish_parent(run_id, uri, run.status, run.metrics)
            entry.mark_logged(run_id)
    except UserError as error:
        say(f"not logged: {error}")


def _send(folder: Path, uri: str) -> None:
    """Send what could not be sent before; what still cannot be is kept."""
    from tractexp.tracking.sync import NOT, count_unsynced, sync

    left = count_unsynced(folder)
    if left and sync(folder, uri, tell=lambda line: None)[NOT]:
        say(f"{left} runs are not logged; they are kept in {folder}, and 'tractexp sync' logs them")


def compute_metrics(jobs: list[Any]) -> dict[str, float]:
    """Figures of a sweep as a whole."""
    ends = [s for job in jobs if (s := read(job.folder)) is not None]
    counts = {
        f"jobs_{kind}": sum(s.status == kind for s in ends)
        for kind in (FINISHED, FAILED, INTERRUPTED)
    }
    measured = {
        name: [f for s in ends if (f := s.metric(name)) is not None]
        for name in (ESTIMATED, SEARCHED)
    }
    best = {f"best_{name}": min(values) for name, values in measured.items() if values}
    return {"jobs": len(jobs), **counts, **best}


def list_shared_settings(configs: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """The settings that all jobs of a sweep have, as `tracking.flatten` spells them."""
    settings = [tracking.flatten(config) for config in configs]
    return {
        key: value
        for key, value in settings[0].items()
        if all(flat.get(key) == value for flat in settings)
    }


def _describe_sweep(folder: Path, jobs: list[Any], overrides: list[str]) -> Any:
    """The parent's run: settings that all jobs share, tags and folder."""
    first = Job(jobs[0].config, jobs[0].choices, folder)
    return tracking.TrackedRun(
        experiment=first.experiment,
        name=f"sweep {folder.name}",
        parameters=list_shared_settings([job.config for job in jobs]),
        tags={
            "task": first.choices["task"],
            "sweep": " ".join(overrides),
            "git_commit": provenance.find_commit(),
        },
        description=f"A sweep of {len(jobs)} jobs: {quoting.markdown(' '.join(overrides))}",
    )
