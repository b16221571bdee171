"""SSA and ISSA against steps written out sparrow by sparrow from the paper's equations."""

import math

import numpy as np
import pytest

from tractexp.extend import Box, build
from tractexp.extend.search import Limits, search
from tractexp_plugins.optimizers import _sparrow as sparrow
from tractexp_plugins.optimizers import covariant_sparrow as covariant
from tractexp_plugins.optimizers import issa

N, D = 5, 2
X = np.array([[0.2, 0.7], [0.4, 0.1], [0.9, 0.5], [0.3, 0.3], [0.8, 0.6]])
F = np.array([1.0, 2.0, 3.0, 4.0, 5.0])


class Drawn:
    """A generator that hands out known numbers in the order they are asked for, and checks each
    request.
    """

    def __init__(self, **numbers):
        self.numbers = {name: list(map(np.asarray, values)) for name, values in numbers.items()}

    def _next(self, name, shape):
        drawn = self.numbers[name].pop(0)
        assert drawn.shape == tuple(shape)
        return drawn

    def random(self, shape=()):
        shape = (shape,) if isinstance(shape, int) else shape
        return self._next("random", shape)

    def standard_normal(self, shape):
        return self._next("normal", shape)

    def integers(self, low, high, shape):
        assert (low, high) == (0, 2)
        return self._next("integers", shape)

    def uniform(self, low, high, shape):
        assert (low, high) == (-1.0, 1.0)
        return self._next("uniform", shape)

    def permutation(self, n):
        return self._next("permutation", (n,))

    def spent(self):
        return not any(self.numbers.values())


def test_producers_shrink_by_rank_while_no_alarm_is_raised():
    u = [0.25, 0.5, 0.0]
    got = sparrow.produce(X[:3], False, 300, Drawn(random=[[[v] for v in u]]))
    for i in range(3):
        for j in range(D):
            alpha = 1 - u[i]
            assert got[i, j] == pytest.approx(
                X[i, j] * math.exp(-(i + 1) / (alpha * 300)), rel=1e-15
            )


def test_alarmed_producers_jump_by_one_normal_number_in_every_coordinate():
    q = [0.3, -1.2]
    got = sparrow.produce(X[:2], True, 300, Drawn(normal=[[[v] for v in q]]))
    for i in range(2):
        for j in range(D):
            assert got[i, j] == X[i, j] + q[i]


def test_scalar_step_is_the_printed_matrix_product():
    leader, coins = np.array([0.25, 0.5]), np.array([[0, 1], [1, 1], [0, 0]])
    got = sparrow.follow(X[2:], leader, 1.0, True, Drawn(integers=[coins]))
    for i in range(3):
        A = np.array([[1.0 if c else -1.0 for c in coins[i]]])  # (1, d)
        A_plus = A.T @ np.linalg.inv(A @ A.T)  # (d, 1)
        L = np.ones((1, D))
        expected = leader + np.abs(X[2 + i : 3 + i] - leader) @ A_plus @ L
        np.testing.assert_allclose(got[i], expected[0], rtol=1e-14)


def test_elementwise_step_is_the_equation_for_one_coordinate_at_a_time():
    leader, coins, s = (
        np.array([0.25, 0.5]),
        np.array([[0, 1], [1, 0]]),
        np.array([[2.0, -0.5], [0.1, 3.0]]),
    )
    got = sparrow.follow(X[1:3], leader, s, False, Drawn(integers=[coins]))
    for i in range(2):
        for j in range(D):
            sign = 1 if coins[i, j] else -1
            assert got[i, j] == pytest.approx(
                leader[j] + s[i, j] * abs(X[1 + i, j] - leader[j]) * sign, rel=1e-14
            )


def test_levy_flight_enters_the_scalar_step_coordinate_by_coordinate():
    leader, s = np.array([0.0, 0.0]), np.array([[2.0, 3.0]])
    got = sparrow.follow(X[:1], leader, s, True, Drawn(integers=[[[1, 0]]]))
    np.testing.assert_allclose(got, (2 * 0.2 - 3 * 0.7) / 2 * np.ones((1, 2)), rtol=1e-14)


