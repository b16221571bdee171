"""Where a record ends because its load changes after the dip, and what is said of a load that is
lost in it.
"""

import re

import numpy as np
import pytest

import tractexp
from tractexp.cache.provenance import hash_record
from tractexp.record import Record, detect

BEGIN, END = 1.0, 1.15  # s, of the dip


def record(course=None, rate=200.0, noise=1e-3, seed=0, sign=1.0):
    """A dip of 30 % with a slow rest, an overshoot of its load, and a `course` of time that
    multiplies it.
    """
    t, rng = np.arange(int(4 * rate)) / rate, np.random.default_rng(seed)
    after = np.where(t >= END, np.exp(-np.maximum(t - END, 0) / 0.1), 0.0)
    U = np.where((t >= BEGIN) & (t < END), 0.7, 1.0) - 0.08 * after
    P, Q = 0.8 * U**1.5 + 0.3 * after, 0.4 * U**2 + 0.3 * after
    size = 1.0 if course is None else course(t)
    U, P, Q = (
        x + noise * rng.standard_normal(len(t)) for x in (U, sign * size * P, sign * size * Q)
    )
    return Record("made", t, U, P, Q, source="made.csv")


@pytest.mark.parametrize("left", [0.0, 0.5, 0.8, 1.6])
@pytest.mark.parametrize("rate", [50, 200, 1000])
def test_a_record_ends_where_its_load_is_switched_after_the_dip(rate, left):
    whole = record(lambda t: np.where(t < 1.6 - 1e-9, 1.0, left), rate)
    event = detect(whole)
    assert 1.5 < event.record.t[-1] < 1.6
    assert event.record.digest == hash_record(whole)
    assert "while the voltage stays: the record is cut there" in event.record.notes[-1]
    assert ("is switched off" in event.record.notes[-1]) == (left == 0)
    assert detect(event.record).record is event.record


def test_a_load_that_goes_slowly_after_the_dip_ends_the_record_too():
    event = detect(record(lambda t: np.clip(1 - (t - 2) / 0.5, 0, 1)))
    assert 1.9 < event.record.t[-1] < 2.1
    assert "to 0 % of that before the dip: the record is cut there" in event.record.notes[-1]


@pytest.mark.parametrize("at", [1.05, 1.14, 1.17])
def test_a_load_that_trips_in_the_dip_is_said_to(at):
    event = detect(record(lambda t: np.where(t < at, 1.0, 0.19)))
    assert event.record.t[-1] > 3.9
    [note] = event.record.notes
    assert re.match(r"the load loses (79|80|81) % of its power in the dip \(P 0\.(8|79)", note)


def test_what_tripped_and_returns_is_the_answer_of_the_load():
    event = detect(record(lambda t: np.where((t > 1.08) & (t < 1.8), 0.6, 1.0)))
    assert event.record.t[-1] > 3.9
    assert event.record.notes == ()


def test_power_that_is_fed_back_may_change():
    assert detect(record(lambda t: np.where(t < 1.6, 1.0, -1.0), sign=-1.0)).record.t[-1] > 3.9


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.02])
@pytest.mark.parametrize("seed", range(5))
def test_a_load_that_answers_the_dip_alone_is_left_whole(noise, seed):
    whole = record(noise=noise, seed=seed)
    assert detect(whole).record is whole


@pytest.mark.parametrize("name", ["tibet", "contactors", "tibet_30pct_comtrade"])
def test_the_shipped_records_are_whole(name):
    for event in tractexp.read(name):
        assert not [note for note in event.record.notes if "cut there" in note or "loses" in note]
