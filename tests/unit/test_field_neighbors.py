"""Neighbors of the kinds of field records: other names, arms, conductors, and lone phases.

Each record is written as COMTRADE and looked at, as a user's is.
"""

import re

import numpy as np
import pytest

import tractexp
from tractexp.filetypes import comtrade
from tractexp.recording import Channel, Recording, Segment

RATE = 1600.0
T = np.arange(0, 2, 1 / RATE)
DIP = np.where((T >= 1) & (T < 1.25), 0.7, 1.0)
TURN = np.exp(-2j * np.pi / 3 * np.arange(3))


def write(tmp_path, *rows, f=50.0, segments=None):
    """A record of (name, unit, phasor (N,) RMS); the name says voltage or current by the unit."""
    waves = []
    for k, (name, unit, z) in enumerate(rows):
        x = np.sqrt(2) * np.real(z * np.exp(2j * np.pi * f * T))
        few = np.random.default_rng(k).standard_normal(len(T))
        waves.append((name, unit, x + 1e-4 * np.abs(x).max() * few))
    return write_waves(tmp_path, waves, f, segments)


def write_waves(tmp_path, waves, f=50.0, segments=None):
    """A record of (name, unit, values (N,))."""
    channels = []
    for name, unit, x in waves:
        gain = np.abs(x).max() / 30000
        quantity = "voltage" if unit.endswith("V") else "current"
        raw = np.round(x / gain).astype(np.int16)
        channels.append(Channel(name, raw, unit, quantity, gain=gain))
    made = Recording("made", channels, segments or [Segment(0, len(T), RATE, 0.0)], f)
    return next(p for p in comtrade.write(made, tmp_path / "a.cfg") if p.suffix == ".cfg")


def waves_of(rows):
    """The values (N,) at 50 Hz of (name, unit, phasor (N,) RMS)."""
    wave = np.exp(2j * np.pi * 50 * T)
    return [(name, unit, np.sqrt(2) * np.real(z * wave)) for name, unit, z in rows]


def loads_of(path, **settings):
    """(the loads, the first line, all that is printed) of a look."""
    seen = tractexp.look(path, progress=False, **settings)
    text = str(seen.summary())
    return [x for x in seen.feeders if x["loaded"]], text.splitlines()[0], text


def single(S=12 + 4j, kilovolts=27.5, turn=0.0):
    """Voltage and current (N,) of a single-phase load [MVA], turned by an angle [degrees]."""
    V = kilovolts * DIP * np.exp(1j * np.radians(turn))
    return V, np.conj((S.real * DIP**1.5 + 1j * S.imag * DIP**2) / V)


def three(S=20 + 8j, kilovolts=110.0):
    """Voltages to ground and currents (3, N) of a load [MVA]."""
    V = kilovolts / np.sqrt(3) * DIP
    return V * TURN[:, None], np.conj((S.real * DIP**1.5 + 1j * S.imag * DIP**2) / (3 * V)) * TURN[
        :, None
    ]


RESIDUALS = (
    *("I_R", "I0", "In", "IN", "Ie", "I_E", "3I0", "Ires", "Isum", "Idiff", "I_gnd", "Imp"),
    *("I earth", "I ground", "I residual", "I Nullleiter", "I Erde", "I terre", "I tierra"),
    *("I_neutral", "I земля", "I нейтраль", "I 接地", "IΔ", "earth current"),
)


@pytest.mark.parametrize("name", RESIDUALS)
@pytest.mark.parametrize("share", [0.03, -0.5])
def test_a_neutral_or_residual_current_is_no_load(tmp_path, name, share):
    V, I = single()
    [load], _, _ = loads_of(
        write(tmp_path, ("U", "kV", V), ("I", "kA", I), (name, "kA", share * I))
    )
    assert (load["name"], load["P"]) == ("I", pytest.approx(12, rel=0.01))


def test_i_r_is_a_load_beside_a_voltage_of_phase_r(tmp_path):
    V, I = single()
    rows = [("U_R", "kV", V), ("U_S", "kV", 0.9 * V), ("I_R", "kA", I), ("I_S", "kA", 0.5 * I)]
    loads, _, _ = loads_of(write(tmp_path, *rows))
    assert [load["name"] for load in loads] == ["I_R", "I_S"]


