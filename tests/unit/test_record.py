"""What a record refuses, and how it names it."""

import dataclasses

import numpy as np
import pytest

from tractexp.errors import UserError
from tractexp.record import Record
from tractexp.record.dips import cut_dips
from tractexp.record.direction import explain_negative_power

N = 100


def record(**changed):
    t = np.arange(N) * 0.001
    given = {
        "name": "dip",
        "t": t,
        "U": np.ones(N),
        "P": np.full(N, 0.8),
        "Q": np.full(N, 0.4),
        "source": "dip.csv",
    }
    return Record(**{**given, **changed})


def spoiled(values, i, value):
    values = np.array(values, dtype=float)
    values[i] = value
    return values


def test_a_good_record_passes_and_is_returned():
    good = record(f=np.full(N, 50.0), U2=np.zeros(N))
    assert good.check() is good
    assert good.rate == pytest.approx(1000)


def test_the_dips_of_one_record_are_numbered_from_one():
    t = np.arange(3000) / 1000
    U = np.where(((t > 0.5) & (t < 0.6)) | ((t > 2.0) & (t < 2.2)), 0.7, 1.0)
    whole = Record("whole", t, U, np.ones(3000), np.full(3000, 0.5), source="made")
    first, second = cut_dips([whole], "made", 0.3, 0.8)
    assert [(d.number, d.result.name, d.result.source) for d in (first, second)] == [
        (1, "whole_dip1", "made dip 1"),
        (2, "whole_dip2", "made dip 2"),
    ]
    assert (first.result.t[0], second.result.t[0]) == pytest.approx((0.2, 1.7), abs=2e-3)


def test_too_few_samples_of_low_voltage_tell_no_direction():
    """What two samples do is no answer: said is that the voltage is never disturbed, and no
    exponent.
    """
    U = spoiled(np.ones(N), slice(40, 42), 0.6)
    assert "the voltage is never disturbed" in explain_negative_power(
        U, -0.8 * U**2, np.full(N, -0.3)
    )
    long = spoiled(np.ones(N), slice(40, 60), 0.6)
    assert "|P| goes as U^2" in explain_negative_power(long, -0.8 * long**2, -0.4 * long**2)


def test_one_sample_tells_no_direction():
    one = np.ones(1)
    assert explain_negative_power(one, one, one) == ""


def test_gaps_in_P_and_Q_are_allowed():
    gappy = record(P=spoiled(np.full(N, 0.8), 5, np.nan), Q=spoiled(np.full(N, 0.4), 7, np.nan))
    assert gappy.check() is gappy


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"P": np.ones(N - 1)}, r"dip.csv: P has shape \(99,\) where t has 100 samples"),
        (
            {"U": spoiled(np.ones(N), 7, np.nan)},
            r"dip.csv: sample 8 \(t = 0.007 s\): U = nan .* only P and Q may have",
        ),
        ({"P": spoiled(np.ones(N), 7, np.inf)}, r"sample 8 .* P = inf is not a finite number"),
        ({"Q": np.full(N, np.nan)}, "Q holds no number at all"),
        (
            {"U": spoiled(np.ones(N), 3, 0.0)},
            r"sample 4 \(t = 0.003 s\): U = 0, but voltage must be above zero",
        ),
        ({"U": spoiled(np.ones(N), 3, -0.2)}, "U = -0.2, but voltage must be above zero"),
        (
            {"t": spoiled(np.arange(N) * 0.001, 9, 0.008)},
            r"sample 10 .*time does not increase: t = 0.008 s after 0.008",
        ),
        (
            {"t": spoiled(np.arange(N) * 0.001, 9, 0.0093)},
            "sample 10 .*30 % of a step off the uniform grid; at most 1 %",
        ),
        (
            {"t": np.arange(N) * 1.0},
            "one sample every 1 s is too coarse: .* at least 20 samples per second .*t must be in"
            " seconds",
        ),
        ({"U": np.full(N, 27.5)}, r"U starts at 27.5, which is not per unit .* data.base_voltage"),
        ({"P": np.full(N, 29.8)}, r"reaches 29.8, which is not per unit .* data.base_power"),
        ({"f": np.full(N, 314.0)}, "f = 314 is more than 20 % off the nominal 50 Hz"),
    ],
)
def test_what_is_wrong_is_named_with_place_and_value(changed, says):
    with pytest.raises(UserError, match=says):
        record(**changed).check()


def test_too_few_samples_are_refused():
    few = {name: np.ones(5) for name in ("U", "P", "Q")}
    with pytest.raises(UserError, match="only 5 samples; a record needs at least 20"):
        record(t=np.arange(5) * 0.001, **few).check()


def test_the_place_is_what_the_reader_says():
    with pytest.raises(UserError, match=r"dip.csv: line 42: U = -1"):
        record(U=spoiled(np.ones(N), 3, -1.0)).check(lambda i: "line 42")


def test_small_jitter_is_resampled_on_the_straight_line_between_samples():
    t = np.arange(N) * 0.001
    t[1:-1] += 1e-4 * np.random.default_rng(1).uniform(-1, 1, N - 2)
    made = record(t=t, U=1 - t, P=spoiled(0.8 + t, 50, np.nan)).uniform().check()
    np.testing.assert_allclose(made.U, 1 - made.t, rtol=1e-12)
    assert "resampled linearly" in made.notes[0]
    assert np.isnan(made.P).any()


def test_jitter_of_rounding_is_straightened_without_a_note():
    made = record(t=np.round(np.arange(N) / 1200, 6)).uniform().check()
    assert made.notes == ()
    np.testing.assert_allclose(np.diff(made.t), 1 / 1200, rtol=1e-4)


def test_missing_rows_are_refused_not_resampled():
    keep = np.delete(np.arange(N), [40, 41, 42, 43])
    cut = {name: values[keep] for name, values in record().channels.items()}
    with pytest.raises(
        UserError,
        match=r"sample 41 .*t advances by 0.005 s where 0.001 s is usual: rows are missing",
    ):
        dataclasses.replace(record(), **cut).uniform()
