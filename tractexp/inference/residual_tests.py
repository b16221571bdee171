"""Is what a fit leaves over noise? Tests of whitened residuals, in closed form."""

from typing import Any

import numpy as np

LAGS = 20
REJECTED = 0.01  # p-value below which a test speaks


def compute_autocorrelation(rows: np.ndarray, lags: int) -> np.ndarray:
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
    >>> compute_autocorrelation(np.array([1.0, -1.0, 1.0, -1.0]), 2).tolist()
    [-0.75, 0.5]
    """
    centered = rows - rows.mean()
    power = centered @ centered
    return np.array([centered[k:] @ centered[:-k] for k in range(1, lags + 1)]) / (power or 1.0)


def run_ljung_box(rows: np.ndarray, fitted: int = 0) -> dict[str, Any]:
    """Whether a row is uncorrelated.

    Parameters
    ----------
    rows : (n,)
        Whitened residuals at even times.
    fitted : int
        Autoregressive coefficients that were fitted; they cost as many degrees of freedom.

    Returns
    -------
    dict
        As of `tell_test`; its statistic is n (n + 2) times the sum of r_k² / (n - k) over the lags.

    Notes
    -----
    Source: Ljung and Box 1978.
    """
    n = len(rows)
    lags = max(min(max(LAGS, fitted + 5), n // 4), fitted + 1)
    r = compute_autocorrelation(rows, lags)
    statistic = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, lags + 1))))
    return tell_test("whiteness (Ljung-Box)", statistic, lags - fitted, ("colored", "white"))


def run_jarque_bera(rows: np.ndarray) -> dict[str, Any]:
    """Whether a row has the skewness and kurtosis of a normal distribution.

    As `scipy.stats.jarque_bera`, without the second that importing it takes.

    Parameters
    ----------
    rows : (n,)
        Whitened residuals.

    Returns
    -------
    dict
        As of `tell_test`; its statistic has two degrees of freedom.

    Notes
    -----
    Source: Jarque and Bera 1987.

    Examples
    --------
    >>> spiky = np.zeros(100)
    >>> spiky[50] = 10.0
    >>> run_jarque_bera(spiky)["p"] < 0.001
    True
    """
    z = (rows - rows.mean()) / (rows.std() or 1.0)
    statistic = len(z) / 6 * float(np.mean(z**3) ** 2 + (np.mean(z**4) - 3) ** 2 / 4)
    return tell_test("normality (Jarque-Bera)", statistic, 2, ("not normal", "normal"))


def tell_test(
    name: str, statistic: float, freedom: int, outcomes: tuple[str, str]
) -> dict[str, Any]:
    """What `result.json` has of a test.

    Parameters
    ----------
    name : str
        What is tested, and by which test.
    statistic : float
        Its value.
    freedom : int
        Degrees of freedom of the chi-squared distribution it is compared with.
    outcomes : (str, str)
        The words where the test speaks, and where it does not.

    Returns
    -------
    dict
        Name, statistic and freedom; `p`, the probability of as large a statistic where nothing but
        noise is left; and what it `says`, in a word.
    """
    from scipy.special import chdtrc

    p = float(chdtrc(freedom, statistic))
    says = outcomes[0] if p < REJECTED else outcomes[1]
    return {"name": name, "statistic": statistic, "freedom": freedom, "p": p, "says": says}
