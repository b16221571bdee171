"""The rows of a survey: made of one file, in worker processes, and kept in a journal as they come."""

import contextlib
import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from tractexp import files
from tractexp.api.look import command, event_row, series
from tractexp.errors import UserError
from tractexp.recording import archive
from tractexp.recording.overview import LoadEvent, Sight, View
from tractexp.report.survey import QUIET, UNREAD
from tractexp.workers import processes

Rows = list[dict[str, Any]]

COLUMNS = (
    "event", "file", "station", "load", "kind", "when", "start", "duration", "depth", "U2", "jump", "P_before",
    "Q_before", "P_after", "Q_after", "unit", "noise", "rate", "worth", "why", "command", "U_picture", "P_picture",
)  # fmt: skip
AHEAD = 4  # files given to each worker at a time
POINTS = 48  # of a small picture
AROUND = (0.1, 0.3)  # s before and after an event in its picture
LONGEST = 5.0  # s of an event there


def rows_of(folder: str, file: str) -> Rows:
    """The rows of one file, `file` being its path within the folder. Nothing that happens in here is an error."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS) | {"file": file, "worth": False, "why": ""}
    try:
        view = archive.looked(Path(folder, file))
        made = [
            row | _event(view, file, number, shown, seen)
            for number, shown in enumerate(view.sights, 1)
            for seen in shown.events
        ]
        return files.plain(made or [row | _common(view) | {"kind": QUIET, "why": _quiet(view)}])
    except UserError as error:
        return [row | {"kind": UNREAD, "why": str(error)}]
    except Exception as error:  # a survey of thousands of files does not end with one of them
        why = f"the program failed at this file, which is its mistake: {type(error).__name__}: {error}"
        return [row | {"kind": UNREAD, "why": why}]


def _quiet(view: View) -> str:
    if not view.sights:
        return "no voltages and currents of one load were recognised"
    return "; ".join(dict.fromkeys(said for s in view.sights for said in s.said)) or "the voltage stays as it is"


def _common(view: View) -> dict[str, Any]:
    recording = view.recording
    if recording is None:
        return {"station": "", "rate": view.sights[0].record.rate if view.sights and view.sights[0].record else None}
    return {"station": recording.station, "rate": max(s.rate for s in recording.segments)}


def _event(view: View, file: str, number: int, shown: Sight, seen: LoadEvent) -> dict[str, Any]:
    """The row of one event."""
    told = event_row(seen)
    begun = view.recording.start if view.recording else None
    event = seen.event
    noise = event.noise_P / max(abs(event.P0), 1e-9) if event is not None else None
    return {
        **_common(view), **{key: value for key, value in told.items() if key in COLUMNS},
        "event": archive.event_name(file, number, seen), "load": shown.name, "unit": "pu" if shown.per_unit else "MW",
        "when": (begun + timedelta(seconds=told["start"])).isoformat() if begun else None, "noise": noise,
        "command": command(view, shown) if seen.worth else "", **_pictures(shown, seen),
    }  # fmt: skip


def _pictures(shown: Sight, seen: LoadEvent) -> dict[str, list[float | None]]:
    """U and P about an event, as shares of the greatest in the picture, few points each."""
    columns = series(shown)
    t, what = columns["t"], seen.what
    first, stop = np.searchsorted(t, [what.start - AROUND[0], min(what.end, what.start + LONGEST) + AROUND[1]])
    return {f"{name}_picture": _few(columns[name][first:stop]) for name in ("U", "P")}


def _few(values: np.ndarray) -> list[float | None]:
    """At most `POINTS` values (n,), the lowest and the highest of each stretch, as shares of the greatest size."""
    if len(values) > POINTS:
        parts = np.array_split(values, POINTS // 2)
        ends = [sorted((int(np.argmin(p)), int(np.argmax(p)))) for p in parts]
        values = np.array([p[k] for p, pair in zip(parts, ends, strict=True) for k in pair])
    known = values[np.isfinite(values)]
    size = float(np.abs(known).max()) if len(known) else 0.0
    return [round(float(v) / size, 3) if size and np.isfinite(v) else None for v in values]


def looked(folder: Path, names: Sequence[str], cores: int) -> Iterator[tuple[str, Rows]]:
    """(file, its rows) of files within a folder, as they are done, on so many processes.

    A file at which a process dies is looked at again by itself; if that one dies too, its row says so.
    """
    if cores == 1 or len(names) < 3:
        yield from ((name, rows_of(str(folder), name)) for name in names)
        return
    left = list(names)
    while left:
        suspects: list[str] = []
        with processes(min(cores, len(left))) as pool:
            waiting: dict[Future[Rows], str] = {}
            todo = iter(list(left))
            try:
                for name in todo:
                    waiting[pool.submit(rows_of, str(folder), name)] = name
                    if len(waiting) >= AHEAD * cores:
                        for done, rows in _done(waiting):
                            left.remove(done)
                            yield done, rows
                while waiting:
                    for done, rows in _done(waiting):
                        left.remove(done)
                        yield done, rows
            except BrokenProcessPool:
                suspects = [name for name in left if name in {*waiting.values()}] or left[:1]
        for name in suspects:
            left.remove(name)
            yield name, _alone(folder, name)


def _done(waiting: dict[Future[Rows], str]) -> list[tuple[str, Rows]]:
    """What is done of what is waited for, which forgets it. Raises `BrokenProcessPool` and forgets nothing of it."""
    ended, _ = wait(waiting, return_when=FIRST_COMPLETED)
    made = [(future, future.result()) for future in ended if future.exception() is None]
    if not made:
        raise BrokenProcessPool
    return [(waiting.pop(future), rows) for future, rows in made]


def _alone(folder: Path, name: str) -> Rows:
    try:
        with processes(1) as pool:
            return pool.submit(rows_of, str(folder), name).result()
    except BrokenProcessPool:
        why = "the program was killed at this file, as where the computer's memory is too small for it"
        return [dict.fromkeys(COLUMNS) | {"file": name, "kind": UNREAD, "worth": False, "why": why}]


def states(paths: Sequence[Path]) -> dict[Path, list[Any]]:
    """What changes with each file: name, size and time of the files of its name, and the version of this program."""
    from tractexp import __version__

    beside: dict[Path, list[Path]] = defaultdict(list)  # by folder and stem: each folder is listed once
    for folder in {path.parent for path in paths}:
        for path in sorted(folder.iterdir()):
            beside[folder / path.stem].append(path)
    found: dict[Path, list[Any]] = {}
    for path in paths:
        there = [(p, p.stat()) for p in beside[path.parent / path.stem] if p.is_file()]
        found[path] = [__version__, *([p.name, told.st_size, told.st_mtime_ns] for p, told in there)]
    return found


def kept(journal: Path | None) -> dict[str, tuple[list[Any], Rows]]:
    """{file: (its state then, its rows)} of a journal; lines that were cut short are left out."""
    found: dict[str, tuple[list[Any], Rows]] = {}
    if journal is None or not journal.is_file():
        return found
    for line in journal.read_text(encoding="utf-8", errors="replace").splitlines():
        with contextlib.suppress(ValueError, KeyError, TypeError):
            told: Mapping[str, Any] = json.loads(line)
            found[told["file"]] = (told["state"], told["rows"])
    return found


@contextlib.contextmanager
def writing(journal: Path | None) -> Iterator[Callable[[str, list[Any], Rows], None]]:
    """Yield what keeps the rows of a file: a line each, so that what is killed loses what it was at, and no more."""
    if journal is None:
        yield lambda name, state, rows: None
        return
    with files.Growing(journal) as growing:

        def write(name: str, state: list[Any], rows: Rows) -> None:
            told = files.plain({"file": name, "state": state, "rows": rows})
            growing.add(json.dumps(told, ensure_ascii=False))

        yield write
