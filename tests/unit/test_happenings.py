"""What kind of event a voltage shows, on made waveforms of many shapes; and silence where nothing
happens.
"""

import re

import numpy as np
import pytest
from field_waves import KA, KV, load, noise, phases, recording, wave

from tractexp.filetypes import comtrade
from tractexp.record import Base, Record
from tractexp.recording import Feeder
from tractexp.recording.happening import find_happenings, find_happenings_of_record
from tractexp.recording.measure import FeederWaves, measure_phasors
from tractexp.recording.trace import trace_waves

SEEDS = range(4)
THREE = Feeder((0, 1, 2), (3, 4, 5), "three_phase")


def seen(t, volts, amps, f=50.0, sigma=0.002, seed=0, rate=3200.0, extra=0.0, nominal=50.0):
    """The happenings in waveforms of phasors (3, N) with noise."""
    waves = np.concatenate([wave(t, volts, f), wave(t, amps, f)]) + extra
    waves += noise(waves.shape, sigma, seed) * np.repeat([KV, KA], 3)[:, None]
    record = recording(waves, rate, frequency=nominal)
    return of(record, THREE)


def of(record, feeder):
    [segment] = record.segments
    waves = FeederWaves.from_recording(record, feeder, segment)[:, :]
    phasors = measure_phasors(record, feeder, segment)
    return find_happenings(trace_waves(waves, segment.rate, 0.0, record.frequency, phasors))


def grid(seconds, rate=3200.0):
    return np.arange(round(seconds * rate)) / rate


def shape(rng):
    """(start, duration, depth) of an event."""
    return 0.5 + rng.uniform(0, 0.3), rng.uniform(0.05, 0.6), rng.uniform(0.12, 0.8)


@pytest.mark.parametrize("seed", SEEDS)
def test_dips_of_any_size_with_a_slow_recovery(seed):
    rng = np.random.default_rng(100 + seed)
    start, duration, depth = shape(rng)
    t = grid(2.5)
    V = KV * np.where((t >= start) & (t < start + duration), 1 - depth, 1.0)
    after = t >= start + duration
    V[after] *= 1 - 0.06 * np.exp(-(t[after] - start - duration) / 0.3)
    turned = np.where((t >= start) & (t < start + duration), np.exp(-0.15j), 1.0)
    [event] = seen(t, phases(V * turned), load(V * turned), seed=seed)
    assert (event.kind, event.worth) == ("dip", True), event.why
    assert event.start == pytest.approx(start, abs=0.02)
    assert event.end == pytest.approx(start + duration, abs=0.03)
    assert event.depth == pytest.approx(depth, abs=0.01)
    assert event.jump == pytest.approx(np.degrees(-0.15), abs=2.0)
    assert event.U2 < 0.02
    S = 3 * KV * KA * np.exp(1j * np.pi / 6)
    assert event.before == (pytest.approx(S.real, rel=0.01), pytest.approx(S.imag, rel=0.01))


@pytest.mark.parametrize("seed", SEEDS)
def test_an_unbalanced_fault_is_a_dip_with_its_negative_sequence(seed):
    rng = np.random.default_rng(200 + seed)
    start, _, depth = shape(rng)
    t = grid(2.0)
    during = (t >= start) & (t < start + 0.1)
    one, two, zero = (
        KV * (1 - depth * during / 3),
        -KV * depth * during / 3,
        -KV * depth * during / 3,
    )
    [event] = seen(t, phases(one, two, zero), load(one, two), seed=seed)
    assert (event.kind, event.worth) == ("dip", True)
    assert event.depth == pytest.approx(depth / 3, abs=0.01)
    assert pytest.approx(depth / 3, abs=0.02) == event.U2
    lowest = float(re.search(r"the lowest phase to ([\d.]+) %", event.why)[1])
    assert lowest == pytest.approx(100 * (1 - depth), abs=1.5)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_swell_then_a_dip_are_two_and_the_dip_has_its_own_depth(seed):
    t = grid(3.0)
    V = KV * np.where((t >= 0.8) & (t < 1.3), 1.15, np.where((t >= 1.3) & (t < 1.5), 0.7, 1.0))
    swell, dip = seen(t, phases(V), load(V), seed=seed)
    assert (swell.kind, dip.kind) == ("swell", "dip")
    assert swell.depth == pytest.approx(-0.15, abs=0.01)
    assert dip.depth == pytest.approx(0.3, abs=0.01)
    assert dip.end - dip.start == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize("change", [-0.05, 0.05, -0.1, 0.12])
