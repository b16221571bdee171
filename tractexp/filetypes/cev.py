"""SEL compressed event reports (.cev, Compressed ASCII) read into a recording.

Source: the instruction manuals of SEL-351A, -311L, -411L, -421, -751 and -787 (appendix Compressed
ASCII, section event reports): quoted rows with a checksum each, names above values; the columns are
instantaneous primary amperes and kilovolts over the root of two; `>` marks the row of the trigger,
`*` that of the greatest current; the states of the relay word are hexadecimal.
"""

import functools
import re
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes import timeline
from tractexp.filetypes.cev_scale import ROOT, find_gain, find_usual_unit, read_ratio
from tractexp.filetypes.cev_text import EventReport, find_marked_row, read_report, read_samples
from tractexp.filetypes.comtrade_fields import parse_number, quote_field
from tractexp.filetypes.comtrade_samples import HUGE
from tractexp.filetypes.remarks import Remarks
from tractexp.filetypes.table import Rows
from tractexp.filetypes.text import decode
from tractexp.recording.recording import Channel, Recording, StatusChannel, find_unit
from tractexp.storage import files

LARGEST = 32 * 2**20  # bytes: event reports last seconds
FEWEST_WAVE_RATE = 10  # samples a cycle: fewer are a filtered report, which holds phasors
BEGINNING = 1 << 16  # bytes in which a report names the samples in a cycle
LEAST, MOST = 10.0, 100.0  # Hz
# what the settings say of the load and of its transformers: full-load and locked-rotor current,
# service factor, ratios
RATING = re.compile(
    r"\b((?:CTRG?|PTR|FLA|LRA|LRTHOT|SF|VNOM|MVA)[A-Z]?\d?)\b\s*:?=\s*(\d+\.?\d*)", re.ASCII
)
_COLUMN = re.compile(r"\s*([^(]*?)\s*(?:\(\s*([^)]*?)\s*\))?\s*")
_WAVE = re.compile(r"[IV](?:([ABCNGQ]|AB|BC|CA)(\w?)|1MEM|S\d?|P)", re.ASCII)


def recognizes(path: Path | str) -> bool:
    """Whether a file is there whose beginning names the samples in a cycle, as such a
    report does.
    """
    return files.is_there(path) and b'"SAM/CYC_A"' in files.read(path, BEGINNING)


def holds_waveforms(path: Path, encoding: str | None = None) -> bool:
    """Whether it is a raw report; a filtered one, of a few samples a cycle, holds phasors."""
    opened = _open_report(path, encoding)
    return opened.per_cycle >= FEWEST_WAVE_RATE


def load(path: Path, encoding: str | None = None) -> Recording:
    """Read a raw event report.

    Parameters
    ----------
    path : Path
        Of the file.
    encoding : str or None
        Of its text; None: guessed from its letters.

    Returns
    -------
    Recording

    Raises
    ------
    UserError
        With line, column and value of what is wrong.
    """
    opened = _open_report(path, encoding)
    report, remarks, t = opened.report, opened.remarks, opened.t
    if opened.per_cycle < FEWEST_WAVE_RATE:
        remarks.add(
            f"{opened.per_cycle:g} samples a cycle: a filtered report; get the raw one of the relay"
            " with the command CEV R, or its COMTRADE file; its phasors are read by data=csv"
        )
    runs = timeline.build_from_stamps(t, 1e-9, str(path))
    moment = 0.0 if opened.marked is None else float(t[opened.marked])
    return Recording(
        source=str(path),
        channels=[
            _build_channel(
                report,
                k,
                timeline.resample_evenly(opened.values[:, k], runs, None),
                opened.gain,
                remarks,
            )
            for k in range(opened.values.shape[1])
            if _is_named(report, k)
        ],
        segments=timeline.arrange_segments(runs),
        frequency=opened.nominal,
        device=report.about.get("FID", "").removeprefix("FID=").strip(),
        start=_start(report, moment, remarks),
        trigger=None if opened.marked is None else moment,
        status=[
            replace(each, raw=timeline.take_nearest(each.raw, runs))
            for each in _build_states(report, opened.words)
        ],
        notes=remarks.notes(),
        extra={
            "format": "SEL CEV",
            "encoding": opened.encoding,
            "about": report.about,
            "settings": report.settings,
        },
    )


