"""Which optimizer is better: the runs of a sweep, or of any filter over MLflow, compared."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.arguments import public
from tractexp.api.job import Job
from tractexp.api.task import Task, print_paths
from tractexp.configuration.plugin import plugin
from tractexp.errors import TASK, UserError, check_choice, check_range
from tractexp.storage import files
from tractexp.studies.api.comparison import (
    ComparisonResult,
    compare_gathered_runs,
    find_page_module,
)
from tractexp.studies.api.search import Searches
from tractexp.text.progress import Progress, say

if TYPE_CHECKING:
    from tractexp.studies.comparison.comparison import Comparison

SWEEPS = Path("outputs", "sweeps")
TARGETS = (10.0, 2.0, 1.01)
APART = ("budget", "time_limit", "target")


@public
def compare(
    sweep: Path | str | Searches | None = None,
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
    progress: Progress = None,
) -> ComparisonResult:
    """Compare the variants in a sweep's folder, or what a `filter` finds, or what `tractexp.search`
    found.

    Runs on several choices of data are compared on each, and over all.

    Parameters
    ----------
    sweep : path or Searches
        None: the newest folder under outputs/sweeps.
    filter : str
        MLflow's, over its store.
    uri : str
        The store; None: that of the current folder.
    experiment : str
        None: all of them.
    data : name
        Only runs on this choice.
    targets : floats
        Those of running times, in multiples of the floor.
    ties : float
        Objectives within this share of the floor count as equal.
    floor : float [pu²]
        What the noise leaves; None: what least squares reach from the ends of the runs and from
        many starts, or the best of all runs where their records cannot be read any more.
    reference : label
        Only its pairs are tested; None: all.
    apart : names
        Limits of a search, such as "budget": runs that differ in them are compared on each.
    bbob : int
        The variants are run on so many instances of the functions of BBOB as well.
    cores : int
        Processes; None: all.
    progress : None, False or callable
        None shows how far that is, False does not; a callable is told.

    Returns
    -------
    ComparisonResult
        `answer` in one sentence, `sentences`, and `report()`.

    Raises
    ------
    UserError
        Where no runs are found, or their models differ.
    """
    check(sweep, filter, targets, ties, floor, apart, bbob)
    searches = sweep if isinstance(sweep, Searches) else None
    call = {
        "sweep": _find_folder(sweep, filter),
        "filter": filter,
        "uri": uri,
        "experiment": experiment,
        "data": data,
        "targets": list(targets),
        "ties": ties,
        "floor": floor,
        "reference": reference,
        "apart": list(apart),
        "bbob": bbob,
    }
    source, comparison = compare_gathered_runs(searches, **call, cores=cores, progress=progress)
    content = find_page_module(comparison).build_content(comparison, source)
    return ComparisonResult(call, source, content, comparison, searches)


def _find_folder(sweep: Path | str | Searches | None, filter: str | None) -> str | None:
    """The folder of the sweep that is compared; None where the runs are from elsewhere."""
    from tractexp.studies.comparison import load

    if filter is not None or isinstance(sweep, Searches):
        return None
    return str(sweep if sweep is not None else load.find_newest_sweep(SWEEPS))


def check(
    sweep: Any,
    filter: str | None,
    targets: Sequence[float],
    ties: float,
    floor: float | None,
    apart: Sequence[str] = (),
    bbob: int = 0,
) -> None:
    """Raise `UserError` for settings out of range."""
    if sweep is not None and filter is not None:
        raise UserError(
            f"{TASK.sweep} and {TASK.filter} are both given; the runs come from one or the other"
        )
    if floor is not None and not 0 < floor < float("inf"):
        raise UserError(f"{TASK.floor}={floor:g} must be an objective above 0, in pu²")
    if not targets:
        raise UserError(
            f"{TASK.targets} is empty; it lists multiples of the floor, such as [10,2,1.01]"
        )
    for target in targets:
        check_range("task.targets", target, 1.0)
    check_range("task.ties", ties, 0.0, 1.0)
    for key in apart:
        check_choice("task.apart", key, APART)
    check_range("task.bbob", bbob, 0, 1000)


@plugin
class Compare(Task, call=compare, given=("uri", "experiment")):
    """Settle which optimizer is better: tables, tests over paired seeds, charts, one page,
    sentences to quote.
    """

    reads = ()
    instead = {"data": "choose among the runs by task.data"}

    sweep: str | None = None  # folder of a sweep; null: the newest under outputs/sweeps
    filter: str | None = None  # instead: a filter over MLflow, "tags.data = 'tibet_50pct'"
    data: str | None = None  # compare the runs on this choice of data only
    # of running times, times the floor
    targets: list[float] = field(default_factory=lambda: list(TARGETS))
    ties: float = 1e-3  # objectives within this share of the floor count as equal in the tests
    # objective that the noise leaves; null: polished from the runs and many starts
    floor: float | None = None
    reference: str | None = None  # test only against this variant; null: every pair
    # limits that make comparisons of their own: [budget]
    apart: list[str] = field(default_factory=list)
    bbob: int = 0  # instances of each function of BBOB on which the variants are run as well
    cores: int | None = None  # processes for these; null: all cores

    def check(self) -> None:
        """Raise `UserError` for settings out of range."""
        check(self.sweep, self.filter, self.targets, self.ties, self.floor, self.apart, self.bbob)

    def perform(self, job: Job, **instead: Any) -> ComparisonResult:
        """Compare what the run's settings name, in the run's own store."""
        node = job.config["tracking"]
        return super().perform(
            job, uri=node["uri"], experiment=node["experiment"], progress=None, **instead
        )

    def log(self, job: Job, result: ComparisonResult, paths: list[Path]) -> None:
        """Put what was written into the sweep's folder, too, and the page on the sweep's run, where
        there is one.
        """
        if result.folder is not None and result.folder != job.folder:
            print_paths(files.copy(path, result.folder / path.name) for path in paths)
        if job.config["tracking"]["enabled"]:
            _track(job, result, paths)

    def track(self, job: Job, result: ComparisonResult, paths: list[Path]) -> None:
        """Nothing is kept of it: the page is for the run of the sweep, which is in the store."""


def _track(job: Job, result: ComparisonResult, paths: list[Path]) -> None:
    """Add the page to the sweep's run, or log a run of its own where there is no such run."""
    from tractexp import tracking
    from tractexp.tracking.run import attach
    from tractexp.tracking.sweepfile import does_wait, read_parent

    if result.folder is not None and does_wait(result.folder):
        return  # the page is sent with the run of the sweep
    parent = read_parent(result.folder) if result.folder is not None else None
    comparisons = result.comparisons
    data = _name_data(comparisons.values())
    try:
        if parent is not None and attach(parent, job.store, paths):
            say(f"logged on the run of the sweep; to see it: {job.look}")
            return
    except UserError as error:
        say(f"not logged: {error}")
        return
    run = tracking.TrackedRun(
        experiment=job.config["tracking"]["experiment"] or f"compare {data}",
        name=f"comparison of {len(next(iter(comparisons.values())).summaries)} variants",
        parameters=tracking.flatten({"task": job.config["task"]}),
        metrics=_collect_medians(comparisons),
        tags={"task": "compare", "data": data},
        artifacts=paths,
    )
    job.send(run)


def _name_data(comparisons: "Iterable[Comparison]") -> str:
    """The record that all runs are on, or how many they are on."""
    variants = [variant for one in comparisons for variant in one.gathered.variants]
    records = {run.data for variant in variants for run in variant.runs}
    return records.pop() if len(records) == 1 else f"{len(records)} records"


def _collect_medians(comparisons: "Mapping[str, Comparison]") -> dict[str, float]:
    """The median objective of each variant of which a run finished, by the names of metrics."""
    from tractexp import tracking

    return {
        tracking.name_metric(f"median {s.name} {label}".strip()): s.objective.median
        for label, comparison in comparisons.items()
        for s in comparison.summaries
        if s.runs > s.failures
    }
