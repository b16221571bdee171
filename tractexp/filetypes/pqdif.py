"""PQDIF files (IEEE 1159.3) as a recording of their waveforms, or as a table of their logs of RMS
values and powers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes import timeline
from tractexp.filetypes.pqdif_channels import (
    LOG,
    PHASOR,
    WAVEFORM,
    ChannelDefinition,
    PqdifContent,
    SeriesDefinition,
    count_seconds,
    read_observations,
)
from tractexp.filetypes.pqdif_records import SIGNATURE, tag
from tractexp.filetypes.remarks import Remarks
from tractexp.filetypes.table import Rows
from tractexp.recording.recording import Channel, Recording
from tractexp.storage import files

ZERO = datetime(1899, 12, 30)
# of the standard
UNITS = {6: "V", 7: "A", 8: "VA", 9: "W", 10: "var", 15: "Hz", 17: "deg", 19: "%", 20: "pu"}
QUANTITIES = {"V": "voltage", "A": "current", "Hz": "frequency", "deg": "angle"}
PHASES = {1: "A", 2: "B", 3: "C", 4: "N", 5: "AB", 6: "BC", 7: "CA", 8: "N", 9: "N"}
# in names of columns: sequences, total, means
MEANS = {10: "1", 11: "2", 12: "0", 13: "", 14: " LN", 15: " LL"}
LETTERS = {"V": "U", "A": "I", "W": "P", "var": "Q", "Hz": "f"}
VALUE, AVERAGE = (
    tag("67f6af97-f753-11cf-9d89-0080c72e70a3"),
    tag("67f6af9a-f753-11cf-9d89-0080c72e70a3"),
)
INSTANT = tag("67f6af9b-f753-11cf-9d89-0080c72e70a3")
ANGLES = (tag("3d786f9d-f76e-11cf-9d89-0080c72e70a3"), tag("dc762342-3c56-11d2-ae44-0060083a2628"))
# what a logged value is of its quantity: none said, RMS, P, Q, frequency; positive and negative
# sequence; fundamental
PLAIN = (
    b"",
    *(tag(f"a6b31a{n}-b451-11d1-ae17-0060083a2628") for n in ("df", "e5", "e1", "e4")),
    tag("07ef68af-9ff5-11d2-b30b-006008b37183"),
)
SEQUENCES = {
    tag("a6b31aea-b451-11d1-ae17-0060083a2628"): 10,
    tag("d71a4b91-3c92-11d4-9f2c-002078e0b723"): 11,
}
FUNDAMENTAL = (
    tag("1cdda475-1ebb-42d8-8087-d01b0b5cfa97"),
    tag("672d0310-7810-11d4-a4b3-444553540000"),
)
ENDINGS = {kind: "" for kind in (*PLAIN, *SEQUENCES)} | {
    kind: " fundamental" for kind in FUNDAMENTAL
}
FEWEST_WAVE_SAMPLES = 4  # samples of a waveform
LARGEST_TIME_DIFFERENCE = 1e-6  # s: times that are the same to the resolution of a moment
LOG_GAP_STEPS = 1.5  # usual steps: after a longer one a log is another one


@dataclass(frozen=True, eq=False)
class ObservedStretch:
    """Values (N,) by column at times (N,) [s] since the file's first observation."""

    t: np.ndarray
    columns: dict[int, np.ndarray]


def recognizes(path: Path | str) -> bool:
    """Whether a file is there and begins as a PQDIF file does."""
    return files.is_there(path) and files.read(path, len(SIGNATURE)) == SIGNATURE


def holds_waveforms(path: Path, encoding: str | None = None) -> bool:
    """Whether waveforms are in the file; raises `UserError` for what is no such file."""
    return bool(
        read_observations(path, encoding, [WAVEFORM], Remarks(str(path)), most=1).observations
    )


def load(path: Path, encoding: str | None = None) -> Recording:
    """Read the waveforms of a PQDIF file.

    Each observation of the channels that most have is a segment.

    Parameters
    ----------
    path : Path
        Of the file.
    encoding : str or None
        Of its texts; None: guessed from their letters.

    Returns
    -------
    Recording

    Raises
    ------
    UserError
        With file and record of what is wrong, and for a file without waveforms.
    """
    remarks = Remarks(str(path))
    content = read_observations(path, encoding, [WAVEFORM], remarks)
    channels: dict[int, tuple[ChannelDefinition, str]] = {}
    stretches = _keep_fullest_set(_read_waves(content, channels, remarks), remarks)
    if not stretches:
        raise UserError(
            f"{path}: there are no waveforms in this PQDIF file; logs of voltage, P and Q are read"
            f" as a table: data=csv data.path={path}"
        )
    segments, evened = _cut_segments(str(path), stretches)
    start = content.observations[0].start
    begin = stretches[0].t[0]
    last = segments[-1].start + (segments[-1].stop - segments[-1].first) / segments[-1].rate
    stated = (
        count_seconds(o.triggered, start) - begin for o in content.observations if o.triggered
    )
    triggers = sorted({float(t) for t in stated if 0 < t < last})
    return Recording(
        source=str(path),
        channels=[_build_channel(*channels[k], values) for k, values in evened.items()],
        segments=segments,
        frequency=content.frequency if 10 <= content.frequency <= 100 else 50.0,
        station=content.station,
        start=_read_moment(start, float(begin), remarks),
        trigger=triggers[0] if triggers else None,
        triggers=triggers if len(triggers) > 1 else (),
        notes=remarks.notes(),
        extra={"format": "PQDIF"},
    )


