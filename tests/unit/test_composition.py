"""How a quantity differs by hour, weekday, season and year, `estimate_composition`: planted
differences are found, and nothing is found where there is none.
"""

from datetime import datetime, timedelta

import numpy as np
import pytest

from tractexp.identification.composition import (
    FEWEST_DATED,
    estimate_composition,
    find_terms,
    shrink,
)


@pytest.fixture(scope="module")
def drawn():
    """Times of 60 dips in five years, and what differs by chance in each."""
    rng = np.random.default_rng(4)
    days = np.sort(rng.uniform(0, 5 * 365, 60))
    times = [datetime(2020, 1, 6) + timedelta(days=float(day)) for day in days]
    return times, 0.02 * rng.standard_normal(60)


def hours(times):
    return np.array([moment.hour + moment.minute / 60 for moment in times])


def test_a_planted_course_of_the_day_is_found_and_nothing_else(drawn):
    times, chance = drawn
    values = 0.5 + 0.12 * np.cos(2 * np.pi * (hours(times) - 14) / 24) + chance
    errors = np.full(60, 0.005)
    assert find_terms(values, errors, times) == ["hour"]
    found = estimate_composition(values, errors, times)
    assert found.spread == pytest.approx(0.02, rel=0.3)
    rows = found.tabulate("hour")
    assert [row["at"] for row in rows[:2]] == ["00:30", "01:30"]
    truth = 0.5 + 0.12 * np.cos(2 * np.pi * (np.arange(24) + 0.5 - 14) / 24)
    seen = np.array([row["value"] for row in rows])
    assert np.abs(seen - truth).max() < 0.02
    inside = [row["low"] <= t <= row["high"] for row, t in zip(rows, truth, strict=True)]
    assert np.mean(inside) > 0.8


def test_where_nothing_differs_nothing_is_told(drawn):
    times, chance = drawn
    values = 0.5 + chance
    assert find_terms(values, np.full(60, 0.005), times) == []
    expected, _ = estimate_composition(values, np.full(60, 0.005), times).predict(times)
    assert np.abs(expected - values.mean()).max() < 0.02


def test_weekends_and_years_are_told_apart_from_hours(drawn):
    times, chance = drawn
    weekend = np.array([moment.weekday() > 4 for moment in times])
    years = np.array([(moment - times[0]).days / 365.25 for moment in times])
    errors = np.full(60, 0.005)
    assert find_terms(0.5 - 0.1 * weekend + chance, errors, times) == ["weekday"]
    assert find_terms(0.4 + 0.05 * years + chance, errors, times) == ["year"]
    first, later = estimate_composition(0.4 + 0.05 * years, errors, times).tabulate("year")
    assert later["value"] - first["value"] == pytest.approx(0.05, rel=0.1)


def test_what_a_dip_tells_badly_is_drawn_towards_what_is_expected():
    values, errors = np.array([0.9, 0.9]), np.array([0.001, 0.4])
    drawn, left = shrink(values, errors, np.array([0.5, 0.5]), 0.05)
    assert drawn[0] == pytest.approx(0.9, abs=1e-3)
    assert drawn[1] == pytest.approx(0.5, abs=0.02)
    assert left[1] == pytest.approx(0.05, rel=0.02)


@pytest.mark.parametrize("count", [1, 2, FEWEST_DATED - 1])
def test_of_few_dips_the_mean_and_the_spread_are_told(drawn, count):
    times, chance = drawn
    values = 0.5 + chance[:count]
    found = estimate_composition(values, np.full(count, 0.005), times[:count])
    expected, _ = found.predict([None, times[0]])
    assert expected == pytest.approx(values.mean(), abs=0.01)
    assert find_terms(values, np.full(count, 0.005), times[:count]) == []


def test_dips_without_a_time_are_in_the_mean(drawn):
    times, chance = drawn
    values = 0.5 + 0.1 * np.cos(2 * np.pi * (hours(times) - 14) / 24) + chance
    unknown = [None, *times[1:]]
    found = estimate_composition(values, np.full(60, 0.005), unknown)
    assert found.start == times[1]
    assert found.predict([None])[0] == pytest.approx(0.5, abs=0.02)
