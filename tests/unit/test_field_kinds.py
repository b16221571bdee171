"""Kinds of field records: short or several-rate ones, railways, direct voltages, secondary values,
unknown units.
"""

import re

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import build_chosen
from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.recording import Channel, Recording, Segment

RATE = 3200.0
TURN = np.exp(-2j * np.pi / 3 * np.arange(3))[:, None]


def waves(phasor, t, f=50.0, seed=0):
    x = np.sqrt(2) * np.real(np.atleast_2d(phasor) * np.exp(2j * np.pi * f * t))
    return x + 1e-4 * np.abs(x).max() * np.random.default_rng(seed).standard_normal(x.shape)


def station(t, dips):
    """Six channels of 110 kV, 20 MW and 8 Mvar: (name, unit, values)."""
    u = np.ones(len(t))
    for start, seconds, depth in dips:
        u[(t >= start) & (t < start + seconds)] = 1 - depth
    V = 110 / np.sqrt(3) * u
    I = np.conj((20 * u**1.5 + 8j * u**2) / (3 * V))
    rows = np.concatenate([waves(V * TURN, t), waves(I * TURN, t, seed=1)])
    units = ["kV"] * 3 + ["kA"] * 3
    return [
        (f"{x}{p}", unit, row)
        for (x, p), unit, row in zip(
            [*(("U", p) for p in "ABC"), *(("I", p) for p in "ABC")], units, rows, strict=True
        )
    ]


def written(tmp_path, t, channels, segments=None, f=50.0, trigger=None, side="P"):
    made = []
    for name, unit, x in channels:
        gain = np.abs(x).max() / 30000
        quantity = "voltage" if name.upper().startswith("U") else "current"
        made.append(Channel(name, np.round(x / gain).astype(np.int16), unit, quantity, gain=gain))
    recording = Recording(
        "made", made, segments or [Segment(0, len(t), RATE, 0.0)], f, "s", "r", trigger=trigger
    )
    path = next(p for p in comtrade.write(recording, tmp_path / "a.cfg") if p.suffix == ".cfg")
    if side != "P":
        lines = path.read_text().splitlines()
        path.write_text(
            "\n".join(line[:-1] + side if line.endswith(",P") else line for line in lines) + "\n"
        )
    return path


def look(path, **settings):
    seen = tractexp.look(path, progress=False, **settings)
    return seen, str(seen.summary()).splitlines()[0]


def parts(*spans):
    """Times of several rates, and their segments, from (start, end, rate)."""
    times, segments, n = [], [], 0
    for start, end, rate in spans:
        t = np.arange(start, end - 1e-9, 1 / rate)
        times.append(t)
        segments.append(Segment(n, n + len(t), rate, start))
        n += len(t)
    return np.concatenate(times), segments


def test_parts_with_gaps_have_each_a_reference_of_their_own(tmp_path):
    """Three triggered parts of one file, hours apart, at other voltages of the network."""
    t = np.arange(0, 1, 1 / RATE)
    levels, depths = (1.0, 0.93, 1.06), (0.3, 0.2, 0.25)
    lines = ["t,UA [kV],UB [kV],UC [kV],IA [kA],IB [kA],IC [kA]"]
    for k, (level, depth) in enumerate(zip(levels, depths, strict=True)):
        values = np.array([x for _, _, x in station(t, [(0.5, 0.2, depth)])]) * level
        rows = np.vstack([t + 3600 * k, values]).T
        lines += [",".join(f"{x:.9g}" for x in row) for row in rows]
    path = tmp_path / "parts.csv"
    path.write_text("\n".join(lines) + "\n")
    seen, _ = look(str(path))
    assert [row["kind"] for row in seen.events] == ["dip"] * 3
    assert [row["depth"] for row in seen.events] == pytest.approx(depths, abs=0.005)
    for event, level, depth in zip(tractexp.read(str(path)), levels, depths, strict=True):
        assert (event.U0, event.depth) == pytest.approx((level, depth), abs=0.005)


@pytest.mark.parametrize(
    "spans",
    [
        ((0, 0.96, 1600.0), (0.96, 1.4, 6400.0), (1.4, 3, 1600.0)),
        ((0, 1.05, 1600.0), (1.05, 1.4, 6400.0), (1.4, 3, 1600.0)),
        ((0, 1.02, 6400.0), (1.02, 3, 1600.0)),
    ],
)
def test_a_dip_over_several_rates_is_one_dip(tmp_path, spans):
    t, segments = parts(*spans)
    path = written(tmp_path, t, station(t, [(1.0, 0.25, 0.3)]), segments)
    [event] = look(path)[0].events
    assert (event["kind"], event["worth"]) == ("dip", True)
    [dip] = tractexp.read(path)
    assert dip.t_start == pytest.approx(1.0, abs=0.012)
    assert dip.depth == pytest.approx(0.3, abs=0.003)
    assert dip.P0 * dip.record.base.power == pytest.approx(20, rel=0.01)


