"""Tables as people have them: names, units, marks, titles, times, kinds; what is made of each, and
what is refused.
"""

import datetime as dt
import io
import json
import random
import time

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.filetypes.tabulated import kind_of
from tractexp.record import detect

RATE = 200.0
BASE = (27.5, 20.0)  # kV, MVA: what the records in kV and MW are of


def dip(n=400, rate=RATE):
    """(n, 4) t, U, P, Q per unit of a dip to 0.6, 6 digits."""
    t = np.arange(n) / rate
    U = np.where((t >= 0.5) & (t < 0.7), 0.6, 1.0)
    return np.round(np.column_stack([t, U, 0.8 * U, 0.6 * U**2]), 6)


def in_units(table=None):
    """The dip in kV, MW and Mvar."""
    table = dip() if table is None else table
    return table * [1, BASE[0], BASE[1], BASE[1]]


def text(table=None, header="t,U,P,Q", mark=",", point="."):
    table = dip() if table is None else table
    rows = (mark.join(f"{x:.9g}" for x in row) for row in table)
    return (
        "\n".join([*([header] if header else []), *(row.replace(".", point) for row in rows)])
        + "\n"
    )


def all_quoted():
    """The dip with every cell in quotes, semicolons between and commas in them."""
    lines = text(header="t;U;P;Q", mark=";", point=",").splitlines()
    return "\n".join('"' + line.replace(";", '";"') + '"' for line in lines)


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def read(content, name="dip.csv", **settings):
    """The record of a file of that text or those bytes."""
    with open(name, "wb") as file:
        file.write(content if isinstance(content, bytes) else content.encode())
    return build("data", {"name": "csv", "train": [name], **settings}).read().train[0]


def same(record, table=None, atol=1e-6):
    """Whether a record shows the dip, per unit."""
    table = dip() if table is None else table
    got = np.column_stack([record.t - record.t[0], record.U, record.P, record.Q])
    np.testing.assert_allclose(got, table - [table[0, 0], 0, 0, 0], atol=atol)


def noted(record, *words):
    """The one note with all those words."""
    return next(note for note in record.notes if all(word in note for word in words))


def says(record, *words):
    """Whether one note has all those words."""
    return any(all(word in note for word in words) for note in record.notes)


