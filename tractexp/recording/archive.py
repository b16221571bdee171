"""A folder of recordings: which of its files are read, and its events by name."""

import functools
import re
from pathlib import Path

from tractexp.configuration.plugin import build
from tractexp.errors import UserError, suggest_nearest
from tractexp.record import Record
from tractexp.recording.event_views import find_settings
from tractexp.recording.overview import View, view_of
from tractexp.recording.reader import WaveformReader
from tractexp.recording.record_files import find_records
from tractexp.recording.sight import LoadEvent, Sight
from tractexp.storage import files, time_limit
from tractexp.text.wording import count_noun

NAMED = re.compile(r"(?P<file>.+?)(?:#(?P<load>\d+)(?:\.(?P<dip>\d+))?)?")


def look_at_file(path: Path) -> View:
    """A file of an archive, looked at by the reader of its ending. Raises `UserError` where it
    cannot be read.
    """
    with time_limit.limit_time(path):
        return view_of(str(path), find_settings(str(path)))


def name_event(file: str, load: int, event: LoadEvent) -> str:
    """The name of an event within its archive: FILE#LOAD.DIP, both counted from 1."""
    return f"{file}#{load}" + ("" if event.dip is None else f".{event.dip}")


def records(folder: Path, names: list[str], where: str) -> list[Record]:
    """The records of events by name; `where` is the setting in messages.

    FILE#LOAD.DIP is dip DIP of load LOAD as `look` numbers them, FILE#LOAD the first event of the
    load that is worth fitting, FILE that of the first load. Raises `UserError` for what is not
    there or cannot be fitted.
    """
    see = functools.cache(look_at_file)
    return [_read_record(folder, name, where, see) for name in names]


def _read_record(
    folder: Path, name: str, where: str, see: "functools._lru_cache_wrapper[View]"
) -> Record:
    """The record of an event by its name, FILE#LOAD.DIP. Raises `UserError` with what the file has
    instead.
    """
    parts = NAMED.fullmatch(name)
    path, load, dip = folder / name, 1, None
    if not files.exists(path) and parts is not None:
        path, load = folder / parts["file"], int(parts["load"] or 1)
        dip = int(parts["dip"]) if parts["dip"] else None
    if not files.is_there(path):
        there = [str(p.relative_to(folder)) for p in find_records(folder)]
        raise UserError(
            f"{where}: there is no file '{path.relative_to(folder)}' in"
            f" {folder}{suggest_nearest(name, there)}"
        )
    view = see(path)
    if not 1 <= load <= len(view.sights):
        loads = count_noun(len(view.sights), "load")
        raise UserError(
            f"{where}: {name}: {path} shows {loads}, and there is no load {load}; the first is 1"
        )
    shown = view.sights[load - 1]
    event = _select(shown, dip, f"{where}: {name}")
    assert event.event is not None
    record = event.event.record
    if view.recording is not None and shown.feeder is not None:
        reader = build("data", view.node)
        assert isinstance(reader, WaveformReader)
        record = reader.attach_samples(
            view.recording,
            shown.feeder,
            record,
            span=(event.what.start, event.what.end),
        )
    return Record(
        **{**vars(record), "name": name_event(path.relative_to(folder).as_posix(), load, event)}
    )


def _select(shown: Sight, dip: int | None, where: str) -> LoadEvent:
    """The event of a load by its number, or the only one that is worth fitting. Raises `UserError`
    with the reason.
    """
    matches = [s for s in shown.events if (s.worth if dip is None else s.dip == dip)]
    if not matches or matches[0].event is None:
        reasons = [f"dip {s.dip}: {s.why}" for s in shown.events if s.dip is not None] or [
            "nothing happened to it"
        ]
        which = (
            "an event that is worth fitting" if dip is None else f"a dip {dip} that can be fitted"
        )
        raise UserError(f"{where}: the load '{shown.name}' has not {which} ({'; '.join(reasons)})")
    return matches[0]
