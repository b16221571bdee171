"""What a frequency, an unbalance or a recorder's window that nobody told does to parameters, and
what is said of it.
"""

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import get
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose
from tractexp.record.window import average, build_mean_weights

TRUTH = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55}
STEP = 5e-3


@pytest.fixture(scope="module")
def swinging():
    """A load whose network swings by 0.2 Hz from the dip on, with f as it was."""
    return record(0.2)


def record(swing):
    t = np.arange(700) * STEP
    U = np.where((t > 0.5) & (t < 0.75), 0.65, 1.0)
    f = 50 + swing * np.sin(2 * np.pi * 0.7 * np.maximum(t - 0.5, 0))
    still = np.ones(len(t))
    event = Excitation(STEP, U, still, still, 1.0, 1.0, 0.6, omega_s=2 * np.pi * (f - 50))
    load = compose(
        get("model/motor", "electromechanical")(), get("model/static", "constant_impedance")()
    )
    values = np.array([[TRUTH[name] for name in load.names]])
    P, Q = load.simulate(Drive.from_events([event]), values, 4).outputs[:, 0]
    rng = np.random.default_rng(5)
    noise = 2e-4 * rng.standard_normal((2, len(t)))
    columns = {"t": t, "U": U, "P": P + noise[0], "Q": Q + noise[1], "f": f}
    return columns | {"U2": np.zeros(len(t))}


def fit(columns, model="third_order_impedance", **settings):
    return tractexp.identify(
        tractexp.read(columns),
        model,
        optimizer="multistart_least_squares",
        progress=False,
        **settings,
    )


@pytest.fixture(scope="module")
def blind(swinging):
    return fit({name: x for name, x in swinging.items() if name != "f"})


@pytest.fixture(scope="module")
def still(swinging):
    """As fitted where the frequency is said to have been nominal."""
    return fit({name: x for name, x in swinging.items() if name != "f"}, frequency_swing=0.0)


def test_with_the_frequency_nothing_is_told_and_the_truth_is_found(swinging):
    found = fit(swinging)
    assert found.result.unrecorded == {}
    assert found.parameters["M"].value == pytest.approx(TRUTH["M"], rel=0.02)
    assert found.parameters["M"].verdict == "identified"


def test_without_it_the_swing_is_told_by_parameter(blind, still):
    """The swing that was there moves T_m by 8 %, four times its interval, within what is told."""
    told, T_m = blind.result.unrecorded["f"], blind.parameters["T_m"]
    off = abs(T_m.value - TRUTH["T_m"])
    low, high = still.parameters["T_m"].interval
    assert off > 0.05 * TRUTH["T_m"]
    assert not low <= TRUTH["T_m"] <= high
    assert still.parameters["T_m"].verdict == "identified"
    assert off <= 1.2 * told["moves"]["T_m"]
    assert told["beyond"] == ["T_m"]
    assert T_m.verdict.startswith("weakly identified: f was not recorded, and 0.2 Hz of f moves")


def test_the_interval_reaches_over_what_it_moves(blind):
    for name, truth in TRUTH.items():
        low, high = blind.parameters[name].interval
        assert low <= truth <= high, name


def test_a_row_says_what_the_swing_moves_and_what_to_record(blind):
    table = blind.table()
    assert table.columns[-1] == "0.2 Hz of f moves"
    assert any(line.startswith("record f or U_angle") for line in blind.advice)


def test_a_course_of_the_frequency_that_explains_what_is_left_is_a_candidate(blind):
    """It is fitted beside the parameters, which it brings near the truth that they miss without."""
    course = blind.result.unrecorded["f"]["course"]
    assert course["error"] < 0.25 * course["error_without"]
    assert 0.1 < course["strays"] < 0.3
    T_m = course["parameters"]["T_m"]
    assert abs(T_m - TRUTH["T_m"]) < 0.3 * abs(blind.parameters["T_m"].value - TRUTH["T_m"])
    (told,) = (line for line in blind.advice if "a frequency that nobody recorded" in line)
    assert told.startswith("record f or U_angle: ")
    assert "a candidate of the measurement, and no effect of the load" in told


def test_an_investigation_tells_the_course_where_no_effect_explains_what_is_left(swinging):
    """Here only some effects are tested, none of which swings."""
    columns = {name: x for name, x in swinging.items() if name != "f"}
    found = tractexp.investigate(
        tractexp.read(columns),
        "third_order_impedance",
        effects=["stator_resistance"],
        progress=False,
    )
    assert (found.verdict, found.names) == ("unexplained", ())
    course = found.content["unrecorded_course"]
    assert course["error"] < 0.25 * course["error_without"]
    assert found.content["recommendation"].startswith("record f or U_angle: a frequency that")
    assert "record f or U_angle" in found.report().html