class TestNamesAndUnits:
    @pytest.mark.parametrize(
        "header",
        [
            "Time,Voltage,Active power,Reactive power",
            "time,V,P,Q",
            "Zeit,Spannung,Wirkleistung,Blindleistung",
            "时间,电压,有功功率,无功功率",
            "время,напряжение,активная мощность,реактивная мощность",
            "T,Vpos,P_total,Q_total",
            "timestamp,V1,Ptot,Qtot",
            '"Time","Voltage, positive sequence","P","Q"',
            "Time [s],v Bus 1,p PQ_1,q PQ_1",
            "b:tnow in s,m:u1:bus1 in p.u.,m:Psum:bus1 in p.u.,m:Qsum:bus1 in p.u.",
            "Time(s),VOLT 101 [BUS1 132.00],PLOD 101,QLOD 101",
            "t [s],U [pu],P [p.u.],Q (pu)",
            "# t,U,P,Q",
            "All calculations,Bus 1,Load 1,Load 1\nb:tnow in s,m:u1 in p.u.,m:Psum:bus1 in"
            " p.u.,m:Qsum:bus1 in p.u.",
        ],
    )
    def test_columns_are_known_by_many_names(self, header):
        record = read(text(header=header))
        same(record)
        assert header == "# t,U,P,Q" or noted(record, "columns: t = ")

    @pytest.mark.parametrize(
        "header",
        [
            "Time [s],U [kV],P [MW],Q [Mvar]",
            "t/s,U/kV,P/MW,Q/MVAr",
            "Zeit in s,Spannung in kV,Wirkleistung in MW,Blindleistung in Mvar",
            "t_s,U_kV,P_MW,Q_Mvar",
            "Zeitpunkt in s,Bus 1\\m:Ul in kV,Load 1\\m:P:bus1 in MW,Load 1\\m:Q:bus1 in Mvar",
            "All calculations,Bus 1,Load 1,Load 1\nTime in s,m:U1l in kV,m:Psum:bus1 in"
            " MW,m:Qsum:bus1 in Mvar",
            "Results,Bus 1,Load 1,Load 1\nb:tnow,m:Ul,m:P:bus1,m:Q:bus1\ns,kV,MW,Mvar",
            "时间(秒),线电压（kV）,有功功率(MW),无功功率(Mvar)",
            "t,U,P,Q\ns,kV,MW,Mvar",
            "t,U,P,Q\n[s],[kV],[MW],[Mvar]",
            "s,kV,MW,Mvar\nb:tnow,m:Ul,m:P:bus1,m:Q:bus1",
            "case 7\n[s],[kV],[MW],[Mvar]\nTime,Voltage,P,Q",
            "Results,Bus 1,Load 1,Load 1\ns,kV,MW,Mvar\nb:tnow,m:Ul,m:P:bus1,m:Q:bus1",
            "Time,Line voltage,P,Q\n(s),(kV),(MW),(Mvar)",
            "recorder 7\nstation: North, feeder 2\n\nt,U,P,Q\n,kV,MW,Mvar",
        ],
    )
    def test_units_stand_in_the_header_or_in_a_row_below_and_give_the_base(self, header):
        record = read(text(in_units(), header))
        same(record)
        assert (record.base.voltage, record.base.power) == pytest.approx(BASE)
        assert noted(
            record, "base: 27.5 kV line to line and 20 MVA, the steady state before the first dip"
        )
        assert noted(record, "[kV]", "[MW]")

    def test_the_smaller_units_are_taken_to_the_greater(self):
        table = dip() * [1000, 27500, 20000, 20000]
        record = read(text(table, "t [ms],U [V],P [kW],Q [kvar]"))
        same(record)
        assert (record.base.voltage, record.base.power) == pytest.approx(BASE)

    def test_units_can_be_said_and_a_base_given_stands(self):
        record = read(
            text(in_units()), units={"U": "kV", "P": "MW", "Q": "Mvar"}, base_voltage=25.0
        )
        assert (record.base.voltage, record.base.power) == pytest.approx((25.0, 20.0))
        same(record, dip() * [1, 1.1, 1, 1])

    def test_power_without_a_unit_beside_kilovolts_is_asked_for(self):
        content = text(in_units(), "t,U [kV],P,Q")
        with pytest.raises(
            UserError,
            match=r"U is in kV, and the unit of P and Q is not told; .*data.units=\{P: MW",
        ):
            read(content)
        same(read(content, units={"P": "MW", "Q": "Mvar"}))
        same(read(content, base_voltage=27.5, base_power=20.0))

    @pytest.mark.parametrize("header", ["t,U [kV],P [kW],Q", "t,U [kV],P,Q [Mvar]"])
    def test_powers_of_which_one_has_no_unit_are_asked_for(self, header):
        with pytest.raises(
            UserError,
            match=r"has no unit, and other columns of P and Q have one; say them, .*Q: Mvar",
        ):
            read(text(in_units(), header))

    @pytest.mark.parametrize("header", ["t [kV],U,P,Q", "t,U [kV],P [Hz],Q", "t,U [s],P,Q"])
    def test_a_unit_of_another_quantity_is_refused(self, header):
        with pytest.raises(UserError, match=r"is no unit; say another column, .*data.units=\{"):
            read(text(in_units(), header))

    @pytest.mark.parametrize(
        ("units", "by"),
        [
            ({"U": "volts", "P": "MW", "Q": "Mvar"}, 1.0),  # 27.5 V
            ({"U": "kV", "P": "MW", "Q": "Mvar"}, 1e3),  # 27,500 kV
        ],
    )
    def test_a_load_that_no_network_feeds_ends_in_a_question(self, units, by):
        with pytest.raises(UserError, match=r"before the first dip is .*say .*data.units=\{U: "):
            read(text(in_units() * [1, by, 1, 1]), units=units)
        assert read(
            text(in_units() * [1, 1e3, 1, 1]), units=units | {"U": "V"}
        ).base.voltage == pytest.approx(27.5)

    @pytest.mark.parametrize(
        ("f", "nominal"), [(59.9, 60), (60.02, 60), (49.8, 50), (16.7, 50 / 3)]
    )
    def test_the_frequency_recorded_says_which_is_nominal(self, f, nominal):
        table = np.column_stack([in_units(), np.full(400, f)])
        record = read(text(table, "t,U [kV],P [MW],Q [Mvar],f [Hz]"))
        assert record.base.frequency == pytest.approx(nominal)
        assert (record.f == f).all()
        assert says(record, "is taken for nominal") == (nominal != 50)

    @pytest.mark.parametrize(
        ("header", "f"), [("FREQ 101", 0.0), ("f", -0.02), ("df [mHz]", 15.0), ("f", 1.0)]
    )
    def test_a_deviation_is_no_frequency(self, header, f):
        record = read(text(np.column_stack([dip(), np.full(400, f)]), f"t,U,P,Q,{header}"))
        assert record.f is None
        assert header == "df [mHz]" or noted(
            record, "a deviation from the nominal frequency", "not used"
        )
        same(record)

    def test_a_frequency_per_unit_is_said_to_be_one(self):
        table = np.column_stack([dip(), np.full(400, 0.998)])
        assert read(text(table, "t,U,P,Q,f [pu]")).f[0] == pytest.approx(49.9)
        assert read(text(table, "t,U,P,Q,f"), units={"f": "pu"}).f[0] == pytest.approx(49.9)

    @pytest.mark.parametrize(
        ("header", "says"),
        [
            (
                "time,SFS_UfRel,SFS_UgRel,SFS_PRel",
                r"say which is which: .*\{U: \.\.\., P: \.\.\., Q: \.\.\.\}",
            ),
            (
                "time,voltage_N,real_power,reactive_power",
                r"if voltage_N is meant, say so: .*\{U: 'voltage_N'",
            ),
            (
                "time,U,Pa,x",
                r"column P, Q is missing; .*if Pa is meant, say so: data.columns=\{P: 'Pa', Q:"
                r" \.\.\.\}",
            ),
            ("C1MAG,U,P,x", r"column t, Q is missing; .*: data.columns=\{t: 'C1MAG', Q: \.\.\.\}"),
        ],
    )
    def test_a_hint_names_what_is_of_the_quantity_or_nothing(self, header, says):
        with pytest.raises(UserError, match=says):
            read(text(header=header))

    def test_a_hint_on_a_name_given_is_no_column_of_another_quantity(self):
        with pytest.raises(UserError, match=r"has no such column\. Columns: t, Voltage, I_MAG, Q"):
            read(text(header="t,Voltage,I_MAG,Q"), columns={"U": "C_MAG"})

    @pytest.mark.parametrize(
        "header", ["t,v Bus 5,Ppq PQ 5,Qpq PQ 5", "Time(s),VOLT 5,POWR 5 TO 6,VARS 5 TO 6"]
    )
    def test_the_names_of_simulators(self, header):
        same(read(text(header=header)))

    def test_a_column_can_be_left_out(self):
        table = np.column_stack([dip(), np.full(400, 33.0)])
        with pytest.raises(UserError, match=r"f = 33 .*data.columns=\{f: null\}"):
            read(text(table, "t,U,P,Q,f"))
        assert read(text(table, "t,U,P,Q,f"), columns={"f": None}).f is None

    def test_a_load_counted_out_of_itself_is_refused_and_turned_by_the_setting(self):
        t, U, P, Q = dip().T
        turned = text(np.column_stack([t, U, -P * U, -Q]))
        with pytest.raises(
            UserError, match=r"P is -0.8 before the first dip: .*set data.reverse_current=true"
        ):
            read(turned)
        assert read(turned, reverse_current=True).P[0] == pytest.approx(0.8)

    def test_powers_that_may_be_exchanged_are_said_to_be_so(self):
        t, U, P, Q = dip().T
        assert noted(
            read(text(np.column_stack([t, U, Q, P]))), "may be exchanged (data.columns={P: ..."
        )
        assert not says(read(text()), "exchanged")

    def test_a_base_in_volts_is_refused(self):
        with pytest.raises(UserError, match=r"base_voltage=27500.* at most 1500"):
            read(text(in_units() * [1, 1e3, 1, 1]), base_voltage=27500.0, base_power=20.0)

    def test_a_phase_voltage_is_said_to_be_taken_as_such(self):
        record = read(
            text(in_units() / [1, np.sqrt(3), 1, 1], "t,Ua [kV],P [MW],Q [Mvar]"),
            columns={"U": "Ua"},
        )
        same(record)
        assert record.base.voltage == pytest.approx(27.5)
        assert noted(record, "phase voltage", "sqrt(3)")
        assert noted(
            read(text(in_units(), "t,U [kV],P [MW],Q [Mvar]")), "U taken as line-to-line voltage"
        )

    @pytest.mark.parametrize("names", ["Ua,Ub,Uc", "UA,UB,UC", "U1,U2,U3", "V_L1,V_L2,V_L3"])
    def test_three_phases_make_one_voltage_and_one_power(self, names):
        t, U, P, Q = in_units().T
        table = np.column_stack(
            [t, U / np.sqrt(3), U / np.sqrt(3), U / np.sqrt(3), P / 3, P / 3, P / 3, Q]
        )
        units = ",".join(f"{name} [kV]" for name in names.split(","))
        record = read(text(table, f"t,{units},Pa [MW],Pb [MW],Pc [MW],Q [Mvar]"))
        same(record)
        assert record.base.voltage == pytest.approx(27.5)
        assert noted(record, "U is the mean of Ua, Ub, Uc")
        assert noted(record, "P is the sum of Pa, Pb, Pc")

    def test_the_contract_wins_over_other_spellings(self):
        t, U, P, Q = dip().T
        record = read(
            text(
                np.column_stack([t, U, P, Q, 5 * U, 0.01 * U, np.full(400, 50)]),
                "t,U,P,Q,Voltage,U2,Frequency",
            )
        )
        same(record)
        assert (record.U2 is not None, record.f is not None) == (True, True)
        assert noted(record, "columns not used: Voltage")

    @pytest.mark.parametrize("columns", [{"U": "Bus 2 V", "P": "P_total"}, {"v": 2, "P": 3}])
    def test_a_mapping_says_which_of_several(self, columns):
        t, U, P, Q = dip().T
        table = np.column_stack([t, 0.9 * U, U, P, 2 * P, Q])
        content = text(table, "t,Bus 1 V,Bus 2 V,P_total,P_aux,Q")
        same(read(content, columns=columns))
        with pytest.raises(
            UserError,
            match=r"U could be any of the columns 'Bus 1 V', 'Bus 2 V'; .*data.columns=\{U:",
        ):
            read(content, columns={"P": "P_total"})

    def test_a_name_may_be_given_with_its_unit(self):
        same(
            read(
                text(in_units(), "t,A (kV),B (MW),C (Mvar)"),
                columns={"U": "A (kV)", "P": "B", "Q": "C[Mvar]"},
            )
        )

    def test_a_file_without_names_is_mapped_by_number(self):
        content = text(header="")
        same(read(content, columns={"t": 0, "U": 1, "P": 2, "Q": 3}))
        with pytest.raises(
            UserError, match=r"no line names the columns; .*data.columns=\{t: 0, U: 1, P: 2, Q: 3\}"
        ):
            read(content)

    def test_the_sidecar_may_hold_mapping_units_and_base(self):
        told = {
            "columns": {"U": "x", "P": "y", "Q": "z"},
            "base": {"voltage": 27.5, "power": 20},
            "notes": ["from 7"],
        }
        with open("dip.json", "w") as file:
            json.dump(told, file)
        record = read(text(in_units(), "t,x,y,z"), units={"U": "kV", "P": "MW", "Q": "Mvar"})
        same(record)
        assert record.notes[0] == "from 7"

    def test_reverse_current_negates_the_powers(self):
        same(read(text(dip() * [1, 1, -1, -1]), reverse_current=True))

    @pytest.mark.parametrize(
        ("settings", "says"),
        [
            ({"columns": {"W": "x"}}, "data.columns names 'W'"),
            (
                {"columns": {"U": "Vlt"}},
                "data.columns: U=Vlt: dip.csv has no such column; did you mean 'V'|Columns",
            ),
            ({"columns": {"U": 9}}, "dip.csv has 4 columns, counted from 0"),
            ({"units": {"U": "parsec"}}, "data.units: U=parsec is not a unit"),
            ({"units": {"X": "kV"}}, "data.units names 'X'"),
            ({"units": {"t": "kV"}}, "data.units: t=kV is no unit of t; one is s, ms"),
            ({"units": {"U": "MW"}}, "data.units: U=MW is no unit of U; one is kV, V, pu"),
            ({"units": {"P": "Mvar"}}, "data.units: P=Mvar is no unit of P"),
            ({"units": {"angle": "Hz"}}, "data.units: angle=Hz is no unit of angle"),
            ({"decimal": ";"}, "data.decimal=; is not one of"),
            ({"header": 0}, "data.header=0 is no line"),
            ({"header": 300}, "there are no rows of numbers below the header line|column t"),
            ({"pre": 0.0}, "data.pre=0.0 is out of range"),
            ({"encoding": "klingon"}, "data.encoding=klingon: there is no such text encoding"),
        ],
    )
    def test_a_bad_setting_is_refused(self, settings, says):
        with pytest.raises(UserError, match=says):
            read(text(), **settings)