@pytest.mark.parametrize("before", [0.0, 0.01, 0.02, 0.03, 0.04, 0.06, 0.1])
@pytest.mark.parametrize(("seconds", "depth"), [(0.25, 0.3), (0.1, 0.15)])
def test_little_before_a_dip_makes_no_swell_of_it(tmp_path, before, seconds, depth):
    t = np.arange(0, 1.5, 1 / RATE)
    path = written(tmp_path, t, station(t, [(before, seconds, depth)]))
    [event] = look(path)[0].events
    assert event["kind"] == "dip"
    assert event["depth"] == pytest.approx(depth, abs=0.01)
    if before >= 0.03:
        [dip] = tractexp.read(path)
        assert dip.depth == pytest.approx(depth, abs=0.01)


@pytest.mark.parametrize("slope", [-0.06, -0.02, 0.05])
def test_a_dip_out_of_a_sliding_voltage_begins_where_it_falls(tmp_path, slope):
    """By so much a second, up to the dip at 1.5 s."""
    t = np.arange(0, 3, 1 / RATE)
    slide = 1 + slope * np.minimum(t, 1.5)
    rows = [(name, unit, x * slide) for name, unit, x in station(t, [(1.5, 0.25, 0.3)])]
    path = written(tmp_path, t, rows)
    seen, first = look(path)
    assert "is worth fitting" in first
    assert [event["kind"] for event in seen.events][:2] == ["ramp", "dip"]
    event = seen.events.rows[1]
    assert event["start"] == pytest.approx(1.5, abs=0.02)
    assert event["depth"] == pytest.approx(0.3, abs=0.015)
    assert event["end"] == pytest.approx(1.75, abs=0.03)
    [dip] = tractexp.read(path)
    assert dip.t_start == pytest.approx(1.5, abs=0.02)


def test_the_voltage_before_the_trigger_is_the_reference(tmp_path):
    t = np.arange(0, 3, 1 / RATE)
    path = written(tmp_path, t, station(t, [(0, 0.2, 0.1), (1.0, 0.25, 0.3)]), trigger=1.0)
    kinds = [(event["kind"], round(event["depth"], 2)) for event in look(path)[0].events]
    assert kinds == [("dip", 0.1), ("dip", 0.3)]
    [dip] = tractexp.read(path)
    assert dip.depth == pytest.approx(0.3, abs=0.005)


