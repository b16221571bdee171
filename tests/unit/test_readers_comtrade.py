"""The COMTRADE reader on files the tests write themselves, and on real recordings."""

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.record import detect, find_dips
from tractexp.record.phasor_measurement import measure

KILOVOLT, KILOAMPERE, LAG = 110 / np.sqrt(3), 0.2, np.deg2rad(30)
S0 = 3 * KILOVOLT * KILOAMPERE * np.exp(1j * LAG)  # MVA
NAMES = ["Ua", "Ub", "Uc", "Ia", "Ib", "Ic"]


def waveforms(t, f, dips):
    """(6, N) primary V and A: balanced, constant impedance, `dips` as (start, end, depth)."""
    scale = np.ones_like(t)
    for start, end, depth in dips:
        scale[(t >= start) & (t < end)] = 1 - depth
    turn = np.exp(1j * (2 * np.pi * f * t[None, :] - 2 * np.pi / 3 * np.arange(3)[:, None]))
    volts, amperes = 1e3 * KILOVOLT * turn, 1e3 * KILOAMPERE * np.exp(-1j * LAG) * turn
    return np.sqrt(2) * np.concatenate([volts, amperes]).real * scale


def write(
    folder,
    values,
    rates,
    kind="BINARY",
    side="P",
    encoding="utf-8",
    names=NAMES,
    units="VA",
    stamps=0.0,
):
    """A COMTRADE 1999 pair. `rates` [(Hz, last sample)]; side S stores values on a 110000:100,
    600:5 secondary.
    """
    ratios = [(110000.0, 100.0)] * 3 + [(600.0, 5.0)] * 3
    primary = np.array([p / s if side == "S" else 1.0 for p, s in ratios])
    stored = values / primary[:, None]
    gain = np.abs(stored).max(axis=1) / 32000
    raw = np.round(stored / gain[:, None]).astype(int)
    lines = ["Umspannwerk,recorder,1999", "8,6A,2D"]
    for i, (label, (p, s)) in enumerate(zip(names, ratios, strict=True)):
        unit = units[0] if i < 3 else units[1]
        lines.append(
            f"{i + 1},{label},{'ABC'[i % 3]},,{unit},{gain[i]:.12g},0,0,-32767,32767,{p},{s},{side}"
        )
    lines += [
        "1,trip,,,0",
        "2,close,,,0",
        "50",
        str(len(rates) if rates[0][0] else 0),
        *(f"{rate},{last}" for rate, last in rates),
    ]
    lines += ["01/02/2024,10:00:00.000000", "01/02/2024,10:00:00.100000", kind, "1"]
    (folder / "station.cfg").write_bytes(("\r\n".join(lines) + "\r\n").encode(encoding))
    n = raw.shape[1]
    if kind == "ASCII":
        rows = np.column_stack(
            [np.arange(1, n + 1), np.zeros(n, int), raw.T, np.zeros((n, 2), int)]
        )
        (folder / "station.dat").write_text(
            "\n".join(",".join(map(str, row)) for row in rows) + "\n"
        )
    else:
        row = np.dtype([("n", "<u4"), ("t", "<u4"), ("a", "<i2", 6), ("d", "<u2")])
        table = np.zeros(n, row)
        table["n"], table["t"], table["a"] = np.arange(1, n + 1), np.round(stamps * 1e6), raw.T
        (folder / "station.dat").write_bytes(table.tobytes())
    return folder / "station.cfg"


def settings(path, **changed):
    return {
        "name": "comtrade",
        "path": str(path),
        "voltages": [0, 1, 2],
        "currents": [3, 4, 5],
        **changed,
    }


def read(path, **changed):
    return build("data", settings(path, **changed)).read()


@pytest.fixture
def two_dips(tmp_path):
    t = np.arange(6400) / 3200
    values = waveforms(t, 50.0, [(0.5, 0.7, 0.4), (1.3, 1.4, 0.2)])
    return write(tmp_path, values, [(3200, 6400)])


