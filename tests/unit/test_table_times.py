"""Times as tables have them: by clocks that are set, in days, in two columns, digits in groups; and
cut tables.
"""

import datetime as dt

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.filetypes.cells import BadCell, find_group_mark, parse_numbers
from tractexp.filetypes.clock import parse_times
from tractexp.record import detect

START = dt.datetime(2024, 3, 1, 10, 15, 30)


def dip(seconds=20.0, rate=50.0):
    """t [s], U [kV], P [MW], Q [Mvar] (N,) of a dip of 30 % at 8 s for 0.3 s; 110 kV, 20 MW, 8
    Mvar.
    """
    t = np.round(np.arange(0, seconds, 1 / rate), 6)
    u = np.where((t >= 8) & (t < 8.3), 0.7, 1.0)
    return t, 110 * u, 20 * u**1.5, 8 * u**2


@pytest.fixture
def read(tmp_path, monkeypatch):
    """The whole record of a table of times and the dip above."""
    monkeypatch.chdir(tmp_path)

    def made(cells, header="Time", mark=",", values="{:.4f}", **settings):
        columns = [[values.format(x) for x in column] for column in dip()[1:]]
        lines = [mark.join((header, "U (kV)", "P (MW)", "Q (Mvar)"))]
        lines += [mark.join(row) for row in zip(cells, *columns, strict=True)]
        (tmp_path / "dip.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
        return build("data", {"name": "csv", "path": "dip.csv", **settings}).table()[0]

    return made


def is_the_dip(record, start=START):
    event = detect(record)
    assert event.t_start - record.t[0] == pytest.approx(8.0, abs=0.011)
    assert event.depth == pytest.approx(0.3, abs=0.01)
    assert (record.base.voltage, record.base.power) == pytest.approx(
        (110, np.hypot(20, 8)), rel=1e-3
    )
    begun = record.identity.get("time")
    assert (
        begun is None
        if start is None
        else abs((dt.datetime.fromisoformat(begun) - start).total_seconds()) < 1e-3
    )


def stamps(form, start=START, jumps=()):
    """Times of the dip by a clock that is moved by so many hours from so many seconds on."""
    t = dip()[0]
    hours = sum((np.where(t >= at, by, 0.0) for at, by in jumps), np.zeros(len(t)))
    moments = [
        start + dt.timedelta(seconds=x, hours=h)
        for x, h in zip(t.tolist(), hours.tolist(), strict=True)
    ]
    return [moment.strftime(form) for moment in moments]


def test_days_as_spreadsheets_count_them(read):
    first = (START - dt.datetime(1899, 12, 30)) / dt.timedelta(days=1)
    record = read([f"{first + x / 86400:.10f}" for x in dip()[0]])
    is_the_dip(record)
    assert any("days since 1899" in note for note in record.notes)


@pytest.mark.parametrize("heading", ["Time [days]", "t (day)"])
def test_days_by_their_unit(read, heading):
    is_the_dip(read([f"{x / 86400:.12f}" for x in dip()[0]], heading), start=None)


def test_seconds_of_the_day_are_no_days(read):
    is_the_dip(read([f"{45352.4 + x:.3f}" for x in dip()[0]]), start=None)


def test_days_of_too_few_digits_are_refused_with_what_helps(read):
    with pytest.raises(
        UserError, match=r"line \d+: times are days since 1899.*too few digits.*ten decimals"
    ):
        read([f"{45352.4274305556 + x / 86400:.6f}" for x in dip()[0]])


@pytest.mark.parametrize("whole", [1_000_000, 1000, 16_777_215, 16_777_216, 10_000_000])
def test_seconds_and_fractions_in_two_columns(read, whole):
    soc = int(START.replace(tzinfo=dt.UTC).timestamp())
    t = dip()[0]
    cells = [f"{soc + int(x + 1e-9)},{round((x + 1e-9) % 1 * whole)}" for x in t]
    is_the_dip(read(cells, "SOC,FRACSEC"))


def test_the_quality_of_the_clock_above_the_fraction_is_left_out(read):
    soc = int(START.replace(tzinfo=dt.UTC).timestamp())
    cells = [
        f"{soc + int(x + 1e-9)},{(0x0F << 24) + round((x + 1e-9) % 1 * 1e6)}" for x in dip()[0]
    ]
    is_the_dip(read(cells, "SOC,FRACSEC"))


@pytest.mark.parametrize(
    ("header", "by"), [("Time,Milliseconds", 1e3), ("Time,ms", 1e3), ("Time,Fraction", 1.0)]
)
def test_a_clock_of_whole_seconds_and_its_fractions(read, header, by):
    cells = [
        f"{stamp},{(x + 1e-9) % 1 * by:.3f}"
        for stamp, x in zip(stamps("%H:%M:%S"), dip()[0], strict=True)
    ]
    is_the_dip(read(cells, header), start=None)


def test_date_and_time_in_two_columns_give_the_moment(read):
    is_the_dip(read(stamps("%d.%m.%Y,%H:%M:%S.%f"), "Date,Time"))


@pytest.mark.parametrize(
    ("values", "mark"),
    [
        ("{:,.1f}", ";"),
        ("{:,.1f}", "\t"),
        ("swiss", ";"),
        ("narrow", ";"),
        ("german", ";"),
        ("quoted", ","),
    ],
)
def test_digits_in_groups(tmp_path, monkeypatch, values, mark):
    monkeypatch.chdir(tmp_path)
    ways = {
        "swiss": lambda x: f"{x:,.1f}".replace(",", "'"),
        "narrow": lambda x: f"{x:,.1f}".replace(",", "\u202f"),
        "german": lambda x: f"{x:,.1f}".replace(",", "_").replace(".", ",").replace("_", "."),
        "quoted": lambda x: f'"{x:,.1f}"',
    }
    write = ways.get(values, values.format)
    t = [f"{x:.2f}".replace(".", "," if values == "german" else ".") for x in dip()[0]]
    rows = zip(t, *([write(1e3 * x) for x in column] for column in dip()[1:]), strict=True)
    lines = [mark.join(("t", "U [V]", "P [kW]", "Q [kvar]")), *(mark.join(row) for row in rows)]
    (tmp_path / "dip.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    record = build("data", {"name": "csv", "path": "dip.csv"}).table()[0]
    is_the_dip(record, start=None)
    assert any("grouped by" in note for note in record.notes)


def test_what_may_be_a_decimal_mark_is_no_group():
    assert find_group_mark([["0,125", "110,250"]], ",") == ""
    assert find_group_mark([["0.125", "110,250"]], ".") == ","
    assert find_group_mark([["0.125", "110,25"]], ".") == ""
    assert parse_numbers(["1,234,567.5", "999.5", "-12,000"], group=",").tolist() == [
        1234567.5,
        999.5,
        -12000,
    ]


AUTUMN, SPRING = dt.datetime(2024, 10, 27, 2, 59, 51), dt.datetime(2024, 3, 31, 1, 59, 51)


@pytest.mark.parametrize(
    ("start", "jumps", "said"),
    [
        (AUTUMN, [(9, -1)], "line 452: the clock was set back by 3600 s"),
        (SPRING, [(9, 1)], "the clock was set forth by 3600 s"),
        (START, [(9, -5 / 3600)], "the clock was set back by 5 s"),
        (START, [(9, -5 / 3600), (12, 5 / 3600)], "the clock was set forth by 5 s"),
    ],
)
def test_a_clock_that_was_set_runs_on(read, start, jumps, said):
    record = read(stamps("%Y-%m-%d %H:%M:%S.%f", start, jumps))
    is_the_dip(record, start)
    assert any(said in note for note in record.notes), record.notes


@pytest.mark.parametrize("start", [START, dt.datetime(2024, 3, 31, 10, 59, 51)])
def test_an_hour_that_is_missing_by_day_is_a_gap(read, start):
    with pytest.raises(UserError, match="missing"):
        read(stamps("%Y-%m-%d %H:%M:%S.%f", start, [(9, 1)]))


def test_rows_that_were_exchanged_are_no_clock_that_was_set(read):
    cells = stamps("%Y-%m-%d %H:%M:%S.%f")
    cells[100], cells[101] = cells[101], cells[100]
    with pytest.raises(UserError, match="time does not increase"):
        read(cells)


@pytest.mark.parametrize("form", ["%Y-%m-%dT%H:%M:%S.%fZ", "%H:%M:%S.%f"])
def test_a_minute_of_61_seconds(read, form):
    start = dt.datetime(2016, 12, 31, 23, 59, 51)
    t = dip()[0]
    cells = [(start + dt.timedelta(seconds=x - (x >= 10))).strftime(form) for x in t.tolist()]
    leap = (t >= 9) & (t < 10)
    cells = [
        f"{start:%Y-%m-%dT}23:59:{51 + x:.2f}Z"[11 * ("Y" not in form) :] if now else cell
        for cell, x, now in zip(cells, t.tolist(), leap, strict=True)
    ]
    cells = [cell if "Y" in form else cell.removesuffix("Z") for cell in cells]
    assert any("23:59:60.5" in cell for cell in cells)
    is_the_dip(read(cells), start if "Y" in form else None)


@pytest.mark.parametrize(
    ("cells", "start"),
    [
        (["03/01/2024 10:15:30 PM", "03/01/2024 10:15:31 PM"], dt.datetime(2024, 3, 1, 22, 15, 30)),
        (["03/01/2024 10:15:30", "03/01/2024 10:15:31"], dt.datetime(2024, 1, 3, 10, 15, 30)),
        (["03/01/2024 23:59:59", "03/02/2024 00:00:00"], dt.datetime(2024, 3, 1, 23, 59, 59)),
        (["03/12/2024 10:00:00", "03/13/2024 10:00:00"], dt.datetime(2024, 3, 12, 10)),
        (["31/12/24 23:59:59", "01/01/25 00:00:00"], dt.datetime(2024, 12, 31, 23, 59, 59)),
        (["12/31/24 11:59:59 pm", "01/01/25 12:00:00 am"], dt.datetime(2024, 12, 31, 23, 59, 59)),
    ],
)
def test_the_order_of_day_and_month_is_that_of_the_column(cells, start):
    read = parse_times(cells)
    assert read.start == start
    assert (np.diff(read.values) > 0).all()


def test_a_date_that_may_be_two_is_said_and_one_that_may_not_is_not():
    assert (
        "read as 03 January 2024, day before month"
        in parse_times(["03/01/2024 10:15:30", "03/01/2024 10:15:31"]).remarks[0][1]
    )
    assert (
        "01 March 2024, month before day, as with AM"
        in parse_times(["03/01/2024 10:15:30 AM"]).remarks[0][1]
    )
    assert parse_times(["2024-03-01 10:15:30", "2024-03-01 10:15:31"]).remarks == ()
    assert parse_times(["13/03/2024 10:15:30"]).remarks == ()


def test_events_late_in_a_log_are_told_by_the_clock(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    t = np.round(np.arange(0, 200, 0.02), 6)
    u = np.where((t >= 150) & (t < 150.3), 0.7, 1.0)
    moments = (f"{START + dt.timedelta(seconds=x):%Y-%m-%d %H:%M:%S.%f}" for x in t.tolist())
    rows = zip(moments, 110 * u, 20 * u**1.5, 8 * u**2, strict=True)
    text = "\n".join(
        ["Time,U (kV),P (MW),Q (Mvar)", *(f"{a},{b:.4f},{c:.4f},{d:.4f}" for a, b, c, d in rows)]
    )
    (tmp_path / "log.csv").write_text(text + "\n")
    seen = tractexp.look("log.csv", progress=False)
    assert seen.content["files"][0]["start"] == START.isoformat()
    assert next(iter(seen.events))["when"] == "2024-03-01T10:18:00"
    first = str(seen.summary()).lstrip().splitlines()[0]
    assert first.startswith("dip 1 at 150.000 s, 2024-03-01 10:18:00.000 (30")
    assert "150.000, 2024-03-01 10:18:00.000" in str(seen.table())


@pytest.mark.parametrize("written", ["16 2/3", "50/3", "16,7", "16.67"])
def test_a_third_of_50_hz_is_read_however_it_is_written(tmp_path, written):
    from tractexp.filetypes import comtrade

    lines = ["S,R,1999", "1,1A,0D", "1,U,,,kV,1,0,0,-9,9,1,1,P", written, "1", "1000,2"]
    lines += ["01/03/2024,10:15:30.000000"] * 2 + ["ASCII", "1"]
    (tmp_path / "r.cfg").write_text("\n".join(lines) + "\n")
    (tmp_path / "r.dat").write_text("1,0,1\n2,1000,2\n")
    assert comtrade.load(tmp_path / "r.cfg").frequency == pytest.approx(50 / 3, rel=3e-3)


ROWS = [
    f"{k * 0.01:.2f},{0.7 if 60 <= k < 110 else 1.0},{0.5 if 60 <= k < 110 else 0.9},0.3456"
    for k in range(200)
]


@pytest.mark.parametrize("cut", [1, 2, 3, 4])
def test_a_value_that_is_cut_is_said_and_not_read(tmp_path, cut):
    (tmp_path / "cut.csv").write_text("\n".join(["t,U,P,Q", *ROWS])[:-cut])
    record = build("data", {"name": "csv", "path": str(tmp_path / "cut.csv")}).table()[0]
    assert set(record.Q) == {0.3456}
    assert any("line 201, the last one, has no line end" in note for note in record.notes)


@pytest.mark.parametrize("end", ["", "\n", "\r\n"])
def test_a_whole_last_line_is_read_without_a_word(tmp_path, end):
    (tmp_path / "whole.csv").write_text("\n".join(["t,U,P,Q", *ROWS]) + end)
    record = build("data", {"name": "csv", "path": str(tmp_path / "whole.csv")}).table()[0]
    assert (record.samples, record.notes) == (200, ())


def test_a_last_value_of_unlike_digits_is_read_and_the_missing_line_end_said(tmp_path):
    rows = [*ROWS[:-2], ROWS[-2][:-3], ROWS[-1][:-3]]
    (tmp_path / "open.csv").write_text("\n".join(["t,U,P,Q", *rows]))
    record = build("data", {"name": "csv", "path": str(tmp_path / "open.csv")}).table()[0]
    assert (record.samples, record.Q[-1]) == (200, 0.3)
    assert any("may be cut short" in note for note in record.notes)


@pytest.mark.parametrize(("zone", "hours"), [("+08:00", 8), ("-0330", -3.5), ("Z", 0)])
def test_a_zone_is_told_where_times_are_turned_into_utc(read, zone, hours):
    cells = [
        f"{START + dt.timedelta(seconds=float(x)):%Y-%m-%dT%H:%M:%S.%f}{zone}" for x in dip()[0]
    ]
    record = read(cells)
    is_the_dip(record, START - dt.timedelta(hours=hours))
    told = [note for note in record.notes if "told in UTC" in note]
    assert [f"those of UTC{zone}" in note for note in told] == [True] * (hours != 0)


@pytest.mark.parametrize(
    ("cell", "second"),
    [
        ("20240301T101530", 30.0),
        ("20240301T101530.25", 30.25),
        ("20240301T111530,5+01:00", 30.5),
        ("20240301T101530Z", 30.0),
        ("Fri Mar  1 10:15:30 2024", 30.0),
        ("Fri Mar 1 10:15:30.75 2024", 30.75),
        ("2024年03月01日 10时15分30.5秒", 30.5),
        ("2024-03-01 10h15m30.25s", 30.25),
    ],
)
def test_times_in_the_basic_form_and_of_asctime(cell, second):
    found = parse_times([cell])
    assert found.start == START + dt.timedelta(seconds=second - 30)
    assert found.begin == pytest.approx(10 * 3600 + 15 * 60 + second)


@pytest.mark.parametrize("cell", ["20241301T101530", "20240301T1015", "Fri Foo 1 10:15:30 2024"])
def test_what_only_looks_like_them_is_refused(cell):
    with pytest.raises(BadCell):
        parse_times([cell])


@pytest.mark.parametrize("cell", ["061:10:15:30.250", "10h15m30.25s", "10时15分30.25秒"])
def test_hours_with_units_and_those_of_irig_are_times_of_day(cell):
    assert parse_times([cell]).begin == pytest.approx(10 * 3600 + 15 * 60 + 30.25)


def test_a_time_with_something_behind_it_is_refused_with_how_times_are_written(read):
    with pytest.raises(tractexp.UserError, match=r"CET' is no time, such as 12:00:00.25"):
        read([f"10:15:{x:09.6f} CET" for x in dip()[0]])
