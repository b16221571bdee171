"""Events from files, frames and arrays, with their dips found."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex, overload

import numpy as np

from tractexp.api.arguments import Choice, check_kind, public
from tractexp.blocks import Report, Table
from tractexp.configuration.composition import list_choices
from tractexp.errors import UserError, list_allowed
from tractexp.outcome import Plain, Tabulated
from tractexp.record import (
    Base,
    Event,
    Record,
    Waves,
    Window,
    describe,
    detect,
    read_records,
    rebase_events,
)
from tractexp.record.angle import unwrap_angle
from tractexp.record.dips import view_dip
from tractexp.recording.event_views import find_settings
from tractexp.storage import files, time_limit
from tractexp.text.wording import count_noun

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tractexp.api.given import Records, Setting
    from tractexp.api.look import Look

REQUIRED, OPTIONAL = ("t", "U", "P", "Q"), ("f", "U2", "U_angle")
GROUP = "data"


class Dips(Plain, Tabulated, list[Event]):
    """Events in a list that prints as a table."""

    @overload
    def __getitem__(self, k: SupportsIndex, /) -> Event: ...

    @overload
    def __getitem__(self, k: slice, /) -> "Dips": ...

    def __getitem__(self, k: SupportsIndex | slice, /) -> "Event | Dips":
        """An event, or the dips of a slice."""
        return Dips(super().__getitem__(k)) if isinstance(k, slice) else super().__getitem__(k)

    def to_dict(self) -> list[dict[str, Any]]:  # type: ignore[override] # a list is saved as one
        """The records, as plain data that JSON knows."""
        return [record_to_dict(event.record) for event in self]

    @classmethod
    def from_dict(cls, content: Iterable[Mapping[str, Any]]) -> "Dips":  # type: ignore[override]
        """The records that `to_dict` gave; their dips are found again."""
        return cls(detect(record_from_dict(one)) for one in content)

    def look(self) -> "Look":
        """A look at the files that the events are from, and at the records that are from
        none.
        """
        from tractexp.api.look import look

        return look(*self)

    def table(self) -> Table:
        """One row for each event."""
        rows = [
            [
                e.record.name,
                e.t_start,
                f"{e.depth:.0%}",
                round(1000 * e.duration),
                round(e.rate),
                e.P0,
                e.Q0,
                "" if e.noise_share is None else f"{e.noise_share:.2%}",
                " ".join(e.record.channels),
            ]
            for e in self
        ]
        columns = [
            "event",
            "starts [s]",
            "depth",
            "lasts [ms]",
            "rate [Hz]",
            "P0 [pu]",
            "Q0 [pu]",
            "noise of P",
            "channels",
        ]
        return Table(columns, rows, count_noun(len(self), "dip"), words=(8,))

    def summary(self) -> Report:
        """The table, and what a reader or the detection found odd."""
        odd = [sentence.partition(". Note: ") for sentence in map(describe, self)]
        notes = [f"{e.record.name}: {o[2]}" for e, o in zip(self, odd, strict=True) if o[2]]
        return (
            Report()
            .add(self.table())
            .text(*notes, *(f"{e.record.name}: {n}" for e in self for n in e.record.notes))
        )


@public
def read(
    *sources: "Records",
    t: "ArrayLike | None" = None,
    U: "ArrayLike | None" = None,
    P: "ArrayLike | None" = None,
    Q: "ArrayLike | None" = None,
    f: "ArrayLike | None" = None,
    U2: "ArrayLike | None" = None,
    U_angle: "ArrayLike | None" = None,
    name: str | None = None,
    **settings: "Setting",
) -> Dips:
    """Read records of voltage dips, check them and find the dip in each.

    Parameters
    ----------
    *sources : path, frame, mapping, name or Record
        A table (columns t, U, P, Q and, where recorded, f, U2, U_angle), a COMTRADE file (.cfg) or
        another file that a reader takes, a pandas or polars frame or a mapping with those columns,
        or a shipped name ("tibet_50pct").
    t : (N,) [s]
        Arrays given directly: the times, evenly spaced.
    U, P, Q, U2 : (N,) [pu]
        Positive-sequence voltage, active and reactive power, negative-sequence voltage. Loads count
        P and Q as positive when consumed; P and Q may have gaps (nan).
    f : (N,) [Hz]
        The frequency.
    U_angle : (N,) [rad]
        Angle of the voltage in a frame that turns at nominal frequency, wrapped or not.
    name : str
        What the arrays are called.
    **settings
        Those of the reader: `base_voltage` [kV, line to line] and `base_power` [MVA] where a table
        is not per unit, `frequency` [Hz, nominal]; for COMTRADE `voltages` and `currents` (three
        channels each, names or numbers from 0), `train` (dips by number from 1), `reverse_current`,
        `skew`, `encoding`, `pre` and `post` [s].

    Returns
    -------
    Dips
        A list of events, each a record with its dip: `event.record` has the arrays, `event.depth`,
        `t_start`, `t_end`, `U0`, `P0`, `Q0` what was found. Of a COMTRADE file every dip that can
        be used, in order of time.

    Raises
    ------
    UserError
        For what is no record, holds no dip or has settings that its reader does not know; it names
        the file, the place and the value.

    Examples
    --------
    >>> import tractexp
    >>> (event,) = tractexp.read("tibet_50pct")
    >>> print(f"{event.depth:.2f} of {event.U0:.2f} pu")
    0.50 of 1.00 pu
    >>> event.record.P.shape == event.record.t.shape
    True
    """
    arrays = {"t": t, "U": U, "P": P, "Q": Q, "f": f, "U2": U2, "U_angle": U_angle}
    columns = {key: values for key, values in arrays.items() if values is not None}
    if name is not None and not columns:
        raise UserError(f"name={name} names arrays (t=, U=, P=, Q=), and none are given")
    if not (sources or columns):
        raise UserError("nothing to read: give a file, a frame, or the arrays t=, U=, P= and Q=")
    records = [record for source in sources for record in _read_records(source, settings)]
    records += [build_record(columns, name or "arrays", settings)] if columns else []
    names = [record.name for record in records]
    return Dips(detect(replace(r, name=r.where) if names.count(r.name) > 1 else r) for r in records)


def read_dips(argument: str, given: Any, least: int = 0) -> Dips:
    """The records of a call: events, or whatever `read` reads, one or a list of them."""
    listed = given if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    dips = Dips(e for one in listed for e in ([one] if isinstance(one, Event) else read(one)))
    if len(dips) < least:
        raise UserError(
            f"{argument} is empty; give at least one event, as tractexp.read gives them"
        )
    return dips


def read_dips_together(records: Any, validate: Any) -> tuple[Dips, Dips]:
    """Events fitted and held out, as `read_dips`, all on the base of the load in the first one."""
    train, held = read_dips("records", records, least=1), read_dips("validate", validate)
    events = rebase_events([view_dip(event) for event in (*train, *held)])
    return Dips(events[: len(train)]), Dips(events[len(train) :])


def build_record(columns: Mapping[str, Any], name: str, settings: Mapping[str, Any]) -> Record:
    """The checked record of columns (N,) each; further columns are left out with a note."""
    bases = {"base_voltage": None, "base_power": None, "frequency": None}
    for key, value in settings.items():
        if key not in bases:
            raise UserError(
                f"{key} is no setting of arrays and frames{list_allowed(key, bases, 'Settings')}"
            )
        check_kind(key, value, float | None)
        bases[key] = value
    if missing := [key for key in REQUIRED if key not in columns]:
        lack = f"{name}: {', '.join(missing)} missing; {', '.join(REQUIRED)} are needed"
        raise UserError(f"{lack}{list_allowed(missing[0], columns, 'Columns')}")
    spare = [str(key) for key in columns if key not in (*REQUIRED, *OPTIONAL)]
    notes = (f"columns not used: {', '.join(spare)}",) if spare else ()
    values = {
        key: _check_array(columns[key], f"{name}: {key}")
        for key in (*REQUIRED, *OPTIONAL)
        if key in columns
    }
    if "U_angle" in values:
        values["U_angle"] = unwrap_angle(values["U_angle"])
    base = Base(
        bases["base_voltage"] or 1.0, bases["base_power"] or 1.0, bases["frequency"] or 50.0
    )
    signals: Any = base.per_unit(values)
    return Record(name, base=base, notes=notes, **signals).uniform().check()


def _check_array(values: Any, where: str) -> np.ndarray:
    """Values as numbers. Raises `UserError` with the first that is none."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise UserError(
            f"{where} holds {_find_odd_value(values)}, which is no number; give numbers, nan for a"
            " gap"
        ) from error
    if array.ndim != 1:
        raise UserError(f"{where} has shape {array.shape}; one number per sample, (N,), is needed")
    return array


