"""The paper's experiments: numbers by hand (`compute_mean_residual`, `compare_depths`), planted
verdicts, every experiment and part, refusals.
"""

import json
import re
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import run_command

from tractexp.blocks import Report
from tractexp.blocks.markdown import render_markdown
from tractexp.errors import UserError
from tractexp.identification.generalization import compare_depths, compute_mean_residual
from tractexp.studies import searches
from tractexp.studies.api.paper import PARTS
from tractexp.studies.paper import (
    claims,
    equations,
    figure_claims,
    maps,
    printed,
    valleys,
    verdict,
    why,
)
from tractexp.studies.paper.study import Shares, Study
from tractexp.studies.paper.valleys import Ends

QUICK = ("task=paper", "task.seeds=1", "task.workers=1", "budget=300", "tracking.enabled=false")
EXPERIMENTS = [
    "table1",
    "table2",
    "table3",
    "table4",
    "table5",
    "figure3",
    "figure4",
    "figure6",
    "figure8",
    "figure9",
    "figure10",
    "figure11",
    "equations",
    "readings",
]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """All parts with one seed, few simulations and few random points: (folder, what
    was printed).
    """
    folder = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tractexp.studies.paper.study.RANDOM", 30)
        patch.setattr("tractexp.studies.paper.figure_sections.RANDOM", 30)
        patch.setattr("tractexp.studies.paper.orders.TIMED_REPEATS", 5)
        done = run_command(*QUICK, "hydra.run.dir=run", "task.docs=docs/paper.md", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


@pytest.fixture(scope="module")
def generalised(tmp_path_factory):
    folder = tmp_path_factory.mktemp("generalise")
    done = run_command(
        "task=generalise",
        "task.optimizers=[pso]",
        "budget=400",
        "tracking.enabled=false",
        "hydra.run.dir=run",
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


# What the paper prints


@pytest.mark.parametrize(("name", "sine"), [("issa", 4.29), ("ssa", 6.00), ("pso", 2.97)])
def test_no_column_of_table_3_has_a_steady_state(name, sine):
    assert equations.compute_steady_state_sine(printed.TABLE_3[name]) == pytest.approx(
        sine, abs=0.005
    )


def test_the_columns_of_table_3_cannot_fit_one_record_however_they_were_rounded():
    """Two columns give mean P² and mean Q² by Eqs. (8) and (20); the second is negative in every
    corner of rounding.
    """
    half_P, half_Q, half_E = (5e-6, 5e-7), (5e-6, 5e-6), (5e-7, 5e-7)
    for signs in product((-1, 1), repeat=6):
        P = [
            printed.EPSILON_P[n] + s * h
            for n, s, h in zip(("issa", "ssa"), signs[:2], half_P, strict=True)
        ]
        Q = [
            printed.EPSILON_Q[n] + s * h
            for n, s, h in zip(("issa", "ssa"), signs[2:4], half_Q, strict=True)
        ]
        E = [
            printed.OBJECTIVE[n] + s * h
            for n, s, h in zip(("issa", "ssa"), signs[4:], half_E, strict=True)
        ]
        determinant = P[0] ** 2 * Q[1] ** 2 - P[1] ** 2 * Q[0] ** 2
        assert (P[0] ** 2 * E[1] - P[1] ** 2 * E[0]) / determinant < -1
    found = equations.check_consistency()
    assert found.pairs["issa and ssa"][1] == pytest.approx(-1.319, abs=0.001)
    assert min(found.best) >= 0
    assert max(map(abs, found.misses.values())) > 0.05


def test_a_consistent_table_is_found_consistent(monkeypatch):
    """Objectives made of mean P² = 0.6 and mean Q² = 0.3 give these back, with no miss."""
    made = {
        n: printed.EPSILON_P[n] ** 2 * 0.6 + printed.EPSILON_Q[n] ** 2 * 0.3
        for n in printed.COMPARED
    }
    monkeypatch.setattr(printed, "OBJECTIVE", made)
    found = equations.check_consistency()
    assert found.best == pytest.approx((0.6, 0.3))
    assert max(map(abs, found.misses.values())) < 1e-12


def test_eq_4_as_printed_is_of_first_order():
    """y' = y by hand: 1 + h + 5/18 h² + h³/27 + h⁴/216 as printed, where the exponential series
    begins h²/2.
    """
    h, one = 0.5, np.ones(1)
    wrong = 1 + h + 5 / 18 * h**2 + h**3 / 27 + h**4 / 216
    right = 1 + h + h**2 / 2 + h**3 / 6 + h**4 / 24
    assert equations.step_as_printed(lambda y: y, one, h)[0] == pytest.approx(wrong, rel=1e-14)
    assert equations.step_classically(lambda y: y, one, h)[0] == pytest.approx(right, rel=1e-14)
    assert equations.order(equations.step_as_printed) == pytest.approx(1, abs=0.05)
    assert equations.order(equations.step_classically) == pytest.approx(4, abs=0.05)


def test_what_is_printed_is_put_into_the_printed_equations(monkeypatch):
    """The columns of Table 3 fail; a table made of a machine and of one record's mean squares
    passes.
    """
    failed = {
        (c.where, c.printed.partition(" ")[0])
        for c in equations.check_printed_numbers()
        if not c.holds
    }
    assert {
        ("Table 3, ISSA", "C"),
        ("Table 3, SSA", "T'"),
        ("Eq. (4)", "the"),
        ("Eq. (15)", "Lévy"),
    } <= failed
    assert ("Table 3, PSO", "C") not in failed
    assert ("Table 3, SSA and PSO", "errors") not in failed
    machine = (0.06, 0.7, 0.8, 0.0026, 0.36, 1.4, 3.6)
    monkeypatch.setattr(printed, "TABLE_3", dict.fromkeys(printed.COMPARED, machine))
    made = {
        n: printed.EPSILON_P[n] ** 2 * 0.6 + printed.EPSILON_Q[n] ** 2 * 0.3
        for n in printed.COMPARED
    }
    monkeypatch.setattr(printed, "OBJECTIVE", made)
    assert not [
        c
        for c in equations.check_printed_numbers()
        if not c.holds and c.where.startswith("Table 3, ")
    ]


def test_the_state_of_eq_3_is_at_rest_and_another_is_not(monkeypatch):
    assert equations.compute_rest_residual(equations.FAIR) < 1e-12
    monkeypatch.setattr(np, "arcsin", lambda x: 1.1 * x)
    assert equations.compute_rest_residual(equations.FAIR) > 1e-3


def test_what_the_motor_draws_before_the_dip_is_that_of_the_equivalent_circuit():
    """R_s = 0: Z = j X_s + (j X_m) || (R_r/s + j X_r); T_m is P_d, and Q_d follows without it."""
    X_s, X_m, X_r, R_r, slip, U = 0.16, 2.0, 0.2, 0.02, 0.02, 1.03
    rotor = R_r / slip + 1j * X_r
    S = U**2 / np.conj(1j * X_s + 1j * X_m * rotor / (1j * X_m + rotor))
    X, X_prime = X_s + X_m, X_s + X_m * X_r / (X_m + X_r)
    value = {"T_m": S.real, "X_prime": X_prime, "C": (X - X_prime) / X}
    assert equations.compute_motor_reactive(value, U) == pytest.approx(S.imag, rel=1e-12)


def test_sparrow_search_as_printed_is_drawn_to_zero_and_particle_swarm_is_not():
    found = equations.measure_bias(budget=2000, seeds=3)
    for name in ("ssa", "issa"):
        near, far = found[name]
        assert far > 1e3 * near
    near, far = found["pso"]
    assert 0.05 < far / near < 20


# Maps and flights


def test_a_tent_orbit_follows_eq_14():
    """By hand with alpha = 0.3: 0.15 -> 0.5 -> 0.5/0.7 = 0.714 -> 0.286/0.7 = 0.408; and each point
    of an orbit.
    """
    z = 0.15
    for expected in (0.5, 5 / 7, (2 / 7) / 0.7):
        z = z / 0.3 if z < 0.3 else (1 - z) / 0.7
        assert z == pytest.approx(expected)
    orbit = maps.compute_tent_orbit(0.3, 100, 2, np.random.default_rng(1))
    before, after = orbit[:-1], orbit[1:]
    assert after == pytest.approx(np.where(before < 0.3, before / 0.3, (1 - before) / 0.7))


def test_a_logistic_orbit_follows_its_map():
    orbit = maps.compute_logistic_orbit(50, 3, np.random.default_rng(1))
    assert orbit.shape == (50, 3)
    assert orbit[1:] == pytest.approx(4 * orbit[:-1] * (1 - orbit[:-1]))


def test_discrepancy_ranks_what_is_known_to_be_even():
    """Sobol points are more even than random ones, and these than the logistic map, which crowds at
    the walls.
    """
    found = {
        k: np.median(v) for k, v in maps.measure_discrepancies(64, 2, (0.3, 0.9), draws=40).items()
    }
    assert found["Sobol"] < 0.5 * found["uniform"] < found["uniform"] < 0.5 * found["logistic"]
    assert found["tent, alpha = 0.3"] < found["tent, alpha = 0.9"]


def test_the_tail_exponent_of_known_tails_is_found():
    u = np.random.default_rng(0).random(200_000)
    for a in (0.7, 1.5, 3.0):
        assert maps.estimate_tail_exponent(u ** (-1 / a)) == pytest.approx(a, rel=0.05)


def test_mantegnas_steps_have_exponent_three_halves_and_the_printed_ones_two_thirds():
    """|nu|^-(1/beta) for a normal nu exceeds x with probability ~ x^-beta, |nu|^-beta with
    x^-(1/beta).
    """
    assert maps.estimate_tail_exponent(maps.draw_flights("mantegna", 200_000, 1)) == pytest.approx(
        1.5, abs=0.15
    )
    assert maps.estimate_tail_exponent(maps.draw_flights("printed", 200_000, 1)) == pytest.approx(
        2 / 3, abs=0.07
    )


# Eq. (21)


def test_eq_21_by_hand():
    """|1 - 1.5| = 0.5 and |2 - 1| = 1 have mean 0.75; the gap does not count."""
    assert compute_mean_residual(
        np.array([1.0, 2.0, np.nan]), np.array([1.5, 1.0, 3.0])
    ) == pytest.approx(0.75)


def test_a_milder_dip_is_interpolated_and_a_deeper_one_extrapolated():
    event = lambda depth: SimpleNamespace(depth=depth)  # noqa: E731
    kinds = compare_depths([event(0.3), event(0.5), event(0.65)], [event(0.4), event(0.5)])
    assert kinds == ["interpolation", "interpolation", "extrapolation"]


def test_generalise_writes_eq_21_of_the_model_it_identified(generalised):
    """Recomputed from Eqs. (1)-(3) and (6)-(7) in polar form by SciPy, which share no code with the
    kernels.
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import Akima1DInterpolator

    from tractexp.configuration.plugin import build
    from tractexp.record import detect

    content = json.loads((generalised[0] / "run" / "generalise.json").read_text())
    row = next(
        r for r in content["residuals"] if r["optimizer"] == "pso" and r["kind"] == "extrapolation"
    )
    p = next(i for i in content["identified"] if i["optimizer"] == "pso")["parameters"]
    event = detect(
        build("data", {"name": "csv", "train": ["pkg://tractexp.data/tibet_65pct.csv"]})
        .read()
        .train[0]
    )
    record, U0 = event.record, event.U0
    delta = 0.5 * np.arcsin(-2 * p["T_m"] * p["X_prime"] / (p["C"] * U0**2))
    E = p["C"] * U0 * np.cos(delta)
    Q_d0 = U0 * (U0 - E * np.cos(delta)) / p["X_prime"]
    voltage = Akima1DInterpolator(record.t, record.U)

    def slopes(t, y):
        E, delta, omega = y
        U = float(voltage(np.clip(t, record.t[0], record.t[-1])))
        return [
            (-E + p["C"] * U * np.cos(delta)) / p["T_prime"],
            -p["C"] * U * np.sin(delta) / (p["T_prime"] * E) + omega,
            (-U * E * np.sin(delta) / p["X_prime"] - p["T_m"]) / p["M"],
        ]

    start = [E, delta, np.tan(delta) / p["T_prime"]]
    solved = solve_ivp(
        slopes, record.t[[0, -1]], start, t_eval=record.t, rtol=1e-8, atol=1e-10, max_step=0.002
    ).y
    U = record.U
    P = (event.P0 - p["T_m"]) * (U / U0) ** p["p_v"] - U * solved[0] * np.sin(solved[1]) / p[
        "X_prime"
    ]
    Q = (event.Q0 - Q_d0) * (U / U0) ** p["q_v"] + U * (U - solved[0] * np.cos(solved[1])) / p[
        "X_prime"
    ]
    assert row["residual_P"] == pytest.approx(np.mean(np.abs(record.P - P)), rel=1e-3)
    assert row["residual_Q"] == pytest.approx(np.mean(np.abs(record.Q - Q)), rel=1e-3)


def test_generalise_compares_the_chosen_optimizer_too_and_says_that_the_data_are_synthetic(
    generalised,
):
    folder, printed_ = generalised
    content = json.loads((folder / "run" / "generalise.json").read_text())
    assert {(r["optimizer"], r["kind"]) for r in content["residuals"]} == {
        (n, k) for n in ("estimate", "pso", "issa") for k in ("interpolation", "extrapolation")
    }
    assert all(i["simulations"] == 400 for i in content["identified"])
    (estimate,) = (i for i in content["identified"] if i["optimizer"] == "estimate")
    assert estimate["parameters"] not in [
        i["parameters"] for i in content["identified"] if i is not estimate
    ]
    assert "synthetic stand-in" in printed_
    for name in (
        "pso_interpolation",
        "pso_extrapolation",
        "issa_interpolation",
        "issa_extrapolation",
    ):
        assert "synthetic stand-in" in (folder / "run" / f"{name}.svg").read_text()


# Searches and verdicts


def test_workers_change_no_result():
    made = [
        searches.run(
            _recipe,
            {"pso": {"name": "pso"}, "ssa": {"name": "ssa"}},
            6,
            searches.Limits(150),
            workers,
            remember=False,
        )
        for workers in (1, 2)
    ]
    for name in ("pso", "ssa"):
        a, b = ([f.objective for f in m[name]] for m in made)
        assert a == b
        assert len(set(a)) == 6


@pytest.fixture
def memory(tmp_path, monkeypatch):
    """A store of its own for searches, empty; the kernels are those of the others."""
    from tractexp.cache import store

    monkeypatch.setattr(store.SEARCHES, "folder", tmp_path)
    return tmp_path / "searches"


def searched(monkeypatch, recipe=None, settings=None, seeds=2, budget=150):
    """The searches found, and how many of them were made just now."""
    made, search = [], searches.search
    monkeypatch.setattr(searches, "search", lambda *a: made.append(a) or search(*a))
    found = searches.run(
        recipe or _recipe,
        {"pso": {"name": "pso", **(settings or {})}},
        seeds,
        searches.Limits(budget),
        workers=1,
    )["pso"]
    monkeypatch.setattr(searches, "search", search)
    return found, len(made)


def test_a_search_made_before_is_read_back_bit_for_bit(memory, monkeypatch):
    first, made = searched(monkeypatch)
    again, more = searched(monkeypatch, seeds=3)
    assert (made, more) == (2, 1)
    for a, b in zip(first, again[:2], strict=True):
        np.testing.assert_array_equal(a.values, b.values)
        for name in ("simulations", "objective", "values", "seconds"):
            np.testing.assert_array_equal(getattr(a.history, name), getattr(b.history, name))
        assert (a.objective, a.simulations, a.refused, a.iterations, a.seconds, a.status) == (
            b.objective,
            b.simulations,
            b.refused,
            b.iterations,
            b.seconds,
            b.status,
        )


def test_a_search_of_anything_else_is_never_read_back(memory, monkeypatch):
    from tractexp.cache import provenance

    searched(monkeypatch)
    assert searched(monkeypatch, settings={"population": 20})[1] == 2
    assert searched(monkeypatch, budget=151)[1] == 2
    assert searched(monkeypatch, lambda: _recipe(bounds={"C": (0.5, 0.9)}))[1] == 2
    assert searched(monkeypatch, lambda: _recipe(shift=1e-9))[1] == 2
    assert searched(monkeypatch, lambda: _recipe(motor="mechanical"))[1] == 2
    monkeypatch.setattr(provenance, "hash_code", lambda: "changed")
    assert searched(monkeypatch)[1] == 2


def test_a_damaged_search_is_made_again_and_the_oldest_are_forgotten(memory, monkeypatch):
    from tractexp.cache import store

    searched(monkeypatch)
    for k, path in enumerate(memory.iterdir()):
        path.write_bytes([b"no zip", path.read_bytes()[:200]][k])
    assert searched(monkeypatch)[1] == 2
    assert searched(monkeypatch)[1] == 0
    monkeypatch.setattr(store.SEARCHES, "limit", 3)
    searched(monkeypatch, seeds=5)
    assert len(list(memory.iterdir())) == 3


def test_a_search_that_a_clock_may_end_is_not_stored(memory, monkeypatch):
    limits = searches.Limits(150, seconds=60.0)
    searches.run(_recipe, {"pso": {"name": "pso"}}, 1, limits, workers=1)
    assert not memory.exists()


def test_a_figure_of_one_run_makes_one_search(memory, tmp_path, monkeypatch):
    """Figure 8 shows ISSA with seed 0; it took the 90 searches of Table 3."""
    from tractexp.studies.paper import page

    made, told = counted(monkeypatch), []
    for _ in range(2):
        study = Study(
            _recipe,
            {},
            _recipe().events,
            (),
            30,
            workers=1,
            limits=searches.Limits(150),
            tell=told.append,
        )
        study.prepare(["figure8"])
        page.report(study, ["figure8"], claims.list_claims(study, ["figure8"]))
    assert made == [(["issa"], 1)] * 2
    again = "  1 of them were made before by the same code on the same records, and are read back"
    searched_, wrote = "searches of issa: seed 0, 300 iterations of 50", "writing Figure 8"
    assert told == [wrote, searched_, wrote, searched_, again]


def counted(monkeypatch):
    """What is asked of `searches.run` from now on: [(readings, seeds)]."""
    made, run = [], searches.run

    def noted(recipe, variants, seeds, *rest, **more):
        made.append((list(variants), seeds))
        return run(recipe, variants, seeds, *rest, **more)

    monkeypatch.setattr(searches, "run", noted)
    return made


def test_what_one_part_searched_the_others_read_back(memory, tmp_path, monkeypatch):
    """Table 3 makes the searches of Tables 2, 4 and 5 and of Figures 8, 10 and 11: after it they
    make none.
    """
    study = _study(seeds=2)
    study.prepare(["table3"])
    fresh, made, search = _study(seeds=2), [], searches.search
    monkeypatch.setattr(searches, "search", lambda *a: made.append(a) or search(*a))
    for part in ("table2", "table3", "table4", "table5"):
        fresh.prepare([part])
    fresh.first("issa")
    assert made == []
    fresh.prepare(["figure9"])
    assert len(made) == 2  # of pure exploration, one for each seed


def _study(seeds=1, budget=150):
    """The study of the shipped record with few simulations; the literal problem is that of Eq. (4)
    as printed.
    """
    limits = searches.Limits(budget)
    literal = lambda: _recipe(integration="printed")  # noqa: E731
    return Study(
        _recipe, {}, _recipe().events, (), seeds, workers=1, limits=limits, literal=literal
    )


def test_descents_are_made_once_for_the_same_starts(memory, monkeypatch):
    """What least squares reach is kept beside the searches; another floor or start is another
    descent.
    """
    made, descend = [], valleys.run_descents
    monkeypatch.setattr(
        valleys, "run_descents", lambda *a, **k: made.append(len(a[1])) or descend(*a, **k)
    )
    monkeypatch.setattr("tractexp.studies.paper.study.RANDOM", 4)
    first, again = (_study() for _ in range(2))
    for study in (first, again):
        vars(study)["floor"] = 3e-5
    np.testing.assert_array_equal(first.control.values, again.control.values)
    np.testing.assert_array_equal(first.control.objective, again.control.objective)
    assert made == [4]
    other, elsewhere = _study(), replace(_study(), seed=1)
    vars(other)["floor"], vars(elsewhere)["floor"] = 4e-5, 3e-5
    for study in (other, elsewhere):
        _ = study.control
    assert made == [4, 4, 4]


def test_equal_budgets_are_laid_out_whole_and_equal_for_all(memory, monkeypatch):
    """A search of 15,050 simulations is not one of 300 iterations cut: its schedules know where
    they end.
    """
    asked = []
    monkeypatch.setattr(
        searches,
        "run",
        lambda r, v, n, limits, *a, **k: asked.append((v, limits)) or dict.fromkeys(v),
    )
    study = replace(_study(), limits=None)
    for name in ("issa", "pso"):
        study.run_searches(name, "simulations")
        study.run_searches(name, "iterations")
    assert asked == [
        ({"issa": {"name": "issa"}}, searches.Limits(15_050)),
        ({"issa": {"name": "issa", "iterations": 300}}, searches.Limits()),
        ({"pso": {"name": "pso", "iterations": 300}}, searches.Limits()),
    ]
    assert printed.EQUAL == 15_050


def test_only_the_literal_readings_search_the_model_as_it_is_printed(memory):
    study = _study()
    for name in ("pso", "pso_to_the_letter"):
        study.run_searches(name)
    literal, classical = (study.run_searches(n)[0] for n in ("pso_to_the_letter", "pso"))
    assert literal.objective == study.printed_problem.objective(literal.values[None])[0]
    assert literal.objective != study.problem.objective(literal.values[None])[0]
    assert classical.objective == study.problem.objective(classical.values[None])[0]


@pytest.mark.parametrize("name", printed.READINGS)
def test_a_reading_is_the_optimizer_of_its_name(name):
    from tractexp.api.arguments import Choice
    from tractexp.configuration.plugin import build

    reading = printed.READINGS[name]
    chosen = (
        name.removesuffix("_to_the_letter")
        if reading.optimizer == "pso" and reading.literal
        else name
    )
    assert build("optimizer", reading.node) == Choice.from_argument("optimizer", chosen).build(
        "optimizer"
    )
    assert reading.literal == name.endswith("_to_the_letter")


def _recipe(motor="electromechanical", shift=0.0, integration="classical", **known):
    import tractexp
    from tractexp.api.setup import Setup
    from tractexp.record import detect

    (event,) = tractexp.read("tibet_50pct")
    moved = detect(replace(event.record, P=event.record.P + shift))
    load = tractexp.compose(motor=motor, static="exponential", integration=integration)
    return Setup.from_arguments([moved], load, **known).problem


def planted(seeds, levels):
    """A study whose searches fell in ten iterations to their level, plus a little that differs by
    seed.
    """
    study = Study(_recipe, {}, (), (), seeds)
    for (name, level), by in product(levels.items(), ("iterations", "simulations")):
        found = study.seen[name, by] = []
        for seed in range(seeds):
            objective = level * (1 + 0.01 * np.sin(seed)) * np.geomspace(100, 1, 10)
            history = SimpleNamespace(simulations=50 * np.arange(1, 11), objective=objective)
            found.append(
                SimpleNamespace(
                    history=history, objective=objective[-1], simulations=500, seconds=1.0
                )
            )
    vars(study)["reference"] = SimpleNamespace(objective=min(levels.values()), simulations=100)
    return study


def read_alike(issa, ssa, pso, **others):
    """Levels of every reading of the three, equal unless said."""
    own = {"issa": issa, "ssa": ssa, "pso": pso}
    return (
        own
        | {f"{n}_10_perceivers": own[n] for n in ("issa", "ssa")}
        | {"pso_limited": pso}
        | others
    )


def test_planted_rankings_are_judged_as_they_are():
    study = planted(10, read_alike(1.0, 2.0, 0.5))
    assert verdict.compare_ends(study, "issa", "ssa", "iterations")[0] == verdict.CONFIRMED
    assert verdict.compare_ends(study, "issa", "pso", "iterations")[0] == verdict.REFUTED
    assert verdict.compare_ends(study, "ssa", "pso", "simulations")[0] == verdict.REFUTED


def test_a_verdict_that_depends_on_the_reading_says_so():
    """Equal with SD = 20, and ISSA lower with 10 perceivers, as the text can be read too."""
    study = planted(10, read_alike(2.0, 2.0, 3.0, issa_10_perceivers=1.0))
    ends, told = verdict.compare_ends(study, "issa", "ssa", "iterations")
    assert ends == "depends on the reading: confirmed only with the 10 perceivers of section 4.2"
    assert told.startswith(
        "with SD = 20 (section 4.3) medians 2.01 and 2.01 pu², p = 1, A = 0.50; with the 10"
        " perceivers"
    )
    limited = planted(10, read_alike(1.0, 2.0, 3.0, pso_limited=0.5))
    assert verdict.compare_ends(limited, "issa", "pso", "iterations")[0].endswith(
        "confirmed only with SD = 20 (section 4.3) and with the 10 perceivers of section 4.2"
    )
    assert verdict.compare_ends(limited, "issa", "ssa", "iterations")[0] == verdict.CONFIRMED


def test_equal_optimizers_confirm_nothing_and_few_seeds_settle_nothing():
    equal, few = planted(10, read_alike(1.0, 1.0, 1.0)), planted(5, read_alike(1.0, 2.0, 3.0))
    assert verdict.compare_ends(equal, "issa", "ssa", "iterations")[0] == verdict.REFUTED
    assert verdict.compare_ends(few, "issa", "ssa", "iterations")[0] == verdict.OPEN


def test_pairs_are_won_only_beyond_chance():
    """Ten seeds of ten lower win; five of ten do not; and the second of a pair never wins."""
    low = 1.0 + 0.01 * np.arange(10)
    high, mixed = low + 1, low + np.where(np.arange(10) % 2, 0.5, -0.5)
    assert verdict.lower([(low, high), (high, low), (low, mixed), (low, low)]) == [
        True,
        False,
        False,
        False,
    ]


def test_running_times_are_those_of_the_planted_histories():
    """100, 60, 36, 22, 13, 7.7, ... times the level: below ten times it after 5 iterations, 300
    simulations.
    """
    study = planted(1, {"issa": 1.0, "ssa": 4.0, "pso": 1.0})
    assert study.running_time("issa", 10.0, "iterations") == 5
    assert study.running_time("issa", 10.0, "simulations") == 300
    assert study.running_time("ssa", 2.0, "iterations") == np.inf


def test_the_faster_reaches_every_target_with_less_beyond_chance():
    study = planted(10, {"issa": 1.0, "ssa": 1.7, "pso": 1.0})
    assert figure_claims.compare_speed(study, "issa", "ssa", "iterations")[0] == verdict.CONFIRMED
    assert figure_claims.compare_speed(study, "ssa", "issa", "iterations")[0] == verdict.REFUTED
    assert figure_claims.compare_speed(study, "issa", "pso", "simulations") == (
        verdict.REFUTED,
        ["300, 450", "300, 450"],
    )


# Why they rank so


def explored(seeds, ends):
    """A study in which {reading: (ends, bottoms below)} were searched, and half of the random
    points are right.
    """
    study = planted(seeds, {name: 1.0 for name in ends})
    for name, (at, _) in ends.items():
        for seed, found in enumerate(study.seen[name, "iterations"]):
            found.objective = at[seed]
    vars(study)["ends"] = {
        name: Ends(np.asarray(b, dtype=float), np.empty((seeds, 0)))
        for name, (_, b) in ends.items()
    }
    vars(study)["control"] = Ends(np.array([1.0, 1.35] * 10), np.empty((20, 0)))
    vars(study)["floor"] = 1.0
    return study


NOISE = 1 + 1e-3 * np.sin(np.arange(20))
HALF = np.where(np.arange(20) % 2, 1.35, 1.0)


@pytest.mark.parametrize(
    ("sparrow", "told"),
    [
        ((2 * HALF * NOISE, HALF), "holds"),
        ((2 * 1.35 * NOISE, np.full(20, 1.35)), "holds only in half, for they lack both"),
        ((1.35 * NOISE, np.full(20, 1.35)), "does not hold: it is exploration"),
        ((HALF * NOISE, HALF), "is not shown: neither test is significant"),
    ],
)
def test_what_the_sparrows_lack_is_found_where_it_is_planted(sparrow, told):
    """Twice above the bottom of their valley they lack convergence; never in the right valley,
    exploration.
    """
    half = HALF * NOISE, HALF
    study = explored(20, {"issa": sparrow, "ssa": sparrow, "pso": half, "random_search": half})
    assert why.answer(why.compare_with_ssa(study)) == told


def test_shares_count_valleys_floors_and_bottoms():
    ends = np.array([1.0, 1.05, 2.0, 1.36]), np.array([1.0, 1.0, 1.0, 1.35])
    assert explored(4, {"issa": ends}).shares("issa") == Shares(n=4, valley=3, floor=2, done=3)


def test_the_second_valley_is_at_the_bound_of_C_and_attracts_whatever_the_bound():
    """Two bottoms of the shipped record, and what the page says of the way between them, recomputed
    from Eq. (3).
    """
    problem, floor = _recipe(), 3.09e-5
    ends = valleys.run_descents(problem, valleys.draw_uniform_points(problem, 60, 0), floor)
    (lowest, n, right), (second, m, left), *_ = ends.group_valleys()
    assert n + m > 40
    assert (lowest, second) == pytest.approx((3.085e-5, 4.168e-5), rel=1e-3)
    C = list(problem.space.names).index("C")
    assert (right[C], left[C]) == pytest.approx((0.819, 0.3), abs=2e-3)

    def static(values):
        known, event = dict(zip(problem.space.names, values, strict=True)), problem.events[0]
        return event.Q0 - equations.compute_motor_reactive(known, event.U0)

    assert static(right) > 0.2
    assert static(left) < -1.5
    wide = valleys.rebound_problem(problem, "C", 0.1, 0.99)
    grid = np.linspace(0.1, 0.9, 17)
    path = valleys.follow_valley(wide, np.array([right, left]), "C", grid, floor)
    assert path.values[:, C] == pytest.approx(grid)
    low = grid < 0.56
    assert (np.diff(path.objective[low]) > 0).all()  # the higher C, the worse, up to the ridge
    assert path.objective[np.abs(grid - 0.65).argmin()] > 3 * lowest
    again = valleys.run_descents(wide, np.array([left]), floor)
    assert again.values[0, C] < 0.15
    assert 1.25 * lowest < again.objective[0] < second


# The page


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_composes_to_its_part(name):
    task = composed(f"experiment={name}").task
    assert task.name == "paper"
    assert task.parts == [name]
    assert name in PARTS


def composed(*overrides):
    from hydra import compose, initialize_config_dir

    from tractexp.configuration.choices import CONF
    from tractexp.sweep.hydra_groups import register

    register()
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("config", overrides=list(overrides))


def test_the_whole_paper_and_the_paper_to_the_letter_are_experiments():
    task = composed("experiment=paper").task
    assert (task.name, task.parts, set(EXPERIMENTS)) == ("paper", [], set(PARTS))
    letter = composed("experiment=to_the_letter")
    assert (letter.task.name, letter.model.integration) == ("identify", "printed")
    chosen = {
        key: letter.optimizer[key]
        for key in ("space", "step", "acceptance", "levy_formula", "perceivers")
    }
    assert chosen == {
        "space": "raw",
        "step": "scalar",
        "acceptance": "all",
        "levy_formula": "printed",
        "perceivers": 0.4,
    }


def test_the_page_has_every_table_and_figure_and_a_verdict_for_each_claim(page):
    folder, told = page
    html = (folder / "run" / "paper.html").read_text()
    text = (folder / "run" / "paper.md").read_text()
    for part in PARTS[:-2]:
        kind = part.rstrip("0123456789")
        heading = f"{kind.capitalize()} {part[len(kind) :]}: "
        assert f"<h2>{heading}" in html, heading
        assert f"## {heading}" in text, heading
    for heading in ("What is printed, in the printed equations", "The readings of the text"):
        assert f"<h2>{heading}</h2>" in html
    rows = html.split("<h2>The claims</h2>")[1].split("</tbody>")[0].count("<tr>") - 1
    judged = json.loads((folder / "run" / "paper.json").read_text())["claims"]
    assert rows == len(judged) >= 36
    assert sum(line.strip().startswith(PARTS) for line in told.splitlines()) == len(judged)
    for word in (verdict.CONFIRMED, verdict.REFUTED, verdict.IMPOSSIBLE):
        assert f">{word}</td>" in html
    assert html.count('class="chart"') == text.count("*Chart of the page: ") == 12
    assert not list((folder / "run").glob("*.svg"))
    for shown in (html, text):
        assert "synthetic stand-in" in shown
        assert "so no value can equal" in shown
        assert "so these are not the paper's 300" in shown.replace("&#x27;", "'")


def test_the_page_begins_with_how_many_claims_and_the_conclusion(page):
    text = (page[0] / "run" / "paper.md").read_text()
    top = text.split("\n\n")[2].split("\n>\n")
    assert re.fullmatch(r"> Of \d+ claims: .*\.", top[0])
    assert 4 <= len(top) <= 6
    for told in (
        "the load model that issa identifies",
        "3 has no steady state for any column",
        "median objectives are",
        "in the valley of the lowest objective end",
    ):
        assert any(told in line.lower().replace("eq. (3)", "3") for line in top), told


def test_the_page_holds_the_papers_values_beside_ours(page):
    html = (page[0] / "run" / "paper.html").read_text()
    for column in printed.TABLE_3.values():
        for value in column:
            assert f"<td>{value:g}</td>" in html
    for table in (printed.INTERPOLATION, printed.EXTRAPOLATION):
        for pair in table.values():
            assert all(f"<td>{value:g}</td>" in html for value in pair)


def test_bounds_and_every_reading_stand_beside_the_three(page):
    text = (page[0] / "run" / "paper.md").read_text()
    for heading in ("## Table 2", "## Table 3"):
        section = text.split(heading)[1].split("\n## ")[0]
        assert "| C | 0.3 .. 0.99 |" in section
        for told in ("10 perceivers (4.2)", "to the letter"):
            assert told in section
    for told in ("PSO, velocity limit 0.2", "| SSA, to the letter |"):
        assert told in section


def test_the_page_for_the_documentation_is_the_same_and_links_nothing(page):
    folder, _ = page
    text = (folder / "docs" / "paper.md").read_text()
    assert text == (folder / "run" / "paper.md").read_text()
    assert "](" not in text


def test_the_equations_alone_take_no_search(tmp_path, monkeypatch):
    from tractexp.studies.paper import page

    monkeypatch.setattr(searches, "run", None)
    study = Study(_recipe, {}, _recipe().events, (), 30)
    judged = claims.list_claims(study, ["equations"])
    assert [claim.verdict for claim in judged] == [verdict.REFUTED] * 2
    text = render_markdown(page.report(study, ["equations"], judged))
    assert text.count("| does not agree |") == sum(
        not check.holds for check in equations.check_printed_numbers()
    )


def test_markdown_escapes_what_would_be_markup():
    report = Report("t").table(["a", "b"], [["x|y", "_z_"]])
    assert render_markdown(report).endswith("\n\n| a | b |\n| --- | ---: |\n| x\\|y | \\_z\\_ |\n")


# Refusals


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["task=paper", "task.parts=[table6]"], "task.parts=table6 is not one of table1"),
        (["task=paper", "task.seeds=0"], "task.seeds=0 is out of range: it must be at least 1"),
        (["task=paper", "task.workers=0"], "task.workers=0 is out of range: it must be at least 1"),
        (["task=paper", "data=tibet_30pct"], "no held-out event for the interpolation"),
        (["experiment=table5", "data=tibet_65pct"], "no held-out event for the extrapolation"),
        (["task=generalise", "data=tibet_30pct"], "task=generalise needs dips that are not fitted"),
        (
            ["task=generalise", "task.optimizers=[isa]"],
            "there is no optimizer 'isa'; did you mean 'issa'?",
        ),
        (
            ["task=generalise", "task.seeds=0"],
            "task.seeds=0 is out of range: it must be at least 1",
        ),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_sentence(arguments, sentence, tmp_path):
    done = run_command(*arguments, "tracking.enabled=false", cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]


def test_a_table_that_needs_no_held_out_dip_is_made_without_one(tmp_path):
    done = run_command(
        "experiment=figure6",
        "data=tibet_30pct",
        "hydra.run.dir=run",
        "tracking.enabled=false",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "<h2>Figure 6: the record</h2>" in (tmp_path / "run" / "paper.html").read_text()


def test_a_study_without_the_dip_it_needs_says_which():
    with pytest.raises(UserError, match="a dip deeper than the fitted one is needed"):
        Study(
            _recipe, {}, (SimpleNamespace(depth=0.5),), (SimpleNamespace(depth=0.3),), 1
        ).select_held_out("extrapolation")
