"""A relay's report of a motor as a type test: start, unbalance, trip and coasting with known truth,
and silence for everything else.
"""

import numpy as np
import pytest
from field_waves import KA, KV, dip, load, noise, phases, recording, wave
from made_motor import R_S, X_LEAK, X_M, X_PRIME, solve_motor
from test_cev import BITS, names, row

import tractexp
from tractexp.filetypes.comtrade_writer import write
from tractexp.recording import Feeder
from tractexp.recording.measure import measure_phasors
from tractexp.recording.type_test import MotorCourse, find_type_test

RATE = 3200.0
THREE = Feeder((0, 1, 2), (3, 4, 5), "three_phase")
BEGUN, TRIPPED, LENGTH = 0.5, 3.0, 4.5  # s
X_LOCKED, T0_PRIME, H, FACTOR = 0.18, 0.9, 0.8, 0.85
RUNNING_LAG = float(np.arccos(FACTOR))
RUNS_UP, START_LAG = 1.2, 1.3


def report(started=True, unbalance=0.0, fan=False, sigma=5e-4):
    """A recording of a motor that starts, runs up, is tripped and coasts down: it draws `KA` at
    `KV` running, with H and X on that base; its load brakes it by the torque of before, or by one
    that falls with the square of the speed.
    """
    t = np.arange(round(LENGTH * RATE)) / RATE
    since = np.maximum(t - TRIPPED, 0.0)
    brake = FACTOR / (2 * H)
    speed = 1 / (1 + brake * since) if fan else 1 - brake * since
    turn = np.cumsum(speed) / RATE * 50.0
    gone = t >= TRIPPED
    V = KV * np.where(gone, speed * np.exp(-since / T0_PRIME), 1.0) * np.exp(2j * np.pi * turn)
    at_rest = (t < BEGUN + RUNS_UP) if started else np.zeros(len(t), dtype=bool)
    size = np.where(at_rest, 1 / X_LOCKED, 1.0)
    lag = np.where(at_rest, START_LAG, RUNNING_LAG)
    flows = ~gone & ((t >= BEGUN) if started else True)
    I = KA * size * np.exp(-1j * lag) * V / KV * flows
    V2 = unbalance * V * ~gone
    I2 = V2 / KV * KA / X_LOCKED * np.exp(-1j * START_LAG) * flows
    waves = np.concatenate([wave(t, phases(V, V2), 0.0), wave(t, phases(I, I2), 0.0)])
    waves += noise(waves.shape, sigma) * np.repeat([KV, KA], 3)[:, None]
    return recording(waves, RATE)


def measure(record):
    [segment] = record.segments
    found = find_type_test(
        MotorCourse.from_phasors(measure_phasors(record, THREE, segment), 50.0), record.frequency
    )
    return found and {each.name: each for each in found.values}


def check(value, truth, share):
    assert value.value == pytest.approx(truth, rel=share)
    assert value.low <= truth * (1 + share / 2)
    assert value.high >= truth * (1 - share / 2)
    assert value.high - value.low < 0.5 * truth


@pytest.mark.parametrize("fan", [False, True])
def test_a_start_and_a_trip_tell_impedance_time_constant_and_inertia(fan):
    found = measure(report(fan=fan))
    assert found.keys() == {"X_locked", "T0'", "H"}
    check(found["X_locked"], X_LOCKED, 0.02)
    check(found["T0'"], T0_PRIME, 0.05)
    check(found["H"], H, 0.1)


def test_an_unbalance_tells_the_impedance_without_a_start():
    found = measure(report(started=False, unbalance=0.02))
    assert found.keys() == {"X_2", "T0'", "H"}
    check(found["X_2"], X_LOCKED, 0.05)
    phasors = measure_phasors(report(started=False), THREE, report().segments[0])
    test = find_type_test(MotorCourse.from_phasors(phasors, 50.0), 50.0)
    assert test.power == pytest.approx(3 * KV * KA, rel=0.01)
    assert test.voltage == pytest.approx(110, rel=0.01)


