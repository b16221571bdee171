"""Find where simulation and measurement disagree, name the missing effect, add it, show the gap shrink."""

from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import LOAD, Job, Task, call

if TYPE_CHECKING:
    from tractexp.api.investigate import Investigation

STAGES = ("before", "after")


@plugin
class Discrepancy(Task):
    """Investigate the training events, judge what is found on the held-out ones, tell it in one page."""

    reads = ("data", *LOAD, "model.bounds", "model.fixed", "model.substeps")
    instead = {"model.per_event": "its parameters are shared by all events, so leave it out"}

    effects: list[str] = field(default_factory=list)  # only these effects are tested; empty: the whole catalogue
    false_alarms: float = 0.05  # probability of naming anything where nothing is missing
    criteria: dict[str, float] = field(default_factory=dict)  # {name: value} of other thresholds of its decisions

    def run(self, job: Job) -> None:
        from tractexp.api.investigate import investigate

        events, node = job.events, job.config["model"]
        read(events)
        job.prepare_log()
        found = call(
            investigate, events.train, node, validate=events.validate, effects=self.effects,
            false_alarms=self.false_alarms, criteria=self.criteria, seed=job.seed,
            progress=lambda line: say(f"  {line}"),
        )  # fmt: skip
        tell(found)
        paths = found.write(job.folder)
        listed(paths)
        conf = job.folder / "conf"
        say(f"the extended model: python -m tractexp --config-dir {conf} model=extended")
        log(job, found, [*(p for p in paths if conf not in p.parents), conf])


def read(events: Any) -> None:
    """Say what was read."""
    from tractexp.record import describe

    for role, group in (("fit", events.train), ("hold out", events.validate)):
        for event in group:
            say(f"{role}: {event.record.name}: {describe(event)}")
            for note in event.record.notes:
                say(f"  note: {note}")


def tell(found: "Investigation") -> None:
    """Print the story: noise, disagreement, where, which, how sure, how much smaller."""
    content, gap = found.content, found.gap
    say(f"noise: {content['noise']}")
    say(f"verdict: {found.verdict.upper()} {', '.join(found.names)}")
    say(f"  {found.reason}")
    for place in content["where"][:5]:
        span = f"{place['start']:.3f} to {place['end']:.3f} s"
        say(f"  where: {place['event']}, {place['channel']}, {span}, {place['share']:.0%}")
    shown = found.table()
    table(shown.columns[:-1], [row[:-1] for row in shown.rows])
    if found.names:
        say(f"share of the explainable gap closed on the fitted events: {_share(gap.train.closed)}")
    if gap.validate is not None:
        say(f"share of the explainable gap closed on the held-out events: {_share(gap.validate.closed)}")
    if near := content["nearest"]:
        held = near["explained_held_out"]
        beyond = "" if held is None else f", {held:.0%} on the held-out events"
        share = f"{_share(near['explained'])} of what exceeds the noise{beyond}"
        say(f"nearest: {' and '.join(near['effects'])} explains {share}")
    say(f"next: {found.recommendation}")
    say()


def _share(share: float | None) -> str:
    return "nan%" if share is None else f"{share:.0%}"


def log(job: Job, found: "Investigation", paths: list[Path]) -> None:
    """Log verdict, gap and page, and below this run one for every set of effects that was refitted."""
    from tractexp import tracking

    metrics = {}
    for role in ("train", "validate"):
        if (gap := getattr(found.gap, role)) is None:
            continue
        for stage in STAGES:
            metrics |= {f"{role}_{stage}_{key}": value for key, value in vars(getattr(gap, stage)).items()}
        if gap.closed is not None:
            metrics[f"{role}_gap_closed"] = gap.closed
    children = [
        tracking.Run(
            experiment=job.experiment,
            name=" and ".join(row["effects"]),
            metrics={"deviance_lowered_by": row["likelihood_ratio"] or 0.0}
            | {name: at["value"] for name, at in row["parameters"].items()},
            tags={"candidate": row["status"], "task": "discrepancy"},
        )
        for row in found.sets
    ]
    job.log(
        name=f"{found.verdict} {' '.join(found.names)}".strip(),
        values={},
        metrics=metrics,
        artifacts=[*paths, job.folder / ".hydra"],
        description=found.reason,
        model=job.folder / "result.json",
        children=children,
    )