def table(path: Path, encoding: str | None = None) -> Rows:
    """Read a filtered event report as phasors.

    Two samples a quarter of a cycle apart are real and imaginary part: x_k + j x_(k-1), at four
    samples a cycle. The relay samples by the frequency that it tracks, so that this holds off the
    nominal one.

    Parameters
    ----------
    path : Path
        Of the file.
    encoding : str or None
        Of its text; None: guessed from its letters.

    Returns
    -------
    Rows
        RMS values, and angles in a frame that turns at the nominal frequency.

    Raises
    ------
    UserError
        As `load`, and for a raw report.
    """
    opened = _open_report(path, encoding)
    report, remarks, quarter = opened.report, opened.remarks, round(opened.per_cycle / 4)
    if (
        opened.per_cycle >= FEWEST_WAVE_RATE
        or 4 * quarter != opened.per_cycle
        or len(opened.t) <= quarter
    ):
        raise UserError(
            f"{path}: {len(opened.t)} samples, {opened.per_cycle:g} a cycle: phasors are read from"
            f" filtered reports of 4 or 8; waveforms by data=sel data.path={path}"
        )
    remarks.add(
        f"a filtered report, {opened.per_cycle:g} samples a cycle: phasors from samples a quarter"
        " of a cycle apart; what changes within a cycle, the window of the relay's filter, does not"
        " show"
    )
    t = opened.t[quarter:]
    back = np.exp(-2j * np.pi * opened.nominal * t)
    columns = [("t", "s", t), ("f", "Hz", opened.frequency[quarter:])]
    for k in filter(functools.partial(_is_named, report), range(opened.values.shape[1])):
        channel = _build_channel(report, k, opened.values[:, k], opened.gain / ROOT, remarks)
        if channel.form == "waveform" and channel.phase in ("A", "B", "C", "AB", "BC", "CA"):
            x = channel.ratio * channel.read_values()
            X = (x[quarter:] + 1j * x[:-quarter]) * back
            columns += [
                (channel.name, channel.unit, np.abs(X)),
                (f"{channel.name} angle", "rad", np.angle(X)),
            ]
    return Rows.from_columns(path, columns, 1 + quarter, remarks.notes())


@dataclass(frozen=True, eq=False)
class _Opened:
    """A report with its samples: values (N, columns), times (N,) [s] and the frequency (N,) [Hz]
    sampled by.
    """

    report: EventReport
    values: np.ndarray
    words: list[str]
    t: np.ndarray
    frequency: np.ndarray
    per_cycle: float
    nominal: float  # Hz
    marked: int | None  # the row of the trigger
    gain: float
    remarks: Remarks
    encoding: str


def _open_report(path: Path, encoding: str | None) -> _Opened:
    """An event report with its text and encoding. Raises `UserError` for a file that is none, or
    too large.
    """
    path = Path(path)
    files.check_there(path)
    if files.read_size(path) > LARGEST:
        raise UserError(
            f"{path}: {files.read_size(path)} bytes are no event report; the limit is {LARGEST}"
        )
    text, encoding = decode(files.read(path), str(path), encoding)
    remarks = Remarks(str(path))
    report = read_report(path, text, remarks)
    values, marks, words = read_samples(path, report, remarks)
    per_cycle, frequency = _read_rate(path, report)
    _note_lost_rows(report, per_cycle, remarks)
    marked = find_marked_row(marks, ">*")
    if marked is None:
        remarks.add(
            "no row is marked as the trigger's ('>'); the report's time is taken as that of the"
            " first sample"
        )
    if rated := ", ".join(f"{name} = {value}" for name, value in RATING.findall(report.settings)):
        remarks.add(f"the relay's settings: {rated}")
    gain, tracked = (
        find_gain(report, values, marks, per_cycle, remarks),
        _read_tracked_frequency(report, values, frequency, remarks),
    )
    t = np.concatenate([[0.0], np.cumsum(2 / (tracked[1:] + tracked[:-1]))]) / per_cycle
    nominal = 50.0 if abs(frequency - 50) < abs(frequency - 60) else 60.0
    return _Opened(
        report, values, words, t, tracked, per_cycle, nominal, marked, gain, remarks, encoding
    )


def _note_lost_rows(report: EventReport, per_cycle: float, remarks: Remarks) -> None:
    """Note rows that are missing or double by the cycles that the summary announces: each has its
    checksum, and none a number.
    """
    cycles = parse_number(report.about.get("NUM_OF_CYC", ""))
    announced = round(per_cycle * cycles) if cycles and abs(cycles) < HUGE else 0
    if announced > 0 and announced != len(report.rows):
        remarks.add(
            f"{len(report.rows)} samples, and NUM_OF_CYC announces {announced}: rows are missing or"
            " double, and times after them off by as many steps; get the report again"
        )


