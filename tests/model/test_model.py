"""The model core against the paper's equations, SciPy, and what physics says must hold."""

import itertools
import os
import subprocess
import sys
import warnings
from types import ModuleType

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import Akima1DInterpolator

import tractexp
from tractexp.configuration.plugin import discover, get
from tractexp.errors import UserError
from tractexp.kernel.layout import LANES
from tractexp.model import operations
from tractexp.model.drive import PHASORS, WAVES, Drive, Excitation
from tractexp.model.model import ModelResponse, compose
from tractexp.model.parts import Static
from tractexp.model.sites import SITES
from tractexp.model.states import State
from tractexp.model.symbols import make_real_symbol, make_vector_symbol, phasor_parts, start_symbol
from tractexp.parameter import Parameter

OMEGA_S = 2 * np.pi * 50
TRUTH = np.array([0.12, 0.25, 0.9, 0.006, 0.55, 1.4, 3.0])  # T', X', C, M, T_m, p_v, q_v


@pytest.fixture(scope="module")
def model():
    return compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())


def dip(step=1e-3, length=1.0, depth=0.5, start=0.2, duration=0.15, P0=1.0, Q0=0.6, U0=1.0):
    """A dip with 20 ms edges, sampled uniformly."""
    t = np.arange(round(length / step) + 1) * step
    fall, rise = np.clip((t - start) / 0.02, 0, 1), np.clip((t - start - duration) / 0.02, 0, 1)
    U = U0 * (1 - depth * (fall - rise))
    return Excitation(step, U, np.full(len(t), P0), np.full(len(t), Q0), U0, P0, Q0)


def candidates(n, rng):
    """Parameter sets around the truth, all with a steady state."""
    return TRUTH * rng.uniform(0.85, 1.1, (n, 7))


def polar_right_hand_side(t, y, U, omega_s, p):
    """Eq. (1) exactly as printed: E', delta, omega."""
    T_prime, X_prime, C, M, T_m = p
    E, delta, omega = y
    return [
        (-E + C * U * np.cos(delta)) / T_prime,
        -C * U * np.sin(delta) / (T_prime * E) + omega - omega_s,
        (-U * E * np.sin(delta) / X_prime - T_m) / M,
    ]


def reference(excitation, values, rtol=1e-12):
    """P and Q by DOP853 on the printed polar equations, restarted at each sample; the voltage by
    SciPy's makima.
    """
    *p, p_v, q_v = values
    T_prime, X_prime, C, _, T_m = p
    U, U0, h = excitation.U, excitation.U0, excitation.step
    delta = 0.5 * np.arcsin(-2 * T_m * X_prime / (C * U0**2))  # Eq. (3)
    state = [
        C * U0 * np.cos(delta),
        delta,
        np.sin(delta) * C * U0 / (T_prime * C * U0 * np.cos(delta)),
    ]
    states = [state]
    t = np.arange(len(U)) * h
    voltage = Akima1DInterpolator(t, U, method="makima")
    for a, b in itertools.pairwise(t):
        f = lambda t, y: polar_right_hand_side(t, y, voltage(t), 0.0, p)  # noqa: E731
        state = solve_ivp(f, (a, b), state, method="DOP853", rtol=rtol, atol=1e-13).y[:, -1]
        states.append(state)
    E, delta, _ = np.array(states).T
    P_d, Q_d = -U * E * np.sin(delta) / X_prime, U * (U - E * np.cos(delta)) / X_prime  # Eq. (2)
    P_s0, Q_s0 = excitation.P0 - P_d[0], excitation.Q0 - Q_d[0]
    return P_d + P_s0 * (U / U0) ** p_v, Q_d + Q_s0 * (U / U0) ** q_v  # Eqs. (6), (7)


