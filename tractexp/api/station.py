"""A substation's loads by all dips of a recorder's years: one model for each, what differs from dip
to dip, and how well each dip was predicted by those before it.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.arguments import public
from tractexp.api.compose import LoadModel, resolve_model
from tractexp.api.identification import UNUSABLE, Identification
from tractexp.api.job import Job
from tractexp.api.joint_command import build_fit_command
from tractexp.api.listed import Listed
from tractexp.api.station_load import LoadJob, fit_load, read_files, restore_dips
from tractexp.api.survey import survey
from tractexp.api.surveying import FEWEST_DIPS, complete_entries, compute_keys, name_load
from tractexp.api.task import Task, call
from tractexp.blocks import Report, Table
from tractexp.cache.store import Store, compute_key, describe_environment
from tractexp.configuration.overrides import format_assignment, survey_of
from tractexp.configuration.plugin import get, plugin
from tractexp.configuration.run_command import find_folder
from tractexp.domain.averaging import RECORDED, check_window
from tractexp.errors import DATA, UserError, check_choice, check_range, list_allowed
from tractexp.exchange.format import choose_format
from tractexp.identification.result import Result
from tractexp.outcome import Written
from tractexp.process.workers import Workers, list_backends
from tractexp.record import Record
from tractexp.report import station as shown
from tractexp.storage import files
from tractexp.text import quoting
from tractexp.text.progress import Progress, make_counter, tell
from tractexp.text.wording import count_noun

if TYPE_CHECKING:
    import pandas

    from tractexp.api.given import ModelGiven

MOST_EXAMINED_DIPS = 3  # that an investigation of a load begins with
DIPS, LOADS = "dips", "loads"  # in the folder of `keep`: an entry for each file, for each load


@dataclass(frozen=True, eq=False, repr=False)
class Station(Written):
    """The loads of a station. `content` is that of `station.json`."""

    kind = "station"
    page = "station.html"

    content: Mapping[str, Any]

    @property
    def folder(self) -> str:
        """The folder of the recordings."""
        return self.content["folder"]

    @property
    def loads(self) -> Listed:
        """One row for each load that was fitted."""
        return Listed([*map(shown.tell_load, self._fitted_loads)], f"loads of {self.folder}")

    @property
    def not_fitted(self) -> Listed:
        """One row for each load that was not, with the reason."""
        return Listed(
            [
                {"station": load["station"], "load": load["load"], "why": load["why"]}
                for load in self.content["loads"]
                if "why" in load
            ],
            f"loads of {self.folder} that were not fitted",
        )

    @property
    def _fitted_loads(self) -> list[Mapping[str, Any]]:
        return [load for load in self.content["loads"] if "why" not in load]

    def load_named(self, name: str) -> Mapping[str, Any]:
        """Everything that is known of a load, as `station.json` has it. Raises `UserError` for a
        name that there is not.
        """
        by_name = {load["load"]: load for load in self.content["loads"]}
        if name not in by_name:
            raise UserError(f"there is no load '{name}'{list_allowed(name, by_name, 'Loads')}")
        return by_name[name]

    def constants(self, name: str) -> Listed:
        """The constants of a load with 95 % intervals, on the base of its motors' power."""
        return Listed(self.load_named(name)["constants"], f"constants of {name}")

    def events(self, name: str) -> Listed:
        """The dips of a load in order of time: shares, and how well each was predicted."""
        return Listed(self.load_named(name)["events"], f"dips of {name}")

    def identification(self, name: str) -> Identification:
        """A load as it usually is, as one identified model: it predicts, simulates and exports."""
        return Identification(Result.from_content(self.load_named(name)["result"], name))

    def to_frame(self) -> "pandas.DataFrame":
        """The dips of all loads as a pandas frame."""
        rows = [
            {"station": load["station"], "load": load["load"], **event}
            for load in self._fitted_loads
            for event in load["events"]
        ]
        return Listed(rows, "dips").to_frame()

    def table(self) -> Table:
        """The loads: constants, shares, and how well dips were predicted."""
        return shown.tabulate_loads(self.content)

    def summary(self) -> Report:
        """The table of loads, and by how much their dips differ."""
        return shown.build_summary(self.content)

    def screen(self) -> Report:
        """The answer on one screen of a terminal."""
        return shown.build_screen(self.content)

    @property
    def next_step(self) -> str:
        """The command that exports the first load that may be used; else one that finds what its
        model lacks.
        """
        place = find_folder()
        for number, load in enumerate(self._fitted_loads, 1):
            format = choose_format(self.identification(load["load"]).result)
            if place and format and load["usability"] != UNUSABLE:
                file = format_assignment("task.parameters", str(place / name_file(number)))
                export = quoting.shell("tractexp", "task=export", file, f"task.format={format}")
                return f"export {load['load']}: {export}"
        for load in self._fitted_loads:
            told = sorted(load["events"], key=lambda event: -event["depth"])[:MOST_EXAMINED_DIPS]
            events = [event["event"] for event in told]
            command = build_fit_command(self.folder, events, "task=discrepancy")
            return f"find what {load['load']} lacks at its deepest dips: {command}"
        return f"see what each file holds: {survey_of(self.folder)}"

    def report(self) -> Report:
        """The page: each load over the years."""
        return shown.report(self.content)

    def write_results(self, folder: Path) -> list[Path]:
        """Write `station.json`, the dips of all loads as `station.csv`, and each load as a result
        that predicts and exports, `load_1.json`, ...
        """
        frame = self.to_frame()
        loads = [
            files.write_json(folder / name_file(number), load["result"])
            for number, load in enumerate(self._fitted_loads, 1)
        ]
        return [
            files.write_json(folder / "station.json", self.content),
            files.write(folder / "station.csv", frame.to_csv(index=False)),
            *loads,
        ]