class TestText:
    @pytest.mark.parametrize(
        ("content", "note"),
        [
            (text(header="t;U;P;Q", mark=";", point=","), ""),
            (text(header="t\tU\tP\tQ", mark="\t", point=","), ""),
            (text(header="t U P Q", mark=" "), ""),
            (text(header="  t     U    P   Q", mark="   "), ""),
            (text(header="% t U P Q", mark="  "), ""),
            (text(header="t|U|P|Q", mark="|"), ""),
            (text(header='"t","U","P","Q"').replace("\n0.1,", '\n"0.1",'), ""),
            (all_quoted(), ""),
            (text().replace("\n", "\r\n"), ""),
            (text().replace("\n", "\r"), ""),
            (text().replace("\n", "\n\n"), ""),
            ("\ufeff" + text(), ""),
            (text().encode("utf-16"), "read as utf-16 text"),
            (text().encode("utf-16-le"), "read as utf-16-le text"),
            (text(header="时间,电压,有功功率,无功功率").encode("gbk"), "read as gbk text"),
            (
                text(header="Время,Напряжение,Активная мощность,Реактивная мощность").encode(
                    "cp1251"
                ),
                "cp1251",
            ),
            (("Prüfstand Süd\n" + text(header="Zeit,U,P,Q")).encode("latin-1"), "latin-1"),
            (text(header="t,U,P,Q,").replace("\n", ",\n").replace("Q,,", "Q,"), ""),
            ("Station North\nRecorder: 7; 12.5 kHz\nDate, 2024-01-31, 12:00:00\n\n" + text(), ""),
            ("# remark\n" + text().replace("0.1,1", "# in between\n0.1,1") + "# the end\n", ""),
            (text()[: text().rindex("0.8")], "line 401, the last one, is cut short and not used"),
        ],
        ids=[
            "semicolons and decimal commas",
            "tabs and decimal commas",
            "spaces",
            "aligned",
            "after a percent sign",
            "bars",
            "quoted",
            "all quoted",
            "dos",
            "old mac",
            "blank lines",
            "marked utf-8",
            "utf-16",
            "utf-16 unmarked",
            "gbk",
            "cp1251",
            "latin-1",
            "trailing comma",
            "titles",
            "remarks",
            "cut short",
        ],
    )
    def test_whatever_way_it_is_written_it_is_the_same_record(self, content, note):
        record = read(content)
        same(record, dip()[: record.samples])
        assert record.samples >= 399
        assert not note or noted(record, note)

    @pytest.mark.parametrize("gap", ["", "#N/A", "-", "NaN", "n/a", "null", "--", " "])
    def test_a_gap_in_P_or_Q_is_left_out(self, gap):
        lines = text().splitlines()
        for line in (11, 21):
            cells = lines[line].split(",")
            lines[line] = ",".join([*cells[:2], gap, cells[3]])
        record = read("\n".join(lines))
        assert np.flatnonzero(np.isnan(record.P)).tolist() == [10, 20]
        assert not np.isnan(record.Q).any()

    def test_digits_are_exact(self):
        values = np.random.default_rng(3).normal(1, 0.001, (400, 4))
        values[:, 0] = np.arange(400) * 1e-3
        rows = "\n".join(",".join(map(repr, row)) for row in values.tolist())
        for content in ("t,U,P,Q\n" + rows, "t,U,P,Q,x\n" + rows.replace("\n", ",#N/A\n") + ",x"):
            record = read(content)
            assert np.array_equal(np.column_stack([record.U, record.P, record.Q]), values[:, 1:])

    def test_the_header_line_can_be_said(self):
        content = "t,U,P,Q\n0,5,5,5\n" + text(header="t,U,P,Q")
        same(read(content, header=3))

    @pytest.mark.parametrize(
        ("content", "says"),
        [
            (b"\x00\x01\x02" * 400, "byte 1 is zero: this is no text"),
            (b"\x89PNG\r\n", "this is no table but a picture"),
            (b"PAR1 and nothing", "not a whole Parquet file"),
            (b"PK\x03\x04 and nothing", "not a workbook that can be read"),
            (b"%PDF-1.7", "this is no table but a PDF file"),
            ("title\n" * 300, "there are no rows of numbers"),
            (
                text().replace("0.5,0.6", '"0.5,0.6'),
                "line 401: the cells cannot be separated; is a quote not closed",
            ),
            (text().replace("0.5,0.6", "0.5,0,6"), "line 102 has 5 cells where the others have 4"),
        ],
    )
    def test_what_is_no_table_is_refused_in_a_sentence(self, content, says):
        with pytest.raises(UserError, match=says):
            read(content)

    def test_a_folder_is_no_file_whatever_its_name(self, tmp_path):
        (tmp_path / "csv").mkdir()
        for path in ("csv", str(tmp_path / "csv")):
            with pytest.raises(
                UserError, match=f"{path} is a folder, .*task=survey data.path={path}"
            ):
                build("data", {"name": "csv", "train": [path]}).read()

    @pytest.mark.parametrize("content", [b"t,U,P,Q\n" + b"1," * 10_000_000, b"x" * 20_000_000])
    def test_a_line_without_end_is_refused_at_once(self, content):
        begin = time.perf_counter()
        with pytest.raises(UserError, match="characters; a row of a table has at most"):
            read(content)
        assert time.perf_counter() - begin < 2


