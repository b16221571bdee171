"""Identify on one dip, judge on a milder and a deeper one: Tables 4 and 5 of the paper, for any optimizers."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

from tractexp.errors import check_range
from tractexp.plugin import build, plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import Job, Task, call


@plugin
class Generalise(Task):
    """Mean absolute residuals of Eq. (21) on the held-out dips, by optimizer: generalise.json, curves and residuals.

    The optimizer chosen by `optimizer=` is always among those compared, with its settings; the others have their own
    defaults. All have the same limits.
    """

    optimizers: list[str] = field(default_factory=list)
    held_out: dict[str, list[str]] = field(default_factory=dict)  # {choice of data: files}; without data.validate
    seeds: int = 1  # searches of each optimizer: job seed and the ones after it

    def check(self) -> None:
        check_range("task.seeds", self.seeds, 1)
        for name in self.optimizers:
            build("optimizer", {"name": name})

    def run(self, job: Job) -> None:
        from tractexp.api.generalise import generalise

        def told(line: str) -> None:
            say(line)
            if line.startswith("model: "):  # as every task that searches, what was chosen on the command line
                say(f"optimizer: {job.choices['optimizer']}, seed {job.seed}")

        asked = job.holding_out(self.held_out).asked
        made = call(generalise, **asked, optimizers=self.compared(job), seeds=self.seeds, progress=told)
        paths = made.write_results(job.folder)
        show(made.medians)
        paths += made.write_drawings(job.folder)
        listed(paths)
        job.log(name="generalisation", values={}, metrics=metrics(made.residuals), artifacts=paths)

    def compared(self, job: Job) -> dict[str, Any]:
        """The optimizers by name, the chosen one with the settings it was given."""
        return {name: {"name": name} for name in self.optimizers} | {job.choices["optimizer"]: job.chosen}


def show(medians: Sequence[Mapping[str, Any]]) -> None:
    """Print a table for each held-out dip, medians over the seeds."""
    from tractexp.api.generalise import TOLD
    from tractexp.domain import WAVES

    say()
    errors = [key for key in WAVES.epsilons if all(key in row for row in medians)]
    for event, kind in dict.fromkeys((row["event"], row["kind"]) for row in medians):
        cells = [
            [row["optimizer"], *(f"{row[key]:.3e}" for key in ("residual_P", "residual_Q")),
             *(f"{row[key]:.3%}" for key in errors), ""]
            for row in medians if row["event"] == event
        ]  # fmt: skip
        table(["optimizer", "residual P", "residual Q", *errors, ""], cells, f"{kind}: {event}")
    say(TOLD)


def metrics(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """The residuals of each optimizer's first seed, by the number of the held-out dip."""
    dips = sum((row["optimizer"], row["seed"]) == (rows[0]["optimizer"], rows[0]["seed"]) for row in rows)
    return {
        f"validate_{1 + k % dips}_residual_{c}_{row['optimizer']}": row[f"residual_{c}"]
        for k, row in reversed(list(enumerate(rows)))  # the first seed's stand
        for c in "PQ"
    }
