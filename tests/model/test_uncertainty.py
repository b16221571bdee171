"""How well records tell their parameters, by `conclude`: known symmetries, planted noise, bounds,
and how often intervals hold.
"""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import symmetries
import uncertainty as study
from printed_events import NOISE, minimum, one_dip, records
from uncertainty import IDENTIFIED, UNIDENTIFIED, WEAK
from written_out import dense, printed_dip

import tractexp
from tractexp.identification.advice import advise
from tractexp.identification.uncertainty import compute_threshold, conclude
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem


@pytest.fixture(scope="module")
def model():
    return study.model()


@pytest.fixture(scope="module")
def deep(model):
    """A dip of 50 % with 0.5 % of colored noise, judged from the truth's neighborhood."""
    events = records((0.5,), 0.005, correlation=0.7)
    return study.judged(Problem(model, events), study.TYPICAL * 1.02).uncertainty


def test_the_t_circuits_fourth_number_is_found_to_be_one_too_many(model):
    events = records((0.5,), 0.002)
    _, known = study.identified(symmetries.load(symmetries.TCircuit), events)
    (direction,) = known.information.unseen
    assert np.count_nonzero(direction) == 4
    circuit = ("X_s", "X_m", "X_r", "R_r")
    assert {n for n, v in known.verdicts.items() if v.word == UNIDENTIFIED} == set(circuit)
    # Along that direction X, X' and T0' do not change to first order: that is what the terminals
    # show.
    X_s, X_m, X_r, R_r = (known.values[known.names.index(n)] for n in circuit)
    relative = np.array([direction[known.names.index(n)] for n in circuit])

    def shown(step):
        s, m, r, R = np.array([X_s, X_m, X_r, R_r]) * (1 + step * relative)
        return np.log([s + m, s + m * r / (m + r), (m + r) / R])

    slope = (shown(1e-6) - shown(-1e-6)) / 2e-6
    np.testing.assert_allclose(slope, 0.0, atol=1e-3)
    assert known.fields()["standard_errors"]["X_s"] is None


def test_a_rating_only_scales_the_reactance_and_the_inertia():
    _, known = study.identified(symmetries.load(symmetries.Rated), records((0.5,), 0.002))
    (direction,) = known.information.unseen
    moves = dict(zip(known.names, direction / direction[known.names.index("rating")], strict=True))
    assert moves["x_prime"] == pytest.approx(1.0, abs=1e-3)
    assert moves["inertia"] == pytest.approx(-1.0, abs=1e-3)
    assert [n for n, m in moves.items() if abs(m) > 1e-3] == ["x_prime", "inertia", "rating"]
    said = str(known.verdicts["rating"])
    assert "leave the record unchanged; what it sees is x_prime / rating, inertia rating" in said


def test_the_papers_model_has_no_structural_symmetry(deep):
    assert len(deep.information.unseen) == 0
    assert {v.word for v in deep.verdicts.values()} <= {IDENTIFIED, WEAK}


def test_one_shallow_dip_leaves_c_weak_and_three_dips_identify_it(model):
    """Noise of 1 % throughout; what C trades against is said."""
    truth = study.TYPICAL
    one = study.judged(Problem(model, records((0.15,), 0.01)), truth).uncertainty
    three = study.judged(Problem(model, records((0.15, 0.3, 0.5), 0.01)), truth).uncertainty
    # that smaller values than 0.75 fit as well is told by profiles (test_profile)
    assert one.verdicts["C"].word != IDENTIFIED
    assert "trades against" in one.verdicts["C"].detail
    assert "q_v (correlation -0.9" in one.verdicts["C"].detail
    assert three.verdicts["C"].word == IDENTIFIED
    assert three.half[2] < one.half[2] / 5


