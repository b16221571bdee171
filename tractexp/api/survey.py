"""A folder of recordings as a table: what happened in each file, to each load, and what is worth
fitting.
"""

import functools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.arguments import public
from tractexp.api.job import Job
from tractexp.api.joint_command import build_fit_command
from tractexp.api.listed import Listed
from tractexp.api.load_command import RACE
from tractexp.api.surveying import (
    FEWEST_DIPS,
    complete_entries,
    compute_keys,
    look_at_files,
    name_load,
)
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.configuration.overrides import build_typed_command, format_assignment
from tractexp.configuration.plugin import get, plugin
from tractexp.errors import DATA, UserError, check_range
from tractexp.outcome import Written
from tractexp.record import detect, measure_promise
from tractexp.recording import archive
from tractexp.recording.record_files import find_records
from tractexp.report import survey as shown
from tractexp.report.survey import UNREAD
from tractexp.storage import files
from tractexp.text import quoting
from tractexp.text.progress import Progress, tell_stages

if TYPE_CHECKING:
    import pandas

    from tractexp.api.given import ModelGiven
    from tractexp.identification.plan import ChosenEvent

ROWS = "rows"  # in the folder of `keep`: an entry for each file that was looked at
# events that are read again to be ranked: those of the greatest depth over noise
MOST_RANKED_EVENTS = 300
PICTURES = ("U_picture", "P_picture")
ABOUT = {
    "event": "FILE#LOAD.DIP, as data.train takes it",
    "when": "by the recorder's clock",
    "start": "s in the file",
    "duration": "s",
    "depth": "of the voltage before",
    "U2": "of U1 before",
    "jump": "degrees",
    "P_before": "MW",
    "Q_before": "Mvar",
    "P_after": "MW",
    "Q_after": "Mvar",
    "unit": "of P: MW, pu where no base is known, secondary where the ratio is not",
    "noise": "of P, before the event",
    "rate": "Hz, sampled",
}


@dataclass(frozen=True, eq=False, repr=False)
class Surveyed(Written):
    """The table of an archive. `content` is that of `survey.json`."""

    kind = "survey"
    page = "survey.html"

    content: Mapping[str, Any]

    @property
    def folder(self) -> str:
        """The archive."""
        return self.content["folder"]

    @property
    def rows(self) -> Listed:
        """One row for each event of each load; for a file without any, or that cannot be read, one
        that says so.
        """
        plain = [
            {k: v for k, v in row.items() if k not in PICTURES} for row in self.content["rows"]
        ]
        return Listed(plain, f"events in {self.folder}")

    @property
    def unread(self) -> Listed:
        """One row for each file that cannot be read: its name and the reason."""
        rows = [
            {"file": row["file"], "why": row["why"]}
            for row in self.content["rows"]
            if row["kind"] == UNREAD
        ]
        return Listed(rows, f"files of {self.folder} that cannot be read")

    @property
    def informative(self) -> list[str]:
        """Names of the events that tell most about the model together, the best first; none where
        not asked for.
        """
        return [each["event"] for each in self.content["informative"]]

    @property
    def command(self) -> str:
        """The command that fits the chosen events together; "" where not asked for."""
        return self.content["command"]

    def to_frame(self) -> "pandas.DataFrame":
        """The rows as a pandas frame."""
        return self.rows.to_frame()

    def table(self) -> Table:
        """How many events there are of each kind."""
        return shown.tabulate_kinds(self.content)

    def summary(self) -> Report:
        """The counts of events by kind, and those that are worth fitting."""
        return shown.build_summary(self.content)

    def report(self) -> Report:
        """The page: a row for each event."""
        return shown.report(self.content)

    @property
    def next_step(self) -> str:
        """The command that fits what is worth it, or that shows why nothing is."""
        if self.command:
            return f"fit them together: {self.command}"
        worth = [row for row in self.content["rows"] if row["worth"]]
        loads = Counter(name_load(row, Path(self.folder)) for row in worth)
        if loads and max(loads.values()) >= FEWEST_DIPS:
            station = ("task=station", format_assignment("data.path", self.folder))
            return f"fit each load to all its dips: {quoting.shell('tractexp', *station)}"
        if worth:
            best = max(worth, key=_rate_promise)
            return f"fit {best['event']}: {best['command']}"
        seen = next((row for row in self.content["rows"] if row["kind"] != UNREAD), None)
        if seen is None:
            return f"see what can be read: {quoting.shell('tractexp', 'list', 'data')}"
        look = quoting.shell("tractexp", "look", str(Path(self.folder, seen["file"])))
        return f"see why nothing is worth fitting: {look}"

    def write_results(self, folder: Path) -> list[Path]:
        """Write the rows as `survey.json`, `survey.csv` and `survey.parquet`."""
        frame = self.to_frame()
        return [
            files.write_json(folder / "survey.json", self.content),
            files.write(folder / "survey.csv", frame.map(_quote_cell).to_csv(index=False)),
            files.write(folder / "survey.parquet", frame.to_parquet(index=False)),
        ]


def _quote_cell(value: Any) -> Any:
    """A text that no spreadsheet takes for a formula."""
    return quoting.cell(value) if isinstance(value, str) else value


