"""A file looked at without being told anything: what it holds, which loads it shows, what happened,
what to fit.
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tractexp.api.arguments import public
from tractexp.api.read import node_of, record_from_dict, record_to_dict, table
from tractexp.blocks import Report, Table
from tractexp.configuration import plugin
from tractexp.configuration.overrides import build_typed_command
from tractexp.errors import UserError
from tractexp.outcome import Tabulated, Written
from tractexp.record import Event, Record
from tractexp.record.wave_event import COARSEST, describe_smearing
from tractexp.recording.event_views import join_event, propose_joining
from tractexp.recording.overview import LoadEvent, Sight, View, sight_of, view_of
from tractexp.recording.quality import describe_clipped
from tractexp.recording.railway import DIRECT, describe_direct_beside, direct_voltage
from tractexp.recording.recording import unit_of
from tractexp.recording.unrecognized import can_be_named, explain_unrecognized
from tractexp.storage import files
from tractexp.text.progress import Progress, tell_stages
from tractexp.text.wording import count_noun

if TYPE_CHECKING:
    import pandas

    from tractexp.api.given import Records, Setting

RACE = "model=auto"  # what a load of the field is made of nobody knows: structures are raced
NAME_THEM = "name the channels of one load: voltages=[...] currents=[...]"
# cycles that a fit of samples needs before the dip, and one that the estimator of phasors leaves
# out
EARLIER = 3.0


class Listed(Tabulated):
    """Rows with names, shown as a table and given as a frame or as the mappings they are."""

    def __init__(self, rows: Sequence[Mapping[str, Any]], title: str = ""):
        """Rows of one kind, {column: value} each."""
        self.rows, self.title = rows, title

    def __len__(self) -> int:
        """How many rows there are."""
        return len(self.rows)

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        """The rows."""
        return iter(self.rows)

    def table(self) -> Table:
        """The rows with a list in one cell as text."""
        columns = list(self.rows[0]) if self.rows else []
        return Table(
            columns, [[_cell(row[name]) for name in columns] for row in self.rows], self.title
        )

    def to_frame(self) -> "pandas.DataFrame":
        """The rows as a pandas frame; what is not known is nan."""
        import pandas

        frame = pandas.DataFrame(list(self.rows))
        unknown = [name for name in frame if all(row[name] is None for row in self.rows)]
        # what no row has is nan, as where some rows have it
        return frame.astype(dict.fromkeys(unknown, float))


def _cell(value: Any) -> Any:
    """A value as a cell shows it: the items of a list in a line."""
    return "; ".join(map(str, value)) if isinstance(value, list | tuple) else value


@dataclass(frozen=True, eq=False, repr=False)
class Look(Written):
    """What files hold. `content` is that of `look.json`; arrays are read again where a look was
    loaded.
    """

    kind = "look"
    page = "look.html"

    sources: Sequence[str | Record]
    settings: Mapping[str, Any]
    content: Mapping[str, Any]
    behind: Sequence[View] = ()  # none where it was loaded

    @functools.cached_property
    def views(self) -> list[View]:
        """What stands behind the tables: recordings, phasors, events."""
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
        """The commands that fit what is worth it, one for each load with such an event."""
        return [load["command"] for _, load in self._loads if load["command"]]

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
            series(_pick_item(_pick_item(self.views, file, "file").sights, feeder, "load"))
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
        from tractexp.report.look import event_row

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
            [f"{file} {load['name']}" if several else load["name"], *event_row(event)]
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

        return look_console.summary(self.content)

    def screen(self) -> Report:
        """The same with as many loads as one screen has room for."""
        from tractexp.report import look_console

        return look_console.screen(self.content)

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
    distinct = list(dict.fromkeys(map(_source, flat)))
    with tell_stages(progress) as stage:
        views, contents = [], []
        if together := _join_given(distinct, settings):
            distinct, settings = [together["path"]], {**settings, "join": together["join"]}
        for k, source in enumerate(distinct, start=1):
            count = f"{k} of {len(distinct)}: " if len(distinct) > 1 else ""
            name = source if isinstance(source, str) else source.name
            stage(f"reading {count}{name}")
            with files.limit_time(name):
                views.append(_view(source, settings))
                stage("measuring the quality of the channels")
                contents.append(_content(views[-1]))
    return Look(distinct, settings, files.plain({"files": contents}), views)


def _source(given: Any) -> str | Record:
    """A path, or a record; an event of a file that is there stands for the file."""
    if isinstance(given, str | Path):
        return str(given)
    record: Any = given.record if isinstance(given, Event) else given
    if isinstance(record, Record):
        path = record.source.rpartition(" dip ")[0]
        return path if path and files.exists(path) else record
    if isinstance(record, Mapping) or hasattr(record, "columns"):
        names = record if isinstance(record, Mapping) else record.columns
        return table({str(name): record[name] for name in names}, "frame", {})
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
    with files.limit_time(paths[0]):
        return join_event(paths)


def _view(source: str | Record, settings: Mapping[str, Any]) -> View:
    """What a source shows; of a file the reader is chosen by what it holds."""
    if isinstance(source, Record):
        return View(source.name, {}, [sight_of(source)])
    if settings.get("join"):
        return view_of(source, node_of(source, settings))
    try:
        view = view_of(source, node_of(source, settings))
    except UserError as error:
        if proposed := propose_joining(source):
            raise UserError(f"{error}; {proposed}") from None
        raise
    return (
        view if files.is_archive(source) else replace(view, proposed=propose_joining(source, view))
    )


def series(shown: Sight) -> dict[str, np.ndarray]:
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


def event_row(event: LoadEvent, begun: datetime | None = None) -> dict[str, Any]:
    """An event as plain data: times in s, powers in MW and Mvar, voltages as shares of that before.

    `begun` is the moment of t = 0: then `when` is that of the event's start.
    """
    what = event.what
    return {
        "kind": what.kind,
        "start": what.start,
        "when": begun and (begun + timedelta(seconds=what.start)).isoformat(),
        "end": what.end,
        "duration": what.end - what.start,
        "depth": what.depth,
        "jump": what.jump,
        "U2": what.U2,
        "P_before": what.before[0],
        "Q_before": what.before[1],
        "P_after": what.after[0],
        "Q_after": what.after[1],
        "dip": event.dip,
        "worth": event.worth,
        "why": event.why,
        "phases": list(what.phases),
        "exponents": [vars(each) for each in what.exponents],
    }


def _content(view: View) -> dict[str, Any]:
    """What `look.json` holds of a file."""
    recording = view.recording
    content: dict[str, Any] = {
        "file": view.source,
        "reader": view.node.get("name", ""),
        "joined": list(view.node.get("join", ())),
        "proposed": view.proposed,
    }
    if recording is None:
        record = view.sights[0].record
        assert record is not None
        content |= {
            "station": "",
            "device": "",
            "start": view.begun and view.begun.isoformat(),
            "frequency": record.base.frequency,
            "rates": [record.rate],
            "seconds": float(record.t[-1] - record.t[0]),
            "segments": [
                {"rate": record.rate, "start": float(record.t[0]), "samples": record.samples}
            ],
            "notes": [*record.notes, *filter(None, [view.proposed])],
            "channels": [],
        }
    else:
        last = recording.segments[-1]
        shown = any(each.feeder is None or each.feeder.currents for each in view.sights)
        lacks = "" if shown else explain_unrecognized(recording)
        named = not lacks or can_be_named(recording)
        remedy = f"; {NAME_THEM}" if lacks and named else ""
        content |= {
            "station": recording.station,
            "device": recording.device,
            "start": recording.start and recording.start.isoformat(),
            "frequency": recording.frequency,
            "rates": [s.rate for s in recording.segments],
            "seconds": last.start + (last.stop - last.first) / last.rate,
            "segments": [
                {"rate": s.rate, "start": s.start, "samples": s.stop - s.first}
                for s in recording.segments
            ],
            "notes": [
                *filter(None, [view.proposed]),
                *recording.notes,
                *([f"no load was recognised: {lacks}{remedy}"] if lacks else _tell_direct(view)),
            ],
            "channels": [_channel(view, number) for number in range(len(recording.channels))],
        }
        direct = bool(lacks and direct_voltage(recording))
        content |= {"lacks": lacks, "can_be_named": named, "direct": direct}
    content["measured_frequency"] = view.frequency
    return content | {"feeders": [_feeder(view, shown) for shown in view.sights]}


def _tell_direct(view: View) -> list[str]:
    """What is said of direct voltages beside a load's."""
    assert view.recording is not None
    steady = [
        number
        for number, channel in enumerate(view.quality)
        if not abs(channel.offset) <= DIRECT * channel.level
    ]
    return describe_direct_beside(view.recording, steady)


