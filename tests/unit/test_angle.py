"""The angle of the voltage in tables and arrays: units, turns, frames and jumps."""

import numpy as np
import pytest

import tractexp
from tractexp.errors import UserError
from tractexp.record import Record
from tractexp.record.angle import measure_frequency, place_jumps, unwrap_angle

T = np.arange(400) * 5e-3
JUMP = 0.2  # rad, where the dip begins, and back where it ends
INSIDE = (T > 0.5) & (T < 0.7)
U = np.where(INSIDE, 0.7, 1.0)
ANGLE = 2 * np.pi * 0.3 * T + JUMP * INSIDE + 30.0  # of 50.3 Hz
P, Q = 0.8 * U**1.5, 0.4 * U**2


def written(path, angle, name="U_angle", **more):
    columns = {"t": T, "U": U, name: angle, "P": P, "Q": Q} | more
    np.savetxt(
        path,
        np.column_stack([*columns.values()]),
        "%.9g",
        ",",
        header=",".join(columns),
        comments="",
    )
    return tractexp.read(path)[0].record


@pytest.mark.parametrize(
    ("name", "angle"),
    [
        ("U_angle", ANGLE),
        ("U_angle", np.angle(np.exp(1j * ANGLE))),
        ("U_angle", np.degrees(ANGLE)),  # it jumps by 11.5, which no angle in rad does
        ("U_angle [deg]", np.degrees(ANGLE)),
        ("Voltage angle [deg]", np.degrees(np.angle(np.exp(1j * ANGLE)))),
    ],
)
def test_an_angle_is_read_wrapped_or_not(tmp_path, name, angle):
    record = written(tmp_path / "dip.csv", angle, name)
    moved = record.U_angle - record.U_angle[0]
    np.testing.assert_allclose(moved, ANGLE - ANGLE[0], atol=1e-6)
    np.testing.assert_allclose(record.f, 50.3, atol=1e-3)


def test_an_angle_without_a_unit_that_is_wrapped_by_360_is_in_degrees(tmp_path):
    """Its frequency is 1.3 Hz off, so that it is wrapped twice in two seconds."""
    angle = np.degrees(np.angle(np.exp(1j * (ANGLE + 2 * np.pi * T))))
    record = written(tmp_path / "dip.csv", angle)
    np.testing.assert_allclose(record.f, 51.3, atol=1e-3)
    assert any("deg, for in rad it would step" in note for note in record.notes)


def test_a_jump_is_no_frequency():
    """The slope of the angle is 6.7 Hz at a jump of 0.2 rad within 5 ms; nothing turns so."""
    f = measure_frequency(ANGLE, 5e-3, 50.0)
    assert np.abs(f - 50.3).max() < 1e-6
    assert np.abs(np.gradient(ANGLE, T) / (2 * np.pi) - 0.3).max() > 3


def test_a_jump_between_two_rows_of_one_time_stays_one(tmp_path):
    """A simulator writes the instant of a fault twice."""
    k = int(np.argmax(INSIDE))
    at = T[k] - 2e-3
    before, after = ANGLE[k] - JUMP - 2e-3 * 0.6 * np.pi, ANGLE[k] - 2e-3 * 0.6 * np.pi
    columns = {"t": np.insert(T, k, [at, at]), "U": np.insert(U, k, [1.0, 0.7])}
    columns |= {"P": np.insert(P, k, [0.8, P[k]]), "Q": np.insert(Q, k, [0.4, Q[k]])}
    columns["U_angle"] = np.insert(ANGLE, k, [before, after])
    record = tractexp.read(columns)[0].record
    begins = int(np.argmax(np.abs(np.diff(record.U_angle))))
    assert (record.t[begins] + record.t[begins + 1]) / 2 == pytest.approx(at)
    np.testing.assert_allclose(record.f[: begins + 20], 50.3, atol=1e-3)
    np.testing.assert_allclose(np.diff(record.U_angle)[begins], JUMP, rtol=0.1)


def test_an_angle_of_another_frame_is_told_and_left_out(tmp_path):
    """Relative to another bus the angle stands still, and f says that it does not."""
    record = written(tmp_path / "dip.csv", ANGLE - 0.6 * np.pi * T, f=np.full(len(T), 50.3))
    assert record.U_angle is None
    assert (record.f == 50.3).all()
    assert any("no angle in a frame of 50 Hz" in note for note in record.notes)


def test_a_gap_of_an_angle_is_a_gap():
    angle = np.angle(np.exp(1j * ANGLE))
    angle[100] = np.nan
    unwrapped = unwrap_angle(angle)
    assert np.flatnonzero(np.isnan(unwrapped)).tolist() == [100]
    assert unwrapped[-1] - unwrapped[0] == pytest.approx(ANGLE[-1] - ANGLE[0])


def record(f):
    return Record("dip", T, U, P, Q, f=f)


def test_a_peak_of_f_at_a_jump_is_no_reason_to_refuse():
    """A jump of 16 degrees between two samples at 200 Hz reads 9 Hz for one of them."""
    f = np.full(len(T), 50.0)
    f[100] = 38.5576
    assert record(f).check().f is f


@pytest.mark.parametrize("samples", [12, 400])
def test_a_frequency_that_turns_by_more_than_half_a_turn_is_none(samples):
    f = np.full(len(T), 50.0)
    f[100 : 100 + samples] = 38.0
    with pytest.raises(UserError, match=r"sample 101 .*f = 38 is more than 20 % off the nominal"):
        record(f).check()


def slope_over_two(angle):
    return np.gradient(angle, T)


def slope_behind(angle):
    return np.diff(angle, prepend=angle[:1]) / (T[1] - T[0])


@pytest.mark.parametrize("take_slope", [slope_over_two, slope_behind])
def test_a_peak_of_f_is_a_jump_in_the_step_in_which_the_voltage_jumps(take_slope):
    f = 50.0 + take_slope(ANGLE) / (2 * np.pi)
    read = tractexp.read({"t": T, "U": U, "P": P, "Q": Q, "f": f})[0].record
    turned = ANGLE - ANGLE[0]
    np.testing.assert_allclose(
        read.U_angle[1:] - read.U_angle[1], turned[1:] - turned[1], atol=1e-6
    )
    np.testing.assert_allclose(read.f[1:], 50.3, atol=1e-6)


def test_without_a_jump_of_the_voltage_within_a_step_f_stays_what_it_is():
    f = 50.0 + np.gradient(ANGLE, T) / (2 * np.pi)
    slow = np.interp(T, [0.5, 0.52, 0.7, 0.72], [1.0, 0.7, 0.7, 1.0])
    assert place_jumps(f, slow, T[1], 50.0) is None
    assert place_jumps(np.full(len(T), 50.3), U, T[1], 50.0) is None
    assert place_jumps(f[:3], U[:3], T[1], 50.0) is None


def test_an_angle_survives_a_stored_record():
    from tractexp.api.read import record_from_dict, record_to_dict

    given = tractexp.read({"t": T, "U": U, "P": P, "Q": Q, "U_angle": ANGLE})[0].record
    again = record_from_dict(record_to_dict(given))
    np.testing.assert_array_equal(again.U_angle, given.U_angle)
    older = record_to_dict(given)
    del older["U_angle"]
    assert record_from_dict(older).U_angle is None
