"""What to record next, so that explanations which fit equally well are told apart."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.setup import Setup
from tractexp.blocks import Report, Table
from tractexp.errors import MODEL, TASK, UserError, name_setting
from tractexp.outcome import Written
from tractexp.record.identity import compose_title_of_records
from tractexp.storage import files
from tractexp.text.progress import Progress, tell_stages

if TYPE_CHECKING:
    from tractexp.discrepancy.next_event.choose import NextEvent


@dataclass(frozen=True, eq=False, repr=False)
class Recommended(Written):
    """The event that tells rivals apart. `content` is that of `plan.json`."""

    kind = "next_event"
    page = "plan.html"

    setup: Setup
    rivals: Sequence[Sequence[str]]
    content: Mapping[str, Any]
    behind: "NextEvent | None" = None  # None where it was loaded

    @property
    def sentence(self) -> str:
        """The event to record, or why none would help."""
        return self.content["sentence"]

    @property
    def probability(self) -> float:
        """That the recommended event leaves one rival, the least over all as the truth."""
        return self.content["recommended"]["probability"]

    @functools.cached_property
    def event(self) -> "NextEvent":
        """The chosen event behind the page; of a loaded result it is computed again."""
        return self.behind or _choose_event(self.setup, self.rivals, False)

    def table(self) -> Table:
        """Every event tried, the surest first."""
        ranked = sorted(self.content["tried"], key=lambda t: -t["probability"])
        rows = [[t["words"], f"{t['probability']:.0%}"] for t in ranked[:10]]
        return Table(["event", "probability"], rows, "the ten surest events")

    def summary(self) -> Report:
        """The surest events, and what to record."""
        return Report().add(self.table()).text(f"next: {self.sentence}")

    def report(self) -> Report:
        """The page: the events tried, and how the rivals differ there."""
        from tractexp.report import next_event

        return next_event.report(
            self.event, compose_title_of_records(e.record for e in self.setup.train)
        )


def recommend_event(setup: Setup, rivals: Any, progress: Progress = None) -> Recommended:
    """Choose the event that tells `rivals` apart. Raises `UserError` for rivals that cannot be
    planned for.
    """
    sets = read_sets(rivals)
    event = _choose_event(setup, sets, progress)
    return Recommended(setup, sets, files.make_plain(event.to_dict()), event)


def read_sets(rivals: Any) -> list[list[str]]:
    """Sets of effects: from names, `a+b` for two at once, or from the `discrepancy.json` of a tie.

    Raises `UserError` for a file that holds no tie.
    """
    if not isinstance(rivals, str):
        return [name.split("+") if isinstance(name, str) else list(name) for name in rivals]
    path = Path(rivals)
    if not files.is_there(path):
        raise UserError(
            f"{TASK.rivals}={rivals}: there is no such file; give names of effects, [a,b] or"
            " [a,b+c], or the discrepancy.json of an investigation that ended tied"
        )
    investigation = files.read_json(path)
    if not isinstance(investigation, dict) or "verdict" not in investigation:
        raise UserError(
            f"{TASK.rivals}={rivals}: this is not the discrepancy.json of an investigation"
        )
    if investigation.get("verdict") != "tied":
        raise UserError(
            f"{TASK.rivals}={rivals}: that investigation ended {investigation.get('verdict')}, not"
            " tied, so that there is nothing to tell apart; of a proposal the terms that are like"
            " it, and what to record for them, are in that file itself, as next_event"
        )
    return investigation["name_sets"]


def _choose_event(setup: Setup, rivals: Sequence[Sequence[str]], progress: Progress) -> "NextEvent":
    """The event that tells rivals apart. Raises `UserError` for a model with `per_event`, or sets
    that do not fit it.
    """
    from tractexp.discrepancy.next_event.rivals import choose_event_for

    m = setup.model
    if m.per_event:
        raise UserError(
            f"{name_setting('task=plan')} plans for shared parameters;"
            f" leave {MODEL.per_event} empty"
        )
    with tell_stages(progress) as tell:
        return choose_event_for(
            m.model, setup.train, rivals, m.bounds, m.fixed, substeps=m.substeps, tell=tell
        )
