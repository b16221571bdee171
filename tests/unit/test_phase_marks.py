"""One vocabulary of phases: whatever a table or a recording calls them, 110 kV, 20 MW and 8 Mvar
come out.
"""

import re
from pathlib import Path

import numpy as np
import pytest

import tractexp
from tractexp.filetypes import comtrade
from tractexp.filetypes.column_unit import split_unit
from tractexp.filetypes.columns import find_role, order_of
from tractexp.recording import Channel, Recording, Segment

ORDERS = ["ABC", "RST", "RYB", "RWB", "UVW", ("L1", "L2", "L3"), "АВС"]
LINES = [
    "U {}-{}",
    "U_{}_{}",
    "Vrms {} {} Avg",
    "U{}-U{}",
    "V {}/{}",
    "Spannung {}-{}",
    "{}-{}",
    "Tensión {}{}",
    "电压{}{}",
]
GROUND = ["U {}N", "V {}-G", "U_{}_N", "Vrms {}N Avg", "V{}-E"]
PLAIN = ["U {}", "V_{}", "Phase {} voltage", "{} voltage", "{}相电压", "Напряжение фаза {}"]
SIZE = (110.0, 20.0, 8.0)  # kV, MW, Mvar


def slow(seconds=20.0, rate=50.0):
    """t, U [kV], P [MW], Q [Mvar] of a dip of 30 % at 8 s."""
    t = np.arange(0, seconds, 1 / rate)
    u = np.where((t >= 8) & (t < 8.3), 0.7, 1.0)
    few = 1 + 3e-4 * np.random.default_rng(0).standard_normal((3, len(t)))
    return t, 110 * u * few[0], 20 * u**1.5 * few[1], 8 * u**2 * few[2]


def read(path, header, columns):
    np.savetxt(
        path,
        np.array(columns).T,
        delimiter=",",
        header=header,
        comments="",
        fmt="%.5f",
        encoding="utf-8",
    )
    event = tractexp.read(path)[0]
    base = event.record.base
    return (base.voltage, event.P0 * base.power, event.Q0 * base.power), event.record.notes


def pairs(order):
    return [(order[k], order[(k + 1) % 3]) for k in range(3)]


def test_the_table_of_the_docs_is_true_in_each_order():
    """Each form of docs/records.md is what its column says, in the letters of each order."""
    page = (Path(__file__).parents[2] / "docs" / "records.md").read_text()
    names = page.partition("## Names of phases")[2]
    row = re.search(r"^\| ABC.*$", names, re.MULTILINE)[0]
    orders, two, ground, *_ = (cell.strip() for cell in row.strip("|").split("|"))
    assert {"ABC", "RST", "RYB", "RWB", "UVW"} <= {*re.findall(r"[A-Z]{3}", orders)}
    told = {True: re.findall(r"`([^`]+)`", two), False: re.findall(r"`([^`]+)`", ground)}
    assert (len(told[True]), len(told[False])) == (7, 4)
    for line, forms in told.items():
        for form in forms:
            name = form if len(form) > 2 else f"U {form}"
            for letters in ("ABC", "RST", "RYB", "RWB", "L1L2L3"):
                marks = re.findall(r"[A-Z]\d?", letters)
                spelled = _spell(name, marks)
                units = ["kV"] * len(spelled)
                roles = [find_role(one, "kV", order_of(spelled, units)) for one in spelled]
                assert all(one is not None and one.line is line for one in roles), spelled


def _spell(name, marks):
    """A form of the table in three phases of another order; a form without marks by itself."""
    first = next(
        (
            p
            for p in (("L1", "L2"), ("R", "Y"), ("a", "b"), ("A", "B"), ("1", "2"))
            if p[0] in name and (p[1] in name or name[-1:] in "nNG")
        ),
        None,
    )
    if first is None or name in ("U LL", "U LN") or (first[0] == "1" and len(marks[0]) > 1):
        return [name]
    spelled = []
    for k in range(3):
        here, there = marks[k], marks[(k + 1) % 3]
        parts = re.split(f"({first[0]}|{first[1]})", name)
        spelled.append("".join({first[0]: here, first[1]: there}.get(p, p) for p in parts))
    return spelled


@pytest.mark.parametrize("order", ORDERS, ids="".join)
def test_names_of_columns_say_their_phases_and_whether_they_are_between_two(order):
    lines = [[form.format(*pair) for pair in pairs(order)] for form in LINES]
    ground = [[form.format(mark) for mark in order] for form in GROUND]
    plain = [[form.format(mark) for mark in order] for form in PLAIN]
    for forms, line in ((lines, True), (ground + plain, False)):
        for names in forms:
            spelled = order_of(names, ["kV"] * 3)
            roles = [find_role(name, "kV", spelled) for name in names]
            marks = ("ab", "bc", "ca") if line else "abc"
            assert [one.key for one in roles] == [f"U{mark}" for mark in marks], names
            assert {bool(one.line) for one in roles} == {line}, names
    for forms, line in ((lines, True), (ground, False)):
        for first, *_ in forms:
            alone = find_role(first, "kV", order_of([first], ["kV"]))
            assert (alone.quantity, alone.line) == ("U", line), first


