"""Phasors of many channels at once, one window of a cycle after another: enough for an overview of
a file.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from tractexp.recording.recording import FEWEST_PER_CYCLE, Channel, Recording, Segment

NOMINAL = (50.0, 60.0, 50 / 3)  # Hz, of the networks there are
OTHER_FREQUENCY = 0.06  # of the nominal one: what is farther off belongs to another
TUNED = 0.06  # of a nominal frequency: a network's frequency strays no farther
MOST_WINDOWS = 1500  # of a segment: half a minute at 50 Hz without a gap; a longer one is sampled
PURE = 0.8  # of the energy about the mean lies in the fundamental of a channel that holds a wave
UNLOADED = 0.005  # of the greatest current in the file: less is an unloaded feeder
# windows of a cycle: what a load draws for three quarters of so long (or of a quarter of a short
# record)
LONG_SNAPSHOT_WINDOWS = 25
# of a spectrum, so that a short one has lines between those that its samples tell apart
FEWEST_LINES = 1 << 14


# {recording: {(number, segment, f): (phasors, rest)}}: each load, bus and check of a file asks for
# the same channels
_measured: WeakKeyDictionary[
    Recording, dict[tuple[int, Segment, float], tuple[np.ndarray, np.ndarray]]
] = WeakKeyDictionary()


# {recording: the frequency [Hz] of its network}
_network: WeakKeyDictionary[Recording, float | None] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Snapshots:
    """RMS phasors of channels, one window of about a cycle each, in a frame that turns at `f` since
    time zero.
    """

    numbers: tuple[int, ...]  # of the channels, as the recording counts them
    t: np.ndarray  # (M,) s, centers of the windows
    X: np.ndarray  # (K, M) kV or kA; nan where samples are missing
    f: float  # Hz
    rest: np.ndarray  # (K, M) RMS of what is neither mean nor fundamental
    # answers that each load asks for again
    remembered: dict[Any, Any] = field(default_factory=dict)

    def select_channels(self, numbers: Sequence[int]) -> np.ndarray:
        """The phasors (K, M) of some of the channels."""
        return self.X[[self.numbers.index(n) for n in numbers]]

    def pure(self, number: int) -> bool:
        """Whether the channel is a wave of this frequency in at least some of the windows where it
        is largest.
        """
        return self.remember(("pure", number), lambda: self._turns(number))

    def _turns(self, number: int) -> bool:
        """Whether a channel is mostly a phasor where it is large."""
        k = self.numbers.index(number)
        size = np.abs(self.X[k])
        if not np.isfinite(size).any() or np.nanmax(size) == 0:
            return False
        large = size >= 0.5 * np.nanmax(size)
        return bool(
            np.nanmedian(self.rest[k][large] ** 2)
            <= (1 / PURE - 1) * np.nanmedian(size[large] ** 2)
        )

    def size(self, numbers: Sequence[int]) -> float:
        """Magnitude [kV, kA], mean over the channels, where it is large for long: no fault's, nor
        that after a trip.
        """
        return self.remember(("size", *numbers), lambda: self._size(numbers))

    def remember(self, key: Any, answer: Callable[[], Any]) -> Any:
        """The answer to a question asked before, else this `answer`, which is then kept."""
        if key not in self.remembered:
            self.remembered[key] = answer()
        return self.remembered[key]

    def _size(self, numbers: Sequence[int]) -> float:
        """The size that channels keep for a while, which no short pulse has."""
        size = np.nan_to_num(np.abs(self.select_channels(numbers))).mean(axis=0)
        if not len(size):
            return 0.0
        spans = np.lib.stride_tricks.sliding_window_view(
            size, max(1, min(LONG_SNAPSHOT_WINDOWS, len(size) // 4))
        )
        return float(np.percentile(spans, 25, axis=1).max())


def take_snapshots(
    recording: Recording, numbers: Sequence[int], frequency: float | None = None
) -> Snapshots | None:
    """Windows of all segments that hold two cycles or more of waveforms, one after another; None
    where there is none.

    In each the least-squares fit of a mean and a sinusoid of `frequency` [Hz] (by default the
    nominal one).
    """
    f = frequency or recording.frequency
    fast = [
        s
        for s in recording.segments
        if s.rate >= FEWEST_PER_CYCLE * f and s.stop - s.first >= 2 * s.rate / f + 1
    ]
    parts = [_measure_windows(recording, numbers, segment, f) for segment in fast]
    if not parts:
        return None
    t, X, rest = (np.concatenate(each, axis=-1) for each in zip(*parts, strict=True))
    return Snapshots(tuple(numbers), t, X, f, rest)


def _measure_windows(
    recording: Recording, numbers: Sequence[int], segment: Segment, f: float
) -> tuple[np.ndarray, ...]:
    """Phasors of whole cycles spread over a segment: start [s], phasor and rest of each channel;
    measured once.
    """
    n = round(segment.rate / f)
    count = (segment.stop - segment.first) // n
    firsts = np.unique(np.linspace(0, count - 1, min(count, MOST_WINDOWS)).astype(int)) * n
    start = segment.start + firsts / segment.rate
    known = _measured.setdefault(recording, {})
    every = [(number, segment, f) for number in numbers]
    for each in every:
        if each not in known:
            X, rest = _measure_channel(
                recording.channels[each[0]], segment, f, n, firsts, len(firsts) == count
            )
            known[each] = (X * np.exp(-2j * np.pi * f * start), rest)
    X, rest = (np.array([known[each][k] for each in every]) for k in (0, 1))
    return start + (n - 1) / 2 / segment.rate, X, rest


def _measure_channel(
    channel: Channel, segment: Segment, f: float, n: int, firsts: np.ndarray, whole: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Phasors (M,) and rest (M,) of one channel in windows of n samples, whose first are counted
    from the segment's.
    """
    begin = segment.first
    basis, inverse = _build_basis(f / segment.rate, n)
    if whole:
        blocks = channel.values(begin, begin + len(firsts) * n).reshape(len(firsts), n)
    else:
        blocks = np.array([channel.values(begin + i, begin + i + n) for i in firsts])
    fitted = blocks @ inverse.T  # (M, 3)
    return fitted[:, 1] + 1j * fitted[:, 2], np.sqrt(
        np.mean((blocks - fitted @ basis.T) ** 2, axis=1)
    )