def _read_tracked_frequency(
    report: EventReport, values: np.ndarray, frequency: float, remarks: Remarks
) -> np.ndarray:
    """The frequency (N,) [Hz] that the relay sampled by: its column's, where that is one, else the
    summary's.
    """
    names = [column.upper() for column in report.columns[: values.shape[1]]]
    k = next((names.index(name) for name in ("FREQ", "FREQ(HZ)") if name in names), None)
    if k is None:
        return np.full(len(values), frequency)
    column = values[:, k]
    good = np.flatnonzero((column >= LEAST) & (column <= MOST))
    if not len(good):
        return np.full(len(values), frequency)
    if len(good) < len(values):
        remarks.add(
            "FREQ has gaps or is no frequency in some rows: that of the rows beside them holds"
        )
    last = np.maximum.accumulate(
        np.where(np.isin(np.arange(len(values)), good), np.arange(len(values)), good[0])
    )
    if np.ptp(column[good]) > 0:
        remarks.add(
            f"times follow the frequency in FREQ, {column[good].min():g} to {column[good].max():g}"
            " Hz"
        )
    return column[last]


def _read_rate(path: Path, report: EventReport) -> tuple[float, float]:
    """Samples a cycle and the frequency that the relay sampled by."""
    numbers = {key: parse_number(report.about.get(key, "")) for key in ("SAM/CYC_A", "FREQ")}
    per_cycle = numbers["SAM/CYC_A"]
    frequency = numbers["FREQ"]
    if per_cycle is None or not 1 <= per_cycle <= 10_000:
        raise UserError(
            f"{path}: SAM/CYC_A, the samples in a cycle, is"
            f" {quote_field(report.about.get('SAM/CYC_A', ''))}, not a number from 1 to 10000;"
            " correct it in the summary row"
        )
    if frequency is None or not LEAST <= frequency <= MOST:
        raise UserError(
            f"{path}: FREQ, the frequency of the summary row, is"
            f" {quote_field(report.about.get('FREQ', ''))}, not a number from 10 to 100 Hz; correct"
            " it there"
        )
    return per_cycle, frequency


def _is_named(report: EventReport, k: int) -> bool:
    """Whether a column has a name."""
    return report.columns[k] not in ("", "*")


def _build_channel(
    report: EventReport, k: int, values: np.ndarray, gain: float, remarks: Remarks
) -> Channel:
    """The channel of a column: its quantity and unit from the name, its values times the
    transformers' ratio.
    """
    match = _COLUMN.fullmatch(report.columns[k])
    name, unit = (match[1], match[2] or "") if match else (report.columns[k], "")
    wave = _WAVE.fullmatch(name.upper())
    unit = unit or find_usual_unit(name, wave is not None, remarks)
    quantity = "frequency" if name == "FREQ" else find_unit(unit)[0]
    if wave is None:
        return Channel(name, values, unit, quantity, form="value")
    phase = wave[1] or ""
    circuit = wave[2] or ""
    ratio = read_ratio(report, name, remarks)
    return Channel(name, values, unit, quantity, phase, circuit, gain, ratio=ratio, form="waveform")


def _start(report: EventReport, before: float, remarks: Remarks) -> datetime | None:
    """The moment of the first sample, `before` s before the report's, which is that of the trigger;
    None, with a remark, where the summary has no date.
    """
    keys = ("YEAR", "MONTH", "DAY", "HOUR", "MIN", "SEC", "MSEC")
    parts = [parse_number(report.about.get(key, "")) for key in keys]
    try:
        year, month, day, hour, minute, second, milli = (
            int(part) for part in parts if part is not None
        )
        moment = datetime(
            year + (2000 if year < 100 else 0), month, day, hour, minute, second, 1000 * milli
        )
        return moment - timedelta(seconds=before)
    except (ValueError, OverflowError):
        said = ", ".join(f"{key} {report.about.get(key, '')}" for key in keys)
        remarks.add(f"{quote_field(said)} is not a date and time; not used")
        return None


def _build_states(report: EventReport, words: list[str]) -> list[StatusChannel]:
    """One channel for each bit with a name; a row without a word keeps the one before."""
    at = report.columns.index("TRIG")
    names = report.columns[at + 1].split() if len(report.columns) > at + 1 else []
    held = ""
    rows = []
    for word in words:
        held = word if re.fullmatch(r"[0-9A-Fa-f]+", word) else held
        rows.append(bytes.fromhex(held if len(held) % 2 == 0 else f"{held}0"))
    if not names:
        return []
    width = -(-len(names) // 8)
    packed = np.frombuffer(
        b"".join(row[:width].ljust(width, b"\0") for row in rows), np.uint8
    ).reshape(-1, width)
    return [
        StatusChannel(name, packed[:, k // 8], bit=7 - k % 8)
        for k, name in enumerate(names)
        if name != "*"
    ]