@pytest.mark.parametrize("order", [ORDERS[0], ORDERS[-2]], ids="".join)
def test_columns_of_magnitudes(tmp_path, order):
    """Of phases by line and by ground, three or one of them; the names of all are told above."""
    t, U, P, Q = slow()
    columns = (
        [LINES[0].format(*pair) for pair in pairs(order)],
        [GROUND[0].format(mark) for mark in order],
        [PLAIN[0].format(mark) for mark in order],
    )
    for names, share in zip(columns, (1, np.sqrt(3), np.sqrt(3)), strict=True):
        header = "t," + ",".join(f"{name} (kV)" for name in names) + ",P (MW),Q (Mvar)"
        got, _ = read(tmp_path / "a.csv", header, [t, *[U / share] * 3, P, Q])
        assert got == pytest.approx(SIZE, rel=0.01), names
    for (name, *_), share in zip(columns[:2], (1, np.sqrt(3)), strict=True):
        got, _ = read(tmp_path / "a.csv", f"t,{name} (kV),P (MW),Q (Mvar)", [t, U / share, P, Q])
        assert got == pytest.approx(SIZE, rel=0.01), name


@pytest.mark.parametrize(
    ("order", "form"), [(ORDERS[0], "V {}-{}"), (ORDERS[1], "U_{}_{}"), (ORDERS[-2], "V{}-V{}")]
)
def test_phasors_of_line_voltages(tmp_path, order, form):
    t, U, P, Q = slow()
    turn = np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]
    V, I = U / np.sqrt(3) * turn, np.conj((P + 1j * Q) / (np.sqrt(3) * U)) * turn
    lines, names = V - V[[1, 2, 0]], [form.format(*pair) for pair in pairs(order)]
    for kept in ([0, 1, 2], [0, 1]):  # two say the third
        header, columns = "t", [t]
        voltages = [(names[k], "kV", lines[k]) for k in kept]
        for name, unit, z in (
            *voltages,
            *((f"I {mark}", "kA", I[k]) for k, mark in enumerate(order)),
        ):
            header += f",{name} mag ({unit}),{name} ang (deg)"
            columns += [np.abs(z), np.degrees(np.angle(z))]
        got, _ = read(tmp_path / "a.csv", header, columns)
        assert got == pytest.approx(SIZE, rel=0.01), (names, kept)


@pytest.mark.parametrize("order", [ORDERS[0], ORDERS[-1]], ids="".join)
def test_channels_of_a_recording(tmp_path, order):
    t = np.arange(0, 1.5, 1 / 1600)
    u = np.where((t >= 0.8) & (t < 1.0), 0.7, 1.0)
    turn = np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]
    V = 110 / np.sqrt(3) * u * turn
    I = np.conj((20 + 8j) / (3 * 110 / np.sqrt(3)) * u) * turn
    for form in ("U {}-{}", "V{}{}", "U_{}_{}", "U{}-U{}"):
        names = [form.format(*pair) for pair in pairs(order)] + [f"I {mark}" for mark in order]
        values = np.sqrt(2) * np.real(
            np.concatenate([V - V[[1, 2, 0]], I]) * np.exp(2j * np.pi * 50 * t)
        )
        channels = [
            Channel(
                name,
                np.round(x / np.abs(x).max() * 30000).astype(np.int16),
                "kV" if k < 3 else "kA",
                "voltage" if k < 3 else "current",
                gain=np.abs(x).max() / 30000,
            )
            for k, (name, x) in enumerate(zip(names, values, strict=True))
        ]
        made = Recording("made", channels, [Segment(0, len(t), 1600.0, 0.0)], 50.0, "s", "r")
        path = next(p for p in comtrade.write(made, tmp_path / "a.cfg") if p.suffix == ".cfg")
        event = tractexp.read(path)[0]
        base = event.record.base
        assert (base.voltage, event.P0 * base.power, event.Q0 * base.power) == pytest.approx(
            SIZE, rel=0.01
        ), names


def test_where_no_name_tells_the_power_or_the_nominal_voltage_does(tmp_path):
    t, U, P, Q = slow()
    I = 1000 * np.hypot(P, Q) / (np.sqrt(3) * U)
    got, notes = read(
        tmp_path / "a.csv",
        "t,Voltage (kV),Current (A),P (MW),Q (Mvar)",
        [t, U / np.sqrt(3), I, P, Q],
    )
    assert got == pytest.approx(SIZE, rel=0.01)
    assert any("P and Q are the product" in note for note in notes)
    got, notes = read(
        tmp_path / "a.csv", "t,Ua (kV),Ub (kV),Uc (kV),P (MW),Q (Mvar)", [t, U, U, U, P, Q]
    )
    assert got == pytest.approx(SIZE, rel=0.01)
    assert any(
        "110 kV is near a nominal voltage, and times sqrt(3) near none" in note for note in notes
    )


