"""The command that fits the dips of one load in several files together."""

import heapq
from collections import defaultdict
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tractexp.api.load_command import RACE
from tractexp.configuration.overrides import build_typed_command
from tractexp.configuration.plugin import discover
from tractexp.recording.archive import name_event
from tractexp.recording.overview import View
from tractexp.recording.sight import LoadEvent, Sight
from tractexp.storage import files

MOST_TOGETHER = 6  # dips that a command names: those that tell most


@dataclass(frozen=True, eq=False)
class NamedDip:
    """A dip that is worth fitting, by its name in the folder of its file."""

    name: str
    event: LoadEvent

    @property
    def is_from_field(self) -> bool:
        """Whether its structure is one that nobody knows: its record is in kV and MW."""
        return self.event.event is not None and self.event.event.record.is_from_field

    @property
    def weight(self) -> float:
        """How much of the load answers: the depth times the active power after the dip."""
        return abs(self.event.what.depth * self.event.what.after[0])


def build_joint_command(views: Sequence[View]) -> dict[str, Any] | None:
    """What fits the load that has dips in most of the files: `dips`, how many, `held_out`, the name
    of the last, and the `command`. None where no load has dips in two files of one folder.

    Loads are one where number, name, channels and reader are the same: of tables without names of
    loads the reader of the screen judges.
    """
    if not all(map(_is_plain_file, views)):
        return None
    folders = {Path(view.source).parent for view in views}
    dips = _find_dips_of_commonest_load(views)
    if len(folders) > 1 or len(dips) < 2:
        return None
    telling = heapq.nlargest(MOST_TOGETHER, dips, key=lambda dip: dip.weight)
    *fitted, held_out = [dip.name for dip in dips if dip in telling]
    raced = [RACE] if any(dip.is_from_field for dip in dips) else []
    command = build_fit_command(str(*folders), fitted, *raced, validate=[held_out])
    return {"dips": len(fitted) + 1, "held_out": held_out, "command": command}


def _find_dips_of_commonest_load(views: Sequence[View]) -> list[NamedDip]:
    """The dips of the load that has them in most files, in the files' order."""
    loads: dict[Hashable, list[NamedDip]] = defaultdict(list)
    for view in views:
        for key, dip in _list_dips(view):
            loads[key].append(dip)
    return max(loads.values(), key=len, default=[])


def build_fit_command(
    folder: str, events: Sequence[str], *more: str, validate: Sequence[str] = ()
) -> str:
    """The command that fits events of a folder together, with further settings.

    Events to `validate` with are held out.
    """
    reader = next(cls.name for cls in discover()["data"].values() if getattr(cls, "folders", False))
    held_out = {"validate": [*validate]} if validate else {}
    return build_typed_command(
        {"name": reader, "path": folder, "train": [*events], **held_out}, *more
    )


def _is_plain_file(view: View) -> bool:
    """Whether a view is that of one file by itself, as a folder's reader would read it."""
    return bool(view.node) and not view.node.get("join") and not files.is_archive(view.source)


def _list_dips(view: View) -> Iterator[tuple[Hashable, NamedDip]]:
    """The first dip of each load of a file that is worth fitting, with what tells the load."""
    for number, shown in enumerate(view.sights, 1):
        worth = next((event for event in shown.events if event.worth), None)
        if worth is not None:
            name = name_event(Path(view.source).name, number, worth)
            yield (number, *_identify_load(view, shown)), NamedDip(name, worth)


def _identify_load(view: View, shown: Sight) -> tuple[Hashable, ...]:
    """What loads of several files have alike where they are one: reader, name and channels."""
    if view.recording is None or shown.feeder is None:
        return (view.node["name"],)
    names = tuple(channel.name for channel in view.recording.channels)
    return view.node["name"], view.recording.station, shown.name, names
