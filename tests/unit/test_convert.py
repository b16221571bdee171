"""Conversion: what is written and read again is the same, to the last bit or to what the format can
hold.
"""

import json
from datetime import datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tractexp
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.filetypes.sidecar import read_sidecar
from tractexp.filetypes.tidy import (
    convert_record,
    make_unique,
    restore_recording,
    write_record,
    write_recording,
)
from tractexp.record import Base, Record
from tractexp.record.window import Window
from tractexp.recording import Channel, Recording, Segment, StatusChannel

TABLES = [".csv", ".parquet"]
NAMES = st.text(
    st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1, max_size=12
)
finite = st.floats(-1e6, 1e6, allow_nan=False)


def a_recording(**changed):
    """Two segments, integers of two sizes and numbers, status channels, everything a format may
    tell.
    """
    rng = np.random.default_rng(5)
    n = 2400
    wave = np.sin(2 * np.pi * 50 * np.arange(n) / 1200)
    channels = [
        Channel(
            "UA",
            (20000 * wave).astype("<i2"),
            "V",
            "voltage",
            "A",
            "bus 1",
            0.0125,
            0.3,
            1100.0,
            2e-6,
            (-32767, 32767),
            -32768,
        ),
        Channel(
            "IA, feeder", (2e9 * wave).astype("<i4"), "A", "current", "A", gain=1e-7, ratio=300.0
        ),
        Channel("IA, feeder", rng.normal(size=n), "kA", "current", "B"),
        Channel("电压", rng.normal(size=n).astype("<f4"), "kV", "voltage", "C"),
    ]
    status = [
        StatusChannel("trip", (wave > 0).astype(np.uint8), "A", "line", 1),
        StatusChannel("cb", np.arange(n) % 8, bit=2),
    ]
    segments = [Segment(0, 1000, 1200.0, 0.0), Segment(1000, n, 1200.0, 0.9)]
    known = {
        "station": "North",
        "device": "7",
        "start": datetime(2024, 3, 31, 1, 2, 3, 456789),
        "trigger": 0.25,
    }
    known |= {
        "notes": ["line 3 mended"],
        "extra": {"format": "X", "stamps": np.arange(5, dtype="<u4")},
    }
    return Recording("rec.x", channels, segments, 50.0, status=status, **(known | changed))


def same_recording(a, b):
    assert [len(c.raw) for c in a.channels] == [len(c.raw) for c in b.channels]
    for x, y in zip(a.channels, b.channels, strict=True):
        assert x.raw.dtype == y.raw.dtype
        np.testing.assert_array_equal(x.raw, y.raw)
        np.testing.assert_array_equal(x.values(), y.values())
        fields = (
            "name",
            "unit",
            "quantity",
            "phase",
            "circuit",
            "gain",
            "offset",
            "ratio",
            "skew",
            "limits",
            "missing",
            "form",
        )
        assert [getattr(x, f) for f in fields] == [getattr(y, f) for f in fields]
    for x, y in zip(a.status, b.status, strict=True):
        np.testing.assert_array_equal(x.values(), y.values())
        assert (x.name, x.phase, x.circuit, x.normal) == (y.name, y.phase, y.circuit, y.normal)
    for field in ("segments", "frequency", "station", "device", "start", "trigger", "notes"):
        assert getattr(a, field) == getattr(b, field)


def a_record(n=200, name="there_dip2", **changed):
    rng = np.random.default_rng(7)
    t = 3.3 + np.arange(n) / 300
    U = np.where((t > 3.5) & (t < 3.7), 0.7, 1.0) + 1e-3 * rng.normal(size=n)
    known = {
        "f": 50 + rng.normal(size=n),
        "U2": 0.01 * rng.random(n),
        "base": Base(27.5, 19.3, 50.0),
    }
    known |= {"notes": ("one", "two, three"), "source": "there.cfg dip 2"}
    return Record(name, t, U, rng.random(n), rng.random(n), **(known | changed))


def same_record(a, b):
    assert list(a.channels) == list(b.channels)
    for name in a.channels:
        np.testing.assert_array_equal(a.channels[name], b.channels[name])
    assert list(a.more) == list(b.more)
    for name in a.more:
        np.testing.assert_array_equal(a.more[name], b.more[name])
    assert (a.name, a.base, a.notes) == (b.name, b.base, b.notes)


def again(path):
    return build("data", {"name": "csv", "train": [str(path)]}).read().train[0]