class TestTimes:
    @pytest.mark.parametrize(
        "stamp",
        [
            lambda t: (dt.datetime(2024, 3, 31, 1, 59, 59) + dt.timedelta(seconds=t)).isoformat(),
            lambda t: (
                (dt.datetime(2024, 3, 31, 1, 59, 59) + dt.timedelta(seconds=t)).isoformat(" ")
                + "+01:00"
            ),
            lambda t: (
                (dt.datetime(2024, 3, 31, 1, 59, 59) + dt.timedelta(seconds=t)).isoformat() + "Z"
            ),
            lambda t: f"31.03.2024 {_clock(86398 + t) if t < 2 else ''}",
            lambda t: _clock(86399 + t),
            lambda t: _clock(3599 + t)[3:],
            lambda t: f"{1_700_000_000 + t:.6f}",
            lambda t: (dt.datetime(2024, 12, 31, 23, 59, 59) + dt.timedelta(seconds=t)).strftime(
                "%m/%d/%Y %I:%M:%S.%f %p"
            ),
        ],
        ids=[
            "iso",
            "zoned",
            "utc",
            "day first",
            "clock past midnight",
            "minutes",
            "epoch",
            "am and pm",
        ],
    )
    def test_times_of_day_and_dates_are_seconds_from_the_first_row(self, stamp):
        table = dip()
        rows = [f"{stamp(t)},{U},{P},{Q}" for t, U, P, Q in table.tolist()]
        same(read("\n".join(["Timestamp,U,P,Q", *rows])), atol=2e-6)

    def test_date_and_time_may_stand_in_two_columns(self):
        rows = [f"2024-01-31,{_clock(3600 + t)},{U},{P},{Q}" for t, U, P, Q in dip().tolist()]
        same(read("\n".join(["Date,Time,U,P,Q", *rows])), atol=2e-6)

    @pytest.mark.parametrize("power", [0, 3, 6, 9])
    def test_digits_say_what_is_counted_since_1970(self, power):
        table = dip()
        first = 17 * 10 ** (8 + power)
        rows = [
            f"{first + round(t * 10**power)}" if power else f"{first + t:.3f}" for t in table[:, 0]
        ]
        lines = [
            f"{t},{U:.6g},{P:.6g},{Q:.6g}" for t, (_, U, P, Q) in zip(rows, table, strict=True)
        ]
        record = read("\n".join(["timestamp,U,P,Q", *lines]))
        assert record.step == pytest.approx(0.005, rel=1e-4)
        assert power == 0 or says(
            record, f"t is in {['ms', 'us', 'ns'][power // 3 - 1]} since 1970"
        )

    def test_the_day_is_told_in_a_note(self):
        rows = [f"2024-01-31T12:00:0{t:.3f},{U},{P},{Q}" for t, U, P, Q in dip().tolist()]
        assert noted(read("\n".join(["t,U,P,Q", *rows])), "t counted from 2024-01-31T12:00:00")

    def test_a_bad_time_is_refused_with_its_place(self):
        rows = [f"{_clock(3600 + t)},{U},{P},{Q}" for t, U, P, Q in dip().tolist()]
        rows[6] = "noon,1,1,1"
        with pytest.raises(
            UserError, match=r"line 8, column t: 'noon' is no time, such as 12:00:00.25"
        ):
            read("\n".join(["t,U,P,Q", *rows]))

    def test_event_instants_of_a_simulator_are_resampled_with_a_note(self):
        """ANDES writes the row before and after a switching 0.1 ms apart, and its grid goes on from
        there.
        """
        t, *rest = dip().T
        t = np.concatenate([t[:100], t[100:140] + 1e-4, t[140:] + 2e-4])
        t, at = np.concatenate([t, [0.5, 0.7]]), np.concatenate([np.arange(400), [99, 139]])
        order = np.argsort(t, kind="stable")
        record = read(text(np.column_stack([t[order], *(x[at][order] for x in rest)])))
        assert noted(
            record,
            "between the usual ones, as a simulator writes the instants of events",
            "every 0.005 s",
        )
        assert detect(record).depth == pytest.approx(0.4)
        assert detect(record).t_start == pytest.approx(0.5, abs=0.01)

    def test_two_rows_of_one_time_are_a_switching(self):
        table = dip()
        both = np.insert(table, 100, [0.5, 1.0, 0.8, 0.6], axis=0)
        record = read(text(both))
        k = int(np.argmax(record.U < 0.99))
        assert record.U[k - 1] == 1.0
        assert record.U[k] == pytest.approx(0.6, abs=0.01)
        assert (record.t[k - 1] + record.t[k]) / 2 == pytest.approx(0.5)
        assert noted(record, "1 row lies between the usual ones")

    def test_steps_that_a_solver_chose_are_resampled_with_a_note(self):
        steps = np.random.default_rng(1).uniform(0.5e-3, 9e-3, 800)
        t = np.concatenate([[0], np.cumsum(steps)])
        U = np.interp(t, [0, 1, 1.01, 1.3, 1.31, 9], [1, 1, 0.6, 0.6, 1, 1])
        record = read(text(np.column_stack([t, U, 0.8 * U, 0.6 * U])))
        assert noted(record, "as a simulator chooses them", "resampled linearly")
        assert detect(record).depth == pytest.approx(0.4, abs=1e-3)

    @pytest.mark.parametrize(
        "lost", [[*range(50, 54)], [*range(50, 54), 200], list(range(20, 400, 9))]
    )
    def test_missing_rows_are_told_as_such(self, lost):
        with pytest.raises(
            UserError,
            match=rf"line {lost[0] + 2}: t advances by .* where 0.005 s is usual: rows are",
        ):
            read(text(np.delete(dip(), lost, axis=0)))

    def test_times_with_too_few_digits_are_told_as_such(self):
        table = dip(rate=2000.0)
        table[:, 0] = np.round(table[:, 0], 3)
        with pytest.raises(UserError, match="t has too few digits"):
            read(text(table))

    def test_a_slow_record_is_too_coarse(self):
        with pytest.raises(
            UserError,
            match=r"one sample every 0.1 s is too coarse: .*at least 20 samples per second",
        ):
            read(text(dip(200, 10.0)))


