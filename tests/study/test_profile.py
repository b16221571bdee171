"""Likelihood along one parameter, `profile_parameters`: a parabola where theory says so, open
sides, better optima, and their page.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from pages import charts, read, unpacked
from printed_events import minimum, problem, records

from tractexp.identification.profile import check_by_profiles, profile_parameters
from tractexp.identification.profile_lanes import End
from tractexp.identification.uncertainty import compute_threshold, conclude
from tractexp.report.profile import describe_profile, report


@pytest.fixture(scope="module")
def quiet():
    return study.judged(problem(records((0.5,), 0.001)), study.TYPICAL).uncertainty


def test_the_threshold_is_chi_squared_of_one_degree():
    assert compute_threshold() == pytest.approx(1.959963985**2, rel=1e-6)


@pytest.fixture(scope="module")
def along(quiet):
    """The profiles of all parameters."""
    return profile_parameters(quiet)


def test_with_little_noise_a_profile_is_the_parabola_of_the_information_matrix(quiet, along):
    assert along.restarts == 0
    for profile, value, half in zip(along.profiles, quiet.values, quiet.half, strict=True):
        np.testing.assert_allclose(
            profile.interval, (value - half, value + half), atol=0.06 * half, err_msg=profile.name
        )
        assert profile.ends == (End.CLOSED, End.CLOSED)
        assert profile.minima == ()
        parabola = along.threshold * ((profile.values - value) / half) ** 2
        np.testing.assert_allclose(profile.deviance, parabola, atol=0.25 + 0.1 * parabola.max())
    assert {v.word for v in along.verdicts.values()} == {study.IDENTIFIED}


def test_a_point_of_a_profile_is_the_constrained_optimum(quiet):
    """The deviance with M held, by SciPy on the same whitened residuals."""
    from scipy.optimize import least_squares

    found = profile_parameters(quiet, names=["M"])
    (profile,) = found.profiles
    j, likelihood = quiet.names.index("M"), quiet.likelihood
    held = (profile.values[-1] - quiet.lower[j]) / (quiet.upper[j] - quiet.lower[j])

    def rows(x):
        return likelihood.rows(np.insert(x, j, held)[None])[0]

    solved = least_squares(
        rows, np.delete(quiet.unit, j), x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12
    )
    assert profile.deviance[-1] == pytest.approx(2 * solved.cost - quiet.deviance, abs=0.02)


def test_a_shallow_dip_leaves_c_open_on_both_sides_of_a_crest_and_the_verdict_says_so():
    """At C = 0.75 the deviance is up by 16, at 0.3 by 0.3: a lane from the estimate alone ends at
    the crest.
    """
    known = study.judged(problem(records((0.15,), 0.01)), study.TYPICAL).uncertainty
    (of_C,) = profile_parameters(known, names=["C"]).profiles
    assert of_C.ends == (End.BOUND, End.BOUND)
    assert of_C.interval == pytest.approx((0.3, 0.99))
    assert of_C.deviance.max() > 10
    judged = check_by_profiles(known)
    assert judged.verdicts["C"].word == study.UNIDENTIFIED
    assert "open upwards" in judged.verdicts["C"].detail
    assert judged.profiled["C"] == pytest.approx(of_C.interval, rel=1e-3)
    assert set(judged.profiled) >= {"C", "X_prime", "q_v"}
    narrow = {
        n for n, v, h in zip(known.names, known.values, known.half, strict=True) if h <= 0.05 * v
    }
    assert narrow  # a parabola anyway
    assert not narrow & set(judged.profiled)
    assert judged.verdicts["T_m"].word == study.IDENTIFIED


@pytest.mark.parametrize(("deviation", "seed", "Q_s0"), [(0.01, 2, 0.02), (0.005, 3, 0.05)])
def test_an_interval_holds_what_the_records_do_not_rule_out_whatever_its_profile_was_begun_from(
    deviation, seed, Q_s0
):
    """Where the static load draws next to no reactive power, q_v is hardly known, and X' and C
    follow it in a curve.

    With one parameter held at its truth after the other, the best fit from the truth is close
    enough to the optimum.
    """
    known = study.judged(
        problem(records((0.3,), deviation, seed, Q_s0=Q_s0)), study.TYPICAL
    ).uncertainty
    judged = check_by_profiles(known)
    likelihood = judged.likelihood
    truth = likelihood.to_unit(study.TYPICAL)[0]
    ends = np.array([minimum(likelihood, truth, held=[j]) for j in range(len(judged.names))])
    rows = likelihood.rows(ends)
    close = np.einsum("nr,nr->n", rows, rows) - judged.deviance < compute_threshold()
    assert close.sum() >= 2
    low, high = judged.intervals.T
    values, slack = likelihood.values(ends[close]), 1e-3 * (high - low)
    assert ((values > low - slack) & (values < high + slack)).all()


def test_a_better_optimum_restarts_the_profiles_and_is_said(quiet):
    """Started from a point off the optimum, as a search may leave it."""
    off = quiet.unit.copy()
    off[quiet.names.index("M")] += 3 * quiet.half[3] / (quiet.upper[3] - quiet.lower[3])
    found = profile_parameters(conclude(quiet.likelihood, off))
    assert found.restarts >= 1
    assert "a better optimum turned up along a profile" in found.notes[0]
    np.testing.assert_allclose(found.uncertainty.values, quiet.values, atol=0.1 * quiet.half.min())
    assert found.uncertainty.deviance == pytest.approx(quiet.deviance, abs=0.05)


def test_the_page_draws_each_profile_with_its_parabola_and_interval(quiet, along, tmp_path):
    path = report(along).save(tmp_path / "profile.html")
    told, drawn = read(path), charts(path.read_text(encoding="utf-8"))
    for chart, profile, value, half in zip(
        drawn, along.profiles, quiet.values, quiet.half, strict=True
    ):
        assert chart["layout"]["title"]["text"] == f"{profile.name}: identified"
        curves = {trace["name"]: trace for trace in chart["data"] if trace["name"]}
        x, y = (unpacked(curves["profile"][axis]) for axis in "xy")
        np.testing.assert_allclose(np.interp(profile.values, x, y), profile.deviance, atol=1e-4)
        for end in profile.interval:  # the interval is where the curve drawn crosses the threshold
            assert np.interp(end, x, y) == pytest.approx(along.threshold, rel=0.02)
        x, y = (unpacked(curves["curvature"][axis]) for axis in "xy")
        assert np.interp(value + half, x, y) == pytest.approx(along.threshold, rel=0.02)
        shaded, level = chart["layout"]["shapes"]
        assert (shaded["x0"], shaded["x1"]) == profile.interval
        assert level["y0"] == along.threshold
    assert "For every parameter the curvature's interval is enough" in told.words
    assert "Every parameter is identified." in told.words
    for part in ("transient reactance on the record's base", "pu s²/rad", "is enough."):
        assert part in told.words


def test_the_page_of_a_model_that_lacks_something_says_what_its_intervals_hold(tmp_path):
    (event,) = records((0.5,), 0.002)
    # a load that is switched on: nothing of the model can do that
    step = 0.02 * (event.record.t > 0.85)
    spoiled = study.event(
        event.record.t, event.record.U, np.array([event.record.P + step, event.record.Q])
    )
    known = study.judged(problem([spoiled]), study.TYPICAL).uncertainty
    assert not known.exact
    found = profile_parameters(known, names=["M", "p_v"])
    told = read(report(found, "an effect is missing").save(tmp_path / "profile.html"))
    assert "An effect is missing." in told.words
    assert "More than noise is left, so these are intervals of least squares" in told.words
    assert all(
        profile.interval[0] < value < profile.interval[1]
        for profile, value in zip(found.profiles, (known.values[3], known.values[5]), strict=True)
    )


def test_the_page_says_where_curvature_misleads(quiet):
    found = profile_parameters(quiet, names=["M"])
    (profile,), value, half = found.profiles, quiet.values[3], quiet.half[3]
    bound, points = (End.CLOSED, End.BOUND), (End.POINTS, End.CLOSED)
    for changes, sentence in (
        ({}, "± .* is enough"),
        ({"interval": (value - half, value + 3 * half)}, r"Lopsided: 3\.0 times as far up"),
        ({"interval": (value - 2 * half, value + half)}, r"Lopsided: 2\.0 times as far down"),
        ({"interval": (value - half / 2, value + half / 2)}, "Narrower than by curvature"),
        ({"interval": (value - 2 * half, value + 2 * half)}, "Wider than by curvature"),
        (
            {"ends": bound, "interval": (value - half, 0.03)},
            r"No limit upwards but the bound 0\.03",
        ),
        ({"ends": (End.BOUND, End.BOUND)}, "No limit but the bounds: the record does not tell it"),
        ({"ends": points}, "Not followed to its end downwards: raise points"),
        ({"minima": (0.02,)}, r"0\.02 fits about as well as the estimate"),
    ):
        assert re.fullmatch(
            sentence + r"\.", describe_profile(found, replace(profile, **changes))
        ), sentence