def look_at_motor(V, I, folder):
    """The test that `look` tells of a motor, and its values by name; voltage and current (n,) are
    space vectors [pu].
    """
    turn = np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]
    waves = np.sqrt(2) * np.concatenate([KV * (V * turn).real, KA * (I * turn).real])
    waves += noise(waves.shape, 5e-4) * np.repeat([KV, KA], 3)[:, None]
    write(recording(waves, RATE), folder / "motor.cfg", "BINARY", 1999)
    (feeder,) = tractexp.look(folder / "motor.cfg").content["files"][0]["feeders"]
    test = feeder["type_test"]
    return test, {row["name"]: row for row in test["values"]}


def solve_type_test(R_r, H, unbalance, folder):
    """The test that `look` tells of a solved motor, its values by name, and what holds: T0' [s],
    and what it draws running over the machine's power.
    """
    V, I, T0 = solve_motor(RATE, R_r, H, 4.0, 5.0, unbalance)
    test, values = look_at_motor(V, I, folder)
    return test, values, T0, test["power"] / (3 * KV * KA)


@pytest.mark.parametrize(
    ("R_r", "H", "unbalance"),
    [(0.015, 0.8, 0.0), (0.025, 1.2, 0.0), (0.015, 0.8, 0.03), (0.05, 0.3, 0.0)],
)
def test_the_intervals_hold_the_truth_of_a_motor_solved_from_standstill(
    R_r, H, unbalance, tmp_path
):
    test, found, T0, base = solve_type_test(R_r, H, unbalance, tmp_path)
    assert found["T0'"]["low"] < T0 < found["T0'"]["high"]
    assert found["H"]["low"] < H / base < found["H"]["high"]
    assert found["H"]["high"] < 1.2 * found["H"]["low"]
    low, high = test["bounds"]["X_prime"]
    assert low < X_PRIME * base < high
    assert ("X_2" in found) == (unbalance > 0)


@pytest.mark.parametrize(("R_r", "unbalance"), [(0.015, 0.0), (0.05, 0.03)])
def test_a_motor_that_is_tripped_before_it_runs_up_tells_its_impedance_in_ohm(
    R_r, unbalance, tmp_path
):
    """Its inertia is that of a rotor that is stuck; what it would draw running nobody knows."""
    V, I, _ = solve_motor(RATE, R_r, 1e3, 1.8, 2.4, unbalance)
    test, found = look_at_motor(V, I, tmp_path)
    rotor = 1 / (1 / (1j * X_M) + 1 / (R_r + 1j * X_LEAK))
    locked = abs(R_S + 1j * X_LEAK + rotor) * KV / KA
    assert found.keys() == ({"Z_locked", "X_2"} if unbalance else {"Z_locked"})
    assert found["Z_locked"]["low"] < locked < found["Z_locked"]["high"]
    assert found["Z_locked"]["unit"] == "ohm"
    assert test["bounds"] == {}
    assert "a start that failed, if it is a motor: Z_locked" in test["sentence"]


@pytest.mark.parametrize("angle", [0.5, 1.57])
def test_a_heater_or_a_reactor_that_is_switched_on_and_off_is_no_failed_start(angle):
    t = np.arange(round(2.4 * RATE)) / RATE
    V = KV * np.exp(2j * np.pi * 50 * t)
    flows = (t > 0.5) & (t < 1.8)
    I = KA * np.exp(-1j * angle) * V / KV * flows
    waves = np.concatenate([wave(t, phases(V, 0 * V), 0.0), wave(t, phases(I, 0 * I), 0.0)])
    waves += noise(waves.shape, 5e-4) * np.repeat([KV, KA], 3)[:, None]
    assert measure(recording(waves, RATE)) is None


def test_a_motor_that_coasts_for_70_ms_tells_time_constant_and_inertia(tmp_path):
    """Its voltage is followed below the frequencies that windows track."""
    _, found, T0, base = solve_type_test(0.16, 0.08, 0.0, tmp_path)
    assert found.keys() == {"T0'", "H"}
    assert pytest.approx(0.07, rel=0.03) == T0
    assert found["T0'"]["low"] < T0 < found["T0'"]["high"] < 1.1 * found["T0'"]["low"]
    assert found["H"]["low"] < 0.08 / base < found["H"]["high"] < 1.2 * found["H"]["low"]


