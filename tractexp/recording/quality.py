"""How well a channel was recorded, and what it is fit for."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.record.change import find_runs
from tractexp.recording.recording import FEWEST_PER_CYCLE, Channel, Recording, Segment
from tractexp.recording.snapshot import find_nominal_frequency, measure_frequency, take_snapshots
from tractexp.text.wording import list_first

CLIPPED = 3  # samples in a row at the greatest or least value
FLAT_TOP = 1e-4  # of the span: values so near each other are one value
WAVES = 1000.0  # Hz: slower sampling cannot show a stator transient
FEW_CLIPPED = 1e-3  # of the samples: more is not fit for waves
WHITE = 3.0  # standard errors that the lag-1 correlation of white noise stays within
STAMP_GAP_STEPS = 1.5  # steps: time stamps farther apart leave a gap
HARMONICS = 25  # as many as the rate allows are taken away to see the noise
QUIET_CYCLES = 10  # whole cycles in which noise and distortion are estimated, if so many are calm
LONGEST_CALM = 60.0  # s of it in which they are sought
SORTED = 1 << 20  # samples among which the least difference of two is sought
CYCLES_AT_ONCE = 1024  # cycles that are compared at once
WINDOWS_AT_ONCE = 64  # of ten cycles each
FEWEST_CALM = 2  # cycles in a row that repeat: one alone is no calm
# of the energy of two cycles: what they differ by at most where one repeats the other
LARGEST_REPEAT_DIFFERENCE = 0.2
LARGEST_RMS_DIFFERENCE = 0.05  # by which their RMS differs at most
# of the RMS of the largest calm: less is a dead line's, and not the state before an event
AT_WORK = {"voltage": 0.5}
MOST_CLIPPED_TOLD = 3  # that are told
IDLE = 0.005  # the same of a current, which a fault multiplies


@dataclass(frozen=True)
class Quality:
    """The quality of one channel in one segment. Sizes in kV, kA or the channel's own unit; nan:
    not available.
    """

    rate: float  # Hz
    # greatest deviation of a time stamp from a uniform grid, in steps; nan without time stamps
    jitter: float
    gaps: int  # samples that have no value, and time stamps that leave a hole
    clipped: float  # share of the samples that are stuck at the greatest or least value
    offset: float  # mean over whole cycles of the quiet part
    step: float  # least difference of two values
    bits: float  # log2 of the span of values over the step
    level: float  # RMS of the fundamental in the quiet part
    noise: float  # standard deviation about fundamental and harmonics
    lag: float  # correlation of that noise with itself one sample later: 0 for white noise
    # white, coloured (neighbours alike), blue (neighbours opposite), or "" where it is undecided
    colour: str
    thd: float  # of the harmonics up to the 25th over the fundamental
    fit: str  # what it is fit for, one sentence


def assess_quality(
    recording: Recording,
    number: int,
    segment: Segment,
    stamps: tuple[float, int] | None = None,
    network: float | None = None,
) -> Quality:
    """The quality of channel `number` in one segment of a recording, whose time stamps are as
    `stamped` says.

    `network` [Hz] is the frequency that the others show; a channel that is no wave of it is
    measured by itself.
    """
    jitter, holes = stamps or measure_stamp_jitter(recording, segment)
    channel = recording.channels[number]
    x = channel.values(segment.first, segment.stop)
    valid = np.isfinite(x)
    gaps = int(np.count_nonzero(~valid)) + holes
    step, span = _measure_step(channel, x if valid.all() else x[valid])
    f = _measure_frequency(recording, number, segment, network)
    clipped = _measure_clipped_share(channel, x, segment, f or recording.frequency, step)
    offset, level, noise, lag, count, thd = _measure_quiet_part(
        x, segment.rate, f, AT_WORK.get(channel.quantity, IDLE)
    )
    colour = _estimate_color(lag, count, noise, step)
    return Quality(
        segment.rate,
        jitter,
        gaps,
        clipped,
        offset,
        step,
        float(np.log2(span / step + 1)) if step > 0 else 0.0,
        level,
        noise,
        lag,
        colour,
        thd,
        _fit(segment, f, channel.form, gaps, clipped, level, max(noise, step)),
    )


def describe_clipped(recording: Recording, shares: Mapping[int, float]) -> str:
    """Which channels {number: share of its samples} stop at a limit, one clause; "" where none
    does.
    """
    clipped = [k for k, share in shares.items() if share > FEW_CLIPPED]
    if not clipped:
        return ""
    names = list_first(
        [f"'{recording.channels[k].name.strip()}'" for k in clipped], MOST_CLIPPED_TOLD
    )
    most = 100 * max(shares[k] for k in clipped)
    return f"clipped: {names}, up to {most:.2g} % of the samples: there U, P and Q are too small"


def measure_clipped_shares(recording: Recording, numbers: Sequence[int]) -> dict[int, float]:
    """{channel: the share of its samples that stop at a limit} in the fastest segment."""
    segment = max(recording.segments, key=lambda s: s.rate)
    shares = {}
    for number in numbers:
        channel = recording.channels[number]
        x = channel.values(segment.first, segment.stop)
        step, _ = _measure_step(channel, x[np.isfinite(x)])
        shares[number] = _measure_clipped_share(channel, x, segment, recording.frequency, step)
    return shares


def measure_stamp_jitter(recording: Recording, segment: Segment) -> tuple[float, int]:
    """(jitter in steps, holes) of the time stamps of a segment; (nan, 0) where the
    file has none.
    """
    stamps = recording.extra.get("stamps")
    if stamps is None or len(stamps) < segment.stop or segment.stop - segment.first < 3:
        return float("nan"), 0
    t = np.array(stamps[segment.first : segment.stop], dtype=float)
    steps = np.diff(t)
    usual = float(np.median(steps))
    if not usual > 0:
        return float("nan"), 0
    holes = steps > STAMP_GAP_STEPS * usual
    t -= t[0]
    if holes.any():
        t[1:] -= np.cumsum(np.where(holes, steps - usual, 0.0))
    k = np.arange(len(t)) - (len(t) - 1) / 2
    t -= t.mean() + k * (k @ t / (k @ k))  # about the line of least squares
    return float(np.abs(t).max() / usual), int(np.count_nonzero(holes))


def _measure_step(channel: Channel, x: np.ndarray) -> tuple[float, float]:
    """(least difference of two values, span of the values)."""
    if len(x) < 2:
        return 0.0, 0.0
    span = float(np.ptp(x))
    if channel.raw.dtype.kind in "iu":
        return abs(channel.gain * channel.ratio * channel.factor), span
    steps = np.diff(np.unique(x[:SORTED]))
    steps = steps[steps > 1e-9 * max(span, 1e-300)]
    return (float(steps.min()) if len(steps) else 0.0), span


def _measure_clipped_share(
    channel: Channel, x: np.ndarray, segment: Segment, f: float, step: float
) -> float:
    """Share of samples in runs at a limit: the converter's where the file says it, else the extreme
    values.
    """
    if len(x) < 10 or not np.isfinite(x).any():
        return 0.0
    low, high = float(np.nanmin(x)), float(np.nanmax(x))
    near = FLAT_TOP * (high - low)
    if near == 0:
        return 0.0
    at = (x >= high - near) | (x <= low + near)
    if channel.limits is not None:
        raw = channel.raw[segment.first : segment.stop]
        least, most = np.array(
            channel.limits, dtype=float
        )  # not cast down to the samples' own type
        at |= (raw <= least) | (raw >= most)
    flat = find_runs(at, max(CLIPPED, _count_crest_samples(x, segment.rate / f, near + step)))
    return sum(run.stop - run.start for run in flat) / len(x)


def _count_crest_samples(x: np.ndarray, cycle: float, near: float) -> int:
    """Samples, of so many in a cycle, that a sine's own crest spends within `near` of its peak, and
    two more.
    """
    amplitude = max(float(np.nanmax(np.abs(x))), 1e-300)
    return 2 + int(2 * np.sqrt(2 * near / amplitude) * cycle / (2 * np.pi))


def _measure_frequency(
    recording: Recording, number: int, segment: Segment, network: float | None
) -> float | None:
    """The network's frequency [Hz] as this channel shows it, else as the others do; None for
    magnitudes.
    """
    if segment.rate < FEWEST_PER_CYCLE * 16:
        return None
    seen = take_snapshots(recording, [number], network) if network else None
    if seen is not None and seen.pure(number):
        return network
    f = measure_frequency(recording, [number])
    return f if f is not None and find_nominal_frequency(f) is not None else recording.frequency


def _measure_quiet_part(
    x: np.ndarray, rate: float, f: float | None, at_work: float
) -> tuple[float, float, float, float, int, float]:
    """(mean, fundamental, noise, lag-1 correlation, samples, THD) in the quietest ten cycles of a
    wave's first calm.

    Mean, fundamental and harmonics are fitted together by least squares over those cycles, each
    with a slow change of its amplitude, so that neither a drift nor a frequency a little off passes
    for noise.
    """
    none = float("nan")
    valid = np.isfinite(x)
    if f is None or rate < 2.5 * f:
        rest = x[valid]
        return (float(rest.mean()) if len(rest) else none), none, none, none, 0, none
    x = x[_select_calm_cycles(x, round(rate / f), at_work)][: round(LONGEST_CALM * rate)]
    n = min(round(QUIET_CYCLES * rate / f), len(x))
    if n < 2 * round(rate / f):
        return none, none, none, none, 0, none
    first = _find_quietest(x, n, round(rate / f))
    part = x[first : first + n]
    if not np.isfinite(part).all():
        return none, none, none, none, 0, none
    orders, Q, solve = _build_basis(n, rate, f)
    coordinates = Q.T @ part
    weights, rest = solve @ coordinates, part - Q @ coordinates
    size = np.hypot(weights[2 : 2 + 2 * orders : 2], weights[3 : 3 + 2 * orders : 2]) / np.sqrt(2)
    noise = float(np.sqrt(rest @ rest / max(n - Q.shape[1], 1)))
    lag = float(rest[1:] @ rest[:-1] / (rest @ rest)) if rest.any() else none
    thd = float(np.linalg.norm(size[1:]) / size[0]) if size[0] > 0 and len(size) > 1 else none
    return float(weights[0]), float(size[0]), noise, lag, n, thd


@functools.lru_cache(maxsize=8)
def _build_basis(n: int, rate: float, f: float) -> tuple[int, np.ndarray, np.ndarray]:
    """(number of harmonics, orthonormal basis (n, K), what makes weights of coordinates in it (K,
    K)).

    The columns before they are made orthonormal: mean, drift, cosine and sine of each harmonic, and
    the fundamental's two with a slow change. All channels of a record share it.
    """
    t = (np.arange(n) - (n - 1) / 2) / rate
    orders = [h for h in range(1, HARMONICS + 1) if h * f < 0.45 * rate]
    waves = [wave(2 * np.pi * h * f * t) for h in orders for wave in (np.cos, np.sin)]
    basis = np.column_stack(
        [np.ones(n), t * rate / n, *waves, *(w * t * rate / n for w in waves[:2])]
    )
    Q, R = np.linalg.qr(basis)
    return len(orders), Q, np.linalg.pinv(R)


def _select_calm_cycles(x: np.ndarray, cycle: int, at_work: float) -> slice:
    """The first cycles in a row that repeat, of a wave that is at work; all of it where none do.

    What comes after a fault or a trip is another state, however quiet, and a fault is quiet for its
    size.
    """
    blocks = x[: len(x) // cycle * cycle].reshape(-1, cycle)
    energy, changed = _compute_variances(blocks)
    both, whole = energy[1:] + energy[:-1], slice(0, len(x))
    with np.errstate(invalid="ignore", divide="ignore"):
        alike = changed / both < LARGEST_REPEAT_DIFFERENCE
        alike &= np.abs(np.sqrt(energy[1:] / energy[:-1]) - 1) < LARGEST_RMS_DIFFERENCE
    spans = [(run.start, run.stop) for run in find_runs(alike, FEWEST_CALM - 1)]
    size = [float(np.sqrt(np.median(energy[a : b + 1]))) for a, b in spans]
    for (a, b), rms in zip(spans, size, strict=True):
        if rms >= at_work * max(size):
            # an edge may hold a part of what comes before or after
            first, last = a + (a > 0), b + (b == len(alike))
            return slice(first * cycle, len(x) if b == len(alike) else max(last, first + 2) * cycle)
    return whole


def _compute_variances(cycles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variances of cycles (M, n), (M,), and of what each differs by from the one before, (M - 1,);
    some at a time.
    """
    parts = [
        cycles[max(first - 1, 0) : first + CYCLES_AT_ONCE]
        for first in range(0, len(cycles), CYCLES_AT_ONCE)
    ]
    own = [part[min(k, 1) :].var(axis=1) for k, part in enumerate(parts)]
    changed = [np.diff(part, axis=0).var(axis=1) for part in parts]
    return np.concatenate([np.empty(0), *own]), np.concatenate([np.empty(0), *changed])


