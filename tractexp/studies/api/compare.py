"""Which optimizer is better: the runs of a sweep, or of any filter over MLflow, compared."""

import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from tractexp.api.arguments import public
from tractexp.api.job import Job
from tractexp.api.task import Task, print_paths
from tractexp.blocks import Report, Table
from tractexp.configuration.overrides import format_assignment
from tractexp.configuration.plugin import plugin
from tractexp.configuration.run_command import list_arguments
from tractexp.errors import TASK, UserError, check_choice, check_range
from tractexp.outcome import Written
from tractexp.storage import files
from tractexp.studies.api.search import Searches
from tractexp.text import quoting
from tractexp.text.progress import Progress, say

if TYPE_CHECKING:
    from tractexp.studies.comparison.comparison import Comparison
    from tractexp.studies.comparison.overall import Several
    from tractexp.studies.comparison.runs import SearchRun

SWEEPS = Path("outputs", "sweeps")
TARGETS = (10.0, 2.0, 1.01)
APART = ("budget", "time_limit", "target")
ENOUGH_SEEDS = 30  # of a sweep that is to settle something
UNSETTLED = "Not settled"  # begins such an answer
MOST_SCREEN_SENTENCES = 4  # of one screen
MOST_TERMINAL_SENTENCES = 8  # sentences on the terminal; the page has all


