"""An archive of recordings as a table, and the events in it that tell most about a model."""

from pathlib import Path
from typing import TYPE_CHECKING

from tractexp.errors import UserError, check_range
from tractexp.overrides import typed
from tractexp.plugin import get, plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import Job, Task, call

if TYPE_CHECKING:
    from tractexp.api.survey import Survey as Surveyed


@plugin
class Survey(Task):
    """Look at every file of a folder, `data.path`: what happened in it, to which load, and what is worth fitting.

    The rows of each file are kept as they come: a run that was stopped goes on where it was, and the next run looks
    only at what is new or changed.
    """

    resumes = True
    reads = ("data", "model")

    informative: int | None = None  # so many events that tell most about the model together
    values: str = "fit"  # of the model there: fit, of the deepest event; default; or the path of a result.json
    cores: int | None = None  # processes; null: all cores

    def check(self) -> None:
        for key in ("informative", "cores"):
            if (value := getattr(self, key)) is not None:
                check_range(f"task.{key}", value, 1)

    def needless(self) -> tuple[str, ...]:
        """The model matters only where events are chosen for it."""
        return () if self.informative else ("model",)

    def run(self, job: Job) -> None:
        from tractexp.api.survey import survey

        node = job.config["data"]
        if not getattr(get("data", node["name"]), "folders", False):
            raise UserError(f"data={job.choices['data']} is no folder; leave it out and give data.path=FOLDER")
        if not node["path"]:
            raise UserError("data.path is missing: give the folder of the recordings, e.g. data.path=recordings")
        made = call(
            survey, node["path"], informative=self.informative, model=job.config["model"], values=self.values,
            cores=self.cores, keep=job.folder,
        )  # fmt: skip
        if made.informative:
            model = [f"{key}={value}" for key, value in job.given.items() if key.partition(".")[0] == "model"]
            data = {"name": node["name"], "path": node["path"], "train": made.informative}
            made = type(made)({**made.content, "command": typed(data, *model)})
        paths = made.write_results(job.folder)
        tell(made)
        paths += made.write_drawings(job.folder)
        listed(paths)
        rows = made.content["rows"]
        job.log(
            name=f"survey of {Path(node['path']).name}", values={}, artifacts=[*paths, job.folder / ".hydra"],
            metrics={"files": made.content["files"], "rows": len(rows), "worth": sum(r["worth"] for r in rows)},
        )  # fmt: skip


def tell(made: "Surveyed") -> None:
    """Print what is in the archive, what cannot be read, and the events that tell most where they were asked for."""
    told = made.table()
    looked, whole = made.content["looked_at"], made.content["files"]
    say(f"{whole} files in {made.folder}, {looked} of them new or changed")
    table(told.columns, told.cells)
    for row in made.unread.rows[:10]:
        say(f"  not read: {row['why'] if row['file'] in row['why'] else row['file'] + ': ' + row['why']}")
    if len(made.unread) > 10:
        say(f"  and {len(made.unread) - 10} more, in the table")
    if not made.informative:
        return
    say("most informative together, the best first:")
    for k, each in enumerate(made.content["informative"]):
        more = f", which narrows the intervals by {each['gain']:.0%}" if k else ""
        say(f"  {each['event']}{more}")
    say("to fit them together:")
    say(f"  {made.command}")
