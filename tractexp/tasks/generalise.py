"""Identify on one dip, judge on a milder and a deeper one: Tables 4 and 5 of the paper, for any optimizers."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from typing import Any

from tractexp.errors import check_range
from tractexp.plugin import build, plugin
from tractexp.tasks.console import say, searching, table
from tractexp.tasks.identify import announce
from tractexp.tasks.task import Job, Task


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

        job = with_siblings(job, self.held_out)
        events, config = job.events(), job.config
        limits = {key: config[key] for key in ("budget", "time_limit", "target")}
        made = generalise(
            events.train, events.validate, model=config["model"], optimizers=compared(job, self.optimizers),
            seeds=self.seeds, seed=job.seed, objective=config["objective"], **limits,
            begin=lambda problem: announce(job, events, problem), watch=watch(config["budget"]),
        )  # fmt: skip
        show(made.medians)
        paths = made.write(job.folder)
        for path in paths:
            say(f"  {path}")
        job.log(name="generalisation", values={}, metrics=metrics(made.residuals), artifacts=paths)


def with_siblings(job: Job, held_out: Mapping[str, list[str]]) -> Job:
    """The job with the files held out that belong to its choice of data, where it names none itself."""
    data: Mapping[str, Any] = job.config["data"]
    if job.choices["data"] not in held_out or data.get("validate"):
        return job
    held = [path for path in held_out[job.choices["data"]] if path not in data["train"]]
    return replace(job, config={**job.config, "data": {**data, "validate": held}})


def compared(job: Job, names: list[str]) -> dict[str, Any]:
    """The optimizers by name, the chosen one with the settings it was given."""
    made = {name: build("optimizer", {"name": name}) for name in names}
    return made | {job.choices["optimizer"]: job.optimizer}


def watch(budget: int | None) -> Any:
    """What says that a search begins and how far it is."""

    @contextmanager
    def watched(name: str, optimizer: Any, seed: int) -> Iterator[Any]:
        say(f"{name}, seed {seed}")
        with searching(getattr(optimizer, "iterations", None), budget) as progress:
            yield progress

    return watched


def show(medians: Sequence[Mapping[str, Any]]) -> None:
    """Print a table for each held-out dip, medians over the seeds."""
    say()
    for event, kind in dict.fromkeys((row["event"], row["kind"]) for row in medians):
        cells = [
            [row["optimizer"], *(f"{row[key]:.3e}" for key in ("residual_P", "residual_Q")),
             *(f"{row[key]:.3%}" for key in ("epsilon_p", "epsilon_q")), ""]
            for row in medians if row["event"] == event
        ]  # fmt: skip
        table(["optimizer", "residual P", "residual Q", "epsilon_p", "epsilon_q", ""], cells, f"{kind}: {event}")
    say("residuals: mean absolute value of Eq. (21), pu")


def metrics(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """The residuals of each optimizer's first seed, by the number of the held-out dip."""
    dips = sum((row["optimizer"], row["seed"]) == (rows[0]["optimizer"], rows[0]["seed"]) for row in rows)
    return {
        f"validate_{1 + k % dips}_residual_{c}_{row['optimizer']}": row[f"residual_{c}"]
        for k, row in reversed(list(enumerate(rows)))  # the first seed's stand
        for c in "PQ"
    }
