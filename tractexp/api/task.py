"""Tasks: public calls by their commands, whose arguments the configuration gives."""

import dataclasses
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar, Union, get_args, get_origin

from tractexp.api.job import Job
from tractexp.blocks.terminal import show
from tractexp.configuration.plugin import Plugin
from tractexp.outcome import Written
from tractexp.text.progress import build_console, find_text_width, say
from tractexp.text.wording import shorten_path

if TYPE_CHECKING:
    from tractexp.tracking import TrackedRun

SEARCH = ("objective", "optimizer", "budget", "time_limit", "target")  # the settings of a search
# The equations of a model, without what is known of its parameters but that they may be held to
# what machines are
LOAD = (
    "model.motor",
    "model.static",
    "model.effects",
    "model.shown_effects",
    "model.integration",
    "model.domain",
    "model.priors",
    "model.physical",
    "model.candidates",
    "model.window",
)
# Arguments that the model's configuration holds
OF_MODEL = ("bounds", "fixed", "per_event", "substeps", "domain", "priors", "physical")
OMITTED: Any = object()  # of an argument: its default stands
R = TypeVar("R")


def call(function: Callable[..., R], *arguments: Any, **keywords: Any) -> R:
    """A public call past the door for people, whose sentences name arguments: here
    they name keys.
    """
    return inspect.unwrap(function)(*arguments, **keywords)


class Source(NamedTuple):
    """Where a call's argument comes from on the command line: the parts of the configuration, and
    its value.
    """

    reads: tuple[str, ...]
    value: Callable[["Job"], Any]


SOURCES = {
    "records": Source(("data",), lambda job: job.events.train),
    "validate": Source(("data",), lambda job: job.events.validate),
    "model": Source(LOAD, lambda job: job.config["model"]),
    "optimizer": Source(("optimizer",), lambda job: job.chosen),
    "seed": Source((), lambda job: job.seed),
    "fit": Source(("data", "model", *SEARCH), lambda job: job.identify_load()),
    # of many jobs nobody reads each profile
    "check_intervals": Source((), lambda job: not job.of_many),
    "progress": Source((), lambda job: job.tell),
} | {
    key: Source((key,), lambda job, key=key: job.config[key])
    for key in ("objective", "budget", "time_limit", "target")
}


