"""COMTRADE records written, 1999 or 2013: what is read back is what was written."""

from collections.abc import Mapping
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError, check_choice
from tractexp.filetypes.comtrade_fields import parse_date
from tractexp.filetypes.comtrade_header import EPOCH, VALUE
from tractexp.filetypes.comtrade_samples import NONE, build_row_type
from tractexp.recording.recording import Channel, Recording
from tractexp.storage import files

# ever more values fit
KINDS = {1999: ("BINARY", "ASCII"), 2013: ("BINARY", "BINARY32", "FLOAT32", "ASCII")}
FULL = {
    "BINARY": (-32767, 32767),
    "BINARY32": (-2147483647, 2147483647),
    "FLOAT32": (-3.4028235e38, 3.4028235e38),
}
FULL["ASCII"], FULL["UNSIGNED"] = (-99999, 99998), (0, 65534)


def write(
    recording: Recording, path: Path, kind: str = "BINARY", revision: int = 2013
) -> list[Path]:
    """Write a recording as COMTRADE, each file whole or not at all.

    Parameters
    ----------
    recording : Recording
        Any; commas in names become semicolons.
    path : Path
        A .cff for one file; any other for a .cfg and a .dat.
    kind : str
        BINARY (16 bits), BINARY32, FLOAT32 or ASCII; of 1999 BINARY or ASCII. Raw values that do
        not fit go to the next kind that holds them exactly; FLOAT32, where chosen, rounds to 24
        bits.
    revision : int
        Year of the standard.

    Returns
    -------
    list of Path
        The files.
    """
    path = Path(path)
    check_choice("the ending of a COMTRADE file", path.suffix.lower(), (".cfg", ".cff"))
    check_choice("revision", revision, KINDS)
    check_choice("kind", kind, KINDS[revision])
    if path.suffix.lower() == ".cff" and revision < 2013:
        raise UserError(
            f"{path}: a .cff is of the standard of 2013; give revision=2013, or a name that ends in"
            " .cfg"
        )
    kind = _choose_kind(recording, kind, revision)
    rates, stamps, timemult = _list_times(recording)
    data = (
        _write_ascii(recording, stamps)
        if kind == "ASCII"
        else _pack_binary(recording, kind, stamps)
    )
    text = "\r\n".join(_write_lines(recording, kind, revision, rates, timemult)) + "\r\n"
    if path.suffix.lower() == ".cff":
        return [files.write(path, _combine_sections(recording, text, kind, data))]
    dat = path.with_suffix(".DAT" if path.suffix.isupper() else ".dat")
    files.write(dat, data)  # first: whoever finds the description finds the samples
    return [files.write(path, text), dat]


def _choose_kind(recording: Recording, first_kind: str, revision: int) -> str:
    """The first kind, from `first_kind` on, that holds all values."""
    if first_kind == "FLOAT32":
        return first_kind
    kinds = KINDS[revision][KINDS[revision].index(first_kind) :]
    return next(
        (kind for kind in kinds if all(_fits(channel, kind) for channel in recording.channels)),
        "ASCII",
    )


def _fits(channel: Channel, kind: str) -> bool:
    """Whether a type of file can hold every value of a channel as it is."""
    raw = np.asarray(channel.raw)
    lacking = _find_lacking_samples(channel)
    present = raw[~lacking]
    if kind == "ASCII":
        return True
    if kind == "FLOAT32":
        with np.errstate(over="ignore"):
            return bool((present.astype(np.float32) == present).all())
    least, greatest = FULL["UNSIGNED" if _is_unsigned(channel, kind) else kind]
    low, high = channel.limits or (least, greatest)
    if not lacking.any():  # then the value that stands for none is free
        least, greatest = (least, 65535) if least == 0 else (least - 1, greatest)
    elif low < least or greatest < high == 65535:
        return False  # the file would declare that value possible
    whole = raw.dtype.kind != "f" or present == np.trunc(present)
    return bool((whole & (least <= present) & (present <= greatest)).all())


def _is_unsigned(channel: Channel, kind: str) -> bool:
    """Whether a channel's integers are stored without a sign."""
    return (
        kind == "BINARY"
        and channel.limits is not None
        and channel.limits[0] >= 0
        and channel.limits[1] > 32767
    )


