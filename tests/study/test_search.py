"""The one search loop: clipping, counting, budgets, the best, the history of `write_history`, and
the polish by `descend_least_squares` that it ends with.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tractexp.extend import REFUSED, Box, Evaluate, Optimizer, UserError, build
from tractexp.extend.search import (
    LEAST_START_DISTANCE,
    History,
    Limits,
    best_distinct,
    race,
    search,
)
from tractexp.identification.polish import Elite, _Residuals, descend_least_squares
from tractexp.identification.result import parse_history, write_history
from tractexp.text import progress

LOWER, UPPER = np.array([-2.0, 0.5, 100.0]), np.array([3.0, 0.75, 900.0])
TRUTH = np.array([1.25, 0.6, 400.0])


class Watched:
    """A weighted sphere that remembers what it was asked; its last answers may be overridden."""

    def __init__(self, lower=LOWER, upper=UPPER, truth=TRUTH):
        self.lower, self.upper, self.truth = lower, upper, truth
        self.asked: list[np.ndarray] = []

    def residuals(self, values):
        self.asked.append(values.copy())
        return (values - self.truth) / (self.upper - self.lower)

    def objective(self, values):
        return (self.residuals(values) ** 2).sum(axis=1)

    @property
    def points(self):
        return np.concatenate(self.asked)


class Scripted(Optimizer):
    """Proposes given batches, one an iteration."""

    name = "scripted"

    def __init__(self, batches, space="unit", residuals=False, polish=False):
        for key, value in {
            "batches": batches,
            "space": space,
            "with_residuals": residuals,
            "polish": polish,
        }.items():
            object.__setattr__(self, key, value)
        object.__setattr__(self, "answers", [])

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        for batch in self.batches:
            self.answers.append(
                (evaluate.residuals if self.with_residuals else evaluate)(np.asarray(batch))
            )
            yield


coordinates = st.floats(-1e6, 1e6)
batches = st.lists(
    arrays(float, st.tuples(st.integers(1, 7), st.just(3)), elements=coordinates),
    min_size=1,
    max_size=6,
)


@given(batches, st.sampled_from(["unit", "raw"]), st.booleans(), st.integers(1, 30))
@settings(max_examples=150, deadline=None)
def test_the_loop_clips_counts_stops_and_keeps_the_best(proposed, space, residuals, budget):
    problem, optimizer = Watched(), Scripted(proposed, space, residuals)
    found = search(problem, optimizer, 0, Limits(simulations=budget))
    wanted = sum(map(len, proposed))
    points = problem.points
    assert len(points) == found.simulations == min(budget, wanted)
    assert ((points >= LOWER) & (points <= UPPER)).all()
    f = Watched().objective(points)
    # the loop sums squared residuals in another order than the problem
    rounding = 1e-14 if residuals else 0.0
    assert found.objective == pytest.approx(f.min(), rel=rounding, abs=0)
    assert found.objective == pytest.approx(
        Watched().objective(found.values[None])[0], rel=rounding, abs=0
    )
    best = np.minimum.accumulate(f)
    np.testing.assert_allclose(
        found.history.objective, best[found.history.simulations - 1], rtol=rounding, atol=0
    )
    assert (f"budget of {budget}" in found.status) == (wanted > budget)


@given(arrays(float, (4, 3), elements=coordinates))
@settings(deadline=None)
def test_an_optimizer_is_told_the_points_really_evaluated(x):
    optimizer = Scripted([x], "unit")
    search(Watched(), optimizer, 0)
    told, f = optimizer.answers[0]
    np.testing.assert_array_equal(told, np.clip(x, 0, 1))
    np.testing.assert_array_equal(
        f, Watched().objective(np.clip(LOWER + told * (UPPER - LOWER), LOWER, UPPER))
    )


def test_history_has_one_row_per_iteration_and_one_for_a_cut_one():
    batches = [np.full((4, 3), 0.2)] * 3
    assert search(Watched(), Scripted(batches), 0).history.simulations.tolist() == [4, 8, 12]
    assert search(
        Watched(), Scripted(batches), 0, Limits(simulations=8)
    ).history.simulations.tolist() == [4, 8]
    cut = search(Watched(), Scripted(batches), 0, Limits(simulations=10))
    assert cut.history.simulations.tolist() == [4, 8, 10]
    assert cut.status == "stopped at the budget of 10 simulations"


def test_progress_is_told_each_iteration():
    told = []
    search(
        Watched(), Scripted([np.full((4, 3), 0.2)] * 3), 0, progress=lambda *row: told.append(row)
    )
    assert [(i, n) for i, _, n in told] == [(0, 4), (1, 8), (2, 12)]


def test_an_end_that_the_search_has_passed_is_none(capsys, monkeypatch):
    assert progress.share(3, 30, 4, None) == 0.75
    assert progress.share(5, 30, 4, None) is None
    assert progress.share(5, 30, 4, 60) == 0.5
    assert [progress.describe_remaining_time(6.0, done) for done in (0.75, 1.0, 0.0, None)] == [
        ", about 2 s left",
        "",
        "",
        "",
    ]
    monkeypatch.setattr(progress, "FIRST_LINE", 0.0)
    monkeypatch.setattr(progress, "_can_overwrite", lambda: False)
    with progress.report_search(4, None) as tell:
        tell(5, 0.25, 30)
    assert capsys.readouterr().err == "  iteration 5: 30 simulations, best objective 0.25\n"


def test_a_target_ends_the_search_at_once():
    batches = [np.full((4, 3), 0.2), (TRUTH - LOWER)[None] / (UPPER - LOWER), np.full((4, 3), 0.3)]
    found = search(Watched(), Scripted(batches), 0, Limits(target=1e-9))
    assert found.simulations == 5
    assert found.status == "reached the target objective 1e-09"


def test_a_time_limit_lets_no_further_batch_start():
    problem = Watched()
    found = search(problem, Scripted([np.full((4, 3), 0.2)] * 3), 0, Limits(seconds=0.0))
    assert found.simulations == 0
    assert problem.asked == []
    assert found.status == "stopped at the time limit of 0 s"


def test_an_objective_that_is_not_a_number_is_refused_not_chosen():
    class Hole(Watched):
        def objective(self, values):
            return np.where(values[:, 0] < 0, np.nan, super().objective(values))

    found = search(Hole(), Scripted([[[0.1, 0.5, 0.5], [0.9, 0.5, 0.5]]]), 0)
    assert found.refused == 1
    assert found.values[0] == pytest.approx(2.5)


def test_a_point_that_is_not_a_number_is_the_plugins_fault():
    with pytest.raises(UserError, match="not a number"):
        search(Watched(), Scripted([[[0.1, np.nan, 0.5]]]), 0)


def test_residuals_count_and_refuse_like_objectives():
    class Hole(Watched):
        def residuals(self, values):
            return np.where(values[:, :1] < 0, np.nan, super().residuals(values))

    found = search(Hole(), Scripted([[[0.1, 0.5, 0.5], [0.9, 0.5, 0.5]]], residuals=True), 0)
    assert (found.simulations, found.refused) == (2, 1)
    assert found.values[0] == pytest.approx(2.5)


def test_best_distinct_takes_the_best_and_leaves_its_neighbors():
    unit = np.array([[0.5, 0.5], [0.51, 0.5], [0.9, 0.5], [0.5, 0.05]])
    assert best_distinct(
        unit, np.array([2.0, 1.0, 3.0, 4.0]), LEAST_START_DISTANCE, 10
    ).tolist() == [1, 2, 3]
    assert best_distinct(
        unit, np.array([2.0, 1.0, 3.0, 4.0]), LEAST_START_DISTANCE, 2
    ).tolist() == [1, 2]


@given(arrays(float, (40, 2), elements=st.floats(0, 1)), st.integers(0, 99))
@settings(deadline=None)
def test_the_elite_lies_apart_in_order_and_holds_the_best(unit, seed):
    f = np.random.default_rng(seed).random(40)
    elite = Elite(Box.unit(2))
    for k in range(0, 40, 8):
        elite.add(unit[k : k + 8], f[k : k + 8])
    assert elite.f[0] == f.min()
    assert (np.diff(elite.f) > 0).all()
    apart = np.abs(elite.x[:, None] - elite.x).max(axis=2)
    assert (apart[~np.eye(len(elite.x), dtype=bool)] > LEAST_START_DISTANCE).all()


def test_the_elite_has_no_refused_points():
    elite = Elite(Box.unit(2))
    elite.add(np.array([[0.1, 0.1], [0.9, 0.9]]), np.array([REFUSED, 3.0]))
    assert elite.f.tolist() == [3.0]


class Direct:
    """Residuals of a curve without a loop around them."""

    def __init__(self, function):
        self.function, self.sizes = function, []

    def residuals(self, x):
        self.sizes.append(len(x))
        return x, self.function(x)


def test_the_jacobian_is_one_batch_of_d_and_right():
    def curve(x):
        return np.stack([np.sin(3 * x[:, 0]) * x[:, 1], np.exp(x[:, 0]), x[:, 1] ** 3], axis=1)

    evaluate, box = Direct(curve), Box(np.array([-1.0, 0.0]), np.array([1.0, 5.0]))
    residuals = _Residuals(evaluate, box, 1.0)
    unit = np.array([0.6, 0.3])
    residuals(unit)
    J = residuals.jacobian(unit)
    a, b = 2 * 0.6 - 1, 5 * 0.3
    exact = [[3 * np.cos(3 * a) * b * 2, np.sin(3 * a) * 5], [np.exp(a) * 2, 0], [0, 3 * b**2 * 5]]
    # a forward difference errs by half its step times f''
    np.testing.assert_allclose(J, exact, rtol=5e-6, atol=1e-9)
    assert evaluate.sizes == [1, 2]


def test_a_difference_that_cannot_be_simulated_is_taken_the_other_way():
    def half(x):
        return np.where(x[:, :1] > 0.3, np.nan, 2 * x)

    evaluate = Direct(half)
    residuals = _Residuals(evaluate, Box.unit(2), 1.0)
    unit = np.array([0.3, 0.4])
    residuals(unit)
    np.testing.assert_allclose(residuals.jacobian(unit), 2 * np.eye(2), rtol=1e-8, atol=1e-9)
    assert evaluate.sizes == [1, 2, 1]


def test_a_start_that_cannot_be_simulated_costs_one_simulation():
    evaluate = Direct(lambda x: np.full((len(x), 4), np.nan))
    descend_least_squares(evaluate, Box.unit(2), np.array([0.5, 0.5]), 1.0)
    assert evaluate.sizes == [1]


class TwoValleys(Direct):
    """One coordinate, objective 1 + (x - 0.2)^2 in one valley and (x - 0.8)^2 in the other, with x
    = 0.5 between.
    """

    def __init__(self):
        super().__init__(
            lambda x: np.hstack((np.where(x < 0.5, x - 0.2, x - 0.8), 1.0 * (x < 0.5)))
        )
        self.lowest = np.inf

    def residuals(self, x):
        x, rows = super().residuals(x)
        self.lowest = min(self.lowest, (rows**2).sum(axis=1).min())
        return x, rows


def test_a_descent_returns_where_it_ended():
    x, f = descend_least_squares(TwoValleys(), Box.unit(1), np.array([0.3]), 1.01)
    assert x[0] == pytest.approx(0.2, abs=1e-6)
    assert f == pytest.approx(1.0, abs=1e-12)


def test_a_race_finds_the_lower_valley_and_finishes_every_start_in_it():
    starts = [(np.array([v]), 1.0) for v in (0.1, 0.3, 0.9)]
    valleys = TwoValleys()
    descents = [valleys.lowest for _ in race(valleys, Box.unit(1), starts)]
    assert descents[:2] == pytest.approx([1.0, 1.0], abs=1e-9)
    assert descents[2] < 1e-15
    assert 3 < len(descents) <= 2 * len(starts)


@pytest.mark.parametrize("space", ["unit", "raw"])
def test_polish_finishes_what_a_search_began_inside_the_budget(space):
    def run(polish):
        optimizer = build("optimizer", {"name": "random_search", "space": space, "polish": polish})
        return search(Watched(), optimizer, 3, Limits(simulations=600))

    rough, polished = run(False), run(True)
    assert rough.objective > 1e-5
    assert polished.objective < 1e-20
    np.testing.assert_allclose(polished.values, TRUTH, rtol=1e-9)
    assert polished.simulations <= 600
    # a third
    np.testing.assert_array_equal(polished.history.objective[:4], rough.history.objective[:4])


def test_polish_follows_a_search_that_ends_by_itself():
    optimizer = build("optimizer", {"name": "random_search", "polish": True, "iterations": 2})
    found = search(Watched(), optimizer, 3)
    assert found.objective < 1e-20
    assert found.history.simulations[:3].tolist() == [50, 100, 150]
    assert found.status.startswith("finished")


class Yieldless(Optimizer):
    """Evaluates at the call of `search`, as one does who forgets the `yield`."""

    name = "yieldless"

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator):
        for _ in range(3):
            evaluate(box.uniform(rng, 10))


@pytest.mark.parametrize("limits", [Limits(), Limits(simulations=20), Limits(target=1e9)])
@pytest.mark.parametrize("polish", [False, True])
def test_an_optimizer_that_never_yields_is_refused(limits, polish):
    with pytest.raises(UserError, match="optimizer 'yieldless': its search never yields"):
        search(Watched(), Yieldless(polish=polish), 0, limits)


@pytest.mark.parametrize("iterations", [0, 3])
def test_an_optimizer_that_never_evaluates_is_refused(iterations):
    class Idle(Yieldless):
        name = "idle"

        def search(self, evaluate, box, rng):
            yield from [None] * iterations

    with pytest.raises(UserError, match=r"optimizer 'idle': .* never called `evaluate`"):
        search(Watched(), Idle(), 0)


def test_polish_leaves_a_reached_target_alone():
    optimizer = build("optimizer", {"name": "random_search", "polish": True})
    found = search(Watched(), optimizer, 3, Limits(target=0.1))
    assert found.simulations == 50
    assert found.status == "reached the target objective 0.1"


def test_polish_of_a_problem_without_residuals_says_so():
    class Bare(Watched):
        def objective(self, values):
            return values.sum(axis=1)

        def residuals(self, values):
            raise UserError("this problem has no residuals")

    with pytest.raises(UserError, match="no residuals"):
        search(
            Bare(),
            build("optimizer", {"name": "random_search", "iterations": 1, "polish": True}),
            0,
        )


def test_a_history_is_read_as_it_was_written_and_one_without_rows_is_none(tmp_path):
    """Without a warning: it is read in a thread, whose filters are those of all threads."""
    history = History(np.array([10, 20]), np.array([0.5, 0.25]), np.zeros((2, 1)), np.ones(2))
    text = write_history(tmp_path / "history.csv", history).read_text()
    simulations, seconds, objective = parse_history(text)
    assert (simulations.tolist(), seconds.tolist()) == ([10, 20], [1, 1])
    assert objective.tolist() == [0.5, 0.25]
    for without_rows in ("", text.partition("\n")[0] + "\n\n"):
        with pytest.raises(ValueError, match="no row"):
            parse_history(without_rows)
