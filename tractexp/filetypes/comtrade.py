"""COMTRADE records (IEEE C37.111-1991, -1999, -2013): .cfg with .dat, or both in one .cff, read and
written.

Read here and not by a library: the samples stay views of the file in the type they have there, no
time is computed per sample, and errors name file, line, channel and value.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import DATA, UserError, suggest_nearest
from tractexp.filetypes import timeline
from tractexp.filetypes.comtrade_header import parse
from tractexp.filetypes.comtrade_lines import Analog, Header
from tractexp.filetypes.comtrade_samples import NONE, ByteRange, Samples, read
from tractexp.filetypes.comtrade_writer import write as write
from tractexp.filetypes.remarks import Remarks
from tractexp.filetypes.text import decode, split_lines
from tractexp.filetypes.timeline import SampleStretch
from tractexp.recording.recording import Channel, Recording, StatusChannel, find_quantity
from tractexp.storage import files

LARGEST_CFG = 4 * 2**20  # bytes: fifty thousand channels
FIRST_WITH_RATIO = 1999  # revision of the standard whose files say primary or secondary
MISSING = {"BINARY": -32768.0, "BINARY32": -2147483648.0}  # raw values that stand for none
MISSING_TEXT = (99999.0, 999999.0)  # of 1999 and of 1991
_SECTION = re.compile(
    rb"^-+[ \t]*file[ \t]*type\b[ \t]*:?[ \t]*(\w+)[ \t]*((?:[a-z]\w*)?)[ \t]*:?[ \t]*(\d+)?[ \t]*"
    rb"(?:-+[ \t]*\r?\n?|\r?(?:\n|\Z))",
    re.I | re.M,
)


def load(path: Path, encoding: str | None = None) -> Recording:
    """Read a COMTRADE record: a .cfg and the .dat beside it, or a .cff.

    Parameters
    ----------
    path : Path
        Of the .cfg, .dat or .cff file.
    encoding : str or None
        Of the configuration; None: guessed from its letters.

    Returns
    -------
    Recording
        What was odd in the file is in its notes.

    Raises
    ------
    UserError
        Where files are missing, cut short or disagree.
    """
    path = Path(path)
    if path.is_dir():
        raise UserError(
            f"{path} is a folder; task=survey data.path={path} makes a table of all records in it"
        )
    try:
        return (
            _read_combined(_find_existing_path(path), encoding)
            if path.suffix.lower() == ".cff"
            else _read_pair(path, encoding)
        )
    except OSError as error:
        raise UserError(
            f"{error.filename or path} cannot be read: {error.strerror or error}"
        ) from error


def read_header(path: Path, encoding: str | None = None) -> Header:
    """The header of a record's configuration, without its samples; raises `UserError` as `load`
    does.
    """
    path = Path(path)
    if path.suffix.lower() == ".cff":
        parts = _find_sections(_find_existing_path(path))
        if "CFG" not in parts:
            raise UserError(f"{path}: no section CFG")
        place = parts["CFG"]
        first = parts["CFG"].line
    else:
        place = _read_bytes(_find_pair(path)[0])
        first = 1
    text, _ = decode(_read_configuration(place), str(path), encoding)
    return parse(str(path), split_lines(text), Remarks(str(path)), first)


def _read_bytes(path: Path) -> ByteRange:
    """All bytes of a file."""
    return ByteRange(path, 0, files.read_size(path))


def _read_pair(path: Path, encoding: str | None) -> Recording:
    """The recording of a .cfg and the .dat beside it."""
    cfg, dat, note = _find_pair(path)
    remarks = Remarks(str(cfg))
    if note:
        remarks.add(note)
    text, encoding = decode(_read_configuration(_read_bytes(cfg)), str(cfg), encoding)
    return _build_recording(cfg, text, _read_bytes(dat), remarks, {"encoding": encoding})


def _read_combined(path: Path, encoding: str | None) -> Recording:
    """A .cff: its sections, the data last and by its length where it is binary."""
    parts = _find_sections(path)
    if "CFG" not in parts or "DAT" not in parts:
        lack = "CFG" if "CFG" not in parts else "DAT"
        raise UserError(
            f"{path}: no section {lack}: a .cff has headings like '--- file type: {lack} ---'; if"
            " this is only the configuration, name it .cfg and put its .dat beside it"
        )
    remarks = Remarks(str(path))
    text, encoding = decode(_read_configuration(parts["CFG"]), str(path), encoding)
    extra = {"encoding": encoding}
    for name, key in (("HDR", "header"), ("INF", "information")):
        if name in parts and (said := parts[name].content().strip()):
            extra[key] = decode(said, str(path))[0]
    return _build_recording(path, text, parts["DAT"], remarks, extra, parts["CFG"].line)


def _find_sections(path: Path) -> dict[str, ByteRange]:
    """Where the sections of a .cff lie; bytes of binary data are not searched for headings."""
    sections: dict[str, ByteRange] = {}
    content: Any = ByteRange(path, 0, files.read_size(path)).numbers(np.dtype(np.uint8))
    counted, line, at = 0, 1, 0
    while (match := _SECTION.search(content, at)) is not None:
        name = match[1].decode().upper()
        length = match[3]
        begin = match.end()
        if name == "DAT" and match[2].upper() != b"ASCII":
            stop = min(len(content), begin + int(length[:15])) if length else len(content)
        else:
            following = _SECTION.search(content, begin)
            stop = following.start() if following else len(content)
        line += int(np.count_nonzero(content[counted:begin] == ord("\n")))
        sections[name] = ByteRange(path, begin, stop, line)
        counted = begin
        at = stop
    return sections


def _build_recording(
    path: Path, text: str, data: ByteRange, remarks: Remarks, extra: dict[str, Any], first: int = 1
) -> Recording:
    """The recording of a configuration's text and its data; what was odd is in its notes."""
    header = parse(str(path), split_lines(text), remarks, first)
    samples = read(data, header, remarks)
    stretches = _find_stretches(data, header, samples, remarks)
    if any(s.t is not None for s in stretches):
        remarks.add("samples at uneven times are interpolated to even ones (cubic splines)")
    return Recording(
        source=str(path),
        channels=[
            _build_channel(header, k, samples, stretches) for k in range(len(header.analogs))
        ],
        segments=timeline.arrange_segments(stretches),
        frequency=header.frequency,
        station=header.station,
        device=header.device,
        start=header.start,
        trigger=_trigger(header, stretches, remarks),
        status=[
            StatusChannel(
                d.name,
                timeline.take_nearest(samples.words[:, k // 16], stretches),
                d.phase,
                d.circuit,
                d.normal,
                bit=k % 16,
            )
            for k, d in enumerate(header.digitals)
        ],
        notes=remarks.notes(),
        extra={**extra, **_collect_extra(header, samples, stretches)},
    )


def _build_channel(
    header: Header, k: int, samples: Samples, stretches: list[SampleStretch]
) -> Channel:
    """An analog channel with its raw integers, at even times, missing ones marked."""
    analog = header.analogs[k]
    raw = samples.analogs[k]
    raw, missing = _find_missing_values(header.kind, analog, raw)
    return Channel(
        analog.name,
        timeline.resample_evenly(raw, stretches, missing),
        analog.unit,
        find_quantity(analog.unit),
        analog.phase,
        analog.circuit,
        analog.gain,
        analog.offset,
        analog.ratio,
        analog.skew * 1e-6,
        analog.limits,
        missing,
        _find_side(header, analog),
    )


def _find_side(header: Header, analog: Analog) -> str:
    """Whether values are secondary without a ratio: S with 1 to 1; files of 1991 do not say."""
    if analog.side == "S" and analog.ratio == 1:
        return "S"
    return "?" if not analog.side and header.revision < FIRST_WITH_RATIO else ""


def _find_missing_values(
    kind: str, analog: Analog, raw: np.ndarray
) -> tuple[np.ndarray, float | None]:
    """The raw values, and which of them stands for none: a value that the file declares possible
    does not.
    """
    if kind == "ASCII":
        return _find_missing_text(analog, raw)
    least, greatest = analog.limits or (np.inf, np.inf)
    missing = MISSING.get(kind)
    if kind == "BINARY" and analog.limits and least >= 0 and greatest > 32767:
        return raw.view("<u2"), 65535.0 if greatest < 65535 else None  # declared without sign
    return raw, None if missing is None or least <= missing else missing


def _find_missing_text(analog: Analog, raw: np.ndarray) -> tuple[np.ndarray, float | None]:
    """The values of a text file, those that stood for none in 1991 as they do now, and which does;
    None where the file declares both possible.
    """
    if analog.limits is not None and analog.limits[1] >= MISSING_TEXT[0]:
        return raw, MISSING_TEXT[1] if analog.limits[1] < MISSING_TEXT[1] else None
    old = raw == MISSING_TEXT[1]
    if old.any():
        raw = np.where(old, raw.dtype.type(MISSING_TEXT[0]), raw)
    return raw, MISSING_TEXT[0]


def _find_stretches(
    data: ByteRange, header: Header, samples: Samples, remarks: Remarks
) -> list[SampleStretch]:
    """Segments from the rates; from the time stamps where there are none."""
    fine = all("." in date and len(date.strip().rpartition(".")[2]) > 6 for date in header.dates)
    unit = header.timemult * (1e-9 if fine else 1e-6)
    if header.rates[0][0] <= 0:
        return _find_stretches_by_stamps(data, header, samples, unit, remarks)
    t = _read_stamped_times(header, samples.stamps, unit, remarks)
    result = timeline.build_from_rates(header.rates, t)
    if any(s.t is not None for s in result):
        remarks.add(
            "sampling rates within 2 % of their neighbours are taken as one waveform",
            header.lines["rates"],
        )
    return result


def _find_stretches_by_stamps(
    data: ByteRange, header: Header, samples: Samples, unit: float, remarks: Remarks
) -> list[SampleStretch]:
    """Segments from the time stamps, of `unit` s each."""
    stamps = samples.stamps.astype(np.float64)
    if header.kind != "ASCII":
        # the counter ran over
        stamps += 2.0**32 * np.cumsum(np.diff(stamps, prepend=stamps[0]) < -(2.0**31))
    result = timeline.build_from_stamps((stamps - stamps[0]) * unit, unit, str(data.path))
    if header.timemult != 1:
        rates = ", ".join(f"{s.segment.rate:g}" for s in result[:3])
        remarks.add(
            f"sampled at {rates} Hz, by the time stamps and the time multiplier"
            f" {header.timemult:g}; if that is wrong, correct the multiplier"
        )
    if len(result) > 1:
        gaps = ", ".join(f"{s.segment.start:.6g}" for s in result[1:6])
        more = " ..." if len(result) > 6 else ""
        remarks.add(f"the steps between time stamps change: a new segment begins at {gaps}{more} s")
    return result


def _read_stamped_times(
    header: Header, stamps: np.ndarray, unit: float, remarks: Remarks
) -> np.ndarray | None:
    """Times (N,) [s] by the time stamps; None where there are none or they contradict the rates,
    which is said.
    """
    if stamps[-1] in (NONE, 0) or stamps[0] == stamps[-1] or not np.isfinite(stamps).all():
        return None
    t = (stamps.astype(np.float64) - float(stamps[0])) * unit
    lengths = np.diff([0, *(stop for _, stop in header.rates)])
    if sum(lengths / [rate for rate, _ in header.rates]) > 2.0**32 * unit or np.any(np.diff(t) < 0):
        return None  # the counter ran over
    first = 0
    for rate, stop in header.rates:
        duration = (stop - first - 1) / rate
        stamped = float(t[stop - 1] - t[first])
        if abs(duration - stamped) > 2 * unit + 0.01 * duration:
            at = f"samples {first + 1} to {stop} take {duration:.6g} s at {rate:g} Hz"
            remarks.add(
                f"{at}, but {stamped:.6g} s by their time stamps; the rate is taken",
                header.lines["rates"],
            )
            return None
        first = stop
    return t


def _trigger(header: Header, stretches: list[SampleStretch], remarks: Remarks) -> float | None:
    """The trigger's time [s] after the first sample; None, with a remark, where it lies outside the
    record.
    """
    last = stretches[-1].segment
    if (
        header.trigger is None
        or -1e-6 <= header.trigger <= last.start + (last.stop - last.first) / last.rate
    ):
        return header.trigger
    remarks.add(
        f"the trigger, {header.trigger:g} s after the first sample, lies outside the record and is"
        " not used"
    )
    return None


def _collect_extra(
    header: Header, samples: Samples, stretches: list[SampleStretch]
) -> dict[str, Any]:
    """Fields of the file that a recording has no attribute for, for a round trip."""
    extra: dict[str, Any] = {
        "format": "COMTRADE",
        "revision": header.revision,
        "kind": header.kind,
        "dates": header.dates,
        "timemult": header.timemult,
        "time_code": header.time_code,
        "quality": header.quality,
        "sides": [(analog.primary, analog.secondary, analog.side) for analog in header.analogs],
        "rates": header.rates,
    }
    if any(s.t is not None for s in stretches):
        return extra  # numbers and stamps of other samples
    count = len(samples.numbers)
    if not np.array_equal(samples.numbers, np.arange(1, count + 1)):
        extra["numbers"] = samples.numbers
    if header.rates[0][0] == 0 or samples.stamps[0] != samples.stamps[-1]:
        extra["stamps"] = samples.stamps
    return extra


def _find_existing_path(path: Path) -> Path:
    """The path. Raises `UserError` with the nearest name of its folder where it is not there."""
    if not files.is_there(path):
        names = [item.name for item in files.list_folder(path.parent)]
        raise UserError(f"{path}: there is no such file{suggest_nearest(path.name, names)}")
    return path


def _find_pair(path: Path) -> tuple[Path, Path, str]:
    """The .cfg and .dat files, whatever the case of their endings, and a remark on them."""
    ending = path.suffix.lower()
    if ending not in (".cfg", ".dat"):
        raise UserError(
            f"{DATA.path}={path}: give the .cfg file of a COMTRADE record, whose .dat lies beside"
            " it, or a .cff"
        )
    _find_existing_path(path)
    if ending == ".dat":
        cfg = _find_companion(path, ".cfg")
        if cfg is None:
            raise UserError(
                f"{path}: the configuration {path.stem}.cfg is not beside it, and the data mean"
                " nothing without"
            )
        return cfg, path, f"it lies beside {path.name}"
    dat = _find_companion(path, ".dat")
    if dat is None:
        raise UserError(
            f"{path.with_suffix('.dat')}: there is no such file; the data must lie beside"
            f" {path.name}"
        )
    return path, dat, ""


def _find_companion(path: Path, ending: str) -> Path | None:
    """The file beside a path with another ending, in whatever letters; None where there is none."""
    for one in (ending, ending.upper(), ending.capitalize()):
        if files.is_there(path.with_suffix(one)):
            return path.with_suffix(one)
    wanted = path.with_suffix(ending).name.casefold()
    return next(
        (
            item
            for item in files.list_folder(path.parent)
            if item.name.casefold() == wanted and files.is_there(item)
        ),
        None,
    )


def _read_configuration(place: ByteRange) -> bytes:
    """The bytes of a configuration. Raises `UserError` for one that is too large."""
    if place.size > LARGEST_CFG:
        raise UserError(
            f"{place.path}: {place.size} bytes are no COMTRADE configuration; the limit is"
            f" {LARGEST_CFG}"
        )
    return place.content()
