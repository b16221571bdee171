"""Settle which optimizer is better, over the runs of a sweep or of any filter over MLflow."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from tractexp.api.arguments import public
from tractexp.api.pages import Drawing, Written
from tractexp.errors import UserError, check_choice, check_range
from tractexp.outcome import Table

if TYPE_CHECKING:
    from tractexp.comparison.comparison import Comparison
    from tractexp.comparison.overall import Several
    from tractexp.comparison.runs import Run

SWEEPS = Path("outputs", "sweeps")
TARGETS = (10.0, 2.0, 1.01)
APART = ("budget", "time_limit", "target")


@dataclass(frozen=True, eq=False, repr=False)
class Compared(Written):
    """A comparison. `content` is that of `comparison.json`; `call` the arguments, from which a page is made again."""

    kind = "comparison"

    call: Mapping[str, Any]
    source: str  # where the runs are from, in words
    content: Mapping[str, Any]

    @functools.cached_property
    def comparison(self) -> "Comparison | Several":
        """What stands behind the page; of a loaded result the runs are read again."""
        return _made(**self.call)[1]

    @property
    def comparisons(self) -> "Mapping[str, Comparison]":
        """The comparison on each problem, by the problem's name; that of one problem alone is called ""."""
        return getattr(self.comparison, "comparisons", {"": self.comparison})

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
        several = self.content.get("problems")
        each = several or {self.content["problem"]: self.content}
        rows = [
            [*([problem] if several else []), v["name"], v["failures"], v["objective"]["median"],
             v["objective"]["worst"], v["at_floor"], v["ert"]["simulations"][_hardest(told["targets"])]]
            for problem, told in each.items() for v in told["variants"]
        ]  # fmt: skip
        columns = ["variant", "failed", "median [pu²]", "worst [pu²]", "share at floor", "ERT [simulations]"]
        title = f"{self.source}: {', '.join(each)}"
        said = [self.answer, *self.sentences, *self.content["notes"]]
        return Table(["problem", *columns] if several else columns, rows, title, said)

    def _results(self, folder: Path) -> list[Path]:
        from tractexp import files

        return [files.write_json(folder / "comparison.json", self.content)]

    def _drawings(self) -> Mapping[str, Drawing]:
        def page(path: Path) -> Path:
            return _report(self.comparison).write_page(self.comparison, path, self.source)

        return {"comparison.html": page}

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
    apart: Sequence[str] = (),
    bbob: int = 0,
    cores: int | None = None,
    progress: Any = None,
) -> Compared:
    """Compare the variants in a sweep's folder (None: the newest under outputs/sweeps), or what a `filter` finds.

    The filter is MLflow's, over the store at `uri` (None: the current folder's) and one `experiment` (None: all).
    `data` keeps the runs on one choice of data; runs on several are compared on each, and over all. So are those that
    differ in the limits of a search named in `apart`, such as "budget". With `bbob` the variants are run on so many
    instances of the functions of BBOB as well, on `cores` processes (None: all). `targets` are those of running times,
    in multiples of the floor; objectives within the share `ties` of it count as equal; `floor` [pu²] is what the noise
    leaves (None: what least squares reach from the ends of the runs and from many starts, or the best of all runs where
    their records cannot be read any more). With a `reference` only its pairs are tested. `progress`: None shows how far
    that is, False does not; a callable is told. Raises `UserError` where no runs are found, or their models differ.
    """
    check(sweep, filter, targets, ties, floor, apart, bbob)
    if filter is None:
        from tractexp.comparison import load

        sweep = str(sweep if sweep is not None else load.newest_sweep(SWEEPS))
    call = {
        "sweep": sweep, "filter": filter, "uri": uri, "experiment": experiment, "data": data,
        "targets": list(targets), "ties": ties, "floor": floor, "reference": reference, "apart": list(apart),
        "bbob": bbob,
    }  # fmt: skip
    source, comparison = _made(**call, cores=cores, progress=progress)
    made = Compared(call, source, _report(comparison).content(comparison, source))
    vars(made)["comparison"] = comparison
    return made


def check(
    sweep: Any, filter: str | None, targets: Sequence[float], ties: float, floor: float | None,
    apart: Sequence[str] = (), bbob: int = 0,
) -> None:  # fmt: skip
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
    for key in apart:
        check_choice("task.apart", key, APART)
    check_range("task.bbob", bbob, 0, 1000)


def _report(comparison: "Comparison | Several") -> Any:
    """The module that tells of one problem, or of several."""
    from tractexp.comparison.overall import Several
    from tractexp.report import comparison as one
    from tractexp.report import overall

    return overall if isinstance(comparison, Several) else one


def _hardest(targets: Sequence[float]) -> int:
    return targets.index(min(targets))


def _made(
    *, sweep: str | None, filter: str | None, uri: str | None, experiment: str | None, data: str | None,
    apart: Sequence[str] = (), bbob: int = 0, cores: int | None = None, progress: Any = False, **judging: Any,
) -> "tuple[str, Comparison | Several]":  # fmt: skip
    """Where the runs are from, and their comparison: of several problems each by itself and all together."""
    from tractexp.api.judging import judged, several
    from tractexp.comparison import runs as gathering

    runs, source = _runs(sweep, filter, uri, experiment)
    if data is not None:
        runs = gathering.on(runs, source, data)
    groups = gathering.parted(runs, apart)
    if len(groups) == 1 and not bbob:
        return source, judged(gathering.gather(runs, source), progress, judging)
    if judging["floor"] is not None and len(groups) > 1:
        raise UserError(
            f"task.floor={judging['floor']:g} is the floor of one problem, and {source} has {len(groups)}; leave it"
            " out, or choose one by task.data"
        )
    return source, several(groups, source, judging, Path(sweep) if sweep else None, bbob, cores, progress)


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