@pytest.mark.parametrize("kind", ["ASCII", "BINARY"])
@pytest.mark.parametrize("side", ["P", "S"])
@pytest.mark.parametrize("f", [49.2, 50.0, 51.1])
def test_what_was_written_is_read_back(tmp_path, kind, side, f):
    t = np.arange(4800) / 3200
    path = write(tmp_path, waveforms(t, f, [(0.5, 0.7, 0.4)]), [(3200, 4800)], kind, side)
    record = read(path).train[0]
    event = detect(record)
    assert record.base.voltage == pytest.approx(110, rel=1e-4)
    assert record.base.power == pytest.approx(abs(S0), rel=1e-4)
    np.testing.assert_allclose(
        [event.U0, event.P0, event.Q0], [1, np.cos(LAG), np.sin(LAG)], atol=2e-4
    )
    assert event.f0 == pytest.approx(f, abs=1e-3)
    assert event.depth == pytest.approx(0.4, abs=1e-3)
    # a one-cycle window first feels it half a cycle before
    assert event.t_start == pytest.approx(0.5, abs=0.011)
    np.testing.assert_allclose(
        (record.P + 1j * record.Q) / record.U**2, np.exp(1j * LAG), atol=0.06
    )


def test_dips_are_numbered_and_share_one_base(two_dips):
    events = read(two_dips)
    assert [r.name for r in (*events.train, *events.validate)] == ["station_dip1", "station_dip2"]
    first, second = detect(events.train[0]), detect(events.validate[0])
    assert (first.depth, second.depth) == (
        pytest.approx(0.4, abs=1e-3),
        pytest.approx(0.2, abs=1e-3),
    )
    assert events.train[0].base == events.validate[0].base
    assert events.train[0].t[-1] < 1.3
    assert events.validate[0].t[0] > 0.7
    assert first.dips == second.dips == 1


def test_training_and_validation_dips_can_be_chosen(two_dips):
    events = read(two_dips, train=[2], validate=[])
    assert [r.name for r in events.train] == ["station_dip2"]
    assert events.validate == []


def test_channels_by_name_are_the_channels_by_number(two_dips):
    by_name = read(two_dips, voltages=NAMES[:3], currents=NAMES[3:]).train[0]
    np.testing.assert_array_equal(by_name.P, read(two_dips).train[0].P)


def test_a_reversed_current_changes_the_sign_of_the_power(two_dips):
    np.testing.assert_array_equal(
        read(two_dips, reverse_current=True).train[0].P, -read(two_dips).train[0].P
    )


def test_window_lengths_are_kept(two_dips):
    record = read(two_dips, pre=0.2, post=0.5).train[0]
    start = detect(record).t_start
    assert start - record.t[0] == pytest.approx(0.2, abs=0.002)
    assert record.t[-1] - start == pytest.approx(0.5, abs=0.002)


def test_names_in_another_encoding_are_found(tmp_path):
    t = np.arange(4800) / 3200
    names = ["母线Ua", "母线Ub", "母线Uc", "主变Ia", "主变Ib", "主变Ic"]
    path = write(
        tmp_path, waveforms(t, 50.0, [(0.5, 0.7, 0.4)]), [(3200, 4800)], encoding="gbk", names=names
    )
    assert read(path, voltages=names[:3], currents=names[3:]).train[0].samples > 1000