def test_hungry_scroungers_fly_to_a_normal_number_times_an_exponential():
    q, worst = [0.5, -2.0], np.array([0.8, 0.6])
    got = sparrow.starve(X[3:], worst, np.array([4, 5]), Drawn(normal=[[[v] for v in q]]))
    for k, i in enumerate((4, 5)):
        for j in range(D):
            assert got[k, j] == pytest.approx(
                q[k] * math.exp((worst[j] - X[i - 1, j]) / i**2), rel=1e-15
            )


def test_hungry_scroungers_survive_bounds_of_any_size():
    x = np.array([[-1e9, 1e9]])
    assert np.isfinite(
        sparrow.starve(x, np.array([1e9, -1e9]), np.array([26]), np.random.default_rng(0))
    ).all()


def test_perceivers_gather_about_the_best_and_the_best_flees_the_worst():
    beta, k = np.array([[0.5, -1.0], [2.0, 0.1]]), np.array([[0.4], [-0.7]])
    best, worst = (X[0], F[0]), (X[4], F[4])
    got = sparrow.perceive(X[[0, 2]], F[[0, 2]], best, worst, Drawn(normal=[beta], uniform=[k]))
    for j in range(D):
        assert got[0, j] == pytest.approx(
            X[0, j] + 0.4 * abs(X[0, j] - X[4, j]) / (1.0 - 5.0 + 1e-50), rel=1e-15
        )
        assert got[1, j] == pytest.approx(X[0, j] + beta[1, j] * abs(X[2, j] - X[0, j]), rel=1e-15)


def sphere(x):
    return ((x - 0.4) ** 2).sum(axis=1)


class Recorded:
    """A batch objective on the unit square that remembers its batches."""

    budget = None

    def __init__(self):
        self.batches = []

    def __call__(self, x):
        x = np.clip(x, 0, 1)
        self.batches.append(x)
        return x, sphere(x)


def iteration_by_hand(x, f, u, better_only, scalar):
    """One iteration of Eqs. (11)-(13) with five sparrows: one producer, ranks 2 to 5 scroungers,
    two perceivers.
    """
    order = sorted(range(N), key=lambda i: f[i])
    x, f = [list(x[i]) for i in order], [f[i] for i in order]
    worst, f_worst = list(x[4]), f[4]
    best, f_best = list(x[0]), f[0]
    batches = []

    def propose(moves):
        nonlocal best, f_best
        batches.append([[min(max(v, 0), 1) for v in moves[i]] for i in sorted(moves)])
        for i, point in zip(sorted(moves), batches[-1], strict=True):
            value = sum((v - 0.4) ** 2 for v in point)
            if not better_only or value < f[i]:
                x[i], f[i] = point, value
                if value < f_best:
                    best, f_best = point, value

    factor = math.exp(-1 / ((1 - u["alpha"]) * 300))
    propose({0: [v * factor if u["R2"] < 0.8 else v + u["Q1"] for v in x[0]]})
    leader = list(x[0])
    moves = {}
    for i in range(1, N):
        rank = i + 1
        if rank > N / 2:
            q = u["Q"][i - 2]
            moves[i] = [q * math.exp((worst[j] - x[i][j]) / rank**2) for j in range(D)]
        else:
            signed = [abs(x[i][j] - leader[j]) * (1 if u["A"][j] else -1) for j in range(D)]
            moves[i] = [leader[j] + (sum(signed) / D if scalar else signed[j]) for j in range(D)]
    for m, i in enumerate(u["watch"]):
        if f[i] > f_best:
            moves[i] = [best[j] + u["beta"][m][j] * abs(x[i][j] - best[j]) for j in range(D)]
        else:
            denominator = f[i] - f_worst + 1e-50
            moves[i] = [
                x[i][j] + u["K"][m] * abs(x[i][j] - worst[j]) / denominator for j in range(D)
            ]
    propose(moves)
    return x, f, batches


