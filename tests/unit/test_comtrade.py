"""COMTRADE files read and written: nothing is lost, what is harmless is mended and noted, the rest
is refused.
"""

import re
from datetime import datetime

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.record import foreign
from tractexp.recording import Channel, Recording, Segment, StatusChannel

CFG = """Substation,device,1999
8,6A,2D
1,Ua,A,Bus,kV,0.01,0,0,-32767,32767,110,0.1,S
2,Ub,B,Bus,kV,0.01,0,0,-32767,32767,110,0.1,S
3,Uc,C,Bus,kV,0.01,0,0,-32767,32767,110,0.1,S
4,Ia,A,Feeder,A,0.02,0.5,12.5,-32767,32767,600,5,P
5,Ib,B,Feeder,A,0.02,0.5,12.5,-32767,32767,600,5,P
6,Ic,C,Feeder,A,0.02,0.5,12.5,-32767,32767,600,5,P
1,trip,A,Feeder,0
2,close,A,Feeder,1
50
1
4000,40
01/02/2024,10:00:00.000000
01/02/2024,10:00:00.005000
ASCII
1
"""


def rows(n=40, width=6):
    k = np.arange(n)
    waves = np.round(3000 * np.sin(2 * np.pi * k[:, None] / 80 + np.arange(width))).astype(int)
    cells = np.column_stack([k + 1, 250 * k, waves, (k > 20).astype(int), (k > 30).astype(int)])
    return "".join(",".join(map(str, row)) + "\r\n" for row in cells)


@pytest.fixture
def pair(tmp_path):
    """Writes a .cfg with lines replaced, and its .dat."""

    def written(*changes, dat=None, cfg=CFG, name="a"):
        for old, new in changes:
            assert old in cfg
            cfg = cfg.replace(old, new, 1)
        (tmp_path / f"{name}.cfg").write_bytes(cfg.encode())
        (tmp_path / f"{name}.dat").write_bytes((rows() if dat is None else dat).encode())
        return tmp_path / f"{name}.cfg"

    return written


def same(a, b):
    """All that a recording says, but what the format itself adds."""
    assert len(a.channels) == len(b.channels)
    for x, y in zip(a.channels, b.channels, strict=True):
        np.testing.assert_array_equal(x.values(), y.values())
        for key in (
            "name",
            "unit",
            "quantity",
            "phase",
            "circuit",
            "gain",
            "offset",
            "ratio",
            "skew",
        ):
            assert getattr(x, key) == getattr(y, key), key
    for x, y in zip(a.status, b.status, strict=True):
        np.testing.assert_array_equal(x.values(), y.values())
        assert (x.name, x.phase, x.circuit, x.normal) == (y.name, y.phase, y.circuit, y.normal)
    assert list(a.segments) == list(b.segments)
    for key in ("frequency", "station", "device", "start", "trigger"):
        assert getattr(a, key) == getattr(b, key), key


def test_what_the_file_says_is_in_the_recording(pair):
    made = comtrade.load(pair())
    assert (made.station, made.device, made.frequency, made.samples) == (
        "Substation",
        "device",
        50.0,
        40,
    )
    assert (made.start, made.trigger) == (datetime(2024, 2, 1, 10), 0.005)
    assert made.segments == [Segment(0, 40, 4000.0, 0.0)]
    voltage, current = made.channels[0], made.channels[3]
    assert (voltage.ratio, voltage.quantity, voltage.circuit) == (1100.0, "voltage", "Bus")
    assert voltage.values()[1] == pytest.approx(voltage.raw[1] * 0.01 * 1100)
    assert (current.ratio, current.skew, current.limits) == (
        1.0,
        pytest.approx(12.5e-6),
        (-32767, 32767),
    )
    assert current.values()[1] == pytest.approx((current.raw[1] * 0.02 + 0.5) / 1000)
    assert voltage.raw.dtype == np.int16
    assert made.status[0].values().sum() == 19
    assert made.notes == ()


@pytest.mark.parametrize("kind", ["BINARY", "BINARY32", "FLOAT32", "ASCII"])
@pytest.mark.parametrize("name", ["b.cfg", "b.cff", "B.CFG"])
def test_round_trip_and_the_independent_reader(pair, tmp_path, kind, name):
    import comtrade as package

    made = comtrade.load(pair())
    files = comtrade.write(made, tmp_path / name, kind)
    again = comtrade.load(files[0])
    same(made, again)
    assert again.extra["kind"] == kind
    assert again.notes == ()
    other = package.Comtrade(ignore_warnings=True, use_numpy_arrays=True, use_double_precision=True)
    other.load(*map(str, files))
    for k, channel in enumerate(made.channels):
        np.testing.assert_allclose(
            other.analog[k] * channel.ratio * channel.factor, channel.values(), rtol=1e-12
        )
    np.testing.assert_array_equal(other.status[0], made.status[0].values())
    np.testing.assert_allclose(other.time, made.segments[0].t, atol=1e-12)


