"""Feeders proposed from channels of any number: by names, by angles, by buses, by
Kirchhoff's law.
"""

import numpy as np
import pytest
from field_waves import KA, dip, load, noise, phases, recording, wave

import tractexp
from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.recording.label import find_label_groups, order
from tractexp.recording.measure import measure_phasors
from tractexp.recording.proposal import propose
from tractexp.recording.recording import Channel

T = np.arange(3200) / 3200
V = wave(T, phases(dip(T)))
I = wave(T, load(dip(T)))
NAMES = {
    6: ["Uab", "Ubc", "Uca", "Ia", "Ib", "Ic"],
    5: ["Uab", "Ubc", "Ia", "Ib", "Ic"],
    4: ["Uab", "Ubc", "Ia", "Ic"],
}


@pytest.mark.parametrize(
    ("volts", "amps"),
    [
        (("Ua", "Ub", "Uc"), ("Ia", "Ib", "Ic")),
        (("UL1", "UL2", "UL3"), ("IL1", "IL2", "IL3")),
        (("VR", "VS", "VT"), ("IR", "IS", "IT")),
        (("U_U", "U_V", "U_W"), ("I_U", "I_V", "I_W")),
        (("U1", "U2", "U3"), ("I1", "I2", "I3")),
        (("F5-VA", "F6-VB", "F7-VC"), ("F1-IA", "F2-IB", "F3-IC")),
        (("1-Ua", "2-Ub", "3-Uc"), ("4-Ia", "5-Ib", "6-Ic")),
        (
            ("Ua_1СШ-110", "Ub_1СШ-110", "Uc_1СШ-110"),
            ("Ia_1СШ-110_ВЛ3", "Ib_1СШ-110_ВЛ3", "Ic_1СШ-110_ВЛ3"),
        ),
        (("Uа", "Uв", "Uс"), ("Iа", "Iв", "Iс")),  # Cyrillic letters
        (("1号母线Ua", "1号母线Ub", "1号母线Uc"), ("馈线3_Ia", "馈线3_Ib", "馈线3_Ic")),
        (("BUS 2 Van", "BUS 2 Vbn", "BUS 2 Vcn"), ("LINE Ia [A]", "LINE Ib [A]", "LINE Ic [A]")),
        (("A相电压", "B相电压", "C相电压"), ("A相电流", "B相电流", "C相电流")),
        (("UA(kV)", "UB(kV)", "UC(kV)"), ("IA(A)", "IB(A)", "IC(A)")),
        (
            ("Phase A Voltage", "Phase B Voltage", "Phase C Voltage"),
            ("Phase A Current", "Phase B Current", "Phase C Current"),
        ),
        (("U_L1-N", "U_L2-N", "U_L3-N"), ("I_L1", "I_L2", "I_L3")),
        (("PT1_VA", "PT1_VB", "PT1_VC"), ("CT3_IA", "CT3_IB", "CT3_IC")),
        (("u_a", "u_b", "u_c"), ("i_a", "i_b", "i_c")),
        (("Фаза A U", "Фаза B U", "Фаза C U"), ("Фаза A I", "Фаза B I", "Фаза C I")),
        (("ch0", "ch1", "ch2"), ("ch3", "ch4", "ch5")),  # nothing but angles
    ],
)
def test_three_phases_are_found_whatever_they_are_called(volts, amps):
    made = recording(np.concatenate([V, I]), names=[*volts, *amps], units=["kV"] * 3 + ["kA"] * 3)
    [feeder] = propose(made)
    assert (feeder.voltages, feeder.currents, feeder.connection) == (
        (0, 1, 2),
        (3, 4, 5),
        "three_phase",
    )
    assert feeder.loaded


def test_channels_in_any_order_are_put_in_that_of_their_phases():
    waves = [I[2], V[1], I[0], V[2], V[0], I[1]]
    [feeder] = propose(recording(waves, names=["Ic", "Ub", "Ia", "Uc", "Ua", "Ib"]))
    assert (feeder.voltages, feeder.currents) == ((4, 1, 3), (2, 5, 0))


def test_phases_belong_together_though_one_lacks_a_number():
    names = ["12-Ia", "13-Ib", "Ic"]
    (found,) = find_label_groups(
        {k: Channel(name, np.zeros(1), "A") for k, name in enumerate(names)}
    )
    assert found.numbers == (0, 1, 2)
    assert found.name == ""