def test_right_hand_side_is_the_printed_polar_equation(model):
    """E = E' exp(j delta): dE/dt = (dE'/dt + j E' ddelta/dt) exp(j delta), at random points."""
    rng = np.random.default_rng(1)
    eq = model.equations
    rows = eq.real_states()
    for _ in range(20):
        values = candidates(1, rng)[0]
        E, delta, omega, omega_s = (
            rng.uniform(0.3, 1.1),
            rng.uniform(-1.2, 0.3),
            rng.uniform(-20, 5),
            rng.uniform(-2, 2),
        )
        U = rng.uniform(0.2, 1.2)
        dE, ddelta, domega = polar_right_hand_side(0, (E, delta, omega), U, omega_s, values[:5])
        phasor = (dE + 1j * E * ddelta) * np.exp(1j * delta)
        known = dict(zip(model.names, values, strict=True)) | {
            "U": U,
            "omega_s": omega_s,
            "omega": omega,
        }
        known |= {"E_re": E * np.cos(delta), "E_im": E * np.sin(delta)}
        got = [float(d.subs({s: known[s.name] for s in d.free_symbols})) for _, d, _ in rows]
        assert got == pytest.approx([phasor.real, phasor.imag, domega], rel=1e-12, abs=1e-12)


def test_response_agrees_with_dop853_to_1e_8(model):
    excitation = dip()
    response = model.simulate(Drive.from_events([excitation]), TRUTH, substeps=8)
    P, Q = reference(excitation, TRUTH)
    assert np.abs(response.P[0] - P).max() < 1e-8
    assert np.abs(response.Q[0] - Q).max() < 1e-8


@pytest.mark.parametrize("step", [10e-3, 20e-3])
def test_a_slow_record_is_as_accurate_as_a_fast_one(model, step):
    excitation = dip(step=step)
    drive = Drive.from_events([excitation])
    substeps, error = model.substeps(drive, TRUTH)
    response = model.simulate(drive, TRUTH, substeps)
    P, _ = reference(excitation, TRUTH)
    assert substeps[0] > 1
    assert np.abs(response.P[0] - P).max() < 1e-7
    assert error[0] < 1e-7


def test_a_long_simulation_is_done_in_calls_between_which_signals_are_heard(model, monkeypatch):
    """Their results are those of one call, bit for bit; each is as short as a block of candidates
    allows.
    """
    drive = Drive.from_events([dip(), dip(depth=0.5)])
    values = TRUTH * np.random.default_rng(3).uniform(0.9, 1.1, (3 * LANES + 5, len(TRUTH)))
    whole, sums = model.simulate(drive, values, 2), model.errors(drive, values, 2)
    run, calls = model.kernel.run, []
    monkeypatch.setattr(
        model.kernel, "run", lambda *arrays: (calls.append(arrays[0].shape[2]), run(*arrays))
    )
    monkeypatch.setattr("tractexp.model.model.MOST_STEPS_A_CALL", 2 * LANES * 2 * drive.samples + 1)
    parts = model.simulate(drive, values, 2)
    assert calls == [2 * LANES, LANES + 5]
    np.testing.assert_array_equal(parts.outputs, whole.outputs)
    np.testing.assert_array_equal(parts.miss, whole.miss)
    np.testing.assert_array_equal(model.errors(drive, values, 2).sums, sums.sums)
    calls.clear()
    monkeypatch.setattr("tractexp.model.model.MOST_STEPS_A_CALL", 1.0)
    model.errors(drive, values, 2)
    assert calls == [LANES] * 3 + [5]


@pytest.mark.parametrize(("integration", "order"), [("classical", 4), ("printed", 1)])
def test_the_kernel_is_of_the_order_that_its_integration_has(model, integration, order):
    """Eq. (4) as printed goes h/6 ahead in its second and third stage, which leaves one order of
    the four.

    The voltage is a smooth one, sampled so finely that the cubic between its samples is not what
    limits.
    """
    t = np.arange(401) * 2.5e-3
    U = 1 - 0.3 * np.sin(np.pi * t) ** 4
    drive = Drive.from_events(
        [Excitation(2.5e-3, U, np.ones(401), np.full(401, 0.6), 1.0, 1.0, 0.6)]
    )
    exact = model.simulate(drive, TRUTH, 64)
    made = compose(model.motor, model.static, integration=integration)
    steps = np.array([1, 2, 4])
    errors = [np.abs(made.simulate(drive, TRUTH, n).Q - exact.Q).max() for n in steps]
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.25)


