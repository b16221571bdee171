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
        from tractexp.discrepancy import contract
        from tractexp.discrepancy.investigate import investigate

        events, node = job.events(), job.config["model"]
        read(events)
        job.prepare_log()
        finding = investigate(
            job.model, events.train, events.validate, node["bounds"], node["fixed"],
            only=self.effects, alpha=self.false_alarms, seed=job.seed, tell=lambda line: say(f"  {line}"),
        )  # fmt: skip
        tell(finding)
        extended = contract.write_model(finding, node, job.folder / "conf" / "model" / "extended.yaml")
        result = extended_result(job, finding, events)
        paths = [contract.write(finding, job.folder / "discrepancy.json"), extended, result]
        if finding.verdict == "unexplained":
            paths.append(contract.write_left(finding, job.folder / "unexplained.csv"))
        paths += draw(job, finding)
        for path in paths:
            say(f"  {path}")
        say(f"the extended model: python -m tractexp --config-dir {job.folder / 'conf'} model=extended")
        log(job, finding, [p for p in paths if p != extended] + [job.folder / "conf"], result)


def read(events: Any) -> None:
    """Say what was read."""
    from tractexp.record import describe

    for role, group in (("fit", events.train), ("hold out", events.validate)):
        for event in group:
            say(f"{role}: {event.record.name}: {describe(event)}")
            for note in event.record.notes:
                say(f"  note: {note}")


def tell(finding: Any) -> None:
    """Print the story: noise, disagreement, where, which, how sure, how much smaller."""
    from tractexp.discrepancy.contract import recommendation

    say(f"noise: {finding.last.noise.describe()}")
    say(f"verdict: {finding.verdict.upper()} {', '.join(finding.names)}")
    say(f"  {finding.reason}")
    for place in finding.places[:5]:
        say(f"  where: {place.event}, {place.channel}, {place.start:.3f} to {place.end:.3f} s, {place.share:.0%}")
    rows = []
    for label, gap in (("fitted", finding.train), ("held out", finding.validate)):
        if gap is None:
            continue
        for stage, curves in (("before", gap.before), ("after", gap.after)):
            rows.append(
                [label, stage, f"{curves.epsilon_p:.3%}", f"{curves.epsilon_q:.3%}", f"{curves.chi2_per_sample:.3f}"]
            )
    table(["events", "", "epsilon_p", "epsilon_q", "chi2 per sample"], rows)
    if finding.names:
        say(f"share of the explainable gap closed on the fitted events: {finding.train.closed:.0%}")
    if finding.validate is not None:
        say(f"share of the explainable gap closed on the held-out events: {finding.validate.closed:.0%}")
    if finding.nearest is not None:
        near = finding.nearest
        held = f", {near.held_out:.0%} on the held-out events" if np.isfinite(near.held_out) else ""
        say(f"nearest: {' and '.join(near.names)} explains {near.fitted:.0%} of what exceeds the noise{held}")
    say(f"next: {recommendation(finding)}")
    say()


def extended_result(job: Job, finding: Any, events: Any) -> Path:
    """Write the extended model's parameters as a result file, which predicts and is logged as a model."""
    from tractexp.identification.problem import Problem
    from tractexp.identification.result import conclude, parts
    from tractexp.identification.search import Found, History
    from tractexp.model.model import compose

    node = job.config["model"]
    names = sorted({*node["effects"], *finding.names})
    settings = {"motor": node["motor"], "static": node["static"], "effects": names}
    model = compose(*parts(settings))
    problem = Problem(
        model, events.train, node["bounds"], node["fixed"], int(finding.study.problem.step.substeps.max())
    )
    values = np.array([finding.study.value(n, finding.extended.unit) for n in problem.space.names])
    objective = float(problem.objective(values[None])[0])
    one = np.array([finding.study.simulations])
    history = History(one, np.array([objective]), values[None], np.zeros(1))
    status = f"ended with the verdict {finding.verdict}"
    found = Found(values, objective, finding.study.simulations, 0, 0, 0.0, status, history)
    result, _ = conclude(problem, found, events.validate, job.seed, settings, "descent")
    return result.write(job.folder / "result.json")


def draw(job: Job, finding: Any) -> list[Path]:
    """The figures and the page."""
    from tractexp.report import discrepancy

    return discrepancy.report(job.folder, finding, f"{job.choices['data']}")


def log(job: Job, finding: Any, paths: list[Path], result: Path) -> None:
    """Log verdict, gap and page."""
    metrics = {}
    for role, gap in (("train", finding.train), ("validate", finding.validate)):
        if gap is None:
            continue
        for stage, curves in (("before", gap.before), ("after", gap.after)):
            metrics |= {f"{role}_{stage}_epsilon_p": curves.epsilon_p, f"{role}_{stage}_epsilon_q": curves.epsilon_q}
            metrics[f"{role}_{stage}_chi2_per_sample"] = curves.chi2_per_sample
        if np.isfinite(gap.closed):
            metrics[f"{role}_gap_closed"] = gap.closed
    job.log(
        name=f"{finding.verdict} {' '.join(finding.names)}".strip(),
        values={},
        metrics=metrics,
        artifacts=[*paths, job.folder / ".hydra"],
        description=finding.reason,
        model=result,
        children=candidates(job, finding),
    )


def candidates(job: Job, finding: Any) -> list[Any]:
    """A run below this one for every set of effects that was refitted: how far it lowers the deviance, and its size."""
    from tractexp import tracking
    from tractexp.discrepancy.contract import sets

    return [
        tracking.Run(
            experiment=job.experiment,
            name=" and ".join(row["effects"]),
            metrics={"deviance_lowered_by": row["likelihood_ratio"] or 0.0}
            | {name: at["value"] for name, at in row["parameters"].items()},
            tags={"candidate": row["status"], "task": "discrepancy"},
        )
        for row in sets(finding)
    ]  # fmt: skip
