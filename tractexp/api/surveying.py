"""The rows of a survey: made of one file, in worker processes, and stored as they come."""

import contextlib
import functools
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.api.load_command import build_load_command
from tractexp.api.look import build_series
from tractexp.api.look_content import build_event_row, hide_secondary
from tractexp.cache.store import Store, compute_key
from tractexp.errors import UserError
from tractexp.process.workers import Workers
from tractexp.recording import archive
from tractexp.recording.event_views import list_within, propose_joining, shows_load
from tractexp.recording.overview import View
from tractexp.recording.sight import LoadEvent, Sight
from tractexp.report.look import describe_dead_phases
from tractexp.report.survey import QUIET, UNEXAMINED, UNREAD
from tractexp.storage import files, time_limit
from tractexp.text.progress import Progress, make_counter

Rows = list[dict[str, Any]]

COLUMNS = (
    "event",
    "file",
    "station",
    "load",
    "kind",
    "when",
    "start",
    "duration",
    "depth",
    "U2",
    "jump",
    "P_before",
    "Q_before",
    "P_after",
    "Q_after",
    "unit",
    "noise",
    "rate",
    "worth",
    "why",
    "command",
    "U_picture",
    "P_picture",
)
KILLED = "the program was killed at this file, as where the computer's memory is too small for it"
MOST_OWN_FILES = 2  # files that this process looks at sooner than others have started
UNRECOGNISED = "no voltages and currents of one load were recognised"
PICTURE_POINTS = 48  # of a small picture
AROUND = (0.1, 0.3)  # s before and after an event in its picture
FEWEST_DIPS = 2  # of a load that a station fits
LONGEST_PICTURED_EVENT = 5.0  # s of an event there


def build_rows(folder: str, file: str) -> Rows:
    """The rows of one file, `file` being its path within the folder. Nothing that happens in here
    is an error.
    """
    try:
        with time_limit.limit_time(Path(folder, file)):
            within = list_within(Path(folder, file))
        return [
            row
            for path in within
            for row in _build_rows_of_file(folder, path.relative_to(folder).as_posix())
        ]
    except UserError as error:
        return [_make_blank_row(file) | {"kind": UNREAD, "why": str(error)}]


def _add_proposal(rows: Rows, path: Path) -> Rows:
    """The rows of a file without a load, with what says that files beside it are of its event."""
    proposed = propose_joining(str(path))
    why = (filter(None, (row["why"], proposed)) for row in rows)
    return [{**row, "why": "; ".join(said)} for row, said in zip(rows, why, strict=True)]


def _make_blank_row(file: str) -> dict[str, Any]:
    """A row of a file of which nothing is known."""
    return dict.fromkeys(COLUMNS) | {"file": file, "worth": False, "why": ""}


def _build_rows_of_file(folder: str, file: str) -> Rows:
    """The rows of one file that is no .zip, or of a .zip that holds the files of one event."""
    row, path = _make_blank_row(file), Path(folder, file)
    try:
        with time_limit.limit_time(path):
            return _build_rows_of_view(row, path)
    except UserError as error:
        return [row | {"kind": UNREAD, "why": str(error)}]
    except Exception as error:  # a survey of thousands of files does not end with one of them
        why = (
            f"the program failed at this file, which is its mistake: {type(error).__name__}:"
            f" {error}"
        )
        return [row | {"kind": UNREAD, "why": why}]


def _build_rows_of_view(row: dict[str, Any], path: Path) -> Rows:
    """The rows of a file, each with what stands in `row`."""
    try:
        view = archive.look_at_file(path)
    except UserError as error:
        return _add_proposal([row | {"kind": UNREAD, "why": str(error)}], path)
    rows = [
        row | _build_event_row(view, row["file"], number, shown, event)
        for number, shown in enumerate(view.sights, 1)
        for event in shown.events
    ]
    rows = rows or [row | _list_common(view) | _describe_file_without_events(view)]
    return files.make_plain(rows if shows_load(view) else _add_proposal(rows, path))


def _describe_file_without_events(view: View) -> dict[str, str]:
    """The row of a file without events: that nothing happened, or why nobody can say."""
    unexamined = list(dict.fromkeys(shown.unexamined for shown in view.sights if shown.unexamined))
    if not view.sights or (
        len(unexamined) and all(shown.unexamined or not shown.is_loaded for shown in view.sights)
    ):
        return {"kind": UNEXAMINED, "why": "; ".join(unexamined) or UNRECOGNISED}
    return {"kind": QUIET, "why": _explain_no_event(view)}


def _explain_no_event(view: View) -> str:
    """The reason why a file shows no event, a sentence."""
    said = [*(said for s in view.sights for said in s.said), *_find_dead_phases(view)]
    return "; ".join(dict.fromkeys(said)) or "the voltage stays as it is"


def _find_dead_phases(view: View) -> list[str]:
    """The phases without voltage, in words."""
    return [*filter(None, (describe_dead_phases(s.dead_phases) for s in view.sights))]


def _list_common(view: View) -> dict[str, Any]:
    """The cells that all rows of a file share: station, rate, begin."""
    recording = view.recording
    if recording is None:
        return {
            "station": "",
            "rate": view.sights[0].record.rate if view.sights and view.sights[0].record else None,
        }
    return {"station": recording.station, "rate": max(s.rate for s in recording.segments)}