def _find_odd_value(values: Any) -> str:
    """The first value that is no number, and where it stands."""
    for k, value in enumerate(values if isinstance(values, Iterable) else [values]):
        try:
            float(value)
        except (TypeError, ValueError):
            return f"{value!r:.40} at sample {k + 1}"
    return f"a {type(values).__name__}"


def _read_records(source: Any, settings: Mapping[str, Any]) -> Iterator[Record]:
    """The records of a source. Raises `UserError` for what is none."""
    if isinstance(source, str | Path):
        yield from _read_file(str(source), settings)
    elif isinstance(source, Record | Event):
        if settings:
            raise UserError(
                f"{', '.join(settings)}: a record is taken as it is; leave the settings out"
            )
        yield source.record if isinstance(source, Event) else source
    elif isinstance(source, Mapping) or hasattr(source, "columns"):
        columns = {
            str(key): source[key]
            for key in (source if isinstance(source, Mapping) else source.columns)
        }
        yield build_record(columns, "frame", settings)
    else:
        kind = type(source).__name__
        raise UserError(
            f"a {kind} cannot be read; give a path, a frame, a mapping of columns, or t=, U=, P="
            " and Q="
        )


def _read_file(path: str, settings: Mapping[str, Any]) -> list[Record]:
    """The records of a file, by the reader its ending names, or of a choice of `conf/data`."""
    with time_limit.limit_time(path):
        read = read_records(choose_reader_node(path, settings))
    return [*read.train, *read.validate]


