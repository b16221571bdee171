"""What is left of the records where nothing explains it, in words: a ringing, a decay, a step or a
pulse, and where.

The whitened residual of each event is searched for c exp(-(t - t0)/tau) cos(2 pi f (t - t0) + phi),
t > t0, over all t0, tau and f at once: with z = exp(-1/tau + 2 pi i f) per sample, the sums of w[k
+ m] z^m from every k to the end are one recursive filter run backwards (a matched filter of every
start). The loudest shape is fitted as the noise lets it be seen, taken away, and the next one
looked for. f = 0 is a decay, and a step where tau is infinite too.
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tractexp.domain import find_domain
from tractexp.inference.recursion import sum_with_decay
from tractexp.model.drive import Drive
from tractexp.noise import Noise
from tractexp.noise.color import FEWEST_NOISE_SAMPLES, SMALLEST_DEVIATION
from tractexp.noise.quiet import estimate
from tractexp.record import Event

MOST_SHAPES = 4  # shapes that are told
# time constants tried, from two samples to the length of the record after the dip
TRIED_TIME_CONSTANTS = 6
FREQUENCIES = 512  # tried at most with each of them
HIGHEST_RELATIVE_FREQUENCY = 0.45  # of the sampling rate
SHORTEST_SHAPE = 8  # samples of a shape
POLISH_ROUNDS = 2  # of polishing the frequency and the decay, then the start
NEIGHBORS = 5  # of a shape along its time constant and its frequency, itself among them
ZOOMS = 8  # on the best of them, each half as wide as the last
# the widest: of the logarithm of the time constant, and of the frequency times that constant
DECAY_REACH, FREQUENCY_REACH = 0.6, 0.03
STAYS = 3.0  # lengths of the rest of the record: what takes so long to die away does not
PULSE = 3.0  # samples: what is over sooner is a pulse
# of what a shape must gain: one that gains less before it is polished never does
LEAST_UNPOLISHED_GAIN = 0.6
SPARING = 2.0  # of log(samples): what the two more numbers of a ringing must gain over a decay


@dataclass(frozen=True)
class Remainder:
    """One shape that is left: `size` is its amplitude at first [pu], with its sign where it does
    not ring.

    `noise` is the size in standard deviations of the channel's noise before the dip, `share` the
    part of what exceeds the noise that it accounts for, `after` the time since the dip began, or
    since it ended where it has `ended`.
    """

    event: str
    channel: str
    kind: str  # "ringing", "decay", "step" or "pulse"
    start: float  # s, time of the record
    after: float  # s
    ended: bool
    frequency: float | None  # Hz
    time_constant: float | None  # s; None where it stays
    damping: float | None  # ratio of a ringing
    size: float
    noise: float
    share: float

    def __str__(self) -> str:
        """What is left, where, from when on, and whether it dies away."""
        size = f"{abs(self.size):.2g} pu ({self.times} the noise)"
        what = f"{self.channel} of {self.event}"
        when = f"from t = {self.start:.3f} s on, {self.when}"
        way = "up" if self.size > 0 else "down"
        if self.kind == "ringing":
            return f"{what} rings at {self.frequency:.3g} Hz {when}, at first by {size}{self._ends}"
        if self.kind == "pulse":
            assert self.time_constant is not None
            length = f"some {1000 * self.time_constant:.2g} ms"
            return (
                f"{what} has a pulse {way} of {size} at t = {self.start:.3f} s, {self.when}, of"
                f" {length}"
            )
        return f"{what} is {way} by {size} {when}{self._ends}"

    @property
    def times(self) -> str:
        """The size, told by the noise."""
        return f"{self.noise:.{int(self.noise < 10)}f} times"

    @property
    def when(self) -> str:
        """The start, told by the dip."""
        edge = "the dip ends" if self.ended else "the dip begins"
        if abs(self.after) < 0.0015:
            return f"as {edge}"
        side = "after" if self.after > 0 else "before"
        return f"{abs(self.after):.3g} s {side} {edge}"

    @property
    def _ends(self) -> str:
        """How it ends."""
        if self.time_constant is None:
            return ", and does not die away" if self.kind == "ringing" else ", and stays so"
        damping = "" if self.damping is None else f" (damping ratio {self.damping:.2g})"
        return f", and dies away with a time constant of {self.time_constant:.2g} s{damping}"


class _Shape(NamedTuple):
    """Where a shape begins [sample], its time constant [samples, inf] and its frequency [cycles per
    sample].
    """

    start: int
    decay: float
    frequency: float

    def rings(self, samples: int) -> bool:
        """Whether there is a cycle of it in so many samples and half of one before it dies away,
        and samples enough.
        """
        lasts = min(2 * self.decay, samples - self.start)
        return lasts >= SHORTEST_SHAPE and self.frequency * lasts >= 1

    def templates(self, samples: int) -> np.ndarray:
        """Its shapes of unit size, (1 or 2, samples): cosine and sine of a ringing."""
        m = np.arange(samples) - self.start
        envelope = np.where(m >= 0, np.exp(-np.maximum(m, 0) / self.decay), 0.0)
        if not self.frequency:
            return envelope[None]
        phase = 2 * np.pi * self.frequency * m
        return envelope * np.stack([np.cos(phase), np.sin(phase)])


@dataclass(frozen=True, eq=False)
class _Stretch:
    """What is left of one event, (C, n) [pu], and how its own noise whitens it."""

    event: Event
    residual: np.ndarray
    noise: Noise
    drive: Drive

    @classmethod
    def from_event(
        cls, event: Event, residual: np.ndarray, noise: Noise, input_modes: np.ndarray | None
    ) -> "_Stretch":
        """The color of the noise is that before the dip, where that tells it: what is left would
        color its own.

        Of waveforms it stays what it is, for what is left cannot color that.
        """
        drive = Drive.from_events([find_domain(event).excitation(event)])
        domain = find_domain(event)
        valid = drive.weights > 0
        before = slice(0, event.start)
        if (
            not domain.noise_from_model
            and np.count_nonzero(np.all(valid, axis=0)[before]) >= FEWEST_NOISE_SAMPLES
        ):
            noise = estimate(_remove_lines(residual[:, before]), valid[:, before], [before])
        return cls(
            event, residual, replace(noise, random_walk=None, input_modes=input_modes), drive
        )

    @property
    def size(self) -> int:
        """How many values are judged there."""
        return find_domain(self.event).values(self.drive)

    @functools.cached_property
    def white_residual(self) -> np.ndarray:
        """What is left, as independent rows (C, n) of unit variance."""
        return self.white(self.residual[None])[0]

    def white(self, rows: np.ndarray) -> np.ndarray:
        """(m, C, n) [pu] to independent rows (m, C, n) of unit variance."""
        return self.noise.whiten(rows, self.drive, self.drive.weights > 0).reshape(rows.shape)

    def fit_shapes(self, shapes: Sequence[_Shape], channel: int) -> tuple[np.ndarray, np.ndarray]:
        """By how much each of shapes of one kind in one channel lowers the deviance (m,), and its
        sizes (m, 1 or 2) [pu].
        """
        templates = np.stack([shape.templates(self.residual.shape[1]) for shape in shapes])
        raw = np.zeros((*templates.shape[:2], *self.residual.shape))
        raw[:, :, channel] = templates
        rows = self.white(raw.reshape(-1, *self.residual.shape)).reshape(*templates.shape[:2], -1)
        shared = rows @ self.white_residual.ravel()
        inverse = np.linalg.pinv(rows @ rows.transpose(0, 2, 1), hermitian=True)
        sizes = np.einsum("mkl,ml->mk", inverse, shared)
        return np.sum(shared * sizes, axis=1), sizes

    def find_best(self, shapes: Sequence[_Shape], channel: int) -> tuple[float, _Shape]:
        """That of shapes of one kind which lowers the deviance most, and by how much."""
        samples = self.residual.shape[1]
        visible = [not shape.frequency or shape.rings(samples) for shape in shapes]
        gains = np.where(visible, self.fit_shapes(shapes, channel)[0], 0.0)
        return float(gains.max()), shapes[int(gains.argmax())]

    def take_away(self, shape: _Shape, channel: int) -> tuple[np.ndarray, "_Stretch"]:
        """The sizes (1 or 2,) [pu] of a shape, and what is left without it."""
        sizes = self.fit_shapes([shape], channel)[1][0]
        residual = self.residual.copy()
        residual[channel] -= sizes @ shape.templates(residual.shape[1])
        return sizes, replace(self, residual=residual)


def _remove_lines(rows: np.ndarray) -> np.ndarray:
    """Rows (C, n) about their straight lines: what a fit leaves before the dip may lie off zero."""
    x = np.linspace(-1.0, 1.0, rows.shape[1])
    return rows - np.stack([np.polynomial.Polynomial.fit(x, row, 1)(x) for row in rows])


def find_remainders(
    residual: np.ndarray, events: Sequence[Event], noise: Noise, false_alarms: float = 0.05
) -> list[Remainder]:
    """The shapes that stand out of residuals (C, N) [pu], measured less calculated, of events end
    to end.

    The loudest first, at most `MOST`; none where white noise would show as much with a probability
    of `false_alarms`. Gaps are 0. `noise` is what a fit left in quiet stretches.
    """
    ends = np.cumsum([0, *(event.record.samples for event in events)])
    parts = [slice(a, b) for a, b in itertools.pairwise(ends.tolist())]
    modes = noise.input_modes
    stretches = [
        _Stretch.from_event(
            event,
            residual[:, part],
            noise.select_event(e),
            None if modes is None else modes[:, :, part],
        )
        for e, (event, part) in enumerate(zip(events, parts, strict=True))
    ]
    excess = sum(float(np.sum(s.white_residual**2)) - s.size for s in stretches)
    loudest = [_find_loudest(s, false_alarms / len(stretches)) for s in stretches]
    shapes: list[Remainder] = []
    while len(shapes) < MOST_SHAPES and (
        candidates := [(one, e) for e, one in enumerate(loudest) if one]
    ):
        (gain, shape, channel), e = max(candidates, key=lambda found: found[0][0])
        sizes, stretches[e] = stretches[e].take_away(shape, channel)
        shapes.append(
            _describe_shape(stretches[e], shape, channel, sizes, gain / max(excess, gain))
        )
        loudest[e] = _find_loudest(stretches[e], false_alarms / len(stretches))
    return shapes


def _find_loudest(stretch: _Stretch, false_alarms: float) -> tuple[float, _Shape, int] | None:
    """(gain in deviance, shape, channel) of the shape that lowers the deviance of an event most;
    None where its gain is within chance.

    The bound on chance is that of as many independent tries as there are starts, decays and
    frequencies.
    """
    white = stretch.white_residual
    tried, candidates = _search_shapes(white, max(stretch.event.start - 2, 0))
    ringing_penalty = SPARING * np.log(white.size)
    gain, shape, channel = max(
        candidates, key=lambda found: found[0] - ringing_penalty * (found[1].frequency > 0)
    )
    limit = 2 * np.log(tried / false_alarms)
    if gain < LEAST_UNPOLISHED_GAIN * limit:
        return None
    gain, shape = _refine_shape(stretch, shape, channel)
    return (gain, shape, channel) if gain > limit else None


def _search_shapes(white: np.ndarray, first: int) -> tuple[int, list[tuple[float, _Shape, int]]]:
    """How many shapes were tried in white rows (C, n) from sample `first` on, and the best of each
    kind: what it gains, itself and its channel.
    """
    length = white.shape[1] - first
    decays = np.geomspace(2.0, max(length, 4), TRIED_TIME_CONSTANTS)
    shapes = [(float(d), 0.0) for d in (*decays, np.inf)]
    for d in decays[decays >= SHORTEST_SHAPE / 2]:
        spacing = max(1 / (2 * length), 1 / (8 * d))
        frequencies = np.arange(max(0.5 / d, 1 / length), HIGHEST_RELATIVE_FREQUENCY, spacing)[
            :FREQUENCIES
        ]
        shapes += [(float(d), float(f)) for f in frequencies]
    best: dict[bool, tuple[float, _Shape, int]] = {}
    for decay, frequency in shapes:
        gains = _compute_gains(white[:, first:], decay, frequency)
        channel, k = divmod(int(gains.argmax()), gains.shape[1])
        if (gain := float(gains[channel, k])) > best.get(frequency > 0, (-1.0,))[0]:
            best[frequency > 0] = gain, _Shape(first + k, decay, frequency), channel
    return len(white) * length * len(shapes), list(best.values())


def _compute_gains(white: np.ndarray, decay: float, frequency: float) -> np.ndarray:
    """Drop of the sum of squares (C, n + 1 - `SHORTEST_SHAPE`) by a shape from each sample on, in
    each channel.
    """
    z = complex(np.exp(-1 / decay + 2j * np.pi * frequency))
    sums = np.stack([sum_with_decay(row[::-1], z)[::-1] for row in white])
    every = np.ones(white.shape[1])
    power = sum_with_decay(every, abs(z) ** 2).real[::-1]
    if not frequency:
        return (sums.real**2 / power)[:, : 1 - SHORTEST_SHAPE]
    double = sum_with_decay(every, z * z)[::-1]
    cc, ss, cs = (power + double.real) / 2, (power - double.real) / 2, double.imag / 2
    a, b, determinant = sums.real, sums.imag, cc * ss - cs**2
    gain = (ss * a**2 - 2 * cs * a * b + cc * b**2) / np.maximum(determinant, 1e-9)
    return np.where(determinant > 0.01 * power**2 / 4, gain, 0.0)[:, : 1 - SHORTEST_SHAPE]


def _refine_shape(stretch: _Stretch, shape: _Shape, channel: int) -> tuple[float, _Shape]:
    """The best shape near one, as the noise lets it be seen in one channel, and what it gains."""
    n = stretch.residual.shape[1]
    gain = 0.0
    for _ in range(POLISH_ROUNDS):
        for zoom in 0.5 ** np.arange(ZOOMS if np.isfinite(shape.decay) else 0):
            gain, shape = stretch.find_best(_list_neighbors(shape, zoom, n), channel)
        period = 1 / shape.frequency if shape.frequency else 4.0
        reach = int(np.clip(period / 2, 3, 25))
        near = range(max(shape.start - reach, 0), min(shape.start + reach, n - SHORTEST_SHAPE) + 1)
        gain, shape = stretch.find_best([shape._replace(start=k) for k in near], channel)
    return gain, shape


def _list_neighbors(shape: _Shape, zoom: float, samples: int) -> list[_Shape]:
    """A shape and those around it, of other time constants and, where it rings, of other
    frequencies.
    """
    steps = zoom * np.linspace(-1, 1, NEIGHBORS)
    decays = np.clip(shape.decay * np.exp(DECAY_REACH * steps), 1.0, 20.0 * samples)
    frequencies = np.zeros(1)
    if shape.frequency:
        frequencies = np.abs(shape.frequency + FREQUENCY_REACH * steps / shape.decay)
    pairs = itertools.product(decays, frequencies)
    return [shape._replace(decay=float(d), frequency=float(f)) for d, f in pairs]


def _name_kind(shape: _Shape, time_constant: float | None) -> str:
    """What a shape is called."""
    if shape.frequency:
        return "ringing"
    if time_constant is None:
        return "step"
    return "pulse" if shape.decay < PULSE else "decay"


def _describe_shape(
    stretch: _Stretch, shape: _Shape, channel: int, sizes: np.ndarray, share: float
) -> Remainder:
    """A shape as a person reads it."""
    event = stretch.event
    step = stretch.event.record.step
    rest = stretch.residual.shape[1] - shape.start
    tau = shape.decay * step if shape.decay < STAYS * rest else None
    size = float(np.hypot(*sizes)) if shape.frequency else float(sizes[0])
    level = max(event.levels[channel], SMALLEST_DEVIATION)
    start = float(event.record.t[shape.start])
    ended = start > event.t_end - 1.5 * step
    frequency = shape.frequency / step if shape.frequency else None
    pace = None if tau is None or frequency is None else np.hypot(2 * np.pi * frequency * tau, 1.0)
    return Remainder(
        event=event.record.name,
        channel=stretch.drive.labels[channel],
        kind=_name_kind(shape, tau),
        start=start,
        after=start - (event.t_end if ended else event.t_start),
        ended=ended,
        frequency=frequency,
        time_constant=tau,
        damping=None if pace is None else float(1 / pace),
        size=size,
        noise=abs(size) / level,
        share=float(share),
    )
