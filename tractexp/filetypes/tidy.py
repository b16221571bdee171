"""Recordings and records as tidy tables: a column for each quantity, a row for each sample, and a
sidecar in JSON.

    dip.csv   t,U,P,Q,f
    dip.json  {"name": ..., "base": {...}, "units": {...}, "source": ..., "notes": [...]}
    rec.csv   t,UA,UB,UC,IA,...
    rec.json  {"recording": {"channels": [{"name": "UA", "phase": "A", "ratio": ...}]}}

The values of a channel are as recorded, gain and offset applied, in the unit of the file; `ratio`
takes them to the primary side. Reading them back gives the same raw numbers, bit by bit.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes.table import TableForm, open_table
from tractexp.record.record import Record
from tractexp.recording.recording import Channel, Recording, Segment, StatusChannel
from tractexp.storage import files
from tractexp.text import quoting

UNITS = {"t": "s", "U": "pu", "P": "pu", "Q": "pu", "f": "Hz"}  # as data.units; U2 is as U


def write_record(record: Record, path: Path) -> list[Path]:
    """Write a record as a table, by the ending of `path`, and its sidecar; raises `UserError` where
    it cannot.
    """
    content = {
        "name": record.name,
        "source": record.source,
        "base": asdict(record.base),
        "units": {name: unit for name, unit in UNITS.items() if name in record.channels},
        "notes": list(record.notes),
        "uniform": True,
        "window": record.window and record.window.to_dict(),
        "more": list(record.more),
    }
    return [
        _write_columns({**record.channels, **record.more}, path),
        files.write_json(path.with_suffix(".json"), content),
    ]


def write_recording(recording: Recording, path: Path) -> list[Path]:
    """Write a recording as a table, by the ending of `path`, and its sidecar; raises `UserError`
    where it cannot.
    """
    t = np.full(recording.samples, np.nan)
    for segment in recording.segments:
        t[segment.first : segment.stop] = segment.t
    named = make_unique(["t", *(c.name.strip() for c in (*recording.channels, *recording.status))])
    values = [
        t,
        *map(_read_raw_values, recording.channels),
        *(s.values() for s in recording.status),
    ]
    table = _write_columns(dict(zip(named, values, strict=True)), path)
    content = {"source": recording.source, "recording": _describe_recording(recording)}
    return [table, files.write_json(path.with_suffix(".json"), content)]


def make_unique(names: Sequence[str]) -> list[str]:
    """The names, with a number behind those that would occur twice; "unnamed" for none."""
    result: list[str] = []
    for name in names:
        stem, k = name or "unnamed", 2
        name = stem
        while name in result:
            name, k = f"{stem} ({k})", k + 1
        result.append(name)
    return result


def restore_recording(path: str, content: Mapping[str, Any]) -> Recording:
    """The recording of a table that `write_recording` wrote, from its sidecar; raises `UserError`
    where they differ.
    """
    table = open_table(path, TableForm())
    try:
        channels, status = content["channels"], content["status"]
        if len(table.heading.names) != 1 + len(channels) + len(status):
            raise UserError(
                f"{path}: has {len(table.heading.names)} columns where its sidecar names t,"
                f" {len(channels)} channels and {len(status)} status channels; convert the"
                " recording again, or remove the sidecar"
            )
        cells = table.read({k: "gaps" for k in range(1, len(table.heading.names))})
        segments = [Segment(**one) for one in content["segments"]]
        _check_segments(path, segments, len(cells[1].values))
        return Recording(
            path,
            [_build_channel(one, cells[k].values) for k, one in enumerate(channels, 1)],
            segments,
            float(content["frequency"]),
            content["station"],
            content["device"],
            datetime.fromisoformat(content["start"]) if content["start"] else None,
            content["trigger"],
            [
                StatusChannel(**one, raw=(cells[k].values == 1).astype(np.int8))
                for k, one in enumerate(status, 1 + len(channels))
            ],
            list(content["notes"]),
            {key: _convert_extra(value) for key, value in content["extra"].items()},
            tuple(content.get("triggers", ())),  # which earlier versions did not write
        )
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise UserError(
            f"{path}: its sidecar is not as task=convert writes it; remove it, or convert again"
        ) from error


def _check_segments(path: str, segments: Sequence[Segment], rows: int) -> None:
    """Raise `UserError` where segments are not those of a table with so many rows."""
    edges = [0]
    for one in segments:
        if not (
            edges[-1] <= one.first < one.stop <= rows
            and 0 < one.rate < np.inf
            and np.isfinite(one.start)
        ):
            raise UserError(
                f"{path}: has {rows} rows, and its sidecar of samples {one.first} to {one.stop} at"
                f" {one.rate} Hz; convert the recording again, or remove the sidecar"
            )
        edges.append(one.stop)
    if len(edges) == 1:
        raise UserError(
            f"{path}: its sidecar names no segment of samples; convert the recording again"
        )


def _convert_extra(value: Any) -> Any:
    """A stored array as an array, any other value unchanged."""
    marked = isinstance(value, dict) and set(value) == {"array", "type"}
    return np.array(value["array"], dtype=value["type"]) if marked else value


def convert_record(record: Record) -> Recording:
    """A record as a recording of magnitudes in kV (line to line), MW, Mvar and Hz, for formats that
    know no other.
    """
    base = record.base
    quantities = {
        "U": ("kV", "voltage"),
        "P": ("MW", "power"),
        "Q": ("Mvar", "reactive_power"),
        "f": ("Hz", "frequency"),
        "U2": ("kV", "voltage"),
    }
    channels = [
        Channel(name, values, *quantities[name], form="value")
        for name, values in base.absolute(record.channels).items()
        if name != "t"
    ]
    segment = Segment(0, record.samples, record.rate, 0.0)
    return Recording(record.where, channels, [segment], base.frequency, notes=list(record.notes))


def _read_raw_values(channel: Channel) -> np.ndarray:
    """The values (N,) of a channel as recorded: those of its converter, gain and offset applied;
    nan for none.
    """
    if channel.gain == 1 and channel.offset == 0 and channel.missing is None:
        return np.asarray(channel.raw)
    return channel.read_values()


def _describe_recording(recording: Recording) -> dict[str, Any]:
    """A recording without its samples, for the sidecar."""
    fields = (
        "name",
        "unit",
        "quantity",
        "phase",
        "circuit",
        "gain",
        "offset",
        "ratio",
        "skew",
        "missing",
        "form",
    )
    return {
        "channels": [
            {name: getattr(c, name) for name in fields}
            | {"limits": c.limits and list(c.limits), "raw": np.asarray(c.raw).dtype.str}
            for c in recording.channels
        ],
        "status": [
            {"name": s.name, "phase": s.phase, "circuit": s.circuit, "normal": s.normal}
            for s in recording.status
        ],
        "segments": [asdict(segment) for segment in recording.segments],
        "frequency": recording.frequency,
        "station": recording.station,
        "device": recording.device,
        "start": recording.start.isoformat() if recording.start else None,
        "trigger": recording.trigger,
        "triggers": list(recording.triggers),
        "notes": list(recording.notes),
        "extra": {
            key: {"array": value.tolist(), "type": value.dtype.str}
            if isinstance(value, np.ndarray)
            else value
            for key, value in recording.extra.items()
        },
    }


def _build_channel(content: Mapping[str, Any], values: np.ndarray) -> Channel:
    """A channel with the raw numbers that its converter gave."""
    fields = dict(content)
    kind, limits = np.dtype(fields.pop("raw")), fields.pop("limits")
    raw = (
        values
        if fields["gain"] == 1 and fields["offset"] == 0
        else (values - fields["offset"]) / fields["gain"]
    )
    if kind.kind in "iu":
        missing = fields["missing"]
        raw = np.where(np.isnan(raw), 0 if missing is None else missing, np.rint(raw))
        if not (np.iinfo(kind).min <= raw.min() and raw.max() <= np.iinfo(kind).max):
            raise ValueError(f"{content['name']} leaves the range of its converter")
    return Channel(raw=raw.astype(kind), limits=limits and (limits[0], limits[1]), **fields)


def _write_columns(columns: Mapping[str, np.ndarray], path: Path) -> Path:
    """Write columns of numbers; the digits of CSV are those that give the same bits."""
    import pyarrow
    from pyarrow import csv as arrow
    from pyarrow import parquet

    table = pyarrow.table({name: np.ascontiguousarray(values) for name, values in columns.items()})
    out = io.BytesIO()
    if path.suffix == ".parquet":
        parquet.write_table(table, out)
    else:
        header = io.StringIO()
        csv.writer(header, lineterminator="\n").writerow(map(quoting.cell, columns))
        out.write(header.getvalue().encode())
        arrow.write_csv(table, out, arrow.WriteOptions(include_header=False))
    return files.write(path, out.getvalue())
