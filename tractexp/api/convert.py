"""Records and recordings written in another format, with all that is known of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from tractexp import plugin
from tractexp.api.arguments import public
from tractexp.api.read import GROUP, node_of
from tractexp.errors import UserError, check_choice
from tractexp.outcome import Outcome, Table
from tractexp.record import Event, Reader, Record
from tractexp.recording import Recording, comtrade, tidy
from tractexp.recording.cut import cut
from tractexp.recording.reader import WaveformReader

ENDINGS = {"parquet": ".parquet", "csv": ".csv", "comtrade": ".cfg", "cff": ".cff"}
WHAT = ("recording", "events")
MARGIN = 0.1  # s of waveforms kept about a dip's record, for the windows of its first and last phasors


@dataclass(frozen=True, eq=False, repr=False)
class Converted(Outcome):
    """What was written: `files`, each table with its sidecar, each .cfg with its .dat; `said` is a sentence on each."""

    kind = "convert"

    files: Sequence[Path]
    said: Sequence[str]

    def table(self) -> Table:
        return Table([], [], f"{len(self.files)} files written", [*self.said, *map(str, self.files)])

    def to_dict(self) -> dict[str, Any]:
        return {"files": [str(path) for path in self.files], "said": list(self.said)}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        return cls([Path(path) for path in content["files"]], list(content["said"]))


@public
def convert(
    source: str | Path | Event | Record | Sequence[Any],
    to: str = "parquet",
    *,
    what: str | None = None,
    folder: str | Path = ".",
    **settings: Any,
) -> Converted:  # fmt: skip
    """Write a file that can be read, or events that were read, as Parquet, CSV or COMTRADE into `folder`.

    `to` is "parquet", "csv" (tables of a row per sample, with a sidecar in JSON that says everything else), "comtrade"
    (.cfg and .dat) or "cff". `what` is "recording", all channels of the file as they were recorded (the default, where
    the file holds waveforms), or "events", the record of each dip; for COMTRADE those are the waveforms about each dip,
    or U, P, Q in kV, MW, Mvar where there are none. `settings` are those of the reader, as for `tractexp.read`.

    Reading what was written gives the same: the bits of numbers, the integers of a recorder. Raises `UserError` for what cannot be read, and where the source would be overwritten.
    """
    if isinstance(source, str | Path):
        return converted(plugin.build(GROUP, node_of(str(source), settings)), to, what, Path(folder))
    if settings or what == "recording":
        raise UserError(
            f"{', '.join(settings) or 'what=recording'}: events are taken as they are; give the file to convert its recording"
        )
    given = list(source) if isinstance(source, Sequence) else [source]
    records = [one.record if isinstance(one, Event) else one for one in given]
    for one in records:
        if not isinstance(one, Record):
            raise UserError(
                f"a {type(one).__name__} cannot be converted; give a file, or events as tractexp.read gives"
            )
    check_choice("task.to", to, ENDINGS)
    return _written([(one.name, one) for one in records], to, Path(folder))


def converted(reader: Reader, to: str, what: str | None, folder: Path) -> Converted:
    """What a reader reads, written into a folder."""
    check_choice("task.to", to, ENDINGS)
    if what is not None:
        check_choice("task.what", what, WHAT)
    waves = isinstance(reader, WaveformReader)
    if what == "recording" and not waves:
        raise UserError("task.what=recording: the file holds U, P, Q, no recording of waveforms; use task.what=events")
    return _written(_parts(reader, to, what or ("recording" if waves else "events")), to, folder)


def _parts(reader: Any, to: str, what: str) -> list[tuple[str, Recording | Record]]:
    """What is to be written, by name."""
    if what == "recording":
        return [(Path(reader.path).stem, reader.recording())]
    read = reader.read()
    records = [*read.train, *read.validate]
    if isinstance(reader, WaveformReader) and to in ("comtrade", "cff"):
        whole = reader.recording()
        return [(one.name, cut(whole, one.t[0] - MARGIN, one.t[-1] + MARGIN)) for one in records]
    return [(one.name, one) for one in records]


def _written(parts: Sequence[tuple[str, Recording | Record]], to: str, folder: Path) -> Converted:
    names = tidy.unique(["".join("_" if c in '/\\:*?"<>|' else c for c in name) for name, _ in parts])
    files: list[Path] = []
    said: list[str] = []
    for name, (_, part) in zip(names, parts, strict=True):
        path = folder / f"{name}{ENDINGS[to]}"
        _check_source(path, part.source, to)
        files += _write(part, path, to)
        said.append(_said(part, path))
    return Converted(files, said)


def _write(part: Recording | Record, path: Path, to: str) -> list[Path]:
    if to in ("comtrade", "cff"):
        return comtrade.write(part if isinstance(part, Recording) else tidy.recording_of(part), path)
    return tidy.write_recording(part, path) if isinstance(part, Recording) else tidy.write_record(part, path)


def _check_source(path: Path, source: str, to: str) -> None:
    """Raise `UserError` where a file to be written is one that was read, or would be taken for its sidecar."""
    beside = ".dat" if to == "comtrade" else ".json"
    for own in _read_from(source):
        written = {path.resolve(), *([] if to == "cff" else [path.with_suffix(beside).resolve()])}
        taken = {own.resolve(), own.with_suffix(".dat" if own.suffix.lower() == ".cfg" else ".json").resolve()}
        if both := written & taken:
            raise UserError(f"{min(both).name} belongs to {own}, which is converted; give another folder")


def _read_from(source: str) -> Iterator[Path]:
    """The file that a source names: "long.csv", or "station.cfg dip 2"."""
    for text in (source, source.rpartition(" dip ")[0]):
        if text and Path(text).is_file():
            yield Path(text)


def _said(part: Recording | Record, path: Path) -> str:
    if isinstance(part, Record):
        return f"{path.name}: {part.samples} samples of {', '.join([*part.channels, *part.more])}"
    status = f" and {len(part.status)} status channels" if part.status else ""
    return f"{path.name}: {part.samples} samples of {len(part.channels)} channels{status}"
