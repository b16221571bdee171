"""What judges the estimate is right itself: truths of ANDES's motors on a record's base, and the
rule of chance.
"""

import json
from pathlib import Path

import andes_loads
import numpy as np
import pytest
from model_error import Compared, block_difference, overall, worse_than_chance
from model_error_tables import documented

MOTOR = {"Sn": 300.0, "rs": 0.013, "xs": 0.1, "rr1": 0.014, "xr1": 0.12, "xm": 3.4, "Hm": 0.7}
TORQUE = {"c1": 1.05, "c2": 0.0, "c3": 1.05}
COUNT, RATE = 480, 240.0


def test_a_motor_of_andes_on_the_record_s_base():
    """The worked values of three dips at hand; T_m is the torque's power at synchronous speed."""
    values = andes_loads.circuit(MOTOR | TORQUE, 5.043933)
    expected = {"T_prime": 0.0411, "X_prime": 0.363, "C": 0.938, "M": 0.00221, "T_m": 0.416}
    assert {name: values[name] for name in expected} == pytest.approx(expected, rel=2e-3)


def test_an_open_second_cage_leaves_the_transient_reactance():
    values = andes_loads.circuit(MOTOR | TORQUE | {"rr2": 0.1, "xr2": 1e6}, 5.0)
    assert values["X_second"] == pytest.approx(values["X_prime"], rel=1e-6)


def test_the_shares_of_a_zip_load_count_from_the_voltage_before():
    terms = {"P": (0.2, 0.3 / 0.9, 0.5 / 0.9**2), "Q": (0.0, 0.0, 1.0)}
    at_flow, lower = (andes_loads.composition(terms, U0) for U0 in (0.9, 0.8))
    assert (at_flow["a_Z"], at_flow["a_I"], at_flow["p_v"]) == pytest.approx((0.5, 0.3, 1.3))
    slope = (
        0.8
        * (0.3 / 0.9 + 2 * 0.5 / 0.9**2 * 0.8)
        / (0.2 + 0.3 * 0.8 / 0.9 + 0.5 * (0.8 / 0.9) ** 2)
    )
    assert lower["p_v"] == pytest.approx(slope)
    assert (lower["b_Z"], lower["q_v"]) == (1.0, 2.0)


def test_series_never_share_a_seed():
    draws = {
        (s, k): andes_loads.generator(s, k).random()
        for s in ("calibration", "final")
        for k in range(100)
    }
    assert len(set(draws.values())) == len(draws)


def test_a_jump_lies_between_samples_and_the_frequency_holds_the_angle_s():
    """A record of a series of two steps: levels before, in and after the fault, and the area under
    the frequency.
    """
    t = np.sort(
        np.concatenate(
            [np.arange(0, andes_loads.AT + andes_loads.LENGTH, 1 / 480), [0.0201, 0.12, 0.1201]]
        )
    )
    inside = (t > andes_loads.AT + 1e-9) & (t <= 0.12 + 1e-9)
    level, angle = np.where(inside, 0.6, 1.0), np.where(inside, 0.1, 0.0)
    rows = {"t": t, "U": level, "P": 2 * level, "Q": level, "angle": angle}
    dip = andes_loads.record(rows, andes_loads.Fault(7, 0.1, 0.0, 0.1), RATE, 0.3 / RATE)
    assert {*np.round(dip["U"], 9).tolist()} == {0.6, 1.0}
    assert (dip["t"][dip["U"] < 0.8] > 0).all()
    assert dip["P"][0] == 1.0
    early = dip["t"] < 0.05
    turned = np.trapezoid(2 * np.pi * (dip["f"][early] - andes_loads.FREQUENCY), dip["t"][early])
    assert turned == pytest.approx(0.1)
    assert np.abs(dip["f_smooth"] - andes_loads.FREQUENCY).max() < 1e-9


def sides(growth: float, seed: int = 0) -> tuple[list[Compared], list[Compared]]:
    """Two fits whose errors are noise of one size, but for a growth of the first's."""
    rng, t = np.random.default_rng(seed), np.arange(COUNT) / RATE
    one, other = rng.normal(size=(2, COUNT)) ** 2
    moved = np.full(COUNT, 100.0)
    return [Compared(t, growth * one, moved)], [Compared(t, other, moved)]


def test_an_error_of_the_same_size_is_chance_and_one_of_twice_the_square_is_not():
    alarms = [worse_than_chance(*sides(1.0, seed)) for seed in range(200)]
    assert sum(alarms) < 14  # 2.3 % of a normal law's are beyond twice its deviation
    assert all(worse_than_chance(*sides(2.0, seed)) for seed in range(20))


def test_few_alarms_where_a_short_record_s_error_is_correlated_and_fades():
    """Two dips of 0.2 s at 1067 Hz, as those of station xtz: errors of one size, correlated over 20
    ms.
    """
    from scipy.signal import lfilter

    rng, t = np.random.default_rng(3), np.arange(213) / 1067
    memory = np.exp(-1 / (1067 * 0.02))

    def error() -> Compared:
        white = rng.normal(size=(2, len(t) + 500))
        colored = lfilter([np.sqrt(1 - memory**2)], [1, -memory], white)[:, 500:] * np.exp(
            -t / 0.05
        )
        return Compared(t, (colored**2).sum(axis=0), np.ones_like(t))

    alarms = [worse_than_chance([error(), error()], [error(), error()]) for _ in range(400)]
    assert sum(alarms) < 24


def test_a_growth_below_one_percent_of_the_error_does_not_count():
    _, search = sides(1.0)
    for growth, worse in ((1.015, False), (1.025, True)):  # of the square
        [one] = search
        estimate = [Compared(one.t, growth * one.missed, one.moved)]
        assert worse_than_chance(estimate, search) == worse


def test_the_error_in_S_is_of_the_excursion():
    estimate, _ = sides(1.0)
    assert overall(estimate) == pytest.approx(np.sqrt(estimate[0].missed.mean()) / 10)
    assert block_difference(estimate, estimate)[:2] == (0.0, 0.0)


def test_the_page_tells_what_the_stored_rows_hold():
    root = Path(__file__).parents[2]
    stored = (root / "benchmarks" / "model_error.jsonl").read_text(encoding="utf-8").splitlines()
    page = (root / "docs" / "coverage.md").read_text(encoding="utf-8")
    lines = documented([json.loads(line) for line in stored])
    assert len(lines) > 6
    for line in lines:
        assert line in page, line
