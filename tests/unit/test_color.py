"""Colored noise, `fit_autoregression` and `Autoregression`: known coefficients, the exact whitener,
and gaps.
"""

import numpy as np
import pytest
from scipy.linalg import cholesky, toeplitz
from scipy.signal import lfilter

from tractexp.noise.color import Autoregression, cut_stretches, fit_autoregression


def test_burg_finds_the_coefficients_and_aicc_the_order():
    rng = np.random.default_rng(3)
    x = lfilter([1.0], [1.0, -1.2, 0.5], rng.standard_normal(20_000))
    found = fit_autoregression([x[:9000], x[9000:]])
    assert found.order in (2, 3)  # AICc may take one too many
    np.testing.assert_allclose(found.coefficients[-1, :2], [1.2, -0.5], atol=0.03)
    assert found.deviation[-1] == pytest.approx(1.0, rel=0.02)
    assert fit_autoregression([rng.standard_normal(2000)]).order <= 1


def test_whitening_is_the_inverse_of_the_cholesky_factor_of_the_covariance():
    """For AR(1) the exact whitener is known: both are lower triangular with a positive diagonal,
    hence equal.
    """
    a, n = 0.7, 12
    noise = Autoregression(np.array([[0.0], [a]]), np.array([1 / np.sqrt(1 - a * a), 1.0]))
    exact = np.linalg.inv(cholesky(toeplitz(a ** np.arange(n)) / (1 - a * a), lower=True))
    whitener = noise.whiten(np.eye(n), np.ones(n, dtype=bool)).T
    np.testing.assert_allclose(whitener, exact, atol=1e-12)


def test_a_gap_ends_the_memory_and_counts_for_nothing():
    a = 0.9
    noise = Autoregression(np.array([[0.0], [a]]), np.array([1 / np.sqrt(1 - a * a), 1.0]))
    x = np.random.default_rng(0).standard_normal(40)
    known = np.ones(40, dtype=bool)
    known[17:20] = False
    white = noise.whiten(np.where(known, x, 1e6), known)
    assert (white[~known] == 0).all()
    assert white[20] == pytest.approx(x[20] * np.sqrt(1 - a * a))
    assert white[21] == pytest.approx(x[21] - a * x[20])
    assert [len(s) for s in cut_stretches(x, known)] == [17, 20]