@pytest.mark.parametrize("step", ["elementwise", "scalar"])
@pytest.mark.parametrize("acceptance", ["better", "all"])
@pytest.mark.parametrize(
    ("R2", "watch"), [(0.5, [3, 0]), (0.79, [1, 4]), (0.8, [0, 2]), (0.95, [2, 3])]
)
def test_an_iteration_of_ssa_is_the_one_computed_by_hand(step, acceptance, R2, watch):
    u = {
        "R2": R2,
        "alpha": 0.35,
        "Q1": -0.15,
        "Q": [0.3, 0.9, -0.2],
        "A": [1, 0],
        "watch": watch,
        "beta": [[0.5, -0.6], [0.2, 0.8]],
        "K": [0.3, -0.9],
    }
    normal = [[[v] for v in u["Q"]], u["beta"]]
    if R2 >= 0.8:
        normal.insert(0, [[u["Q1"]]])
    drawn = Drawn(
        random=[X, R2] + ([[[u["alpha"]]]] if R2 < 0.8 else []),
        integers=[[u["A"]]],
        normal=normal,
        uniform=[[[k] for k in u["K"]]],
        permutation=[watch + [i for i in range(N) if i not in watch]],
    )
    settings = {"population": N, "perceivers": 0.4, "acceptance": acceptance, "step": step}
    evaluate, box = Recorded(), Box.unit(D)
    steps = build("optimizer", {"name": "ssa", **settings}).search(evaluate, box, drawn)
    next(steps)
    next(steps)
    assert drawn.spent()
    _, _, batches = iteration_by_hand(X, sphere(X), u, acceptance == "better", step == "scalar")
    assert len(evaluate.batches) == 3
    for got, expected in zip(evaluate.batches[1:], batches, strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-13)


@pytest.mark.parametrize("better_only", [True, False])
def test_a_sparrow_moves_to_improve_or_always(better_only):
    evaluate = Recorded()
    flock = sparrow.Flock(X.copy(), evaluate, better_only)
    before = flock.f.copy()
    flock.move(np.array([0, 1]), np.array([[0.4, 0.4], [1.0, 1.0]]))
    np.testing.assert_array_equal(flock.x[0], [0.4, 0.4])
    np.testing.assert_array_equal(flock.x[1], X[1] if better_only else [1.0, 1.0])
    assert flock.f[1] == (before[1] if better_only else pytest.approx(0.72))
    np.testing.assert_array_equal(flock.best[0], [0.4, 0.4])


def test_the_best_is_remembered_when_every_move_is_taken():
    flock = sparrow.Flock(X.copy(), Recorded(), False)
    first = flock.f.argmin()
    flock.move(np.array([first]), np.array([[1.0, 1.0]]))
    np.testing.assert_array_equal(flock.best[0], X[first])


def test_tent_map_by_hand():
    # 0.1 < 0.3: 0.1/0.3; then (1 - 1/3)/0.7, (1 - 0.952380..)/0.7, 0.0680../0.3
    z, orbit = np.array([0.1]), []
    for _ in range(4):
        z = issa.tent(z, 0.3)
        orbit.append(z[0])
    np.testing.assert_allclose(orbit, [1 / 3, 20 / 21, 10 / 147, 100 / 441], rtol=1e-13)


def test_tent_map_keeps_the_uniform_density():
    """The map's invariant measure is uniform: the mean and variance of a long orbit are 1/2 and
    1/12.
    """
    rng = np.random.default_rng(3)
    z, seen = rng.random(200), []
    for _ in range(500):
        z = issa.tent_orbit(z, 0.3, rng)
        seen.append(z)
    assert np.mean(seen) == pytest.approx(0.5, abs=0.005)
    assert np.var(seen) == pytest.approx(1 / 12, abs=0.002)


def test_a_dead_orbit_starts_anew():
    rng = np.random.default_rng(0)
    z = rng.random(20)
    for _ in range(200):  # alpha = 1/2 shifts the binary digits out: every orbit reaches 0
        z = issa.tent_orbit(z, 0.5, rng)
    assert ((z > 0) & (z < 1)).all()
    assert np.ptp(z) > 0.1


def test_tent_initialization_is_one_orbit_of_the_map_in_each_coordinate():
    box = Box(np.array([-1.0, 2.0]), np.array([1.0, 6.0]))
    x = build("optimizer", {"name": "issa", "population": 5}).initial(
        box, Drawn(random=[[0.1, 0.6]])
    )
    first, second = [0.1], [0.6]
    for _ in range(4):
        first.append(first[-1] / 0.3 if first[-1] < 0.3 else (1 - first[-1]) / 0.7)
        second.append(second[-1] / 0.3 if second[-1] < 0.3 else (1 - second[-1]) / 0.7)
    np.testing.assert_allclose(x[:, 0], [-1 + 2 * z for z in first], rtol=1e-13)
    np.testing.assert_allclose(x[:, 1], [2 + 4 * z for z in second], rtol=1e-13)