def test_segments_of_different_rates_never_share_a_window(tmp_path):
    """A waveform, peak magnitudes at 50 Hz, then a waveform at half the rate: phasors stay clean at
    every edge.
    """
    parts, rates, start = [], [], 0.0
    for rate, n, dips in (
        (3200, 3200, [(0.5, 0.6, 0.4)]),
        (50, 40, []),
        (1600, 1600, [(2.3, 2.4, 0.3)]),
    ):
        t = start + np.arange(n) / rate
        wave = waveforms(t, 50.0, dips)
        parts.append(
            wave
            if rate > 50
            else np.repeat(np.abs(waveforms(np.zeros(1), 50.0, []))[:, :1], n, axis=1)
        )
        rates.append((rate, (rates[-1][1] if rates else 0) + n))
        start = t[-1]
    path = write(tmp_path, np.concatenate(parts, axis=1), rates)
    events = read(path)
    first, second = events.train[0], events.validate[0]
    assert first.t[-1] < 1.0 - 0.009
    assert second.t[0] > 1.8 + 0.009
    for record, depth in ((first, 0.4), (second, 0.3)):
        assert detect(record).depth == pytest.approx(depth, abs=2e-3)
        assert record.U.max() == pytest.approx(1, abs=2e-3)
        assert record.U.min() == pytest.approx(1 - depth, abs=2e-3)
    assert "segments without waveform not used: 50 Hz" in first.notes[1]


def test_time_stamps_are_used_where_the_file_gives_no_rate(tmp_path):
    t = np.arange(6000) / 4000
    path = write(tmp_path, waveforms(t, 50.0, [(0.5, 0.7, 0.4)]), [(0, 6000)], stamps=t)
    event = detect(read(path).train[0])
    assert (event.depth, event.f0) == (pytest.approx(0.4, abs=1e-3), pytest.approx(50, abs=1e-3))


def test_stamps_beside_two_dates_in_nanoseconds_are_in_nanoseconds(tmp_path):
    """And in microseconds where one of the dates is."""
    t = np.arange(6000) / 4000
    path = write(tmp_path, waveforms(t, 50.0, []), [(0, 6000)], stamps=t)
    text = path.read_text()
    for dates, rate in ((2, 4e6), (1, 4e3)):
        path.write_text(
            text.replace(".000000", ".000000000").replace(".100000", ".100000000", dates - 1)
        )
        assert [one.rate for one in comtrade.load(path).segments] == [pytest.approx(rate)]


def test_a_gap_between_time_stamps_begins_a_segment(tmp_path):
    t = np.arange(6000) / 4000
    path = write(tmp_path, waveforms(t, 50.0, []), [(0, 6000)], stamps=np.where(t > 1, t + 0.01, t))
    recording = comtrade.load(path)
    assert [(s.first, s.stop, s.rate) for s in recording.segments] == [
        (0, 4001, 4000.0),
        (4001, 6000, 4000.0),
    ]
    assert recording.segments[1].start == pytest.approx(1.01025)
    assert "a new segment begins at 1.01025 s" in recording.notes[0]


def test_kilovolts_in_the_file_are_kilovolts(tmp_path):
    t = np.arange(4800) / 3200
    values = waveforms(t, 50.0, [(0.5, 0.7, 0.4)]) / 1e3
    path = write(tmp_path, values, [(3200, 4800)], units=["kV", "kA"])
    assert read(path).train[0].base.voltage == pytest.approx(110, rel=1e-4)


