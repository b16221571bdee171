"""One run of a task: its configuration as plain data, its records and its folder."""

import functools
import re
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.cache import provenance
from tractexp.configuration.plugin import build, get
from tractexp.errors import UserError
from tractexp.storage.run_folder import Write
from tractexp.text import quoting
from tractexp.text.progress import is_everything_asked, say

if TYPE_CHECKING:
    from tractexp.record.identity import Identity
    from tractexp.tracking import TrackedRun

ALWAYS = ("task", "experiment", "seed", "tracking", "sweep", "hydra")  # open to every task
LABEL = "load"  # the tag with station, load and dips
NAMED = ("optimizer", "data")  # choices that a run is named after anyway


def name_variant(optimizer: str, chosen: Mapping[str, str]) -> str:
    """The name of an optimizer with the settings that were chosen beside it, whatever the seed:
    "issa levy=false".

    Files go without their folders.
    """
    beside = {key: value for key, value in chosen.items() if key.partition(".")[0] not in ALWAYS}
    parts = [
        f"{key.removeprefix('optimizer.')}={value}"
        for key, value in sorted(beside.items())
        if key not in NAMED
    ]
    return " ".join([optimizer, *(re.sub(r"[^\s,\[=']*/", "", part) for part in parts)])


def read_events(data: Mapping[str, Any]) -> Any:
    """The recorded events of a choice of data, read and with their dips found (`Events` of
    `Event`).
    """
    from tractexp.record import Events, detect, read_records

    records = read_records(data)
    return Events([detect(r) for r in records.train], [detect(r) for r in records.validate])


