"""What the loads of one bus say of each other: both sides of a transformer, currents counted
backward, infeeds.
"""

import numpy as np
import pytest
from test_field_kinds import RATE, TURN, look, waves, written

TIMES = np.arange(0, 2, 1 / RATE)
FALL = np.where((TIMES >= 1) & (TIMES < 1.25), 0.7, 1.0)


def voltages(kilovolts=110.0):
    return kilovolts / np.sqrt(3) * FALL * TURN


def currents(P, Q, kilovolts=110.0, exponent=1.5):
    """[kA] of a load of P ~ U^exponent MW and Q ~ U^2 Mvar."""
    S = P * FALL**exponent + 1j * Q * FALL**2
    return np.conj(S / 3 / voltages(kilovolts)[0]) * TURN


def station(tmp_path, *groups):
    """What a look says of channels: (name before the phase, phasors (3, N))."""
    rows = []
    for k, (name, phasors) in enumerate(groups):
        unit = "kV" if name.startswith("U") else "kA"
        rows += [
            (f"{name}{p}", unit, x)
            for p, x in zip("ABC", waves(phasors, TIMES, seed=k), strict=True)
        ]
    seen, first = look(written(tmp_path, TIMES, rows))
    return {load["name"]: load for load in seen.feeders.rows}, first, str(seen.summary())


class TestBothSidesOfATransformer:
    @pytest.mark.parametrize(
        ("high", "low"),
        [("HV I", "LV I"), ("I_high ", "I_low "), ("I 110kV ", "I 10.5kV "), ("高压I", "低压I")],
    )
    def test_the_side_of_the_voltage_is_the_load(self, tmp_path, high, low):
        one = currents(20, 8)
        for kilovolts, mine in ((110.0, 0), (10.5, 1)):
            loads, first, page = station(
                tmp_path, ("U ", voltages(kilovolts)), (high, one), (low, 110 / 10.5 * one)
            )
            loaded = [name for name, load in loads.items() if load["loaded"]]
            [other] = loads.keys() - {*loaded}
            assert len(loaded) == 1
            assert loads[loaded[0]]["P"] == pytest.approx(20, rel=0.01)
            assert f"of {loaded[0]} is worth fitting" in first
            assert f"{other}: no load here: the same current as that of {loaded[0]}" in page
            assert loads[loaded[0]]["currents"][0] == 3 + 3 * mine

    def test_a_turn_of_a_vector_group_tells_it_without_names(self, tmp_path):
        one = currents(20, 8)
        other = 110 / 10.5 * one * np.exp(-1j * np.pi / 6)
        loads, _, _ = station(tmp_path, ("U ", voltages()), ("I1", one), ("I2", other))
        assert [load["loaded"] for load in loads.values()] == [True, False]
        assert loads["I1"]["P"] == pytest.approx(20, rel=0.01)

    @pytest.mark.parametrize("turn", [1, -1])
    def test_windings_that_carry_one_current_need_no_turn(self, tmp_path, turn):
        one = currents(20, 8)
        groups = ("T1W1 I", one), ("T1W2 I", turn * 110 / 20 * one)
        loads, first, page = station(tmp_path, ("U ", voltages()), *groups)
        assert [load["loaded"] for load in loads.values()] == [True, False]
        assert "of T1W1 is worth fitting" in first
        assert "T1W2: no load here: the same current as that of T1W1 times 5.5" in page

    def test_the_only_two_currents_that_are_one_may_be_one_load(self, tmp_path):
        one = currents(20, 8)
        groups = ("CT1 I", one), ("CT2 I", 110 / 20 * one)
        _, first, page = station(tmp_path, ("U ", voltages()), *groups)
        assert "of CT1 is worth fitting" in first
        said = (
            "CT2: at all times the same current as that of CT1 times 5.5: a load just like it, or"
        )
        assert said in " ".join(page.split())

    def test_three_feeders_of_like_loads_are_three(self, tmp_path):
        groups = [(f"CT{k} I", currents(10 * k, 4 * k)) for k in (1, 2, 4)]
        loads, _, _ = station(tmp_path, ("U ", voltages()), *groups)
        assert all(load["loaded"] for load in loads.values())

    def test_two_feeders_of_like_loads_are_two(self, tmp_path):
        groups = ("F1 I", currents(40, 16)), ("F2 I", currents(10, 4))
        loads, _, page = station(tmp_path, ("U ", voltages()), *groups)
        assert all(load["loaded"] for load in loads.values())
        assert "same current" not in page

    def test_two_loads_at_sides_that_differ_are_two(self, tmp_path):
        groups = ("HV I", currents(20, 8)), ("LV I", currents(90, 30, exponent=0.2))
        loads, _, _ = station(tmp_path, ("U ", voltages()), *groups)
        assert all(load["loaded"] for load in loads.values())


