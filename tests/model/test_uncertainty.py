"""Noise, information and verdicts, by `conclude`, `judge` and `compare_events`: analytic cases,
known symmetries, planted noise, planted faults.
"""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import symmetries
import uncertainty as study
from scipy import stats
from scipy.linalg import cholesky, toeplitz
from scipy.signal import lfilter
from written_out import dense, dense_normal, printed_dip

import tractexp
from tractexp.identification import advice, agreement
from tractexp.identification.advice import advise
from tractexp.identification.agreement import compare_events
from tractexp.identification.profile import check_by_profiles
from tractexp.identification.uncertainty import conclude
from tractexp.identification.verdict import IDENTIFIED, UNIDENTIFIED, WEAK, judge
from tractexp.inference.differences import central_differences
from tractexp.inference.information import Information
from tractexp.inference.least_squares import descend, normal
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem
from tractexp.inference.residual_tests import jarque_bera, ljung_box
from tractexp.inference.separable import NOT_SEPARABLE
from tractexp.noise import Noise
from tractexp.noise.color import Autoregression, fit_autoregression, stretches


def ar1(rng, n, a):
    shocks = rng.standard_normal(n)
    shocks[0] /= np.sqrt(1 - a * a)
    return lfilter([1.0], [1.0, -a], shocks)


def records(depths, deviation, seed=1, truth=study.TYPICAL, correlation=0.0, Q_s0=0.35):
    """Events of the printed equations with noise."""
    rng = np.random.default_rng(seed)
    made = []
    for k, depth in enumerate(depths):
        t, U = study.Shape(depth).voltage()
        clean = printed_dip(depth, tuple(truth), Q_s0)
        made.append(
            study.event(
                t, U, clean + study.noise(rng, len(t), deviation, correlation), f"dip {k + 1}"
            )
        )
    return made


@pytest.fixture(scope="module")
def model():
    return study.model()


@pytest.fixture(scope="module")
def deep(model):
    """A dip of 50 % with 0.5 % of colored noise, judged from the truth's neighborhood."""
    events = records((0.5,), 0.005, correlation=0.7)
    return study.judged(Problem(model, events), study.TYPICAL * 1.02).uncertainty


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
    x = ar1(np.random.default_rng(0), 40, a)
    known = np.ones(40, dtype=bool)
    known[17:20] = False
    white = noise.whiten(np.where(known, x, 1e6), known)
    assert (white[~known] == 0).all()
    assert white[20] == pytest.approx(x[20] * np.sqrt(1 - a * a))
    assert white[21] == pytest.approx(x[21] - a * x[20])
    assert [len(s) for s in stretches(x, known)] == [17, 20]


def test_whiteness_and_normality_speak_when_they_should_and_are_silent_when_not():
    rng = np.random.default_rng(8)
    assert ljung_box(rng.standard_normal(800))["says"] == "white"
    assert ljung_box(ar1(rng, 800, 0.4))["says"] == "colored"
    assert jarque_bera(rng.standard_normal(800))["says"] == "normal"
    assert jarque_bera(rng.standard_t(3, 800))["says"] == "not normal"
    skewed = rng.exponential(size=60)
    theirs = stats.jarque_bera(skewed)
    ours = jarque_bera(skewed)
    assert (ours["statistic"], ours["p"]) == pytest.approx(
        (theirs.statistic, theirs.pvalue), rel=1e-9
    )
    rejected = [ljung_box(rng.standard_normal(300))["p"] < 0.05 for _ in range(400)]
    assert 0.02 < np.mean(rejected) < 0.09


def test_descent_solves_many_linear_problems_and_keeps_to_walls_and_frozen_columns():
    rng = np.random.default_rng(2)
    # the last lies beyond the wall
    A, truth = rng.standard_normal((30, 3)), np.array([0.2, 0.9, 1.4])

    def rows(unit, lanes):
        return (unit - truth) @ A.T

    start = np.full((2, 3), 0.5)
    frozen = np.array([[False] * 3, [True, False, False]])
    found = descend(rows, start, frozen, iterations=100, tolerance=1e-12)
    for lane, held in enumerate(([2], [0, 2])):
        fixed = {2: 1.0, 0: 0.5}
        free = [k for k in range(3) if k not in held]
        offset = sum(A[:, k] * (fixed[k] - truth[k]) for k in held)
        expected = truth[free] + np.linalg.lstsq(A[:, free], -offset, rcond=None)[0]
        np.testing.assert_allclose(found.unit[lane][free], expected, atol=1e-5)
        assert found.unit[lane][2] == 1.0


def test_information_of_a_straight_line_is_the_textbooks():
    """y = a + b x: the variances of regression, once with the level as a nuisance."""
    x = np.linspace(0, 1, 50)
    J = np.column_stack((np.ones(50), x))
    whole = Information.from_jacobian(("a", "b"), np.ones(2), np.ones(2), J, np.zeros((50, 1)))
    np.testing.assert_allclose(whole.covariance, np.linalg.inv(J.T @ J), rtol=1e-9)
    slope = Information.from_jacobian(("b",), np.ones(1), np.ones(1), J[:, 1:], J[:, :1])
    assert slope.standard_errors[0] == pytest.approx(whole.standard_errors[1], rel=1e-9)


