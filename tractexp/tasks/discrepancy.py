"""Find where simulation and measurement disagree, name the missing effect, add it, show the gap shrink."""

from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.plugin import plugin
from tractexp.tasks.console import say, table
from tractexp.tasks.task import LOAD, Job, Task, call
from tractexp.wording import joined, percent

if TYPE_CHECKING:
    from tractexp.api.investigate import Investigation

STAGES = ("before", "after")


@plugin
class Discrepancy(Task):
    """Investigate the training events and judge what is found on the held-out ones."""

    resumes = True
    reads = ("data", *LOAD, "model.bounds", "model.fixed", "model.substeps")
    instead = {"model.per_event": "its parameters are shared by all events, so leave it out"}

    effects: list[str] = field(default_factory=list)  # only these effects are tested; empty: the whole catalogue
    false_alarms: float = 0.05  # probability of naming anything where nothing is missing
    criteria: dict[str, float] = field(default_factory=dict)  # {name: value} of other thresholds of its decisions

    def run(self, job: Job) -> None:
        from tractexp.api.investigate import investigate

        events, node = job.events_of_fit, job.config["model"]
        read(events)
        job.prepare_log()
        found = call(
            investigate, events.train, node, validate=events.validate, effects=self.effects,
            false_alarms=self.false_alarms, criteria=self.criteria, seed=job.seed,
            progress=lambda line: say(f"  {line}"),
        )  # fmt: skip
        paths = found.write_results(job.folder)
        paths += found.write_drawings(job.folder)
        tell(found, paths)
        conf = job.folder / "conf"
        log(job, found, [*(p for p in paths if conf not in p.parents), *([conf] if found.names else [])])


def read(events: Any) -> None:
    """Say what was read."""
    from tractexp.record import describe

    for role, group in (("fit", events.train), ("hold out", events.validate)):
        for event in group:
            say(f"{role}: {describe(event)}")
            for note in event.record.notes:
                say(f"  note: {note}")


def tell(found: "Investigation", paths: Sequence[Path]) -> None:
    """Print the verdict first, then how large it is and how much it explains, where, and what was written."""
    from tractexp.discrepancy.discrepancy_json import use_of

    content, shown = found.content, found.table()
    say()
    say(f"verdict: {found.verdict.upper()} {' or '.join(map(joined, content['name_sets']))}".rstrip())
    *said, noise, following = shown.said
    for line in said:
        say(f"  {line}")
    grade, which = content["adequacy"], "extended" if found.names else "base"
    say(f"  the {which} model is graded {grade['grade'].replace('_', ' ')}: {grade['sentence']}")
    columns = shown.columns if found.names else shown.columns[:-1]
    table(columns, [row[: len(columns)] for row in shown.rows])
    if places := content["where"]:
        loudest = places[0]
        span = f"{loudest['start']:.3f} to {loudest['end']:.3f} s"
        others = len(places) - 1
        more = f", and {others} more stretch{'es' * (others > 1)}" if others else ""
        say(f"where: {loudest['channel']} of {loudest['event']}, {span}, {loudest['share']:.0%} of the excess{more}")
    if near := content["nearest"]:
        held = near["explained_held_out"]
        beyond = "" if held is None else f" and {percent(held)} on the held-out events"
        share = f"{percent(near['explained'])} of what exceeds the noise{beyond}"
        say(f"nearest, not accepted: {joined(near['effects'])}, {share}; {', '.join(found.sizes_of_nearest)}")
    say(noise)
    say(following)
    by_name = {path.name: path for path in paths}
    if page := by_name.pop("discrepancy.html", None):
        say(f"page: {page}")
    say(f"beside it: {', '.join(sorted(by_name))}")
    if model := by_name.get("extended.yaml"):
        which = f", which has {joined(found.names)}" * (found.verdict == "tied")
        say(f"use the extended model{which}: {use_of(found.question.model.domain, str(model.parent.parent))}")


def log(job: Job, found: "Investigation", paths: list[Path]) -> None:
    """Log verdict, gap and page, and below this run one for every set of effects that was refitted."""
    from tractexp import tracking

    metrics = {}
    for role in ("train", "validate"):
        if (gap := getattr(found.gap, role)) is None:
            continue
        for stage in STAGES:
            known = {key: value for key, value in vars(getattr(gap, stage)).items() if value is not None}
            metrics |= {f"{role}_{stage}_{key}": value for key, value in known.items()}
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