def test_mantegnas_sigma():
    """beta = 1 is the Cauchy case, sigma = 1 exactly; 0.6966 at beta = 3/2 is the
    published value.
    """
    assert issa.levy_sigma(1.0) == pytest.approx(1.0, rel=1e-14)
    assert issa.levy_sigma(1.5) == pytest.approx(0.696575, abs=1e-6)


def test_levy_step_as_mantegna_and_as_printed():
    mu, nu = 0.8, -0.5
    sigma = issa.levy_sigma(1.5)
    mantegna = issa.levy_flight((1,), "mantegna", Drawn(normal=[[mu], [nu]]))
    printed = issa.levy_flight((1,), "printed", Drawn(normal=[[mu], [nu]]))
    assert mantegna[0] == pytest.approx(sigma * mu / 0.5 ** (2 / 3), rel=1e-14)
    assert printed[0] == pytest.approx(-sigma * mu / 0.5**1.5, rel=1e-14)


def test_mantegnas_steps_have_the_tail_of_a_stable_law():
    """P(|s| > x) falls as x^-1.5; the printed step's falls as x^(-1/1.5), far heavier."""
    rng = np.random.default_rng(5)
    slopes = {}
    for formula in ("mantegna", "printed"):
        s = np.abs(issa.levy_flight((2_000_000,), formula, rng))
        slopes[formula] = np.log((s > 100).mean() / (s > 1000).mean()) / np.log(10)
    assert slopes["mantegna"] == pytest.approx(1.5, abs=0.15)
    assert slopes["printed"] == pytest.approx(2 / 3, abs=0.05)


def test_gaussian_variation_by_hand():
    got = issa.vary(X[:1], Drawn(normal=[[[0.5, -2.0]]]))
    np.testing.assert_allclose(got, [[0.2 * 1.5, 0.7 * -1.0]], rtol=1e-15)


def test_tent_perturbation_is_the_mean_with_a_chaotic_point_of_the_box():
    box = Box(np.array([-1.0, 2.0]), np.array([1.0, 6.0]))
    got = issa.disturb(np.array([[0.5, 3.0]]), np.array([[0.25, 0.75]]), box)
    np.testing.assert_allclose(got, [[(0.5 - 0.5) / 2, (3.0 + 5.0) / 2]], rtol=1e-15)


def perturbed(schedule, t, **switches):
    optimizer = build(
        "optimizer", {"name": "issa", "population": N, "schedule": schedule, **switches}
    )
    varied, disturbed = optimizer._divide(t, 10, F)
    return varied.tolist(), disturbed.tolist()


def test_by_fitness_the_better_half_varies_and_the_others_are_disturbed():
    assert perturbed("fitness", 1) == ([0, 1], [2, 3, 4])  # the mean of F is 3
    assert perturbed("fitness", 1, gaussian=False) == ([], [2, 3, 4])
    assert perturbed("fitness", 10, tent_perturbation=False) == ([0, 1], [])


def test_by_stage_all_are_disturbed_early_and_the_best_varies_late():
    assert perturbed("stage", 5) == ([], [0, 1, 2, 3, 4])
    assert perturbed("stage", 6) == ([0], [])
    assert perturbed("stage", 5, tent_perturbation=False) == ([], [])
    assert perturbed("stage", 6, gaussian=False) == ([], [])


@pytest.mark.parametrize("budget", [1000, 6000, 40_000])
@pytest.mark.parametrize(
    "switches", [{}, {"gaussian": False}, {"tent_perturbation": False}, {"levy": False}]
)
def test_a_budget_lets_the_schedule_run_whole(budget, switches, monkeypatch):
    """The first half of the iterations disturbs all, the second varies the best: the budget ends
    with the second.
    """
    laid_out, steps = [], []
    whole = issa.ISSA._divide

    def seen(self, t, iterations, f):
        laid_out.append(iterations)
        steps.append(t)
        return whole(self, t, iterations, f)

    monkeypatch.setattr(issa.ISSA, "_divide", seen)
    optimizer = build("optimizer", {"name": "issa", "schedule": "stage", **switches})
    assert search(Bowl(), optimizer, 0, Limits(simulations=budget)).simulations == budget
    assert len({*laid_out}) == 1
    assert abs(steps[-1] - laid_out[0]) <= max(2, 0.02 * laid_out[0])