def _find_quietest(x: np.ndarray, n: int, cycle: int) -> int:
    """First sample of the span of n in which the wave repeats best from one cycle to the next, for
    its energy.
    """
    if len(x) <= n + cycle:
        return 0
    change = np.nan_to_num((x[cycle:] - x[:-cycle]) ** 2, nan=np.inf)
    starts = np.arange(0, len(change) - n + 1, max(cycle, 1))
    filled = np.nan_to_num(x)
    energy = n * _measure_windows(filled, n, starts, np.var)
    changed = _measure_windows(change, n, starts, np.sum)
    return int(
        starts[np.argmin(np.where(energy > 0, changed / np.maximum(energy, 1e-300), np.inf))]
    )


def _measure_windows(
    x: np.ndarray, n: int, starts: np.ndarray, measure: Callable[..., np.ndarray]
) -> np.ndarray:
    """Return `measure` of the n samples from each start on, (k,); some at a time, for
    they overlap.
    """
    windows = np.lib.stride_tricks.sliding_window_view(x, n)
    parts = [
        measure(windows[starts[first : first + WINDOWS_AT_ONCE]], axis=1)
        for first in range(0, len(starts), WINDOWS_AT_ONCE)
    ]
    return np.concatenate(parts)


def _estimate_color(lag: float, count: int, noise: float, step: float) -> str:
    """The color of the noise by its lag-1 correlation, where there is more noise than the
    converter's rounding.
    """
    if not np.isfinite(lag) or count < 50 or noise <= 0.2 * step:
        return ""
    if abs(lag) * np.sqrt(count) < WHITE:
        return "white"
    return "coloured" if lag > 0 else "blue"