def test_channels_without_names_are_put_in_the_order_of_their_angles():
    waves = [V[0], V[2], V[1], *I]
    [feeder] = propose(
        recording(waves, names=[f"ch{k}" for k in range(6)], units=["kV"] * 3 + ["kA"] * 3)
    )
    assert feeder.voltages == (0, 2, 1)


@pytest.mark.parametrize("name", ["3U0", "VN", "Un", "3Uo_1СШ", "零序电压", "Vo"])
def test_residual_voltages_are_left_out(name):
    zero = wave(T, np.full((1, len(T)), 2.0 + 0j))
    made = recording(
        [*V, *zero, *I],
        names=["Ua", "Ub", "Uc", name, "Ia", "Ib", "Ic"],
        units=["kV"] * 4 + ["kA"] * 3,
    )
    [feeder] = propose(made)
    assert (feeder.voltages, feeder.currents) == ((0, 1, 2), (4, 5, 6))


def test_direct_voltages_and_what_is_no_wave_are_no_phases():
    constant = [np.full(len(T), 0.22) + noise(len(T), 1e-4, k) for k in range(3)]
    names = ["U1", "U2", "U3", "VA", "VB", "VC", "IA", "IB", "IC"]
    made = recording([*constant, *V, *I], names=names)
    assert [f.voltages for f in propose(made) if f.loaded] == [(3, 4, 5)]


def test_each_feeder_has_the_voltages_of_its_own_bus():
    other = wave(T, phases(0.97 * dip(T, depth=0.2)))
    names = [f"{q}{p}_{b}СШ" for b in (1, 2) for q in "U" for p in "abc"]
    names += [f"I{p}_{b}СШ_Л{k}" for b, k in ((2, 1), (1, 2)) for p in "abc"]
    first, second = propose(recording([*V, *other, *I, *I], names=names))
    assert (first.voltages, second.voltages) == ((3, 4, 5), (0, 1, 2))
    assert "share" in first.why[1]


def test_where_names_do_not_tell_the_bus_the_currents_do():
    other = dip(T, start=0.2, end=0.3, depth=0.3)
    names = [
        "Ua north",
        "Ub north",
        "Uc north",
        "Ua south",
        "Ub south",
        "Uc south",
        "Ia X",
        "Ib X",
        "Ic X",
    ]
    [feeder] = propose(recording([*V, *wave(T, phases(other)), *wave(T, load(other))], names=names))
    assert feeder.voltages == (3, 4, 5)
    assert "follow these voltages best" in feeder.why[1]


class TestWhichVoltages:
    NAMES = (*(f"{bus} U{p}" for bus in ("W1", "W2") for p in "abc"), "Ia", "Ib", "Ic")

    def two(self, other, current=I, names=NAMES):
        units = ["kV"] * 6 + ["kA"] * 3
        return propose(recording([*V, *other, *current], names=names, units=units))

    @pytest.mark.parametrize("dead", [noise((3, len(T)), 1e-4), 5e-4 * V, np.zeros_like(V)])
    def test_a_load_has_no_dead_voltages_whatever_their_name(self, dead):
        names = [
            *(f"bus U{p}" for p in "abc"),
            *(f"QF2 U{p}" for p in "abc"),
            *(f"QF1 I{p}" for p in "abc"),
        ]
        (feeder,) = self.two(dead, names=names)
        assert (feeder.voltages, feeder.loaded) == ((0, 1, 2), True)
        assert "the only ones alive" in feeder.why[1]

    @pytest.mark.parametrize("turn", [0.0, np.pi / 6])
    def test_both_sides_of_a_transformer_are_asked_for_with_their_powers(self, turn):
        found = self.two(wave(T, phases(0.25 * dip(T) * np.exp(1j * turn))))
        assert [(f.voltages, f.currents, f.loaded) for f in found] == [
            ((0, 1, 2), (6, 7, 8), True), ((3, 4, 5), (6, 7, 8), True),
        ]  # fmt: skip
        assert found[0].question == found[1].question
        assert "110 kV, P = 33 MW, Q = 19.05 Mvar" in found[0].question
        assert "27.5 kV, P = " in found[0].question
        assert len({f.name for f in found}) == 2

    def test_a_bus_that_the_currents_follow_is_taken_though_two_others_have_names_more_alike(self):
        other = wave(T, phases(0.02 * dip(T, start=0.2, end=0.3)))
        names = [f"{bus} U{p}" for bus in ("main", "QF2 out", "QF3 out") for p in "abc"] + [
            f"QF1 out I{p}" for p in "abc"
        ]
        waves = [*V, *other, *(1.2 * other), *I]
        (feeder,) = propose(recording(waves, names=names, units=["kV"] * 9 + ["kA"] * 3))
        assert feeder.voltages == (0, 1, 2)

    def test_where_names_say_nothing_every_bus_that_the_currents_may_follow_is_a_candidate(self):
        volts = [f"{bus} U{p}" for bus in ("main", "QF2 out", "QF3 out") for p in "abc"]
        names = [*volts, *(f"QF1 out I{p}" for p in "abc")]
        waves = [*V, *(0.01 * V), *(0.008 * np.roll(V, 1, axis=0)), *I]
        found = propose(recording(waves, names=names, units=["kV"] * 9 + ["kA"] * 3))
        assert {f.voltages for f in found} == {(0, 1, 2), (3, 4, 5), (6, 7, 8)}
        assert "110 kV, P = 33 MW" in found[0].question

    def test_names_that_say_it_are_believed(self):
        names = [
            *(f"{side} U{p}" for side in ("HV", "LV") for p in "abc"),
            *(f"LV I{p}" for p in "abc"),
        ]
        (feeder,) = self.two(wave(T, phases(0.25 * dip(T))), names=names)
        assert (feeder.voltages, feeder.question) == ((3, 4, 5), "")

    def test_two_transformers_on_one_bus_are_no_question(self):
        (feeder,) = self.two(1.001 * V)
        assert (feeder.voltages, feeder.question) == ((0, 1, 2), "")