def test_binary_samples_stay_views_of_the_file(pair, tmp_path):
    files = comtrade.write(comtrade.load(pair()), tmp_path / "b.cfg")
    made = comtrade.load(files[0])
    assert {c.raw.base is not None and c.raw.dtype == np.int16 for c in made.channels} == {True}
    # two channels, one word
    assert all(np.shares_memory(made.status[0].raw, s.raw) for s in made.status)


def recordings(draw):
    """Anything a COMTRADE file can hold."""
    n = draw(st.integers(2, 40))
    kind = draw(st.sampled_from(["i2", "i4", "f4", "f8", "u2"]))
    word = st.text("abcUI 0123456789_äß站Ж-/()", max_size=8).map(str.strip)
    number = st.floats(-1e6, 1e6).map(lambda x: float(f"{x:.9g}"))
    channels = []
    for k in range(draw(st.integers(1, 4))):
        if kind in ("f4", "f8"):
            raw = np.array(
                draw(st.lists(st.floats(-1e9, 1e9, width=32), min_size=n, max_size=n)), kind
            )
            raw[draw(st.integers(0, n - 1))] = draw(st.sampled_from([0.0, np.nan, 99999.0]))
        else:
            info = np.iinfo(kind)
            raw = np.array(
                draw(st.lists(st.integers(info.min, info.max), min_size=n, max_size=n)), kind
            )
        missing = (
            draw(st.sampled_from([None, float(raw[0]), 99999.0])) if raw[0] == raw[0] else None
        )
        limits = (
            (0.0, 65535.0) if kind == "u2" else draw(st.sampled_from([None, (-32767.0, 32767.0)]))
        )
        channels.append(
            Channel(
                draw(word) or f"c{k}",
                raw,
                draw(st.sampled_from(["kV", "A", "", "Hz"])),
                "",
                draw(word),
                draw(word),
                draw(number),
                draw(number),
                draw(st.sampled_from([1.0, 1100.0, 0.5])),
                round(draw(st.floats(0, 1e3)), 6) * 1e-6,
                limits,
                missing,
            )
        )
    states = [
        StatusChannel(
            draw(word) or "s",
            np.array(draw(st.lists(st.integers(0, 1), min_size=n, max_size=n))),
            normal=k % 2,
        )
        for k in range(draw(st.integers(0, 20)))
    ]
    half = n // 2
    cuts = [(0, n, 4000.0, 0.0)] if n < 4 else [(0, half, 4000.0, 0.0), (half, n, 50.0, 0.125)]
    start = draw(st.sampled_from([None, datetime(2024, 2, 29, 23, 59, 59, 999999)]))
    return Recording(
        "made",
        channels,
        [Segment(*cut) for cut in cuts],
        draw(st.sampled_from([50.0, 60.0, 16.7])),
        draw(word),
        draw(word),
        start,
        None if start is None else draw(st.sampled_from([None, 0.0, 0.0001])),
        states,
    )


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_a_round_trip_loses_nothing(tmp_path, data):
    made = recordings(data.draw)
    revision = data.draw(st.sampled_from([1999, 2013]))
    kind = data.draw(st.sampled_from(["BINARY", "ASCII"]))
    name = data.draw(st.sampled_from(["r.cfg", "r.cff"])) if revision == 2013 else "r.cfg"
    again = comtrade.load(comtrade.write(made, tmp_path / name, kind, revision)[0])
    for x, y in zip(made.channels, again.channels, strict=True):
        np.testing.assert_array_equal(x.values(), y.values())
        told = ("name", "unit", "phase", "circuit", "gain", "offset", "ratio")
        assert [getattr(x, key) for key in told] == [getattr(y, key) for key in told]
        assert x.skew == pytest.approx(y.skew, abs=1e-15)
    for x, y in zip(made.status, again.status, strict=True):
        np.testing.assert_array_equal(x.values(), y.values())
        assert (x.name, x.normal) == (y.name, y.normal)
    assert list(again.segments) == list(made.segments)
    for key in ("frequency", "station", "device", "start", "trigger"):
        assert getattr(made, key) == getattr(again, key), key