def test_a_difference_is_one_sided_where_the_other_side_is_lost():
    """Rows A x that cannot be simulated above 0.5 in the second, below 0.5 in the third; the fourth
    is on a wall.
    """
    A = np.random.default_rng(1).normal(size=(6, 4))

    class Straight(Likelihood):
        def rows(self, unit, lanes=None):
            made = unit @ A.T
            made[(unit[:, 1] > 0.5) | (unit[:, 2] < 0.5)] = np.nan
            return made

    at = np.array([0.3, 0.5, 0.5, 1.0])
    rows, J = central_differences(
        Straight(problem=None, valid=None, noise=None).rows, at[None], np.zeros(1, dtype=int)
    )
    np.testing.assert_allclose(rows[0], A @ at)
    np.testing.assert_allclose(J[0].T, A, rtol=1e-6, atol=1e-9)


def test_jacobian_agrees_with_the_printed_equations(model):
    """Central differences of an independent solution of Eqs. (1)-(7), not of the model's own
    kernel.
    """
    # the mean before a smooth fall is a little lower
    events = [replace(records((0.5,), 0.005)[0], U0=1.0)]
    problem = Problem(model, events, substeps=16)
    white = Noise.white(1.0, 1.0)
    likelihood = Likelihood.from_problem(problem, white)
    t, U = events[0].record.t, events[0].record.U
    _, J = likelihood.jacobian(likelihood.to_unit(study.TYPICAL)[0])
    for j, name in enumerate(study.NAMES):
        h = 1e-3 * study.TYPICAL[j]  # well above the reference's own error of 1e-8
        sides = []
        for sign in (1, -1):
            moved = study.TYPICAL.copy()
            moved[j] += sign * h
            P, Q = study.printed(moved, t, U, 0.0, P0=events[0].P0)
            sides.append(np.concatenate((P, Q + (events[0].Q0 - Q[0]) * U ** moved[6])))
        expected = (sides[0] - sides[1]) / (2 * h) * (problem.upper - problem.lower)[j]
        np.testing.assert_allclose(
            J.shared_columns[:, j], expected, atol=1e-4 * np.abs(expected).max(), err_msg=name
        )


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
    three = check_by_profiles(
        study.judged(Problem(model, records((0.15, 0.3, 0.5), 0.01)), truth).uncertainty
    )
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
    known = check_by_profiles(
        study.judged(Problem(model, [study.event(t, U, power)]), truth).uncertainty
    )
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
    """16 records under two kinds of noise; the full study is benchmarks/uncertainty.py."""
    inside, off = [], []
    for seed in range(8):
        for row in study.coverage_record(seed, ("white 0.2 %", "AR(1) 0.2 %")).values():
            inside.append(row["inside"])
            off.append(row["likely"])
    n = np.size(inside)
    assert abs(np.mean(inside) - 0.95) < 4 * np.sqrt(0.95 * 0.05 / n)
    assert np.sqrt(np.mean(np.square(off))) < 1.1


def test_an_interval_that_reaches_past_the_bounds_says_so():
    information = SimpleNamespace(
        names=("T_m",),
        values=np.array([0.5]),
        unseen=np.zeros((0, 1)),
        identifiable=np.array([True]),
    )
    half = np.array([0.02])
    inside, past = (
        judge(information, np.array([0.0]), np.array([upper]), half, np.array([1.96]))["T_m"]
        for upper in (1.0, 0.51)
    )
    assert str(inside) == IDENTIFIED
    assert str(past) == f"{IDENTIFIED}: the interval reaches past its bounds"


def test_stator_transients_the_model_lacks_are_noticed():
    assert study.independent_record(0)["warned"]


def test_each_event_is_credited_and_the_one_that_does_not_belong_is_named(model):
    changed = study.TYPICAL.copy()
    changed[3] *= 1.15  # another inertia on the second dip
    good = records((0.3, 0.5, 0.6), 0.003)
    (odd,) = records((0.4,), 0.003, seed=9, truth=changed)
    fine = compare_events(study.judged(Problem(model, good), study.TYPICAL).uncertainty)
    assert fine["odd_events"] == []
    assert all(ratio >= 1 for gain in fine["gains"].values() for ratio in gain.values())
    assert fine["gains"]["dip 3"]["M"] > fine["gains"]["dip 1"]["M"]
    odd = replace(odd, record=replace(odd.record, name="changed"))
    mixed = compare_events(study.judged(Problem(model, [*good, odd]), study.TYPICAL).uncertainty)
    assert mixed["odd_events"] == ["changed"]
    assert "changed does not fit with the rest: deviance higher by" in mixed["notes"][0]


def test_the_powers_of_all_events_take_one_simulation_of_differences(model, monkeypatch):
    """Of P before the dips and of Q, however many events there are."""
    known = study.judged(
        Problem(model, records((0.3, 0.4, 0.5, 0.6), 0.003)), study.TYPICAL
    ).uncertainty
    assert known.exact
    only, sizes = agreement.only, []

    def counted(likelihood, groups):
        rows = only(likelihood, groups)
        return lambda unit, lanes: (sizes.append(len(unit) / len(groups)), rows(unit, lanes))[1]

    monkeypatch.setattr(agreement, "only", counted)
    assert agreement.find_disagreeing_events(known) == ([], [])
    assert max(sizes) == known.likelihood.free + 2