def test_without_a_budget_there_are_the_papers_iterations_and_with_both_the_first_to_end_counts():
    def iterations(limit, **settings):
        return search(
            Bowl(), build("optimizer", {"name": "issa", **settings}), 0, Limits(simulations=limit)
        ).iterations

    assert iterations(None) == 300
    assert iterations(100_000) > 900
    assert iterations(100_000, iterations=12) == 12
    assert iterations(1000, iterations=300) < 12


class Bowl:
    """A shifted sphere in a box with its own units."""

    lower, upper = np.array([0.1, -3.0, 10.0]), np.array([0.4, 5.0, 90.0])

    def objective(self, values):
        return (((values - self.lower) / (self.upper - self.lower) - [0.3, 0.6, 0.45]) ** 2).sum(
            axis=1
        )

    def residuals(self, values):
        return (values - self.lower) / (self.upper - self.lower) - [0.3, 0.6, 0.45]


OFF = {"tent_initialization": False, "levy": False, "gaussian": False, "tent_perturbation": False}


@pytest.mark.parametrize(
    "reading", [{}, {"space": "raw", "acceptance": "all", "step": "scalar"}, {"polish": True}]
)
@pytest.mark.parametrize("seed", [0, 7])
def test_issa_with_everything_off_is_ssa_bit_for_bit(reading, seed):
    settings = {"iterations": 40, **reading}
    ssa = search(Bowl(), build("optimizer", {"name": "ssa", **settings}), seed)
    off = search(Bowl(), build("optimizer", {"name": "issa", **settings, **OFF}), seed)
    assert ssa.values.tobytes() == off.values.tobytes()
    assert ssa.history.objective.tobytes() == off.history.objective.tobytes()
    assert ssa.history.values.tobytes() == off.history.values.tobytes()
    assert ssa.history.simulations.tolist() == off.history.simulations.tolist()


@pytest.mark.parametrize("switch", OFF)
def test_each_ingredient_changes_the_search(switch):
    ssa = search(Bowl(), build("optimizer", {"name": "ssa", "iterations": 10}), 0)
    one = search(
        Bowl(), build("optimizer", {"name": "issa", "iterations": 10, **OFF, switch: True}), 0
    )
    assert ssa.history.values.tobytes() != one.history.values.tobytes()


def test_simulations_of_an_iteration():
    """A flock moves once, its perceiving producers once more; ISSA by fitness simulates all once
    again.
    """
    spent = {}
    for name in ("ssa", "issa"):
        h = search(Bowl(), build("optimizer", {"name": name, "iterations": 30}), 1).history
        assert h.simulations[0] == 50
        spent[name] = np.diff(h.simulations)
    assert spent["ssa"].min() >= 50
    assert spent["ssa"].max() <= 60
    assert spent["issa"].min() >= 100
    assert spent["issa"].max() <= 110


def covariant_move(x, seed=3, **settings):
    optimizer = build("optimizer", {"name": "covariant_sparrow", "population": len(x), **settings})
    return optimizer._propose_points(x, np.random.default_rng(seed))


def test_the_covariant_flock_moves_as_computed_by_hand():
    """Five sparrows: a producer, a scrounger that follows, three that starve; the second and the
    last perceive.
    """
    one, step, led = np.array([1, 3, 0, 2, 4]), np.array([2, 1, 3, 1, 4]), np.zeros(5, dtype=int)
    q, normal, coins = (
        np.array([[-0.7]]),
        np.array([[0.5, -1.5], [0.25, 2.0]]),
        np.full((N, D), 0.5),
    )
    coins[2, 1] = 0.95  # not below the share of 0.9: the third sparrow keeps its second coordinate
    asked = iter([(0, N, one), (1, N, step), (0, 1, led), (0, D, np.zeros(N, dtype=int))])

    class Numbers(Drawn):
        def integers(self, low, high, size):
            expected_low, expected_high, drawn = next(asked)
            assert (low, high, size) == (expected_low, expected_high, N)
            return drawn

    rng = Numbers(normal=[q, normal], permutation=[[1, 4, 0, 2, 3]], random=[coins])
    settings = {"population": N, "producers": 0.2, "perceivers": 0.4, "factor": 0.6, "mixing": 0.9}
    got = build("optimizer", {"name": "covariant_sparrow", **settings})._propose_points(X, rng)

    other = [(a + b) % N for a, b in zip(one, step, strict=True)]
    mean = [(X[0, j] + X[1, j]) / 2 for j in range(D)]  # of the better half, two of five
    for j in range(D):
        way = [X[one[i], j] - X[other[i], j] for i in range(N)]
        expected = [
            X[0, j] - 0.7 * way[0],
            None,
            X[0, j] + 0.6 * way[2],
            X[0, j] + 0.6 * way[3],
            None,
        ]
        for row, (a, b) in zip((1, 4), normal, strict=True):
            expected[row] = X[0, j] + (
                a * (X[0, j] - mean[j]) + b * (X[1, j] - mean[j])
            ) / math.sqrt(2)
        if j == 1:
            expected[2] = X[2, 1]
        np.testing.assert_allclose(got[:, j], expected, rtol=1e-13)
    assert rng.spent()