def _build_channel(definition: ChannelDefinition, unit: str, values: np.ndarray) -> Channel:
    """A defined channel with its values (N,)."""
    quantity = QUANTITIES.get(unit, "")
    phase = PHASES.get(definition.phase, "")
    return Channel(definition.name, values, unit, quantity, phase, definition.circuit)


def _read_waves(
    content: PqdifContent, channels: dict[int, tuple[ChannelDefinition, str]], remarks: Remarks
) -> list[ObservedStretch]:
    """The waveforms of each observation by the times of their samples; `channels` learns definition
    and unit.
    """
    stretches: dict[tuple[float, ...], ObservedStretch] = {}
    for each in content.observations:
        begin = count_seconds(each.start, content.observations[0].start)
        own: dict[tuple[float, ...], ObservedStretch] = {}
        for one in each.instances:
            sampled = ((d, v) for d, v in one.series if d.value in (VALUE, INSTANT))
            definition, values = next(sampled, (None, None))
            if definition is None or values is None or len(one.t) < FEWEST_WAVE_SAMPLES:
                continue
            steps = np.diff(one.t)
            if not ((steps > 0) & (steps < np.inf)).all():
                raise UserError(
                    f"{remarks.where}: {one.channel.name}: its times do not increase: the file is"
                    " damaged"
                )
            channels[one.channel.number] = (one.channel, UNITS.get(definition.unit, ""))
            stretch = own.setdefault(_key_times(begin, one.t), ObservedStretch(begin + one.t, {}))
            stretch.columns[one.channel.number] = values
        for stretch in _merge_rates([*own.values()], remarks):
            stretches.setdefault(_key_times(0.0, stretch.t), stretch).columns.update(
                stretch.columns
            )
    return sorted(stretches.values(), key=lambda stretch: stretch.t[0])


def _key_times(begin: float, t: np.ndarray) -> tuple[float, ...]:
    """(first [s], count, duration [s]) of times (N,), to the microsecond: equal where they are the
    same times.
    """
    return round(begin + float(t[0]), 6), len(t), round(float(t[-1] - t[0]), 6)


def _merge_rates(
    stretches: Sequence[ObservedStretch], remarks: Remarks
) -> Sequence[ObservedStretch]:
    """One stretch of channels that one observation samples at several rates: all at the times of
    the slowest.
    """
    first, last = (
        f(each.t[k] for each in stretches) if stretches else 0.0 for f, k in ((max, 0), (min, -1))
    )
    slowest = min(
        stretches, key=lambda each: (len(each.t) - 1) / (each.t[-1] - each.t[0]), default=None
    )
    if slowest is None or len(stretches) == 1:
        return stretches
    t = slowest.t[
        (slowest.t >= first - LARGEST_TIME_DIFFERENCE)
        & (slowest.t <= last + LARGEST_TIME_DIFFERENCE)
    ]
    if len(t) < FEWEST_WAVE_SAMPLES:
        return stretches
    from scipy.interpolate import CubicSpline

    remarks.add(
        f"channels of one observation are sampled at {len(stretches)} rates: all are taken at the"
        " lowest"
    )
    columns = {k: CubicSpline(each.t, v)(t) for each in stretches for k, v in each.columns.items()}
    return [ObservedStretch(t, columns)]


def _keep_fullest_set(
    stretches: Sequence[ObservedStretch], remarks: Remarks
) -> list[ObservedStretch]:
    """The stretches of the largest set of channels: what others have is no whole load."""
    if not stretches:
        return []
    sets = [frozenset(each.columns) for each in stretches]
    full = max(sets, key=lambda one: (len(one), sets.count(one)))
    if len(sets) > sets.count(full):
        count = len(sets) - sets.count(full)
        remarks.add(
            f"{count} of {len(sets)} observations hold other channels, or fewer, and are not read"
        )
    return [each for each, own in zip(stretches, sets, strict=True) if own == full]


def _cut_segments(
    where: str, stretches: Sequence[ObservedStretch]
) -> tuple[list[timeline.Segment], dict[int, np.ndarray]]:
    """Segments of even sampling, and the values (N,) of each channel in them; times begin with the
    first sample.
    """
    segments: list[timeline.Segment] = []
    parts: dict[int, list[np.ndarray]] = {k: [] for k in stretches[0].columns}
    first = 0
    for each in stretches:
        t = each.t - stretches[0].t[0]
        resolution = float(np.spacing(np.float32(np.abs(t - t[0]).max())))
        runs = timeline.build_from_stamps(t, resolution, where)
        segments += [
            timeline.Segment(first + s.first, first + s.stop, s.rate, s.start)
            for s in timeline.arrange_segments(runs)
        ]
        for k, values in each.columns.items():
            parts[k].append(timeline.resample_evenly(values, runs, None))
        first += len(next(iter(parts.values()))[-1])
    return segments, {
        k: each[0] if len(each) == 1 else np.concatenate(each) for k, each in parts.items()
    }