def _clock(t):
    t = t % 86400
    return f"{int(t // 3600):02d}:{int(t % 3600 // 60):02d}:{t % 60:09.6f}"


class TestParquet:
    def frame(self, names=("t", "U", "P", "Q"), **more):
        import pandas

        return pandas.DataFrame(dict(zip(names, in_units().T, strict=True)) | more)

    def test_numbers_are_exact_and_gaps_are_gaps(self):
        frame = self.frame()
        frame.loc[5, "P"] = None
        frame.to_parquet("dip.parquet")
        record = build(
            "data", {"name": "csv", "path": "dip.parquet", "base_voltage": 27.5, "base_power": 20.0}
        ).read()
        assert np.array_equal(record.train[0].U, frame["U"].to_numpy() / 27.5)
        assert np.flatnonzero(np.isnan(record.train[0].P)).tolist() == [5]

    def test_names_units_and_times_as_in_text(self):
        import pandas

        stamps = pandas.to_datetime(dip()[:, 0], unit="s", origin="2024-01-31", utc=True)
        frame = self.frame(
            ("x", "Voltage [kV]", "Active power (MW)", "Q/Mvar"), Timestamp=stamps
        ).drop(columns="x")
        frame.to_parquet("dip.parquet", index=False)
        event = tractexp.read("dip.parquet")[0]
        same(event.record)

    def test_a_bad_cell_is_named(self):
        frame = self.frame(("t", "U [kV]", "P [MW]", "Q [Mvar]"))
        frame["P [MW]"] = ["oops" if k == 7 else str(x) for k, x in enumerate(frame["P [MW]"])]
        frame.to_parquet("dip.parquet", index=False)
        with pytest.raises(
            UserError, match=r"dip.parquet: row 8, column P: 'oops' is not a number"
        ):
            build("data", {"name": "csv", "path": "dip.parquet"}).read()