@pytest.mark.parametrize("name", ["I booster", "I GW", "I PW", "I protective wire", "I обратный"])
def test_other_names_of_return_conductors_are_no_loads(tmp_path, name):
    V, I = single()
    [load], _, _ = loads_of(
        write(tmp_path, ("U_C", "kV", V), ("I_C", "kA", I), (name, "kA", -0.8 * I))
    )
    assert load["name"] == "I_C"


@pytest.mark.parametrize("turn", [60.0, 90.0, 120.0])
def test_each_arm_of_a_substation_has_its_own_voltages(tmp_path, turn):
    rows = []
    for arm, (V, I) in (("alpha", single()), ("beta", single(6 + 2j, turn=-turn))):
        rows += [(f"{arm} U_T", "kV", V), (f"{arm} U_F", "kV", -V)]
        rows += [(f"{arm} I_T", "kA", 0.6 * I), (f"{arm} I_F", "kA", -0.4 * I)]
    loads, _, _ = loads_of(write(tmp_path, *rows))
    assert [(x["P"], x["Q"]) for x in loads] == [
        pytest.approx((12, 4), rel=0.01),
        pytest.approx((6, 2), rel=0.01),
    ]


def test_a_feeders_current_that_counts_inward_is_turned_and_said(tmp_path):
    V, I = single()
    rows = [
        ("U_CAT", "kV", V),
        ("U_FEED", "kV", -V),
        ("I_CAT", "kA", 0.6 * I),
        ("I_FEED", "kA", 0.4 * I),
    ]
    path = write(tmp_path, *rows)
    [load], first, _ = loads_of(path)
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((27.5, 12, 4), rel=0.01)
    assert "feeder:inward" in first
    assert any("counted the other way" in said for said in load["why"])
    connection = {"name": "autotransformer", "feeder": "inward"}
    [dip] = tractexp.read(path, voltages=[0, 1], currents=[2, 3], connection=connection)
    assert dip.P0 * dip.record.base.power == pytest.approx(12, rel=0.01)


def test_currents_of_two_tracks_are_two_halves_not_one_load(tmp_path):
    V, I = single()
    rows = [("U_C", "kV", V), ("U_F", "kV", -V), ("I_C1", "kA", 0.6 * I), ("I_C2", "kA", 0.3 * I)]
    loads, _, _ = loads_of(write(tmp_path, *rows))
    assert len(loads) == 2
    assert all("half" in load["name"] for load in loads)


def test_two_unnamed_currents_of_one_angle_may_be_those_of_one_load(tmp_path):
    """Two tracks, or a feeder's current that counts inward: how it is read as one load is said."""
    V, I = single()
    rows = [("U1", "kV", V), ("U2", "kV", -V), ("CH3", "kA", 0.6 * I), ("CH4", "kA", 0.4 * I)]
    path = write(tmp_path, *rows)
    loads, _, _ = loads_of(path)
    assert len(loads) == 4  # each current at each of the opposite voltages
    for load in loads:
        assert "may be half" in load["name"]
        [said] = [each for each in load["why"] if "counted the other way" in each]
        assert "data.currents=[2,3] 'data.connection={name: autotransformer, feed" in said
    connection = {"name": "autotransformer", "feeder": "inward"}
    [dip] = tractexp.read(path, voltages=[0, 1], currents=[2, 3], connection=connection)
    assert dip.P0 * dip.record.base.power == pytest.approx(12, rel=0.01)


def test_one_current_at_the_voltage_between_both_conductors_may_be_half(tmp_path):
    V, I = single()
    [load], first, _ = loads_of(write(tmp_path, ("U T-F", "kV", 2 * V), ("I T", "kA", 0.6 * I)))
    assert "may be half of an autotransformer feeder" in load["name"]
    assert "may be half" in first


