"""What was found when real files were read, case by case: made again as files, read as a user
would.

A case is a load of known admittance behind known voltages, three phases, sampled and written as
COMTRADE.
"""

import numpy as np
import pytest

import tractexp
from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.recording import Channel, Recording, Segment

KILOVOLT = 230 / np.sqrt(3)  # phase to ground
Y = (0.45 - 0.03j) * 1e-3 * 3  # kA/kV of the load: 71 MW at 230 kV
TURN = np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]
PHASES, RATE = ("A", "B", "C"), 3200.0


def phasors(t, *changes, unbalance=0.0):
    """Phase voltages (3, N) [kV, complex RMS]; `changes` are (start, end, factor of each phase)."""
    V = np.repeat(KILOVOLT * TURN, len(t), axis=1).astype(complex)
    V[0] *= 1 + unbalance
    for start, end, factor in changes:
        inside = (t >= start) & (t < end)
        V[:, inside] *= np.broadcast_to(np.asarray(factor, dtype=complex).reshape(-1, 1), (3, 1))
    return V


def waves(X, t, f):
    return np.sqrt(2) * np.real(X * np.exp(2j * np.pi * f * t))


def station(
    tmp_path, V, I, t, f=50.0, *, declared=50.0, names=None, labels=None, name="station.cfg"
):
    """The path of a file with voltages (K, N) and currents [kV, kA, complex RMS]."""
    values = np.concatenate([waves(V, t, f), waves(I, t, f)])
    names = names or ["Ua", "Ub", "Uc", "Ia", "Ib", "Ic"]
    labels = labels or [*PHASES, *PHASES]
    channels = []
    for k, x in enumerate(values):
        gain = np.abs(x).max() / 30000 or 1.0
        unit, quantity = ("kV", "voltage") if k < len(V) else ("kA", "current")
        channels.append(
            Channel(
                names[k],
                np.round(x / gain).astype(np.int16),
                unit,
                quantity,
                labels[k],
                gain=gain,
                limits=(-32767, 32767),
            )
        )
    recording = Recording(
        "made", channels, [Segment(0, len(t), RATE, 0.0)], declared, "station", "recorder"
    )
    return next(
        path for path in comtrade.write(recording, tmp_path / name) if path.suffix == ".cfg"
    )


def seconds(length=2.0):
    return np.arange(round(length * RATE)) / RATE


DIP = (1.0, 1.2, 0.7)
S0 = 3 * KILOVOLT**2 * np.conj(Y)


def only(path, **settings):
    """The first dip of a file and its record."""
    (event, *_) = tractexp.read(path, **settings)
    return event


def powers(event):
    return (event.P0 + 1j * event.Q0) * event.record.base.power


def is_right(event, depth=0.3, duration=0.2):
    assert event.record.base.voltage == pytest.approx(230, rel=2e-3)
    assert abs(powers(event) - S0) < 5e-3 * abs(S0)
    assert event.depth == pytest.approx(depth, abs=0.005)
    assert event.duration == pytest.approx(duration, abs=0.025)


def test_three_phases_are_read_with_or_without_channels(tmp_path):
    t = seconds()
    V = phasors(t, DIP)
    path = station(tmp_path, V, Y * V, t)
    is_right(only(path, voltages=[0, 1, 2], currents=[3, 4, 5]))
    is_right(only(path))


