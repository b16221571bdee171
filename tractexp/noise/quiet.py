"""Noise where little happens: estimated from what a fit leaves before the dips and at the end of
the records.
"""

import functools
from collections.abc import Callable, Sequence

import numpy as np

from tractexp.model.drive import Drive
from tractexp.noise.color import (
    SMALLEST_DEVIATION,
    Autoregression,
    check_count,
    fit_autoregression,
    white_noise,
)
from tractexp.noise.model import Noise
from tractexp.noise.random_walk import RandomWalk, remove_slow
from tractexp.record import Event

# Order of the autoregressions: noise behind an average over ten samples, which phasors of one cycle
# have at ten values a cycle, needs eleven. With 8 coefficients an oscillation was seen in one of
# nine stretches of such noise at a p of 0.001, with 12 in one of fifty.
HIGHEST_NOISE_ORDER = 12
QUIET_TAIL_SHARE = 0.35  # share of the record after the dip that counts as quiet
SHORTEST_QUIET_STRETCH = 8  # samples of a stretch
# quiet samples from which shocks are drawn as they were seen, with their tails and steps
FEWEST_EMPIRICAL_SAMPLES = 200
# of freedom of Student's t that are tried
DEGREES = np.array([2.5, 3, 3.5, 4, 5, 6, 8, 10, 15, 20])
LEAST_QUIET_GAIN = 10.0  # of twice the log-likelihood: by chance once in some 1,500
LOUDER = 1e-3  # p below which the end of a record is louder than its beginning
QUANTILES = 20_000  # that stand for a law


def find_quiet_stretches(events: Sequence[Event], drive: Drive) -> list[slice]:
    """The samples in which little happens.

    Parameters
    ----------
    events : sequence of Event
        The events of the drive.
    drive : Drive
        Where they begin.

    Returns
    -------
    list of slice
        Of the drive's samples: those before each dip and those at the end of the record. None is
        shorter than `SHORTEST_QUIET_STRETCH`.
    """
    parts = []
    for e, event in enumerate(events):
        first = int(drive.first[e])
        n = event.record.samples
        tail = round(n - QUIET_TAIL_SHARE * (n - event.end))
        parts += [slice(first + event.first, first + event.start), slice(first + tail, first + n)]
    return [p for p in parts if p.stop - p.start >= SHORTEST_QUIET_STRETCH]


def estimate(
    residuals: np.ndarray,
    valid: np.ndarray,
    quiet: Sequence[slice],
    random_walk: Callable[[np.ndarray], RandomWalk | None] = lambda mix: None,
    input_modes: np.ndarray | None = None,
) -> Noise:
    """The noise of residuals in quiet stretches.

    The channels are made independent by their covariance; each then is an autoregression of least
    BIC, for a color that is not there would change the weight of slow differences.

    Parameters
    ----------
    residuals : (C, N) [pu]
        What a fit leaves.
    valid : (C, N) bools
        Which samples count; a channel without any is not measured.
    quiet : sequence of slice
        Where little happens.
    random_walk : (C, C) -> RandomWalk or None
        The wandering of the load, in channels mixed by this matrix.
    input_modes : (k, C, N) [pu] or None
        What errors of the voltage do to what is compared.

    Returns
    -------
    Noise

    Raises
    ------
    UserError
        Where fewer than `FEWEST_NOISE_SAMPLES` samples are quiet.
    """
    measured = np.any(valid, axis=1)
    both = np.all(valid[measured], axis=0)
    pieces = [residuals[measured, part][:, both[part]] for part in quiet]
    count = sum(p.shape[1] for p in pieces)
    check_count(count)
    together = np.concatenate(pieces, axis=1)
    covariance = together @ together.T / count
    # of channels that say the same: sums are no more exact
    covariance += np.diag(1e-18 + 1e-14 * np.diag(covariance))
    own = np.linalg.inv(np.linalg.cholesky(covariance))
    fast = [[(own @ p)[c] for p in pieces] for c in range(len(own))]
    mix = np.eye(len(measured))
    mix[np.ix_(measured, measured)] = own
    slow = random_walk(mix)
    if slow is not None:
        fast = [[remove_slow(p) for p in channel] for channel in fast]
    # Sparing, because a color that is not there changes the weight of slow differences, which every
    # effect makes.
    fitted = [fit_autoregression(channel, HIGHEST_NOISE_ORDER, sparing=True) for channel in fast]
    shocks = None
    if count >= FEWEST_EMPIRICAL_SAMPLES and measured.all():
        shocks = tuple(map(_collect_shocks, fitted, fast))
    colors = iter(fitted)
    pair = tuple(next(colors) if there else white_noise(1.0) for there in measured)
    return Noise((pair,), mix, shocks, slow, input_modes)


