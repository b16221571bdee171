"""A fault recording in COMTRADE form: checked, its channels chosen, its waveforms in primary kV and kA."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError, nearest

ENCODINGS = ("utf-8", "gbk", "cp1251", "latin-1")  # tried in this order; the last one never fails
VALUE_BYTES = {"BINARY": 2, "BINARY32": 4, "FLOAT32": 4}  # of one analog value; ASCII has lines instead
UNITS = {
    "voltages": {"v": 1e-3, "volt": 1e-3, "volts": 1e-3, "kv": 1.0},  # to kV
    "currents": {"a": 1e-3, "amp": 1e-3, "amps": 1e-3, "ampere": 1e-3, "amperes": 1e-3, "ka": 1.0},  # to kA
}
FEWEST_PER_CYCLE = 10  # samples: a slower segment holds no waveform but magnitudes


@dataclass(frozen=True)
class Segment:
    """Samples of one rate: numbers from `first` up to but not including `stop`, from `start` [s] on."""

    first: int
    stop: int
    rate: float  # Hz
    start: float  # s since the file's first sample


@dataclass(frozen=True, eq=False)
class Recording:
    """A COMTRADE file pair. `channels` are the `comtrade` package's analog channels, `values` their samples."""

    path: Path
    channels: Sequence[Any]
    values: Sequence[np.ndarray]  # each (N,), in the units of the .cfg
    segments: tuple[Segment, ...]
    frequency: float  # Hz, nominal

    @classmethod
    def load(cls, path: Path, encoding: str | None = None) -> "Recording":
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
        segments = _segments(dat, head, np.asarray(file.time))
        values = [np.asarray(channel) for channel in file.analog]
        return cls(cfg, head.analog_channels, values, segments, head.frequency or 50.0)

    def waveforms(self) -> list[Segment]:
        """The segments sampled fast enough to hold a waveform; raises `UserError` when there is none."""
        fast = [s for s in self.segments if s.rate >= FEWEST_PER_CYCLE * self.frequency]
        if not fast:
            rates = ", ".join(f"{s.rate:g} Hz" for s in self.segments)
            raise UserError(
                f"{self.path}: sampled at {rates}: no waveform, for which {FEWEST_PER_CYCLE} samples per cycle of "
                f"{self.frequency:g} Hz are needed"
            )
        return fast

    def phases(self, key: str, chosen: Sequence[Any]) -> list[int]:
        """The three channels of setting `data.key` ("voltages" or "currents"), as numbers from 0."""
        if len(chosen) != 3:
            raise UserError(
                f"data.{key}={list(chosen)} must name three channels, phases a, b, c; {self.path.name} has "
                + ", ".join(f"{i} '{c.name}' [{c.uu}]" for i, c in enumerate(self.channels))
            )
        numbers = [self._channel(key, each) for each in chosen]
        if len(set(numbers)) < 3:
            raise UserError(f"data.{key}={list(chosen)} names a channel twice; three different phases are needed")
        other = UNITS["currents" if key == "voltages" else "voltages"]
        for i in numbers:
            if self.channels[i].uu.strip().lower() in other:
                raise UserError(
                    f"data.{key}: channel {i} '{self.channels[i].name}' of {self.path} is in {self.channels[i].uu}; "
                    f"choose {key}"
                )
        return numbers

    def check_order(self, voltages: Sequence[int], currents: Sequence[int]) -> None:
        """Raise `UserError` where the file labels the phases and voltages and currents disagree in order."""
        labels = ["".join(self.channels[i].ph.strip().upper() for i in each) for each in (voltages, currents)]
        if all(len(set(label)) == len(label) == 3 for label in labels):
            v, c = labels
            if set(v) == set(c) and v != c:
                raise UserError(
                    f"data.currents are the phases {', '.join(c)} where data.voltages are {', '.join(v)}, says "
                    f"{self.path}; give both in the same order"
                )

    def primary(self, key: str, number: int, segment: Segment) -> np.ndarray:
        """Primary values of a channel (M,) in kV or kA; raises `UserError` where one is missing."""
        channel = self.channels[number]
        values = self.values[number][segment.first : segment.stop]
        if not np.isfinite(values).all():
            i = segment.first + int(np.argmin(np.isfinite(values)))
            raise UserError(f"{self.path}: channel {number} '{channel.name}' has no value at sample {i + 1}")
        ratio = 1.0
        if channel.pors.strip().upper() == "S":
            if channel.primary <= 0 or channel.secondary <= 0:
                raise UserError(
                    f"{self.path}: channel {number} '{channel.name}' is in secondary values, but its ratio "
                    f"{channel.primary:g}/{channel.secondary:g} is not positive"
                )
            ratio = channel.primary / channel.secondary
        return values * (ratio * UNITS[key].get(channel.uu.strip().lower(), 1e-3))

    def _channel(self, key: str, each: Any) -> int:
        """A channel's number from its number or name."""
        names = [channel.name.strip() for channel in self.channels]
        if isinstance(each, int) and not isinstance(each, bool):
            if not 0 <= each < len(names):
                raise UserError(
                    f"data.{key}: there is no channel {each} in {self.path}, which has {len(names)}, counted from 0"
                )
            return each
        if str(each) not in names:
            raise UserError(f"data.{key}: {self.path} has no analog channel '{each}'{nearest(str(each), names)}")
        if names.count(str(each)) > 1:
            raise UserError(f"data.{key}: {self.path} has several channels '{each}'; give the number, from 0")
        return names.index(str(each))


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
