"""A motor that still accelerates when its dip comes, solved outside the project: its speed at the
record's first sample is fitted beside the parameters. A steady load, and one that drifts along a
straight line, have no such start.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_starts import TRUTH, make_start

import tractexp

TOLD = ("T_prime", "X_prime", "C", "M", "T_m", "p_v")


def identify(record):
    return tractexp.identify(
        [record], fixed={"q_v": TRUTH["q_v"]}, check_intervals=False, progress=False
    ).result


@pytest.mark.parametrize("motor", ["none", "voltage"])
def test_a_load_without_a_motor_whose_speed_moves_has_no_such_start(motor):
    model = tractexp.compose(motor=motor)
    found = tractexp.identify(
        [make_start(0.12)], model, check_intervals=False, progress=False
    ).result
    assert any("the load drifts" in note for note in found.uncertainty["notes"])
    assert found.unsteady_start == {}


def on_given_base(result, values):
    """Values of parameters on the base of the file."""
    power = result.own_base["power"]
    exponents = {"X_prime": -1, "M": 1, "T_m": 1}
    return {name: value * power ** exponents.get(name, 0) for name, value in values.items()}


@pytest.mark.parametrize("slip", [0.1, 0.15])
def test_a_motor_that_accelerates_before_its_dip_is_found_with_its_parameters(slip):
    result = identify(make_start(slip))
    told = result.unsteady_start
    assert told["error"] < 0.5
    assert told["sentence"] in result.uncertainty["notes"]
    found = on_given_base(result, told["parameters"])
    for name in TOLD:
        assert found[name] == pytest.approx(TRUTH[name], rel=0.02), name


def test_its_speed_is_that_at_the_first_sample_and_a_steady_start_misses_the_response():
    told = identify(make_start(0.15)).unsteady_start
    assert told["speeds"]["start"] == pytest.approx(-0.15, abs=0.005)
    assert told["error_without"] > 50


def test_a_load_that_fades_away_at_the_end_tells_it_too():
    record = make_start(0.12)
    fading = np.clip((2.4 - record.t) / 0.6, 0.0, 1.0)
    result = identify(replace(record, P=fading * record.P, Q=fading * record.Q))
    found = on_given_base(result, result.unsteady_start["parameters"])
    assert found["T_m"] == pytest.approx(TRUTH["T_m"], rel=0.02)


@pytest.mark.parametrize("drift", [0.0, 0.02, 0.06])
def test_no_start_is_told_of_a_load_that_is_steady_or_drifts_along_a_line(drift):
    result = identify(make_start(None, drift=drift))
    drifts = any("the load drifts" in note for note in result.uncertainty["notes"])
    assert drifts == (drift > 0)
    assert result.unsteady_start == {}
