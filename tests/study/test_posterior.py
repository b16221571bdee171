"""Draws of the posterior beside the intervals of a fit, `sample`, and their page."""

import numpy as np
import pytest
import uncertainty as study
from pages import charts, read, unpacked
from printed_events import problem, records

from tractexp.errors import UserError
from tractexp.identification.posterior import PosteriorSample, sample
from tractexp.report import posterior


@pytest.fixture(scope="module")
def quiet():
    return study.judged(problem(records((0.5,), 0.001)), study.TYPICAL).uncertainty


def test_the_posterior_confirms_the_intervals(quiet):
    pytest.importorskip("emcee", reason="the optional extra [posterior] is not installed")
    drawn = sample(quiet, walkers=40, steps=600, seed=1)
    for (low, high), value, half in zip(drawn.intervals, quiet.values, quiet.half, strict=True):
        assert (high - low) / 2 == pytest.approx(half, rel=0.3)
        assert (high + low) / 2 == pytest.approx(value, abs=0.3 * half)


def test_the_same_seed_gives_the_same_draws(quiet):
    pytest.importorskip("emcee", reason="the optional extra [posterior] is not installed")
    one, again = (sample(quiet, walkers=18, steps=50, seed=1) for _ in range(2))
    np.testing.assert_array_equal(one.draws, again.draws)


def test_too_few_walkers_are_refused(quiet):
    pytest.importorskip("emcee", reason="the optional extra [posterior] is not installed")
    with pytest.raises(
        UserError, match=r"task.walkers=10 is too few: 9 coordinates need at least 18"
    ):
        sample(quiet, walkers=10, steps=100, seed=0)


def test_the_page_of_a_posterior_shows_its_draws_beside_the_fit(quiet, tmp_path):
    rng = np.random.default_rng(1)
    error = quiet.information.standard_errors
    draws = quiet.values + error * rng.standard_normal((20_000, len(error)))
    draws[:, 1] += 1.5 * error[1]  # of one parameter they lie elsewhere
    # as C does, so does q_v
    draws[:, 6] = quiet.values[6] + error[6] * (draws[:, 2] - quiet.values[2]) / error[2]
    path = posterior.report(quiet, PosteriorSample(quiet.names, draws, 2000, 50.0, 0.3, 1)).save(
        tmp_path / "posterior.html"
    )
    told, drawn = read(path).words, charts(path.read_text(encoding="utf-8"))
    assert "but those of X_prime: take the posterior's." in told
    assert "The chain lasts 40 autocorrelation times; 50 are asked for: raise steps." in told
    assert "C and q_v depend on each other most" in told
    assert len(drawn) == len(quiet.names) + 1
    first = drawn[0]
    edges, density = (unpacked(first["data"][-1][axis]).astype(float) for axis in "xy")
    assert np.sum(np.diff(edges) * density[:-1]) == pytest.approx(1, rel=1e-4)
    shaded, estimate = first["layout"]["shapes"]
    assert (shaded["x0"], shaded["x1"]) == pytest.approx(np.quantile(draws[:, 0], [0.025, 0.975]))
    assert estimate["x0"] == quiet.values[0]
