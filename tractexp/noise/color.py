"""Noise of a recorded channel: how large it is, how one sample follows from those before it, and
how to whiten it.

Recorded power is rarely white: a phasor window, a filter or the load itself correlate its samples.
Treating them as independent makes standard errors too small. An autoregressive model of the
residual repairs that.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.kernel.stencil import Stencil
from tractexp.record.change import find_runs

HIGHEST_ORDER = 16
SMALLEST_DEVIATION = 1e-9  # pu: stands for the noise of a record that has none
FEWEST_NOISE_SAMPLES = 20  # samples to estimate a noise model from


@dataclass(frozen=True, eq=False)
class Autoregression:
    """A channel's noise, in which each sample follows from those before it.

        x[t] = a_1 x[t-1] + ... + a_p x[t-p] + e[t]

    The best predictors of each lower order are kept, too: the first samples of a stretch and those
    after a gap have fewer predecessors.

    Attributes
    ----------
    coefficients : (p + 1, p)
        `coefficients[k, :k]` predict a sample from k known predecessors, the nearest first.
    deviation : (p + 1,) [pu]
        `deviation[k]` is the standard deviation of the error of that; `deviation[0]` that of x
        itself.
    """

    coefficients: np.ndarray  # (p + 1, p)
    deviation: np.ndarray  # (p + 1,) pu

    @property
    def order(self) -> int:
        """The number p of samples before that tell of the next one."""
        return len(self.deviation) - 1

    @property
    def white(self) -> bool:
        """Whether samples are independent: the order is 0."""
        return self.order == 0

    def scale_noise(self, factor: float) -> "Autoregression":
        """The autoregression of the same color, `factor` times as loud."""
        return Autoregression(self.coefficients, self.deviation * factor)

    def whiten(
        self, rows: np.ndarray, valid: np.ndarray, out: np.ndarray | None = None
    ) -> np.ndarray:
        """The prediction errors of rows, of unit variance.

        A gap ends the memory: the samples after it are predicted from fewer predecessors.

        Parameters
        ----------
        rows : (..., N) [pu]
            Samples at even times.
        valid : (N,) bools
            Which samples count.
        out : (..., N)
            Where the result is written; None: a new array.

        Returns
        -------
        (..., N) array
            0 where a sample does not count.

        Examples
        --------
        >>> noise = Autoregression(np.array([[0.0], [0.5]]), np.array([2.0, 1.0]))
        >>> noise.whiten(np.array([2.0, 2.0, 2.0]), np.ones(3, dtype=bool)).tolist()
        [1.0, 1.0, 1.0]
        """
        out = np.empty_like(rows) if out is None else out
        parts = [slice(0, len(valid))] if len(valid) else []
        if not valid.all():
            out[..., ~valid] = 0.0
            parts = find_runs(valid)
        if parts:
            self._whiten(np.atleast_2d(rows), parts, np.atleast_2d(out))
        return out

    def _whiten(self, rows: np.ndarray, parts: Sequence[slice], out: np.ndarray) -> None:
        """Write the prediction errors of rows (n, N) to `out`, within parts that have no gap."""
        weights = np.r_[1.0, -self.coefficients[-1]] / self.deviation[-1]
        p = self.order
        if self.white or np.iscomplexobj(rows):
            for part in parts:
                y = rows[:, part]
                white = out[:, part]
                np.multiply(y, weights[0], out=white)
                for lag in range(1, p + 1):
                    white[:, lag:] += weights[lag] * y[:, :-lag]
        else:
            taps = {f"c{lag}": weight for lag, weight in enumerate(weights)}
            build_filter_stencil(p)(out[None], parts, np.array(0), y=rows[None], **taps)
        for part in parts if p else ():  # of the first few fewer are known
            first = rows[:, part][:, :p]
            known = self._first_rows[: first.shape[1], : first.shape[1]]
            out[:, part][:, :p] = np.einsum("nj,kj->nk", first, known)

    @functools.cached_property
    def _first_rows(self) -> np.ndarray:
        """The matrix (p, p) that makes prediction errors of the first p samples."""
        matrix = np.eye(self.order, dtype=self.coefficients.dtype)
        for k in range(1, self.order):
            matrix[k, :k] = -self.coefficients[k, k - 1 :: -1]
        return matrix / self.deviation[: self.order, None]

    def color_shocks(self, shocks: np.ndarray) -> np.ndarray:
        """Noise from independent shocks: the inverse of whitening, from rest.

        Parameters
        ----------
        shocks : (n, N) [pu]
            Prediction errors e of n rows.

        Returns
        -------
        (n, N) array [pu]
            x by the recurrence of full order.
        """
        from scipy.linalg import solve_banded

        bands = np.repeat(np.r_[1.0, -self.coefficients[-1]][:, None], shocks.shape[1], axis=1)
        return solve_banded((self.order, 0), bands, shocks.T).T


@functools.cache
def build_filter_stencil(order: int) -> Stencil:
    """The sum of the samples 0, 1, ... `order` before each, times the numbers c0, c1, ... of their
    row.
    """

    def expression(y: Callable[[int], Any], **c: Any) -> Any:
        return sum(c[f"c{lag}"] * y(-lag) for lag in range(order + 1))

    return Stencil(expression, rows=("y",), numbers=[f"c{lag}" for lag in range(order + 1)])


def white_noise(deviation: float) -> Autoregression:
    """Independent samples of one standard deviation [pu].

    Examples
    --------
    >>> white_noise(0.01).order
    0
    """
    return Autoregression(np.empty((1, 0)), np.array([max(deviation, SMALLEST_DEVIATION)]))


def forgetting_noise(deviation: float, correlation: float) -> Autoregression:
    """Noise of one standard deviation [pu] whose neighbors correlate so, 0 to 1."""
    shock = float(np.sqrt(1 - correlation**2))
    color = np.array([[0.0], [correlation]])
    return Autoregression(color, deviation * np.array([1.0, shock]))


def check_count(samples: int) -> None:
    """Raise `UserError` for too few quiet samples."""
    if samples < FEWEST_NOISE_SAMPLES:
        raise UserError(
            f"the noise cannot be told from {samples} quiet samples before and after the dips: at"
            f" least {FEWEST_NOISE_SAMPLES} are"
            " needed; give records that start earlier"
        )


def fit_autoregression(
    stretches: Sequence[np.ndarray], highest: int = HIGHEST_ORDER, sparing: bool = False
) -> Autoregression:
    """The autoregression that describes some stretches best.

    The coefficients are found by Burg's method, so that the result is stationary whatever the data;
    the order is that of the least information criterion.

    Parameters
    ----------
    stretches : sequence of (n_i,) arrays [pu]
        Parts of one channel without gaps.
    highest : int
        The highest order that is tried; no more than a tenth of the samples.
    sparing : bool
        Whether the criterion is BIC in place of AICc: fewer coefficients.

    Returns
    -------
    Autoregression

    Notes
    -----
    Source: Burg 1975; Hurvich and Tsai 1989 (AICc); Schwarz 1978 (BIC).

    Examples
    --------
    >>> shocks = np.random.default_rng(1).standard_normal((1, 5000))
    >>> true = Autoregression(np.array([[0.0], [0.8]]), np.array([1.667, 1.0]))
    >>> fitted = fit_autoregression([true.color_shocks(shocks)[0]], sparing=True)
    >>> fitted.order, fitted.coefficients[-1].round(1).tolist()
    (1, [0.8])
    """
    count = sum(map(len, stretches))
    power = sum(float(x @ x) for x in stretches) / max(count, 1)
    highest = min(highest, count // 10, max(map(len, stretches), default=1) - 1)
    errors = [(x[1:], x[:-1]) for x in stretches]  # of prediction, forward and backward
    table = [np.empty(0)]
    variance = [max(power, SMALLEST_DEVIATION**2)]
    for _ in range(highest):
        both = sum(float(f @ b) for f, b in errors)
        energy = sum(float(f @ f + b @ b) for f, b in errors)
        reflection = 2 * both / energy if energy > 0 else 0.0
        last = table[-1]
        table.append(np.concatenate((last - reflection * last[::-1], [reflection])))
        variance.append(max(variance[-1] * (1 - reflection**2), SMALLEST_DEVIATION**2))
        errors = [((f - reflection * b)[1:], (b - reflection * f)[:-1]) for f, b in errors]
    orders = np.arange(len(variance))
    price = np.log(max(count, 2)) if sparing else 2 * count / np.maximum(count - orders - 2, 1)
    criterion = count * np.log(variance) + (orders + 1) * price
    order = int(np.argmin(criterion))
    return build_from_orders(table[: order + 1], variance)


def build_from_orders(
    table: Sequence[np.ndarray], variance: np.ndarray | Sequence[float]
) -> Autoregression:
    """The autoregression of tabulated predictors.

    Parameters
    ----------
    table : sequence of (k,) arrays
        Coefficients of each order k from 0 on.
    variance : one number an order [pu²]
        Variance of the prediction error of each.

    Returns
    -------
    Autoregression
        Of the highest order in the table.
    """
    coefficients = np.zeros((len(table), len(table) - 1), dtype=table[-1].dtype)
    for k, row in enumerate(table):
        coefficients[k, :k] = row
    return Autoregression(coefficients, np.sqrt(variance[: len(table)]))


def cut_stretches(values: np.ndarray, valid: np.ndarray) -> list[np.ndarray]:
    """The parts of `values` (N,) between gaps, where `valid` (N,) is true.

    Examples
    --------
    >>> [part.tolist() for part in cut_stretches(np.arange(4), np.array([True, False, True, True]))]
    [[0], [2, 3]]
    """
    return [values[part] for part in find_runs(valid)]