class TestRefused:
    @pytest.mark.parametrize(
        ("changed", "says"),
        [
            ({"path": ""}, "data.path is missing"),
            ({"train": []}, "data.train is empty"),
            ({"train": [1], "validate": [1]}, "name dip 1 twice"),
            (
                {"train": [3]},
                "there is no dip 3; the file has 2; dips that can be used: 1 at .*, 2 at",
            ),
            ({"validate": [0]}, "there is no dip 0"),
            (
                {"voltages": [0, 1]},
                r"data.voltages=\[0, 1\] must name three channels.* 0 'Ua' \[V\], 1 'Ub'",
            ),
            ({"currents": []}, r"data.currents=\[\] must name three channels"),
            ({"voltages": [0, 1, 1]}, "names a channel twice"),
            (
                {"voltages": [0, 1, 6]},
                "there is no channel 6 in .*station.cfg, which has 6, counted from 0",
            ),
            ({"voltages": ["Ua", "Ub", "Ud"]}, "has no analog channel 'Ud'; did you mean 'U"),
            (
                {"voltages": [3, 4, 5]},
                "data.voltages: channel 3 'Ia' of .* is in A; choose voltages",
            ),
            (
                {"currents": [4, 5, 3]},
                "data.currents are the phases B, C, A where data.voltages are A, B, C",
            ),
            (
                {"voltages": [1, 0, 2], "currents": [4, 3, 5]},
                "data.voltages=.* the phases are not in the order a, b, c",
            ),
            ({"encoding": "ascii-85"}, "data.encoding=ascii-85: there is no such text encoding"),
        ],
    )
    def test_settings(self, two_dips, changed, says):
        with pytest.raises(UserError, match=says):
            read(**{"path": two_dips, **changed})

    @pytest.mark.parametrize(
        ("old", "new", "says"),
        [
            ("8,6A,2D", "9,6A,2D", "line 2: announces 9 channels but 6 analog and 2 status ones"),
            (
                "8,6A,2D",
                "9,7A,2D",
                "line 9: analog channel 7 of 7 'trip' has 5 fields, but an analog channel has 13",
            ),
            ("3200,6400", "3200,0", "line 13: last sample 0 must be above zero"),
            ("3200,6400", "-1,6400", "line 13: sampling rate '-1' is not between 0 and 1e9 Hz"),
            ("BINARY", "BINARY99", "data file type 'BINARY99' is not one of ASCII, BINARY"),
            (
                "3200,6400",
                "3200,9000",
                "cut short: 9000 samples .* take 198000 bytes, and the file has 140800",
            ),
            ("3200,6400", "400,6400", "sampled at 400 Hz: no waveform"),
        ],
    )
    def test_a_configuration_that_contradicts_itself_or_the_data(self, two_dips, old, new, says):
        content = two_dips.read_text()
        assert old in content
        two_dips.write_text(content.replace(old, new, 1))
        with pytest.raises(UserError, match=says):
            read(two_dips)

    def test_a_truncated_binary_file_says_how_much_is_missing(self, two_dips):
        dat = two_dips.with_suffix(".dat")
        dat.write_bytes(dat.read_bytes()[:100_000])
        with pytest.raises(
            UserError,
            match=r"station.dat: cut short: 6400 samples .* take 140800 bytes, and .* 100000",
        ):
            read(two_dips)

    def test_a_truncated_text_file_says_how_much_is_missing(self, tmp_path):
        t = np.arange(4800) / 3200
        path = write(tmp_path, waveforms(t, 50.0, [(0.5, 0.7, 0.4)]), [(3200, 4800)], "ASCII")
        dat = path.with_suffix(".dat")
        dat.write_text("\n".join(dat.read_text().splitlines()[:3000]) + "\n")
        with pytest.raises(UserError, match="take 4800 lines, and the file has 3000"):
            read(path)

    def test_text_where_a_number_should_be(self, tmp_path):
        t = np.arange(4800) / 3200
        path = write(tmp_path, waveforms(t, 50.0, [(0.5, 0.7, 0.4)]), [(3200, 4800)], "ASCII")
        dat = path.with_suffix(".dat")
        dat.write_text(dat.read_text().replace("\n7,", "\n7,x", 1))
        with pytest.raises(
            UserError,
            match=r"station.dat: line 7: time stamp 'x0' is not a number, up to 1e38; correct it",
        ):
            read(path)

    def test_missing_files(self, two_dips):
        with pytest.raises(
            UserError, match=r"staton.cfg: there is no such file; did you mean 'station.cfg'\?"
        ):
            read(two_dips.with_name("staton.cfg"))
        with pytest.raises(UserError, match=r"give the \.cfg file"):
            read(two_dips.with_suffix(".hdr"))
        two_dips.with_suffix(".dat").unlink()
        with pytest.raises(
            UserError,
            match=r"station.dat: there is no such file; the data must lie beside station.cfg",
        ):
            read(two_dips)

    def test_missing_samples_are_named(self, two_dips):
        dat = two_dips.with_suffix(".dat")
        content = bytearray(dat.read_bytes())
        for sample in range(99, 109):  # "missing" in IEEE C37.111; a few in a row are bridged
            content[22 * sample + 8 : 22 * sample + 10] = (0x8000).to_bytes(2, "little")
        dat.write_bytes(content)
        with pytest.raises(UserError, match="channel 0 'Ua' has no value at sample 100"):
            read(two_dips)

    def test_no_dip(self, tmp_path):
        t = np.arange(4800) / 3200
        with pytest.raises(
            UserError, match=r"no dip: the voltage starts at 110 and falls at most .* \(t = 1.4"
        ):
            read(write(tmp_path, waveforms(t, 50.0, []), [(3200, 4800)]))

    def test_a_dip_without_recovery_and_a_segment_too_short(self, tmp_path):
        t = np.arange(3200) / 3200
        path = write(tmp_path, waveforms(t, 50.0, [(0.5, 2.0, 0.4)]), [(3200, 3200)])
        assert detect(read(path).train[0]).unfinished
        path = write(tmp_path, waveforms(t, 50.0, [(0.95, 2.0, 0.4)]), [(3200, 3200)])
        with pytest.raises(
            UserError,
            match=r"dip 1: the record is shorter than the dip.* dips that can be used: none",
        ):
            read(path)
        path = write(tmp_path, waveforms(t[:100], 50.0, []), [(3200, 100)])
        with pytest.raises(
            UserError, match=r"segment from 0.000 s: 100 samples at 3200 Hz are too short"
        ):
            read(path)

    def test_a_dip_right_at_the_start(self, tmp_path):
        t = np.arange(3200) / 3200
        path = write(tmp_path, waveforms(t, 50.0, [(0.021, 0.3, 0.4)]), [(3200, 3200)])
        with pytest.raises(
            UserError, match=r"the dip starts at sample .* needs at least 10 samples"
        ):
            read(path)


