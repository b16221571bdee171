"""The paper's tables and figures, done again: one page, one verdict for each claim."""

import functools
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from tractexp import files
from tractexp.api.arguments import public
from tractexp.api.pages import Drawing, Written
from tractexp.api.setup import Setup
from tractexp.errors import check_choice, check_range
from tractexp.outcome import Table
from tractexp.progress import NEXT_LINES, telling

if TYPE_CHECKING:
    from tractexp.replication.claims import Claim
    from tractexp.replication.study import Study
    from tractexp.report.markdown import Markdown
    from tractexp.report.page import Page

PARTS = (
    "table1", "table2", "table3", "table4", "table5", "figure3", "figure4", "figure6", "figure8", "figure9", "figure10",
    "figure11", "equations", "readings",
)  # fmt: skip
HELD_OUT = {"interpolation": {"table4", "figure10"}, "extrapolation": {"table5", "figure11"}}  # what needs which dip
SEEDS = 30


@dataclass(frozen=True, eq=False, repr=False)
class Replicated(Written):
    """The paper's claims, judged. Of a loaded result the page is measured again, from the records it holds."""

    kind = "paper"

    setup: Setup
    settings: Mapping[str, Any]  # seeds, workers
    parts: Sequence[str]
    claims: "Sequence[Claim]"

    @functools.cached_property
    def study(self) -> "Study":
        """What stands behind the page, each part measured when first asked for."""
        return _study(self.setup, **self.settings)

    @property
    def counts(self) -> Counter[str]:
        """How many claims got which verdict."""
        return Counter(claim.word for claim in self.claims)

    def table(self) -> Table:
        from tractexp.replication.claims import counted

        rows = [[claim.part, claim.text, claim.verdict, claim.measured] for claim in self.claims]
        return Table(["where", "the paper's claim", "verdict", "measured"], rows, counted(self.claims))

    @functools.cached_property
    def _sheets(self) -> "tuple[Page, Markdown]":
        from tractexp.report.paper import sheets

        return sheets(self.study, self.parts, self.claims)

    def _results(self, folder: Path) -> list[Path]:
        """paper.json: the claims and what was measured."""
        told = {key: value for key, value in self.to_dict().items() if key != "setup"}
        return [files.write_json(folder / "paper.json", told)]

    def _drawings(self) -> Mapping[str, Drawing]:
        return {
            "paper.html": lambda path: self._sheets[0].write(path),
            "paper.md": lambda path: self._sheets[1].write(path),
        }

    def to_dict(self) -> dict[str, Any]:
        told = {"settings": dict(self.settings), "parts": list(self.parts)}
        return {"claims": [asdict(claim) for claim in self.claims], **told, "setup": self.setup.to_dict()}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        from tractexp.replication.claims import Claim

        judged = [Claim(**told) for told in content["claims"]]
        return cls(Setup.from_dict(content["setup"]), content["settings"], content["parts"], judged)


@public
def paper(
    records: Any,
    model: Any = None,
    *,
    validate: Any = (),
    parts: Sequence[str] = (),
    seeds: int = SEEDS,
    workers: int | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    per_event: Sequence[str] | None = None,
    substeps: int | None = None,
    objective: Any = None,
    budget: int | None = None,
    time_limit: float | None = None,
    target: float | None = None,
    seed: int = 0,
    progress: Any = None,
) -> Replicated:
    """Measure what the paper claims, on `records` fitted and on those of `validate`.

    `parts` are tables and figures ("table2", "figure9", "equations"; none: all). Each of the paper's optimizers
    searches under `seeds` seeds, on `workers` processes (None: one for each core). Everything else is as in
    `tractexp.identify`. `progress`: None shows the stage, False does not; a callable is told each stage.

    Raises `UserError` for wrong names or values, and where a part needs a held-out dip that is not there.
    """
    check(parts, seeds, workers)
    known = {"bounds": bounds, "fixed": fixed, "per_event": per_event, "substeps": substeps}
    limits = {"budget": budget, "time_limit": time_limit, "target": target}
    setup = Setup.of(records, model, validate, objective, known, seed=seed, **limits)
    settings, chosen = {"seeds": seeds, "workers": workers}, [p for p in PARTS if p in parts or not parts]
    with telling(progress) as tell:
        study = _study(setup, **settings, tell=tell, count=_counted(tell))
        from tractexp.replication.claims import claims

        for kind, needing in HELD_OUT.items():
            if needing & set(chosen):
                study.held(kind)
        study.prepare(chosen)
        made = Replicated(setup, settings, chosen, claims(study, chosen))
    vars(made)["study"] = study
    return made


def check(parts: Sequence[str], seeds: int, workers: int | None) -> None:
    """Raise `UserError` for settings out of range."""
    for part in parts:
        check_choice("task.parts", part, PARTS)
    check_range("task.seeds", seeds, 1)
    if workers is not None:
        check_range("task.workers", workers, 1)


def _study(setup: Setup, seeds: int, workers: int | None, **heard: Any) -> "Study":
    from tractexp.replication.study import Study

    literal = replace(setup, model=setup.model.with_(integration="printed"))
    return Study(
        recipe=setup.problem_of, literal=literal.problem_of,
        node=asdict(setup.model), train=setup.train, held_out=setup.validate, seeds=seeds,
        seed=setup.seed, workers=workers, limits=setup.limits, **heard,
    )  # fmt: skip


def _counted(tell: Callable[[str], None]) -> Callable[[int, int], None]:
    """What hears of each search that ends, and tells now and then how many have."""
    told = time.perf_counter()

    def count(done: int, total: int) -> None:
        nonlocal told
        now = time.perf_counter()
        if done == total or now - told > NEXT_LINES:
            told = now
            tell(f"  {done} of {total} searches")

    return count