def _read_moment(start: tuple[int, float], more: float, remarks: Remarks) -> datetime | None:
    """The date of so many days since 1900 and seconds; None, with a remark, where it is none."""
    try:
        return ZERO + timedelta(days=start[0], seconds=start[1] + more)
    except OverflowError:
        remarks.add(f"day {start[0]} since 1900 is no date; not used")
        return None


def table(path: Path, encoding: str | None = None) -> Rows:
    """Read the logs of a PQDIF file: RMS values, powers and phasors.

    Parameters
    ----------
    path : Path
        Of the file.
    encoding : str or None
        Of its texts; None: guessed from their letters.

    Returns
    -------
    Rows
        At the times that most logs have. Columns are named by what they are (UA, P, U1 angle), with
        the circuit where there are several.

    Raises
    ------
    UserError
        For a file without logs.
    """
    remarks = Remarks(str(path))
    content = read_observations(path, encoding, [LOG, PHASOR], remarks)
    names: dict[int, tuple[str, str]] = {}
    stretches = _read_logs(content, names)
    if not stretches:
        raise UserError(
            f"{path}: there are no logs of RMS values or powers in this PQDIF file; its waveforms"
            f" are read by data=pqdif data.path={path}"
        )
    fullest = _keep_fullest_set(stretches, remarks)
    t, columns = _join_longest_log(fullest, remarks)
    every = [("t", "s", t - t[0]), *((*names[k], values) for k, values in columns.items())]
    return Rows.from_columns(path, every, 1, remarks.notes())


def _read_logs(content: PqdifContent, names: dict[int, tuple[str, str]]) -> list[ObservedStretch]:
    """The logs of each observation by their times; `names` learns what each column is called, and
    its unit.
    """
    stretches: dict[tuple[float, ...], ObservedStretch] = {}
    circuits = {i.channel.circuit for o in content.observations for i in o.instances}
    numbers: dict[tuple[int, int], int] = {}
    for each in content.observations:
        begin = count_seconds(each.start, content.observations[0].start)
        for one in each.instances:
            values = {d.value for d, _ in one.series}
            for k, (definition, column) in enumerate(one.series):
                name = _name_column(one.channel, definition, VALUE in values)
                if not name or len(one.t) < 2:
                    continue
                number = numbers.setdefault((one.channel.number, k), len(numbers))
                circuit = one.channel.circuit if len(circuits) > 1 else ""
                names[number] = (" ".join(filter(None, (circuit, name))), UNITS[definition.unit])
                stretch = stretches.setdefault(
                    _key_times(begin, one.t), ObservedStretch(begin + one.t, {})
                )
                stretch.columns[number] = column
    return sorted(stretches.values(), key=lambda stretch: stretch.t[0])


def _name_column(channel: ChannelDefinition, definition: SeriesDefinition, has_value: bool) -> str:
    """The name of a logged series, by quantity and phase; "" for a least or greatest value, and
    other quantities.
    """
    unit = UNITS.get(definition.unit, "")
    phase = SEQUENCES.get(definition.characteristic, channel.phase)
    mark = PHASES.get(phase, MEANS.get(phase, ""))
    values = (VALUE,) if has_value else (AVERAGE, INSTANT)
    if definition.value in ANGLES and unit == "deg" and channel.quantity in ("U", "I"):
        return f"{channel.quantity}{mark} angle"
    letter = LETTERS.get(unit, "")
    if not letter or definition.value not in values:
        return ""
    name = letter + mark if letter in "UI" or mark in "ABC" else letter
    ending = ENDINGS.get(definition.characteristic)
    return "" if ending is None else f"{name}{ending}"


def _join_longest_log(
    stretches: Sequence[ObservedStretch], remarks: Remarks
) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """The longest of the logs that follow one another without a gap: times (N,), and values (N,) by
    column.
    """
    runs: list[list[ObservedStretch]] = []
    for each in stretches:
        before = runs[-1][-1].t if runs else each.t
        joined = runs and 0 < each.t[0] - before[-1] <= LOG_GAP_STEPS * float(
            np.median(np.diff(before))
        )
        if joined:
            runs[-1].append(each)
        else:
            runs.append([each])
    run = max(runs, key=lambda one: sum(len(each.t) for each in one))
    if len(runs) > 1:
        remarks.add(
            f"{len(runs)} logs with gaps between them: the longest is read, from {run[0].t[0]:.3f}"
            " s"
        )
    t = np.concatenate([each.t for each in run])
    return t, {k: np.concatenate([each.columns[k] for each in run]) for k in run[0].columns}