@pytest.mark.parametrize(
    "names",
    [
        ("HCSA", "HCSB", "HCSC", "HCSA  -HVS1A", "HCSB  -HVS1B", "HCSC  -HVS1C"),
        ("BUSA1", "BUSB1", "BUSC1", "LOADA1", "LOADB1", "LOADC1"),
        ("UA1-UA2", "UB1-UB2", "UC1-UC2", "IA1-IA2", "IB1-IB2", "IC1-IC2"),
        ("NodeR", "NodeS", "NodeT", "NodeR:LoadR", "NodeS:LoadS", "NodeT:LoadT"),
    ],
)
def test_marks_may_stand_after_a_word_before_a_digit_and_twice(names):
    uneven = I * np.array([1, 1.2, 0.7])[:, None]  # which equal sizes do not show
    turn = [0, 2, 1, 3, 5, 4]
    (feeder,) = propose(recording([*V, *uneven], names=names, units=["kV"] * 3 + ["kA"] * 3))
    assert (feeder.voltages, feeder.currents) == ((0, 1, 2), (3, 4, 5))
    (feeder,) = propose(
        recording(
            np.array([*V, *uneven])[turn],
            names=[names[i] for i in turn],
            units=["kV"] * 3 + ["kA"] * 3,
        )
    )
    assert (feeder.voltages, feeder.currents) == ((0, 2, 1), (3, 5, 4))
    assert order([Channel(name, np.zeros(3)) for name in names[3:]]) == ((0, 1, 2), False)


def test_two_control_signals_are_no_load():
    signals = np.array([0.3 * I[1], 0.3 * I[2]])
    names = ["Ua", "Ub", "Uc", "Ia", "Ib", "Ic", "ctrl V", "ctrl W"]
    (feeder,) = propose(recording([*V, *I, *signals], names=names, units=["kV"] * 3 + ["kA"] * 5))
    assert feeder.currents == (3, 4, 5)


def test_line_voltages_and_two_of_them_and_two_transformers():
    lines = V - np.roll(V, -1, axis=0)
    [three] = propose(recording([*lines, *I], names=["UAB", "UBC", "UCA", "IA", "IB", "IC"]))
    assert (three.connection, three.voltages) == ("line_voltages", (0, 1, 2))
    [two] = propose(recording([*lines[:2], *I], names=["U21", "U32", "I1", "I2", "I3"]))
    assert (two.connection, two.voltages) == ("two_line_voltages", (0, 1))
    [other] = propose(recording([lines[0], lines[2], *I], names=["UAB", "UCA", "IA", "IB", "IC"]))
    assert other.connection == {"name": "two_line_voltages", "pairs": ["ab", "ca"]}
    [aron] = propose(recording([*V, I[0], I[2]], names=["Ua", "Ub", "Uc", "Ia", "Ic"]))
    assert (aron.connection, aron.currents) == ("aron", (3, 4))
    [both] = propose(recording([*lines[:2], I[0], I[2]], names=["Uab", "Ubc", "Ia", "Ic"]))
    assert both.connection == {"name": "two_line_voltages", "phases": "ac"}
    whole = measure_phasors(made := recording([*V, *I]), propose(made)[0], made.segments[0])
    for feeder, waves in (
        (three, [*lines, *I]),
        (two, [*lines[:2], *I]),
        (both, [*lines[:2], I[0], I[2]]),
    ):
        seen = measure_phasors(recording(waves, names=NAMES[len(waves)]), feeder, made.segments[0])
        np.testing.assert_allclose(seen.S, whole.S, rtol=1e-6)