def _fit(
    segment: Segment,
    f: float | None,
    form: str,
    gaps: int,
    clipped: float,
    level: float,
    noise: float,
) -> str:
    """The sentence on what a channel is fit for."""
    if form != "waveform":
        return f"holds {form} values, no waveform: fit for what they say, not for phasors"
    if f is None or segment.rate < FEWEST_PER_CYCLE * f:
        return f"{segment.rate:g} Hz is no waveform: fit for magnitudes only"
    if not np.isfinite(level):
        return "too short, or with too many gaps, for any estimate"
    if level <= 2 * noise:
        return "carries no more than noise or rounding: no signal to fit"
    if gaps:
        return f"{gaps} gaps: fit for phasors where there are none"
    if clipped > FEW_CLIPPED:
        return (
            f"{100 * clipped:.2g} % of the samples are clipped: fit for phasors outside those"
            " cycles only"
        )
    if segment.rate < WAVES:
        return (
            f"fit for phasors; {segment.rate:g} Hz is too slow for waves, which need {WAVES:g} Hz"
        )
    return "fit for phasors and for waves"


def compute_spectrum(wave: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """The spectrum of a wave, by a Hann window.

    Parameters
    ----------
    wave : (N,)
        Samples at even times; their mean is taken out.
    rate : float [Hz]
        Of the samples.

    Returns
    -------
    (M,) array [Hz]
        Frequencies.
    (M,) array
        RMS values in the unit of the wave: that of a sinusoid is right at its peak.

    Examples
    --------
    >>> wave = np.sqrt(2) * np.sin(2 * np.pi * 50 * np.arange(400) / 2000)
    >>> f, size = compute_spectrum(wave, 2000.0)
    >>> float(f[size.argmax()]), round(float(size.max()), 6)
    (50.0, 1.0)
    """
    window = np.hanning(len(wave) + 1)[:-1]
    lines = np.fft.rfft((wave - wave.mean()) * window)
    return np.fft.rfftfreq(len(wave), 1 / rate), np.sqrt(2) * np.abs(lines) / window.sum()
