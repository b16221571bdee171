"""What writers must satisfy."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.record import Base, Record, find_reader, list_endings
from tractexp.recording import Channel, Recording, Segment, Writer
from tractexp.recording.reader import WaveformReader

T = np.arange(400) / 200
RECORD = Record(
    "dip",
    T,
    1 - 0.3 * ((T > 1) & (T < 1.2)),
    0.8 + 0.01 * np.sin(9 * T),
    0.3 + 0 * T,
    base=Base(27.5, 12.0),
)


def writes_a_record_that_is_read_again(cls: type[Writer]) -> None:
    """A record is written into the files returned, and a reader that takes them gives its numbers
    back.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = _write_files(
            cls, lambda: cls().record(RECORD, Path(folder, f"dip{cls.endings[0]}"))
        )
        if not files or files[0].suffix not in list_endings():
            return
        reader = find_reader(str(files[0]))
        if issubclass(reader, WaveformReader):
            return  # a format of waveforms, which holds U, P, Q as channels
        (again,) = (
            build("data", {"name": reader.name, **reader.build_settings(str(files[0]))})
            .read()
            .train
        )
        # a format that does not keep the base is read on that of the power before the dip
        ratio = {"U": 1.0, "P": 1.0, "Q": 1.0}
        if again.base is not None and again.base != RECORD.base:
            power = again.base.power / RECORD.base.power
            ratio = {"U": again.base.voltage / RECORD.base.voltage, "P": power, "Q": power}
        for name, values in RECORD.channels.items():
            off = np.abs(again.channels[name] * ratio.get(name, 1.0) - values).max()
            assert off < 1e-9, f"'{cls.name}' writes {name} that is read {off:.2g} off"


def writes_a_recording_that_is_read_again(cls: type[Writer]) -> None:
    """The channels of a written recording, by name, have the same values when read."""
    t = np.arange(800) / 4000
    names = ("Ua", "Ub", "Uc", "Ia", "Ib", "Ic")
    raw = [
        np.round(30000 * np.cos(2 * np.pi * (50 * t - k / 3))).astype(np.int16) for k in range(6)
    ]
    kinds = [("kV", "voltage")] * 3 + [("kA", "current")] * 3
    channels = [
        Channel(n, x, *kind, "ABC"[k % 3], gain=1e-3)
        for k, (n, x, kind) in enumerate(zip(names, raw, kinds, strict=True))
    ]
    whole = Recording("test", channels, [Segment(0, len(t), 4000.0, 0.0)])
    with tempfile.TemporaryDirectory() as folder:
        files = _write_files(
            cls, lambda: cls().recording(whole, Path(folder, f"all{cls.endings[0]}"))
        )
        if not files or files[0].suffix not in list_endings():
            return
        reader = find_reader(str(files[0]))
        assert issubclass(reader, WaveformReader), (
            f"'{cls.name}' writes a recording that '{reader.name}' takes for a table"
        )
        again = build(
            "data", {"name": reader.name, **reader.build_settings(str(files[0]))}
        ).recording()
        for one, other in zip(whole.channels, again.channels, strict=True):
            assert one.name == other.name, (
                f"'{cls.name}' writes channel {one.name}, which is read as {other.name}"
            )
            off = np.abs(one.values() - other.values()).max()
            assert off < 1e-9, f"'{cls.name}' writes channel {one.name} that is read {off:.2g} off"


def _write_files(cls: type[Writer], write: Callable[[], list[Path]]) -> list[Path]:
    """The files written, there and of its endings; [] where it refuses."""
    assert cls.endings, f"'{cls.name}' names no endings"
    try:
        files = write()
    except UserError:
        return []  # a format of one kind alone refuses the other
    for file in files:
        assert file.is_file(), f"'{cls.name}' names {file.name}, which is not there"
        assert file.suffix in cls.endings, (
            f"'{cls.name}' writes {file.name}, and its endings are {cls.endings}"
        )
    return files


CHECKS: tuple[Callable[..., None], ...] = (
    writes_a_record_that_is_read_again,
    writes_a_recording_that_is_read_again,
)
SUITE = (Writer, (), CHECKS)