@pytest.mark.parametrize("ending", TABLES)
class TestTables:
    def test_a_record_is_the_same_again(self, tmp_path, ending):
        window = Window("p_class", np.linspace(-0.01, 0.01, 9), np.hanning(9) / np.hanning(9).sum())
        record = a_record(
            window=window, more={"P_3": np.random.default_rng(1).random(200), "THD_u": np.ones(200)}
        )
        table, sidecar = write_record(record, tmp_path / f"x{ending}")
        made = again(table)
        same_record(record, made)
        np.testing.assert_array_equal(made.window.weights, window.weights)
        assert json.loads(sidecar.read_text())["source"] == "there.cfg dip 2"

    def test_gaps_stay_gaps(self, tmp_path, ending):
        record = a_record()
        record.P[[3, 50]] = np.nan
        same_record(record, again(write_record(record, tmp_path / f"x{ending}")[0]))

    def test_a_recording_is_the_same_again(self, tmp_path, ending):
        recording = a_recording()
        table, _ = write_recording(recording, tmp_path / f"rec{ending}")
        made = build("data", {"name": "waveforms", "path": str(table)}).recording()
        same_recording(recording, made)
        np.testing.assert_array_equal(made.extra["stamps"], recording.extra["stamps"])
        assert made.extra["stamps"].dtype == "<u4"


def check_any_recording(data, folder, ending):
    n = data.draw(st.integers(2, 30))
    channels = [
        Channel(
            data.draw(NAMES),
            np.array(
                data.draw(st.lists(st.integers(-32768, 32767), min_size=n, max_size=n)),
                dtype="<i2",
            ),
            gain=data.draw(st.floats(1e-9, 1e3)),
            offset=data.draw(st.floats(-1e3, 1e3)),
            missing=data.draw(st.sampled_from([None, -32768])),
        )
        for _ in range(data.draw(st.integers(1, 4)))
    ]
    channels.append(
        Channel("x", np.array(data.draw(st.lists(st.floats(), min_size=n, max_size=n))))
    )
    recording = Recording("x", channels, [Segment(0, n, 1000.0, 0.0)])
    table, _ = write_recording(recording, folder / f"rec{ending}")
    made = restore_recording(str(table), read_sidecar(str(table)).recording)
    for x, y in zip(recording.channels, made.channels, strict=True):
        # else the offset swallows the digits of a step
        if abs(x.offset) < 1e3 * x.gain * 32768:
            np.testing.assert_array_equal(x.values(), y.values())


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_whatever_the_numbers_and_names(tmp_path_factory, data):
    check_any_recording(data, tmp_path_factory.mktemp("any"), ".csv")


@settings(max_examples=3, deadline=None)  # a process reads each
@given(data=st.data())
def test_whatever_the_numbers_and_names_in_parquet(tmp_path_factory, data):
    check_any_recording(data, tmp_path_factory.mktemp("any"), ".parquet")


def test_a_sidecar_of_another_table_is_refused(tmp_path):
    table, sidecar = write_recording(a_recording(), tmp_path / "rec.csv")
    told = json.loads(sidecar.read_text())
    told["recording"]["channels"].pop()
    sidecar.write_text(json.dumps(told))
    with pytest.raises(
        UserError, match=r"has 7 columns where its sidecar names t, 3 channels and 2 status"
    ):
        build("data", {"name": "waveforms", "path": str(table)}).recording()
    sidecar.write_text(json.dumps({"recording": {"channels": 3}}))
    with pytest.raises(UserError, match="its sidecar is not as task=convert writes it"):
        build("data", {"name": "waveforms", "path": str(table)}).recording()


def test_names_are_made_different():
    assert make_unique(["t", "a", "a", "", "a", "t"]) == [
        "t",
        "a",
        "a (2)",
        "unnamed",
        "a (3)",
        "t (2)",
    ]


