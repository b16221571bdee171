"""Statistics of a whitened, projected residual: each looks for another kind of thing that a model
does not account for.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from tractexp.inference.problem import Problem

LOUDEST, PER_EVENT = "the loudest window", "parameters of each event"
STRIDE = 4  # samples between the instants at which a step is looked for
SPECTRUM_BINS = 1024  # of the transform in which an oscillation is looked for
PULSES = (0.01, 0.03, 0.1)  # s, lengths of the pulses that are looked for after the dips
# s, lengths of the stretches after the dips in which an oscillation may come and go
BURSTS = (0.1, 0.3)
FEWEST_OSCILLATION_SAMPLES = 8  # samples of a stretch with an oscillation
WINDOWS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # s after the end of the dip


def list_windows(problem: Problem, event: int) -> list[tuple[float, float]]:
    """The windows of one event: before the dip, both halves of it, then ever longer ones.

    Parameters
    ----------
    problem : Problem
        Whose event it is.
    event : int
        Its number, from 0.

    Returns
    -------
    list of (float, float) [s]
        Since the event's first sample.
    """
    e = problem.events[event]
    start = e.t_start - e.record.t[0]
    end = e.t_end - e.record.t[0]
    last = e.record.t[-1] - e.record.t[0]
    edges = [0.0, start, (start + end) / 2, *(end + w for w in WINDOWS if end + w < last), last]
    return [(a, b) for a, b in itertools.pairwise(edges) if b > a]


@dataclass(frozen=True, eq=False)
class ResidualWindow:
    """A stretch of one channel of one event.

    Attributes
    ----------
    event : int
        Number of the event, from 0.
    channel : str
        The channel's label.
    part : slice
        Its samples in the drive.
    start, end : float [s]
        Its times in the record.
    """

    event: int
    channel: str
    part: slice
    start: float  # s
    end: float


def compute_residual_statistics(channels: np.ndarray, problem: Problem) -> dict[str, np.ndarray]:
    """The statistics of which the largest counts, by what each looks for.

    Parameters
    ----------
    channels : (b, C, N)
        Whitened, projected residuals: of a fit b is 1, of draws their number.
    problem : Problem
        Whose events, windows and quiet stretches count.

    Returns
    -------
    {name: (b, k)}
        The energy of each window, of steps and pulses, and of oscillations.
    """
    after = align_residuals(channels, problem)
    return {
        LOUDEST: measure_energies(channels, problem),
        "a step or a pulse": np.concatenate(
            [measure_steps(channels, problem), measure_pulses(after, problem)], axis=1
        ),
        "an oscillation": np.concatenate(
            [measure_tones(channels, problem), measure_bursts(after, problem)], axis=1
        ),
    }


def list_residual_windows(problem: Problem) -> list[ResidualWindow]:
    """Every window of every event, for each channel that is compared; none shorter than two
    samples.
    """
    cells = []
    for e, event in enumerate(problem.events):
        first, step, origin = int(problem.drive.first[e]), event.record.step, event.record.t[0]
        for a, b in list_windows(problem, e):
            i = round(a / step)
            j = min(round(b / step), event.record.samples)
            if j - i < 2:
                continue
            part = slice(first + i, first + j)
            cells += [
                ResidualWindow(e, c, part, origin + i * step, origin + (j - 1) * step)
                for c in problem.drive.labels
            ]
    return cells


def measure_energies(channels: np.ndarray, problem: Problem) -> np.ndarray:
    """How loud residuals are in each window: the sum of their squares there, in units of the mean
    square of the same channel before the dips.

    Noise alone leaves about the number of samples of the window.

    Parameters
    ----------
    channels : (b, C, N)
        Whitened, projected residuals: b of them, C channels, N samples of all events.
    problem : Problem
        Whose `list_residual_windows` and quiet stretches before the dips count.

    Returns
    -------
    (b, k) array
        A column for each of the k windows of `list_residual_windows`, in their order.
    """
    square = channels**2
    quiet = np.mean(
        np.concatenate([square[:, :, part] for part in problem.quiet], axis=2),
        axis=2,
        keepdims=True,
    )
    square /= np.where(quiet > 0, quiet, 1.0)  # a current that is not compared is zero throughout
    row = problem.drive.labels.index
    return np.stack(
        [square[:, row(c.channel), c.part].sum(axis=1) for c in list_residual_windows(problem)],
        axis=1,
    )


def align_residuals(channels: np.ndarray, problem: Problem) -> np.ndarray:
    """What follows the dips, summed over the events at the same time after each.

    Timers and controls answer every dip alike, however little each event shows of it.

    Parameters
    ----------
    channels : (b, C, N)
        Whitened residuals.
    problem : Problem
        Whose events they are of.

    Returns
    -------
    (b, C, n) array
        Of unit variance; n is the number of samples of the shortest event after its dip.
    """
    drive = problem.drive
    finished = [e for e, event in enumerate(problem.events) if not event.unfinished]
    after = [
        channels[:, :, drive.part(e)][:, :, problem.events[e].end :]
        for e in finished or range(len(problem.events))
    ]
    common = min(p.shape[2] for p in after)
    return sum(p[:, :, :common] for p in after) / np.sqrt(len(after))


def measure_steps(channels: np.ndarray, problem: Problem) -> np.ndarray:
    """The evidence of a step at each instant, up to the end of the event.

    Parameters
    ----------
    channels : (b, C, N)
        Whitened residuals.
    problem : Problem
        Whose events they are of.

    Returns
    -------
    (b, columns) array
        Squares of the sums from every `STRIDE`-th instant to the end, of each event and channel.
    """
    columns = []
    for part in problem.drive.parts:
        sums = np.cumsum(channels[:, :, part][:, :, ::-1], axis=2)[:, :, ::STRIDE]
        columns.append(sums**2)
    return np.concatenate(columns, axis=2).reshape(len(channels), -1)


def measure_pulses(after: np.ndarray, problem: Problem) -> np.ndarray:
    """How much a short rectangular pulse after the dips would explain of residuals, wherever it
    begins.

    A pulse of n samples that fits them best lowers the sum of their squares by (sum r)²/n, which is
    1 on average in white noise of unit variance. The stretches of a length begin a quarter of it
    apart.

    Parameters
    ----------
    after : (b, C, n)
        Whitened residuals from the end of the dip on, as `align_residuals` adds up events.
    problem : Problem
        Whose sampling it is.

    Returns
    -------
    (b, columns) array
        (sum r)²/n of each length of `PULSES`, each channel and each beginning.
    """
    sums = np.cumsum(np.pad(after, ((0, 0), (0, 0), (1, 0))), axis=2)
    columns = [np.empty((len(after), 0))]
    for length in PULSES:
        n = max(round(length / problem.events[0].record.step), 1)
        if n < sums.shape[2]:
            stretches = (sums[:, :, n:] - sums[:, :, :-n])[:, :, :: math.ceil(n / 4)]
            columns.append((stretches**2 / n).reshape(len(after), -1))
    return np.concatenate(columns, axis=1)


def measure_tones(channels: np.ndarray, problem: Problem) -> np.ndarray:
    """The evidence of an oscillation that lasts.

    Parameters
    ----------
    channels : (b, C, N)
        Whitened residuals.
    problem : Problem
        Whose events they are of.

    Returns
    -------
    (b, frequencies) array
        Power over all events and channels: in the dips, after them and in both.
    """
    power = np.zeros((len(channels), 3, SPECTRUM_BINS // 2 + 1))
    for event, of_event in zip(problem.events, problem.drive.parts, strict=True):
        own = channels[:, :, of_event]
        for k, part in enumerate(
            (slice(event.start, event.end), slice(event.end, None), slice(event.start, None))
        ):
            stretch = own[:, :, part]
            if stretch.shape[2] >= FEWEST_OSCILLATION_SAMPLES:
                power[:, k] += np.sum(_compute_spectrum(stretch), axis=1) / stretch.shape[2]
    return power.reshape(len(channels), -1)


def measure_bursts(after: np.ndarray, problem: Problem) -> np.ndarray:
    """The evidence of an oscillation that comes and goes after the dips.

    Parameters
    ----------
    after : (b, C, n)
        Residuals as `align_residuals` sums them.
    problem : Problem
        Whose sampling it is.

    Returns
    -------
    (b, cells) array
        Power by frequency in stretches of `BURSTS` [s] that overlap by half.
    """
    columns = [np.empty((len(after), 0))]
    for length in BURSTS:
        n = round(length / problem.events[0].record.step)
        if FEWEST_OSCILLATION_SAMPLES <= n <= after.shape[2]:
            stretches = np.lib.stride_tricks.sliding_window_view(after, n, axis=2)[:, :, :: n // 2]
            power = np.abs(np.fft.rfft(stretches, 2 * n, axis=3)) ** 2 / n
            columns.append(power.sum(axis=1).reshape(len(after), -1))
    return np.concatenate(columns, axis=1)


def _compute_spectrum(stretch: np.ndarray) -> np.ndarray:
    """The power (..., frequencies) of stretches (..., n), at the frequencies of one transform of
    `SPECTRUM_BINS` however long they are.
    """
    padded = -(-stretch.shape[-1] // SPECTRUM_BINS) * SPECTRUM_BINS
    return np.abs(np.fft.rfft(stretch, padded, axis=-1)[..., :: padded // SPECTRUM_BINS]) ** 2
