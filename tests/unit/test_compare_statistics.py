"""The tests and effect sizes against numbers worked out by hand, published, or SciPy's."""

import numpy as np
import pytest
import scipy  # whose `stats` are imported by the two tests that use them

from tractexp.studies.comparison import statistics as st

RNG = np.random.default_rng(7)


def test_vargha_delaney_counts_pairs_and_half_of_the_ties():
    """Of the nine pairs of {1, 2, 3} and {2, 3, 4}, six are lower and two equal: (6 + 1) / 9."""
    assert st.compute_vargha_delaney([1, 2, 3], [2, 3, 4]) == pytest.approx(7 / 9)
    assert st.compute_vargha_delaney([2, 3, 4], [1, 2, 3]) == pytest.approx(2 / 9)
    assert st.compute_vargha_delaney([1.0, np.inf], [2.0, np.inf]) == pytest.approx(
        (1 + 1 + 0 + 0.5) / 4
    )


def test_vargha_delaney_is_the_mann_whitney_statistic_per_pair():
    a, b = RNG.normal(size=20), RNG.normal(0.4, size=15)
    assert st.compute_vargha_delaney(a, b) == pytest.approx(
        scipy.stats.mannwhitneyu(b, a).statistic / 300
    )


@pytest.mark.parametrize(
    ("effect", "size"),
    [
        (0.5, "negligible"),
        (0.55, "negligible"),
        (0.56, "small"),
        (0.36, "medium"),
        (0.71, "large"),
        (0.0, "large"),
    ],
)
def test_effects_are_called_as_vargha_and_delaney_call_them(effect, size):
    assert st.describe_effect_size(effect) == size


def test_holm_steps_down():
    """0.01 x 4, 0.02 x 3, then 0.03 x 2 and 0.04 x 1, neither below the one before."""
    assert st.correct_by_holm([0.04, 0.01, 0.03, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert st.correct_by_holm([0.6, 0.7]) == pytest.approx([1.0, 1.0])
    assert st.correct_by_holm([]).shape == (0,)


def test_the_signed_rank_test_is_exact_for_few_seeds():
    """Six pairs that all agree: 2 / 2^6 of all signs are as extreme; the rank sums are 21 and 0."""
    a = np.arange(6.0)
    assert st.run_wilcoxon_test(a, a + np.arange(1, 7)) == (pytest.approx(2 / 64), 21.0)
    assert st.run_wilcoxon_test(a + np.arange(1, 7), a)[1] == -21.0
    assert 2 / 2**st.LEAST_SEEDS < st.SIGNIFICANCE_LEVEL < 2 / 2 ** (st.LEAST_SEEDS - 1)


def test_equal_samples_show_nothing():
    a = RNG.normal(size=30)
    assert st.run_wilcoxon_test(a, a) == (1.0, 0.0)


def test_a_failed_run_is_the_worst_of_all():
    a = np.array([1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6])
    b = a + np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, np.inf])
    assert st.run_wilcoxon_test(a, b) == (pytest.approx(2 / 128), 28.0)


@pytest.mark.parametrize(("alpha", "published"), [(0.05, 1.25), (0.10, 1.12)])
def test_the_critical_difference_is_demsars(alpha, published):
    """Demsar 2006, section 3.2: four classifiers on 14 data sets."""
    assert st.compute_critical_difference(4, 14, alpha) == pytest.approx(published, abs=0.006)


@pytest.mark.parametrize(("k", "q"), [(2, 1.960), (3, 2.343), (4, 2.569), (5, 2.728), (10, 3.164)])
def test_the_quantiles_are_those_demsar_tabulates(k, q):
    assert st.compute_critical_difference(k, 7) == pytest.approx(
        q * np.sqrt(k * (k + 1) / 42), abs=2e-3
    )


def test_the_groups_are_those_of_demsars_diagram():
    """At 10 %, C4.5 differs from C4.5+m and C4.5+m+cf; nothing else differs."""
    names, ranks = ("C4.5", "+m", "+cf", "+m+cf"), (3.143, 2.000, 2.893, 1.964)
    assert st.group_indifferent(names, ranks, st.compute_critical_difference(4, 14, 0.10)) == (
        ("+m+cf", "+m", "+cf"),
        ("+cf", "C4.5"),
    )
    assert st.group_indifferent(names, ranks, st.compute_critical_difference(4, 14, 0.05)) == (
        ("+m+cf", "+m", "+cf", "C4.5"),
    )
    assert st.group_indifferent(names, (1.0, 5.0, 10.0, 20.0), 2.0) == ()


def test_friedman_without_ties_is_the_textbook_formula():
    table = RNG.normal(size=(12, 4))
    ranks = st.rank_by_friedman("abcd", table)
    mean = np.mean([np.argsort(np.argsort(row)) + 1 for row in table], axis=0)
    chi2 = 12 * 12 / (4 * 5) * (np.sum(mean**2) - 4 * 25 / 4)
    assert ranks.mean == pytest.approx(mean)
    assert ranks.chi2 == pytest.approx(chi2)
    assert ranks.p == pytest.approx(scipy.stats.chi2.sf(chi2, 3))


def test_friedman_of_nothing_but_ties_shows_nothing():
    ranks = st.rank_by_friedman("abc", np.ones((8, 3)))
    assert (ranks.mean, ranks.chi2, ranks.p) == ((2.0, 2.0, 2.0), 0.0, 1.0)
    assert ranks.groups == (("a", "b", "c"),)


def test_the_expected_running_time_charges_failures_their_budget():
    """Two successes at 100 and 300, one failure with 1000: 1400 per two successes."""
    spent, reached = np.array([100, 300, 1000]), np.array([True, True, False])
    assert st.compute_expected_running_time(spent, reached) == 700
    assert st.compute_expected_running_time(spent, np.zeros(3, bool)) == np.inf


def test_the_bootstrap_interval_of_a_mean_is_about_two_standard_errors():
    values = RNG.normal(3.0, 2.0, size=200)
    low, high = st.bootstrap_interval(values)
    error = values.std(ddof=1) / np.sqrt(200)
    assert (low, high) == pytest.approx(
        (values.mean() - 1.96 * error, values.mean() + 1.96 * error), abs=0.15 * error
    )
    assert st.bootstrap_interval(values) == (low, high)
    assert st.bootstrap_interval(np.full(5, 2.0)) == (2.0, 2.0)
