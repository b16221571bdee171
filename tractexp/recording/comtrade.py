"""COMTRADE files (IEEE C37.111) read and checked."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError, nearest
from tractexp.recording.recording import UNITS, Channel, Recording, Segment

ENCODINGS = ("utf-8", "gbk", "cp1251", "latin-1")  # tried in this order; the last one never fails
VALUE_BYTES = {"BINARY": 2, "BINARY32": 4, "FLOAT32": 4}  # of one analog value; ASCII has lines instead


def load(path: Path, encoding: str | None = None) -> Recording:
    """Read a .cfg and the .dat beside it; raises `UserError` where they are missing, cut short or disagree."""
    import comtrade

    cfg, dat = _pair(path)
    encoding = _encoding(cfg, encoding)
    try:
        head = comtrade.Cfg(ignore_warnings=True)
        head.load(str(cfg), encoding=encoding)
    except (ValueError, IndexError, TypeError, AttributeError, comtrade.ComtradeError) as error:
        raise UserError(f"{cfg}: not a consistent COMTRADE configuration: {error}") from error
    _check_header(cfg, head)
    _check_size(dat, head)
    file = comtrade.Comtrade(ignore_warnings=True, use_numpy_arrays=True, use_double_precision=True)
    try:
        file.load(str(cfg), str(dat), encoding=encoding)
    except (ValueError, IndexError, TypeError, comtrade.ComtradeError) as error:
        raise UserError(f"{dat}: does not hold what {cfg.name} announces: {error}") from error
    channels = [_channel(cfg, k, head.analog_channels[k], file.analog[k]) for k in range(head.analog_count)]
    return Recording(str(cfg), channels, _segments(dat, head, np.asarray(file.time)), head.frequency or 50.0)


def _channel(cfg: Path, number: int, told: Any, values: Any) -> Channel:
    ratio = 1.0
    if told.pors.strip().upper() == "S":
        if told.primary <= 0 or told.secondary <= 0:
            raise UserError(
                f"{cfg}: channel {number} '{told.name}' is in secondary values, but its ratio "
                f"{told.primary:g}/{told.secondary:g} is not positive"
            )
        ratio = told.primary / told.secondary
    quantity = UNITS.get(told.uu.strip().lower(), ("", 1.0))[0]
    return Channel(
        told.name.strip(), np.asarray(values), told.uu.strip(), quantity, told.ph.strip(), told.ccbm.strip(),
        ratio=ratio, skew=told.skew * 1e-6,
    )  # fmt: skip


def _pair(path: Path) -> tuple[Path, Path]:
    """The .cfg and .dat files, whatever the case of their endings."""
    if path.suffix.lower() != ".cfg":
        raise UserError(f"data.path={path}: give the .cfg file of a COMTRADE record; its .dat is read beside it")
    if not path.is_file():
        found = [item.name for item in path.parent.iterdir()] if path.parent.is_dir() else []
        raise UserError(f"{path}: there is no such file{nearest(path.name, found)}")
    for suffix in (".dat", ".DAT", ".Dat"):
        if path.with_suffix(suffix).is_file():
            return path, path.with_suffix(suffix)
    raise UserError(f"{path.with_suffix('.dat')}: there is no such file; the data must lie beside {path.name}")


def _encoding(cfg: Path, given: str | None) -> str:
    content = cfg.read_bytes()
    for encoding in (given,) if given else ENCODINGS:
        try:
            content.decode(encoding)
        except LookupError as error:
            raise UserError(f"data.encoding={given}: there is no such text encoding; try utf-8, gbk, cp1251") from error
        except UnicodeDecodeError:
            continue
        return encoding
    raise UserError(f"{cfg}: not {given} text; leave data.encoding out to have it found")


def _check_header(cfg: Path, head: Any) -> None:
    if head.channels_count != head.analog_count + head.status_count:
        raise UserError(
            f"{cfg}: line 2 announces {head.channels_count} channels but {head.analog_count} analog and "
            f"{head.status_count} status ones"
        )
    ends = [end for _, end in head.sample_rates]
    if not ends or ends[0] < 1 or np.any(np.diff(ends) <= 0):
        raise UserError(f"{cfg}: the last samples {ends} of the sampling rates must be positive and increase")
    if any(rate < 0 or (rate == 0 and not head.timestamp_critical) for rate, _ in head.sample_rates):
        raise UserError(f"{cfg}: sampling rates {[rate for rate, _ in head.sample_rates]} must be above zero")
    if head.ft.upper() not in (*VALUE_BYTES, "ASCII"):
        raise UserError(f"{cfg}: data file type '{head.ft}' is not one of ASCII, {', '.join(VALUE_BYTES)}")


def _check_size(dat: Path, head: Any) -> None:
    """Refuse a .dat shorter than announced: the package would leave its end zero."""
    samples = head.sample_rates[-1][1]
    if head.ft.upper() == "ASCII":
        with dat.open("rb") as lines:
            found, expected, unit = sum(1 for line in lines if line.strip(b" \r\n\x1a")), samples, "lines"
    else:
        row = 8 + VALUE_BYTES[head.ft.upper()] * head.analog_count + 2 * math.ceil(head.status_count / 16)
        found, expected, unit = dat.stat().st_size, samples * row, "bytes"
    if found < expected:
        raise UserError(
            f"{dat}: cut short: {samples} samples of {head.analog_count} analog and {head.status_count} status "
            f"channels take {expected} {unit}, found {found}"
        )


def _segments(dat: Path, head: Any, time: np.ndarray) -> tuple[Segment, ...]:
    """Rates and times from the .cfg; from the time stamps where it gives no rate."""
    if head.timestamp_critical:
        steps = np.diff(time)
        usual = float(np.median(steps))
        if usual <= 0 or np.abs(steps / usual - 1).max() > 0.05:
            i = int(np.argmax(np.abs(steps - usual))) + 1
            raise UserError(f"{dat}: sample {i + 1}: time advances by {steps[i - 1]:g} s where {usual:g} s is usual")
        return (Segment(0, len(time), (len(time) - 1) / float(time[-1] - time[0]), 0.0),)
    made, first, start = [], 0, 0.0
    for rate, stop in head.sample_rates:
        start += 1 / rate if made else 0.0
        made.append(Segment(first, stop, rate, start))
        first, start = stop, start + (stop - first - 1) / rate
    return tuple(made)