class TestCOMTRADE:
    @pytest.fixture
    def station(self, tmp_path):
        """A COMTRADE record with one dip, of three phases."""
        t = np.arange(8000) / 4000
        level = np.where((t >= 0.8) & (t < 1.0), 0.6, 1.0)
        channels = []
        for unit, size, lag in (("V", 22453.0, 0.0), ("A", 400.0, 0.5)):
            for k, phase in enumerate("ABC"):
                wave = level * np.cos(2 * np.pi * (50 * t - k / 3) - lag)
                quantity = {"V": "voltage", "A": "current"}[unit]
                name = f"{'U' if unit == 'V' else 'I'}{phase}"
                channels.append(
                    Channel(
                        name,
                        np.rint(30000 * wave).astype("<i2"),
                        unit,
                        quantity,
                        phase,
                        gain=size / 30000,
                    )
                )
        made = Recording(
            "made", channels, [Segment(0, 8000, 4000.0, 0.0)], start=datetime(2024, 1, 1)
        )
        return comtrade.write(made, tmp_path / "station.cfg")[0]

    def test_to_a_table_and_back_gives_the_same_integers(self, station, tmp_path):
        first = comtrade.load(station)
        table = tractexp.convert(station, to="parquet", folder=tmp_path / "a").files[0]
        made = tractexp.convert(table, to="comtrade", folder=tmp_path / "b").files
        same_recording(first, comtrade.load(made[0]))
        assert made[1].read_bytes() == station.with_suffix(".dat").read_bytes()

    @pytest.mark.parametrize("to", ["csv", "parquet", "comtrade", "cff"])
    def test_the_dip_is_the_same_in_every_format(self, station, tmp_path, to):
        converted = tractexp.convert(station, to=to, folder=tmp_path / "made")
        a, b = tractexp.read(station)[0], tractexp.read(converted.files[0])[0]
        for name in a.record.channels:
            np.testing.assert_array_equal(a.record.channels[name], b.record.channels[name])
        assert a.record.base == b.record.base

    def test_events_as_tables_are_the_records(self, station, tmp_path):
        events = tractexp.read(station)
        for source in (station, events, events[0]):
            made = tractexp.convert(source, to="csv", what="events", folder=tmp_path / "events")
            assert [path.name for path in made.files] == ["station_dip1.csv", "station_dip1.json"]
            same_record(events[0].record, tractexp.read(made.files[0])[0].record)

    def test_events_as_comtrade_are_the_waveforms_about_each_dip(self, station, tmp_path):
        made = tractexp.convert(
            station, to="comtrade", what="events", folder=tmp_path / "cut", pre=0.3, post=0.5
        )
        part, whole = comtrade.load(made.files[0]), comtrade.load(station)
        first = round(part.start.microsecond * 1e-6 * 4000)
        np.testing.assert_array_equal(
            part.channels[4].raw, whole.channels[4].raw[first : first + part.samples]
        )
        assert 0.99 < part.samples / 4000 < 1.01  # 0.8 s, and 0.1 s on either side
        assert tractexp.read(made.files[0])[0].depth == pytest.approx(
            tractexp.read(station)[0].depth, abs=1e-6
        )
        assert any("cut from" in note for note in part.notes) or part.samples < whole.samples

    def test_a_record_becomes_magnitudes_in_kilovolt_and_megawatt(self, tmp_path):
        record = a_record()
        path = tractexp.convert(record, to="comtrade", folder=tmp_path).files[0]
        made = {c.name: c for c in comtrade.load(path).channels}
        assert {name: c.unit for name, c in made.items()} == {
            "U": "kV",
            "P": "MW",
            "Q": "Mvar",
            "f": "Hz",
            "U2": "kV",
        }
        for channel in convert_record(record).channels:
            np.testing.assert_array_equal(made[channel.name].raw, channel.raw)

    def test_what_cannot_be_is_refused(self, station, tmp_path):
        table = write_record(a_record(name="dip"), tmp_path / "dip.csv")[0]
        for (source, to), says in [
            ((station, "xls"), "there is no writer 'xls'. Available: cff, comtrade, csv, parquet"),
            (
                (station, "comtrade"),
                "station.(cfg|dat) belongs to .*station.cfg, which is converted; give another"
                " folder",
            ),
            ((table, "parquet"), "dip.json belongs to .*dip.csv, which is converted"),
            ((tmp_path / "none.cfg", "csv"), "none.cfg: there is no such file"),
            (([3], "csv"), "a value of type int cannot be converted"),
            (("pkg://tractexp.data/tibet_50pct.cfg", "xls"), "there is no writer 'xls'"),
        ]:
            with pytest.raises(UserError, match=says):
                tractexp.convert(source, to=to, folder=tmp_path)
        with pytest.raises(UserError, match="what=recording: the file holds U, P, Q, no recording"):
            tractexp.convert(table, what="recording", folder=tmp_path / "x")
        with pytest.raises(UserError, match="events are taken as they are"):
            tractexp.convert(a_record(), skew=True)