def test_a_jacobian_takes_as_many_simulations_for_many_events_and_no_more_fits(model, monkeypatch):
    """Time and memory grow with the records, not with their number of events, too."""
    known = study.judged(
        Problem(model, records((0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6), 0.003)), study.TYPICAL
    )
    uncertainty, rows, taken = known.uncertainty, Likelihood.rows, []
    monkeypatch.setattr(
        Likelihood,
        "rows",
        lambda self, unit, *lanes: (taken.append(len(unit)), rows(self, unit))[1],
    )
    _, J = uncertainty.likelihood.jacobian(uncertainty.unit)
    assert taken == [2 * (uncertainty.likelihood.free + 2) + 1]
    assert J.columns.shape == (
        uncertainty.likelihood.free + 2,
        uncertainty.likelihood.problem.drive.measurements.size,
    )
    only, fits = agreement.only, []
    monkeypatch.setattr(
        agreement,
        "only",
        lambda likelihood, groups: (fits.append(groups), only(likelihood, groups))[1],
    )
    assert agreement.find_disagreeing_events(uncertainty) == ([], [])
    assert [len(groups) for groups in fits] == [1 + 2 * agreement.SUSPECTS]


def test_the_events_that_are_fitted_by_themselves_are_those_that_disagree_most(model, monkeypatch):
    """Among twice as many as are fitted, what is linear finds the same as a fit without and of
    each.
    """
    changed = study.TYPICAL.copy()
    changed[3] *= 1.15
    depths = (0.3, 0.35, 0.45, 0.5, 0.55, 0.6, 0.65)
    (odd,) = records((0.4,), 0.003, seed=9, truth=changed)
    events = [*records(depths, 0.003), replace(odd, record=replace(odd.record, name="changed"))]
    uncertainty = study.judged(Problem(model, events), study.TYPICAL).uncertainty
    few = agreement.find_disagreeing_events(uncertainty)
    monkeypatch.setattr(agreement, "SUSPECTS", len(events))
    assert few == agreement.find_disagreeing_events(uncertainty)
    assert few[0] == ["changed"]


def test_the_gain_of_an_event_is_that_of_all_rows_against_those_without_its_own(model):
    """Over every row and every P0 and Q0 at once, as the least squares of the whole have them."""
    known = study.judged(Problem(model, records((0.3, 0.4, 0.5), 0.003)), study.TYPICAL).uncertainty
    likelihood, gains = known.likelihood, compare_events(known)["gains"]
    J = dense(likelihood.jacobian(known.unit)[1])

    def errors(rows):
        own, nuisances = J[rows][:, : likelihood.free], J[rows][:, likelihood.free :]
        information = Information.from_jacobian(
            known.names, known.values, known.upper - known.lower, own, nuisances
        )
        return information.standard_errors

    whole = errors(np.arange(len(J)))
    for e, gain in enumerate(gains.values()):
        assert list(gain.values()) == pytest.approx(
            errors(np.setdiff1d(np.arange(len(J)), likelihood.separable_columns.rows[e])) / whole,
            rel=1e-9,
        )


def test_the_normal_equations_of_the_likelihood_are_those_of_every_column_by_itself(model):
    """P0 and Q0 of each event stand in columns of their own, which are never written out."""
    likelihood = Likelihood.from_problem(Problem(model, records((0.3, 0.5), 0.003)))
    unit, lanes = likelihood.to_unit(study.TYPICAL), np.zeros(1, dtype=int)
    base = likelihood.rows(unit)
    alone, together = (
        normal(likelihood.rows, unit, base, lanes, apart)
        for apart in (NOT_SEPARABLE, likelihood.separable_columns)
    )
    for one, other in (alone[0], together[0]), (dense_normal(alone[1]), dense_normal(together[1])):
        assert other == pytest.approx(one, rel=1e-6, abs=1e-6 * np.abs(one).max())
    assert (dense_normal(together[1]) == np.swapaxes(dense_normal(together[1]), 1, 2)).all()


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
    likelihood = Likelihood.from_problem(problem, Noise.white(0.003, 0.003))
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


def test_where_every_depth_would_do_any_dip_is_advised(monkeypatch):
    """Some of them are named by their depths."""
    known = SimpleNamespace(names=("M",), lower=[0.0], upper=[1.0], values=[0.5])
    monkeypatch.setattr(advice, "_goal", lambda *_: (0.1, []))
    told = [
        advice._further(
            known,
            0,
            [SimpleNamespace(half=[h], shape=SimpleNamespace(depth=d)) for h, d in plan],
            "more",
        )
        for plan in ([(0.05, 0.2), (0.05, 0.4)], [(0.5, 0.2), (0.05, 0.4)])
    ]
    assert [line.partition(" more")[0] for line in told] == [
        "for M: any further dip",
        "for M: a further dip of 40 %",
    ]


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