def _find_lacking_samples(channel: Channel) -> np.ndarray:
    """Which samples (N,) of a channel are missing."""
    raw = np.asarray(channel.raw)
    lacking = np.isnan(raw) if raw.dtype.kind == "f" else np.zeros(len(raw), bool)
    return lacking if channel.missing is None else lacking | (raw == channel.missing)


def _find_limits(channel: Channel, kind: str) -> tuple[float, float]:
    """The least and greatest raw value that the channel declares, or its kind has; wider where a
    value would else be taken for a missing one.
    """
    raw = np.asarray(channel.raw)[~_find_lacking_samples(channel)]
    if not len(raw):
        return channel.limits or FULL[kind]
    least = float(raw.min())
    greatest = float(raw.max())
    low, high = channel.limits or FULL[kind]
    if kind == "ASCII":
        return (low, high) if greatest < 99999 else (low, max(high, greatest, 999999.0))
    if kind != "FLOAT32" and least < FULL[kind][0]:
        low = min(low, least)
    if _is_unsigned(channel, kind) and greatest > 65534:
        high = max(high, 65535)
    return low, high


def _list_times(recording: Recording) -> tuple[list[tuple[float, int]], np.ndarray, float]:
    """Rates with last samples, time stamps (N,) and their multiplier: the file's own where it had
    some.
    """
    extra, segments, count = recording.extra, recording.segments, recording.samples
    timemult = float(extra.get("timemult", 1.0))
    stamps = np.asarray(extra.get("stamps", ()), float)
    firsts = [s.first for s in segments]
    stops = [s.stop for s in segments]
    if _has_stamps_alone(extra) or [*firsts, count] != [0, *stops]:
        if len(stamps) != count:
            raise UserError(
                f"{recording.source}: its segments leave samples out, and it has no time stamps: it"
                " cannot be written as COMTRADE; write it as a table"
            )
        return [(0.0, count)], stamps, timemult
    if len(stamps) != count:
        t = np.concatenate([s.t for s in segments])
        while t[-1] > 4.29e3 * timemult:  # a counter of 32 bits
            timemult *= 10
        stamps = np.round(t / (1e-6 * timemult))
    return [(s.rate, s.stop) for s in segments], stamps, timemult


def _has_stamps_alone(extra: Mapping[str, Any]) -> bool:
    """Whether the file that was read had no rate, but time stamps."""
    rates = extra.get("rates")
    return bool(rates) and rates[0][0] == 0 and "stamps" in extra


def _write_lines(
    recording: Recording, kind: str, revision: int, rates: list[tuple[float, int]], timemult: float
) -> list[str]:
    """The lines of a configuration."""
    count = len(recording.channels)
    states = len(recording.status)
    sides = recording.extra.get("sides", [])
    if len(sides) != count:
        sides = [(1.0, 1.0, "")] * count
    lines = [
        f"{_name(recording.station)},{_name(recording.device)},{revision}",
        f"{count + states},{count}A,{states}D",
    ]
    for k, (channel, side) in enumerate(zip(recording.channels, sides, strict=True), 1):
        primary, secondary, letter = _describe_side(channel, side)
        low, high = _find_limits(channel, kind)
        fields = [k, *map(_name, (channel.name, channel.phase, channel.circuit, channel.unit))]
        numbers = (
            channel.gain,
            channel.offset,
            round(1e6 * channel.skew, 9),
            low,
            high,
            primary,
            secondary,
        )
        lines.append(",".join(map(str, [*fields, *map(_format_number, numbers), letter])))
    for k, status in enumerate(recording.status, 1):
        lines.append(
            f"{k},{_name(status.name)},{_name(status.phase)},{_name(status.circuit)},{status.normal}"
        )
    lines += [_format_number(recording.frequency), "0" if rates[0][0] == 0 else str(len(rates))]
    lines += [f"{_format_number(rate)},{stop}" for rate, stop in rates]
    lines += [*_format_moments(recording), kind, _format_number(timemult)]
    if revision >= 2013:
        lines += [
            recording.extra.get("time_code") or "0,0",
            recording.extra.get("quality") or "0,0",
        ]
    return lines


def _describe_side(
    channel: Channel, original: tuple[float, float, str]
) -> tuple[float, float, str]:
    """Primary and secondary of a channel's transformer, and the side that its values are on."""
    primary, secondary, side = original
    if channel.ratio == 1 and side != "S":
        return primary or 1.0, secondary or 1.0, "P"
    return (
        (primary, secondary, "S")
        if side == "S" and primary / secondary == channel.ratio
        else (channel.ratio, 1.0, "S")
    )