@pytest.mark.parametrize(
    "names", [("V_R-Y", "V_B-Y"), ("Uab", "Ucb"), ("U12", "U32"), ("U L1-L2", "U L3-L2")]
)
def test_two_line_voltages_of_which_one_counts_down_make_a_load(tmp_path, names):
    V, I = three()
    rows = [(names[0], "kV", V[0] - V[1]), (names[1], "kV", V[2] - V[1])]
    rows += [(f"I{p}", "kA", x) for p, x in zip("ABC", I, strict=True)]
    path = write(tmp_path, *rows)
    [load], _, _ = loads_of(path)
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((110, 20, 8), rel=0.01)
    [dip] = tractexp.read(path)
    assert dip.P0 * dip.record.base.power == pytest.approx(20, rel=0.01)


def test_phases_at_the_hours_of_a_clock_are_three(tmp_path):
    V, I = three()
    rows = [(f"U{h}", "kV", x) for h, x in zip((0, 4, 8), V, strict=True)]
    rows += [(f"I{h}", "kA", x) for h, x in zip((0, 4, 8), I, strict=True)]
    [load], _, _ = loads_of(write(tmp_path, *rows))
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((110, 20, 8), rel=0.01)


def test_one_phase_of_several_is_called_a_part(tmp_path):
    V, I = three()
    rows = [("UA", "kV", V[0]), ("UB", "kV", V[1]), ("IA", "kA", I[0]), ("IB", "kA", I[1])]
    loads, first, _ = loads_of(write(tmp_path, *rows))
    assert all("one phase of a three-phase load" in load["name"] for load in loads)
    assert "one phase of a three-phase load" in first


def test_currents_that_go_with_no_voltage_are_not_said_to_be_missing(tmp_path):
    V, I = three()
    rows = [(f"U{p}", "kV", x) for p, x in zip("ABC", V, strict=True)] + [("IA", "kA", I[0])]
    path = write(tmp_path, *rows)
    _, first, text = loads_of(path)
    assert "no current is recorded with it" in first
    assert "name the channels of one load: voltages=[...] currents=[...]" in text
    [load], _, _ = loads_of(path, voltages=[0], currents=[3])
    assert load["P"] == pytest.approx(20 / 3, rel=0.01)


@pytest.mark.parametrize("name", ["Udc", "U", "V line"])
def test_a_direct_voltage_without_a_current_is_said_to_be_one(tmp_path, name):
    gain = 0.05
    u = 1500 * DIP * (1 + 0.02 * np.sin(2 * np.pi * 300 * T))
    raw = np.round(u / gain).astype(np.int32)
    made = Recording(
        "made", [Channel(name, raw, "V", "voltage", gain=gain)], [Segment(0, len(T), RATE, 0.0)]
    )
    path = next(p for p in comtrade.write(made, tmp_path / "dc.cfg") if p.suffix == ".cfg")
    _, first, _ = loads_of(path)
    assert "is direct: 1500 V in the mean with a ripple of 1.4% RMS" in first
    assert "(30.0%) at 1.000 s for 250 ms" in first


def station(V, I):
    rows = [(f"U{p}", "kV", x) for p, x in zip("ABC", V, strict=True)]
    return rows + [(f"I{p}", "kA", x) for p, x in zip("ABC", I, strict=True)]


@pytest.mark.parametrize("line", [False, True])
def test_values_of_secondary_size_show_no_megawatts_whatever_the_file_says(tmp_path, line):
    V, I = three()
    marks = ("AB", "BC", "CA") if line else "ABC"
    V = V - V[[1, 2, 0]] if line else V
    rows = [(f"U{p}", "V", x / 1.1) for p, x in zip(marks, V, strict=True)]
    rows += [(f"I{p}", "A", x / 0.12) for p, x in zip("ABC", I, strict=True)]
    path = write(tmp_path, *rows)
    [load], first, text = loads_of(path)
    assert (load["U"], load["P"], load["Q"]) == (None, None, None)
    assert "its values are secondary" in first
    assert "by their size, whatever the file says" in text
    [load], _, _ = loads_of(path, units={"U": "1.1 kV", "I": "120 A"})
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((110, 20, 8), rel=0.01)
    [load], _, text = loads_of(path, units={"U": "V", "I": "A"})
    assert load["U"] == pytest.approx(0.1, rel=0.01)
    assert "whatever the file says" not in text


