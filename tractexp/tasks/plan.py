"""Before the recording: which dips tell what, how deep one must be, and which events of an archive to fit."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.errors import UserError, check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import say, table
from tractexp.tasks.task import Job, Task

if TYPE_CHECKING:
    from tractexp.report.plan import Planned

DURATIONS = (0.06, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8)  # s
RATES = (25.0, 50.0, 100.0, 200.0, 500.0, 1000.0)  # Hz
NOISES = (0.001, 0.002, 0.005, 0.01, 0.02)  # of P before the event
DEPTH, DURATION, RATE, NOISE = "depth", "duration [s]", "samples per second", "noise, of P before the dip"
FIT, DEFAULT = "fit", "default"
ORIGINS = {FIT: "the values of a quick fit to {name}", DEFAULT: "the model's default values"}


@plugin
class Plan(Task):
    """Forecast the intervals that a recording would give, without fitting it: plan.html, plan.json, plan.svg.

    The dip is that of the deepest record in `data`, or as set here. The parameters are guessed by a quick fit to
    that record, or are the model's defaults, or those of an earlier result.json.
    """

    reads = ("data", "model")

    parameter: str = "H"  # how deep a dip is needed for this one (H stands for M)
    within: float = 0.05  # half of the 95 % interval, as a share of the value
    depth: float | None = None  # of the voltage before; null: as recorded
    duration: float | None = None  # s
    rate: float | None = None  # Hz
    noise: float | None = None  # standard deviation, as a share of P before the event; white
    values: str = FIT  # fit, default, or the path of a result.json
    least: float = 0.05  # another event of the archive must narrow the intervals by this share
    events: int | None = None  # at most so many

    def check(self) -> None:
        check_range("task.within", self.within, 1e-6, 10.0)
        check_range("task.least", self.least, 0.0, 1.0)
        if self.events is not None:
            check_range("task.events", self.events, 1)
        if self.noise is not None:
            check_range("task.noise", self.noise, 1e-9, 1.0)

    def run(self, job: Job) -> None:
        planned = self.planned(job)
        tell(planned)
        paths = written(job.folder, planned)
        for path in paths:
            say(f"  {path}")
        needed = planned.needed
        job.log(
            name=f"plan for {self.parameter}",
            values=dict(zip(planned.problem.space.names, planned.values.tolist(), strict=True)),
            metrics={} if needed.depth is None else {"depth_needed": needed.depth},
            artifacts=[*paths, job.folder / ".hydra"],
        )

    def planned(self, job: Job) -> "Planned":
        """Everything forecast: how deep, over what, and the best events."""
        from tractexp.identification.plan import best_events, column, depth_needed
        from tractexp.report.plan import Planned

        recorded = job.events().train
        problem = job.problem(recorded)
        column(problem.space.names, self.parameter)
        if problem.per_event:
            raise UserError("task=plan plans for shared parameters; leave model.per_event empty")
        deepest = max(recorded, key=lambda e: e.depth)
        shape = self.shape(deepest)
        shape.check()
        values = self.guess(job, deepest)
        scans = self.scans(problem, values, shape)
        return Planned(
            problem=problem,
            values=values,
            origin=ORIGINS.get(self.values, "the values of {path}").format(name=deepest.record.name, path=self.values),
            dip=describe(shape),
            needed=depth_needed(scans[DEPTH][1], self.parameter, self.within),
            scans=scans,
            chosen=best_events(problem, values, self.least, self.events) if len(recorded) > 1 else [],
            least=self.least,
            most=self.events,
        )

    def shape(self, event: Any) -> Any:
        """The dip to plan for: the recorded one with what is set replaced."""
        from tractexp.identification.plan import Shape

        shape = Shape.of(event)
        given = {key: getattr(self, key) for key in ("depth", "duration", "rate")}
        shape = replace(shape, **{key: value for key, value in given.items() if value is not None})
        if self.noise is not None:
            shape = replace(shape, noise_P=self.noise * abs(event.P0), noise_Q=self.noise * abs(event.P0), memory=0.0)
        return shape

    def guess(self, job: Job, event: Any) -> np.ndarray:
        """Free values (d,) to plan at."""
        from tractexp.identification.plan import guess
        from tractexp.identification.result import load

        problem = job.problem([event])
        if self.values == FIT:
            return guess(problem)
        if self.values == DEFAULT:
            return np.array([p.default for p in problem.parameters if p.name in problem.space.names])
        known = load(Path(self.values)).parameters
        if missing := [name for name in problem.space.names if name not in known]:
            raise UserError(
                f"task.values={self.values}: that result has no {', '.join(missing)}; it is of another model"
            )
        return np.array([known[name] for name in problem.space.names])

    def scans(self, problem: Any, values: np.ndarray, shape: Any) -> dict[str, Any]:
        """{label: (x, forecasts)}: one property of the dip varied at a time."""
        from tractexp.identification.plan import forecast, over_depth

        def over(key: str, grid: tuple[float, ...]) -> Any:
            shapes = [replace(shape, **{key: x}) for x in grid]
            return grid, [forecast(problem, values, s) for s in shapes]

        by_depth = over_depth(problem, values, shape)
        P = abs(shape.P0)
        loud = [replace(shape, noise_P=x * P, noise_Q=x * P) for x in NOISES]
        return {
            DEPTH: (tuple(f.shape.depth for f in by_depth), by_depth),
            DURATION: over("duration", DURATIONS),
            RATE: over("rate", RATES),
            NOISE: (NOISES, [forecast(problem, values, s) for s in loud]),
        }


def tell(planned: "Planned") -> None:
    """Print the plan, its answer and the best events."""
    from tractexp.report.plan import rest

    values = zip(planned.problem.space.names, planned.values, strict=True)
    say(planned.dip)
    say(f"parameters, {planned.origin}: {', '.join(f'{name} {value:.4g}' for name, value in values)}")
    show(planned.scans)
    say(f"how deep? {planned.needed}")
    for k, choice in enumerate(planned.chosen, start=1):
        narrower = f", intervals narrower by {choice.gain:.0%}" if k > 1 else ""
        say(f"event {k} of the best: {choice.name}{narrower}")
    if left_out := rest(planned):
        say(left_out)


def written(folder: Path, planned: "Planned") -> list[Path]:
    """Write plan.json, plan.svg and plan.html."""
    from tractexp.report import plan, uncertainty

    path = folder / "plan.json"
    path.write_text(json.dumps(content(planned), indent=2) + "\n", encoding="utf-8")
    figure = uncertainty.plan(folder / "plan.svg", planned.scans, planned.needed.within)
    return [path, figure, plan.page(folder / "plan.html", planned, figure)]


def describe(shape: Any) -> str:
    memory = f"forgotten within {1000 * shape.memory:.0f} ms" if shape.memory > 0 else "white"
    P, Q = (f"{100 * level / abs(shape.P0):.2g} %" for level in (shape.noise_P, shape.noise_Q))
    dip = f"a dip of {100 * shape.depth:.0f} % for {1000 * shape.duration:.0f} ms at {shape.rate:.0f} Hz"
    return f"planned: {dip}, noise {P} in P and {Q} in Q, of P, {memory}"


def show(scans: Mapping[str, Any]) -> None:
    """Print half intervals in percent of the value for some points of each scan."""
    from tractexp.report.plan import percent

    for label, (grid, forecasts) in scans.items():
        picked = range(0, len(grid), max(1, len(grid) // 6))
        rows = [[f"{grid[k]:.4g}", *(percent(r) for r in forecasts[k].relative)] for k in picked]
        table(
            [label.partition(",")[0].partition(" ")[0], *forecasts[0].names],
            rows,
            f"half of the 95 % interval, % of the value, by {label}",
        )


def content(planned: "Planned") -> dict[str, Any]:
    """What `plan.json` holds; half intervals are shares of the value, null where there is none."""
    finite = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731
    names = planned.problem.space.names
    return {
        "answer": str(planned.needed),
        "depth_needed": planned.needed.depth,
        "parameters": dict(zip(names, planned.values.tolist(), strict=True)),
        "half_intervals": {
            label: [
                {"at": float(x), **{n: finite(r) for n, r in zip(names, f.relative, strict=True)}}
                for x, f in zip(grid, forecasts, strict=True)
            ]
            for label, (grid, forecasts) in planned.scans.items()
        },
        "best_events": [
            {"name": c.name, "gain": c.gain, "half": {n: finite(h) for n, h in zip(names, c.half, strict=True)}}
            for c in planned.chosen
        ],
    }
