"""Whether a residual is white and normal, `run_ljung_box` and `run_jarque_bera`."""

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from tractexp.inference.residual_tests import run_jarque_bera, run_ljung_box


def ar1(rng, n, a):
    shocks = rng.standard_normal(n)
    shocks[0] /= np.sqrt(1 - a * a)
    return lfilter([1.0], [1.0, -a], shocks)


def test_whiteness_and_normality_speak_when_they_should_and_are_silent_when_not():
    rng = np.random.default_rng(8)
    assert run_ljung_box(rng.standard_normal(800))["says"] == "white"
    assert run_ljung_box(ar1(rng, 800, 0.4))["says"] == "colored"
    assert run_jarque_bera(rng.standard_normal(800))["says"] == "normal"
    assert run_jarque_bera(rng.standard_t(3, 800))["says"] == "not normal"
    skewed = rng.exponential(size=60)
    theirs = stats.jarque_bera(skewed)
    ours = run_jarque_bera(skewed)
    assert (ours["statistic"], ours["p"]) == pytest.approx(
        (theirs.statistic, theirs.pvalue), rel=1e-9
    )
    rejected = [run_ljung_box(rng.standard_normal(300))["p"] < 0.05 for _ in range(400)]
    assert 0.02 < np.mean(rejected) < 0.09