class TestExcel:
    def write(self, rows, name="dip.xlsx", before=()):
        import xlsxwriter

        out = io.BytesIO()
        book = xlsxwriter.Workbook(
            out, {"in_memory": True, "default_date_format": "yyyy-mm-dd hh:mm:ss.000"}
        )
        for title, content in (*before, ("Data", rows)):
            sheet = book.add_worksheet(title)
            for k, row in enumerate(content):
                sheet.write_row(k, 0, row)
        book.close()
        with open(name, "wb") as file:
            file.write(out.getvalue())

    def test_titles_names_and_units_are_found(self):
        head = [["Recorder 7"], [], ["Time", "Voltage", "P", "Q"], ["s", "kV", "MW", "Mvar"]]
        self.write([*head, *in_units().tolist()], before=[("About", [["measured on a Tuesday"]])])
        record = tractexp.read("dip.xlsx")[0].record
        same(record)
        assert noted(record, "sheet 'Data' read, not About")
        for sheet in ("Data", 2):
            assert (
                build("data", {"name": "csv", "path": "dip.xlsx", "sheet": sheet})
                .read()
                .train[0]
                .samples
                == 400
            )
        with pytest.raises(UserError, match=r"sheet=Dta: .*did you mean 'Data'"):
            tractexp.read("dip.xlsx", sheet="Dta")

    def test_dates_are_times(self):
        start = dt.datetime(2024, 1, 31, 23, 59, 59)
        rows = [[start + dt.timedelta(seconds=t), U, P, Q] for t, U, P, Q in dip().tolist()]
        self.write([["Time", "U", "P", "Q"], *rows])
        same(tractexp.read("dip.xlsx")[0].record, atol=1e-3)

    def test_a_bad_cell_is_named_with_its_row(self):
        rows = [["t", "U", "P", "Q"], *dip().tolist()]
        rows[8][1] = "oops"
        self.write(rows)
        with pytest.raises(
            UserError, match="sheet 'Data': row 9, column U: 'oops' is not a number"
        ):
            tractexp.read("dip.xlsx")


class TestPhasors:
    def stream(self, U2=0.0, f=50.0, n=400):
        """Phasors (n,) V1, V2, I1 of the dip in V and A, and their times."""
        t, U, P, Q = dip(n).T
        turn = np.exp(2j * np.pi * (f - 50) * t + 0.3j)
        V1 = U * 27.5e3 / np.sqrt(3) * turn
        I1 = ((P + 1j * Q) * 20e6 / (3 * V1)).conj()
        return t, V1, U2 * np.abs(V1).max() * turn, I1

    def columns(self, X1, X2=0.0):
        a = np.exp(2j * np.pi / 3)
        return [X1 + X2, a**2 * X1 + a * X2, a * X1 + a**2 * X2]

    def test_three_phases_give_both_sequences_and_the_frequency(self):
        t, V1, V2, I1 = self.stream(U2=0.02, f=50.1)
        names, table = ["Timestamp"], [t]
        for letter, phasors in (("V", self.columns(V1, V2)), ("I", self.columns(I1))):
            for phase, X in zip("ABC", phasors, strict=True):
                names += [f"{letter}{phase}_Magnitude", f"{letter}{phase}_Angle"]
                table += [np.abs(X), np.degrees(np.angle(X))]
        record = read(text(np.column_stack(table), ",".join(names)))
        assert kind_of("dip.csv") == "phasors"
        same(record, atol=1e-5)
        np.testing.assert_allclose(record.U2, 0.02, rtol=1e-4)
        np.testing.assert_allclose(record.f, 50.1, atol=1e-4)
        assert (record.base.voltage, record.base.power) == pytest.approx(BASE, rel=1e-6)
        assert noted(record, "f from the angle of the voltage")

    @pytest.mark.parametrize(
        ("header", "scale", "turn"),
        [
            (
                "Time,V1 Magnitude (V),V1 Angle (deg),I1 Magnitude (A),I1 Angle"
                " (deg),Frequency,DFDT",
                1.0,
                180 / np.pi,
            ),
            ("t,V1 [kV],V1_angle [rad],I1 [kA],I1_angle [rad],f [Hz],ROCOF", 1e-3, 1.0),
            (
                "Time,VPOS_MAG(kV),VPOS_ANG(degrees),IPOS_MAG(kA),IPOS_ANG(degrees),FREQ,DF",
                1e-3,
                180 / np.pi,
            ),
            ("time,U [kV],U angle [deg],I [kA],I angle [deg],freq [Hz],df/dt", 1e-3, 180 / np.pi),
        ],
    )
    def test_a_positive_sequence_stream(self, header, scale, turn):
        t, V1, _, I1 = self.stream()
        f = np.full(len(t), 49.98)
        table = [
            t,
            scale * np.abs(V1),
            turn * np.angle(V1),
            scale * np.abs(I1),
            turn * np.angle(I1),
            f,
            0 * t,
        ]
        record = read(text(np.column_stack(table), header))
        same(record, atol=1e-5)
        assert (record.f == 49.98).all()
        assert record.U2 is None

    @pytest.mark.parametrize("units", [("[kV]", ""), ("", "[A]"), ("[pu]", "[A]"), ("[V]", "")])
    def test_units_of_one_quantity_alone_are_no_answer(self, units):
        t, V1, _, I1 = self.stream()
        table = [t, 0.4 * np.abs(V1) / np.abs(V1[0]), np.angle(V1), np.abs(I1), np.angle(I1)]
        with pytest.raises(UserError, match=r"say the units, e.g. data.units=\{U: kV, I: A\}"):
            read(
                text(
                    np.column_stack(table),
                    f"t,V1 {units[0]},V1 angle [rad],I1 {units[1]},I1 angle [rad]",
                )
            )

    def test_a_kilovolt_without_a_unit_is_not_per_unit(self):
        t, V1, _, I1 = self.stream()
        table = [t, 1200 * np.abs(V1) / np.abs(V1[0]), np.angle(V1), np.abs(I1), np.angle(I1)]
        record = read(text(np.column_stack(table), "t,V1,V1 angle [rad],I1,I1 angle [rad]"))
        assert record.base.voltage == pytest.approx(1.2 * np.sqrt(3))

    def test_the_names_of_a_micro_pmu(self):
        t, V1, _, I1 = self.stream()
        table = [t, np.abs(V1), np.degrees(np.angle(V1)), np.abs(I1), np.degrees(np.angle(I1))]
        record = read(
            text(np.column_stack(table), "t,L1MAG,L1ANG,C1MAG,C1ANG"), units={"angle": "deg"}
        )
        same(record, atol=1e-5)
        assert says(record, "U1 = 'L1MAG'", "I1_angle = 'C1ANG'")

    @pytest.mark.parametrize(
        ("name", "size", "said"),
        [
            ("V", 1.0, "taken as phase to ground: times sqrt(3) it is 27.5 kV"),
            ("V", np.sqrt(3), "taken as line to line: 27.5 kV"),
            ("V LL", np.sqrt(3), ""),
            ("V LL", 0.9 * np.sqrt(3), ""),
            ("V1", 0.9, ""),
        ],
    )
    def test_one_voltage_is_line_or_phase_by_its_name_or_its_size(self, name, size, said):
        t, V1, _, I1 = self.stream()
        table = np.column_stack([t, size * np.abs(V1), np.angle(V1), np.abs(I1), np.angle(I1)])
        record = read(text(table, f"t,{name} [V],{name} angle [rad],I [A],I angle [rad]"))
        by = size / (np.sqrt(3) if size > 1 else 1)
        assert record.base.voltage == pytest.approx(27.5 * by)
        assert record.base.power == pytest.approx(20.0 * by)
        assert says(record, "taken as") == bool(said)
        assert says(record, said)

    def test_line_voltages_are_taken_to_phases(self):
        t, V1, _, I1 = self.stream()
        a, b, c = self.columns(V1)
        names, table = ["t"], [t]
        for name, X in zip(
            ["VAB", "VBC", "VCA", "IA", "IB", "IC"],
            [a - b, b - c, c - a, *self.columns(I1)],
            strict=True,
        ):
            names += [f"{name} Mag ({'V' if name[0] == 'V' else 'A'})", f"{name} Ang (deg)"]
            table += [np.abs(X), np.degrees(np.angle(X))]
        same(read(text(np.column_stack(table), ",".join(names))), atol=1e-5)

    def test_units_that_cannot_be_told_are_asked_for(self):
        t, V1, _, I1 = self.stream()
        table = np.column_stack(
            [t, np.abs(V1) / 1e3, np.full(400, 0.1), np.abs(I1), np.full(400, -0.2)]
        )
        content = text(table, "t,V1,V1_angle,I1,I1_angle")
        with pytest.raises(
            UserError, match=r"'V1' has no unit, .*say the units, e.g. data.units=\{U: kV"
        ):
            read(content)
        with pytest.raises(UserError, match=r"'V1_angle' has no unit, .*data.units=\{angle: deg\}"):
            read(content, units={"U": "kV", "I": "A"})

    def test_magnitudes_without_angles_are_no_power(self):
        t, V1, _, I1 = self.stream()
        with pytest.raises(
            UserError, match=r"magnitudes without angles, .*add P and Q, or the angles"
        ):
            read(text(np.column_stack([t, np.abs(V1), np.abs(I1)]), "t,Ua [V],Ia [A]"))


