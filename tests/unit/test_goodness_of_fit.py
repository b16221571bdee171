"""How often chance leaves as much, `compute_tail_p`, against laws that are known."""

import numpy as np
import pytest
from scipy.stats import genextreme

from tractexp.inference.goodness_of_fit import Scale, compute_tail_p


@pytest.mark.parametrize(("shape", "p"), [(0.0, 0.01), (0.3, 0.01), (0.3, 0.001)])
def test_the_largest_of_many_has_the_tail_of_its_own_law(shape, p):
    """Draws from SciPy's extreme value distributions, light and heavy tails: the p of a known
    quantile comes out.
    """
    law = genextreme(-shape, 2.0, 3.0)
    rng = np.random.default_rng(5)
    unit = Scale(np.zeros(1), np.ones(1))
    found = [
        compute_tail_p(law.rvs((199, 1), random_state=rng), np.array([law.isf(p)]), unit)
        for _ in range(40)
    ]
    assert np.median(found) == pytest.approx(p, rel=0.3)


def test_the_largest_of_many_comes_about_by_chance_as_often_as_it_says():
    """With thousands of columns a draw must not have a part in the mean and the spread that it is
    measured by.
    """
    rng = np.random.default_rng(12)
    p = []
    for _ in range(6):
        draws, fresh = rng.normal(size=(199, 1000)) ** 2, rng.normal(size=(100, 1000)) ** 2
        p += [compute_tail_p(draws, row[None]) for row in fresh]
    assert 0.05 < np.mean(np.array(p) < 0.1) < 0.15
    assert np.mean(np.array(p) < 0.01) < 0.03
    assert 0.4 < np.mean(np.array(p) < 0.5) < 0.6


def test_a_rare_value_of_many_is_judged_alike_by_any_draws_once_the_scales_are_exact():
    """Exponential columns: the largest of 3000 exceeds x with 1 - (1 - exp(-x))^3000 exactly."""
    rng = np.random.default_rng(13)
    x = -np.log(1 - (1 - 1e-3) ** (1 / 3000))
    value, exact = np.zeros((1, 3000)), Scale(np.ones(3000), np.ones(3000))
    value[0, 1234] = x
    draws = [rng.exponential(size=(199, 3000)) for _ in range(40)]
    alike = np.array([compute_tail_p(few, value, exact) for few in draws]) / 1e-3
    own = np.array([compute_tail_p(few, value) for few in draws]) / 1e-3
    assert 0.8 < np.exp(np.log(alike).mean()) < 1.25
    assert np.log(alike).std() < 0.7 * np.log(own).std()
    assert np.all((alike > 0.25) & (alike < 4))
    assert not np.all((own > 0.25) & (own < 4))
