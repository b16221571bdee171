"""`task=suite`: one method on one numbered case of the benchmark."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from tractexp import tracking
from tractexp.api.job import Job
from tractexp.api.task import Task
from tractexp.blocks import Table
from tractexp.cache import provenance
from tractexp.configuration.plugin import plugin
from tractexp.errors import UserError, check_range
from tractexp.outcome import Written
from tractexp.storage import files

SUITE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(SUITE))

import page  # noqa: E402
import run  # noqa: E402


@dataclass(frozen=True, eq=False, repr=False)
class SuiteRow(Written):
    """What one method reached on one case: the row that `run.run_method` gives."""

    kind = "suite"

    row: Mapping[str, Any]

    def table(self) -> Table:
        """The row as the benchmark's table has it."""
        return Table(page.COLUMNS, [page.summarize([dict(self.row)])], page.CAPTION)

    def write_results(self, folder: Path) -> list[Path]:
        """Write `suite.json`."""
        return [files.write_json(folder / "suite.json", self.row)]

    def to_dict(self) -> dict[str, Any]:
        """The row."""
        return dict(self.row)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """What `to_dict` gave."""
        return cls(content)


@plugin
class Suite(Task):
    """One method on one numbered case of the benchmark: errors of dips that it did not see."""

    reads = ()

    method: str = "tractexp_identify"  # a file of `methods` without its ending, or a path
    case: int = 1

    def check(self) -> None:
        """Raise `UserError` for a case that there is not."""
        check_range("task.case", self.case, run.MADE[0], run.RECORDS[-1])

    def perform(self, job: Job, **instead: Any) -> SuiteRow:
        """Run the method. Raises `UserError` for no method, and where a record's files are not
        there.
        """
        named = run.METHODS / f"{self.method}.py"
        path = named if named.is_file() else Path(self.method).resolve()
        try:
            run.read_method(path)
        except SystemExit as error:
            raise UserError(f"task.method: {error}") from None
        seed = job.seed if self.case in run.DRAWN else None
        if not (rows := run.run_case(self.case, seed, [path])):
            raise UserError(
                f"task.case={self.case}: the files of this record are not in {run.SHARED};"
                " TRACTEXP_SHARED names their folder"
            )
        return SuiteRow(rows[0])

    def draws(self, job: Job) -> bool:
        """Whether pages are made: `page.py` makes the one of all rows."""
        return False

    def track(self, job: Job, result: Any, paths: list[Path]) -> tracking.TrackedRun | None:
        """The run of this row: it has no model, optimizer or data of the user's."""
        metrics = page.measure([dict(result.row)])
        told = {key: value for key, value in metrics.items() if np.isfinite(value)}
        job.measured.update(told)
        node = job.config["tracking"]
        if not node["enabled"]:
            return None
        row = result.row
        return tracking.TrackedRun(
            experiment=node["experiment"] or "benchmark",
            name=f"{row['method']}, case {row['case']}",
            parameters={key: str(row[key]) for key in ("method", "case", "seed", "file", "truth")},
            metrics=told,
            tags={"task": "suite", "method": row["method"], "git_commit": provenance.find_commit()},
            artifacts=paths,
            parent=job.sweep,
        )