def test_a_step_stays(change):
    t = grid(4.0)
    V = KV * np.where(t >= 1.3, 1 + change, 1.0)
    [event] = seen(t, phases(V), load(V))
    assert (event.kind, event.worth) == ("step", False)
    assert event.start == pytest.approx(1.3, abs=0.03)
    assert event.depth == pytest.approx(-change, abs=0.005)


def test_a_dip_after_a_step_is_measured_from_the_new_level():
    t = grid(6.0)
    V = KV * np.where(t >= 1.0, 1.06, 1.0) * np.where((t >= 4.0) & (t < 4.2), 0.6, 1.0)
    step, dip = seen(t, phases(V), load(V))
    assert (step.kind, dip.kind) == ("step", "dip")
    assert dip.depth == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("change", [-0.1, 0.08])
def test_a_ramp_takes_its_time(change):
    t = grid(8.0)
    V = KV * (1 + change * np.clip((t - 2) / 3, 0, 1))
    events = seen(t, phases(V), load(V))
    assert {event.kind for event in events} == {"ramp"}
    assert not any(event.worth for event in events)


def test_ramps_that_follow_each_other_are_one():
    """Three of 5 % each, 3 s apart: one, from the first to where the last is nearly over, as deep
    as it is then.
    """
    t = grid(16.0)
    V = KV * (1 - sum(0.05 * np.clip((t - start) / 1.5, 0, 1) for start in (2, 6.5, 11)))
    [ramp] = seen(t, phases(V), load(V))
    assert (ramp.kind, ramp.worth) == ("ramp", False)
    assert (ramp.start, ramp.end) == (pytest.approx(2.0, abs=1.0), pytest.approx(12.0, abs=0.7))
    assert ramp.depth == pytest.approx(1 - V[round(ramp.end * 3200)] / KV, abs=0.005)
    assert ramp.depth > 0.12


def test_ramps_on_either_side_of_a_dip_stay_two():
    t = grid(14.0)
    V = KV * (1 - sum(0.1 * np.clip((t - start) / 1.5, 0, 1) for start in (1, 10)))
    V = V * np.where((t >= 7.0) & (t < 7.2), 0.6, 1.0)
    assert [event.kind for event in seen(t, phases(V), load(V))] == ["ramp", "dip", "ramp"]


@pytest.mark.parametrize("seed", SEEDS)
def test_an_interruption_returns_and_a_dead_line_does_not(seed):
    t = grid(3.0)
    V = KV * np.where((t >= 0.7) & (t < 1.5), 0.001, 1.0)
    [event] = seen(t, phases(V), load(V), seed=seed)
    assert (event.kind, event.worth) == ("interruption", False)
    V = KV * np.where(t >= 0.7, 0.0005, 1.0)
    [event] = seen(t, phases(V), load(V), seed=seed)
    assert (event.kind, event.end) == ("dead line", pytest.approx(3.0, abs=0.03))