def test_a_load_that_is_switched_off_a_live_bus_is_no_type_test():
    t = np.arange(round(3 * RATE)) / RATE
    V = np.full(len(t), KV)
    record = recording(np.concatenate([wave(t, phases(V)), wave(t, load(V * (t < 1.5)))]), RATE)
    assert measure(record) is None


@pytest.mark.parametrize("depth", [0.0, 0.5])
def test_a_dip_or_nothing_is_no_type_test(depth):
    t = np.arange(round(2 * RATE)) / RATE
    V = dip(t, depth=depth)
    record = recording(np.concatenate([wave(t, phases(V)), wave(t, load(V))]), RATE)
    assert measure(record) is None


def test_a_look_tells_it(tmp_path):
    write(report(), tmp_path / "start.cfg", "BINARY", 1999)
    seen = tractexp.look(tmp_path / "start.cfg")
    (feeder,) = seen.content["files"][0]["feeders"]
    names = [row["name"] for row in feeder["type_test"]["values"]]
    assert names == ["X_locked", "T0'", "H"]
    low, high = feeder["type_test"]["bounds"]["M"]
    assert low < H / (np.pi * 50) < high
    low, high = feeder["type_test"]["bounds"]["X_prime"]
    assert low < X_LOCKED < high
    assert "a type test: X_locked 0.18" in str(seen.screen()).replace("\n", " ")


def test_a_filtered_report_of_a_relay_tells_it(tmp_path):
    """Four samples a cycle of phasors, by a relay that tracks the frequency."""
    nominal, per_cycle = 50.0, 4
    times = [0.0]
    while times[-1] < TRIPPED + 0.3:  # it samples by the frequency that it measures
        turns = 1 - FACTOR / (2 * H) * max(times[-1] - TRIPPED, 0.0)
        times.append(times[-1] + 1 / (nominal * turns * per_cycle))
    at = np.array(times)
    since = np.maximum(at - TRIPPED, 0.0)
    speed = 1 - FACTOR / (2 * H) * since
    U = np.where(at >= TRIPPED, speed * np.exp(-since / T0_PRIME), 1.0)
    size = np.where(at < BEGUN, 0.0, np.where(at < BEGUN + RUNS_UP, 1 / X_LOCKED, 1.0))
    size = np.where(at >= TRIPPED, 0.0, size)
    lag = np.where(at < BEGUN + RUNS_UP, START_LAG, RUNNING_LAG)
    path = tmp_path / "MOTOR 1.CEV"
    path.write_text("\n".join(filtered_report(nominal * speed, per_cycle, U, size, lag)) + "\n")
    (feeder,) = tractexp.look(path).content["files"][0]["feeders"]
    found = {row["name"]: row for row in feeder["type_test"]["values"]}
    assert found["X_locked"]["value"] == pytest.approx(X_LOCKED, rel=0.02)
    assert found["T0'"]["value"] == pytest.approx(T0_PRIME, rel=0.02)
    assert found["H"]["value"] == pytest.approx(H, rel=0.05)


def filtered_report(f, per_cycle, U, size, lag):
    """Lines of a filtered report of a relay that samples by f (N,) [Hz]."""
    turn = np.exp(2j * np.pi * np.arange(len(f)) / per_cycle)[:, None]
    turn = turn * np.exp(-2j * np.pi / 3 * np.arange(3))
    V = 6.35 * U[:, None] * turn.real
    I = 300 * (size * U * np.exp(-1j * lag))[:, None] * turn
    columns = ["IA", "IB", "IC", "VA(kV)", "VB(kV)", "VC(kV)", "FREQ"]
    told = {"FREQ": f"{f[0]:.2f}", "SAM/CYC_A": per_cycle, "EVENT": '"ER"'}
    lines = [names("FID"), names("FID=SEL-710-R415")]
    lines.append(names("MONTH", "DAY", "YEAR", "HOUR", "MIN", "SEC", "MSEC"))
    lines += [row(3, 14, 2023, 15, 9, 26, 535), names(*told), row(*told.values())]
    lines.append(names(*columns, "TRIG", BITS))
    for k in range(len(f)):
        cells = [*(f"{v:.4f}" for v in (*I[k].real, *V[k])), f"{f[k]:.2f}"]
        lines.append(row(*cells, ">" if k == len(f) // 3 else "", '"8480"'))
    return lines