def test_what_a_load_has_and_the_model_lacks_is_no_course_of_the_frequency():
    """A motor whose flux decays, fitted by one whose flux follows at once."""
    plain = {name: x for name, x in record(0.0).items() if name != "f"}
    found = fit(plain, "second_order_exponential", check_intervals=False)
    assert not found.adequate
    assert found.result.unrecorded["f"]["course"] == {}
    assert not any("nobody recorded" in line for line in found.advice)


def test_a_frequency_that_stood_still_moves_nothing(still):
    assert still.result.unrecorded == {}
    assert "f was not recorded" not in still.parameters["T_m"].verdict


def record_unbalanced(share):
    """A load at the theory's size in a dip whose negative sequence is a share of its depth."""
    t = np.arange(700) * STEP
    U = np.where((t > 0.5) & (t < 0.75), 0.65, 1.0)
    U2 = share * (1 - U)
    still = np.ones(len(t))
    event = Excitation(STEP, U, still, still, 1.0, 1.0, 0.6, U2=U2, U20=0.0)
    parts = get("model/motor", "electromechanical")(), get("model/static", "constant_impedance")()
    load = compose(*parts, [get("effect", "negative_sequence_braking")()])
    truth = TRUTH | {"negative_sequence": 1.0}
    values = np.array([[truth[name] for name in load.names]])
    P, Q = load.simulate(Drive.from_events([event]), values, 4).outputs[:, 0]
    noise = 2e-4 * np.random.default_rng(5).standard_normal((2, len(t)))
    columns = {"t": t, "U": U, "P": P + noise[0], "Q": Q + noise[1], "U2": U2}
    return columns | {"f": np.full(len(t), 50.0)}


def without_U2(columns):
    return {name: x for name, x in columns.items() if name != "U2"}


@pytest.fixture(scope="module")
def unbalanced():
    return record_unbalanced(0.3)


@pytest.fixture(scope="module")
def blind_to_U2(unbalanced):
    return fit(without_U2(unbalanced))


def test_an_unbalance_that_nobody_recorded_is_told_by_parameter(blind_to_U2):
    """The one that was there moves M by 7 %, beyond an interval that knows nothing of it."""
    told, M = blind_to_U2.result.unrecorded, blind_to_U2.parameters["M"]
    off = abs(M.value - TRUTH["M"])
    assert [*told] == ["U2"]
    assert 0.05 * TRUTH["M"] < off < 1.2 * told["U2"]["moves"]["M"]
    assert "M" in told["U2"]["beyond"]
    assert "U2 was not recorded, and U2 of 100 % of the dip moves it by" in M.verdict
    for name, truth in TRUTH.items():
        low, high = blind_to_U2.parameters[name].interval
        assert low <= truth <= high, name


def test_its_course_is_a_candidate_of_the_measurement(blind_to_U2, unbalanced):
    assert blind_to_U2.table().columns[-1] == "U2 of 100 % of the dip moves"
    course = blind_to_U2.result.unrecorded["U2"]["course"]
    assert course["error"] < 0.25 * course["error_without"]
    assert course["strays"] == pytest.approx(unbalanced["U2"].max(), rel=0.3)
    assert any(line.startswith("record U2 or the three phases: ") for line in blind_to_U2.advice)
    assert "U2 of 100 % of the dip moves" in blind_to_U2.report().html


def test_of_a_recorded_unbalance_nothing_is_told(unbalanced):
    found = fit(unbalanced)
    assert found.result.unrecorded == {}
    low, high = found.parameters["M"].interval
    assert not low <= TRUTH["M"] <= high  # whose effect the model lacks


def test_how_large_it_may_have_been_is_a_setting(unbalanced):
    """Of balanced dips nothing is told; a fault of half the unbalance moves a quarter."""
    assert fit(without_U2(unbalanced), unbalance=0.0, check_intervals=False).result.unrecorded == {}
    small, half = (
        fit(without_U2(unbalanced), unbalance=share, check_intervals=False).result.unrecorded["U2"]
        for share in (0.05, 0.1)
    )
    assert (small["size"], half["size"]) == (0.05, 0.1)
    assert half["moves"]["M"] == pytest.approx(4 * small["moves"]["M"], rel=1e-3)


def test_a_load_that_is_balanced_stays_identified():
    """What the record would show if it were there is bounded by its noise."""
    found = fit(without_U2(record_unbalanced(0.0)))
    assert found.adequate
    assert found.parameters["M"].verdict == "identified"
    assert found.result.unrecorded["U2"]["beyond"] == []


def test_of_a_load_without_a_motor_on_which_it_acts_nothing_is_told():
    columns = without_U2(record_unbalanced(0.0))
    found = fit(columns, "static_exponential", check_intervals=False)
    assert "U2" not in found.result.unrecorded