def choose_reader_node(path: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """The reader that a path, or a choice of `conf/data`, asks for, with its settings."""
    if not files.exists(path):
        shipped = list_choices(GROUP, files=True)
        if path in shipped:
            return {**Choice.from_argument(GROUP, path).node, **settings}
        if not Path(path).suffix:
            raise UserError(
                f"{path} is neither a file with an ending nor a shipped"
                f" record{list_allowed(path, shipped)}"
            )
    if not settings.get("join"):
        return {**find_settings(path), **settings}
    join = settings["join"]
    paths = [join] if isinstance(join, str | Path) else join
    if not isinstance(paths, Sequence):
        raise UserError(f"join={join!r:.60} must be a list of files of the same event as {path}")
    named = [*map(str, paths)]
    return {**find_settings(path, *named), **settings, "join": named}


def record_to_dict(record: Record) -> dict[str, Any]:
    """A record as plain data."""
    plain = {
        "base": asdict(record.base),
        "window": record.window and record.window.to_dict(),
        "more": {**record.more},
        "waves": record.waves and record.waves.to_dict(),
        "identity": {**record.identity},
        "given_base": record.original_base and asdict(record.original_base),
    }
    return {f.name: getattr(record, f.name) for f in fields(Record)} | plain


def record_from_dict(content: Mapping[str, Any]) -> Record:
    """The record of its plain data."""
    arrays: Any = {
        k: np.array(content[k], dtype=float)
        for k in (*REQUIRED, *OPTIONAL)
        if content.get(k) is not None
    }
    base, notes = Base(**content["base"]), tuple(content["notes"])
    original = Base(**content["given_base"]) if content.get("given_base") else None
    window = Window.from_content(content["window"]) if content.get("window") else None
    more = {name: np.array(values, dtype=float) for name, values in content.get("more", {}).items()}
    waves = Waves.from_content(content["waves"]) if content.get("waves") else None
    return Record(
        content["name"],
        base=base,
        source=content["source"],
        notes=notes,
        window=window,
        more=more,
        waves=waves,
        original_base=original,
        identity=content.get("identity", {}),
        digest=content.get("digest", ""),
        **arrays,
    )