def test_without_static_load_its_exponent_means_nothing(model):
    truth = study.TYPICAL.copy()
    t, U = study.Shape(0.5).voltage()
    rng = np.random.default_rng(4)
    power = printed_dip(0.5, tuple(truth), 0.35, truth[4]) + study.noise(rng, len(t), 0.002, 0.0)
    _, known = study.identified(model, [study.event(t, U, power)])
    assert known.verdicts["p_v"].word == UNIDENTIFIED
    assert known.verdicts["M"].word == IDENTIFIED


def test_noise_level_and_color_are_recovered(deep):
    for row in deep.noise:
        assert row["deviation"] == pytest.approx(0.005, rel=0.15)
        assert row["correlation"] == pytest.approx(0.7, abs=0.1)
    assert all(t["says"] == "white" for t in deep.tests if t["name"].startswith("whiteness"))
    assert not deep.notes


def test_intervals_shrink_with_the_root_of_the_samples_and_grow_with_the_noise(model):
    def half(deviation, step):
        t, U = study.Shape(0.5, step=step).voltage()
        events = [study.event(t, U, study.printed(study.TYPICAL, t, U, 0.35))]
        return study.bound(model, events, study.TYPICAL, deviation, 0.0).standard_errors

    np.testing.assert_allclose(half(0.01, 2e-3) / half(0.005, 2e-3), 2.0, rtol=1e-6)
    np.testing.assert_allclose(half(0.005, 2e-3) / half(0.005, 1e-3), np.sqrt(2), rtol=0.05)


def test_another_valley_is_found_where_the_search_missed_it(model):
    """At q_v = 2 the static load takes over U²/X' and any C fits; the judgement looks beyond that
    valley.
    """
    events = records((0.5,), 0.002)
    stuck = study.TYPICAL.copy()
    stuck[[1, 2, 6]] = [0.35 * 0.4 / 0.85, 0.4, 2.0]
    known = study.judged(Problem(model, events), stuck).uncertainty
    assert known.values[2] == pytest.approx(0.85, rel=0.05)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """8 records under two kinds of noise; the full study is benchmarks/uncertainty.py."""
    inside, off = [], []
    for seed in range(4):
        for row in study.coverage_record(seed, ("white 0.2 %", "AR(1) 0.2 %")).values():
            inside.append(row["inside"])
            off.append(row["likely"])
    n = np.size(inside)
    assert abs(np.mean(inside) - 0.95) < 4 * np.sqrt(0.95 * 0.05 / n)
    assert np.sqrt(np.mean(np.square(off))) < 1.1


def test_stator_transients_the_model_lacks_are_noticed():
    assert study.independent_record(0)["warned"]


def test_a_fit_at_a_bound_says_so(model):
    problem = Problem(model, records((0.5,), 0.002), {"M": [0.001, 0.005]})
    known = study.judged(problem, np.minimum(study.TYPICAL, problem.upper)).uncertainty
    assert str(known.verdicts["M"]).startswith(
        "at its bound: 0.005; the record asks for a value beyond it: widen model.bounds.M"
    )


def test_what_a_requirement_of_the_model_holds_is_not_called_without_effect():
    """All of P_s of constant impedance: a_I has no room below, and above it a share of constant
    power is negative.
    """
    load = tractexp.compose({"motor": "electromechanical", "static": "zip"}).model
    problem = Problem(load, records((0.5,), 0.002))
    values = np.array([{"a_Z": 1.0, "a_I": 0.0}.get(p.name, p.default) for p in load.parameters])
    likelihood = Likelihood.from_problem(problem)
    known = conclude(likelihood, likelihood.to_unit(values)[0])
    assert known.information.held == ("a_I",)
    assert str(known.verdicts["a_I"]).endswith(
        "a requirement of the model holds it there: beside it there is no steady state"
    )
    assert not any("requirement" in str(v) for name, v in known.verdicts.items() if name != "a_I")
    sentences = advise(known, SimpleNamespace(grade=None))
    assert any(
        sentence.startswith("fix a_I by model.fixed: a requirement") for sentence in sentences
    )
    assert not any("does not change with it" in sentence for sentence in sentences)