MENDED = {
    "blank line": ([("2,Ub", "\n2,Ub")], "line 4: a blank line is passed over"),
    "lower case and spaces": ([("8,6A,2D", " 8 , 6a , 2 d ")], None),
    "counts swapped": ([("8,6A,2D", "8,2D,6A")], None),
    "padding": (
        [("\n1\n4000,40", "\n3\n4000,40\n4000,40\n4000,40")],
        "lines 14, 15: a sampling rate without samples",
    ),
    "count of rates": (
        [("\n1\n4000,40", "\n2\n4000,40")],
        "line 12: 2 sampling rates announced, 1 present",
    ),
    "no count of rates": (
        [("\n1\n4000,40", "\n4000,40")],
        "line 12: the number of sampling rates is missing",
    ),
    "no frequency": (
        [("\n50\n", "\n0\n")],
        "line 11: the nominal frequency is missing: 50 Hz, unless",
    ),
    "blank frequency": (
        [("\n50\n", "\n\n")],
        "line 12: the nominal frequency is missing: 50 Hz, unless",
    ),
    "frequency left out": (
        [("\n50\n", "\n")],
        "line 11: the nominal frequency is missing: 50 Hz, unless",
    ),
    "no such day": (
        [("01/02/2024,10:00:00.000000", "00/00/2024,10:00:00")],
        "line 14: .* is not a day of the calendar",
    ),
    "no date": (
        [("01/02/2024,10:00:00.000000\n01/02/2024,10:00:00.005000\n", "")],
        "no date of the first sample",
    ),
    "empty dates": (
        [("01/02/2024,10:00:00.000000\n01/02/2024,10:00:00.005000", ",\n,")],
        "lines 14, 15: ',' is not a date",
    ),
    "year first": (
        [("01/02/2024", "2024/02/01")],
        "line 14: date '2024/02/01,10:00:00.000000' read as 2024-02-01",
    ),
    "month first": ([("01/02/2024", "02/28/2024")], "line 14: date .* read as 2024-02-28"),
    "clock not set": (
        [("01/02/2024", "01/01/1970"), ("01/02/2024", "01/01/1970")],
        "line 14: the clock was not set",
    ),
    "no multiplier": ([("ASCII\n1\n", "ASCII\n")], "no time multiplier, 1 taken"),
    "Ctrl-Z": ([("ASCII\n1\n", "ASCII\n1\n\x1a\x1a")], None),
    "kind in lower case": ([("ASCII", " ascii ")], None),
    "no side": ([(",600,5,P\n5,", ",600,5,\n5,")], "line 6: neither P nor S stands there, primary"),
    "no side, no comma": (
        [(",600,5,P\n5,", ",600,5\n5,")],
        "line 6: neither P nor S stands there, primary",
    ),
    "no skew, no limits": ([("0.5,12.5,-32767,32767", "0.5,,,")], None),
    "Fortran's exponent": ([("kV,0.01,", "kV,1.0D-02,")], None),
    "announced binary": (
        [("ASCII", "BINARY")],
        "BINARY announced, but a.dat is text and read as ASCII",
    ),
    "trigger elsewhere": (
        [("01/02/2024,10:00:00.005", "01/02/2025,10:00:00.005")],
        "the trigger, .* lies outside",
    ),
    "one sample too many announced": (
        [("4000,40", "4000,41")],
        "holds 40 of the 41 samples announced; those are read",
    ),
}


@pytest.mark.parametrize("case", MENDED)
def test_harmless_departures_are_mended_and_noted(pair, case):
    changes, note = MENDED[case]
    made, right = comtrade.load(pair(*changes)), comtrade.load(pair(name="b"))
    for x, y in zip(made.channels, right.channels, strict=True):
        np.testing.assert_array_equal(x.values(), y.values())
    assert [s.rate for s in made.segments] == [4000.0]
    if note is None:
        assert made.notes == ()
    else:
        assert [n for n in made.notes if re.search(note, n)], made.notes