def name_file(number: int) -> str:
    """The file of a load that was fitted, by its number from 1."""
    return f"load_{number}.json"


@public
def fit_station(
    folder: str | Path,
    model: "ModelGiven | None" = None,
    *,
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    substeps: int | None = None,
    physical: bool | None = None,
    window: float | str | None = RECORDED,
    cores: int | None = None,  # processes; null: all cores
    backend: str = "loky",  # of joblib: processes of this computer, or dask
    address: str | None = None,  # of a Dask scheduler; null: a cluster of its own
    keep: str | Path | None = None,
    progress: Progress = None,
) -> Station:
    """Fit every load of a recorder to all dips of its years: constants of its machines, which all
    dips share, and the share of the motors in each.

    Parameters
    ----------
    folder : path
        Of the recordings; each event of each load in it is found as `tractexp.survey` finds it.
        Loads are told apart by station and name, tables by their folders.
    model : as in `tractexp.identify`
        A model with a motor; "auto" races structures on the dips of a load that tell most.
    bounds, fixed, substeps, physical : as in `tractexp.identify`
        Bounds of impedances and inertia are those of motors that draw the torque's default.
    window : float [s], name, "recorded" or None
        Over which the recorder averages phasors, as in `tractexp.compose`, where the model says
        none; None: no model is looked at through it but those of what happens within a cycle.
    cores : int
        Processes that read and fit; None: all cores.
    backend, address : str
        Of joblib ("loky", "dask", ...), and of a Dask scheduler that is there.
    keep : path
        A folder where what was read of each file and found of each load is stored as it comes: what
        was stopped goes on there, and the next call reads only new files.
    progress : None, False or callable
        None shows how many files and loads are done, False does not.

    Returns
    -------
    Station
        `loads`, one row each; of a load its `constants` and `events`; `report()`.

    Raises
    ------
    UserError
        For a folder that is not there or in which no event is worth fitting.
    """
    check_range("task.cores", cores, 1)
    check_choice("task.backend", backend, list_backends())
    workers = Workers(cores or -1, backend, address, where="task")
    chosen = {"bounds": bounds, "fixed": fixed, "substeps": substeps, "physical": physical}
    load = resolve_model(model).with_(**chosen)
    if load.window is None:
        load = replace(load, window=window)
    check_window(load.window, load.domain)
    place = Path(folder)
    surveyed = call(survey, folder, cores=cores, keep=keep, progress=progress)
    rows = [row for row in surveyed.content["rows"] if row["worth"]]
    if not rows:
        raise UserError(f"no event in {folder} is worth fitting; a survey says why of each")
    read = _read_dips(place, rows, workers, Path(keep) if keep else None, progress)
    jobs, single = _group(rows, read, load, place)
    tell(progress, [f"{count_noun(len(rows), 'dip')} of {count_noun(len(jobs), 'load')}"])
    fitted = _fit_loads(jobs, workers, Path(keep) if keep else None, progress)
    content = {
        "folder": str(folder),
        "files": surveyed.content["files"],
        "loads": [*fitted, *single],
        "unread": [
            {"event": name, "why": one["why"]} for name, one in read.items() if "why" in one
        ],
    }
    return Station(content)


