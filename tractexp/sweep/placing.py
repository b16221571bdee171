"""Which folder a job of a sweep has, and whether it was done there before."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from tractexp.errors import UserError
from tractexp.sweep import status
from tractexp.sweep.job import SweepJob
from tractexp.sweep.status import ENDED, FINISHED, INTERRUPTED, RUNNING
from tractexp.text import quoting


def place(jobs: Sequence[SweepJob], folder: Path) -> list[SweepJob]:
    """Give each job its folder: that of the same configuration in an earlier sweep here, else a
    free one.

    Free is the folder of `hydra.sweep.subdir`, or the next number; also a folder that holds nothing
    yet but what Hydra hides in it, as a full disk or a kill leaves it. Raises `UserError` where the
    folder of `hydra.sweep.subdir` is another job's, somebody else's or not below the sweep's.
    """
    folders = {
        s.configuration: p for p in _find_job_folders(folder) if (s := status.read(p)) is not None
    }
    taken = set(folders.values())
    above = set(itertools.chain.from_iterable(own.parents for own in taken))
    free = (k for k in itertools.count() if not _holds_something(folder / str(k)))
    placed = []
    for job in jobs:
        if job.configuration not in folders:
            there = (
                _find_own_folder(folder, job, taken, above)
                if job.subdir
                else folder / str(next(free))
            )
            taken.add(there)
            above.update(there.parents)
            folders[job.configuration] = there
        there = folders[job.configuration]
        placed.append(
            replace(job, folder=there, subdir=job.subdir and there.relative_to(folder).as_posix())
        )
    return placed


def _find_own_folder(folder: Path, job: SweepJob, taken: set[Path], above: set[Path]) -> Path:
    """The folder that `hydra.sweep.subdir` names, where it is the job's alone.

    `taken` are the other jobs' folders, `above` those that hold them.
    """
    there = Path(folder, *Path(job.subdir).parts)
    if ".." in there.parts or folder not in there.parents:
        raise UserError(
            f"hydra.sweep.subdir={job.subdir} does not lie below the sweep's folder {folder}"
        )
    if there in above or not taken.isdisjoint((there, *there.parents)):
        raise UserError(
            f"hydra.sweep.subdir={job.subdir} is the folder of two jobs; name all that differs,"
            " such as "
            "hydra.sweep.subdir='${optimizer.name}_${seed}', or all of it:"
            " '${hydra.job.override_dirname}'"
        )
    if _holds_something(there):
        raise UserError(
            f"hydra.sweep.subdir={job.subdir}: {there} holds files that are not this job's; name"
            " another"
        )
    return there


def list_placing_overrides(job: SweepJob) -> list[str]:
    """The overrides by which any launcher of Hydra's puts a job into its folder."""
    return [
        f"hydra.sweep.dir={quoting.hydra(str(job.sweep))}",
        f"hydra.sweep.subdir={quoting.hydra(job.name)}",
    ]


def is_finished(job: SweepJob) -> bool:
    """Whether this job, with the same code and data, has been done in its folder."""
    state = status.read(job.folder)
    same = state is not None and (state.configuration, state.inputs) == (
        job.configuration,
        job.inputs,
    )
    return same and state.status == FINISHED  # type: ignore[union-attr]


def await_end(job: SweepJob) -> None:
    """Have the end of a job told from that of an earlier time, which stays until then."""
    if (job.folder / status.FILE).exists():
        replace(job.status, status=INTERRUPTED).begin(job.folder)


def settle(job: SweepJob, end: str, problem: str) -> None:
    """Write the end of a job that has not written its own; where it is interrupted, an earlier end
    stands.
    """
    newest = status.read_newest(job.folder)
    earlier = status.read(job.folder)
    if newest is not None and newest.status in ENDED:
        return
    if end == INTERRUPTED and earlier is not None and earlier.status != RUNNING:
        status.forget(job.folder)
    else:
        replace(job.status, status=end, message=problem).end(job.folder)


def _find_job_folders(folder: Path) -> list[Path]:
    """The folders of an earlier sweep's jobs, at any depth."""
    return [path.parent for path in folder.rglob(status.FILE)]


def _holds_something(folder: Path) -> bool:
    """Whether a folder holds more than hidden files."""
    return folder.exists() and not (
        folder.is_dir() and all(p.name.startswith(".") for p in folder.iterdir())
    )