def test_low_voltage_is_no_secondary(tmp_path):
    V, I = three(S=0.1 + 0.03j, kilovolts=0.208)
    [load], _, text = loads_of(write(tmp_path, *station(V, I)))
    assert load["P"] == pytest.approx(0.1, rel=0.01)
    assert "whatever the file says" not in text


def test_an_open_pole_tells_the_phase_that_lies_at_nothing(tmp_path):
    V, I = three()
    open_phase = np.where((T >= 0.5) & (np.arange(3)[:, None] == 2), 0.02, 1.0) / DIP
    V, I = V * open_phase, I * open_phase
    seen = tractexp.look(write(tmp_path, *station(V, I)), progress=False)
    [event] = [e for e in seen.events if e["kind"] == "open pole"]
    assert event["phases"] == pytest.approx([1, 1, 0.02], abs=0.01)
    assert event["depth"] == pytest.approx(0.327, abs=0.01)
    assert event["P_before"] == pytest.approx(20, rel=0.01)
    assert "phase c to 1.99" in str(seen.summary())


def test_a_fall_that_does_not_return_lasts_to_the_end(tmp_path):
    V, I = three()
    V = V / DIP * np.where(T >= 0.5, 0.7, 1.0)
    [event] = tractexp.look(write(tmp_path, *station(V, I)), progress=False).events
    assert event["kind"] == "dip"
    assert event["duration"] == pytest.approx(1.5, abs=0.05)
    assert "what its end would tell stays open" in event["why"]


def test_what_is_too_slow_for_waveforms_is_not_examined(tmp_path):
    from tractexp.api.surveying import build_rows

    V, I = three()
    fast = 960  # samples; what follows is sampled at 200 Hz and holds the dip
    slow = np.arange(fast, len(T), 8)
    keep = [*range(fast), *slow]
    channels = []
    for name, unit, z in station(V, I):
        x = (np.sqrt(2) * np.real(z * np.exp(2j * np.pi * 50 * T)))[keep]
        gain = np.abs(x).max() / 30000
        quantity = "voltage" if unit == "kV" else "current"
        channels.append(
            Channel(name, np.round(x / gain).astype(np.int16), unit, quantity, gain=gain)
        )
    segments = [Segment(0, fast, RATE, 0.0), Segment(fast, len(keep), RATE / 8, fast / RATE)]
    made = Recording("made", channels, segments)
    path = next(p for p in comtrade.write(made, tmp_path / "a.cfg") if p.suffix == ".cfg")
    first = str(tractexp.look(path, progress=False).summary()).splitlines()[0]
    assert first.startswith("not examined: 1.4 s from 0.600 s on at 200 Hz hold no waveforms")
    assert [row["kind"] for row in build_rows(str(tmp_path), path.name)] == ["not examined"]


def write_table(path, header, rows, delimiter=","):
    path.write_text("\n".join([header, *(delimiter.join(row) for row in rows)]) + "\n")
    return str(path)


def slow():
    """t [s], U [kV], P [MW], Q [Mvar] of a dip of 30 % at 8 s for 0.3 s."""
    t = np.arange(0, 20, 0.02)
    u = np.where((t >= 8) & (t < 8.3), 0.7, 1.0)
    return t, 110 * u, 20 * u**1.5, 8 * u**2


@pytest.mark.parametrize(
    ("told", "spell"),
    [
        ("since the year 0", lambda t: f"{739312.42743055556 + t / 86400:.9f}"),
        ("since 1601", lambda t: f"{133537617300000000 + round(t * 1e7)}"),
        ("since the year 1", lambda t: f"{638448849300000000 + round(t * 1e7)}"),
        (
            "counted from",
            lambda t: f"2024-03-01 10:15:{30 + int(t + 1e-9)}:{round(t * 1e3) % 1000:03d}",
        ),
    ],
)
def test_other_clocks_of_programs_are_read(tmp_path, told, spell):
    rows = [[spell(t), *(f"{x:.4f}" for x in values)] for t, *values in zip(*slow(), strict=True)]
    path = write_table(tmp_path / "t.csv", "Time,U (kV),P (MW),Q (Mvar)", rows)
    seen = tractexp.look(path, progress=False)
    [event] = seen.events
    assert event["start"] == pytest.approx(8, abs=0.03)
    assert event["when"].startswith("2024-03-01T10:15:3")
    assert any(told in note for note in seen.files.rows[0]["notes"])


