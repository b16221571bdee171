"""What a task is, and what it is given: the configuration turned into records, a model and an optimizer."""

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from tractexp.plugin import Plugin, build

SEARCH = ("objective", "optimizer", "budget", "time_limit", "target")  # the settings of a search
LOAD = ("model.motor", "model.static", "model.effects")  # the parts of a model, without what is known of its parameters
R = TypeVar("R")


def call(function: Callable[..., R], *arguments: Any, **keywords: Any) -> R:
    """A public call past the door for people, whose sentences name arguments: here they name keys."""
    return inspect.unwrap(function)(*arguments, **keywords)


class Task(Plugin):
    """Base of the tasks, chosen by `task=NAME`. A task's `run` reads as the story of what it does."""

    group: ClassVar[str] = "task"
    sourced: ClassVar[bool] = False
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

    def events(self) -> Any:
        """The recorded events, read and with their dips found (`Events` of `Event`)."""
        from tractexp.record import Events, detect

        records = build("data", self.config["data"]).read()
        return Events([detect(r) for r in records.train], [detect(r) for r in records.validate])

    @functools.cached_property
    def optimizer(self) -> Any:
        return build("optimizer", self.config["optimizer"])

    @functools.cached_property
    def model(self) -> Any:
        from tractexp.identification.result import parts
        from tractexp.model.model import compose

        return compose(*parts(self.config["model"]))

    def problem(self, events: Any) -> Any:
        """The identification problem of these events (a `Problem`)."""
        from tractexp.identification.problem import Problem

        node, loss = self.config["model"], build("objective", self.config["objective"])
        return Problem(
            self.model, events, node["bounds"], node["fixed"], node["substeps"], node["per_event"], loss=loss
        )

    def identified(self, progress: Callable[[str], None]) -> Any:
        """The identification that model, objective, optimizer and limits describe (an `Identification`)."""
        from tractexp.api.arguments import Choice
        from tractexp.api.identify import identify

        def told(line: str) -> None:
            self.prepare_log()  # the first line is told once the input is found right
            progress(line)

        config, events = self.config, self.events()
        return call(
            identify,
            events.train,
            config["model"],
            validate=events.validate,
            objective=config["objective"],
            optimizer=Choice(self.choices["optimizer"], config["optimizer"]),
            **{key: config[key] for key in ("budget", "time_limit", "target", "seed")},
            check_intervals=not self.in_sweep,  # of many jobs nobody reads each profile; task=profile makes them
            progress=told,
        )

    @property
    def seed(self) -> int:
        return int(self.config["seed"])

    @property
    def experiment(self) -> str:
        """The MLflow experiment: named by the configuration, or after task and data."""
        return self.config["tracking"]["experiment"] or f"{self.choices['task']} {self.choices['data']}"

    @property
    def _store(self) -> str:
        from tractexp import tracking

        return tracking.address(self.config["tracking"]["uri"])

    @functools.cached_property
    def _logger(self) -> Any:
        from tractexp.tracking.process import Logger

        return Logger(self._store)

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
        from tractexp.tasks.console import say

        parts = {group: self.choices[group] for group in ("task", "model", "optimizer", "data")}
        run = tracking.Run(
            experiment=self.experiment,
            name=name,
            parameters={**tracking.flatten(self.config), **values},
            tags={**parts, "seed": str(self.seed), "git_commit": tracking.git_commit()},
            parent=self.sweep,
            **content,
        )
        if "_logger" in self.__dict__:
            self._logger.log(run)
        else:
            tracking.log(run, self._store)
        chosen = f" --uri {node['uri']}" if node["uri"] else ""
        say(f"logged in experiment '{self.experiment}'; to see it: tractexp ui{chosen}")