@public
def survey(
    folder: str | Path,
    *,
    informative: int | None = None,  # so many events that tell most about the model together
    model: "ModelGiven | None" = None,
    # of the model there: fit, of the deepest event; default; or the path of a result.json
    values: "str | Path | Mapping[str, float]" = "fit",
    cores: int | None = None,  # processes; null: all cores
    keep: str | Path | None = None,
    progress: Progress = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    substeps: int | None = None,
) -> Surveyed:
    """Look at every file below a folder that can be read; what cannot be read is a row with the
    reason.

    Parameters
    ----------
    folder : path
        Of the archive.
    informative : int
        So many events are chosen that tell most about `model` together (D-optimal); None: none.
    model, bounds, fixed, substeps : as in `tractexp.identify`
        The model whose parameters the chosen events shall tell.
    values : as in `tractexp.plan`
        The parameters at which they are chosen.
    cores : int
        Processes that look; None: all cores.
    keep : path
        A folder where the rows of each file are stored as they come, so that the next survey with
        it looks only at files that are new or changed.
    progress : None, False or callable
        None shows how many files are done, False does not.

    Returns
    -------
    Surveyed
        `rows`, one for each event of each file; those `informative`, and the `command` that fits
        them; `unread` files with the reason.

    Raises
    ------
    UserError
        For a folder that is not there or holds no file that can be read.
    """
    check_range("task.informative", informative, 1)
    check_range("task.cores", cores, 1)
    place = Path(folder)
    paths = list(find_records(place))
    if not paths:
        raise UserError(f"{DATA.path}={folder} holds no file that can be read")
    look_at = functools.partial(look_at_files, place, cores=cores or -1)
    own, where = compute_keys(place, paths), Path(keep) if keep else None
    rows, looked_at = complete_entries(ROWS, where, own, look_at, "files", progress)
    content = {
        "folder": str(folder),
        "files": len(rows),
        "looked_at": looked_at,
        "about": ABOUT,
        "rows": [row for own in rows.values() for row in own],
        "informative": [],
        "command": "",
    }
    if informative is None:
        return Surveyed(content)
    worth = sorted(
        (row for row in content["rows"] if row["worth"]), key=_rate_promise, reverse=True
    )[:MOST_RANKED_EVENTS]
    settings = {"bounds": bounds, "fixed": fixed, "substeps": substeps}
    with tell_stages(progress) as stage:
        stage(f"choosing among {len(worth)} events")
        best = _choose_most_telling(
            place, [row["event"] for row in worth], informative, model, values, settings
        )
    content["informative"] = files.make_plain(
        [{"event": c.name, "gain": c.gain, "half": c.half} for c in best]
    )
    raced = propose_race(content["rows"], content["informative"]) if model is None else []
    content["command"] = build_fit_command(str(folder), [c.name for c in best], *raced)
    return Surveyed(content)


def propose_race(
    rows: Sequence[Mapping[str, Any]], chosen: Sequence[Mapping[str, Any]]
) -> list[str]:
    """The setting that races structures, where each of the chosen events' own commands has it."""
    names = {each["event"] for each in chosen}
    for row in rows:
        words = str(row["command"]).split()
        if row.get("event") in names and RACE not in words:
            return []
    return [RACE]


def _rate_promise(row: Mapping[str, Any]) -> float:
    """How much the event of a row may tell."""
    return measure_promise(row["depth"], row["noise"])


def _choose_most_telling(
    folder: Path,
    names: Sequence[str],
    most: int,
    model: Any,
    values: Any,
    settings: Mapping[str, Any],
) -> "list[ChosenEvent]":
    """The events that tell most together. Raises `UserError` where none is worth fitting."""
    from tractexp.api.plan import select_events
    from tractexp.api.setup import Setup

    if not names:
        raise UserError(f"no event in {folder} is worth fitting; the table says why")
    events = [detect(record) for record in archive.records(folder, list(names), DATA.train)]
    return select_events(Setup.from_arguments(events, model, **settings), values, most)


@plugin
class Survey(Task, call=survey, given=("folder", "keep")):
    """Look at every file of a folder, `data.path`: what happened in it, to which load, and what is
    worth fitting.

    The rows of each file are kept as they come: a run that was stopped goes on where it was, and
    the next run looks only at what is new or changed.
    """

    resumes = True
    reads = ("data", "model")

    def needless(self) -> tuple[str, ...]:
        """The model matters only where events are chosen for it."""
        return () if getattr(self, "informative") else ("model",)  # noqa: B009 # a setting that the call declares

    def perform(self, job: Job, **instead: Any) -> Surveyed:
        """Survey the folder that `data.path` names. Raises `UserError` for a reader of single
        files.
        """
        node = job.config["data"]
        if not getattr(get("data", node["name"]), "folders", False):
            raise UserError(
                f"data={job.choices['data']} is no folder; leave it out and give {DATA.path}=FOLDER"
            )
        if not node["path"]:
            raise UserError(
                f"{DATA.path} is missing: give the folder of the recordings, e.g."
                f" {DATA.path}=recordings"
            )
        result = super().perform(job, folder=node["path"], keep=job.folder, **instead)
        if not result.informative:
            return result
        model = [
            f"{key}={value}" for key, value in job.given.items() if key.partition(".")[0] == "model"
        ]
        if "model" not in job.given:
            chosen = propose_race(result.content["rows"], result.content["informative"])
            model = [*chosen, *model]
        data = {"name": node["name"], "path": node["path"], "train": result.informative}
        return Surveyed({**result.content, "command": build_typed_command(data, *model)})

    def collect_log(self, job: Job, result: Surveyed) -> dict[str, Any]:
        """How many files, events and events worth fitting there are, for MLflow."""
        rows = result.content["rows"]
        metrics = {
            "files": result.content["files"],
            "rows": len(rows),
            "worth": sum(r["worth"] for r in rows),
        }
        return {"name": f"survey of {Path(result.folder).name}", "metrics": metrics}