class TestLineVoltages:
    """A: channels between the phases, taken for phase voltages, gave 398 kV and a power turned by
    30 degrees.
    """

    @pytest.mark.parametrize(
        ("names", "labels"),
        [
            (["UAB", "UBC", "UCA"], ["AB", "BC", "CA"]),
            (["Vab", "Vbc", "Vca"], ["", "", ""]),
            (["U12", "U23", "U31"], ["", "", ""]),
            (["u1", "u2", "u3"], ["AB", "BC", "CA"]),
        ],
    )
    def test_are_recognised_by_their_labels(self, tmp_path, names, labels):
        t = seconds()
        V = phasors(t, (1.0, 1.2, [0.7, 0.7, 0.7]))
        lines = V - np.roll(V, -1, axis=0)
        path = station(
            tmp_path, lines, Y * V, t, names=[*names, "Ia", "Ib", "Ic"], labels=[*labels, *PHASES]
        )
        event = only(path, voltages=[0, 1, 2], currents=[3, 4, 5])
        is_right(event)
        assert any("line" in note for note in event.record.notes)

    def test_two_of_them_are_enough(self, tmp_path):
        t = seconds()
        V = phasors(t, DIP)
        lines = (V - np.roll(V, -1, axis=0))[:2]
        names, labels = ["UAB", "UBC", "Ia", "Ib", "Ic"], ["AB", "BC", *PHASES]
        is_right(
            only(
                station(tmp_path, lines, Y * V, t, names=names, labels=labels),
                voltages=[0, 1],
                currents=[2, 3, 4],
            )
        )

    def test_a_residual_beside_them_is_no_third_one(self, tmp_path):
        t = seconds()
        V = phasors(t, DIP)
        lines = np.array([V[0] - V[1], V[1] - V[2], V.mean(axis=0)])
        path = station(
            tmp_path, lines, Y * V, t, names=["U21", "U32", "V0", "I1", "I2", "I3"], labels=[""] * 6
        )
        with pytest.raises(
            UserError, match=r"channel 2 'V0' is the residual .*: voltages=\[0, 1\]"
        ):
            only(path, voltages=[0, 1, 2], currents=[3, 4, 5])
        is_right(only(path, voltages=[0, 1], currents=[3, 4, 5]))
        is_right(only(path))
        path = station(tmp_path, lines, Y * V, t, names=[*"abcdef"], labels=[""] * 6)
        with pytest.raises(
            UserError, match=r"50 % of the positive one: .* are not the voltages of one bus"
        ):
            only(path, voltages=[0, 1, 2], currents=[3, 4, 5])


def test_b_the_frequency_that_is_measured_counts_not_the_one_that_is_declared(tmp_path):
    t = seconds()
    V = phasors(t, DIP)
    event = only(
        station(tmp_path, V, Y * V, t, f=50.016, declared=60.0),
        voltages=[0, 1, 2],
        currents=[3, 4, 5],
    )
    is_right(event)
    assert event.record.base.frequency == 50
    assert event.f0 == pytest.approx(50.016, abs=2e-3)
    assert any("60" in note and "50" in note for note in event.record.notes)


def test_c_a_swell_before_a_dip_is_not_the_level_it_falls_from(tmp_path):
    t = seconds(4.0)
    V = phasors(t, (1.0, 1.5, 1.15), (1.5, 1.7, 0.7))
    is_right(only(station(tmp_path, V, Y * V, t), voltages=[0, 1, 2], currents=[3, 4, 5]))


@pytest.mark.parametrize("order", [(1, 2, 0), (2, 0, 1), (1, 0, 2)])
def test_d_currents_in_another_order_never_pass_for_a_load(tmp_path, order):
    """Rotated, P was -30 MW instead of 69, with a word on a reversed current only."""
    t = seconds()
    V = phasors(t, DIP)
    path = station(
        tmp_path, V, (Y * V)[[*order]], t, labels=["", "", "", "", "", ""], names=[*"uvwxyz"]
    )
    currents = [3 + order.index(k) for k in range(3)]
    with pytest.raises(UserError) as refused:
        only(path, voltages=[0, 1, 2], currents=[3, 4, 5])
    assert f"; currents={currents} gives P = 71.4 MW" in str(refused.value)
    is_right(only(path, voltages=[0, 1, 2], currents=currents))


def test_d_a_reversed_transformer_is_told_from_regeneration(tmp_path):
    t = seconds()
    V = phasors(t, DIP)
    event = only(station(tmp_path, V, -Y * V, t), voltages=[0, 1, 2], currents=[3, 4, 5])
    assert any("data.reverse_current=true" in note for note in event.record.notes)
    # constant power back into the network, as a converter feeds it
    braking = 3 * -70 / (9 * np.conj(V)) * (1 + 0j)
    event = only(station(tmp_path, V, braking, t), voltages=[0, 1, 2], currents=[3, 4, 5])
    assert any(
        "regeneration (a braking train), no reversed current" in note for note in event.record.notes
    )


