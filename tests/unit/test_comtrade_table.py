"""COMTRADE of powers and of phasors: as the tables with the same numbers."""

import numpy as np
import pytest

import tractexp
from tractexp.filetypes import comtrade_table
from tractexp.filetypes.comtrade_writer import write
from tractexp.record import detect
from tractexp.record.reader import find_reader
from tractexp.recording.recording import Channel, Recording, Segment

UNITS = {"kV": "voltage", "kA": "current"}


def values(rate, seconds=20.0):
    """t, U [kV], P [MW], Q [Mvar], f [Hz] (N,) of a dip of 30 % at 8 s."""
    t = np.arange(0, seconds, 1 / rate)
    u = np.where((t >= 8) & (t < 8.3), 0.7, 1.0)
    return t, 110 * u, 20 * u**1.5, 8 * u**2, 50 + 0 * t


@pytest.fixture
def saved(tmp_path):
    def made(columns, rate, name="swing.cfg", kind="ASCII", frequency=50.0):
        channels = [
            Channel(n, np.round(v / g).astype(np.int32), unit, UNITS.get(unit, ""), gain=g)
            for n, unit, v in columns
            for g in [(np.abs(v).max() or 1.0) / 30000]
        ]
        recording = Recording(
            "made", channels, [Segment(0, len(columns[0][2]), rate, 0.0)], frequency
        )
        write(recording, tmp_path / name, kind, 1999)
        return str(tmp_path / name)

    return made


NAMES = [
    ("U L1", "P L1", "Q L1", "FREQ"),
    ("U", "P", "Q", "f"),
    ("Voltage", "Active power", "Reactive power", "F"),
]


@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("rate", [25.0, 50.0, 100.0])
@pytest.mark.parametrize("kind", ["ASCII", "BINARY"])
def test_powers_at_a_value_a_cycle_are_a_table(saved, names, rate, kind):
    _, *columns = values(rate)
    path = saved([*zip(names, ("kV", "MW", "Mvar", "Hz"), columns, strict=True)], rate, kind=kind)
    assert find_reader(path).name == "csv"
    (event,) = tractexp.read(path)
    assert event.t_start == pytest.approx(8.0, abs=1 / rate)
    assert event.depth == pytest.approx(0.3, abs=0.01)
    base = event.record.base
    assert (base.voltage, base.power) == pytest.approx((110, np.hypot(20, 8)), rel=1e-3)


def test_a_table_with_the_same_numbers_gives_the_same_record(saved, tmp_path):
    t, *columns = values(50.0)
    path = saved(
        [*zip(("U", "P", "Q", "f"), ("kV", "MW", "Mvar", "Hz"), columns, strict=True)], 50.0
    )
    header = "t,U (kV),P (MW),Q (Mvar),f (Hz)"
    np.savetxt(
        tmp_path / "same.csv",
        np.c_[t, np.transpose(columns)],
        "%.6f",
        ",",
        header=header,
        comments="",
    )
    ours, theirs = (detect(tractexp.read(p)[0].record) for p in (path, str(tmp_path / "same.csv")))
    for name in ("U", "P", "Q", "f"):
        np.testing.assert_allclose(
            ours.record.channels[name], theirs.record.channels[name], atol=2e-4
        )


@pytest.mark.parametrize("rate", [30.0, 60.0, 120.0])
def test_phasors_of_a_pmu_are_a_table_at_the_nominal_frequency_of_the_file(saved, rate):
    t, U, P, Q, _ = values(rate)
    I = np.hypot(P, Q) / (np.sqrt(3) * U)
    turning = np.mod(10 * t + 180, 360) - 180
    lag = np.degrees(np.arctan2(Q, P))
    columns = [
        ("V1 mag", "kV", U / np.sqrt(3)),
        ("V1 ang", "deg", turning),
        ("I1 mag", "kA", I),
        ("I1 ang", "deg", turning - lag),
        ("FREQ", "Hz", 60 + 0 * t),
    ]
    (event,) = tractexp.read(saved(columns, rate, frequency=60.0))
    base = event.record.base
    assert (base.voltage, base.power, base.frequency) == pytest.approx(
        (110, np.hypot(20, 8), 60), rel=2e-3
    )
    assert event.P0 * base.power == pytest.approx(20, rel=5e-3)


def test_powers_without_currents_are_a_table_however_fast(saved):
    _, *columns = values(1000.0, 10.0)
    path = saved(
        [*zip(("U", "P", "Q", "f"), ("kV", "MW", "Mvar", "Hz"), columns, strict=True)], 1000.0
    )
    assert find_reader(path).name == "csv"
    assert tractexp.read(path)[0].depth == pytest.approx(0.3, abs=0.01)


def test_waveforms_stay_waveforms_with_powers_beside_them(saved):
    t = np.arange(0, 1, 1 / 1600)
    wave = [np.cos(2 * np.pi * (50 * t - k / 3)) for k in range(3)]
    columns = [
        *((f"U{p}", "kV", 90 * w) for p, w in zip("ABC", wave, strict=True)),
        *((f"I{p}", "kA", w) for p, w in zip("ABC", wave, strict=True)),
        ("P", "MW", 20 + 0 * t),
        ("Q", "Mvar", 8 + 0 * t),
    ]
    path = saved(columns, 1600.0)
    assert comtrade_table.holds_waveforms(path)
    assert find_reader(path).name == "comtrade"


def test_several_feeders_are_asked_about_once_and_the_answer_helps(saved):
    _, U, P, Q, _ = values(50.0)
    columns = [
        ("U bus", "kV", U),
        ("P north", "MW", P),
        ("Q north", "Mvar", Q),
        ("P south", "MW", P / 2),
        ("Q south", "Mvar", Q / 2),
    ]
    path = saved(columns, 50.0)
    with pytest.raises(tractexp.UserError, match=r"columns=\{P: 'P north', Q: 'Q north'\}"):
        tractexp.read(path)
    (event,) = tractexp.read(path, columns={"P": "P south", "Q": "Q south"})
    assert event.record.base.power == pytest.approx(np.hypot(10, 4), rel=1e-3)


def test_a_folder_lists_such_a_record_once(saved, tmp_path):
    from tractexp.recording.record_files import find_records

    _, *columns = values(50.0)
    saved([*zip(("U", "P", "Q", "f"), ("kV", "MW", "Mvar", "Hz"), columns, strict=True)], 50.0)
    assert [path.name for path in find_records(tmp_path)] == ["swing.cfg"]
