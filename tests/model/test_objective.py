"""What a search minimizes, by `Problem`: losses, weights, gaps and parameters per event."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import uncertainty as study

import tractexp
from tractexp.configuration.plugin import build, get
from tractexp.errors import UserError
from tractexp.identification.search import search
from tractexp.inference.problem import Problem
from tractexp.model.model import compose
from tractexp.parameter import spread_evenly


def loss(name, **settings):
    return build("objective", {"name": name, **settings})


@pytest.fixture(scope="module")
def event():
    t, U = study.Shape(0.5).voltage()
    clean = study.printed(study.TYPICAL, t, U, 0.35)
    return study.event(t, U, clean + study.noise(np.random.default_rng(6), len(t), 0.004, 0.0))


@pytest.fixture(scope="module")
def spoiled(event):
    """One sample in fifteen is off by 0.1 pu or more, after the dip has begun."""
    rng = np.random.default_rng(1)
    P = event.record.P.copy()
    at = rng.choice(np.arange(200, 1000), 55, replace=False)
    P[at] += rng.uniform(0.1, 0.3, 55)
    return replace(event, record=replace(event.record, P=P))


def values(problem, n=5):
    return study.TYPICAL * np.random.default_rng(2).uniform(0.95, 1.05, (n, 7))


@pytest.mark.parametrize("name", ["squares", "huber", "student_t"])
def test_residuals_squared_sum_to_the_objective_of_every_loss(event, name):
    problem = Problem(study.model(), [event], loss=loss(name))
    x = values(problem)
    np.testing.assert_allclose(
        (problem.residuals(x) ** 2).sum(axis=1), problem.objective(x), rtol=1e-9
    )


def test_losses_are_the_formulas_of_their_papers():
    z = np.array([0.0, 0.5, 1.345, 4.0]) ** 2
    k = 1.345
    huber = [0, 0.25, k**2, 2 * k * 4 - k**2]  # twice Huber's rho: the square where it is small
    np.testing.assert_allclose(loss("huber").rho(z), huber)
    np.testing.assert_allclose(loss("student_t", freedom=4.0).rho(z), 4 * np.log(1 + z / 4))
    np.testing.assert_allclose(loss("student_t", freedom=1e9).rho(z), z, rtol=1e-6)


def test_weights_multiply_the_squared_errors_of_each_channel(event):
    x = values(None)
    plain = Problem(study.model(), [event])
    rows = plain.residuals(x).reshape(len(x), 2, -1)
    weighted = Problem(study.model(), [event], loss=loss("squares", weight_P=3.0, weight_Q=0.5))
    expected = 3 * (rows[:, 0] ** 2).sum(axis=1) + 0.5 * (rows[:, 1] ** 2).sum(axis=1)
    np.testing.assert_allclose(weighted.objective(x), expected, rtol=1e-9)


def test_missing_samples_are_gaps_in_the_sum(event):
    Q = event.record.Q.copy()
    Q[400:500] = np.nan
    x = values(None)
    holed = Problem(study.model(), [replace(event, record=replace(event.record, Q=Q))])
    rows = Problem(study.model(), [event]).residuals(x).reshape(len(x), 2, -1)
    rows[:, 1, 400:500] = 0
    np.testing.assert_allclose(holed.objective(x), (rows**2).sum(axis=(1, 2)), rtol=1e-9)


@pytest.mark.parametrize("name", ["huber", "student_t"])
def test_outliers_pull_least_squares_and_not_a_robust_loss(spoiled, name):
    off = {}
    for chosen in ("squares", name):
        problem = Problem(study.model(), [spoiled], loss=loss(chosen))
        found = search(problem, get("optimizer", "multistart_least_squares")(starts=3), 0)
        off[chosen] = np.abs(found.values / study.TYPICAL - 1)
    assert off["squares"][[3, 4]].max() > 0.02
    assert off[name][[3, 4]].max() < 0.01
    assert off[name].max() < 0.3 * off["squares"].max()


def test_intervals_of_a_robust_fit_leave_the_outliers_out(spoiled):
    problem = Problem(study.model(), [spoiled], loss=loss("huber"))
    known = study.judged(problem, study.TYPICAL).uncertainty
    assert 0 <= 2 * 1000 - 55 - known.likelihood.samples <= 5
    assert (np.abs(known.values - study.TYPICAL) < 2 * known.half).all()
    assert known.noise[0]["deviation"] == pytest.approx(0.004, rel=0.1)


def test_a_parameter_per_event_is_found_for_each():
    t, U = study.Shape(0.5).voltage()
    rng, events = np.random.default_rng(3), []
    for k, T_m in enumerate((0.35, 0.45)):
        truth = study.TYPICAL.copy()
        truth[4] = T_m
        power = study.printed(truth, t, U, 0.35) + study.noise(rng, len(t), 0.003, 0.0)
        events.append(study.event(t, U, power, f"dip {k}"))
    problem = Problem(study.model(), events, per_event=["T_m"])
    assert problem.space.names == ("T_prime", "X_prime", "C", "M", "T_m[1]", "T_m[2]", "p_v", "q_v")
    start = np.insert(study.TYPICAL, 4, 0.4)
    known = study.judged(problem, start).uncertainty
    assert known.values[4:6] == pytest.approx([0.35, 0.45], abs=0.005)
    assert problem.full(known.values)[0, 4] == pytest.approx(0.4, abs=0.005)
    np.testing.assert_array_equal(problem.by_event(known.values)[:, 0, 4], known.values[4:6])
    alone = Problem(study.model(), events[:1], per_event=["T_m"])
    assert alone.space.names == study.NAMES


def test_the_probes_of_the_step_fill_the_cube_evenly():
    points = spread_evenly(64, 7)
    assert points.shape == (64, 7)
    assert ((points >= 0) & (points < 1)).all()
    for column in points.T:  # every eighth of every axis has its share
        assert (np.histogram(column, 8, (0, 1))[0] >= 5).all()


def test_what_cannot_be_fitted_is_refused_in_a_sentence(event):
    silent = replace(event, noise_Q=0.0)
    with pytest.raises(
        UserError, match=r"Q shows no noise before the dip.*objective\.scale \[pu\]"
    ):
        Problem(study.model(), [silent], loss=loss("huber"))
    Problem(study.model(), [silent], loss=loss("huber", scale=0.01))
    with pytest.raises(UserError, match=r"objective\.weight_P and objective\.weight_Q are both 0"):
        loss("squares", weight_P=0.0, weight_Q=0.0)
    with pytest.raises(UserError, match=r"objective\.tuning=0 is out of range"):
        loss("huber", tuning=0)
    with pytest.raises(
        UserError, match=r"model\.per_event\.T_n: this model has no parameter 'T_n'; did you mean"
    ):
        Problem(study.model(), [event], per_event=["T_n"])
    with pytest.raises(UserError, match=r"model\.per_event names M, which model\.fixed fixes"):
        Problem(study.model(), [event], fixed={"M": 0.006}, per_event=["M"])


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_fixed_value_that_is_no_number_is_refused_by_its_name(value):
    with pytest.raises(UserError, match=r"fixed.C=(nan|inf) is out of range: it must be finite"):
        tractexp.identify(
            "tibet_50pct", fixed={"C": value}, optimizer="multistart_least_squares", budget=20
        )


def contactors():
    """A shipped dip of 50 %, 2 ms a sample."""
    folder = Path(tractexp.__file__).parent / "data"
    return tractexp.read(str(folder / "contactors_50pct.csv"))


def test_what_collapses_behind_an_impedance_asks_for_no_shorter_steps(monkeypatch):
    """Of feeders beside a load that recovers a few in the box collapse, and 256 steps a sample do
    not calculate them: an investigation that ended with both was refused at its grade.
    """
    # fewer, since the search up to them takes its time
    for module in ("model.model", "inference.steps"):
        monkeypatch.setattr(f"tractexp.{module}.MOST_SUBSTEPS", 32)
    base = get("model/motor", "electromechanical")(), get("model/static", "exponential")()
    names = ("exponential_recovery", "feeder_impedance")
    model = compose(*base, [get("effect", name)() for name in names])
    assert Problem(model, contactors()).step.substeps.tolist() == [8]


def test_a_base_model_that_no_number_of_steps_calculates_is_refused():
    model = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
    with pytest.raises(UserError, match=r"Runge-Kutta steps per sample of 2 ms leave.*in a memory"):
        Problem(model, contactors(), bounds={"T_prime": (1e-7, 1e-6)})