class TestRailways:
    t = np.arange(0, 2, 1 / RATE)
    u = np.where((t >= 1) & (t < 1.25), 0.7, 1.0)
    V = 27.5 * u
    I = np.conj((12 * u**1.5 + 4j * u**2) / V)

    def loads(self, tmp_path, *channels, f=50.0):
        rows = [
            (name, "kV" if name[0] == "U" else "kA", waves(z, self.t, f)[0]) for name, z in channels
        ]
        seen, first = look(written(tmp_path, self.t, rows, f=f))
        return [x for x in seen.feeders if x["loaded"]], first

    def test_contact_line_and_negative_feeder_are_one_load(self, tmp_path):
        V, I = self.V, self.I
        each = (("U_CAT", V), ("U_FEED", -V), ("I_CAT", 0.6 * I), ("I_FEED", -0.4 * I))
        between = (("U T-F", 2 * V), ("I T", 0.6 * I), ("I F", -0.4 * I))
        for channels in (each, each[::-1], between):
            [load], _ = self.loads(tmp_path, *channels)
            assert load["connection"] == "autotransformer"
            assert (load["U"], load["P"], load["Q"]) == pytest.approx((27.5, 12, 4), rel=0.01)

    def test_half_of_it_is_called_half(self, tmp_path):
        V, I = self.V, self.I
        [load], first = self.loads(tmp_path, ("U_CAT", V), ("U_FEED", -V), ("I_CAT", 0.6 * I))
        assert "half" in load["name"]
        assert "half" in first
        loads, _ = self.loads(tmp_path, ("U_CAT", V), ("I_CAT", 0.6 * I), ("I_FEED", -0.4 * I))
        assert all("half" in load["name"] for load in loads)

    @pytest.mark.parametrize("name", ["I_RC", "I return", "I Rückleiter", "I BT", "I Schiene"])
    def test_a_return_conductor_is_no_load(self, tmp_path, name):
        V, I = 15 / 27.5 * self.V, self.I
        [load], _ = self.loads(tmp_path, ("U FL", V), ("I FL", I), (name, -0.8 * I), f=50 / 3)
        assert load["P"] == pytest.approx(12 * 15 / 27.5, rel=0.01)

    def test_of_opposite_voltages_it_is_the_sum_of_both_powers(self):
        each = build_chosen("connection", "autotransformer")
        V, I = np.array([27.5, -27.5]), np.array([0.3 - 0.1j, -0.2 + 0.05j])
        assert (each.voltage() @ V)[0] * np.conj(each.current() @ I)[0] == pytest.approx(
            V @ I.conj()
        )

    @pytest.mark.parametrize("volts", [750, 1500, 3000])
    def test_a_direct_voltage_is_said_to_be_one(self, tmp_path, volts):
        ripple = np.sin(2 * np.pi * 300 * self.t)
        u = volts * self.u * (1 + 0.02 * ripple)
        path = written(tmp_path, self.t, [("U line", "V", u), ("I line", "A", 500 + 50 * ripple)])
        seen, first = look(path)
        assert not seen.feeders.rows
        assert f"is direct: {volts} V in the mean with a ripple of 1.4% RMS" in first
        assert "(30.0%) at 1.000 s for 250 ms" in first
        with pytest.raises(tractexp.UserError, match=r"is direct: .* alternating voltage"):
            tractexp.read(path)


def test_a_direct_voltage_beside_alternating_ones_is_told(tmp_path):
    t = np.arange(0, 2, 1 / RATE)
    direct = 1500 * np.where((t >= 1) & (t < 1.2), 0.7, 1.0) + 30 * np.sin(2 * np.pi * 300 * t)
    rows = [*station(t, [(1.0, 0.2, 0.3)]), ("U third rail", "V", direct), ("I rail", "A", direct)]
    seen, first = look(written(tmp_path, t, rows))
    assert "is worth fitting" in first
    assert [x["P"] for x in seen.feeders if x["loaded"]] == pytest.approx([20], rel=0.01)
    notes = " ".join(seen.files.rows[0]["notes"])
    assert "'U third rail' is direct: 1500 V in the mean with a ripple of 1.4% RMS" in notes
    assert "no load is shown of it" in notes


@pytest.mark.parametrize(
    ("kilovolts", "part"),
    [(110 / 3**0.5, True), (33 / 3**0.5, True), (27.5, False), (15.9, False), (25.8, False)],
)
def test_one_phase_of_three_is_told_by_its_voltage(tmp_path, kilovolts, part):
    t = np.arange(0, 2, 1 / RATE)
    V = kilovolts * np.where((t >= 1) & (t < 1.2), 0.7, 1.0)
    rows = [("UA", "kV", waves(V, t)[0]), ("IA", "kA", waves(0.1 * V / kilovolts, t)[0])]
    seen, first = look(written(tmp_path, t, rows))
    [load] = seen.feeders
    assert ("one phase of a three-phase load" in load["name"]) == part
    assert ("one phase of a three-phase load" in first) == part


def test_secondary_values_show_no_megawatts_until_the_ratio_is_given(tmp_path):
    t = np.arange(0, 2, 1 / RATE)
    rows = [
        (name, unit[1:], x * 1e3 / (1100 if unit == "kV" else 120))
        for name, unit, x in station(t, [(1.0, 0.2, 0.3)])
    ]
    path = written(tmp_path, t, rows, side="S")
    seen, first = look(path)
    [load] = seen.feeders
    assert (load["U"], load["P"]) == (None, None)
    assert "secondary" in first
    assert any("units={U: '1.1 kV', I: '120 A'}" in note for note in seen.files.rows[0]["notes"])
    assert any("secondary" in note for note in tractexp.read(path)[0].record.notes)
    made = tractexp.survey(str(tmp_path), cores=1, progress=False)
    [row] = made.content["rows"]
    powers = [row[f"{x}_{when}"] for x in "PQ" for when in ("before", "after")]
    assert (powers, row["unit"]) == ([None] * 4, "secondary")
    [load] = look(path, units={"U": "1.1 kV", "I": "120 A"})[0].feeders
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((110, 20, 8), rel=0.01)


