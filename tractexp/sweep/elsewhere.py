"""Jobs on workers that share no disk with the sweep: the records go along, and what the job leaves
in its folder comes back through the engine.
"""

import contextlib
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from tractexp import tracking
from tractexp.storage import files
from tractexp.sweep.job import OUTPUT, SweepJob, open_folder, read_shared_events, work
from tractexp.sweep.status import FILE, FINISHED, Status
from tractexp.tracking import runfile

CONFIGURATION = ".hydra"  # of a job's folder: written where that lies


@dataclass(frozen=True)
class Delivery:
    """How a job ended, and {path within its folder: content} of what it left there."""

    end: Status
    contents: dict[str, bytes]


def pack_job(job: SweepJob) -> SweepJob:
    """The job with all that a worker may not find where it is: records, and the store's address."""
    node = job.config["tracking"]
    config: dict[str, Any] = {**job.config}
    if node["enabled"]:
        config["tracking"] = {**node, "uri": tracking.resolve_address(node["uri"])}
    events = None
    with contextlib.suppress(Exception):  # the job itself will say
        events = read_shared_events(config["data"], job.inputs)
    return replace(job, config=config, events=events)


def work_elsewhere(job: SweepJob) -> Delivery:
    """Run a job in a folder of the worker's own, which goes when its content is sent."""
    with tempfile.TemporaryDirectory() as there:
        own = replace(job, folder=Path(there, "sweep", *PurePosixPath(job.name).parts))
        end = work(own)
        contents = {
            path.relative_to(own.folder).as_posix(): path.read_bytes()
            for path in own.folder.rglob("*")
            if path.is_file()
        }
        contents[OUTPUT] = contents[OUTPUT].replace(
            str(own.folder).encode(), str(job.folder).encode()
        )
        return Delivery(end, contents)


def unpack_job(job: SweepJob, delivery: Delivery) -> Status:
    """Write what a job left into its folder, its status last; returns how it ended.

    Where it failed, results of an earlier time stay.
    """

    def write(folder: Path) -> list[Path]:
        paths = []
        for name, content in delivery.contents.items():
            place = PurePosixPath(name)
            outside = place.is_absolute() or ".." in place.parts
            if not outside and place.parts[0] not in (CONFIGURATION, FILE):
                path, private = folder.joinpath(*place.parts), name == runfile.FILE
                paths.append(files.write(path, content, lasting=False, private=private))
        return paths

    with open_folder(job) as place:
        if delivery.end.status == FINISHED:
            place.place(write)
        else:
            write(job.folder)
    delivery.end.end(job.folder)
    return delivery.end