class TestWaveforms:
    RATE = 4000.0

    def waves(self, seconds=2.0):
        """t, ua, ub, uc [V], ia, ib, ic [A] of a dip of 40 % at 0.8 s."""
        t = np.arange(round(seconds * self.RATE)) / self.RATE
        level = np.where((t >= 0.8) & (t < 1.0), 0.6, 1.0)
        turn = 2 * np.pi * (50 * t[:, None] - np.array([0, 1, 2]) / 3)
        u = 22453.0 * level[:, None] * np.cos(turn)
        return np.column_stack([t, u, 400 * level[:, None] * np.cos(turn - 0.5)])

    def test_they_are_known_by_their_content_and_read_as_channels(self):
        with open("rec.csv", "w") as file:
            file.write(text(self.waves(), "t,ua,ub,uc,ia,ib,ic"))
        assert kind_of("rec.csv") == "waves"
        recording = build("data", {"name": "waveforms", "path": "rec.csv"}).recording()
        assert [c.name for c in recording.channels] == ["ua", "ub", "uc", "ia", "ib", "ic"]
        assert [c.quantity for c in recording.channels] == ["voltage"] * 3 + ["current"] * 3
        assert [c.phase for c in recording.channels] == [*"ABC", *"ABC"]
        assert recording.segments[0].rate == pytest.approx(4000)
        np.testing.assert_allclose(
            recording.channels[0].values(), self.waves()[:, 1] * 1e-3, rtol=1e-6, atol=1e-4
        )
        assert any(
            "no unit of ua, ub, uc, ia, ib, ic: taken as V and A" in n for n in recording.notes
        )

    @pytest.mark.parametrize(
        "header",
        [
            "t,UA(kV),UB(kV),UC(kV),IA(A),IB(A),IC(A)",
            "时间,A相电压(kV),B相电压(kV),C相电压(kV),A相电流(A),B相电流(A),C相电流(A)",
        ],
    )
    def test_tractexp_read_finds_their_dips(self, header):
        with open("rec.csv", "w") as file:
            file.write(text(self.waves() * [1, 1e-3, 1e-3, 1e-3, 1, 1, 1], header))
        recording = build("data", {"name": "waveforms", "path": "rec.csv"}).recording()
        event = tractexp.read("rec.csv", voltages=[0, 1, 2], currents=[3, 4, 5])[0]
        assert [c.unit for c in recording.channels] == ["kV"] * 3 + ["A"] * 3
        assert event.depth == pytest.approx(0.4, abs=2e-3)
        assert event.record.base.voltage == pytest.approx(27.5, rel=1e-3)
        assert event.record.base.power == pytest.approx(3 * 22.453 * 0.4 / 2, rel=1e-3)

    def test_one_voltage_and_one_current(self):
        with open("rec.csv", "w") as file:
            file.write(text(self.waves()[:, [0, 1, 4]], "t;u [V];i [A]", ";", ","))
        assert kind_of("rec.csv") == "waves"
        recording = build("data", {"name": "waveforms", "path": "rec.csv"}).recording()
        assert [c.quantity for c in recording.channels] == ["voltage", "current"]

    def test_a_gap_in_time_parts_the_file(self):
        with open("rec.csv", "w") as file:
            file.write(
                text(np.delete(self.waves(), np.arange(2000, 2040), axis=0), "t,ua,ub,uc,ia,ib,ic")
            )
        recording = build("data", {"name": "waveforms", "path": "rec.csv"}).recording()
        assert [(s.first, s.stop) for s in recording.segments] == [(0, 2000), (2000, 7960)]
        assert recording.segments[1].start == pytest.approx(0.51)
        assert any("1 gaps in time, the first at line 2002" in note for note in recording.notes)

    def test_each_reader_says_whose_the_other_file_is(self):
        with open("rec.csv", "w") as file:
            file.write(text(self.waves(), "t,ua,ub,uc,ia,ib,ic"))
        with pytest.raises(
            UserError, match=r"rec.csv holds waveforms .*data=waveforms data.path=rec.csv"
        ):
            build("data", {"name": "csv", "path": "rec.csv"}).read()
        with open("dip.csv", "w") as file:
            file.write(text())
        with pytest.raises(
            UserError, match=r"dip.csv holds powers, not waveforms; .*data=csv data.path=dip.csv"
        ):
            build("data", {"name": "waveforms", "path": "dip.csv"}).recording()