@functools.lru_cache(maxsize=64)
def _build_basis(turns: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sinusoid (n, 3) of so many turns a sample, and what fits them to samples (3, n)."""
    phase = 2 * np.pi * turns * np.arange(n)
    basis = np.column_stack([np.ones(n), np.sqrt(2) * np.cos(phase), -np.sqrt(2) * np.sin(phase)])
    return basis, np.linalg.pinv(basis)


def measure_frequency(recording: Recording, numbers: Sequence[int]) -> float | None:
    """Frequency [Hz] measured on the largest of the channels while it is alive; None where none
    turns.

    The strongest line of its spectrum between 10 and 75 Hz, refined by how its phase turns from
    window to window.
    """
    coarse = [
        line
        for s in recording.segments
        if (line := _find_strongest_line(recording, numbers, s)) is not None
    ]
    if not coarse:
        return None
    at = max(coarse)[1]
    windows = take_snapshots(recording, numbers, at)
    if windows is None or windows.X.shape[1] < 3:
        return at
    X = np.nan_to_num(windows.X)
    x = X[int(np.argmax(np.median(np.abs(X), axis=1)))]
    alive = np.abs(x) > 0.5 * np.abs(x).max()
    pairs = alive[1:] & alive[:-1] & (np.diff(windows.t) < 1.5 * np.median(np.diff(windows.t)))
    if np.count_nonzero(pairs) < 2:
        return at
    turned = (np.angle(x[1:] * x[:-1].conj()) / np.diff(windows.t) / (2 * np.pi))[pairs]
    return at + float(np.median(turned))


def measure_network_frequency(recording: Recording) -> float | None:
    """The network's frequency [Hz] as the largest of a recording's channels shows it; None where
    none does.
    """
    if recording not in _network:
        volts = [i for i, c in enumerate(recording.channels) if c.quantity == "voltage"]
        f = measure_frequency(recording, volts) or measure_frequency(
            recording, range(len(recording.channels))
        )
        _network[recording] = f if f is not None and find_nominal_frequency(f) is not None else None
    return _network[recording]


def choose_frequency(recording: Recording, numbers: Sequence[int]) -> float | None:
    """That of the network, where some of the channels turn with it; else as `frequency`."""
    f = measure_network_frequency(recording)
    seen = take_snapshots(recording, numbers, f) if f is not None else None
    if seen is not None and any(seen.pure(number) for number in numbers):
        return f
    return measure_frequency(recording, numbers)


def _find_strongest_line(
    recording: Recording, numbers: Sequence[int], segment: Segment
) -> tuple[float, float] | None:
    """(energy, frequency [Hz]) of the strongest line of a segment's first two seconds; None for a
    slow or short one.
    """
    n = min(segment.stop - segment.first, int(2 * segment.rate))
    if segment.rate < 10 * 16 or n < 0.05 * segment.rate or not numbers:
        return None
    waves = [recording.channels[i].values(segment.first, segment.first + n) for i in numbers]
    size = [float(np.nanstd(w)) if np.isfinite(w).any() else 0.0 for w in waves]
    wave = np.nan_to_num(waves[int(np.argmax(size))])
    if not np.any(wave):
        return None
    padded = max(2 * n, min(8 * n, FEWEST_LINES))
    power = np.abs(np.fft.rfft((wave - wave.mean()) * np.hanning(n), padded)) ** 2
    lines = np.fft.rfftfreq(padded, 1 / segment.rate)
    power[(lines < 10) | (lines > 75)] = 0
    best = int(np.argmax(power))
    return float(power[best]) * n, float(lines[best])


def find_nominal_frequency(f: float) -> float | None:
    """The nominal frequency [Hz] that a measured one belongs to; None for none."""
    best = min(NOMINAL, key=lambda each: abs(f / each - 1))
    return best if abs(f / best - 1) <= TUNED else None
