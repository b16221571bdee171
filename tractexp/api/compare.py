"""Settle which optimizer is better, over the runs of a sweep or of any filter over MLflow."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from tractexp.api.arguments import public
from tractexp.api.pages import Written
from tractexp.errors import UserError, check_range
from tractexp.outcome import Table

if TYPE_CHECKING:
    from tractexp.comparison.comparison import Comparison
    from tractexp.comparison.runs import Run

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
        return Table(columns, rows, title, [*self.sentences, *self.content["notes"]])

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
) -> Compared:
    """Compare the variants in a sweep's folder (None: the newest under outputs/sweeps), or what a `filter` finds.

    The filter is MLflow's, over the store at `uri` (None: the current folder's) and one `experiment` (None: all).
    `data` keeps the runs on one choice of data. `targets` are those of running times, in multiples of the floor;
    objectives within the share `ties` of it count as equal; `floor` [pu²] is what the noise leaves (None: the best of
    all runs). With a `reference` only its pairs are tested. Raises `UserError` where no runs are found, or they are of
    different problems.
    """
    check(sweep, filter, targets, ties, floor)
    if filter is None:
        from tractexp.comparison import load

        sweep = str(sweep if sweep is not None else load.newest_sweep(SWEEPS))
    call = {
        "sweep": sweep, "filter": filter, "uri": uri, "experiment": experiment, "data": data,
        "targets": list(targets), "ties": ties, "floor": floor, "reference": reference,
    }  # fmt: skip
    source, comparison = _made(**call)
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
    reference: str | None, **judging: Any,
) -> "tuple[str, Comparison]":  # fmt: skip
    from tractexp.comparison.comparison import compare
    from tractexp.comparison.runs import gather

    runs, source = _runs(sweep, filter, uri, experiment)
    return source, compare(gather(runs, source, data), reference=reference, plain=_plain(), **judging)


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