def _format_moments(recording: Recording) -> tuple[str, str]:
    """The lines of the first sample's moment and the trigger's: as the file that was read had them,
    where they still hold.
    """
    lines = recording.extra.get("dates", ("", ""))
    start, triggered = (parse_date(line, False)[0] for line in lines)
    if recording.extra.get("revision", 1991) >= 1999 and start and triggered:
        trigger = None if triggered == EPOCH else (triggered - start) / timedelta(seconds=1)
        if (start, trigger) == (recording.start, recording.trigger):
            return lines[0], lines[1]
    begin = recording.start or EPOCH
    trigger = EPOCH if recording.trigger is None else begin + timedelta(seconds=recording.trigger)
    return f"{begin:%d/%m/%Y,%H:%M:%S.%f}", f"{trigger:%d/%m/%Y,%H:%M:%S.%f}"


def _name(text: str) -> str:
    """A name that fits a field of a configuration: no commas, no line ends."""
    return " ".join(text.replace(",", ";").splitlines()).strip()


def _format_number(value: float) -> str:
    """A number as short as it can be read back to the bit."""
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(float(value))


def _pack_binary(recording: Recording, kind: str, stamps: np.ndarray) -> bytes:
    """The bytes of all samples, with their numbers and time stamps."""
    table = np.zeros(
        recording.samples, build_row_type(kind, len(recording.channels), len(recording.status))
    )
    table["n"] = _list_numbers(recording)
    good = (stamps >= 0) & (stamps < NONE)
    table["t"] = np.where(good, stamps, NONE).astype(np.uint32)
    for k, channel in enumerate(recording.channels):
        none = (
            np.nan
            if kind == "FLOAT32"
            else 65535
            if _is_unsigned(channel, kind)
            else FULL[kind][0] - 1
        )
        with np.errstate(over="ignore", invalid="ignore"):
            values = np.asarray(channel.raw).astype(
                "<u2" if _is_unsigned(channel, kind) else VALUE[kind]
            )
        values[_find_lacking_samples(channel)] = none
        table["a"][:, k] = values.view(VALUE[kind])
    for k, status in enumerate(recording.status):
        table["d"][:, k // 16] |= status.values().astype(np.uint16) << (k % 16)
    return table.tobytes()


def _list_numbers(recording: Recording) -> np.ndarray:
    """The samples' own numbers, or 1, 2, ..."""
    own = recording.extra.get("numbers")
    count = recording.samples
    return np.asarray(own) if own is not None and len(own) == count else np.arange(1, count + 1)


def _write_ascii(recording: Recording, stamps: np.ndarray) -> bytes:
    """The lines of all samples; what is missing is an empty cell."""
    columns = [_format_cells(_list_numbers(recording)), _format_cells(stamps)]
    for channel in recording.channels:
        cells = _format_cells(np.asarray(channel.raw))
        for i in np.flatnonzero(_find_lacking_samples(channel)):
            cells[i] = ""
        columns.append(cells)
    columns += [status.values().astype(str).tolist() for status in recording.status]
    return ("\r\n".join(map(",".join, zip(*columns, strict=True))) + "\r\n").encode()


def _format_cells(values: np.ndarray) -> list[str]:
    """The shortest text that reads back as the same number."""
    if values.dtype.kind in "iu":
        return values.astype(str).tolist()
    if values.dtype == np.float32:
        values = values.astype(np.float64)
    return ["" if value != value else _format_number(value) for value in values.tolist()]


def _combine_sections(recording: Recording, text: str, kind: str, data: bytes) -> bytes:
    """One file with the sections of a configuration, of information, of a header and of the
    data.
    """
    parts = [b"--- file type: CFG ---\r\n", text.encode()]
    for name, key in (("INF", "information"), ("HDR", "header")):
        said = recording.extra.get(key, "")
        parts += [f"--- file type: {name} ---\r\n".encode(), (said + "\r\n").encode()]
    heading = "DAT ASCII" if kind == "ASCII" else f"DAT {kind}: {len(data)}"
    return b"".join([*parts, f"--- file type: {heading} ---\r\n".encode(), data])
