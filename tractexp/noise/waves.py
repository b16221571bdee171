"""Noise of sampled currents: white noise of their own, and that of the recorded voltage, as the
load passes it on.

A model is driven by the voltage as recorded. What is noise in it makes calculated currents wander
about the true ones: slowly, since a machine's flux sums the voltage up, and in the sense in which
its rotor turns, so that the two components of the space vector are one complex series. Its color
follows from the model's own response to a single wrong sample of the voltage, so that the loudness
of the two is all that has to be told from the records.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.noise.color import (
    SMALLEST_DEVIATION,
    Autoregression,
    build_from_orders,
    check_count,
    white_noise,
)
from tractexp.noise.model import Noise

HIGHEST_WAVE_ORDER = 48  # order of the autoregressions
GAINED = 1.001  # times its least variance: a prediction as good is good enough
# of the voltage's deviations from its periodic course that are noise
SHARES = (0.0, 0.25, 0.5, 1.0)
# of twice the log-likelihood, by which anything else must be better than all of them
LEAST_WAVE_GAIN = 4.0
FLOORS = np.geomspace(1.0, 0.01, 28)  # of the current's own noise over all that is left in quiet
FINER = np.geomspace(FLOORS[1], 1 / FLOORS[1], 15)  # times the best of these


def estimate_wave_noise(
    residuals: np.ndarray,
    valid: np.ndarray,
    quiet: Sequence[slice],
    answers: Sequence[np.ndarray],
    phases: int,
    input_modes: np.ndarray | None = None,
) -> Noise:
    """The noise of sampled currents, from what a fit leaves in quiet stretches.

    Parameters
    ----------
    residuals : (3, N) [pu]
        Of the two components of the space vector and of the zero sequence.
    valid : (3, N) bools
        Which samples count.
    quiet : sequence of slice
        Where little happens.
    answers : two (L,) arrays [pu]
        For the space vector and the zero sequence: the currents that one standard deviation of a
        voltage's sample causes from then on.
    phases : int
        3 for a space vector, else its first component stands alone.
    input_modes : (k, 3, N) [pu] or None
        What errors of the record do to what is compared.

    Returns
    -------
    Noise

    Raises
    ------
    UserError
        Where too few samples are quiet.
    """
    measured = np.any(valid, axis=1)
    count = sum(part.stop - part.start for part in quiet)
    check_count(count)
    vector = residuals[0] + 1j * residuals[1] if phases == 3 else residuals[0]
    first = _fit_wave_noise([vector[part][valid[0, part]] for part in quiet], answers[0])
    pair = [first, first if phases == 3 else white_noise(1.0), white_noise(1.0)]
    if measured[2]:
        pair[2] = _fit_wave_noise(
            [residuals[2, part][valid[2, part]] for part in quiet], answers[1]
        )
    return Noise((tuple(pair),), np.eye(3), input_modes=input_modes, vector=phases == 3)


def _fit_wave_noise(pieces: Sequence[np.ndarray], answer: np.ndarray) -> Autoregression:
    """The most likely sum of white noise and noise of the voltage, of stretches (n_i,) real or
    complex.
    """
    per = 2 if np.iscomplexobj(pieces[0]) else 1
    level = max(np.sqrt(np.mean(np.abs(np.concatenate(pieces)) ** 2) / per), SMALLEST_DEVIATION)
    passed = compute_covariances(answer, HIGHEST_WAVE_ORDER)
    if per == 1:
        passed = np.real(passed)
    shares = SHARES if passed[0].real > (1e-3 * level) ** 2 else (0.0,)

    def fit_color(share: float, floor: float) -> tuple[float, float, float, Autoregression]:
        whole = share**2 * passed
        whole[0] += (floor * level) ** 2
        color = solve_levinson(whole)
        price = sum(_measure_surprise(color, piece, per) for piece in pieces) - LEAST_WAVE_GAIN * (
            share == 1.0
        )
        return price, share, floor, color

    tried = [fit_color(share, floor) for share in shares for floor in (FLOORS if share else (1.0,))]
    best = min(tried, key=lambda t: t[:3])
    if best[1]:
        best = min(
            (best, *(fit_color(best[1], best[2] * step) for step in FINER)), key=lambda t: t[:3]
        )
    return best[3]


def _measure_surprise(color: Autoregression, piece: np.ndarray, per: int) -> float:
    """Minus twice the log-likelihood of a stretch (n,) whose samples have `per` components, up to a
    constant.
    """
    white = color.whiten(piece, np.ones(len(piece), dtype=bool))
    errors = np.log(color.deviation[np.minimum(np.arange(len(piece)), color.order)])
    return float(np.sum(np.abs(white) ** 2) + 2 * per * errors.sum())


def compute_covariances(answer: np.ndarray, highest: int) -> np.ndarray:
    """The covariances of noise that is the sum of answers to unit shocks.

    Parameters
    ----------
    answer : (L,)
        What one shock causes at the samples from then on.
    highest : int
        The largest lag.

    Returns
    -------
    (highest + 1,) array
        E[x(t + k) x*(t)] for k = 0 ... highest.

    Examples
    --------
    >>> compute_covariances(np.array([1.0, 0.5]), 2).tolist()
    [1.25, 0.5, 0.0]
    """
    padded = np.concatenate([answer, np.zeros(highest)])
    return np.array([np.vdot(answer, padded[k : k + len(answer)]) for k in range(highest + 1)])


def solve_levinson(covariance: np.ndarray) -> Autoregression:
    """The autoregression of given covariances, by Levinson's recursion.

    Parameters
    ----------
    covariance : (p + 1,) [pu²]
        At lags 0 ... p, real or complex.

    Returns
    -------
    Autoregression
        Of less order than p where that predicts as well.

    Notes ----- Source: Levinson 1947; Hayes 1996, Statistical Digital Signal Processing and
    Modeling, section 5.2.

    Examples
    --------
    >>> solve_levinson(np.array([1.0, 0.5, 0.25])).coefficients[-1].tolist()
    [0.5]
    """
    table = [np.empty(0, dtype=covariance.dtype)]
    variance = [float(covariance[0].real)]
    for m in range(1, len(covariance)):
        last = table[-1]
        reflection = (covariance[m] - last @ covariance[m - 1 : 0 : -1]) / variance[-1]
        table.append(np.concatenate([last - reflection * last[::-1].conj(), [reflection]]))
        variance.append(variance[-1] * max(1 - abs(reflection) ** 2, 1e-12))
    order = int(np.argmax(np.array(variance) <= GAINED * variance[-1]))
    return build_from_orders(table[: order + 1], variance)
