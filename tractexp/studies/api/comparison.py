"""What a comparison of optimizers says: the answer, its table and its page, and the runs behind
it.
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from tractexp.blocks import Report, Table
from tractexp.configuration.overrides import format_assignment
from tractexp.configuration.run_command import list_arguments
from tractexp.errors import TASK, UserError
from tractexp.outcome import Written
from tractexp.studies.api.search import Searches
from tractexp.text import quoting

if TYPE_CHECKING:
    from tractexp.studies.comparison.comparison import Comparison
    from tractexp.studies.comparison.overall import Several
    from tractexp.studies.comparison.runs import SearchRun

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
        return self.computed or compare_gathered_runs(self.searches, **self.call)[1]

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
        return find_page_module(self.comparison).report(self.comparison, self.source)

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


def find_page_module(comparison: "Comparison | Several") -> Any:
    """The module that writes the page: of one problem, or of several."""
    from tractexp.studies.comparison import overall_page, page
    from tractexp.studies.comparison.overall import Several

    return overall_page if isinstance(comparison, Several) else page


def _find_hardest(targets: Sequence[float]) -> int:
    """The place of the lowest target."""
    return targets.index(min(targets))


def compare_gathered_runs(
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
    runs, source = _gather_runs(searches, sweep, filter, uri, experiment)
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


def _gather_runs(
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
    return load.read_logged(find(tracking.resolve_address(uri), filter, experiment), source), source