def test_a_covariant_scrounger_follows_a_producer_and_a_way_between_two_sparrows():
    x = np.random.default_rng(0).random((20, 3))
    rng = np.random.default_rng(3)
    way, leader = covariant.differences(x, rng), x[rng.integers(0, 4, 20)]
    got = covariant_move(x, 3, perceivers=0.0, mixing=1.0)
    np.testing.assert_allclose(
        got[4:10], x[4:10] + 0.6 * (leader - x)[4:10] + 0.6 * way[4:10], rtol=1e-13
    )


def test_a_covariant_flock_may_be_turned_stretched_and_shifted():
    """With whole positions taken, the moves of the transformed flock are the transformed moves: no
    axis, no zero.
    """
    rng = np.random.default_rng(1)
    x, turn, shift = rng.random((30, 4)), rng.standard_normal((4, 4)), rng.standard_normal(4)
    moved = covariant_move(x, mixing=1.0)
    assert np.abs(moved - x).max() > 0.1
    np.testing.assert_allclose(
        covariant_move(x @ turn + shift, mixing=1.0), moved @ turn + shift, atol=1e-12
    )


def test_covariant_perceivers_have_the_covariance_of_the_better_half():
    better = np.random.default_rng(2).standard_normal((15, 3)) @ [
        [1, 2, 0],
        [0, 0.3, 0.1],
        [0, 0, 2],
    ]
    best = np.array([5.0, -1.0, 2.0])
    drawn = covariant.draw_varied_points(best, better, 200_000, np.random.default_rng(4))
    np.testing.assert_allclose(drawn.mean(axis=0), best, atol=0.03)
    np.testing.assert_allclose(np.cov(drawn.T), np.cov(better.T, bias=True), rtol=0.02, atol=0.02)


def test_a_way_never_leads_from_a_sparrow_to_itself():
    x = np.arange(4.0)[:, None]
    assert (covariant.differences(np.repeat(x, 1, axis=0), np.random.default_rng(0)) != 0).all()
    ways = np.concatenate(
        [covariant.differences(x, np.random.default_rng(seed)) for seed in range(200)]
    )
    assert {*ways[:, 0].tolist()} == {-3.0, -2.0, -1.0, 1.0, 2.0, 3.0}


def test_a_sparrow_takes_at_least_one_coordinate():
    x = np.zeros((50, 4))
    taken = covariant.mix_coordinates(x, x + 1, 0.0, np.random.default_rng(0))
    assert (taken.sum(axis=1) == 1).all()
    assert (covariant.mix_coordinates(x, x + 1, 1.0, np.random.default_rng(0)) == 1).all()


def test_a_collapsed_covariant_flock_is_drawn_anew():
    """In a bowl the flock is soon narrower than allowed; after that points all over the square come
    again.
    """
    evaluate, optimizer = (
        Recorded(),
        build("optimizer", {"name": "covariant_sparrow", "collapse": 1e-3}),
    )
    steps = optimizer.search(evaluate, Box.unit(2), np.random.default_rng(0))
    for _ in range(200):
        next(steps)
    widths = [np.ptp(batch, axis=0).max() for batch in evaluate.batches]
    narrow = next(i for i, width in enumerate(widths) if width < 1e-2)
    assert max(widths[narrow:]) > 0.8
    assert len({len(batch) for batch in evaluate.batches}) == 1