class TestRealRecordings:
    """Figures of the recordings' PROVENANCE.md."""

    @pytest.mark.parametrize(
        ("voltages", "currents", "S", "P", "Q"),
        [
            ([4, 5, 6], [8, 9, 10], 29.8 + 5.4j, (14.6, 42.0), (-10.8, 8.4)),
            ([0, 1, 2], [16, 17, 18], 10.6 - 4.2j, (6.4, 14.4), (-7.9, -2.1)),
        ],
        ids=["T2", "T1"],
    )
    def test_transformers_of_the_220_kv_station(self, shared_data, voltages, currents, S, P, Q):
        path = shared_data / "dfr220kv-shandong" / "xtz.cfg"
        events = read(path, voltages=voltages, currents=currents)
        first, second = events.train[0], events.validate[0]
        event, MVA = detect(first), first.base.power
        assert abs((event.P0 + 1j * event.Q0) * MVA - S) < 0.1
        assert event.depth == pytest.approx(0.131, abs=0.001)
        assert (first.P.min() * MVA, first.P.max() * MVA) == pytest.approx(P, abs=0.12)
        assert (first.Q.min() * MVA, first.Q.max() * MVA) == pytest.approx(Q, abs=0.12)
        assert 0.04 < event.duration < 0.05 + 0.02  # a one-cycle window adds its own length
        assert first.U2.max() > 0.1
        assert second.t[0] > 1.12  # the reclosure's own waveform segment
        assert detect(second).t_start - event.t_start == pytest.approx(1.1, abs=0.05)
        assert first.base.voltage == pytest.approx(230, abs=1)

    def test_negative_sequence_current_reaches_nine_tenths(self, shared_data):
        recording = comtrade.load(shared_data / "dfr220kv-shandong" / "xtz.cfg")
        segment = recording.waveforms()[0]
        chosen = [4, 5, 6, 8, 9, 10]
        made = measure(recording.matrix(chosen, segment), segment.rate, 50.0)
        before = np.abs(made.I1[made.t < 0.19]).mean()
        assert np.abs(made.I2).max() / before == pytest.approx(0.9, abs=0.02)
        assert [s.rate for s in recording.segments] == [3200, 50, 3200, 50]

    @pytest.mark.parametrize(
        ("currents", "P66", "exponent"),
        [([15, 16, 17], 4.87, 1.94), ([19, 20, 21], 5.90, 1.89)],
        ids=["VL2", "VL3"],
    )
    def test_feeders_of_the_110_kv_pole_slip_are_static_loads(
        self, shared_data, currents, P66, exponent
    ):
        recording = comtrade.load(shared_data / "async110kv-wisp" / "async110.cfg")
        [segment] = recording.waveforms()
        chosen = [0, 1, 2, *currents]
        made = measure(recording.matrix(chosen, segment), segment.rate, 50.0)
        late = made.t > 7
        slope, level = np.polyfit(np.log(np.abs(made.V1[late]) / 66), np.log(made.S[late].real), 1)
        assert (np.exp(level), slope) == (
            pytest.approx(P66, abs=0.01),
            pytest.approx(exponent, abs=0.01),
        )
        assert 48.0 < made.f[late].min() < made.f[late].max() < 51.8
        swings = np.count_nonzero(
            (np.abs(made.V1[1:]) < 62) & (np.abs(made.V1[:-1]) >= 62) & (made.t[1:] > 7.5)
        )
        assert (
            sum(made.t[start] > 7.5 for start, _ in find_dips(made.t, np.abs(made.V1)))
            == swings
            > 5
        )
        assert recording.channels[15].name == "Ia_2СШ-110_ВЛ_ВЛ2"  # CP1251 found by itself

    def test_dips_of_the_pole_slip_that_cannot_be_used_are_named(self, shared_data):
        path = shared_data / "async110kv-wisp" / "async110.cfg"
        events = read(path, voltages=[0, 1, 2], currents=[15, 16, 17])
        refused = [
            note for note in events.train[0].notes if note.startswith("not used for validation")
        ]
        said = f"{1 + len(events.validate) + len(refused)} dips"
        assert any(said in note for note in events.train[0].notes)
        assert "dip 1: the dip starts at sample" in refused[0]  # the file begins within a swing
        assert detect(events.validate[-1]).unfinished  # and ends within one

    def test_low_voltage_feeder_at_60_hz_and_30_khz(self, shared_data):
        recording = comtrade.load(shared_data / "keating-lv" / "keating_1999.cfg")
        [segment] = recording.waveforms()
        assert (segment.stop, recording.frequency) == (2048, 60.0)
        chosen = [4, 5, 6, 0, 1, 2]
        made = measure(recording.matrix(chosen, segment), segment.rate, 60.0)
        # kV: a 600 V feeder
        assert np.abs(made.V1).mean() * np.sqrt(3) == pytest.approx(0.6, rel=0.05)
        np.testing.assert_allclose(made.f, 60, atol=0.1)


def test_a_file_whose_time_multiplier_is_wrong_says_so(tmp_path):
    t = np.arange(4800) / 3200
    path = write(tmp_path, waveforms(t, 50.0, [(0.5, 0.7, 0.4)]), [(0, 4800)], stamps=t)
    text = path.read_text().rstrip().rsplit("\n", 1)[0] + "\n1000\n"
    path.write_text(text)
    with pytest.raises(
        UserError, match=r"sampled at 3.2 Hz: no waveform, .*the time multiplier 1000; if"
    ):
        build("data", {"name": "comtrade", "path": str(path)}).read()
    (file,) = tractexp.look(path).files
    assert any("no load was recognised: sampled at 3.2 Hz" in note for note in file["notes"])


def test_a_file_without_voltages_says_so(tmp_path):
    t = np.arange(4800) / 3200
    path = write(
        tmp_path,
        waveforms(t, 50.0, []),
        [(3200, 4800)],
        names=[f"n{k}" for k in range(6)],
        units=["Hz", "A"],
    )
    with pytest.raises(
        UserError, match=r"no channel is a voltage by its unit, of which there are 'A', 'Hz', or"
    ):
        build("data", {"name": "comtrade", "path": str(path)}).read()
