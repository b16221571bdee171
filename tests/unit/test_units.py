"""Units of recordings: said by the file, by size or by a setting, or asked for; never a thousand by
default.
"""

import numpy as np
import pytest
from made_recordings import constant, recording

import tractexp
from tractexp.errors import UserError
from tractexp.filetypes.comtrade_writer import write
from tractexp.recording import Channel
from tractexp.recording.recording import find_quantity, find_unit
from tractexp.recording.unit import convert_to_units, parse_amount

KV, MW, MVAR = 110.0, 40.0, 15.0  # of `constant`


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def saved(tmp_path, volts, amps, by=(1.0, 1.0)):
    """A file of the load in kV and kA, its numbers multiplied and its units called as said."""
    values = constant() * np.repeat(by, 3)[:, None]
    whole = recording(values)
    channels = [
        Channel(c.name, c.raw, volts if i < 3 else amps, "", c.phase, gain=c.gain)
        for i, c in enumerate(whole.channels)
    ]
    write(
        recording(values).__class__("", channels, whole.segments),
        tmp_path / "rec.cfg",
        "BINARY",
        1999,
    )
    return tmp_path / "rec.cfg"


def load(path, **settings):
    record = tractexp.read(path, **settings)[0].record
    event = tractexp.read(path, **settings)[0]
    return (
        event.U0 * record.base.voltage,
        event.P0 * record.base.power,
        event.Q0 * record.base.power,
    )


RIGHT = pytest.approx((KV, MW, MVAR), rel=2e-3)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("кВ", ("voltage", 1.0)),
        ("В", ("voltage", 1e-3)),
        ("А", ("current", 1e-3)),
        ("кА", ("current", 1.0)),
        ("мВ", ("voltage", 1e-6)),
        ("МВ", ("voltage", 1e3)),
        ("㎸", ("voltage", 1.0)),
        ("ｋＶ", ("voltage", 1.0)),
        ("[kV]", ("voltage", 1.0)),
        ("kilovolts", ("voltage", 1.0)),
        ("千伏", ("voltage", 1.0)),
        ("кA", ("current", 1.0)),
        ("pu", ("", 1.0)),
        ("V/kV", ("", 1.0)),
        ("", ("", 1.0)),
        ("W", ("", 1.0)),
        ("kV]", ("", 1.0)),
    ],
)
def test_units_as_files_write_them(text, unit):
    assert find_unit(text) == unit


def test_two_units_in_one_say_the_quantity_and_not_the_size():
    assert (
        find_quantity("В/кВ"),
        find_quantity("kA / A"),
        find_quantity("V/A"),
        find_quantity("m/s"),
    ) == (
        "voltage",
        "current",
        "",
        "",
    )
    assert parse_amount("89.8 kV") == (89.8, "kV")


@pytest.mark.parametrize(
    ("volts", "amps", "by"),
    [
        ("кВ", "А", (1, 1e3)),
        ("", "", (1e3, 1e3)),
        ("V", "", (1e3, 1e3)),
        ("kV", "", (1, 1e3)),
        ("В", "кА", (1e3, 1)),
    ],
)
def test_what_the_file_or_the_size_says_is_right(tmp_path, volts, amps, by):
    path = saved(tmp_path, volts, amps, by)
    assert load(path) == RIGHT
    assert load(path, voltages=[0, 1, 2], currents=[3, 4, 5]) == RIGHT
    (feeder,) = tractexp.look(path).feeders
    assert (feeder["U"], feeder["P"], feeder["Q"]) == RIGHT


@pytest.mark.parametrize(
    ("volts", "amps", "by", "units"),
    [
        ("", "", (1, 1), {"U": "kV", "I": "kA"}),
        ("pu", "pu", (1 / 89.8, 1 / 0.3), {"U": "89.8 kV", "I": "0.3 kA"}),
        ("V/kV", "А", (1, 1e3), {"U": "kV"}),
        ("parsec", "furlong", (1, 1), {"U": "kV", "I": "kA"}),
        ("kV", "", (1, 1), {"I": "kA"}),
    ],
)
def test_what_nothing_says_is_asked_for_and_the_setting_answers(tmp_path, volts, amps, by, units):
    path = saved(tmp_path, volts, amps, by)
    for chosen in ({}, {"voltages": [0, 1, 2], "currents": [3, 4, 5]}):
        with pytest.raises(UserError, match=r"say the unit, units=\{"):
            tractexp.read(path, **chosen)
        assert load(path, units=units, **chosen) == RIGHT
    (feeder,) = tractexp.look(path).feeders
    assert feeder["P"] is None
    assert np.isnan(tractexp.look(path).feeders.to_frame()["P"]).all()
    assert any("say the unit" in sentence for sentence in feeder["said"])
    assert not tractexp.look(path).commands
    command = tractexp.look(path, units=units).commands[0]
    assert "data.units" in command


@pytest.mark.parametrize("by", [(1e3, 1.0), (1.0, 1e3)])
def test_volts_and_amperes_called_kilo_end_in_a_question(tmp_path, by):
    path = saved(tmp_path, "kV", "kA", by)
    with pytest.raises(UserError, match=r"units=\{U: "):
        tractexp.read(path)
    assert not tractexp.look(path).commands
    assert any(
        "units={U: " in sentence for sentence in next(iter(tractexp.look(path).feeders))["said"]
    )
    assert (
        load(path, units={"U": "V" if by[0] > 1 else "kV", "I": "A" if by[1] > 1 else "kA"})
        == RIGHT
    )


@pytest.mark.parametrize(
    "units", [{"U": "A"}, {"I": "kV"}, {"t": "s"}, {"U": "parsec"}, {"U": "-2 kV"}]
)
def test_a_setting_that_fits_nothing_is_refused(tmp_path, units):
    with pytest.raises(UserError, match="units"):
        tractexp.read(saved(tmp_path, "kV", "kA"), units=units)


def test_what_is_certain_is_left_alone():
    whole = recording(constant())
    assert convert_to_units(whole, {}, {}).notes == ()
    assert [c.unit for c in convert_to_units(whole, {}, {}).channels] == [
        c.unit for c in whole.channels
    ]
