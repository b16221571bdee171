"""Find where simulation and measurement disagree, name the missing effect, add it, show the gap shrink."""

from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import say, table
from tractexp.tasks.task import LOAD, Job, Task


@plugin
class Discrepancy(Task):
    """Investigate the training events, judge what is found on the held-out ones, tell it in one page."""

    reads = ("data", *LOAD, "model.bounds", "model.fixed", "model.substeps")
    instead = {"model.per_event": "its parameters are shared by all events, so leave it out"}

    effects: list[str] = field(default_factory=list)  # only these effects are tested; empty: the whole catalogue
    false_alarms: float = 0.05  # probability of naming anything where nothing is missing

    def check(self) -> None:
        check_range("task.false_alarms", self.false_alarms, 0.001, 0.5)

    def run(self, job: Job) -> None:
        from tractexp.discrepancy import discrepancy_json
        from tractexp.discrepancy.criteria import Criteria
        from tractexp.discrepancy.investigate import investigate

        events, node = job.events(), job.config["model"]
        read(events)
        job.prepare_log()
        found = investigate(
            job.model, events.train, events.validate, node["bounds"], node["fixed"],
            only=self.effects, criteria=Criteria(false_alarms=self.false_alarms), seed=job.seed,
            tell=lambda line: say(f"  {line}"),
        )  # fmt: skip
        tell(found)
        extended = discrepancy_json.write_model(found, node, job.folder / "conf" / "model" / "extended.yaml")
        result = extended_result(job, found, events)
        paths = [discrepancy_json.write(found, job.folder / "discrepancy.json"), extended, result]
        if found.verdict.word == "unexplained":
            paths.append(discrepancy_json.write_left(found, job.folder / "unexplained.csv"))
        paths += draw(job, found)
        for path in paths:
            say(f"  {path}")
        say(f"the extended model: python -m tractexp --config-dir {job.folder / 'conf'} model=extended")
        log(job, found, [p for p in paths if p != extended] + [job.folder / "conf"], result)


def read(events: Any) -> None:
    """Say what was read."""
    from tractexp.record import describe

    for role, group in (("fit", events.train), ("hold out", events.validate)):
        for event in group:
            say(f"{role}: {event.record.name}: {describe(event)}")
            for note in event.record.notes:
                say(f"  note: {note}")


def tell(found: Any) -> None:
    """Print the story: noise, disagreement, where, which, how sure, how much smaller."""
    from tractexp.discrepancy.discrepancy_json import recommendation

    say(f"noise: {found.last.noise.describe()}")
    say(f"verdict: {found.verdict.word.upper()} {', '.join(found.names)}")
    say(f"  {found.verdict.reason}")
    for place in found.places[:5]:
        say(f"  where: {place.event}, {place.channel}, {place.start:.3f} to {place.end:.3f} s, {place.share:.0%}")
    rows = []
    for label, gap in (("fitted", found.train), ("held out", found.validate)):
        if gap is None:
            continue
        for stage, curves in (("before", gap.before), ("after", gap.after)):
            rows.append(
                [label, stage, f"{curves.epsilon_p:.3%}", f"{curves.epsilon_q:.3%}", f"{curves.chi2_per_sample:.3f}"]
            )
    table(["events", "", "epsilon_p", "epsilon_q", "chi2 per sample"], rows)
    if found.names:
        say(f"share of the explainable gap closed on the fitted events: {found.train.closed:.0%}")
    if found.validate is not None:
        say(f"share of the explainable gap closed on the held-out events: {found.validate.closed:.0%}")
    if found.verdict.nearest is not None:
        near = found.verdict.nearest
        held = f", {near.held_out:.0%} on the held-out events" if np.isfinite(near.held_out) else ""
        say(f"nearest: {' and '.join(near.names)} explains {near.fitted:.0%} of what exceeds the noise{held}")
    say(f"next: {recommendation(found)}")
    say()


def extended_result(job: Job, found: Any, events: Any) -> Path:
    """Write the extended model's parameters as a result file, which predicts and is logged as a model."""
    from tractexp.identification.problem import Problem
    from tractexp.identification.result import conclude, parts
    from tractexp.identification.search import Found, History
    from tractexp.model.model import compose

    node = job.config["model"]
    names = sorted({*node["effects"], *found.names})
    settings = {"motor": node["motor"], "static": node["static"], "effects": names}
    model = compose(*parts(settings))
    problem = Problem(model, events.train, node["bounds"], node["fixed"], int(found.bench.problem.step.substeps.max()))
    values = np.array([found.bench.coordinates.value(n, found.extended.unit) for n in problem.space.names])
    objective = float(problem.objective(values[None])[0])
    one = np.array([found.bench.effort.simulations])
    history = History(one, np.array([objective]), values[None], np.zeros(1))
    status = f"ended with the verdict {found.verdict.word}"
    ended = Found(values, objective, found.bench.effort.simulations, 0, 0, 0.0, status, history)
    result, _ = conclude(problem, ended, events.validate, job.seed, settings, "descent")
    return result.write(job.folder / "result.json")


def draw(job: Job, found: Any) -> list[Path]:
    """The figures and the page."""
    from tractexp.report import discrepancy

    return discrepancy.report(job.folder, found, f"{job.choices['data']}")


def log(job: Job, found: Any, paths: list[Path], result: Path) -> None:
    """Log verdict, gap and page."""
    metrics = {}
    for role, gap in (("train", found.train), ("validate", found.validate)):
        if gap is None:
            continue
        for stage, curves in (("before", gap.before), ("after", gap.after)):
            metrics |= {f"{role}_{stage}_epsilon_p": curves.epsilon_p, f"{role}_{stage}_epsilon_q": curves.epsilon_q}
            metrics[f"{role}_{stage}_chi2_per_sample"] = curves.chi2_per_sample
        if np.isfinite(gap.closed):
            metrics[f"{role}_gap_closed"] = gap.closed
    job.log(
        name=f"{found.verdict.word} {' '.join(found.names)}".strip(),
        values={},
        metrics=metrics,
        artifacts=[*paths, job.folder / ".hydra"],
        description=found.verdict.reason,
        model=result,
        children=candidates(job, found),
    )


def candidates(job: Job, found: Any) -> list[Any]:
    """A run below this one for every set of effects that was refitted: how far it lowers the deviance, and its size."""
    from tractexp import tracking
    from tractexp.discrepancy.discrepancy_json import sets

    return [
        tracking.Run(
            experiment=job.experiment,
            name=" and ".join(row["effects"]),
            metrics={"deviance_lowered_by": row["likelihood_ratio"] or 0.0}
            | {name: at["value"] for name, at in row["parameters"].items()},
            tags={"candidate": row["status"], "task": "discrepancy"},
        )
        for row in sets(found)
    ]  # fmt: skip