def test_a_line_that_is_energised_was_dead():
    t = grid(2.0)
    V = KV * np.where(t < 0.8, 0.0002, 1.0)
    events = seen(t, phases(V), load(V))
    assert [event.kind for event in events] == ["dead line"]
    assert (events[0].start, events[0].end) == (
        pytest.approx(0.01, abs=0.02),
        pytest.approx(0.8, abs=0.06),
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_a_fault_that_ends_in_an_open_pole_is_two_parts(seed):
    pole = np.random.default_rng(300 + seed).integers(3)
    t = grid(3.0)
    volts, amps = phases(KV * np.ones(len(t))), load(KV * np.ones(len(t)))
    fault, opened = (t >= 0.6) & (t < 0.7), (t >= 0.7) & (t < 1.6)
    volts[pole] *= np.where(fault, 0.3, np.where(opened, 0.15, 1.0))
    amps[pole] *= np.where(fault, 1.8, np.where(opened, 0.002, 1.0))
    dip, event = seen(t, volts, amps, seed=seed)
    assert (dip.kind, event.kind) == ("dip", "open pole")
    assert (dip.worth, event.worth) == (False, False)
    assert "ends in an open pole" in dip.why
    assert event.start == pytest.approx(0.7, abs=0.03)
    assert event.end == pytest.approx(1.6, abs=0.03)
    assert pytest.approx(0.85 / 3, abs=0.03) == event.U2


def test_an_open_pole_that_the_voltage_hardly_shows():
    t = grid(2.0)
    volts, amps = phases(KV * np.ones(len(t))), load(KV * np.ones(len(t)))
    amps[1] *= np.where((t >= 0.8) & (t < 1.4), 0.001, 1.0)
    [event] = seen(t, volts, amps)
    assert event.kind == "open pole"


@pytest.mark.parametrize(("period", "depth"), [(0.7, 0.35), (1.1, 0.6), (0.4, 0.2), (2.0, 0.5)])
def test_swings_of_a_lost_generator_are_one_pole_slip(period, depth):
    t = grid(4.5 * period + 1)
    angle = 2 * np.pi * np.clip(t - 0.5, 0, None) / period
    # two networks that slip against each other
    V = KV * ((1 - depth / 2) + depth / 2 * np.exp(1j * angle))
    events = seen(t, phases(V), load(V))
    slips = [event for event in events if event.kind == "pole slip"]
    assert len(slips) == 1
    assert slips[0].depth == pytest.approx(depth, abs=0.05)
    assert slips[0].end - slips[0].start > 2.5 * period
    assert not any(event.worth for event in events)


@pytest.mark.parametrize("seed", SEEDS)
def test_motors_that_start_one_after_another_are_no_pole_slip(seed):
    rng = np.random.default_rng(400 + seed)
    t = grid(6.0)
    V = np.full(len(t), KV)
    for start in (1.0, 2.4, 3.9):
        after = t >= start
        V[after] *= 1 - rng.uniform(0.12, 0.2) * np.exp(-(t[after] - start) / 0.15)
    events = seen(t, phases(V), load(V), seed=seed)
    assert [event.kind for event in events] == ["dip"] * 3


@pytest.mark.parametrize("seed", SEEDS)
def test_the_inrush_of_a_transformer(seed):
    t = grid(2.5)
    rng = np.random.default_rng(500 + seed)
    turned = 2 * np.pi * 50 * t + np.array([[0], [-2 * np.pi / 3], [2 * np.pi / 3]])
    on = t >= 0.9
    lobes = (
        np.maximum(np.cos(turned + rng.uniform(0, 6)) - 0.35, 0)
        * on
        * np.exp(-np.clip(t - 0.9, 0, None) / 0.4)
    )
    V = KV * np.ones(len(t))
    extra = np.concatenate([np.zeros_like(lobes), 3 * KA * lobes])
    [event] = seen(t, phases(V), load(V), extra=extra, seed=seed)
    assert event.kind == "inrush"
    assert event.start == pytest.approx(0.9, abs=0.03)


def test_the_offset_of_a_fault_current_is_no_inrush():
    t = grid(2.0)
    during = (t >= 0.8) & (t < 0.9)
    V = KV * np.where(during, 0.5, 1.0)
    amps = load(V) * np.where(during, 12.0, 1.0)
    offset = np.zeros((6, len(t)))
    offset[3:] = KA * 4 * np.array([[1], [-0.6], [-0.4]]) * during * np.exp(-(t - 0.8) / 0.06)
    events = seen(t, phases(V), amps, extra=offset)
    assert [event.kind for event in events] == ["dip"]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("f", [48.5, 50.0, 51.4])
@pytest.mark.parametrize("sigma", [0.0, 0.01])
def test_silence_where_nothing_happens(seed, f, sigma):
    rng = np.random.default_rng(600 + seed)
    t = grid(3.0)
    V = np.full(len(t), KV) * (1 + 0.01 * np.sin(2 * np.pi * rng.uniform(0.3, 8) * t))
    extra = np.zeros((6, len(t)))
    for h in (3, 5, 7, 11):
        lag = rng.uniform(0, 6, (3, 1))
        extra[:3] += 0.02 * KV * np.sqrt(2) * np.cos(2 * np.pi * h * f * t + lag)
        extra[3:] += 0.06 * KA * np.sqrt(2) * np.cos(2 * np.pi * h * f * t - lag)
    assert seen(t, phases(V), load(V), f=f, sigma=sigma, seed=seed, extra=extra) == []


@pytest.mark.parametrize(
    ("rate", "nominal"),
    [(600.0, 50.0), (1000.0, 50.0), (960.0, 60.0), (12800.0, 60.0), (500.0, 50 / 3)],
)
def test_at_any_rate_and_nominal_frequency(rate, nominal):
    t = grid(2.0, rate)
    V = KV * np.where((t >= 0.9) & (t < 1.2), 0.7, 1.0)
    [event] = seen(t, phases(V), load(V), f=nominal * 1.003, rate=rate, nominal=nominal)
    assert (event.kind, event.worth) == ("dip", True)
    assert event.depth == pytest.approx(0.3, abs=0.01)


def test_single_phase_feeders_have_happenings_too():
    t = grid(2.0)
    V = 27.5 * np.where((t >= 0.9) & (t < 1.2), 0.75, 1.0)
    record = recording(
        [*wave(t, V[None]), *wave(t, 0.3 * np.exp(-0.4j) * V[None] / 27.5)], names=["U", "I"]
    )
    [event] = of(record, Feeder((0,), (1,), "single_phase"))
    assert (event.kind, event.worth) == ("dip", True)
    assert np.isnan(event.U2)


@pytest.mark.parametrize("volts", [0.0, 1e-6, "same"])
def test_voltages_that_are_no_three_phases_are_a_dead_line(volts):
    t = grid(1.0)
    same = np.ones((3, len(t))) * KV if volts == "same" else phases(volts * np.ones(len(t)))
    [event] = seen(t, same, load(KV * np.ones(len(t))))
    assert (event.kind, event.worth) == ("dead line", False)
    assert "no three phases" in event.why


def test_a_feeder_without_load_is_not_worth_fitting():
    t = grid(2.0)
    V = KV * np.where((t >= 0.9) & (t < 1.2), 0.7, 1.0)
    [event] = seen(t, phases(V), 0 * load(V))
    assert (event.kind, event.worth) == ("dip", False)
    assert "no load current" in event.why


class TestOfRecords:
    def record(self, U, U2=None, step=1e-3, f=None):
        t = np.arange(len(U)) * step
        return Record(name="made", t=t, U=U, P=0.8 * U**1.5, Q=0.4 * U**2, U2=U2, f=f, base=Base())

    def test_a_dip(self):
        U = np.ones(3000) + noise(3000, 0.001)
        U[1000:1150] -= 0.4
        [event] = find_happenings_of_record(self.record(U))
        assert (event.kind, event.worth) == ("dip", True)
        assert (event.start, event.end) == (
            pytest.approx(1.0, abs=0.02),
            pytest.approx(1.15, abs=0.02),
        )
        assert event.before == (pytest.approx(0.8, rel=0.01), pytest.approx(0.4, rel=0.01))

    def test_an_open_pole_by_its_negative_sequence(self):
        U, U2 = np.ones(8000), np.zeros(8000)
        U[1000:6000], U2[1000:6000] = 0.63, 0.365
        [event] = find_happenings_of_record(self.record(U, U2))
        assert event.kind == "open pole"

    def test_a_jump_of_the_angle_is_the_area_under_the_frequency(self):
        U, f = np.ones(3000), np.full(3000, 50.0)
        U[1000:1200] = 0.7
        f[1000:1010] += 5.0  # 5 Hz for 10 ms: 18 degrees
        [event] = find_happenings_of_record(self.record(U, f=f))
        assert event.jump == pytest.approx(18.0, abs=1.0)

    @pytest.mark.parametrize("step", [1e-3, 5e-3, 20e-3])
    def test_kinds_at_any_rate(self, step):
        n = round(6 / step)
        t = np.arange(n) * step
        swell = np.where((t > 2) & (t < 2.5), 1.12, 1.0)
        tap = np.where(t > 2, 0.95, 1.0)
        for U, kind in ((swell, "swell"), (tap, "step")):
            assert [
                event.kind
                for event in find_happenings_of_record(self.record(U + noise(n, 5e-4), step=step))
            ] == [kind]


def test_the_two_dips_of_the_220_kv_station(shared_data):
    record = comtrade.load(shared_data / "dfr220kv-shandong" / "xtz.cfg")
    feeder = Feeder((4, 5, 6), (8, 9, 10), "three_phase")
    events = []
    for segment in record.waveforms():
        phasors = measure_phasors(record, feeder, segment)
        waves = FeederWaves.from_recording(record, feeder, segment)[:, :]
        events += find_happenings(trace_waves(waves, segment.rate, segment.start, 50.0, phasors))
    assert [(event.kind, event.worth) for event in events] == [("dip", True)] * 2
    assert [event.depth for event in events] == pytest.approx([0.131, 0.127], abs=0.003)


def test_the_pole_slip_of_the_110_kv_station(shared_data):
    record = comtrade.load(shared_data / "async110kv-wisp" / "async110.cfg")
    events = of(record, Feeder((0, 1, 2), (19, 20, 21), "three_phase"))
    assert {event.kind for event in events} == {"pole slip"}
    assert sum(event.end - event.start for event in events) > 14


class TestLoadsAndFuses:
    """What happens beside the network: the load, or what measures it."""

    def test_a_load_that_is_switched_off_is_an_event(self):
        t = grid(3.0)
        [event] = seen(t, phases(KV + 0 * t), load(KV + 0 * t) * np.where(t < 0.9, 1.0, 1e-4))
        assert (event.kind, event.worth) == ("load loss", False)
        assert event.start == pytest.approx(0.9, abs=0.015)
        assert event.before[0] == pytest.approx(3 * KV * KA * np.cos(np.pi / 6), rel=0.01)
        assert abs(event.after[0]) < 0.05

    @pytest.mark.parametrize("share", [0.5, 1.6])
    def test_part_of_a_load_is_a_step(self, share):
        t = grid(3.0)
        [event] = seen(t, phases(KV + 0 * t), load(KV + 0 * t) * np.where(t < 0.9, 1.0, share))
        assert event.kind == "load step"
        assert event.after[0] / event.before[0] == pytest.approx(share, rel=0.02)

    def test_the_powers_of_a_dip_are_those_between_the_steps_of_its_load(self):
        t = grid(3.0)
        V = KV * np.where((t >= 1.2) & (t < 1.4), 0.7, 1.0)
        factor = np.where(t < 0.9, 3.0, np.where(t < 1.7, 1.0, 0.0))
        events = seen(t, phases(V), load(V) * factor)
        assert [event.kind for event in events] == ["load step", "dip", "load loss"]
        P = 3 * KV * KA * np.cos(np.pi / 6)
        np.testing.assert_allclose([events[1].before[0], events[1].after[0]], P, rtol=0.01)

    @pytest.mark.parametrize(
        ("lost", "back"), [((0,), 9.0), ((1, 2), 9.0), ((0, 1, 2), 9.0), ((0, 1, 2), 1.7)]
    )
    def test_a_voltage_that_is_lost_while_the_currents_stay_is_a_fuse(self, lost, back):
        t = grid(3.0)
        left = np.ones((3, len(t)))
        left[list(lost)] = np.where((t < 0.8) | (t >= back), 1.0, 1e-3)
        [event] = seen(t, phases(KV + 0 * t) * left, load(KV + 0 * t))
        assert (event.kind, event.worth) == ("blown fuse", False)
        assert event.end == pytest.approx(min(back, 2.99), abs=0.03)
        assert "a fuse of the voltage transformers" in event.why

    def test_a_line_that_is_dead_with_its_current_is_no_fuse(self):
        t = grid(3.0)
        V = KV * np.where(t < 0.8, 1.0, 1e-4)
        [event] = seen(t, phases(V), load(V))
        assert event.kind == "dead line"
        assert event.end > 2.9

    def test_a_fault_of_one_phase_is_no_fuse(self):
        t = grid(3.0)
        fault = (t >= 0.8) & (t < 0.95)
        left = np.ones((3, len(t)))
        left[0, fault] = 0.05
        V = phases(KV + 0 * t) * left
        [event] = seen(
            t, V, load(KV + 0 * t) * np.where(fault, np.array([[0.3], [0.9], [1.1]]), 1.0)
        )
        assert event.kind == "dip"


def exponential(t, course, exponent):
    """Volts and amps (3, N) of powers that go with a course (N,) of the voltage to an exponent."""
    return phases(KV * course), load(KV * course ** (exponent - 1))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("exponent", [1.0, 1.6])
def test_a_tap_tells_the_exponents_of_the_static_part(seed, exponent):
    t = grid(4.0)
    [event] = seen(t, *exponential(t, np.where(t < 2.0, 1.0, 0.96), exponent), seed=seed)
    assert (event.kind, event.worth) == ("step", False)
    assert [each.channel for each in event.exponents] == ["P", "Q"]
    for each in event.exponents:
        assert each.value == pytest.approx(exponent, abs=0.1)
        assert each.low <= exponent + 0.05
        assert each.high >= exponent - 0.05
        assert each.high - each.low < 0.5
        assert each.explained > 0.9
    assert "worth fitting for the static part: P with U^" in event.why


@pytest.mark.parametrize("within", [0.001, 0.06])
@pytest.mark.parametrize("tap", [-0.015, 0.0125])
def test_one_tap_of_a_transformer_tells_them(tap, within):
    """A changer steps by 1.25 to 2.5 %, at once or through its resistors within three cycles."""
    t = grid(4.0)
    course = 1 + tap * np.clip((t - 2) / within, 0, 1)
    [event] = seen(t, *exponential(t, course, 1.6))
    assert (event.kind, event.worth) == ("step", False)
    assert event.depth == pytest.approx(-tap, abs=0.002)
    assert event.start == pytest.approx(2.0, abs=0.07)
    assert event.exponents[0].low < 1.6 < event.exponents[0].high


def test_a_load_that_steps_makes_no_tap_of_the_voltage_that_it_lowers():
    t = grid(4.0)
    more = np.where(t < 2, 1.0, 1.15)
    V, I = exponential(t, np.where(t < 2, 1.0, 0.985), 1.6)
    assert [event.kind for event in seen(t, V, I * more)] == []


def test_a_ramp_tells_them_too():
    t = grid(8.0)
    course = 1 - 0.1 * np.clip((t - 2) / 4, 0, 1)
    events = seen(t, *exponential(t, course, 1.4))
    assert {event.kind for event in events} == {"ramp"}
    assert events[0].exponents[0].value == pytest.approx(1.4, abs=0.1)


def test_what_shows_no_change_of_the_voltage_or_no_load_tells_no_exponent():
    t = grid(4.0)
    course = np.where(t < 2.0, 1.0, 0.96)
    [event] = seen(t, phases(KV * course), 0 * load(KV * course))
    assert event.exponents == ()
    assert "static part:" not in event.why
    [dip] = seen(t, *exponential(t, np.where((t > 2) & (t < 2.2), 0.6, 1.0), 1.0))
    assert dip.exponents == ()