class Task(Plugin):
    """Base of the tasks, chosen by `task=NAME`. A task is a public call by its command.

    Its settings are the arguments of `call` that the configuration does not hold elsewhere, with
    their defaults, and what it declares itself; what it `reads` follows from the others.
    """

    group: ClassVar[str] = "task"
    sourced: ClassVar[bool] = False
    resumes: ClassVar[bool] = False  # whether the same command goes on where it was stopped
    # what is chosen beside these is refused
    reads: ClassVar[tuple[str, ...]] = ("data", "model", *SEARCH)
    # choices that a command may come with, of `look` for one, and that are left alone
    leaves_alone: ClassVar[tuple[str, ...]] = ()
    # {setting it does not read: what to do, as the refusal's last words}
    instead: ClassVar[Mapping[str, str]] = {}
    function: ClassVar[Callable[..., Any] | None] = None

    def __init_subclass__(
        cls, call: Callable[..., Any] | None = None, given: Sequence[str] = (), **settings: Any
    ) -> None:
        """`given` are arguments that the task itself gives to its call."""
        super().__init_subclass__(**settings)
        if call is None:
            return
        cls.function = staticmethod(call)
        arguments = inspect.signature(call).parameters
        sources = [name for name in arguments if name in SOURCES and name not in given]
        of_model = [
            f"model.{name}" for name in OF_MODEL if name in arguments and "model" in arguments
        ]
        if "reads" not in vars(cls):
            cls.reads = tuple(
                dict.fromkeys(
                    [*(part for name in sources for part in SOURCES[name].reads), *of_model]
                )
            )
        own, cls.__annotations__ = vars(cls).get("__annotations__", {}), {}
        for parameter in arguments.values():
            if parameter.name not in (*SOURCES, *OF_MODEL, *given, *own):
                cls.__annotations__[parameter.name], default = find_setting(parameter)
                setattr(cls, parameter.name, default)
        cls.__annotations__ |= own

    def needless(self) -> tuple[str, ...]:
        """The parts of `reads` that are not read with the settings it has."""
        return ()

    @classmethod
    def takes_records(cls) -> bool:
        """Whether the call takes records of `data`."""
        arguments = inspect.signature(cls.function).parameters if cls.function else {}
        return any("data" in SOURCES[name].reads for name in arguments if name in SOURCES)

    def perform(self, job: "Job", **instead: Any) -> Any:
        """Call with the job's configuration and the task's settings; `instead`
        replaces arguments.
        """
        assert self.function is not None
        arguments = dict.fromkeys(inspect.signature(self.function).parameters, OMITTED)
        for name in arguments:
            if name in instead:
                arguments[name] = instead[name]
            elif name in SOURCES:
                arguments[name] = SOURCES[name].value(job)
            elif hasattr(self, name):
                arguments[name] = getattr(self, name)
        return call(
            self.function,
            **{name: value for name, value in arguments.items() if value is not OMITTED},
        )

    def draws(self, job: "Job") -> bool:
        """Whether pages and figures are made."""
        return True

    def draw(self, job: "Job", result: Written) -> list[Path]:
        """Write pages and figures, where this run makes any; their paths."""
        return result.write_drawings(job.folder) if self.draws(job) else []

    def run(self, job: "Job") -> None:
        """Do the task. Raises `UserError` before anything is logged where the input is wrong."""
        self.conclude(job, self.perform(job))

    def conclude(self, job: "Job", result: Written) -> None:
        """Write a result, show it, draw it, log it."""
        paths = job.write(result.write_results, lambda paths: self.track(job, result, paths))
        print_result(job, result)
        paths += self.draw(job, result)
        print_written(paths, result.page)
        self.log(job, result, paths)

    def log(self, job: "Job", result: Any, paths: list[Path]) -> None:
        """Log what was found, and send it."""
        if (run := self.track(job, result, paths)) is not None:
            job.send(run)

    def track(self, job: "Job", result: Any, paths: list[Path]) -> "TrackedRun | None":
        """The run as it is logged, with files of its folder; None where none is."""
        content = {"name": self.name, "artifacts": [*paths, job.folder / ".hydra"]}
        return job.track(**content | self.collect_log(job, result))

    def collect_log(self, job: "Job", result: Any) -> dict[str, Any]:
        """The fields of `tractexp.tracking.TrackedRun` that a result logs, and `values` that were
        given.
        """
        return {}


def find_setting(parameter: inspect.Parameter) -> tuple[Any, Any]:
    """Type and default of the setting that stands for an argument: of mappings and lists, plain and
    empty ones.
    """
    kind, default = parameter.annotation, parameter.default
    kind = Any if isinstance(kind, str) else kind  # in quotes: what type checkers alone are told
    kinds = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    for one in kinds:
        origin, inner = get_origin(one), get_args(one)
        if origin is not None and issubclass(origin, Mapping):
            return dict[inner[0], _name_list_kind(inner[1])], field(default_factory=dict)
        if origin is not None and issubclass(origin, Sequence) and str not in kinds:
            return list[inner[0]], field(default_factory=list)
    if isinstance(default, tuple):
        return Any, field(default_factory=list)
    return kind, dataclasses.MISSING if default is parameter.empty else default


def _name_list_kind(kind: Any) -> Any:
    """A list for a sequence, as the configuration's schema knows it."""
    return list[get_args(kind)[0]] if get_origin(kind) is not None else kind


def print_result(job: "Job", result: Written) -> None:
    """Print one screen, or everything (see `Job.tells_everything`), and what leads on."""
    report = result.summary() if job.tells_everything else result.screen()
    if step := result.next_step:
        report.text(f"next: {step}")
    show(report, build_console(), find_text_width())


def print_written(paths: Iterable[Path], page: str) -> None:
    """Print where the page is, and the names of what is beside it; without a page each path."""
    by_name = {path.name: path for path in paths}
    if page not in by_name:
        print_paths(by_name.values())
        return
    first = by_name.pop(page)
    say(f"page: {shorten_path(first)}")
    beside = sorted(str(path.relative_to(first.parent)) for path in by_name.values())
    if beside:
        say(f"beside it: {', '.join(beside)}")


def print_paths(paths: Iterable[Path]) -> None:
    """Print what was written."""
    for path in paths:
        say(f"  {path}")