def test_a_phase_column_of_numbers_says_nothing():
    lines = V - np.roll(V, -1, axis=0)
    names, labels = ["I1", "I2", "I3", "U21", "U32", "Vo"], ["7", "8", "9", "0", "1", "6"]
    [feeder] = propose(recording([*I, *lines[:2], 0 * V[0]], names=names, labels=labels))
    assert (feeder.voltages, feeder.currents, feeder.connection) == (
        (3, 4),
        (0, 1, 2),
        "two_line_voltages",
    )


def test_one_voltage_and_one_current_are_a_single_phase_feeder():
    made = recording([V[0], I[0]], names=["U contact line", "I feeder 212"])
    [feeder] = propose(made)
    assert (feeder.voltages, feeder.currents, feeder.connection) == ((0,), (1,), "single_phase")


@pytest.mark.parametrize(
    "names",
    [
        ("Ua", "Ub", "Ia", "Ib"),
        ("27.5kV Uα", "27.5kV Uβ", "α馈线I", "β馈线I"),
        ("arm 1 U", "arm 2 U", "arm 1 I", "arm 2 I"),
    ],
)
def test_the_two_arms_of_a_traction_substation_are_two_feeders(names):
    found = propose(
        recording([V[0], V[1], I[0], I[1]], names=names, units=["kV", "kV", "kA", "kA"])
    )
    assert [(f.voltages, f.currents, f.connection) for f in found] == [
        ((0,), (2,), "single_phase"),
        ((1,), (3,), "single_phase"),
    ]


def station(reverse=(), tie=False):
    """Two loads and an infeed that feeds both, names by bay."""
    one, two = wave(T, load(dip(T))), 0.6 * wave(T, load(dip(T), lag=0.2))
    bays = {"T1": one, "T2": two, "L1": -(one + two)}
    if tie:
        bays["tie"] = 0.3 * one
    waves, names = [*V], ["Ua", "Ub", "Uc"]
    for bay, each in bays.items():
        waves += list((-1 if bay in reverse else 1) * each + KA * noise((3, len(T)), 0.001))
        names += [f"{bay} Ia", f"{bay} Ib", f"{bay} Ic"]
    return {f.name: f for f in propose(recording(waves, names=names))}


def test_currents_of_a_bus_add_up_to_nothing():
    found = station()
    assert all("the currents of 3 feeders add up to 0." in f.why[-1] for f in found.values())
    assert not any(f.reverse_current for f in found.values())


def test_a_bus_tie_is_left_out_of_the_sum():
    found = station(tie=True)
    assert "without tie: a bus tie, or one of another bus" in found["tie"].why[-1]
    assert {name: f.loaded for name, f in found.items()} == {
        "T1": True,
        "T2": True,
        "L1": True,
        "tie": False,
    }


@pytest.mark.parametrize("name", ["Bus coupler", "220kV母联", "ШСВ-220", "Sectionalizer 1"])
def test_what_is_called_a_bus_coupler_is_no_load(name):
    one = wave(T, load(dip(T)))
    names = ["Ua", "Ub", "Uc", *(f"{bay} I{p}" for bay in ("T1", name) for p in "abc")]
    waves = [*V, *(one + KA * noise((3, len(T)), 0.001)), *(0.5 * one)]
    found = propose(recording(waves, names=names))
    assert [f.loaded for f in found] == [True, False]
    assert "a bus coupler" in found[1].why[-1]


def test_the_load_of_the_greatest_active_power_is_recommended():
    from tractexp.report import look_console

    def entry(name, P, Q):
        event = {
            "kind": "dip",
            "dip": 1,
            "start": 1.0,
            "duration": 0.2,
            "depth": 0.3,
            "worth": True,
            "why": "",
            "P_after": P,
            "Q_after": Q,
        }
        return {"name": name, "why": [], "events": [event], "command": f"fit {name}"}

    feeders = [entry("cable", 1.0, -98.0), entry("load", 20.0, 8.0), entry("aside", 5.0, 2.0)]
    assert "fit load" in look_console._answer([{"feeders": feeders}])