def _channel(view: View, number: int) -> dict[str, Any]:
    """A channel's row: name, unit, phase, quality."""
    assert view.recording is not None
    channel, fitness = view.recording.channels[number], view.quality[number]
    share = fitness.noise / fitness.level if fitness.level > 0 else None
    return {
        "number": number,
        "name": channel.name,
        "phase": channel.phase,
        "unit": channel.unit,
        "quantity": channel.quantity,
        "magnitude": fitness.level,
        "primary_unit": {"voltage": "kV", "current": "kA"}.get(
            unit_of(channel.unit)[0], channel.unit
        ),
        "noise_share": share,
        **asdict(fitness),
    }


def _feeder(view: View, shown: Sight) -> dict[str, Any]:
    """A load's row: its channels, power and what speaks for it."""
    feeder, powers = shown.feeder, view.powers(shown)
    names = [c.name for c in view.recording.channels] if view.recording else []
    row: dict[str, Any] = {
        "name": shown.name,
        "connection": "",
        "voltages": [],
        "currents": [],
        "channels": [],
        "reverse_current": False,
        "why": [],
        "loaded": True,
    }
    if feeder is not None:
        row |= {
            key: getattr(feeder, key)
            for key in ("voltages", "currents", "reverse_current", "why", "loaded")
        }
        row["connection"] = _name(feeder.connection)
        row["channels"] = [names[i] for i in (*feeder.voltages, *feeder.currents)]
    U, P, Q = powers if powers and not shown.secondary else (None, None, None)
    units = ("pu", "pu", "pu") if shown.per_unit else ("kV", "MW", "Mvar")
    return row | {
        "U": U,
        "P": P,
        "Q": Q,
        "units": units,
        **_sums(shown),
        "said": list(shown.said),
        "type_test": shown.type_test and shown.type_test.to_dict(),
        "unexamined": shown.unexamined,
        "dead_phases": shown.dead_phases,
        "secondary": shown.secondary,
        "clipped": _tell_clipped(view, shown),
        "command": command(view, shown),
        "events": [hide_secondary(event_row(event, view.begun), shown) for event in shown.events],
    }