class TestNegativePower:
    bus = (("U ", voltages()), ("F1 I", currents(20, 8)), ("F2 I", currents(12, 5)))

    def test_a_transformer_that_points_backward_is_said_with_the_setting(self, tmp_path):
        loads, _, page = station(tmp_path, *self.bus, ("F3 I", -currents(4, 1.5)))
        said = (
            "P of F3 is negative: it falls with the voltage as a load's, while F1, F2 draw: its"
            " current transformer points backward (data.reverse_current=true turns it round)"
        )
        assert loads["F3"]["said"] == [said]
        assert said in " ".join(page.split())

    def test_a_sum_that_is_nearly_zero_by_accident_turns_nothing_round(self, tmp_path):
        groups = ("F1 I", currents(20, 8)), ("F2 I", currents(12, 5)), ("F3 I", -currents(9, 3))
        loads, _, _ = station(tmp_path, ("U ", voltages()), *groups)
        assert not any(load["reverse_current"] for load in loads.values())
        assert loads["F2"]["P"] == pytest.approx(12, rel=0.01)

    @pytest.mark.parametrize("own", [-currents(32, 13), -currents(36, 14.5)])
    def test_what_feeds_the_bus_is_not_to_be_turned(self, tmp_path, own):
        loads, _, page = station(tmp_path, *self.bus, ("T1 I", own))
        assert loads["T1"]["said"] == [
            "P of T1 is negative: it feeds what the others of its bus draw (F1, F2)"
        ]
        assert "reverse_current" not in page

    def test_generation_is_not_to_be_turned(self, tmp_path):
        own = currents(-15, 0, exponent=0.02)
        loads, _, page = station(tmp_path, *self.bus, ("PV I", own))
        assert "no reversed current" in loads["PV"]["why"][-1]
        assert "reverse_current" not in page

    def test_a_load_alone_says_what_its_answer_shows(self, tmp_path):
        _, first, _ = station(tmp_path, ("U ", voltages()), ("F3 I", -currents(4, 1.5)))
        assert "P is negative before it: |P| goes as U^1.5" in first
        assert "data.reverse_current=true" in first


def test_channels_that_make_no_sense_are_not_worth_fitting(tmp_path):
    """What the command of a look would be refused for, the look refuses as well."""
    phasors = voltages() * np.array([1.0, 0.0, 1.0])[:, None]
    loads, first, _ = station(tmp_path, ("U ", phasors), ("F1 I", currents(20, 8)))
    assert first.startswith("nothing is worth fitting")
    assert loads["F1"]["command"] == ""


class TestCouplers:
    feeders = {"F1": (20, 8, 1.5), "F2": (6, 1, 1.1), "F3": (12, 5, 1.9), "F4": (3, 2, 1.4)}

    @pytest.mark.parametrize(
        "name", ["Couplage", "Tronçonnement", "Bus section", "BUS-SEC", "B/C", "QBC", "СВ", "Tie"]
    )
    def test_names_of_other_languages_tell_a_coupler(self, tmp_path, name):
        F1, F2, F3 = (currents(P, Q, exponent=a) for P, Q, a in [*self.feeders.values()][:3])
        groups = ("T1 I", -(F1 + F2 + 2 * F3)), ("F1 I", F1), ("F2 I", F2), (f"{name} I", 2 * F3)
        loads, first, _ = station(tmp_path, ("U ", voltages()), *groups)
        assert [key for key, load in loads.items() if not load["loaded"]] == [name]
        assert "of F1 is worth fitting" in first

    def test_between_two_buses_it_carries_the_sum_of_one(self, tmp_path):
        F1, F2, F3, F4 = (currents(P, Q, exponent=a) for P, Q, a in self.feeders.values())
        T1, T2 = (-share * (F1 + F2 + F3 + F4) for share in (0.7, 0.3))
        one = ("B1 T1 I", T1), ("B1 F1 I", F1), ("B1 F2 I", F2)
        two = ("B2 T2 I", T2), ("B2 F3 I", F3), ("B2 F4 I", F4)
        buses = ("U B1 ", voltages()), ("U B2 ", voltages())
        loads, _, _ = station(tmp_path, *buses, *one, ("BAY5 I", -(T1 + F1 + F2)), *two)
        assert [key for key, load in loads.items() if not load["loaded"]] == ["BAY5"]