def test_integrated_as_printed_a_model_takes_one_step_per_sample_and_says_what_that_leaves(model):
    printed = compose(model.motor, model.static, integration="printed")
    drive = Drive.from_events([dip()])
    substeps, error = printed.substeps(drive, TRUTH)
    assert substeps.tolist() == [1]
    assert error[0] > 1e-4
    assert model.substeps(drive, TRUTH)[1][0] < 1e-7
    assert printed.source != model.source
    with pytest.raises(
        UserError, match=r"model\.integration=euler is not one of classical, printed"
    ):
        compose(model.motor, model.static, integration="euler")


def test_the_operations_of_a_step_are_those_counted_by_hand(model):
    """Eq. (1) in rectangular form: 9 multiplications and 6 additions four times, 9 of each to go
    ahead in three stages, 6 and 12 for the sum; a constant times the voltage serves both stages in
    the middle. All lanes share two cubics of 8 and 8, the voltage's, and two slopes of the cubic of
    its angle, the speed, of 9 and 7 and a division: the end of a step is the beginning of the next.
    """
    step = operations.count(model.source).step
    assert step.multiplications == pytest.approx(4 * 9 - 1 + 9 + 6 + 2 * (8 + 9) / LANES)
    assert step.additions == pytest.approx(4 * 6 + 9 + 12 + 2 * (8 + 7) / LANES)
    assert step.divisions == pytest.approx(2 / LANES)
    assert step.others == 0


def test_the_operations_of_a_sample_are_those_of_both_powers_and_the_errors(model):
    """A ZIP load instead of two powers saves what two exponentials cost; a load without a motor
    makes no steps.
    """
    zip_load, none = get("model/static", "zip")(), get("model/motor", "none")()
    powers, polynomial = (
        operations.count(model.source),
        operations.count(compose(none, zip_load).source),
    )
    assert polynomial.step.total == 0
    # two exponents, each clamped and put into the exponent of a number; all lanes share two shifts
    # of a logarithm
    assert powers.sample.others == pytest.approx(2 * 3 + 2 / LANES)
    assert powers.sample.total > polynomial.sample.total + 2 * 24
    assert powers.per_sample(3).total == pytest.approx(powers.sample.total + 3 * powers.step.total)


def test_recorded_frequency_moves_the_synchronous_speed(model):
    """At a constant off-nominal frequency the load is in the same steady state: flat stays flat,
    slip unchanged.
    """
    t = np.arange(500) * 1e-3
    speed = np.full(len(t), -3.0)
    flat = Excitation(
        1e-3, np.ones(len(t)), np.ones(len(t)), np.full(len(t), 0.6), 1.0, 1.0, 0.6, speed, -3.0
    )
    response = model.simulate(Drive.from_events([flat]), TRUTH)
    assert np.abs(response.P - 1.0).max() < 1e-12


def test_steady_state_is_the_equivalent_circuit(model):
    """With R_s = 0: Z = j X_s + (j X_m) || (R_r/s + j X_r), slip s from omega, same P and Q."""
    X_s, X_m, X_r, R_r, U = 0.1, 3.0, 0.12, 0.02, 1.02
    X, X_prime = X_s + X_m, X_s + X_m * X_r / (X_m + X_r)
    T_prime = X_prime / X * (X_m + X_r) / (OMEGA_S * R_r)
    slip = 0.015
    rotor = R_r / slip + 1j * X_r
    S = U**2 / np.conj(1j * X_s + 1j * X_m * rotor / (1j * X_m + rotor))
    values = [T_prime, X_prime, (X - X_prime) / X, 0.006, S.real, 1.5, 2.0]
    t = np.arange(50) * 1e-3
    flat = Excitation(1e-3, np.full(50, U), np.zeros(50), np.zeros(50), U, S.real, S.imag)
    eq = model.equations
    known = dict(zip(model.names, values, strict=True)) | {"U0": U, "omega_s0": 0.0}
    starts = {
        s.name: complex(i.subs({x: known[x.name] for x in i.free_symbols})).real
        for s, _, i in eq.real_states()
    }
    assert starts["omega"] == pytest.approx(-slip * OMEGA_S, rel=1e-9)
    # all of P and Q is the motor's, so nothing is left to the static part: flat at S whatever its
    # exponents
    response = model.simulate(Drive.from_events([flat]), values)
    assert response.Q[0] == pytest.approx(np.full(50, S.imag), abs=1e-12)
    assert U * (U - starts["E_re"]) / X_prime == pytest.approx(S.imag, rel=1e-9)
    assert len(t) == 50


