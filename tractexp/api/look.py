"""A file looked at without being told anything: what it holds, which loads it shows, what happened,
what to fit.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tractexp.api.arguments import public
from tractexp.api.joint_command import build_joint_command
from tractexp.api.listed import Listed
from tractexp.api.look_content import build_content
from tractexp.api.read import build_record, choose_reader_node, record_from_dict, record_to_dict
from tractexp.blocks import Report, Table
from tractexp.errors import UserError
from tractexp.outcome import Written
from tractexp.record import Event, Record
from tractexp.recording.event_views import join_event, propose_joining
from tractexp.recording.overview import View, overview_record, view_of
from tractexp.recording.sight import Sight
from tractexp.storage import files, time_limit
from tractexp.text.progress import Progress, tell_stages
from tractexp.text.wording import count_noun

if TYPE_CHECKING:
    import pandas

    from tractexp.api.given import Records, Setting


@dataclass(frozen=True, eq=False, repr=False)
class Look(Written):
    """The content of files: channels, loads, events. `content` is that of `look.json`; arrays are
    read again where a look was loaded.
    """

    kind = "look"
    page = "look.html"

    sources: Sequence[str | Record]
    settings: Mapping[str, Any]
    content: Mapping[str, Any]
    behind: Sequence[View] = ()  # none where it was loaded

    @functools.cached_property
    def views(self) -> list[View]:
        """Recordings, phasors and events behind the tables, one view a file."""
        return [*self.behind] or [_view(source, self.settings) for source in self.sources]

    @property
    def files(self) -> Listed:
        """One row for each file: station, start, rates, nominal and measured frequency, notes."""
        left_out = ("channels", "feeders", "segments")
        rows = [{k: v for k, v in f.items() if k not in left_out} for f in self.content["files"]]
        return Listed(rows, "files")

    @property
    def channels(self) -> Listed:
        """One row for each channel: number, name, phase, unit, primary magnitude, quality."""
        return Listed(
            [{"file": f["file"], **c} for f in self.content["files"] for c in f["channels"]],
            "channels",
        )

    @property
    def feeders(self) -> Listed:
        """One row for each load: its channels, voltage and power before anything happened, the
        command that fits.
        """
        rows = [
            {"file": file, **{k: v for k, v in load.items() if k != "events"}}
            for file, load in self._loads
        ]
        return Listed(rows, "loads")

    @property
    def events(self) -> Listed:
        """One row for each event of each load: kind, start, depth, duration, jump, U2, P and Q,
        worth, why.
        """
        rows = [
            {"file": file, "feeder": load["name"], **e}
            for file, load in self._loads
            for e in load["events"]
        ]
        return Listed(rows, "events")

    @property
    def commands(self) -> list[str]:
        """The commands that fit what is worth it, one for each load with such an event; then the
        one that fits the dips of one load in several files together.
        """
        joint = [self.content["joint"]["command"]] if "joint" in self.content else []
        return [load["command"] for _, load in self._loads if load["command"]] + joint

    @property
    def _loads(self) -> list[tuple[str, Mapping[str, Any]]]:
        """(file, load) of each load."""
        return [(f["file"], load) for f in self.content["files"] for load in f["feeders"]]

    def phasors(self, feeder: int = 0, file: int = 0) -> "pandas.DataFrame":
        """A frame of one load: t [s], f [Hz], U, U2 [kV, line to line], I1, I2 [kA], P [MW], Q
        [Mvar].

        Of a table that is a record: its columns, in the same units. Raises `UserError` where there
        is no such load.
        """
        import pandas

        return pandas.DataFrame(
            build_series(_pick_item(_pick_item(self.views, file, "file").sights, feeder, "load"))
        )

    def waveforms(self, file: int = 0) -> "pandas.DataFrame":
        """A frame of all channels of a file in primary values: t [s], then each channel [kV, kA,
        ...].

        Raises `UserError` for a file that holds no channels.
        """
        import pandas

        recording = _pick_item(self.views, file, "file").recording
        if recording is None:
            raise UserError(
                f"{self.content['files'][file]['file']} is a table of U, P and Q, without waveforms"
            )
        t = np.concatenate([s.t for s in recording.segments])
        names = [c.name for c in recording.channels]
        labels = [n if names.count(n) == 1 else f"{n} ({i})" for i, n in enumerate(names)]
        columns = {
            label: c.values()[: len(t)] for label, c in zip(labels, recording.channels, strict=True)
        }
        return pandas.DataFrame({"t": t, **columns})

    def table(self) -> Table:
        """Every event of every load."""
        from tractexp.report.look import list_event_cells

        columns = [
            "load",
            "dip",
            "kind",
            "starts [s]",
            "lasts [ms]",
            "depth",
            "jump [°]",
            "U2",
            "P",
            "Q",
            "fit it?",
        ]
        several = len(self.content["files"]) > 1
        rows = [
            [f"{file} {load['name']}" if several else load["name"], *list_event_cells(event)]
            for file, load in self._loads
            for event in load["events"]
        ]
        title = (
            f"{count_noun(len(rows), 'event')} in"
            f" {', '.join(f['file'] for f in self.content['files'])}"
        )
        return Table(columns, rows, title)

    def summary(self) -> Report:
        """Which load and dip to fit by which command, then a line for each file, bus and load."""
        from tractexp.report import look_console

        return look_console.build_summary(self.content)

    def screen(self) -> Report:
        """The summary with as many loads as one screen has room for."""
        from tractexp.report import look_console

        return look_console.build_screen(self.content)

    def build_full_report(self) -> Report:
        """Notes, channels, why the loads are such, all events and all commands."""
        from tractexp.report import look_console

        return look_console.build_full_report(self.content)

    everything = build_full_report  # its name in version 0.2

    def report(self) -> Report:
        """The page: loads, what happened, channels and their quality."""
        from tractexp.report import look

        return look.report(self.views, self.content)

    def to_dict(self) -> dict[str, Any]:
        """Sources, settings and content as plain data."""
        sources = [s if isinstance(s, str) else record_to_dict(s) for s in self.sources]
        return {"sources": sources, "settings": dict(self.settings), "content": dict(self.content)}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The look that `to_dict` gave."""
        sources = [s if isinstance(s, str) else record_from_dict(s) for s in content["sources"]]
        return cls(sources, content["settings"], content["content"])