def is_louder(late: Sequence[np.ndarray], calm: Sequence[np.ndarray]) -> bool:
    """Whether stretches of a channel are louder than calm ones by more than chance explains.

    An F test, with as many samples as tell of the slowest of each one's color.

    Parameters
    ----------
    late, calm : sequences of (n_i,) arrays [pu]
        Stretches of the channel.

    Returns
    -------
    bool
        False where either has none.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> calm, loud = rng.standard_normal(200), 3 * rng.standard_normal(200)
    >>> is_louder([loud], [calm]), is_louder([calm], [calm])
    (True, False)
    """
    from scipy.special import fdtrc

    if not (late and calm):
        return False
    (a, n), (b, m) = (_measure_variance(pieces) for pieces in (late, calm))
    return bool(fdtrc(n, m, a / max(b, SMALLEST_DEVIATION**2)) < LOUDER)


def _measure_variance(pieces: Sequence[np.ndarray]) -> tuple[float, float]:
    """The variance [pu²] of stretches, and the number of independent samples that it is worth."""
    count = sum(map(len, pieces))
    color = fit_autoregression(
        list(pieces), min(HIGHEST_NOISE_ORDER, max(count // 10, 0)), sparing=True
    )
    return sum(float(p @ p) for p in pieces) / max(count, 1), max(
        Noise(((color,),)).worth(count), 2.0
    )


def _collect_shocks(channel: Autoregression, pieces: Sequence[np.ndarray]) -> np.ndarray:
    """What the past of a channel does not predict, centered and scaled to unit variance.

    Of heavy tails the quiet samples show less than follows after the dip: there the quantiles of
    their law stand for them.
    """
    white = np.concatenate(
        [channel.whiten(p, np.ones(len(p), dtype=bool))[channel.order :] for p in pieces]
    )
    unit = (white - white.mean()) / max(float(white.std()), 1e-300)
    heavy = _find_heavy_tails(unit)
    return unit if heavy is None else heavy


def _find_heavy_tails(unit: np.ndarray) -> np.ndarray | None:
    """Quantiles of unit variance of the most likely Student's t of samples (n,), where it is
    clearly likelier than the normal distribution; else None.
    """
    from scipy.special import gammaln

    freedom = DEGREES[:, None]
    scale = 1 - 2 / freedom  # of a variance of one
    constant = gammaln((freedom + 1) / 2) - gammaln(freedom / 2) - np.log(np.pi * (freedom - 2)) / 2
    likely = (constant - (freedom + 1) / 2 * np.log1p(unit**2 / (freedom * scale))).sum(axis=1)
    normal = -(np.log(2 * np.pi) + unit**2).sum() / 2
    if 2 * (likely.max() - normal) < LEAST_QUIET_GAIN:
        return None
    return _compute_quantiles(float(DEGREES[likely.argmax()]))


@functools.cache
def _compute_quantiles(freedom: float) -> np.ndarray:
    """Quantiles of Student's t, of unit variance; once for each of `DEGREES`, since each fit
    estimates its noise.
    """
    from scipy.special import stdtrit

    quantiles = stdtrit(freedom, (np.arange(QUANTILES) + 0.5) / QUANTILES)
    return quantiles / quantiles.std()