def test_a_transformer_whose_polarity_is_reversed_is_found_by_the_sum():
    found = station(reverse=("T2",), tie=False)
    assert {name: f.reverse_current for name, f in found.items()} == {
        "T1": False,
        "T2": True,
        "L1": False,
    }


def test_unloaded_feeders_come_last_and_say_so():
    names = ["Ua", "Ub", "Uc", *(f"{bay} I{p}" for bay in ("spare", "used") for p in "abc")]
    used, spare = propose(
        recording([*V, *(1e-3 * I), *I], names=names, units=["kV"] * 3 + ["kA"] * 6)
    )
    assert (used.currents, used.loaded) == ((6, 7, 8), True)
    assert (spare.currents, spare.loaded) == ((3, 4, 5), False)
    assert "unloaded" in spare.why[-1]


@pytest.mark.parametrize("volts", [np.zeros_like(V), V[[0, 0, 0]], 1e-3 * noise(V.shape, 1.0)])
def test_voltages_that_are_dead_or_no_three_phases_are_no_load(volts):
    [feeder] = propose(recording([*volts, *I]))
    assert not feeder.loaded
    assert "the line is dead" in feeder.why[-1]


def test_a_machine_that_runs_free_has_no_networks_frequency():
    [feeder] = propose(recording([*wave(T, phases(dip(T)), 79.2), *(1e-5 * I)]))
    assert not feeder.loaded
    assert "the voltages have 79.2 Hz, which is no network's" in feeder.why[-1]


def test_nothing_to_propose_is_no_error():
    assert propose(recording(V)) == []
    assert propose(recording(np.zeros((6, 3)))) == []
    flat = propose(recording(np.zeros((6, 3200))))
    assert not any(f.loaded for f in flat)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("Ib", "Ic", "Ia"), ((1, 2, 0), False)),
        (("IL3", "IL1", "IL2"), ((2, 0, 1), False)),
        (("UBC", "UCA", "UAB"), ((1, 2, 0), True)),
        (("U12", "U23", "U31"), ((0, 1, 2), True)),
        (("left", "right", "middle"), None),
    ],
)
def test_the_order_that_labels_say(names, told):
    assert order([Channel(name, np.zeros(1)) for name in names]) == told


def test_the_transformers_of_the_220_kv_station(shared_data):
    found = propose(comtrade.load(shared_data / "dfr220kv-shandong" / "xtz.cfg"))
    by_currents = {f.currents: f for f in found}
    assert by_currents[8, 9, 10].voltages == (4, 5, 6)
    assert by_currents[16, 17, 18].voltages == (0, 1, 2)
    assert "the currents of 6 feeders add up to 0.1" in by_currents[8, 9, 10].why[-1]
    # the bus coupler, and a line without load
    assert [f.loaded for f in found] == [True] * 6 + [False] * 2
    assert "a bus coupler, as its name says" in by_currents[24, 25, 26].why[-1]


def test_the_feeders_of_the_110_kv_station(shared_data):
    found = {
        f.currents: f
        for f in propose(comtrade.load(shared_data / "async110kv-wisp" / "async110.cfg"))
    }
    assert len(found) == 11
    # AT1, as is known of the file
    assert [names for names, f in found.items() if f.reverse_current] == [(39, 40, 41)]
    assert (
        "the currents of 5 feeders add up to 1.7 % of their magnitudes once this"
        in found[39, 40, 41].why[-1]
    )
    assert found[15, 16, 17].voltages == (4, 5, 6)
    assert found[19, 20, 21].voltages == (0, 1, 2)
    assert not found[23, 24, 25].loaded


def test_a_reader_asks_which_voltages_a_load_has(tmp_path):
    whole = recording(
        [*V, *wave(T, phases(0.25 * dip(T))), *I],
        names=TestWhichVoltages.NAMES,
        units=["kV"] * 6 + ["kA"] * 3,
    )
    comtrade.write(whole, tmp_path / "sides.cfg", "ASCII", 1999)
    with pytest.raises(
        UserError, match=r"cannot be told: .*110 kV, P = 33.* or .*27.5 kV, P = .*choose one: "
    ):
        tractexp.read(tmp_path / "sides.cfg")
    assert len(tractexp.look(tmp_path / "sides.cfg").feeders) == 2