def answer_to_U2(motor, **more):
    """By how much an unbalance of 0.2 pu moves P and Q (2,) of a motor after 0.6 s."""
    t = np.arange(600) * 1e-3
    U, still = np.full(len(t), 1.0), np.ones(len(t))
    U2 = 0.2 * np.clip((t - 0.05) / 0.1, 0, 1)
    load = compose(
        get("model/motor", motor)(),
        get("model/static", "constant_impedance")(),
        [get("effect", "negative_sequence_braking")()],
    )
    truth = TRUTH | {"X_second": 0.2, "T_second": 0.01} | more
    event = Excitation(1e-3, U, still, still, 1.0, 1.0, 0.6, U2=U2, U20=0.0)
    drive = Drive.from_events([event])
    with_it, without = (
        load.simulate(
            drive, np.array([[(truth | {"negative_sequence": k})[n] for n in load.names]]), 8
        ).outputs[:, 0]
        for k in (1.0, 0.0)
    )
    return (with_it - without)[:, -1]


@pytest.mark.parametrize(
    ("stiff", "moving"),
    [("electromechanical", "stator_flux"), ("double_cage", "double_cage_stator_flux")],
)
def test_behind_a_stator_flux_negative_sequence_acts_as_on_a_motor_without(stiff, moving):
    """In the end; winners of `model=auto` have one, and records without U2 are told there, too."""
    there = answer_to_U2(moving, R_s=1e-5)
    assert np.abs(there).min() > 1e-3
    assert there == pytest.approx(answer_to_U2(stiff), rel=0.02)


FAST = {"T_prime": 0.03, "X_prime": 0.23, "C": 0.94, "M": 0.0022, "T_m": 0.54, "R_s": 0.035}


def record_through_a_window(depth, rng):
    """A motor with a stator flux, as one-cycle values every 10 ms show it."""
    fine, every = 5e-4, slice(0, None, 20)
    t = np.arange(4000) * fine
    U = 1 - depth * (np.clip((t - 0.5) / 0.0015, 0, 1) - np.clip((t - 0.65) / 0.0015, 0, 1))
    still, weights = np.ones(len(t)), build_mean_weights(0.02 / fine)
    event = Excitation(fine, U, still, still, 1.0, 1.0, 0.6, omega_s=0 * t, window=weights)
    load = compose(get("model/motor", "stator_flux")(), get("model/static", "constant_impedance")())
    values = np.array([[FAST[name] for name in load.names]])
    power = load.simulate(Drive.from_events([event]), values, 4).outputs[:, 0, every]
    P, Q = power + 3e-3 * rng.standard_normal(power.shape)
    columns = {"t": t[every], "U": average(U, weights)[every], "P": P, "Q": Q}
    return columns | {"f": 50 * still[every], "U2": 0 * t[every]}


@pytest.fixture(scope="module")
def fit_through_a_window():
    rng = np.random.default_rng(5)
    dips = [tractexp.read(record_through_a_window(depth, rng))[0] for depth in (0.3, 0.5)]

    def identify(window=None, **settings):
        return tractexp.identify(
            dips,
            tractexp.compose("fifth_order_stator_flux", window=window),
            optimizer="multistart_least_squares",
            check_intervals=False,
            progress=False,
            **settings,
        )

    return identify


def test_a_window_that_nobody_told_widens_what_it_moves(fit_through_a_window):
    """Without it R_s is 0.05 where 0.035 is true, and the interval knows nothing of that."""
    blind = fit_through_a_window(averaged_cycles=0.0).parameters["R_s"]
    assert blind.interval[0] > 1.2 * FAST["R_s"]
    assert blind.verdict == "identified"
    found = fit_through_a_window()
    for name, truth in FAST.items():
        low, high = found.parameters[name].interval
        assert low <= truth <= high, name
    why = "weakly identified: window was not recorded, and a 1-cycle window moves it by"
    assert found.parameters["R_s"].verdict.startswith(why)
    assert found.table().columns[-1] == "a 1-cycle window moves"


def test_its_length_is_a_candidate_of_the_measurement(fit_through_a_window):
    found = fit_through_a_window()
    course = found.result.unrecorded["window"]["course"]
    assert course["strays"] == pytest.approx(0.02, rel=0.2)
    assert course["error"] < 0.5 * course["error_without"]
    (told,) = (line for line in found.advice if line.startswith("say the recorder's window"))
    assert "a recorder's window that nobody told, 18 ms long, would leave" in told


def test_a_window_that_the_model_is_looked_at_through_is_known(fit_through_a_window):
    assert "window" not in fit_through_a_window(0.02).result.unrecorded
