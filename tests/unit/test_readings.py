"""What a shape that is left may be physically, `read_shapes`: a known shape has a known reading."""

from dataclasses import replace

import numpy as np
import pytest

import tractexp
from tractexp.discrepancy.readings import LOOK, RULES, WAVES, read_shapes
from tractexp.discrepancy.remainder import Remainder
from tractexp.record import Record, detect
from tractexp.record.waves import Waves


@pytest.fixture(scope="module")
def event():
    t = np.arange(0, 1, 0.002)
    dip = np.where((t > 0.3) & (t < 0.6), 0.6, 1.0)
    return detect(Record(name="dip", t=t, U=dip, P=dip, Q=0.5 * dip))


def shape(kind, channel="P", frequency=None, time_constant=None, event="dip1"):
    times = (frequency, time_constant, None)
    return Remainder(event, channel, kind, 0.3, 0.0, False, *times, 0.1, 20.0, 0.5)


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (shape("ringing", frequency=47.0, time_constant=0.023), "a direct component of flux"),
        (shape("ringing", frequency=55.5, time_constant=0.023), "a direct component of flux"),
        (shape("ringing", frequency=100.0), "not balanced"),
        (shape("ringing", frequency=150.0), "harmonics"),
        (shape("ringing", "i_alpha", frequency=150.0), "harmonics"),
        (shape("ringing", frequency=12.0), "a control loop"),
        (shape("decay", "i_alpha", time_constant=0.05), "a direct current"),
        (shape("decay", time_constant=0.02), "faster than the model"),
        (shape("decay", time_constant=0.5), "a slow recovery"),
        (shape("step"), "trips or comes back"),
        (shape("pulse", time_constant=0.002), "the recorder lost"),
    ],
)
def test_a_shape_has_its_reading(left, words, event):
    (reading,) = read_shapes([left], event)
    assert words in reading.means
    assert reading.source
    assert reading.decides
    assert reading.command.startswith("tractexp")


def test_a_ring_that_two_events_share_is_no_function_of_the_voltage(event):
    both = [shape("ringing", frequency=f, event=e) for f, e in ((12.0, "dip1"), (12.6, "dip2"))]
    apart = [shape("ringing", frequency=f, event=e) for f, e in ((12.0, "dip1"), (17.0, "dip2"))]
    assert all("in common" in reading.means for reading in read_shapes(both, event))
    assert not any("in common" in reading.means for reading in read_shapes(apart, event))


def test_what_would_decide_is_a_command_that_can_be_carried_out(event):
    """A record of phasors holds no samples to fit: its file is looked at; arrays have no file."""
    fast, slow = shape("decay", time_constant=0.02), shape("decay", time_constant=0.5)
    (shipped,) = tractexp.read("tibet_50pct")
    look = "tractexp look pkg://tractexp.data/tibet_50pct.csv --all"
    assert [r.command for r in read_shapes([fast, slow], shipped)] == [look, look]
    assert {r.command for r in read_shapes([fast, slow], event)} == {"tractexp.plan(dips)"}
    samples = Waves(np.zeros((6, 5000)), 0.0, 5000.0, "dft", None)
    sampled = replace(event, record=replace(event.record, waves=samples))
    (reading,) = read_shapes([fast], sampled)
    assert reading.command == "tractexp.investigate(dips, domain='waves')"


def test_each_row_of_the_table_has_a_source_and_a_command_that_exists():
    assert all(rule.source and rule.decides for rule in RULES)
    assert {rule.command for rule in RULES} == {LOOK, WAVES}