def _tell_clipped(view: View, shown: Sight) -> str:
    """Which channels of a load stop at a limit, one clause; "" where none does."""
    if view.recording is None or shown.feeder is None:
        return ""
    numbers = (*shown.feeder.voltages, *shown.feeder.currents)
    return describe_clipped(view.recording, {k: view.quality[k].clipped for k in numbers})


def hide_secondary(row: dict[str, Any], shown: Sight) -> dict[str, Any]:
    """The row of an event, without powers where they are those of a transformer's secondary."""
    return (
        row | dict.fromkeys(("P_before", "Q_before", "P_after", "Q_after"))
        if shown.secondary
        else row
    )


def _name(connection: Any) -> str:
    """A connection's name."""
    return connection["name"] if isinstance(connection, Mapping) else str(connection)


def command(view: View, shown: Sight) -> str:
    """What is to be typed to fit the events of a load that are worth it; "" where none is."""
    choice = shown.choice()
    if choice is None or not view.node:
        return ""
    usual = {f.name: f for f in fields(plugin.get("data", view.node["name"]))}
    settings = {**view.node, **choice}
    text = build_typed_command(
        {
            key: value
            for key, value in settings.items()
            if key == "name" or not _is_usual(usual[key], value)
        }
    )
    raced = [RACE] if _is_from_field(shown) else []
    sampled = ["domain=waves"] if waves_serve(view, shown) else []
    return " ".join([text, *raced, *sampled])


def _is_from_field(shown: Sight) -> bool:
    """Whether the load that is fitted is one whose structure nobody knows: of kV and MW."""
    events = (each.event for each in shown.events if each.worth)
    return any(event is not None and event.record.is_from_field for event in events)


def waves_serve(view: View, shown: Sight) -> bool:
    """Whether the samples of the dip that is fitted first tell more than its phasors, and can be
    fitted.
    """
    first = next(
        (event.what for event in shown.events if event.worth and event.dip is not None), None
    )
    if view.recording is None or first is None:
        return False
    f = view.recording.frequency
    ends = [(s, s.start + (s.stop - s.first) / s.rate) for s in view.recording.waveforms()]
    there = next((s for s, end in ends if s.start <= first.start and first.end <= end), None)
    fine = (
        there is not None and there.rate >= COARSEST * f and first.start - there.start > EARLIER / f
    )
    return fine and bool(describe_smearing(first.end - first.start, first.U2 or 0.0, f))


def _is_usual(setting: Any, value: Any) -> bool:
    """Whether a value is what a setting (a dataclass field) is without it."""
    return value == (
        setting.default if setting.default is not MISSING else setting.default_factory()
    )


def _sums(shown: Sight) -> dict[str, Any]:
    """Kirchhoff: the sums of the three voltages and of the three currents, as shares of a phase's,
    at the beginning.
    """
    sums = {}
    for key in "VI":
        value = None
        if shown.phasors and len(shown.phasors[0].V) == 3:
            first = getattr(shown.phasors[0], key)[:, :50]
            scale = float(np.abs(first).mean())
            value = float(np.abs(first.sum(axis=0)).mean()) / scale if scale > 0 else None
        sums[f"sum_{key}"] = value
    return sums


def _pick_item(items: Sequence[Any], k: int, what: str) -> Any:
    """The k-th item. Raises `UserError` with how many there are."""
    if not -len(items) <= k < len(items):
        raise UserError(f"there is no {what} {k}; there are {len(items)}, counted from 0")
    return items[k]