def test_one_candidate_gives_the_bits_of_a_batch(model):
    values = candidates(LANES + 5, np.random.default_rng(3))
    drive = Drive.from_events([dip()])
    batch = model.errors(drive, values).sums
    responses = model.simulate(drive, values)
    for k in (0, 7, 8, LANES - 1, LANES, LANES + 4):
        alone = model.simulate(drive, values[k])
        assert np.array_equal(model.errors(drive, values[k]).sums[..., 0], batch[..., k])
        assert np.array_equal(alone.P[0], responses.P[k])
        assert np.array_equal(alone.Q[0], responses.Q[k])


def test_a_kernel_just_compiled_gives_the_bits_of_the_same_kernel_loaded(tmp_path):
    program = """if True:
        import numpy as np
        from tractexp.model.drive import Drive, Excitation
        from tractexp.model.model import ModelResponse, compose
        from tractexp.configuration.plugin import get
        model = compose(get("model/motor", "double_cage")(), get("model/static", "exponential")())
        values = np.array([p.default for p in model.parameters]) * \
np.linspace(0.95, 1.05, 20)[:, None]
        U = 1 - 0.5 * (np.arange(100) // 30 == 1)
        drive = Drive.from_events([Excitation(1e-3, U, np.ones(100), np.ones(100), 1.0, 1.0, 0.6)])
        response = model.simulate(drive, values)
        assert (response.miss == 0).all()
        print(response.P.tobytes().hex(), response.Q.tobytes().hex())
    """
    environment = os.environ | {"TRACTEXP_CACHE_DIR": str(tmp_path)}
    told = [
        subprocess.run(
            [sys.executable, "-c", program],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        for _ in range(2)
    ]
    assert told[0].stdout == told[1].stdout


def test_sums_are_those_of_the_responses(model):
    rng = np.random.default_rng(4)
    excitation = dip()
    P, Q = rng.normal(1, 0.1, len(excitation.U)), rng.normal(0.6, 0.1, len(excitation.U))
    drive = Drive.from_events([Excitation(1e-3, excitation.U, P, Q, 1.0, 1.0, 0.6)])
    values = candidates(5, rng)
    response, errors = model.simulate(drive, values), model.errors(drive, values)
    assert errors.sums[0, 0] == pytest.approx(((response.P - P) ** 2).sum(axis=1), rel=1e-12)
    assert errors.sums[0, 1] == pytest.approx(((response.Q - Q) ** 2).sum(axis=1), rel=1e-12)


def test_errors_of_what_diverges_behind_a_measurement_are_infinite_without_a_warning(monkeypatch):
    behind = compose(
        get("model/motor", "electromechanical")(),
        get("model/static", "exponential")(),
        [get("effect", "time_skew")()],
    )
    drive = Drive.from_events([dip()])
    outputs = np.full((2, 1, drive.samples), 1e200)
    monkeypatch.setattr(
        type(behind), "simulate", lambda *_: ModelResponse(outputs, np.zeros((1, 1)))
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isinf(behind.errors(drive, np.r_[TRUTH, 0.0]).sums).all()


def test_events_in_one_pass_are_the_events_one_by_one(model):
    events = [
        dip(),
        dip(step=2e-3, depth=0.3, P0=0.8, Q0=0.5, U0=0.98),
        dip(depth=0.65, duration=0.1),
    ]
    values = candidates(20, np.random.default_rng(5))
    substeps = [1, 3, 2]
    together = model.errors(Drive.from_events(events), values, substeps).sums
    for e, (event, n) in enumerate(zip(events, substeps, strict=True)):
        assert np.array_equal(
            model.errors(Drive.from_events([event]), values, n).sums[0], together[e]
        )


def test_a_gap_in_the_measurement_is_left_out(model):
    whole = dip()
    P = whole.P.copy()
    P[100:140] = np.nan
    gappy = Excitation(whole.step, whole.U, P, whole.Q, 1.0, 1.0, 0.6)
    sums = [model.errors(Drive.from_events([e]), TRUTH).sums[0, :, 0] for e in (whole, gappy)]
    response = model.simulate(Drive.from_events([whole]), TRUTH)
    left_out = ((response.P[0, 100:140] - 1.0) ** 2).sum()
    assert sums[1][0] == pytest.approx(sums[0][0] - left_out, rel=1e-12)
    assert sums[1][1] == sums[0][1]


def test_candidates_without_a_steady_state_are_refused_and_ranked(model):
    """|2 T_m X'/(C U0^2)| = 1.25, 2.5, 5: each misses by what exceeds 1; a feasible neighbor
    is untouched.
    """
    values = np.tile(TRUTH, (4, 1))
    values[1:, 1] = np.array([1.25, 2.5, 5.0]) * 0.9 / (2 * 0.55)
    errors = model.errors(Drive.from_events([dip()]), values)
    assert errors.miss == pytest.approx([0, 0.25, 1.5, 4.0])
    assert errors.is_refused.tolist() == [False, True, True, True]
    assert np.array_equal(
        errors.sums[..., 0], model.errors(Drive.from_events([dip()]), TRUTH).sums[..., 0]
    )


@pytest.mark.parametrize(
    ("column", "values", "limit"),
    [
        ("ISSA", [4.1354, 1.6654, -2.6241, 0.82, 3.378, 3.5867, 3.056], "4.29"),
        ("SSA", [-3.8726, 1.8054, 1.8197, 0.3427, 3.0239, 1.9803, 2.128], "6"),
        ("PSO", [2.1863, 0.75606, 0.627, 1.7738, 1.2298, 2.5629, 1.286], "2.97"),
    ],
)
def test_the_papers_own_values_get_the_reason_why_they_cannot_be_simulated(
    model, column, values, limit
):
    sentence = model.refusal(values, Drive.from_events([dip()]))
    assert f"it is {limit}" in sentence, column
    assert "Eq. (3)" in sentence
    assert ("C = (X - X')/X must lie between 0 and 1" in sentence) == (column != "PSO")
    assert ("T_prime must be positive" in sentence) == (column == "SSA")


def test_good_values_are_not_refused(model):
    assert model.refusal(TRUTH, Drive.from_events([dip()])) is None


def test_a_kernel_is_shared_by_processes_that_start_together(tmp_path):
    program = (
        "from tractexp.configuration.plugin import get; from tractexp.model.model import compose;"
        "m = compose(get('model/motor', 'electromechanical')(), get('model/static',"
        " 'exponential')());"
        "m.compile()"
    )
    environment = os.environ | {"TRACTEXP_CACHE_DIR": str(tmp_path)}
    started = [subprocess.Popen([sys.executable, "-c", program], env=environment) for _ in range(3)]
    assert [p.wait() for p in started] == [0, 0, 0]
    assert len(list(tmp_path.glob("code/*.entry"))) == 1
    assert len(list(tmp_path.iterdir())) == 2  # its text, too
    assert not list(tmp_path.glob("*.part"))


def test_a_text_is_remembered_until_code_or_settings_change(tmp_path, monkeypatch):
    from tractexp.cache import texts

    monkeypatch.setenv("TRACTEXP_CACHE_DIR", str(tmp_path))
    motor, static = get("model/motor", "electromechanical")(), get("model/static", "exponential")()
    made = []

    def generate():
        made.append(1)
        return f"text {len(made)}"

    assert texts.get_text_of_parts((motor, static), generate, "text") == "text 1"
    assert texts.get_text_of_parts((motor, static), generate, "text") == "text 1"
    assert texts.get_text_of_parts((static, motor), generate, "text") == "text 2"


@pytest.mark.parametrize("name", ["lambda", "two words", "_c0", "U"])
def test_a_name_that_cannot_be_told_from_others_is_refused(name):
    from tractexp.model.equations import Equations
    from tractexp.parameter import Parameter

    with pytest.raises(UserError, match=f"called '{name}'"):
        Equations().declare([Parameter(1.0, (0.0, 2.0), "1", "about", "source", name=name)])


class Renamed(Static):
    """Two powers, their exponents named as a kernel once named its own variables."""

    def __init__(self, names):
        self.name = "renamed"
        self.parameters = tuple(
            Parameter(1.5, (0.0, 3.0), "1", "exponent", "test", name=name) for name in names
        )

    def law(self, u, **exponents):
        return tuple(u**e for e in exponents.values())


@pytest.mark.parametrize("names", [("m", "n"), ("miss", "sums"), ("c0", "s0"), ("k1_E", "W")])
def test_no_name_of_a_parameter_is_taken_by_the_kernel(model, names):
    """A parameter called m once overwrote the kernel's own m and gave nan without a word."""
    renamed = compose(model.motor, Renamed(names))
    drive = Drive.from_events([dip()])
    assert np.array_equal(renamed.errors(drive, TRUTH).sums, model.errors(drive, TRUTH).sums)


def test_symbols_say_what_they_are():
    assert make_real_symbol("U").is_real
    assert make_vector_symbol("v").is_complex
    assert not make_vector_symbol("v").is_real
    assert all(s.is_real for s in phasor_parts(make_vector_symbol("v")))
    assert start_symbol(make_real_symbol("omega")) == make_real_symbol("omega_before")
    assert start_symbol(make_vector_symbol("E")) == make_vector_symbol("E_before")


def test_a_state_starts_from_constants_unless_told_otherwise():
    assert not State(make_real_symbol("omega"), "\\omega", "speed", "motor").derived


def test_a_pair_that_draws_nothing_is_refused():
    with pytest.raises(UserError, match="draw no power; choose a model/motor or a model/static"):
        _ = compose(get("model/motor", "none")(), get("model/static", "none")()).source


def test_the_sites_of_a_model_are_a_table_of_what_stands_there(model):
    table = tractexp.sites(model)
    rows = {row[0]: dict(zip(table.columns, row, strict=True)) for row in table.rows}
    of_waves = {"bus_voltage", "bus_voltage_rate", "motor_current", "current", "zero_current"}
    # which this motor has as a state
    assert set(rows) == set(SITES) - of_waves - {"internal_voltage"}
    assert rows["coupling"]["expression"] == "C"
    assert rows["load_torque"]["could be edited by"] == "speed_dependent_torque, torque_curve"
    assert "undervoltage_trip" in rows["P"]["could be edited by"].split(", ")
    assert not any(row["edited by"] for row in rows.values())
    assert "phasor" in next(
        line for line in str(table).splitlines() if line.lstrip().startswith("stator_impedance")
    )
    slowed = compose(model.motor, model.static, [get("effect", "speed_dependent_torque")()])
    (torque,) = (row for row in tractexp.sites(slowed).rows if row[0] == "load_torque")
    assert torque[-2:] == ("speed_dependent_torque", "torque_curve")
    alone = compose(get("model/motor", "none")(), get("model/static", "exponential")())
    assert [row[0] for row in tractexp.sites(alone).rows] == [
        "static_voltage",
        "P_static",
        "Q_static",
        "P",
        "Q",
    ]
    with pytest.raises(UserError, match="sites\\(\\) takes a model"):
        tractexp.sites("third_order")


def test_whether_an_effect_fits_and_what_stands_before_an_event_are_remembered_without_deriving(
    tmp_path,
):
    program = (
        "import sys, numpy as np; from tractexp.configuration.plugin import discover, get; from"
        " tractexp.model.model import compose;"
        "from tractexp.model.drive import Drive, Excitation;"
        "m = compose(get('model/motor', 'voltage')(), get('model/static', 'exponential')());"
        "names = ('stator_resistance', 'speed_dependent_torque', 'time_skew');"
        "print([m.acceptance(get('effect', n)()).refusal for n in names]);"
        "one = np.ones(2);"
        "drive = Drive.from_events([Excitation(1e-3, one, one, one, 1.0, 1.0, 0.5)]);"
        "print(m.at_rest(np.array([p.default for p in m.parameters]), drive));"
        "print(m.latex());"
        "print('sympy' in sys.modules, 'scipy.signal' in sys.modules)"
    )
    there = os.environ | {"TRACTEXP_CACHE_DIR": str(tmp_path)}

    def run():
        told = subprocess.check_output([sys.executable, "-c", program], env=there, text=True)
        return told.splitlines()

    *derived, loaded = run()
    assert derived[0] == "[None, 'its equations have no speed that moves', None]"
    assert "'P_motor': " in derived[1]
    assert "P_s" in derived[2]
    assert loaded == "True False"
    assert run() == [*derived, "False False"]


@pytest.mark.parametrize("motor", ["electromechanical", "stator_flux"])
def test_what_stands_before_an_event_is_what_the_equations_say(motor):
    of = compose(
        get("model/motor", motor)(),
        get("model/static", "zip")(),
        [get("effect", "feeder_impedance")()],
    )
    flat, values = np.full(2, 0.97), np.array([p.default for p in of.parameters])
    before = of.at_rest(
        values, Drive.from_events([Excitation(1e-3, flat, flat, flat, 0.97, 1.0, 0.5)])
    )
    for symbol in of.equations.definitions:
        value, imaginary = of.equations.parts(of.equations.evaluate_before(symbol))
        assert (symbol.name in before) == (imaginary == 0)
        if imaginary == 0:
            number = value.subs({s: before[s.name] for s in value.free_symbols})
            assert before[symbol.name] == pytest.approx(float(number), rel=1e-13, abs=1e-15)


def test_two_plugins_of_one_class_name_in_one_folder_have_sources_of_their_own(
    tmp_path, monkeypatch
):
    from tractexp.cache import texts

    monkeypatch.setenv("TRACTEXP_CACHE_DIR", str(tmp_path))
    made = []
    for name in ("one", "two"):
        monkeypatch.setitem(sys.modules, f"load_{name}", module := ModuleType(f"load_{name}"))
        module.__file__ = str(tmp_path / f"load_{name}.py")
        exec(
            "class Load:\n    def __repr__(self): return 'Load()'",
            {"__name__": f"load_{name}"},
            namespace := {},
        )
        made.append(texts.get_text_of_parts((namespace["Load"](),), lambda name=name: name, "text"))
    assert made == ["one", "two"]


@pytest.mark.parametrize(
    ("motor", "exact"), [("electromechanical", True), ("stator_flux", True), ("double_cage", False)]
)
def test_whether_a_declared_steady_state_is_exact_is_found(motor, exact):
    from tractexp.model.lowering import lower

    of = compose(get("model/motor", motor)(), get("model/static", "exponential")())
    assert (lower(of.equations).rest is None) == exact


@pytest.mark.parametrize("motor", sorted(discover()["model/motor"]))
def test_a_kernel_is_written_of_every_motor_with_the_effects_that_every_fit_compares_it_with(motor):
    """Rival structures: behind a resistance the first-order motor's current is a quotient that
    SymPy does not split.
    """
    parts = get("model/motor", motor)(), get("model/static", "exponential")()
    domains = [
        d
        for d in (PHASORS, WAVES)
        if not any(p.phasors_only if d == WAVES else p.waves_only for p in parts)
    ]
    effects = [e for e in (get("effect", name)() for name in discover()["effect"]) if e.rival]
    for domain, effect in itertools.product(domains, effects):
        if compose(*parts, domain=domain).acceptance(effect).refusal is None:
            assert "define void @run(" in compose(*parts, [effect], domain=domain).source