class TestManyDips:
    def long(self, dips=5, every=20.0, rate=100.0):
        t = np.arange(round(dips * every * rate)) / rate
        U = np.where(
            (t % every >= 8) & (t % every < 8.3), 0.95 - 0.1 * np.floor(t / every) / dips, 1.0
        )
        return np.column_stack([t, U, 0.8 * U, 0.6 * U])

    def events(self, **settings):
        with open("long.csv", "w") as file:
            file.write(text(self.long()))
        return build("data", {"name": "csv", "path": "long.csv", **settings}).read()

    def test_dips_are_numbered_and_the_first_is_fitted(self):
        events = self.events()
        assert [r.name for r in (*events.train, *events.validate)] == [
            f"long_dip{k}" for k in range(1, 6)
        ]
        assert [r.source for r in events.train] == ["long.csv dip 1"]
        assert noted(events.train[0], "5 dips")
        record = events.validate[2]
        assert (record.t[0], record.t[-1]) == pytest.approx((67.0, 77.99))
        assert detect(record).depth == pytest.approx(0.11)

    def test_the_window_of_what_recorded_it_is_the_record_s(self, tmp_path):
        path = tmp_path / "dip.csv"
        path.write_text(text())
        (plain,), (event,) = tractexp.read(path), tractexp.read(path, estimator="p_class")
        assert plain.record.window is None
        assert (event.record.window.name, event.record.window.length) == (
            "p_class",
            pytest.approx(0.04),
        )
        with pytest.raises(UserError, match="p_clas"):
            tractexp.read(path, estimator="p_clas")

    def test_dips_and_window_can_be_chosen(self):
        events = self.events(train=[3], validate=[5, 1], pre=0.5, post=2.0)
        assert [detect(r).t_start for r in (*events.train, *events.validate)] == pytest.approx(
            [48, 88, 8]
        )
        assert events.train[0].t[-1] - events.train[0].t[0] == pytest.approx(2.49)
        assert self.events(validate=[]).validate == []
        with pytest.raises(
            UserError, match="there is no dip 9; the file has 5; dips that can be used: 1 at"
        ):
            self.events(train=[9])

    def test_tractexp_read_gives_them_all(self):
        self.events()
        assert [event.t_start for event in tractexp.read("long.csv")] == pytest.approx(
            [8, 28, 48, 68, 88]
        )

    def test_one_dip_is_the_whole_file(self):
        with open("dip.csv", "w") as file:
            file.write(text())
        assert tractexp.read("dip.csv")[0].record.samples == 400
        assert tractexp.read("dip.csv", post=0.5)[0].record.samples == 200

    def test_records_of_one_call_share_the_base_of_the_first(self):
        for name, scale in (("a.csv", 1.0), ("b.csv", 1.1)):
            with open(name, "w") as file:
                file.write(text(in_units() * [1, scale, scale, scale], "t,U [kV],P [MW],Q [Mvar]"))
        events = build("data", {"name": "csv", "train": ["a.csv"], "validate": ["b.csv"]}).read()
        assert events.validate[0].base == events.train[0].base
        assert events.validate[0].U[0] == pytest.approx(1.1)


def mutated(data, rng):
    """A file with a few bits, marks, lines or its end changed."""
    data = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 5])):
        i = rng.randrange(len(data)) if rng.random() < 0.6 else rng.randrange(min(len(data), 200))
        change = rng.randrange(5)
        if change == 0:
            data[i] ^= 1 << rng.randrange(8)
        elif change == 1:
            data[i : i + rng.choice([0, 1, 3])] = rng.choice(MARKS)
        elif change == 2:
            del data[i : i + rng.choice([1, 10, 200])]
        elif change == 3:
            data[i:i] = data[i : i + rng.choice([1, 10, 200])]
        else:
            lines = bytes(data).split(b"\n")
            lines.insert(rng.randrange(len(lines)), lines[rng.randrange(len(lines))])
            data = bytearray(b"\n".join(lines))
    return bytes(data)


MARKS = [
    b",",
    b";",
    b"\n",
    b"\t",
    b'"',
    b"#",
    b"nan",
    b"inf",
    b"-",
    b"1e308",
    b"1e999",
    b"\x00",
    b"\xff",
    b"",
    b"99:99",
    b"1_0",
    b"0x1p3",
    b"9" * 400,
    b"\xe2\x80\xa8",
    b"2024-01-01",
    b"'",
    b"%",
]
LEAKS = (
    "Error",
    "invalid literal",
    "could not convert",
    "NoneType",
    "list index",
    "codec can't",
    "Traceback",
    "Invalid:",
)


@pytest.mark.parametrize("seed", range(2))  # of every format: study/test_mutated_files.py
def test_a_mutated_file_is_read_or_refused_in_a_sentence(seed):
    rng = random.Random(seed)
    stamps = (f"2024-01-31 {_clock(3600 + t)},{U},{P},{Q}" for t, U, P, Q in dip().tolist())
    sound = [
        text().encode(),
        text(in_units(), "t [s];U [kV];P [MW];Q [Mvar]", ";", ",").encode(),
        text().encode("utf-16"),
        text(header="时间,电压,有功功率,无功功率").encode("gbk"),
        text(header="t U P Q", mark=" ").encode(),
        "\n".join(["Timestamp,U,P,Q", *stamps]).encode(),
    ]
    for _ in range(25):
        with open("dip.csv", "wb") as file:
            file.write(mutated(rng.choice(sound), rng))
        begin = time.process_time()
        try:
            tractexp.read("dip.csv")
        except UserError as error:
            said = str(error)
        else:
            said = ""
        assert not [leak for leak in LEAKS if leak in said], said
        assert time.process_time() - begin < 2


def test_a_column_is_chosen_by_a_name_or_a_number():
    with pytest.raises(UserError, match=r"P must be the name of a column of .*, or its number"):
        read(text(dip()), columns={"P": {"a": None}})
