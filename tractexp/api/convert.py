"""Records and recordings written in another format, with all that is known of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.arguments import public
from tractexp.api.job import Job
from tractexp.api.read import GROUP, choose_reader_node
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.blocks.terminal import show
from tractexp.configuration.plugin import build, discover, plugin
from tractexp.errors import TASK, UserError, check_choice
from tractexp.filetypes.tidy import make_unique
from tractexp.outcome import Tabulated
from tractexp.record import Event, Reader, Record
from tractexp.recording import Recording, Writer
from tractexp.recording.cut import cut_recording
from tractexp.recording.reader import WaveformReader
from tractexp.storage.time_limit import limit_time
from tractexp.text.progress import build_console

if TYPE_CHECKING:
    from tractexp.api.given import Records, Setting

WHAT = ("recording", "events")
# s of waveforms kept about a dip's record, for the windows of its first and last phasors
DIP_MARGIN = 0.1
Part = tuple[str, Recording | Record]  # what is written, and its name


@dataclass(frozen=True, eq=False, repr=False)
class Converted(Tabulated):
    """The `files` that were written, each table with its sidecar, each .cfg with its .dat; `said`
    is a sentence on each.
    """

    files: Sequence[Path]
    said: Sequence[str]

    def table(self) -> Table:
        """The files."""
        return Table(["file"], [[str(path)] for path in self.files])

    def summary(self) -> Report:
        """A sentence on each file."""
        return Report().text(*self.said).items([str(path) for path in self.files])


@public
def convert(
    *sources: "Records",
    to: str | None = None,
    what: str | None = None,
    folder: str | Path = ".",
    **settings: "Setting",
) -> Converted:
    """Write files that can be read, or events that were read, as Parquet, CSV or COMTRADE.

    Reading what was written gives the same: the bits of numbers, the integers of a recorder.

    Parameters
    ----------
    *sources : paths or events
        Whatever `tractexp.read` takes.
    to : name
        "parquet" (the default), "csv" (tables of a row per sample, with a sidecar in JSON that says
        everything else), "comtrade" (.cfg and .dat), "cff" or the name of a plugin.
    what : "recording" or "events"
        "recording" is all channels of a file as they were recorded (the default, where it holds
        waveforms), "events" the record of each dip; for COMTRADE those are the waveforms about each
        dip, or U, P, Q in kV, MW, Mvar where there are none.
    folder : path
        Where the files go.
    **settings
        Those of the reader, as for `tractexp.read`.

    Returns
    -------
    Converted
        A table of the files, and what each holds.

    Raises
    ------
    UserError
        For what cannot be read, and where a source would be overwritten.

    Examples
    --------
    >>> import tempfile, tractexp
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = tractexp.convert(*tractexp.read("tibet_50pct"), to="csv", folder=folder)
    ...     (again,) = tractexp.read(f"{folder}/tibet_50pct.csv")
    >>> bool((again.record.P == tractexp.read("tibet_50pct")[0].record.P).all())
    True
    """
    if not sources:
        raise UserError("nothing to read: give a file, or events as tractexp.read gives them")
    writer = find_writer(to)
    parts = [part for source in sources for part in _cut_parts(source, writer, what, settings)]
    return write_parts(parts, writer, Path(folder))


def find_writer(to: str | None) -> Writer:
    """The writer of that name, or the usual one."""
    writers = discover()["writer"]
    return build(
        "writer",
        {"name": to or next(name for name, cls in writers.items() if getattr(cls, "usual", False))},
    )


def read_parts(reader: Any, writer: Writer, what: str | None) -> list[Part]:
    """The records or recordings that a reader reads, by the names they are written under."""
    if what is not None:
        check_choice("task.what", what, WHAT)
    waves = isinstance(reader, WaveformReader)
    if what == WHAT[0] and not waves:
        raise UserError(
            f"{TASK.what}=recording: the file holds U, P, Q, no recording of waveforms; use"
            f" {TASK.what}=events"
        )
    if waves and what in (None, WHAT[0]):
        return [(Path(reader.path).stem, reader.recording())]
    read = reader.read()
    records = [*read.train, *read.validate]
    if waves and writer.waves:
        whole = reader.recording()
        return [
            (one.name, cut_recording(whole, one.t[0] - DIP_MARGIN, one.t[-1] + DIP_MARGIN))
            for one in records
        ]
    return [(one.name, one) for one in records]


def write_parts(parts: Sequence[Part], writer: Writer, folder: Path) -> Converted:
    """Write everything into a folder; raises `UserError` before anything is written over what was
    read.
    """
    names = make_unique(
        ["".join("_" if c in '/\\:*?"<>|' else c for c in name) for name, _ in parts]
    )
    paths = [folder / f"{name}{writer.endings[0]}" for name in names]
    for path, (_, part) in zip(paths, parts, strict=True):
        _check_source(path, part.source, writer)
    files: list[Path] = []
    for path, (_, part) in zip(paths, parts, strict=True):
        files += (
            writer.recording(part, path)
            if isinstance(part, Recording)
            else writer.record(part, path)
        )
    return Converted(
        files,
        [_describe_written_part(part, path) for path, (_, part) in zip(paths, parts, strict=True)],
    )


def _cut_parts(
    source: Any, writer: Writer, what: str | None, settings: dict[str, Any]
) -> list[Part]:
    """A file, an event, or a list of such, cut into what is written to a file of its own."""
    if isinstance(source, str | Path):
        with limit_time(source):
            reader: Reader = build(GROUP, choose_reader_node(str(source), settings))
            return read_parts(reader, writer, what)
    if isinstance(source, Sequence):
        return [part for one in source for part in _cut_parts(one, writer, what, settings)]
    if not isinstance(source, Record | Event):
        kind = type(source).__name__
        raise UserError(
            f"a value of type {kind} cannot be converted; give a file, or events as tractexp.read"
            " gives"
        )
    if settings or what == WHAT[0]:
        reason = ", ".join(settings) or f"{TASK.what}=recording"
        raise UserError(
            f"{reason}: events are taken as they are; give the file, whose recording or settings"
            " are meant"
        )
    record = source.record if isinstance(source, Event) else source
    return [(record.name, record)]


def _check_source(path: Path, source: str, writer: Writer) -> None:
    """Raise `UserError` where a file to be written is one that was read, or would be taken for its
    sidecar.
    """
    for own in _read_from(source):
        files = {path.with_suffix(ending).resolve() for ending in writer.endings}
        taken = {
            own.resolve(),
            own.with_suffix(".dat" if own.suffix.lower() == ".cfg" else ".json").resolve(),
        }
        if both := files & taken:
            raise UserError(
                f"{min(both).name} belongs to {own}, which is converted; give another folder"
            )


def _read_from(source: str) -> Iterator[Path]:
    """The file that a source names: "long.csv", or "station.cfg dip 2"."""
    for text in (source, source.rpartition(" dip ")[0]):
        if text and Path(text).is_file():
            yield Path(text)


def _describe_written_part(part: Recording | Record, path: Path) -> str:
    """ "dip1.csv: 1000 samples of U, P, Q"."""
    if isinstance(part, Record):
        return f"{path.name}: {part.samples} samples of {', '.join([*part.channels, *part.more])}"
    status = f" and {len(part.status)} status channels" if part.status else ""
    return f"{path.name}: {part.samples} samples of {len(part.channels)} channels{status}"


@plugin
class Convert(Task, call=convert, given=("sources", "folder", "settings")):
    """Write what was read as Parquet, CSV or COMTRADE: the whole recording, or the record of each
    dip.
    """

    reads = ("data",)
    leaves_alone = ("model",)
    instead = {"model": "a conversion has no model"}

    # parquet (where none is named), csv (both with a sidecar in JSON), comtrade (.cfg and .dat),
    # cff
    to: str = ""
    # recording or events; null: the recording, where the file holds waveforms
    what: str | None = None

    def run(self, job: Job) -> None:
        """Write the files into the run's folder, and print what each holds."""
        writer = find_writer(self.to)
        parts = read_parts(build("data", job.config["data"]), writer, self.what)
        show(write_parts(parts, writer, job.folder).summary(), build_console())
