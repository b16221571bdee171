"""What a frequency that nobody recorded does to parameters, and what is told of it."""

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import get
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose

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
    return {"t": t, "U": U, "P": P + noise[0], "Q": Q + noise[1], "f": f}


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
    told, T_m = blind.result.unrecorded, blind.parameters["T_m"]
    off = abs(T_m.value - TRUTH["T_m"])
    low, high = still.parameters["T_m"].interval
    assert off > 0.05 * TRUTH["T_m"]
    assert not low <= TRUTH["T_m"] <= high
    assert still.parameters["T_m"].verdict == "identified"
    assert off <= 1.2 * told["moves"]["T_m"]
    assert (told["channel"], told["beyond"]) == ("f", ["T_m"])
    assert T_m.verdict.startswith("weakly identified: f was not recorded, and a swing of 0.2 Hz")


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
    course = blind.result.unrecorded["course"]
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
    course = found.content["frequency_course"]
    assert course["error"] < 0.25 * course["error_without"]
    assert found.content["recommendation"].startswith("record f or U_angle: a frequency that")
    assert "record f or U_angle" in found.report().html


def test_what_a_load_has_and_the_model_lacks_is_no_course_of_the_frequency():
    """A motor whose flux decays, fitted by one whose flux follows at once."""
    plain = {name: x for name, x in record(0.0).items() if name != "f"}
    found = fit(plain, "second_order_exponential", check_intervals=False)
    assert not found.adequate
    assert found.result.unrecorded["course"] == {}
    assert not any("nobody recorded" in line for line in found.advice)


def test_a_frequency_that_stood_still_moves_nothing(still):
    assert still.result.unrecorded == {}
    assert "f was not recorded" not in still.parameters["T_m"].verdict