@dataclass(frozen=True)
class Job:
    """One run: its configuration as plain data, and the folder it writes to."""

    config: Mapping[str, Any]
    choices: Mapping[str, str]  # what was chosen in each group: {"optimizer": "issa_no_levy", ...}
    folder: Path
    sweep: str | None = None  # run id of the sweep this job belongs to, where that is logged
    in_sweep: bool = False
    of_many: bool = False  # in a sweep: what only a person looks at may be left out
    # whether it logs what it keeps for the store, which in a sweep its parent does
    logs: bool = True
    # what the user chose, {"optimizer": "pso"}: no defaults
    given: Mapping[str, str] = field(default_factory=dict)
    measured: dict[str, float] = field(default_factory=dict)  # metrics by name, as they are logged
    # how results take the place of an earlier run's
    placed: Callable[[Write], list[Path]] | None = None
    # what reads a choice of data; the jobs of a sweep share what was read
    read_events: Callable[[Mapping[str, Any]], Any] = read_events

    @functools.cached_property
    def events(self) -> Any:
        """The recorded events, read and with their dips found (`Events` of `Event`)."""
        return self.read_events(self.config["data"])

    @functools.cached_property
    def events_of_fit(self) -> Any:
        """The events fitted and those held out as a fit takes them: on the base of the load in the
        first.
        """
        from tractexp.api.read import read_dips_together

        return read_dips_together(self.events.train, self.events.validate)

    def holding_out(self, siblings: Mapping[str, list[str]]) -> "Job":
        """The job with those files held out that belong to its choice of data, where it names none
        itself.
        """
        data: Mapping[str, Any] = self.config["data"]
        if self.choices["data"] not in siblings or data.get("validate"):
            return self
        held = [path for path in siblings[self.choices["data"]] if path not in data["train"]]
        return replace(self, config={**self.config, "data": {**data, "validate": held}})

    @functools.cached_property
    def optimizer(self) -> Any:
        """The run's optimizer."""
        return build("optimizer", self.config["optimizer"])

    @property
    def chosen(self) -> Any:
        """The optimizer and what it is called (a `Choice`)."""
        from tractexp.api.arguments import Choice

        return Choice(self.choices["optimizer"], self.config["optimizer"])

    @functools.cached_property
    def problem(self) -> Any:
        """The identification problem (a `Problem`)."""
        from tractexp.api.setup import Setup

        return Setup.from_arguments(
            self.events.train, self.config["model"], objective=self.config["objective"]
        ).problem

    def write(
        self, results: Write, track: "Callable[[list[Path]], TrackedRun | None]"
    ) -> list[Path]:
        """Write the results of a run into its folder: an earlier run's are there until these are
        whole. Their paths.

        What is to be logged of them is written beside them before they have their places. So
        whoever ends this process leaves no result that `tractexp sync` would not bring in.
        """

        def write_whole(folder: Path) -> list[Path]:
            from tractexp.tracking.runfile import save

            paths = results(folder)
            run = track([self.folder / path.relative_to(folder) for path in paths])
            if run is not None:
                save(self.folder, replace(run, key=self.key), self.store, place=folder)
            return paths

        return write_whole(self.folder) if self.placed is None else self.placed(write_whole)

    @functools.cached_property
    def key(self) -> str:
        """The random key by which its run is found in the store."""
        return uuid.uuid4().hex

    def tell(self, line: str) -> None:
        """Print a line of a call's progress. The first comes once the input is found right: then
        MLflow gets ready.
        """
        self.prepare_log()
        say(line)

    @property
    def tells_everything(self) -> bool:
        """Whether more than one screen is printed: where that is asked for, and in a sweep, whose
        jobs have no page.
        """
        return is_everything_asked() or self.in_sweep

    def tell_beside(self, line: str) -> None:
        """Print a line on what was read and begun, which is no part of the first screen."""
        self.prepare_log()
        if self.tells_everything:
            say(line)

    def identify_load(self, **instead: Any) -> Any:
        """The identification that model, objective, optimizer and limits describe (an
        `Identification`).
        """
        return build("task", {"name": "identify"}).perform(self, **instead)

    @property
    def seed(self) -> int:
        """The run's seed."""
        return int(self.config["seed"])

    @property
    def variant(self) -> str:
        """The optimizer and what else was chosen: runs of one variant differ in their
        seeds alone.
        """
        return name_variant(self.choices["optimizer"], self.given)

    @functools.cached_property
    def identities(self) -> "list[Identity]":
        """Which loads the records of a task are of, those fitted first.

        [] for tasks without records, and for data that have a name of their own, as the shipped
        ones.
        """
        from tractexp.record.identity import Identity

        named = self.choices["data"] != self.config["data"]["name"]
        if named or not get("task", self.config["task"]["name"]).takes_records():
            return []
        return [
            Identity.from_record(event.record)
            for event in (*self.events.train, *self.events.validate)
        ]

    @property
    def label(self) -> str:
        """Station, load and dips, short, as a run's name says them; "" where no file
        names a load.
        """
        from tractexp.record.identity import label

        fitted = self.identities[: len(self.events.train)] if self.identities else []
        dips = " and ".join(filter(None, (one.dip for one in fitted)))
        return ", ".join(filter(None, (label(fitted), dips))) if label(fitted) else ""

    @property
    def experiment(self) -> str:
        """The MLflow experiment: named by the configuration, or after the station, or after task
        and data.
        """
        stations = {one.station for one in self.identities}
        station = stations.pop() if len(stations) == 1 else ""
        named = self.config["tracking"]["experiment"] or (station and f"station {station}")
        return named or f"{self.choices['task']} {self.choices['data']}"

    @property
    def store(self) -> str:
        """The address of the MLflow store."""
        from tractexp import tracking

        return tracking.resolve_address(self.config["tracking"]["uri"])

    @functools.cached_property
    def _logger(self) -> Any:
        """The process that logs, where there is one."""
        from tractexp.tracking.process import open_logger

        return open_logger(self.store)

    def prepare_log(self) -> None:
        """Get MLflow ready beside the computation, in a process of its own; call it once the input
        is found right.

        A job of a sweep leaves it: its worker has MLflow at hand, and the cores are busy.
        """
        if self.config["tracking"]["enabled"] and not self.in_sweep:
            _ = self._logger

    def track(
        self,
        name: str,
        values: Mapping[str, float] | None = None,
        tags: Mapping[str, str] | None = None,
        **content: Any,
    ) -> "TrackedRun | None":
        """This job as it is logged in MLflow, with its configuration and tags; None where it is not
        to be.

        `values` are numbers that were given beside the configuration, `tags` are added to the job's
        own; `content` are further fields of `tractexp.tracking.TrackedRun`.
        """
        node = self.config["tracking"]
        self.measured.update(content.get("metrics", {}))
        if not node["enabled"]:
            return None
        from tractexp import tracking

        parts = {group: self.choices[group] for group in ("task", "model", "optimizer", "data")}
        parts |= {
            "variant": self.variant,
            "seed": str(self.seed),
            LABEL: self.label,
            **(tags or {}),
        }
        return tracking.TrackedRun(
            experiment=self.experiment,
            name=", ".join(filter(None, (self.label, name))),
            parameters={**tracking.flatten(self.config), **(values or {})},
            tags={key: text for key, text in parts.items() if text}
            | {"git_commit": provenance.find_commit()},
            parent=self.sweep,
            **content,
        )

    @property
    def look(self) -> str:
        """The command that shows what was logged."""
        from tractexp import tracking

        uri = tracking.choose_uri(self.config["tracking"]["uri"])
        return quoting.shell("tractexp", "ui", *(["--uri", uri] if uri else []))

    def send(self, run: "TrackedRun") -> None:
        """Log a run, and say how to look at it.

        It is kept in the folder first. Where the store cannot be used, that is a sentence: the
        results are there.
        """
        from tractexp import tracking
        from tractexp.tracking import sweepfile
        from tractexp.tracking.runfile import save

        entry = None
        try:
            entry = save(self.folder, replace(run, key=self.key), self.store)
            if not self.logs or (
                self.in_sweep and sweepfile.does_wait(sweepfile.find_sweep_folder(self.folder))
            ):
                return
            run_id = (
                self._logger.log(entry.run)
                if "_logger" in self.__dict__
                else tracking.log(entry.run, self.store)
            )
            entry.mark_logged(run_id)
        except UserError as error:
            say(f"not logged: {error}")
            named = (
                f", by {quoting.shell('--uri', uri)}"
                if (uri := self.config["tracking"]["uri"])
                else ""
            )
            later = f"; 'tractexp sync' logs them when that is mended{named}" if entry else ""
            say(f"  the results are in {self.folder}{later}")
            return
        say(f"logged in experiment '{run.experiment}'; to see it: {self.look}")