REFUSED = {
    "a field lost": (
        [("1,Ua,A,Bus", "1,Ua,Bus")],
        "line 3: analog channel 1 of 6 'Ua' has 12 fields, but an analog",
    ),
    "a channel twice": (
        [("2,close", "2,close,A,Feeder,1\n2,close")],
        "line 11: '2,close,A,Feeder,1' where the nominal",
    ),
    "frequency": (
        [("\n50\n", "\n-1\n")],
        "line 11: nominal frequency '-1' is not a number between 10 and 100 Hz; write",
    ),
    "offset": (
        [("A,0.02,0.5", "A,0.02,1e308")],
        "line 6: analog channel 4 of 6 'Ia': offset '1e308' is not a number",
    ),
    "multiplier": (
        [("kV,0.01", "kV,nan")],
        "line 3: analog channel 1 of 6 'Ua': multiplier 'nan' is not a number",
    ),
    "infinite": (
        [("kV,0.01", "kV,inf")],
        "multiplier 'inf' is not a number between -1e12 and 1e12; correct it",
    ),
    "no multiplier": ([("kV,0.01", "kV,")], "multiplier '' is not a number"),
    "ratio": (
        [("110,0.1,S", "110,0,S")],
        "line 3: .* is in secondary values, but its ratio 110/0 is not positive; write",
    ),
    "channels": (
        [("8,6A,2D", "2000000006,6A,2000000000D")],
        "line 2: announces 2000000006 channels, but only 15 lines",
    ),
    "no analog": ([("8,6A,2D", "2,0A,2D")], "line 2: announces no analog channel"),
    "nonsense": (
        [("8,6A,2D", "8;6A;2D")],
        "line 2: '8;6A;2D' is not the numbers of channels, as in 8,6A,2D",
    ),
    "samples": (
        [("4000,40", "4000,4000000000")],
        "cut short: 4000000000 samples of 6 analog and 2 status channels",
    ),
    "endless": ([("4000,40", "4000,9e99")], "line 13: '4000,9e99' is not a sampling rate"),
    "rate": (
        [("4000,40", "x,40")],
        "line 13: 'x,40' is not a sampling rate .Hz. and its last sample, as in 4000,8000",
    ),
    "mixed rates": (
        [("\n1\n4000,40", "\n2\n0,20\n4000,40")],
        "line 13: sampling rates 0, 4000 Hz: a rate of 0 means",
    ),
    "falling": (
        [("\n1\n4000,40", "\n2\n4000,30\n4000,20")],
        "line 14: last sample 20 must be above zero, and above 30",
    ),
    "kind": ([("ASCII", "ASC")], "line 16: data file type 'ASC' is not one of ASCII, BINARY"),
    "cut": (
        [("1,trip", "trip"), ("ASCII\n1\n", "")],
        "ends after line 15, before the type of the data file",
    ),
    "deleted channel": (
        [("6,Ic,C,Feeder,A,0.02,0.5,12.5,-32767,32767,600,5,P\n", "")],
        "line 8: analog channel 6 of 6",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_contradictions_are_refused_with_line_and_value(pair, case):
    changes, says = REFUSED[case]
    with pytest.raises(UserError, match=says):
        comtrade.load(pair(*changes))


def test_blank_lines_and_empty_cells_in_the_data(pair):
    made = comtrade.load(pair(dat=_with_cell(rows(), 5, 2, "").replace("\r\n", "\r\n\r\n")))
    assert np.flatnonzero(np.isnan(made.channels[0].values())).tolist() == [4]
    assert any("blank lines in a.dat" in note for note in made.notes)
    assert any("1 empty cells in a.dat" in note for note in made.notes)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("\n7,", "\n7,x", "line 7: time stamp 'x1500' is not a number"),
        ("\n7,1500,", "\n7,1500,1,", "line 7: 11 cells, but 10 are announced"),
    ],
)
def test_wrong_cells_in_the_data(pair, old, new, says):
    with pytest.raises(UserError, match=says):
        comtrade.load(pair(dat=rows().replace(old, new)))


def test_missing_values_of_each_kind(pair, tmp_path):
    made = comtrade.load(pair(dat=_with_cell(rows(), 3, 2, "99999")))
    assert np.flatnonzero(np.isnan(made.channels[0].values())).tolist() == [2]
    for kind in ("BINARY", "BINARY32", "FLOAT32", "ASCII"):
        again = comtrade.load(comtrade.write(made, tmp_path / f"{kind}.cfg", kind)[0])
        assert again.extra["kind"] == kind
        np.testing.assert_array_equal(again.channels[0].values(), made.channels[0].values())


def _with_cell(text, line, k, value):
    lines = text.split("\r\n")
    cells = lines[line - 1].split(",")
    lines[line - 1] = ",".join([*cells[:k], value, *cells[k + 1 :]])
    return "\r\n".join(lines)