def test_an_unknown_unit_leaves_a_record_unexamined_and_never_quiet(tmp_path):
    t = np.arange(0, 2, 1 / RATE)
    rows = [
        (name, "V/kV" if unit == "kV" else unit, x)
        for name, unit, x in station(t, [(1.0, 0.2, 0.3)])
    ]
    path = written(tmp_path, t, rows)
    seen, first = look(path)
    assert first.startswith("not examined: ")
    assert "nothing happened" not in str(seen.summary())
    from tractexp.api.surveying import build_rows

    assert [row["kind"] for row in build_rows(str(tmp_path), path.name)] == ["not examined"]


def test_a_bus_tells_the_fault_that_its_circuits_end_at_different_instants(tmp_path):
    t = np.arange(0, 3, 1 / RATE)
    fault = (t >= 1) & (t < 2.2)
    E = 110 / np.sqrt(3)
    V = E * np.where(fault & (np.arange(3)[:, None] == 0), 0.05, 1.0) * TURN
    rows = [(f"U L{p}", "kV", x) for p, x in zip("ABC", waves(V, t), strict=True)]
    for number, S, opens in ((1, 20 + 8j, 1.10), (2, -18 - 6j, 1.16)):
        I = np.conj(S / 3 / E**2) * V
        I[0] *= np.where(fault & (t < opens), 60.0, np.where(fault, 0.0, 1.0))
        rows += [
            (f"I{number} L{p}", "kA", x)
            for p, x in zip("ABC", waves(I, t, seed=number), strict=True)
        ]
    seen, _ = look(written(tmp_path, t, rows))
    [bus] = [line for line in str(seen.summary()).splitlines() if line.strip().startswith("bus 1")]
    assert "dip at 0.99" in bus
    assert "1200 ms" in bus
    assert "phase a to 5" in bus


def bus_line(path):
    seen, _ = look(path)
    [bus] = [line for line in str(seen.summary()).splitlines() if line.strip().startswith("bus 1")]
    return bus, seen


@pytest.mark.parametrize(
    ("fallen", "named"), [((0,), "a"), ((1,), "b"), ((2,), "c"), ((0, 2), "a and c")]
)
def test_a_bus_tells_which_phase_fell(tmp_path, fallen, named):
    t = np.arange(0, 2, 1 / RATE)
    fault = (t >= 1) & (t < 1.2) & np.isin(np.arange(3), fallen)[:, None]
    V = 110 / np.sqrt(3) * np.where(fault, 0.1, 1.0) * TURN
    I = np.conj((20 + 8j) / 110**2) * V
    rows = [
        (f"{letter}{p}", unit, x)
        for letter, unit, z in (("U", "kV", V), ("I", "kA", I))
        for p, x in zip("ABC", waves(z, t), strict=True)
    ]
    bus, seen = bus_line(written(tmp_path, t, rows))
    assert f"phase{'s' * (len(fallen) > 1)} {named} to 10" in bus
    [event] = seen.events.rows
    shares = [0.1 if k in fallen else 1.0 for k in range(3)]
    assert event["phases"] == pytest.approx(shares, abs=0.02)
    assert named in event["why"]


def test_a_dip_of_all_phases_names_none(tmp_path):
    t = np.arange(0, 2, 1 / RATE)
    bus, _ = bus_line(written(tmp_path, t, station(t, [(1.0, 0.2, 0.3)])))
    assert "phase" not in bus


def test_a_phase_that_is_dead_from_first_to_last_is_never_within_the_thresholds(tmp_path):
    from tractexp.api.surveying import build_rows

    t = np.arange(0, 2, 1 / RATE)
    rows = [(name, unit, x * (1e-6 if name == "UB" else 1.0)) for name, unit, x in station(t, [])]
    path = written(tmp_path, t, rows)
    bus, seen = bus_line(path)
    assert "no voltage in phase b from first to last" in bus
    assert "within the thresholds" not in str(seen.summary())
    [row] = build_rows(str(tmp_path), path.name)
    assert "no voltage in phase b" in row["why"]