@pytest.mark.parametrize(
    "settings", [{}, {"voltages": [0, 1, 2], "currents": [3, 4, 5]}], ids=["proposed", "named"]
)
def test_what_is_found_of_order_and_direction_is_said_once_in_a_look(tmp_path, settings):
    t = seconds()
    V = phasors(t, DIP)
    (feeder,) = tractexp.look(station(tmp_path, V, -Y * V, t), **settings).feeders
    assert sum("data.reverse_current=true" in why for why in feeder["why"]) == 1


class TestNotADip:
    """E: fitted, as dips of 100 % and of 37 %."""

    def test_an_interruption(self, tmp_path):
        t = seconds(3.0)
        V = phasors(t, (1.0, 1.6, 0.001))
        with pytest.raises(UserError, match="interruption"):
            only(station(tmp_path, V, Y * V, t), voltages=[0, 1, 2], currents=[3, 4, 5])

    def test_one_pole_open(self, tmp_path):
        t = seconds(8.0)
        V = phasors(t, (1.0, 6.0, [0.001, 1.0, 1.0]))
        with pytest.raises(UserError, match="pole"):
            only(station(tmp_path, V, Y * V, t), voltages=[0, 1, 2], currents=[3, 4, 5])


def test_a_line_that_is_dead_after_the_trip_does_not_decide_the_order(tmp_path):
    t = seconds(3.0)
    V = phasors(t, (0.6, 0.8, 0.6), (1.0, 9.0, 1e-4))
    noise = np.random.default_rng(3).normal(size=(2, 3, len(t))) * 1e-4
    path = station(tmp_path, V + KILOVOLT * noise[0], Y * V + 1e-3 * noise[1], t)
    event = only(path, voltages=[0, 1, 2], currents=[3, 4, 5], train=[1])
    is_right(event, depth=0.4)


class TestSentences:
    """What was refused, or would be, says what is true."""

    def said(self, tmp_path, V, t, **settings):
        with pytest.raises(UserError) as refused:
            only(station(tmp_path, V, Y * V, t), voltages=[0, 1, 2], currents=[3, 4, 5], **settings)
        return str(refused.value)

    def test_a_swell(self, tmp_path):
        t = seconds(3.0)
        said = self.said(tmp_path, phasors(t, (1.0, 1.5, 1.15)), t)
        assert "swell" in said
        assert "shorter than the dip" not in said

    def test_a_step(self, tmp_path):
        t = seconds(3.0)
        said = self.said(tmp_path, phasors(t, (1.0, 9.0, 0.94)), t)
        assert "step" in said
        assert "shorter than the dip" not in said

    def test_a_dead_line_has_no_frequency(self, tmp_path):
        t = seconds(3.0)
        said = self.said(tmp_path, phasors(t, (1.0, 9.0, 0.0)), t)
        assert "data.frequency" not in said
        assert "dead" in said or "interruption" in said

    def test_a_folder(self, tmp_path):
        with pytest.raises(UserError, match="task=survey"):
            tractexp.read(tmp_path)

    def test_ten_samples_a_second(self, tmp_path):
        t = np.arange(0, 20, 0.1)
        U = np.where((t > 10) & (t < 10.5), 0.7, 1.0)
        with pytest.raises(UserError, match="coarse"):
            tractexp.read(t=t, U=U, P=U**1.5, Q=0.5 * U**2)


def test_files_and_channels_with_names_of_any_script(tmp_path):
    t = seconds()
    V = phasors(t, DIP)
    names = ["UA(kV)", "UB(kV)", "UC(kV)", "Ia_2СШ-110", "Ib_2СШ-110", "Ic_2СШ-110"]
    path = station(tmp_path, V, Y * V, t, names=names, name="站北 (1).cfg")
    is_right(only(path, voltages=names[:3], currents=names[3:]))