def test_bytes_lost_within_binary_data_are_found(pair, tmp_path):
    cfg, dat = comtrade.write(comtrade.load(pair()), tmp_path / "b.cfg")
    content = dat.read_bytes()
    dat.write_bytes(content[:101] + content[102:] + b"\0")
    with pytest.raises(
        UserError, match=r"b.dat: sample \d+: its number is \d+ after \d+: the rows are not BINARY"
    ):
        comtrade.load(cfg)


def test_sampling_that_follows_the_frequency_becomes_one_even_waveform(pair):
    """Twenty rates within half a per cent, as some recorders write: one segment, interpolated."""
    n, f = 4000, 49.8
    rates = 2400 * (1 + 0.004 * np.sin(np.arange(20)))
    steps = np.repeat(1 / rates, n // 20)[1:]
    t = np.concatenate([[0], np.cumsum(steps)])
    wave = np.round(30000 * np.sin(2 * np.pi * f * t)).astype(int)
    told = "\n20\n" + "\n".join(
        f"{rate!r},{(k + 1) * n // 20}" for k, rate in enumerate(rates.tolist())
    )
    cells = np.column_stack([np.arange(n) + 1, 0 * wave, *[wave] * 6, 0 * wave, 0 * wave])
    dat = "".join(",".join(map(str, row)) + "\n" for row in cells)
    made = comtrade.load(pair(("\n1\n4000,40", told), dat=dat))
    [segment] = made.segments
    right = 30000 * np.sin(2 * np.pi * f * segment.t)
    assert np.abs(np.asarray(made.channels[0].raw) - right)[5:-5].max() < 3  # of 30,000
    assert any("interpolated" in note for note in made.notes)


def test_rates_that_the_time_stamps_contradict_are_said(pair):
    made = comtrade.load(pair(("4000,40", "2000,40")))
    assert any(
        "take 0.0195 s at 2000 Hz, but 0.00975 s by their time stamps" in note
        for note in made.notes
    )


def test_the_standard_of_1991(pair):
    cfg = "Sub,dev\n2,1A,1D\n1,U,A,Bus,kV,0.01,0,0,-2048,2047\n1,trip,0\n60\n1\n4000,40\n"
    cfg += "02/29/92,1:2:3.5\n02/29/92,1:2:3.505\nASCII\n"
    dat = "".join(f"{k + 1},{250 * k},{k},0\r\n" for k in range(40))
    made = comtrade.load(pair(cfg=cfg, dat=dat))
    assert (made.start, made.channels[0].ratio, made.notes) == (
        datetime(1992, 2, 29, 1, 2, 3, 500000),
        1.0,
        (),
    )


@pytest.mark.parametrize(
    ("names", "encoding"),
    [
        (["Увод 1СШ-110 кВ Ua", "ВЛ Тяговая Iа"], "cp1251"),
        (["терминал версия", "Блокировка"], "cp1251"),
        (["220kV母线I_Ua", "主变高压侧电流"], "gbk"),
        (["Estação de Medição", "Oscilógrafo"], "latin-1"),
        (["Спуск трансформатора", "站北"], "utf-8"),
    ],
)
def test_encodings_are_found(tmp_path, names, encoding):
    cfg = CFG.replace("Ua", names[1], 1).replace("Substation", names[0])
    (tmp_path / "a.cfg").write_bytes(cfg.encode(encoding))
    (tmp_path / "a.dat").write_text(rows())
    made = comtrade.load(tmp_path / "a.cfg")
    assert (made.station, made.channels[0].name) == (names[0], names[1])


def test_either_file_of_the_pair_names_the_record(pair, tmp_path):
    pair()
    (tmp_path / "a.dat").rename(tmp_path / "A.Dat")
    made = comtrade.load(tmp_path / "A.Dat")
    assert made.notes == (f"{tmp_path / 'a.cfg'}: it lies beside A.Dat",)
    (tmp_path / "a.cfg").unlink()
    with pytest.raises(UserError, match=r"the configuration A.cfg is not beside it"):
        comtrade.load(tmp_path / "A.Dat")
    with pytest.raises(UserError, match=r"is a folder; task=survey data.path="):
        comtrade.load(tmp_path)


def test_a_combined_file_without_a_section(tmp_path):
    (tmp_path / "a.cff").write_text("--- file type: CFG ---\n" + CFG)
    with pytest.raises(
        UserError, match=r"no section DAT: a \.cff has headings like '--- file type: DAT ---'"
    ):
        comtrade.load(tmp_path / "a.cff")
    wrong = CFG.replace("\n50\n", "\nx\n")
    (tmp_path / "a.cff").write_text(
        "--- file type: CFG ---\n" + wrong + "--- file type: DAT ASCII ---\n" + rows()
    )
    # of the file, not of the section
    with pytest.raises(UserError, match=r"a\.cff: line 12: nominal frequency 'x'"):
        comtrade.load(tmp_path / "a.cff")


@pytest.mark.parametrize(
    ("cfg", "dat"),
    [
        ("--- file type CFG ---", "--- file type DAT ASCII ---"),
        ("--- File Type CFG", "--- File Type DAT ASCII"),
        ("---file type:CFG---", "---file type:DAT ASCII: 0---"),
        ("------ filetype CFG ------", "------ filetype DAT ASCII ------"),
    ],
)
def test_headings_of_a_combined_file_in_other_spellings(tmp_path, cfg, dat):
    wanted = f"{tmp_path / 'a.cff'}"
    (tmp_path / "a.cff").write_text(
        f"--- file type: CFG ---\n{CFG}--- file type: DAT ASCII ---\n{rows()}"
    )
    usual = [c.values() for c in comtrade.load(wanted).channels]
    (tmp_path / "a.cff").write_text(f"{cfg}\n{CFG}{dat}\n{rows()}")
    np.testing.assert_array_equal([c.values() for c in comtrade.load(wanted).channels], usual)


@pytest.mark.parametrize(
    "heading", ["file type DAT BINARY {}", "file type: DAT BINARY {}", "file type DAT BINARY: {}"]
)
def test_the_length_of_binary_data_is_found_without_colons(pair, tmp_path, heading):
    made = comtrade.load(pair())
    comtrade.write(made, tmp_path / "a.cff", "BINARY")
    content = (tmp_path / "a.cff").read_bytes()
    length = re.search(rb"DAT BINARY: ?(\d+) ---", content)
    changed = content.replace(length[0].replace(b" ---", b""), b"")
    changed = re.sub(rb"file type: (?= ---)", heading.format(length[1].decode()).encode(), changed)
    assert changed != content
    (tmp_path / "b.cff").write_bytes(changed)
    again = comtrade.load(tmp_path / "b.cff")
    whole = comtrade.load(tmp_path / "a.cff")
    np.testing.assert_array_equal(
        [c.values() for c in again.channels], [c.values() for c in whole.channels]
    )


def test_what_cannot_be_written_is_refused(pair, tmp_path):
    made = comtrade.load(pair())
    for path, kind, revision, says in [
        ("b.txt", "BINARY", 2013, "the ending of a COMTRADE file=.txt is not one of .cfg, .cff"),
        ("b.cfg", "FLOAT32", 1999, "kind=FLOAT32 is not one of BINARY, ASCII"),
        ("b.cff", "BINARY", 1999, "a .cff is of the standard of 2013"),
        ("b.cfg", "BINARY", 1991, "revision=1991 is not one of 1999, 2013"),
    ]:
        with pytest.raises(UserError, match=says):
            comtrade.write(made, tmp_path / path, kind, revision)
        assert not (tmp_path / path).exists()


def test_foreign_files_are_named():
    assert foreign.describe_foreign_file("a/b.PL4").startswith("a/b.PL4 is ATP's plot file")
    assert "have it write .out files" in foreign.describe_foreign_file("run.psout")
    assert foreign.describe_foreign_file("a/b.pqd") == ""
    assert "give the .cfg beside it" in foreign.describe_foreign_file("x.hdr")
    assert foreign.describe_foreign_file("x.cfg") == ""
    records = [
        name
        for name in ("a.PL4", "b.psout", "c.rec", "d.hdr", "e.zip", "f.pdf", "g.cfg")
        if foreign.is_record(name)
    ]
    assert records == ["a.PL4", "b.psout", "c.rec"]


@pytest.mark.parametrize(
    ("unit", "kilo"), [("V", 1e-3), ("kV", 1.0), ("KV", 1.0), ("mV", 1e-6), ("MV", 1e3)]
)
def test_a_unit_is_what_its_letters_say_milli_and_mega_apart(unit, kilo):
    channel = Channel("U", np.array([2, -3], np.int16), unit, "voltage")
    np.testing.assert_allclose(channel.values(), [2 * kilo, -3 * kilo])
