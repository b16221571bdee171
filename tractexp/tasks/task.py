"""What a task is, and what it is given: the configuration turned into records, a model and an optimizer."""

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from tractexp import provenance
from tractexp.errors import UserError
from tractexp.plugin import Plugin, build
from tractexp.tasks.given import variant

SEARCH = ("objective", "optimizer", "budget", "time_limit", "target")  # the settings of a search
# The equations of a model, without what is known of its parameters
LOAD = ("model.motor", "model.static", "model.effects", "model.integration")
R = TypeVar("R")


def call(function: Callable[..., R], *arguments: Any, **keywords: Any) -> R:
    """A public call past the door for people, whose sentences name arguments: here they name keys."""
    return inspect.unwrap(function)(*arguments, **keywords)


class Task(Plugin):
    """Base of the tasks, chosen by `task=NAME`. A task's `run` reads as the story of what it does."""

    group: ClassVar[str] = "task"
    sourced: ClassVar[bool] = False
    resumes: ClassVar[bool] = False  # whether the same command goes on where it was stopped
    reads: ClassVar[tuple[str, ...]] = ("data", "model", *SEARCH)  # what is chosen beside these is refused
    instead: ClassVar[Mapping[str, str]] = {}  # {setting it does not read: what to do, as the refusal's last words}

    def needless(self) -> tuple[str, ...]:
        """The parts of `reads` that are not read with the settings it has."""
        return ()

    def run(self, job: "Job") -> None:
        """Do the task. Raises `UserError` before anything is logged where the input is wrong."""


@dataclass(frozen=True)
class Job:
    """One run: its configuration as plain data, and the folder it writes to."""

    config: Mapping[str, Any]
    choices: Mapping[str, str]  # what was chosen in each group: {"optimizer": "issa_no_levy", ...}
    folder: Path
    sweep: str | None = None  # run id of the sweep this job belongs to, where that is logged
    in_sweep: bool = False  # one of many: what only a person looks at may be left out
    given: Mapping[str, str] = field(
        default_factory=dict
    )  # what the user chose, {"optimizer": "pso"}: not the defaults

    @functools.cached_property
    def events(self) -> Any:
        """The recorded events, read and with their dips found (`Events` of `Event`)."""
        from tractexp.record import Events, detect

        records = build("data", self.config["data"]).read()
        return Events([detect(r) for r in records.train], [detect(r) for r in records.validate])

    @functools.cached_property
    def events_of_fit(self) -> Any:
        """The events as a fit takes them: on the base of the load in the first (`Events` of `Event`)."""
        from tractexp.record import Events, on_own_base

        train, validate = self.events.train, self.events.validate
        moved = on_own_base([*train, *validate])
        return Events(moved[: len(train)], moved[len(train) :])

    def holding_out(self, siblings: Mapping[str, list[str]]) -> "Job":
        """The job with those files held out that belong to its choice of data, where it names none itself."""
        data: Mapping[str, Any] = self.config["data"]
        if self.choices["data"] not in siblings or data.get("validate"):
            return self
        held = [path for path in siblings[self.choices["data"]] if path not in data["train"]]
        return replace(self, config={**self.config, "data": {**data, "validate": held}})

    @functools.cached_property
    def optimizer(self) -> Any:
        return build("optimizer", self.config["optimizer"])

    @property
    def chosen(self) -> Any:
        """The optimizer and what it is called (a `Choice`)."""
        from tractexp.api.arguments import Choice

        return Choice(self.choices["optimizer"], self.config["optimizer"])

    @property
    def asked(self) -> dict[str, Any]:
        """What every search is asked, as arguments of a call: records, model, objective, seed and limits."""
        same = {key: self.config[key] for key in ("model", "objective", "budget", "time_limit", "target", "seed")}
        return {"records": self.events.train, "validate": self.events.validate, **same}

    @functools.cached_property
    def problem(self) -> Any:
        """The identification problem (a `Problem`)."""
        from tractexp.api.setup import Setup

        return Setup.of(self.events.train, self.config["model"], (), self.config["objective"], {}).problem

    def identified(self, progress: Callable[[str], None]) -> Any:
        """The identification that model, objective, optimizer and limits describe (an `Identification`)."""
        from tractexp.api.identify import identify

        def told(line: str) -> None:
            self.prepare_log()  # the first line is told once the input is found right
            progress(line)

        # of many jobs nobody reads each profile; task=profile makes them
        return call(identify, **self.asked, optimizer=self.chosen, check_intervals=not self.in_sweep, progress=told)

    @property
    def seed(self) -> int:
        return int(self.config["seed"])

    @property
    def variant(self) -> str:
        """The optimizer and what else was chosen: runs of one variant differ in their seeds alone."""
        return variant(self.choices["optimizer"], self.given)

    @property
    def experiment(self) -> str:
        """The MLflow experiment: named by the configuration, or after task and data."""
        return self.config["tracking"]["experiment"] or f"{self.choices['task']} {self.choices['data']}"

    @property
    def store(self) -> str:
        """The address of the MLflow store."""
        from tractexp import tracking

        return tracking.address(self.config["tracking"]["uri"])

    @functools.cached_property
    def _logger(self) -> Any:
        from tractexp.tracking.process import logger

        return logger(self.store)

    def prepare_log(self) -> None:
        """Get MLflow ready beside the computation, in a process of its own; call it once the input is found right.

        A job of a sweep leaves it: its worker has MLflow at hand, and the cores are busy.
        """
        if self.config["tracking"]["enabled"] and not self.in_sweep:
            _ = self._logger

    def log(self, name: str, values: Mapping[str, float], **content: Any) -> None:
        """Log this job in MLflow with its configuration and tags, and say how to look at it.

        `values` are identified parameters; `content` are further fields of `tractexp.tracking.Run`.
        """
        node = self.config["tracking"]
        if not node["enabled"]:
            return
        from tractexp import tracking

        parts = {group: self.choices[group] for group in ("task", "model", "optimizer", "data")}
        parts |= {"variant": self.variant, "seed": str(self.seed)}
        run = tracking.Run(
            experiment=self.experiment,
            name=name,
            parameters={**tracking.flatten(self.config), **values},
            tags={**parts, "git_commit": provenance.commit()},
            parent=self.sweep,
            **content,
        )
        self.send(run)

    @property
    def look(self) -> str:
        """The command that shows what was logged."""
        uri = self.config["tracking"]["uri"]
        return f"tractexp ui --uri {uri}" if uri else "tractexp ui"

    def send(self, run: Any) -> None:
        """Log a run (`tracking.Run`), and say how to look at it.

        It is kept in the folder first. Where the store cannot be used, that is a sentence: the results are there.
        """
        from tractexp import tracking
        from tractexp.tasks.console import say
        from tractexp.tracking import sweepfile
        from tractexp.tracking.runfile import save

        entry = None
        try:
            entry = save(self.folder, run, self.store)
            if self.in_sweep and sweepfile.waits(self.folder.parent):
                return
            run_id = self._logger.log(entry.run) if "_logger" in self.__dict__ else tracking.log(entry.run, self.store)
            entry.logged(run_id)
        except UserError as error:
            say(f"not logged: {error}")
            later = "; 'tractexp sync' logs them when that is mended" if entry else ""
            say(f"  the results are in {self.folder}{later}")
            return
        say(f"logged in experiment '{run.experiment}'; to see it: {self.look}")