@public
def look(*sources: "Records", progress: Progress = None, **settings: "Setting") -> Look:
    """Look at files without saying which channels they have: what they hold, which loads they show,
    what happened.

    Loads count P and Q as positive when consumed; voltages are primary kV line to line, depth, jump
    and U2 are those of `tractexp.recording.Happening`.

    Parameters
    ----------
    *sources : path, event, Record, frame or a list of these
        Any file that `tractexp.read` takes, or a frame with the columns t, U, P, Q.
    progress : None, False or callable
        None shows the stage where it takes long, False does not.
    **settings
        Those of the reader; where `voltages` and `currents` are given, that load is looked at
        instead of those proposed.

    Returns
    -------
    Look
        Tables `files`, `feeders`, `channels` and `events`, the `commands` that fit, and the arrays
        of `phasors(k)` and `waveforms(k)` of the k-th load.

    Raises
    ------
    UserError
        For what cannot be read; it names file, place and value.

    Examples
    --------
    >>> import tractexp
    >>> seen = tractexp.look(tractexp.read("tibet_50pct"), progress=False)
    >>> len(seen.events.rows)
    1
    """
    flat = [
        one
        for source in sources
        for one in (source if isinstance(source, list | tuple) else [source])
    ]
    if not flat:
        raise UserError("nothing to look at: give a file, e.g. look('station.cfg')")
    distinct = list(dict.fromkeys(map(_find_source, flat)))
    with tell_stages(progress) as stage:
        views, contents = [], []
        if together := _join_given(distinct, settings):
            distinct, settings = [together["path"]], {**settings, "join": together["join"]}
        for k, source in enumerate(distinct, start=1):
            count = f"{k} of {len(distinct)}: " if len(distinct) > 1 else ""
            name = source if isinstance(source, str) else source.name
            stage(f"reading {count}{name}")
            with time_limit.limit_time(name):
                views.append(_view(source, settings))
                stage("measuring the quality of the channels")
                contents.append(build_content(views[-1]))
    joint = None if settings else build_joint_command(views)
    content = {"files": contents} | ({"joint": joint} if joint else {})
    return Look(distinct, settings, files.make_plain(content), views)


def _find_source(given: Any) -> str | Record:
    """A path, or a record; an event of a file that is there stands for the file."""
    if isinstance(given, str | Path):
        return str(given)
    record: Any = given.record if isinstance(given, Event) else given
    if isinstance(record, Record):
        path = record.source.rpartition(" dip ")[0]
        return path if path and files.exists(path) else record
    if isinstance(record, Mapping) or hasattr(record, "columns"):
        names = record if isinstance(record, Mapping) else record.columns
        return build_record({str(name): record[name] for name in names}, "frame", {})
    raise UserError(
        f"a {type(given).__name__} cannot be looked at; give a path, an event, a record or a frame"
    )


def _join_given(
    sources: Sequence[str | Record], settings: Mapping[str, Any]
) -> dict[str, Any] | None:
    """How the files that were given are read as those of one event; None where they are not."""
    paths = [source for source in sources if isinstance(source, str)]
    alone = settings or len(paths) < len(sources) or any(map(files.is_archive, paths))
    if alone or not paths:
        return None
    with time_limit.limit_time(paths[0]):
        return join_event(paths)


def _view(source: str | Record, settings: Mapping[str, Any]) -> View:
    """The view of a source; of a file the reader is chosen by its content."""
    if isinstance(source, Record):
        return View(source.name, {}, [overview_record(source)])
    if settings.get("join"):
        return view_of(source, choose_reader_node(source, settings))
    try:
        view = view_of(source, choose_reader_node(source, settings))
    except UserError as error:
        if proposed := propose_joining(source):
            raise UserError(f"{error}; {proposed}") from None
        raise
    return (
        view if files.is_archive(source) else replace(view, proposed=propose_joining(source, view))
    )


def build_series(shown: Sight) -> dict[str, np.ndarray]:
    """Columns (M,) of one load: t [s], f [Hz], U, U2 [kV], P [MW], Q [Mvar] and, of channels, I1,
    I2 [kA].
    """
    if shown.record is not None:
        return shown.record.base.absolute(shown.record.channels)
    parts = [
        {
            "t": p.t,
            "f": p.f,
            "U": p.U,
            "U2": p.U2,
            "I1": np.abs(p.I1),
            "I2": np.abs(p.I2),
            "P": np.real(p.S),
            "Q": np.imag(p.S),
        }
        for p in shown.phasors
    ]
    return {
        name: np.concatenate([part[name] for part in parts]) for name in (parts[0] if parts else ())
    }


def _pick_item(items: Sequence[Any], k: int, what: str) -> Any:
    """The k-th item. Raises `UserError` with how many there are."""
    if not -len(items) <= k < len(items):
        raise UserError(f"there is no {what} {k}; there are {len(items)}, counted from 0")
    return items[k]