@pytest.mark.parametrize(("mark", "delimiter"), [(".", ";"), (",", ";")])
def test_groups_of_digits_without_decimals_are_told_by_times_that_rise(tmp_path, mark, delimiter):
    rows = [
        [f"{1000 * x:,.0f}".replace(",", mark) for x in row] for row in zip(*slow(), strict=True)
    ]
    path = write_table(tmp_path / "t.csv", "t [ms];U [V];P [kW];Q [kvar]", rows, delimiter)
    [load], _, _ = loads_of(path)
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((110, 20, 8), rel=1e-3)


@pytest.mark.parametrize(
    ("header", "count", "kilovolts"),
    [("t,U (kV)", 1, 110), ("t,U", 1, 1), ("t,Ua (kV),Ub (kV),Uc (kV)", 3, 110)],
)
def test_a_table_of_voltage_alone_lists_its_events(tmp_path, header, count, kilovolts):
    t, U, *_ = slow()
    size = kilovolts / 110 / (np.sqrt(3) if count == 3 else 1)
    rows = [[f"{a:.3f}", *[f"{b * size:.5f}"] * count] for a, b in zip(t, U, strict=True)]
    path = write_table(tmp_path / "u.csv", header, rows)
    [load], first, text = loads_of(path)
    assert "dip at 8.000 s (30.0%, 300 ms)" in first
    assert "no current is recorded with it" in first
    assert "column P, Q is missing" in " ".join(text.split())
    assert (load["U"], load["P"]) == (pytest.approx(kilovolts), None)
    tractexp.look(path, progress=False).write(tmp_path / "page")
    with pytest.raises(tractexp.UserError, match="column P, Q is missing"):
        tractexp.read(path)


@pytest.mark.parametrize("volts", [750, 1500, 3000])
@pytest.mark.parametrize("ripple", [0.0, 0.02])
def test_a_table_of_a_direct_voltage_alone_is_said_to_be_one(tmp_path, volts, ripple):
    u = volts * DIP * (1 + ripple * np.sin(2 * np.pi * 300 * T))
    rows = [[f"{a:.6f}", f"{b:.3f}"] for a, b in zip(T, u, strict=True)]
    words = r"is direct: ([\d.]+) V in the mean with a ripple of .* \(30\.\d%\) at 1\.00\d s for 2"
    with pytest.raises(tractexp.UserError, match=words) as refused:
        tractexp.look(write_table(tmp_path / "u.csv", "t,U [V]", rows), progress=False)
    assert float(re.search(words, str(refused.value))[1]) == pytest.approx(volts, rel=1e-3)


def test_a_heading_with_more_names_than_cells_is_told_as_such(tmp_path):
    rows = [[f"{x:.4f}" for x in row] for row in zip(*slow(), strict=True)]
    path = write_table(tmp_path / "t.csv", "t,U, kV,P, MW,Q, Mvar", rows)
    with pytest.raises(
        tractexp.UserError, match=r"names 7 columns, and line 2 has 4 cells.*quotes"
    ):
        tractexp.read(path)


@pytest.mark.parametrize("names", ["PhV.phs{}.mag", "V_PH_{}", "MMXU1.PhV.phs{}"])
def test_names_of_iec_61850_are_phases_to_ground(tmp_path, names):
    t, U, P, Q = slow()
    header = ",".join(
        ["t", *(names.format(p) + " (kV)" for p in "ABC"), "TotW (MW)", "TotVAr (Mvar)"]
    )
    E = U / np.sqrt(3)
    rows = [[f"{x:.6f}" for x in row] for row in zip(t, E, E, E, P, Q, strict=True)]
    [load], _, _ = loads_of(write_table(tmp_path / "t.csv", header, rows))
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((110, 20, 8), rel=1e-3)