def _build_event_row(
    view: View, file: str, number: int, shown: Sight, seen: LoadEvent
) -> dict[str, Any]:
    """The row of an event."""
    fields = hide_secondary(build_event_row(seen, view.begun), shown)
    event = seen.event
    return {
        **_list_common(view),
        **{key: value for key, value in fields.items() if key in COLUMNS},
        "event": archive.name_event(file, number, seen),
        "load": shown.name,
        "unit": "secondary" if shown.secondary else "pu" if shown.per_unit else "MW",
        "noise": event and event.noise_share,
        "command": build_load_command(view, shown) if seen.worth else "",
        **_draw_pictures(shown, seen),
    }


def _draw_pictures(shown: Sight, event: LoadEvent) -> dict[str, list[float | None]]:
    """U and P about an event, as shares of the greatest in the picture, few points each."""
    columns = build_series(shown)
    t, what = columns["t"], event.what
    first, stop = np.searchsorted(
        t, [what.start - AROUND[0], min(what.end, what.start + LONGEST_PICTURED_EVENT) + AROUND[1]]
    )
    return {f"{name}_picture": _thin_values(columns[name][first:stop]) for name in ("U", "P")}


def _thin_values(values: np.ndarray) -> list[float | None]:
    """At most `POINTS` values (n,), the lowest and the highest of each stretch, as shares of the
    greatest size.
    """
    if len(values) > PICTURE_POINTS:
        parts = np.array_split(values, PICTURE_POINTS // 2)
        ends = [sorted((int(np.argmin(p)), int(np.argmax(p)))) for p in parts]
        values = np.array([p[k] for p, pair in zip(parts, ends, strict=True) for k in pair])
    finite = values[np.isfinite(values)]
    size = float(np.abs(finite).max()) if len(finite) else 0.0
    return [round(float(v) / size, 3) if size and np.isfinite(v) else None for v in values]


def look_at_files(folder: Path, names: Sequence[str], cores: int) -> Iterator[tuple[str, Rows]]:
    """(file, its rows) of files within a folder, as they are done, on so many processes (-1: one
    for each core).

    A file at which a process is killed is looked at again by itself; if that one is killed too, its
    row says so.
    """
    workers = Workers(cores if len(names) > MOST_OWN_FILES else 1)
    with contextlib.closing(
        workers.results(functools.partial(build_rows, str(folder)), names)
    ) as results:
        for name, rows in results:
            yield (
                name,
                rows
                or [
                    dict.fromkeys(COLUMNS)
                    | {"file": name, "kind": UNREAD, "worth": False, "why": KILLED}
                ],
            )


def complete_entries(
    kind: str,
    keep: Path | None,
    own: Mapping[str, str],
    compute: Callable[[list[str]], Iterable[tuple[str, Any]]],
    what: str,
    progress: Progress,
    restore: Callable[[Any], Any] | None = None,
) -> tuple[dict[str, Any], int]:
    """The entry of each file, stored as it is computed, and how many were computed: those that
    `keep` has are read.

    Parameters
    ----------
    kind : str
        Of the entries.
    keep : Path
        The folder where they are kept; None keeps nothing.
    own : {file: key}
        The files that are wanted, and the keys of their entries.
    compute : callable
        Of a list of files (file, entry) as they are done.
    what : str
        Is counted while they are.
    progress : None, False or callable
        None shows how many are done, False does not.
    restore : callable
        What is held in memory of an entry, which is plain data; None: the entry.

    Returns
    -------
    ({file: entry} in the order of `own`, how many were computed)
    """
    store = Store(kind, folder=keep or Path())
    names = own if keep else dict.fromkeys(own, "")
    hold = restore or (lambda entry: entry)
    found = dict[str, Any]()
    for file, name in names.items():
        if (entry := store.read_json(name)) is not None:
            found[file] = hold(entry)
    fresh = [file for file in own if file not in found]
    with make_counter(what, progress)(len(fresh)) as count:
        for file, computed in compute(fresh):
            entry = files.make_plain(computed)
            store.write_json(names[file], entry)
            found[file] = hold(entry)
            count()
    return {file: found[file] for file in own}, len(fresh)


def compute_keys(folder: Path, paths: Sequence[Path]) -> dict[str, str]:
    """{file within the folder: key of its rows}: name, size and time of the files of its name, and
    this program.
    """
    from tractexp import __version__

    # by folder and stem: each folder is listed once
    beside: dict[Path, list[Path]] = defaultdict(list)
    for place in {path.parent for path in paths}:
        for path in files.list_folder(place):
            beside[place / path.stem].append(path)
    names = {path: path.relative_to(folder).as_posix() for path in paths}
    return {
        names[path]: compute_key(
            __version__, names[path], _read_states(beside[path.parent / path.stem])
        )
        for path in paths
    }


def name_load(row: Mapping[str, Any], folder: Path) -> tuple[str, str]:
    """Station and load of a row. A table names neither: those of one folder are of one load."""
    file = Path(row["file"])
    if row["load"] != file.stem:
        return row["station"] or "", row["load"] or ""
    return row["station"] or "", (Path(folder.resolve().name) / file.parent).as_posix()


def _read_states(paths: Sequence[Path]) -> list[Any]:
    """Size and time of change of each file that is there."""
    return [[path.name, *files.read_state(path)] for path in paths if files.exists(path)]
