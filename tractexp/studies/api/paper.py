"""The paper's tables and figures, measured again: one page, one verdict for each claim."""

import functools
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from tractexp.api.arguments import public
from tractexp.api.job import Job
from tractexp.api.setup import Setup, describe_records
from tractexp.api.task import Task, print_paths
from tractexp.blocks import Report, Table
from tractexp.configuration.plugin import plugin
from tractexp.errors import check_choice, check_range
from tractexp.outcome import Drawing, Written
from tractexp.storage import files
from tractexp.text.progress import NEXT_LINES, Pace, Progress, say, tell_stages

if TYPE_CHECKING:
    from tractexp.api.given import Chosen, ModelGiven, Records
    from tractexp.studies.paper.study import Study
    from tractexp.studies.paper.verdict import Claim
    from tractexp.tracking import TrackedRun

PARTS = (
    "table1",
    "table2",
    "table3",
    "table4",
    "table5",
    "figure3",
    "figure4",
    "figure6",
    "figure8",
    "figure9",
    "figure10",
    "figure11",
    "equations",
    "readings",
)
# what needs which dip
HELD_OUT = {"interpolation": {"table4", "figure10"}, "extrapolation": {"table5", "figure11"}}
SEEDS = 30


@dataclass(frozen=True, eq=False, repr=False)
class PaperResult(Written):
    """The paper's claims with their verdicts. A loaded result measures its page again, from the
    records it holds.
    """

    kind = "paper"
    page = "paper.html"

    setup: Setup
    settings: Mapping[str, Any]  # seeds, workers
    parts: Sequence[str]
    claims: "Sequence[Claim]"
    measured: "Study | None" = None  # None in a loaded result
    seconds: float = 0.0  # that it took

    @functools.cached_property
    def study(self) -> "Study":
        """The study behind the page; each part is measured at its first use."""
        return self.measured or _build_study(self.setup, **self.settings)

    @property
    def counts(self) -> Counter[str]:
        """How many claims got which verdict."""
        return Counter(claim.word for claim in self.claims)

    def table(self) -> Table:
        """Every claim with its verdict and what was measured."""
        from tractexp.studies.paper.claims import count_verdicts

        rows = [[claim.part, claim.text, claim.verdict, claim.measured] for claim in self.claims]
        return Table(
            ["where", "the paper's claim", "verdict", "measured"],
            rows,
            count_verdicts(self.claims),
            words=(1, 2, 3),
        )

    def summary(self) -> Report:
        """The claims, and how long that took."""
        page = Report().add(self.table())
        return page.text(f"in {self.seconds:.0f} s") if self.seconds else page

    def report(self) -> Report:
        """The page: each table and figure, measured again."""
        return self._report

    @functools.cached_property
    def _report(self) -> Report:
        """The page, made once."""
        from tractexp.studies.paper.page import report

        return report(self.study, self.parts, self.claims)

    def write_results(self, folder: Path) -> list[Path]:
        """paper.json: the claims and what was measured."""
        content = {
            key: value for key, value in self.to_dict().items() if key not in ("setup", "seconds")
        }
        return [files.write_json(folder / "paper.json", content)]

    def drawings(self) -> Mapping[str, Drawing]:
        """The page, and the same as Markdown."""
        return {
            **super().drawings(),
            "paper.md": lambda path: files.write(path, self._report.markdown),
        }

    def to_dict(self) -> dict[str, Any]:
        """Claims, settings and parts as plain data."""
        return {
            "claims": [asdict(claim) for claim in self.claims],
            "settings": dict(self.settings),
            "parts": list(self.parts),
            "seconds": self.seconds,
            "setup": self.setup.to_dict(),
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The claims that `to_dict` gave."""
        from tractexp.studies.paper.verdict import Claim

        claims = [Claim(**claim) for claim in content["claims"]]
        seconds = content.get("seconds", 0.0)
        return cls(
            Setup.from_dict(content["setup"]),
            content["settings"],
            content["parts"],
            claims,
            seconds=seconds,
        )


@public
def paper(
    records: "Records",
    model: "ModelGiven | None" = None,
    *,
    validate: "Records" = (),
    parts: Sequence[str] = (),
    seeds: int = SEEDS,
    workers: int | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    per_event: Sequence[str] | None = None,
    substeps: int | None = None,
    objective: "Chosen | None" = None,
    budget: int | None = None,
    time_limit: float | None = None,
    target: float | None = None,
    seed: int = 0,
    progress: Progress = None,
) -> PaperResult:
    """Measure what the paper claims, on dips that are fitted and on others held out.

    Parameters
    ----------
    records, model, validate : as in `tractexp.identify`
    parts : names
        Tables and figures ("table2", "figure9", "equations"); none: all.
    seeds : int
        Each of the paper's optimizers searches under so many.
    workers : int
        Processes; None: one for each core.
    bounds, fixed, per_event, substeps, objective, budget, time_limit, target, seed
        As in `tractexp.identify`.
    progress : None, False or callable
        None shows the stage, False does not; a callable is told each stage.

    Returns
    -------
    PaperResult
        `claims`, each with its `text`, what was `measured` and the `verdict`.

    Raises
    ------
    UserError
        For wrong names or values, and where a part needs a held-out dip that is not there.

    Notes
    -----
    Source: Wu, Fan and Zou 2022.
    """
    started = time.perf_counter()
    check(parts, seeds, workers)
    setup = Setup.from_arguments(
        records,
        model,
        validate,
        objective,
        bounds=bounds,
        fixed=fixed,
        per_event=per_event,
        substeps=substeps,
        seed=seed,
        budget=budget,
        time_limit=time_limit,
        target=target,
    )
    settings, chosen = (
        {"seeds": seeds, "workers": workers},
        [p for p in PARTS if p in parts or not parts],
    )
    with tell_stages(progress) as tell:
        study = _build_study(setup, **settings, tell=tell, count=_count_searches(tell))
        from tractexp.studies.paper.claims import list_claims

        for kind, needing in HELD_OUT.items():
            if needing & set(chosen):
                study.select_held_out(kind)
        study.prepare(chosen)
        return PaperResult(
            setup,
            settings,
            chosen,
            list_claims(study, chosen),
            study,
            time.perf_counter() - started,
        )


def check(parts: Sequence[str], seeds: int, workers: int | None) -> None:
    """Raise `UserError` for settings out of range."""
    for part in parts:
        check_choice("task.parts", part, PARTS)
    check_range("task.seeds", seeds, 1)
    check_range("task.workers", workers, 1)


def _build_study(setup: Setup, seeds: int, workers: int | None, **listeners: Any) -> "Study":
    """The searches and fits that the parts ask for, with the printed equations beside the usual
    ones.
    """
    from tractexp.studies.paper.study import Study

    literal = replace(setup, model=setup.model.with_(integration="printed"))
    return Study(
        recipe=setup.problem_of,
        literal=literal.problem_of,
        node=asdict(setup.model),
        train=setup.train,
        held_out=setup.validate,
        seeds=seeds,
        seed=setup.seed,
        workers=workers,
        limits=setup.limits,
        **listeners,
    )


def _count_searches(tell: Callable[[str], None]) -> Callable[[int, int], None]:
    """A counter of the searches that have ended, which reports now and then."""
    pace = Pace(NEXT_LINES)

    def count(done: int, total: int) -> None:
        if pace() or done == total:
            tell(f"  {done} of {total} searches")

    return count


@plugin
class Paper(Task, call=paper):
    """Measure what the paper claims, on the shipped stand-ins or on records of your own:
    paper.json, .html and .md.
    """

    resumes = True
    reads = ("data", "model", "objective", "budget", "time_limit", "target")
    instead = {"optimizer": "it compares the paper's three; task=generalise takes any"}

    parts: list[str] = field(default_factory=list)  # such as [table1,figure9]; empty: all
    # {choice of data: files}; without data.validate
    held_out: dict[str, list[str]] = field(default_factory=dict)
    docs: str | None = None  # write paper.md to this file too

    def check(self) -> None:
        """Raise `UserError` for settings out of range."""
        check(self.parts, getattr(self, "seeds"), getattr(self, "workers"))  # noqa: B009 # settings of the call

    def perform(self, job: Job, **instead: Any) -> PaperResult:
        """Measure with dips held out, and print each stage."""
        job = job.holding_out(self.held_out)
        for line in describe_records(*job.events_of_fit, held_out="hold out"):
            say(line)
        return super().perform(job, progress=lambda line: say(f"  {line}"), **instead)

    def log(self, job: Job, result: PaperResult, paths: list[Path]) -> None:
        """Log the claims; with `docs` their pages are copied there."""
        if self.docs is not None:
            print_paths(files.copy(path, Path(self.docs)) for path in paths if path.suffix == ".md")
        super().log(job, result, paths)

    def track(self, job: Job, result: PaperResult, paths: list[Path]) -> "TrackedRun | None":
        """How many claims got each verdict, for MLflow."""
        metrics = {verdict.replace(" ", "_"): float(n) for verdict, n in result.counts.items()}
        return job.track(name="the paper", metrics=metrics, artifacts=paths)