def test_of_the_least_mean_and_largest_values_the_mean_is_read(tmp_path):
    t, U, P, Q = slow()
    names = ("U L1-L2 {} (kV rms)", "Active Power Total {} (MW)", "Reactive Power Total {} (Mvar)")
    header = ["t", *(name.format(what) for name in names for what in ("Min", "Avg", "Max"))]
    columns = [t, *(x * size for x in (U, P, Q) for size in (0.98, 1.0, 1.02))]
    rows = [[f"{x:.6f}" for x in row] for row in zip(*columns, strict=True)]
    [load], _, _ = loads_of(write_table(tmp_path / "t.csv", ",".join(header), rows))
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((110, 20, 8), rel=1e-3)


def test_samples_that_are_counted_have_a_time_that_can_be_given(tmp_path):
    rows = [[f"{x:.6f}" for x in row] for row in zip(*slow()[1:], strict=True)]
    numbered = [[str(k), *row] for k, row in enumerate(rows)]
    path = write_table(tmp_path / "t.csv", "t,U (kV),P (MW),Q (Mvar)", numbered)
    with pytest.raises(tractexp.UserError, match=r"counts samples, the time of one: .*20 ms"):
        tractexp.read(path)
    [dip] = tractexp.read(path, units={"t": "20 ms"})
    assert dip.t_start == pytest.approx(8, abs=0.03)


def test_rms_values_without_angles_are_no_direct_voltage(tmp_path):
    rows = [(f"U L{k}", "kV", 110 / np.sqrt(3) * DIP) for k in (1, 2, 3)]
    path = write_waves(tmp_path, [*rows, *((f"I L{k}", "kA", 0.1 * DIP) for k in (1, 2, 3))])
    loads, first, text = loads_of(path)
    assert loads == []
    assert "is direct" not in text
    assert "keeps its sign, as RMS values do: 63.51 kV in the mean" in first
    assert "(30.0%) at 1.000 s for 250 ms" in first
    assert first.endswith("does not follow without angles, or P and Q")


def test_a_voltage_whose_recorder_stops_is_no_direct_one(tmp_path):
    last = int(1.1 * RATE)
    stopped = [(n, u, np.where(T < 1.1, x, x[last])) for n, u, x in waves_of(station(*three()))]
    [load], first, text = loads_of(write_waves(tmp_path, stopped))
    assert load["P"] == pytest.approx(20, rel=0.01)
    assert first.startswith("nothing is worth fitting")
    assert "is direct" not in text


@pytest.mark.parametrize("clipped", ["U", "I"])
def test_waves_that_stop_at_a_limit_are_said(tmp_path, clipped):
    most = {"U": 80.0, "I": 0.12}[clipped]  # of peaks of 89.8 kV and 0.16 kA
    waves = waves_of(station(*three()))
    waves = [(n, u, np.clip(x, -most, most) if n[0] == clipped else x) for n, u, x in waves]
    path = write_waves(tmp_path, waves)
    said = f"clipped: '{clipped}A', '{clipped}B', '{clipped}C', up to "
    assert said in loads_of(path)[1]
    assert any(note.startswith(said) for note in tractexp.read(path)[0].record.notes)


@pytest.mark.parametrize("parts", [[(0, 3200)], [(0, 40), (40, 3160), (3160, 3200)]])
def test_whole_waves_are_not_called_clipped(tmp_path, parts):
    """Also where a part of a cycle stands by itself, as in a record of several rates."""
    rates = [RATE if last - first > 100 else 0.7 * RATE for first, last in parts]
    segments = [
        Segment(*part, rate, part[0] / 800) for part, rate in zip(parts, rates, strict=True)
    ]
    path = write(tmp_path, *station(*three()), segments=segments)
    assert "clipped" not in loads_of(path)[2]
    assert not any("clipped" in note for note in tractexp.read(path)[0].record.notes)


def test_a_dip_out_of_a_voltage_that_swings_has_nothing_steady_before_it(tmp_path):
    """At 2 Hz by 3 % to either side: the level from which the dip falls is not known."""
    V, I = three()
    swing = 1 + 0.03 * np.sin(2 * np.pi * 2 * T)
    seen = tractexp.look(write(tmp_path, *station(V * swing, I * swing)), progress=False)
    [why] = [event["why"] for event in seen.events if event["depth"] > 0.2]
    assert "the voltage is not steady before the dip, from which P0, Q0" in why