@pytest.mark.parametrize(
    ("name", "line"),
    [
        *((name, True) for name in ("Leiterspannung", "Vline", "線間電圧 RS", "전압 L1-L2")),
        *((name, True) for name in ("Phase-to-phase voltage", "Gerilim L1-L2", "U12 avg")),
        *((name, False) for name in ("Vph", "Uphase", "VPN", "相電圧 R", "Tension simple V1")),
        *((name, False) for name in ("Tensión simple L1", "Sternspannung L1", "A相电压")),
        *((name, True) for name in ("VLLab", "V_LL_AB", "Vll 12", "AB_Voltage")),
        *((name, False) for name in ("V_LN_A", "VLN1", "R-N Volt", "L1-N Voltage")),
        *((name, True) for name in ("Uph-ph", "VL-L", "Vphase-phase avg")),
        *((name, False) for name in ("Voltage to neutral", "UL-E", "Uph-n", "V to ground")),
    ],
)
def test_names_of_programs_and_languages_say_line_or_ground(name, line):
    meant = find_role(name, "kV", "rst" if "R" in name else "abc")
    assert (meant.quantity, meant.line) == ("U", line)


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("AB_Voltage_kV", ("AB_Voltage", "kV")),
        ("P_total_MW", ("P_total", "MW")),
        ("I_L1_kA", ("I_L1", "kA")),
        ("Voltage, kV", ("Voltage", "kV")),
        ("Q_MVAR", ("Q", "MVAR")),
        ("Phase_S", ("Phase_S", "")),
    ],
)
def test_a_unit_is_the_last_of_several_words(name, parts):
    assert split_unit(name) == parts


@pytest.mark.parametrize(
    ("name", "share"),
    [
        *((name, 1.0) for name in ("Uline", "U line", "Uлин", "U_л", "Line voltage")),
        *((name, np.sqrt(3)) for name in ("Phase voltage", "U phase", "V_phase", "Uф")),
    ],
)
def test_line_or_phase_said_in_a_word(tmp_path, name, share):
    t, U, P, Q = slow()
    got, _ = read(tmp_path / "a.csv", f"t,{name} (kV),P (MW),Q (Mvar)", [t, U / share, P, Q])
    assert got == pytest.approx(SIZE, rel=0.01)


@pytest.mark.parametrize(
    "header",
    [
        "Tensão (kV),Potência ativa (MW),Potência reativa (Mvar)",
        "Napięcie (kV),Moc czynna (MW),Moc bierna (Mvar)",
        "Jännite kV,Pätöteho MW,Loisteho MVAR",
        "Napětí [kV],Činný výkon [MW],Jalový výkon [Mvar]",
        "전압(kV),유효전력(MW),무효전력(Mvar)",
        "电压(千伏),功率(兆瓦),无效功率(兆乏)",
    ],
)
def test_in_whatever_language_the_only_column_of_a_unit_is_what_it_measures(tmp_path, header):
    t, U, P, Q = slow()
    got, notes = read(tmp_path / "a.csv", f"t,{header}", [t, U, P, Q])
    assert got == pytest.approx(SIZE, rel=0.01)
    assert any(note.startswith("columns: t = 't'") or "U = " in note for note in notes)


def test_of_two_columns_of_a_unit_none_is_taken_by_it(tmp_path):
    t, U, P, Q = slow()
    with pytest.raises(tractexp.UserError, match="column P is missing"):
        read(tmp_path / "a.csv", "t,U (kV),Moc (MW),Straty (MW),Q (Mvar)", [t, U, P, P / 9, Q])


def test_three_voltages_and_currents_of_any_name_are_those_of_the_phases(tmp_path):
    t = np.arange(0, 2, 1 / 1600)
    u = np.where((t >= 1) & (t < 1.2), 0.7, 1.0) * np.sqrt(2)
    turn = np.exp(2j * np.pi * (50 * t - np.arange(3)[:, None] / 3))
    V = np.real(u * SIZE[0] / np.sqrt(3) * turn)
    I = np.real(u * np.conj(SIZE[1] + 1j * SIZE[2]) / np.sqrt(3) / SIZE[0] * turn)
    names = [f"CH{k} ({unit})" for k, unit in enumerate(["kV"] * 3 + ["kA"] * 3)]
    got, _ = read(tmp_path / "a.csv", ",".join(["t", *names]), [t, *V, *I])
    assert got == pytest.approx(SIZE, rel=0.01)
