"""Settle which optimizer is better, over the runs of a sweep or of any filter over MLflow."""

import contextlib
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from tractexp.api.arguments import public
from tractexp.api.pages import Written
from tractexp.errors import UserError, check_range
from tractexp.outcome import Table
from tractexp.progress import counting

if TYPE_CHECKING:
    from tractexp.comparison.comparison import Comparison
    from tractexp.comparison.floor import Polished
    from tractexp.comparison.runs import Gathered, Run
    from tractexp.identification.problem import Problem

SWEEPS = Path("outputs", "sweeps")
TARGETS = (10.0, 2.0, 1.01)


@dataclass(frozen=True, eq=False, repr=False)
class Compared(Written):
    """A comparison. `content` is that of `comparison.json`; `call` the arguments, from which a page is made again."""

    kind = "comparison"

    call: Mapping[str, Any]
    source: str  # where the runs are from, in words
    content: Mapping[str, Any]

    @functools.cached_property
    def comparison(self) -> "Comparison":
        """What stands behind the page; of a loaded result the runs are read again."""
        return _made(**self.call)[1]

    @property
    def folder(self) -> Path | None:
        """The sweep's folder; None where the runs are from MLflow."""
        return Path(self.call["sweep"]) if self.call["filter"] is None else None

    @property
    def answer(self) -> str:
        """Which variant to take, as far as these runs say."""
        return self.content["answer"]

    @property
    def sentences(self) -> list[str]:
        """What may be quoted."""
        return self.content["sentences"]

    def table(self) -> Table:
        targets = self.content["targets"]
        hardest = targets.index(min(targets))
        rows = [
            [v["name"], v["failures"], v["objective"]["median"], v["objective"]["worst"], v["at_floor"],
             v["ert"]["simulations"][hardest]]
            for v in self.content["variants"]
        ]  # fmt: skip
        columns = ["variant", "failed", "median [pu²]", "worst [pu²]", "share at floor", "ERT [simulations]"]
        title = f"{self.source}: {self.content['problem']}"
        return Table(columns, rows, title, [self.answer, *self.sentences, *self.content["notes"]])

    def _write(self, folder: Path) -> list[Path]:
        """comparison.html and comparison.json."""
        from tractexp.report.comparison import write_json, write_page

        page = write_page(self.comparison, folder / "comparison.html", self.source)
        return [page, write_json(self.comparison, folder / "comparison.json", self.source)]

    def to_dict(self) -> dict[str, Any]:
        return {"call": dict(self.call), **self.content}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        found = {key: value for key, value in content.items() if key not in ("call", "kind", "tractexp")}
        return cls(content["call"], content["source"], found)


@public
def compare(
    sweep: Path | str | None = None,
    *,
    filter: str | None = None,
    uri: str | None = None,
    experiment: str | None = None,
    data: str | None = None,
    targets: Sequence[float] = TARGETS,
    ties: float = 1e-3,
    floor: float | None = None,
    reference: str | None = None,
    progress: Any = None,
) -> Compared:
    """Compare the variants in a sweep's folder (None: the newest under outputs/sweeps), or what a `filter` finds.

    The filter is MLflow's, over the store at `uri` (None: the current folder's) and one `experiment` (None: all).
    `data` keeps the runs on one choice of data. `targets` are those of running times, in multiples of the floor;
    objectives within the share `ties` of it count as equal; `floor` [pu²] is what the noise leaves (None: what least
    squares reach from the ends of the runs and from many starts, or the best of all runs where their records cannot be
    read any more). With a `reference` only its pairs are tested. `progress`: None shows how far that is, False does
    not; a callable is told. Raises `UserError` where no runs are found, or they are of different problems.
    """
    check(sweep, filter, targets, ties, floor)
    if filter is None:
        from tractexp.comparison import load

        sweep = str(sweep if sweep is not None else load.newest_sweep(SWEEPS))
    call = {
        "sweep": sweep, "filter": filter, "uri": uri, "experiment": experiment, "data": data,
        "targets": list(targets), "ties": ties, "floor": floor, "reference": reference,
    }  # fmt: skip
    source, comparison = _made(**call, progress=progress)
    from tractexp.report.comparison import content

    made = Compared(call, source, content(comparison, source))
    vars(made)["comparison"] = comparison
    return made