def write_direct(path, columns, volts=1500.0, rate=2000.0, ripple=0.02, pulses=300.0, factor=0.0):
    """A table of a direct voltage that falls by a fifth, with its current and powers; `columns`
    {name: quantity}.
    """
    t = np.arange(0, 1.0, 1 / rate)
    u = np.where((t > 0.5) & (t < 0.6), 0.8, 1.0)
    U = volts * u * (1 + ripple * np.sin(2 * np.pi * pulses * t))
    values = {"U": U, "kV": U / 1000, "I": 2000 * u, "P": 2 * U * u, "Q": factor * 2 * U * u}
    rows = zip(t, *(values[quantity] for quantity in columns.values()), strict=True)
    lines = [",".join(["t", *columns]), *(",".join(f"{x:.7g}" for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


@pytest.mark.parametrize(
    ("columns", "settings"),
    [
        ({"U [V]": "U", "I [A]": "I"}, {}),
        ({"U [V]": "U", "I [A]": "I"}, {"volts": 750.0, "pulses": 600.0}),
        ({"Voltage (kV)": "kV", "Current (A)": "I"}, {"volts": 3000.0}),
        ({"U [V]": "U", "I [A]": "I"}, {"rate": 100.0, "ripple": 0.0}),
        ({"U [V]": "U", "P [kW]": "P"}, {}),
        ({"U": "U", "I": "I"}, {}),
        ({"Udc [V]": "U", "Idc [A]": "I"}, {"volts": 1100.0}),
        ({"Gleichspannung [V]": "U", "P [kW]": "P"}, {"volts": 400.0}),
        ({"U [V]": "U", "P [kW]": "P", "Q [kvar]": "Q"}, {}),
        ({"U [V]": "U", "P [kW]": "P", "Q [kvar]": "Q"}, {"factor": 0.3}),
        ({"U [V]": "U", "P [kW]": "P", "Q [kvar]": "Q"}, {"rate": 100.0, "ripple": 0.0}),
    ],
)
def test_a_table_of_direct_current_is_said_to_be_one(tmp_path, columns, settings):
    path = write_direct(tmp_path / "dc.csv", columns, **settings)
    words = (
        r"is direct: (\S+) V in the mean with a ripple of \d\.\d% RMS, and falls to .*\(20\.\d%\)"
        r" at 0\.\d+ s for \d+ ms; the models here are those of loads at alternating voltage"
    )
    with pytest.raises(UserError, match=words) as refused:
        look(path)
    mean = float(re.search(words, str(refused.value))[1])
    assert mean == pytest.approx(settings.get("volts", 1500.0), rel=1e-3)


def test_what_may_be_direct_and_has_a_q_is_alternating_and_said(tmp_path):
    columns = {"U [V]": "U", "P [kW]": "P", "Q [kvar]": "Q"}
    path = write_direct(tmp_path / "ac.csv", columns, rate=100.0, ripple=0.0, factor=0.4)
    seen, first = look(path)
    assert "is worth fitting" in first
    assert "1.5 kV may be a direct voltage of railways" in " ".join(seen.files.rows[0]["notes"])
    still = write_direct(tmp_path / "zero.csv", columns, rate=100.0, ripple=0.0)
    assert tractexp.read(still, base_voltage=1.5, base_power=4.0)


def test_other_tables_without_q_are_not_direct(tmp_path):
    path = write_direct(tmp_path / "ac.csv", {"U [V]": "U", "P [kW]": "P"}, volts=27500.0)
    with pytest.raises(UserError, match="column Q is missing"):
        look(path)


@pytest.mark.parametrize(
    ("rate", "seconds", "unit", "why"),
    [
        (400.0, 1.0, "kV", "sampled at 400 Hz: no waveform"),
        (RATE, 0.03, "kV", "it lasts 0.03 s"),
        (RATE, 0.047, "kV", "fewer than four half cycles"),
        (RATE, 1.0, "%", "no channel is a voltage by its unit"),
    ],
)
def test_what_nobody_can_tell_is_not_examined(tmp_path, rate, seconds, unit, why):
    t = np.arange(0, seconds, 1 / rate)
    rows = [
        (name, unit if own == "kV" else own, x) for name, own, x in station(t, [(0.5, 0.1, 0.3)])
    ]
    path = written(tmp_path, t, rows, [Segment(0, len(t), rate, 0.0)])
    seen, first = look(path)
    assert first.startswith("not examined: ")
    assert why in first
    assert "nothing happened" not in str(seen.summary())


def test_a_record_that_begins_inside_a_dip_has_phases_by_what_follows(tmp_path):
    t = np.arange(0, 1, 1 / RATE)
    [event] = look(written(tmp_path, t, station(t, [(0.0, 0.3, 0.4)])))[0].events
    assert event["phases"] == pytest.approx([0.6] * 3, abs=0.02)
    assert "the lowest phase to 60 %" in event["why"]