def test_gaps_cost_precision_and_nothing_else(model):
    (event,) = records((0.5,), 0.004, seed=2)
    P = event.record.P.copy()
    P[300:600:3] = np.nan
    holed = replace(event, record=replace(event.record, P=P))
    whole, gaps = (
        study.judged(Problem(model, [e]), study.TYPICAL).uncertainty for e in (event, holed)
    )
    assert gaps.likelihood.samples == whole.likelihood.samples - 100
    # or the two would stand on other noise
    assert not any(row["wanders"] for row in (*whole.noise, *gaps.noise))
    off = np.abs(gaps.values - study.TYPICAL) / gaps.information.standard_errors
    assert off.max() < 4
    assert (gaps.half >= 0.95 * whole.half).all()
    assert gaps.half[3] > whole.half[3]


def test_the_fields_of_the_result_are_plain_json(deep):
    fields = json.loads(json.dumps(deep.fields(), allow_nan=False))
    assert list(fields["intervals"]) == list(study.NAMES)
    for name, (low, high) in fields["intervals"].items():
        assert low < deep.values[deep.names.index(name)] < high
        assert fields["standard_errors"][name] > 0
        assert isinstance(fields["verdicts"][name], str)


def test_intervals_hold_the_truth_under_a_correlated_error_that_the_usual_ones_miss():
    """A slow random error, thrice the noise: 10 records, the parameters that one dip tells."""
    told, usual = [], []
    own = [0, 3, 4, 5]  # T', M, T_m, p_v
    for seed in range(10):
        rng = np.random.default_rng([seed, 4])
        case = one_dip(study.noise(rng, 1000, 3 * NOISE, 0.97), seed=seed)
        squares = Likelihood.of_squares(case, NOISE)
        unit = minimum(squares, squares.to_unit(study.TYPICAL)[0])
        known = conclude(squares, unit, squares.with_initial_power)
        off = np.abs(known.values - study.TYPICAL)[own]
        told.append(off <= known.half[own])
        rows, J = squares.jacobian(unit)[0], dense(squares.jacobian(unit)[1])
        plain = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * np.mean(rows**2)) * (
            case.upper - case.lower
        )
        usual.append(off <= 1.96 * plain[own])
    assert np.mean(told) > 0.8
    assert np.mean(usual) < 0.6


def test_the_deviance_rises_to_its_limit_where_the_interval_ends():
    """Of a parameter by itself, others free: the parabola of the sandwich, by the likelihood as
    wide as the scatter.
    """
    squares = Likelihood.of_squares(one_dip(), NOISE)
    unit = minimum(squares, squares.to_unit(study.TYPICAL)[0])
    known = conclude(squares, unit, squares.with_initial_power)
    j = known.names.index("T_m")
    moved = unit.copy()
    moved[j] += known.half[j] / (known.upper[j] - known.lower[j])
    end = minimum(known.likelihood, moved, held=[j])
    rise = np.sum(known.likelihood.rows(end[None]) ** 2) - known.deviance
    assert rise == pytest.approx(known.limits[j], rel=0.25)
    assert known.limits[j] != pytest.approx(compute_threshold(), rel=0.01)


def test_correlated_noise_of_p_and_q_is_seen_and_used():
    t, U = study.Shape(0.5).voltage()
    rng = np.random.default_rng(4)
    common = 0.004 * rng.standard_normal(len(t))
    power = printed_dip(0.5, tuple(study.TYPICAL), 0.35) + common
    power += 0.0005 * rng.standard_normal(power.shape)
    known = study.judged(
        Problem(study.model(), [study.event(t, U, power)]), study.TYPICAL
    ).uncertainty
    assert known.noise[0]["between_P_and_Q"] > 0.95
    apart = Likelihood.of_squares(known.likelihood.problem, 0.004).with_initial_power
    J = dense(apart.jacobian(known.unit)[1])
    loose = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))[: apart.free] * (known.upper - known.lower)
    assert (known.information.standard_errors < loose).all()
    assert np.median(known.information.standard_errors / loose) < 0.6
