"""Is what a fit leaves over noise? Tests of whitened residuals, in closed form."""

from dataclasses import dataclass

import numpy as np

LAGS = 20
REJECTED = 0.01  # p-value below which a test speaks


@dataclass(frozen=True)
class ResidualTest:
    """A test of whitened residuals.

    Attributes
    ----------
    name : str
        What is tested, and by which test.
    statistic : float
        Its value.
    freedom : int
        Degrees of freedom of the chi-squared distribution it is compared with.
    p : float
        Probability of as large a statistic where nothing but noise is left.
    says : str
        Its outcome in a word.
    """

    name: str
    statistic: float
    freedom: int
    p: float
    says: str


def autocorrelation(rows: np.ndarray, lags: int) -> np.ndarray:
    """The correlation of a row with itself later.

    Parameters
    ----------
    rows : (n,)
        Samples at even times.
    lags : int
        Up to so many samples later.

    Returns
    -------
    (lags,) array
        At 1, 2, ... samples; 0 where the row is constant.

    Examples
    --------
    >>> autocorrelation(np.array([1.0, -1.0, 1.0, -1.0]), 2).tolist()
    [-0.75, 0.5]
    """
    centered = rows - rows.mean()
    power = centered @ centered
    return np.array([centered[k:] @ centered[:-k] for k in range(1, lags + 1)]) / (power or 1.0)


def ljung_box(rows: np.ndarray, fitted: int = 0) -> ResidualTest:
    """Whether a row is uncorrelated.

    Parameters
    ----------
    rows : (n,)
        Whitened residuals at even times.
    fitted : int
        Autoregressive coefficients that were fitted; they cost as many degrees of freedom.

    Returns
    -------
    ResidualTest
        Its statistic is n (n + 2) times the sum of r_k² / (n - k) over the lags.

    Notes
    -----
    Source: Ljung and Box 1978.
    """
    from scipy.special import chdtrc

    n = len(rows)
    lags = max(min(max(LAGS, fitted + 5), n // 4), fitted + 1)
    r = autocorrelation(rows, lags)
    statistic = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, lags + 1))))
    p = float(chdtrc(lags - fitted, statistic))
    return ResidualTest(
        "whiteness (Ljung-Box)", statistic, lags - fitted, p, "colored" if p < REJECTED else "white"
    )


def jarque_bera(rows: np.ndarray) -> ResidualTest:
    """Whether a row has the skewness and kurtosis of a normal distribution.

    As `scipy.stats.jarque_bera`, without the second that importing it takes.

    Parameters
    ----------
    rows : (n,)
        Whitened residuals.

    Returns
    -------
    ResidualTest
        Its statistic has two degrees of freedom.

    Notes
    -----
    Source: Jarque and Bera 1987.

    Examples
    --------
    >>> spiky = np.zeros(100)
    >>> spiky[50] = 10.0
    >>> jarque_bera(spiky).p < 0.001
    True
    """
    from scipy.special import chdtrc

    z = (rows - rows.mean()) / (rows.std() or 1.0)
    statistic = len(z) / 6 * float(np.mean(z**3) ** 2 + (np.mean(z**4) - 3) ** 2 / 4)
    p = float(chdtrc(2, statistic))
    return ResidualTest(
        "normality (Jarque-Bera)", statistic, 2, p, "not normal" if p < REJECTED else "normal"
    )
