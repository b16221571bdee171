"""Which channels are phases or lines, in what order, in what direction: told while
they are alive.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from field_waves import KA, KV, dip, load, noise, phases, recording, wave

from tractexp.errors import UserError
from tractexp.recording import Feeder
from tractexp.recording.arrangement import arrange_feeder, tune_frequency
from tractexp.recording.measure import measure_phasors

T = np.arange(4800) / 3200
GIVEN = Feeder((0, 1, 2), (3, 4, 5), "three_phase")
PLAIN = ["x0 [kV]", "x1 [kV]", "x2 [kV]", "x3 [kA]", "x4 [kA]", "x5 [kA]"]  # names that say nothing
UNITS = ["kV"] * 3 + ["kA"] * 3


def made(volts, amps, names=PLAIN, seed=0, **more):
    waves = np.concatenate([wave(T, volts), wave(T, amps)])
    waves += noise(waves.shape, 0.001, seed) * np.abs(waves).max(axis=1, keepdims=True)
    return recording(waves, names=names, units=UNITS, **more)


def fault(share=0.3):
    """Positive, negative and zero sequence [kV] of a fault of phase a from 0.5 to 0.6 s."""
    during = (T >= 0.5) & (T < 0.6)
    return KV * (1 - share * during / 3), -KV * share * during / 3, -KV * share * during / 3


def power(record, feeder):
    seen = measure_phasors(record, feeder, record.segments[0])
    return complex(np.median(seen.S))


def test_what_is_right_is_left_as_it_is():
    record = made(phases(dip(T)), load(dip(T)), names=["Ua", "Ub", "Uc", "Ia", "Ib", "Ic"])
    assert arrange_feeder(record, GIVEN) == GIVEN


class TestLineVoltages:
    @pytest.mark.parametrize(
        "names",
        [
            ("UAB", "UBC", "UCA"),
            ("U12", "U23", "U31"),
            ("U21", "U32", "U13"),
            ("UL1L2", "UL2L3", "UL3L1"),
        ],
    )
    def test_are_recognised_by_their_labels(self, names):
        phase = phases(dip(T))
        record = made(
            phase - np.roll(phase, -1, axis=0), load(dip(T)), names=[*names, "Ia", "Ib", "Ic"]
        )
        found = arrange_feeder(record, GIVEN)
        assert found.connection == "line_voltages"
        assert "line to line, as their labels say" in found.why[0]
        assert ("U21 as V1 - V2" in found.why[0]) == ("U21" in names)
        assert power(record, found) == pytest.approx(
            power(made(phase, load(dip(T))), GIVEN), rel=0.002
        )

    def test_given_in_another_order_are_put_right(self):
        phase = phases(dip(T))
        lines = phase - np.roll(phase, -1, axis=0)
        record = made(lines[[1, 2, 0]], load(dip(T)), names=["UBC", "UCA", "UAB", "Ia", "Ib", "Ic"])
        assert arrange_feeder(record, GIVEN).voltages == (2, 0, 1)

    def test_add_up_to_zero_in_a_fault_to_earth(self):
        one, two, zero = fault()
        phase = phases(one, two, zero)
        amps = load(one, two) + phases(0, 0, -0.4 * KA * (two != 0))
        found = arrange_feeder(made(phase - np.roll(phase, -1, axis=0), amps), GIVEN)
        assert found.connection == "line_voltages"
        assert "add up to zero even in a fault to earth" in found.why[0]
        assert arrange_feeder(made(phase, amps), GIVEN).connection == "three_phase"

    def test_a_fault_between_lines_proves_nothing(self):
        one, two, _ = fault()
        found = arrange_feeder(made(phases(one, two), load(one, two)), GIVEN)
        assert found.connection == "three_phase"

    def test_sqrt_3_times_others_of_the_file(self):
        phase = phases(dip(T))
        waves = np.concatenate(
            [wave(T, x) for x in (phase - np.roll(phase, -1, axis=0), load(dip(T)), phase)]
        )
        record = recording(
            waves, names=[*PLAIN, "Ua", "Ub", "Uc"], units=[*UNITS, "kV", "kV", "kV"]
        )
        found = arrange_feeder(record, GIVEN)
        assert found.connection == "line_voltages"
        assert "sqrt 3 times" in found.why[0]

    def test_phases_are_not_taken_for_two_line_voltages(self):
        record = made(phases(dip(T)), load(dip(T)), names=["Ua", "Ub", "Uc", "Ia", "Ib", "Ic"])
        with pytest.raises(UserError, match=r"data.voltages=\[0, 1\].*'Ua' \[kV\], 1 'Ub'"):
            arrange_feeder(record, Feeder((0, 1), (3, 4, 5), "two_line_voltages"))


class TestFrequency:
    @pytest.mark.parametrize(
        ("declared", "real", "nominal"), [(60, 50.016, 50), (50, 59.93, 60), (50, 16.71, 50 / 3)]
    )
    def test_declared_wrongly_is_measured(self, declared, real, nominal):
        waves = np.concatenate([wave(T, phases(dip(T)), real), wave(T, load(dip(T)), real)])
        found = tune_frequency(recording(waves, frequency=declared), (0, 1, 2))
        assert found.frequency == pytest.approx(nominal)
        assert f"declares {declared} Hz, but the voltage has {real:.3g}"[:40] in found.notes[-1]

    @pytest.mark.parametrize("real", [48.3, 50.0, 51.6])
    def test_a_network_that_strays_keeps_its_nominal_frequency(self, real):
        record = recording(wave(T, phases(dip(T)), real))
        assert tune_frequency(record, (0, 1, 2)) is record

    def test_is_told_from_the_part_that_is_alive(self):
        alive = np.where(T < 0.4, 1.0, 1e-4)
        record = recording(
            wave(T, phases(KV * alive), 50.02) + noise((3, len(T)), 0.05), frequency=60.0
        )
        assert tune_frequency(record, (0, 1, 2)).frequency == 50.0


class TestOrder:
    def test_labels_that_disagree_are_refused_with_both_powers(self):
        record = made(phases(dip(T)), load(dip(T)), names=["Ua", "Ub", "Uc", "Ia", "Ib", "Ic"])
        says = (
            r"data.currents are the phases B, C, A where data.voltages are A, B, C,"
            r" .*data.currents=\[3, 4, 5\], "
        )
        with pytest.raises(
            UserError, match=says + r"which gives P = 33 MW, Q = 19.1 Mvar where .* P = -33 MW"
        ):
            arrange_feeder(record, replace(GIVEN, currents=(4, 5, 3)))

    @pytest.mark.parametrize("turned", [(1, 2, 0), (2, 0, 1)])
    def test_rotated_currents_without_labels_are_refused_with_the_order_that_makes_sense(
        self, turned
    ):
        record = made(phases(dip(T)), load(dip(T), lag=-0.07)[[*turned]])
        right = [3 + turned.index(k) for k in range(3)]
        with pytest.raises(
            UserError,
            match=rf"P and Q make no sense .* data.currents={re.escape(str(right))} gives P = ",
        ):
            arrange_feeder(record, GIVEN)
        arrange_feeder(record, replace(GIVEN, currents=tuple(right)))

    @pytest.mark.parametrize("turned", [(1, 0, 2), (0, 2, 1), (2, 1, 0)])
    def test_swapped_currents_are_refused(self, turned):
        record = made(phases(dip(T)), load(dip(T))[[*turned]])
        right = [3 + turned.index(k) for k in range(3)]
        with pytest.raises(
            UserError,
            match=rf"two are swapped; data.currents={re.escape(str(right))} gives P = 33 MW",
        ):
            arrange_feeder(record, GIVEN)

    def test_voltages_in_the_other_order_are_refused(self):
        record = made(phases(dip(T)), load(dip(T)))
        with pytest.raises(
            UserError,
            match=r"not in the order a, b, c.* data.voltages=\[0, 1, 2\] data.currents=\[3, 4, 5\]",
        ):
            arrange_feeder(record, Feeder((1, 0, 2), (4, 3, 5), "three_phase"))

    @pytest.mark.parametrize("side", ["voltages", "currents"])
    def test_one_transformer_of_opposite_polarity_is_named(self, side):
        sign = np.array([1, -1, 1])[:, None]
        volts, amps = phases(dip(T)), load(dip(T))
        record = made(volts * sign, amps) if side == "voltages" else made(volts, amps * sign)
        number = 1 if side == "voltages" else 4
        with pytest.raises(
            UserError,
            match=rf"data.{side}=.* channel {number} 'x{number} .* has the opposite polarity",
        ):
            arrange_feeder(record, GIVEN)

    @pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
    def test_a_line_that_is_dead_after_the_trip_keeps_its_order(self, order):
        # less than a quarter of the record; then nothing but noise
        alive = np.where(T < 0.3, 1.0, 0.0)
        record = made(phases(KV * alive, 0.01 * KV), load(KV * np.maximum(alive, 1e-6)) * alive)
        given = Feeder(order, tuple(3 + k for k in order), "three_phase")
        assert arrange_feeder(record, given).voltages == order

    @pytest.mark.parametrize("share", [0.05, 0.38])
    @pytest.mark.parametrize("end", [0.5, 9.0])
    def test_a_fault_behind_the_transformers_is_judged_by_the_calm(self, share, end):
        volts, amps = phases(np.full(len(T), KV)), load(np.full(len(T), KV))
        fault = (T > 0.1) & (end > T)
        volts[1, fault] *= share
        amps[1, fault] *= 60
        assert arrange_feeder(made(volts, amps), GIVEN).voltages == (0, 1, 2)

    def test_a_dead_recording_says_that_nothing_can_be_checked(self):
        record = recording(np.zeros((6, 4800)), names=PLAIN, units=UNITS)
        assert "nothing is alive" in arrange_feeder(record, GIVEN).why[-1]

    def test_a_load_of_one_phase_is_not_refused(self):
        amps = np.zeros((3, len(T)), complex)
        amps[0], amps[1] = (current := KA * np.exp(-0.4j) * np.ones(len(T))), -current
        assert arrange_feeder(made(phases(dip(T)), amps), GIVEN).voltages == (0, 1, 2)

    @pytest.mark.parametrize("lag", [90, -90, 60, -60, 20])
    def test_reactors_capacitors_and_compensated_loads_are_not_refused(self, lag):
        arrange_feeder(made(phases(dip(T)), load(dip(T), lag=np.deg2rad(lag))), GIVEN)


class TestDirection:
    def test_a_reversed_transformer_is_told_from_the_answer_to_the_voltage(self):
        found = arrange_feeder(made(phases(dip(T)), -load(dip(T), exponent=1.6)), GIVEN)
        assert "data.reverse_current=true" in found.why[-1]
        assert "|P| goes as U^1.6 when the voltage falls, as a load's" in found.why[-1]
        assert (
            arrange_feeder(
                made(phases(dip(T)), -load(dip(T))), replace(GIVEN, reverse_current=True)
            ).why
            == ()
        )

    def test_a_braking_train_keeps_its_power(self):
        amps = load(dip(T), lag=np.pi, exponent=0.0)
        found = arrange_feeder(made(phases(dip(T)), amps), GIVEN)
        assert "regeneration (a braking train)" in found.why[-1]

    def test_constant_current_at_unity_is_left_open(self):
        found = arrange_feeder(made(phases(dip(T)), load(dip(T), lag=np.pi, exponent=1.0)), GIVEN)
        assert "cannot separate a reversed current" in found.why[-1]

    def test_a_train_that_brakes_and_motors_has_both_signs(self):
        sign = np.where((T > 0.8) & (T < 1.1), 1.0, -1.0)
        found = arrange_feeder(made(phases(dip(T)), sign * load(dip(T), lag=0.05)), GIVEN)
        assert "power flows both ways" in found.why[-1]

    @pytest.mark.parametrize(
        ("sign", "says"),
        [(1, "direction is right and this is regeneration"), (-1, "that of a load turned round")],
    )
    def test_the_negative_sequence_tells_whatever_power_does(self, sign, says):
        one, two, _ = fault()
        back = (
            phases(-KA * one / KV * np.exp(-0.1j))
            if sign > 0
            else -phases(KA * one / KV * np.exp(-0.1j))
        )
        passive = phases(0, 2.0 * KA * two / KV * np.exp(-1.2j))
        found = arrange_feeder(made(phases(one, two), back + sign * passive), GIVEN)
        assert says in found.why[-1]

    def test_the_state_before_a_long_open_pole_counts(self):
        volts, amps = phases(np.full(len(T), KV)), -load(np.full(len(T), KV))
        for x in (volts, amps):
            x[1, T > 0.4] *= 0.001
        found = arrange_feeder(made(volts, amps), GIVEN)
        assert found.why[-1].startswith("P = -33 MW, Q = -19.1 Mvar: ")

    def test_nothing_is_said_of_noise(self):
        assert (
            arrange_feeder(
                made(phases(dip(T)), 1e-9 * load(dip(T)) + noise((3, len(T)), 0.01)), GIVEN
            ).why
            == ()
        )

    def test_a_single_phase_feeder_has_a_direction_too(self):
        waves = [wave(T, phases(dip(T)))[0], -wave(T, load(dip(T)))[0]]
        record = recording(waves, names=["U", "I"], units=["kV", "kA"])
        assert (
            "data.reverse_current=true"
            in arrange_feeder(record, Feeder((0,), (1,), "single_phase")).why[-1]
        )