def _read_dips(
    folder: Path,
    rows: Sequence[Mapping[str, Any]],
    workers: Workers,
    keep: Path | None,
    progress: Progress,
) -> dict[str, dict[str, Any]]:
    """{event: its record, or why there is none} of the rows of a survey."""
    wanted = defaultdict[str, list[str]](list)
    for row in rows:
        wanted[row["file"]].append(row["event"])
    own = compute_keys(folder, [folder / file for file in wanted])

    def read(fresh: Sequence[str]) -> Iterator[tuple[str, Any]]:
        return read_files(folder, {file: wanted[file] for file in fresh}, workers)

    by_file, _ = complete_entries(DIPS, keep, own, read, "files with dips", progress, restore_dips)
    return {
        name: {**one, "key": own[file]}
        for file, names in wanted.items()
        for name, one in zip(names, by_file[file], strict=True)
    }


def _group(
    rows: Sequence[Mapping[str, Any]],
    read: Mapping[str, Mapping[str, Any]],
    model: LoadModel,
    folder: Path,
) -> tuple[list[LoadJob], list[dict[str, Any]]]:
    """A job for each load with dips enough, and the entries of the loads with too few."""
    groups = defaultdict[tuple[str, str], list[tuple[str, str | None, Record]]](list)
    stamps = defaultdict[tuple[str, str], list[str]](list)
    for row in rows:
        one = read[row["event"]]
        name = name_load(row, folder)
        dips = groups[name]
        if "record" in one:
            dips.append((row["event"], row["when"], one["record"]))
            stamps[name].append(row["event"] + one["key"])
    jobs = [
        LoadJob(load, station, dips, model, stamps[station, load])
        for (station, load), dips in groups.items()
        if len(dips) >= FEWEST_DIPS
    ]
    single = [
        {
            "load": load,
            "station": station,
            "why": f"{count_noun(len(dips), 'dip')}, where {FEWEST_DIPS} are needed",
        }
        for (station, load), dips in groups.items()
        if len(dips) < FEWEST_DIPS
    ]
    return jobs, single


def _fit_loads(
    jobs: Sequence[LoadJob], workers: Workers, keep: Path | None, progress: Progress
) -> list[dict[str, Any]]:
    """The entry of each load; of one that was fitted to the same dips before, the stored one."""
    store = Store(LOADS, folder=keep or Path())
    names = [
        compute_key(describe_environment(), job.load, job.station, job.keys, job.model)
        if keep
        else ""
        for job in jobs
    ]
    entries = enumerate(map(store.read_json, names))
    found = {k: entry for k, entry in entries if entry is not None}
    fresh = [k for k in range(len(jobs)) if k not in found]
    position = {id(jobs[k]): k for k in fresh}
    with make_counter("loads", progress)(len(fresh)) as count:
        for job, told in workers.results(fit_load, [jobs[k] for k in fresh]):
            k = position[id(job)]
            killed = "the program was killed at this load, as where the memory is too small for it"
            found[k] = told or {"load": job.load, "station": job.station, "why": killed}
            if told:
                store.write_json(names[k], told)
            count()
    return [found[k] for k in range(len(jobs))]


@plugin
class StationTask(Task, call=fit_station, given=("folder", "keep", "window")):
    """Fit every load of a recorder to all dips in the folder `data.path`: constants of machines,
    shares of the motors by dip, hour, weekday and season, and how well dips were predicted.

    What was read and fitted is kept: a run that was stopped goes on where it was, and the next run
    reads only what is new.
    """

    resumes = True
    reads = ("data", "model")

    def perform(self, job: Job, **instead: Any) -> Station:
        """Fit the loads of the folder that `data.path` names. Raises `UserError` for a reader of
        single files.
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
        window = job.config["model"]["window"]
        return super().perform(job, folder=node["path"], keep=job.folder, window=window, **instead)

    def collect_log(self, job: Job, result: Station) -> dict[str, Any]:
        """How many loads were fitted to how many dips, for MLflow."""
        loads = result.loads.rows
        metrics = {"loads": len(loads), "dips": sum(load["dips"] for load in loads)}
        return {"name": f"station of {Path(result.folder).name}", "metrics": metrics}
