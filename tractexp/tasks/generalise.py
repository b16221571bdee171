"""Identify on one dip, judge on a milder and a deeper one: Tables 4 and 5 of the paper, for any optimizers."""

import json
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError, check_range
from tractexp.identification.search import Limits, search
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
        from tractexp.identification.result import conclude
        from tractexp.replication.searches import by_depth

        job = with_siblings(job, self.held_out)
        events = job.events()
        if not events.validate:
            raise UserError(
                "task=generalise needs dips that are not fitted: name them in data.validate, a milder one to"
                " interpolate and a deeper one to extrapolate"
            )
        problem = job.problem(events.train)
        announce(job, events, problem)
        config = job.config
        limits = Limits(config["budget"], config["time_limit"], config["target"])
        settings = {part: config["model"][part] for part in ("motor", "static", "effects")}
        kinds = by_depth(events.validate, events.train)
        found = []
        for name, optimizer in compared(job, self.optimizers).items():
            for seed in range(job.seed, job.seed + self.seeds):
                say(f"{name}, seed {seed}")
                with searching(getattr(optimizer, "iterations", None), limits.simulations) as progress:
                    ended = search(problem, optimizer, seed, limits, progress)
                result, fits = conclude(problem, ended, events.validate, seed, settings, name)
                found.append((result, fits[len(events.train) :]))
        rows = [row for result, fits in found for row in residuals(result, fits, kinds)]
        show(rows)
        paths = [write(job.folder / "generalise.json", rows, found), *draw(job.folder, found, kinds)]
        for path in paths:
            say(f"  {path}")
        metrics = {
            f"validate_{1 + k % len(kinds)}_residual_{c}_{row['optimizer']}": row[f"residual_{c}"]
            for k, row in reversed(list(enumerate(rows)))  # the first seed's stand
            for c in "PQ"
        }
        job.log(name="generalisation", values={}, metrics=metrics, artifacts=paths)


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


def residuals(result: Any, fits: list[Any], kinds: list[str]) -> list[dict[str, Any]]:
    """Eq. (21) and Eq. (20) of P and Q on each held-out dip."""
    from tractexp.replication.searches import mean_residual

    return [
        {
            "optimizer": result.optimizer,
            "seed": result.seed,
            "event": fit.event.record.name,
            "kind": kind,
            "depth": fit.event.depth,
            "residual_P": mean_residual(fit.event.record.P, fit.P),
            "residual_Q": mean_residual(fit.event.record.Q, fit.Q),
            "epsilon_p": fit.epsilon_p,
            "epsilon_q": fit.epsilon_q,
        }
        for fit, kind in zip(fits, kinds, strict=True)
    ]


def show(rows: list[dict[str, Any]]) -> None:
    """Print a table for each held-out dip, medians over the seeds."""
    say()
    for event, kind in dict.fromkeys((row["event"], row["kind"]) for row in rows):
        cells = []
        for optimizer in dict.fromkeys(row["optimizer"] for row in rows):
            members = [row for row in rows if (row["event"], row["optimizer"]) == (event, optimizer)]
            P, Q, p, q = (
                float(np.median([m[key] for m in members]))
                for key in ("residual_P", "residual_Q", "epsilon_p", "epsilon_q")
            )
            cells.append([optimizer, f"{P:.3e}", f"{Q:.3e}", f"{p:.3%}", f"{q:.3%}", ""])
        table(["optimizer", "residual P", "residual Q", "epsilon_p", "epsilon_q", ""], cells, f"{kind}: {event}")
    say("residuals: mean absolute value of Eq. (21), pu")


def write(path: Path, rows: list[dict[str, Any]], found: list[tuple[Any, Any]]) -> Path:
    """The residuals, and the parameters they come from."""
    identified = [
        {"optimizer": r.optimizer, "seed": r.seed, "objective": r.objective, "simulations": r.simulations,
         "parameters": r.parameters}
        for r, _ in found
    ]  # fmt: skip
    content = {"residuals": rows, "identified": identified}
    part = path.with_suffix(".part")
    part.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return part.replace(path)


def draw(folder: Path, found: list[tuple[Any, Any]], kinds: list[str]) -> list[Path]:
    """Curves and residuals of each optimizer's first seed on each held-out dip: issa_interpolation.svg, ..."""
    from tractexp.report import figures

    paths, seen = [], set()
    for result, fits in found:
        if result.optimizer in seen:
            continue
        seen.add(result.optimizer)
        for k, (fit, kind) in enumerate(zip(fits, kinds, strict=True)):
            record = fit.event.record
            suffix = f"_{k + 1}" if kinds.count(kind) > 1 else ""
            paths.append(
                figures.fit(
                    folder / f"{result.optimizer}_{kind}{suffix}.svg", record.t, record.U, (record.P, record.Q),
                    (fit.P, fit.Q), title=f"{record.name} ({kind}), {result.optimizer}, seed {result.seed}",
                    epsilon=(fit.epsilon_p, fit.epsilon_q), notes=record.notes,
                )
            )  # fmt: skip
    return paths