@dataclass(frozen=True, eq=False, repr=False)
class ComparisonResult(Written):
    """A comparison. `content` is that of `comparison.json`; from `call`, the arguments, a loaded
    result is drawn.
    """

    kind = "comparison"
    page = "comparison.html"

    call: Mapping[str, Any]
    source: str  # where the runs are from, in words
    content: Mapping[str, Any]
    computed: "Comparison | Several | None" = None  # None in a loaded result
    searches: Searches | None = None  # what was compared, where that was made by a call

    @functools.cached_property
    def comparison(self) -> "Comparison | Several":
        """The comparison behind the page. A loaded result reads the runs again."""
        return self.computed or _compare_gathered_runs(self.searches, **self.call)[1]

    @property
    def comparisons(self) -> "Mapping[str, Comparison]":
        """The comparison on each problem, by the problem's name; that of one problem alone is
        called "".
        """
        return getattr(self.comparison, "comparisons", {"": self.comparison})

    @property
    def folder(self) -> Path | None:
        """The sweep's folder; None where the runs are from elsewhere."""
        return None if self.call["sweep"] is None else Path(self.call["sweep"])

    @property
    def answer(self) -> str:
        """Which variant to take, as far as these runs say."""
        return self.content["answer"]

    @property
    def sentences(self) -> list[str]:
        """Sentences to quote."""
        return self.content["sentences"]

    def table(self) -> Table:
        """A row for each variant on each problem."""
        several = self.content.get("problems")
        each = several or {self.content["problem"]: self.content}
        rows = [
            [
                *([problem] if several else []),
                v["name"],
                v["failures"],
                v["objective"]["median"],
                v["objective"]["worst"],
                v["at_floor"],
                v["ert"]["simulations"][_find_hardest(content["targets"])],
            ]
            for problem, content in each.items()
            for v in content["variants"]
        ]
        columns = [
            "variant",
            "failed",
            "median [pu²]",
            "worst [pu²]",
            "share at floor",
            "ERT [simulations]",
        ]
        return Table(
            ["problem", *columns] if several else columns, rows, f"{self.source}: {', '.join(each)}"
        )

    def summary(self) -> Report:
        """The answer, the table, and what was tested."""
        report = Report()
        several = "problems" in self.content
        if several:
            report.text(f"{self.source}: {', '.join(self.content['problems'])}").add(
                *self._over_all()
            )
        else:
            report.add(self.table())
            target = min(self.content["targets"])
            terms = (
                "objectives in pu² at the end of the search; at floor: within 1 %; ERT: simulations"
                " to"
            )
            report.text(f"{terms} {target:g} x floor", self.answer)
        shown = self.sentences if several else self.sentences[:MOST_TERMINAL_SENTENCES]
        report.text(*(f"- {sentence}" for sentence in [*shown, *self.content["notes"]]))
        if (more := len(self.sentences) - len(shown)) > 0:
            report.text(f"- and {more} more sentences in {self.page}")
        return report

    def screen(self) -> Report:
        """The answer, the table, and what may be quoted first."""
        if "problems" in self.content:
            return self.summary()
        page = Report().text(self.answer, "").add(self.table())
        told = [*self.sentences[:MOST_SCREEN_SENTENCES], *self.content["notes"]]
        return page.text(*(f"- {sentence}" for sentence in told))

    def _over_all(self) -> Iterator[Table]:
        """A table for each of the terms over several problems, the best variants first."""
        for overall in getattr(self.comparison, "overall", ()):
            best = list(overall.figures.items())[:MOST_TERMINAL_SENTENCES]
            cells = [
                [name, *(f"{x:.0%}" if overall.share else f"{x:.3g}" for x in values)]
                for name, values in best
            ]
            yield Table(
                ["variant", *overall.columns],
                cells,
                f"{overall.terms}, {overall.where}: {overall.measure}",
            )

    @property
    def next_step(self) -> str:
        """The command that runs more seeds in the folder of the sweep that ends here, where nothing
        is settled; elsewhere the answer is the end.
        """
        given = list_arguments()
        swept = {"-m", "--multirun"} & {*given} and self.folder is not None
        if not swept or not self.answer.startswith(UNSETTLED):
            return ""
        kept = [each for each in given if not each.startswith(("seed=", "hydra.sweep.dir="))]
        place = format_assignment("hydra.sweep.dir", str(self.folder))
        command = quoting.shell("tractexp", *kept, f"seed=range(0,{ENOUGH_SEEDS})", place)
        return f"run more seeds: {command}"

    def report(self) -> Report:
        """The page of the comparison."""
        return _report(self.comparison).report(self.comparison, self.source)

    def to_dict(self) -> dict[str, Any]:
        """Call, content and searches as plain data."""
        made = {} if self.searches is None else {"searches": self.searches.to_dict()}
        return {"call": dict(self.call), **self.content, **made}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The comparison that `to_dict` gave."""
        beside = ("call", "kind", "tractexp", "searches")
        own = {key: value for key, value in content.items() if key not in beside}
        made = content.get("searches")
        searches = None if made is None else Searches.from_dict(made)
        return cls(content["call"], content["source"], own, searches=searches)


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
    source, comparison = _compare_gathered_runs(searches, **call, cores=cores, progress=progress)
    content = _report(comparison).content(comparison, source)
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


def _report(comparison: "Comparison | Several") -> Any:
    """The module that writes the page: of one problem, or of several."""
    from tractexp.studies.comparison import overall_page, page
    from tractexp.studies.comparison.overall import Several

    return overall_page if isinstance(comparison, Several) else page


def _find_hardest(targets: Sequence[float]) -> int:
    """The place of the lowest target."""
    return targets.index(min(targets))


def _compare_gathered_runs(
    searches: Searches | None,
    *,
    sweep: str | None,
    filter: str | None,
    uri: str | None,
    experiment: str | None,
    data: str | None,
    apart: Sequence[str] = (),
    bbob: int = 0,
    cores: int | None = None,
    progress: Any = False,
    **judging: Any,
) -> "tuple[str, Comparison | Several]":
    """Where the runs are from, and their comparison: of several problems each by itself and all
    together.
    """
    from tractexp.studies.comparison import runs as gathering
    from tractexp.studies.comparison.judging import compare_runs, judge_problems

    problem = searches and searches.setup.problem
    runs, source = _runs(searches, sweep, filter, uri, experiment)
    if data is not None:
        runs = gathering.select_runs_on(runs, source, data)
    groups = gathering.part_runs(runs, apart)
    if len(groups) == 1 and not bbob:
        return source, compare_runs(gathering.gather(runs, source), progress, judging, problem)
    if judging["floor"] is not None and len(groups) > 1:
        raise UserError(
            f"{TASK.floor}={judging['floor']:g} is the floor of one problem, and {source} has"
            f" {len(groups)}; leave it out, or choose one by {TASK.data}"
        )
    return source, judge_problems(
        groups, source, judging, Path(sweep) if sweep else None, bbob, cores, progress, problem
    )


def _runs(
    searches: Searches | None,
    sweep: str | None,
    filter: str | None,
    uri: str | None,
    experiment: str | None,
) -> "tuple[list[SearchRun], str]":
    """The runs, and where they are from in words."""
    from tractexp.studies.comparison import load

    if searches is not None:
        return list(searches.runs), searches.source
    if filter is None:
        assert sweep is not None
        return load.read_sweep(Path(sweep)), f"the sweep {Path(sweep)}"
    from tractexp import tracking
    from tractexp.tracking.find import find

    source = f"the filter {filter}"
    return load.read_logged(find(tracking.address(uri), filter, experiment), source), source


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
    from tractexp.tracking.sweepfile import parent_of, waits

    if result.folder is not None and waits(result.folder):
        return  # the page is sent with the run of the sweep
    parent = parent_of(result.folder) if result.folder is not None else None
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
        tracking.metric_name(f"median {s.name} {label}".strip()): s.objective.median
        for label, comparison in comparisons.items()
        for s in comparison.summaries
        if s.runs > s.failures
    }