def check(sweep: Any, filter: str | None, targets: Sequence[float], ties: float, floor: float | None) -> None:
    """Raise `UserError` for settings out of range."""
    if sweep is not None and filter is not None:
        raise UserError("task.sweep and task.filter are both given; the runs come from one or the other")
    if floor is not None and not 0 < floor < float("inf"):
        raise UserError(f"task.floor={floor:g} must be an objective above 0, in pu²")
    if not targets:
        raise UserError("task.targets is empty; it lists multiples of the floor, such as [10,2,1.01]")
    for target in targets:
        check_range("task.targets", target, 1.0)
    check_range("task.ties", ties, 0.0, 1.0)


def _made(
    *, sweep: str | None, filter: str | None, uri: str | None, experiment: str | None, data: str | None,
    reference: str | None, progress: Any = False, **judging: Any,
) -> "tuple[str, Comparison]":  # fmt: skip
    from tractexp.comparison.comparison import compare
    from tractexp.comparison.runs import gather

    runs, source = _runs(sweep, filter, uri, experiment)
    gathered = gather(runs, source, data)
    polished, why_not = _polished(gathered, progress)
    known = {"polished": polished, "why_not": why_not}
    return source, compare(gathered, reference=reference, plain=_plain(), **known, **judging)


def _polished(gathered: "Gathered", progress: Any) -> "tuple[Polished | None, str]":
    """What polishing found on the problem that the runs' configuration describes; None, and why, where it cannot."""
    from tractexp.comparison.floor import polish

    runs = [run for variant in gathered.variants for run in variant.runs]
    try:
        problem = _problem(next(run for run in runs if run.finished))
    except UserError as error:
        return None, f"the problem cannot be put again ({str(error).rstrip('.')})"
    except (KeyError, TypeError, ValueError) as error:
        return None, f"the configuration of the runs is not understood any more ({type(error).__name__}: {error})"
    with contextlib.ExitStack() as stack:
        found = polish(problem, runs, lambda n: stack.enter_context(counting("groups of descents", n, progress)))
    return found, "" if found else "the records or the model have changed since: these parameters fit otherwise now"


def _problem(run: "Run") -> "Problem":
    """The problem that a run's configuration describes. Raises `UserError` where its records are not there any more."""
    from tractexp.api.setup import Setup
    from tractexp.comparison.load import nested
    from tractexp.plugin import build
    from tractexp.record import detect

    config = nested(run.config)
    home = Path(run.folder) if run.folder else Path()  # relative paths count from where the run was started
    with contextlib.chdir(home) if home.is_dir() else contextlib.nullcontext():
        records = build("data", config["data"]).read()
    train = [detect(record) for record in records.train]
    return Setup.of(train, config["model"], (), config.get("objective"), {}).problem


def _runs(
    sweep: str | None, filter: str | None, uri: str | None, experiment: str | None
) -> "tuple[list[Run], str]":  # fmt: skip
    """The runs, and where they are from in words."""
    from tractexp.comparison import load

    if filter is None:
        assert sweep is not None
        return load.from_sweep(Path(sweep)), f"the sweep {Path(sweep)}"
    from tractexp import tracking
    from tractexp.tracking.find import find

    source = f"the filter {filter}"
    return load.from_logged(find(tracking.address(uri), filter, experiment), source), source


def _plain() -> dict[str, str]:
    """For each optimizer the one that it is with all its switches off, "" where there is none."""
    from tractexp.plugin import discover, get

    return {name: get("optimizer", name).plain for name in discover()["optimizer"]}
