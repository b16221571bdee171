"""SEL compressed event reports that the tests write themselves, from the description in SEL's
manuals.
"""

from datetime import datetime

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.filetypes import cev
from tractexp.filetypes.cev_text import compute_checksum
from tractexp.record.reader import find_reader

KILOVOLT, AMPERE, LAG, F, PER_CYCLE = 63.5, 200.0, np.deg2rad(30), 49.98, 32
COLUMNS = ["IA", "IB", "IC", "IG", "VA(kV)", "VB(kV)", "VC(kV)", "*", "VDC", "FREQ"]
HALF = 1 / np.sqrt(2)  # what SEL multiplies instantaneous values by
BITS = "50P1 * 51P TRIP 52A RB1 RB2 RB3 RB4"


def row(*cells):
    """Cells of a line with its checksum, as in the appendix Compressed ASCII."""
    text = "".join(f"{cell}," for cell in cells)
    return f'{text}"{compute_checksum(text)}"'


def names(*cells):
    return row(*(f'"{cell}"' for cell in cells))


def waves(n, dip=(0.5, 0.7, 0.4), scale=HALF):
    """(N, 7) columns, instantaneous primary values times `scale`: three currents, their sum, three
    voltages.
    """
    t = np.arange(n) / (F * PER_CYCLE)
    turn = np.exp(1j * (2 * np.pi * F * t[:, None] - 2 * np.pi / 3 * np.arange(3)))
    depth = np.where((t >= dip[0]) & (t < dip[1]), 1 - dip[2], 1.0)[:, None]
    I = np.sqrt(2) * AMPERE * (np.exp(-1j * LAG) * turn).real * depth * scale
    V = np.sqrt(2) * KILOVOLT * turn.real * depth * scale
    return np.column_stack([I, I.sum(axis=1), V])


def report(n=1920, trigger=480, values=None, summary=(), columns=COLUMNS):
    """Lines of a report; the row of the trigger carries the mark, the contact TRIP closes there."""
    values = waves(n) if values is None else values
    peak = np.hypot(*values[[trigger, trigger - PER_CYCLE // 4], :3])
    told = {
        "FREQ": F,
        "SAM/CYC_A": PER_CYCLE,
        "SAM/CYC_D": 4,
        "NUM_OF_CYC": n // PER_CYCLE,
        "EVENT": '"ER"',
        "IA": f"{peak[0]:.0f}",
        "IB": f"{peak[1]:.0f}",
        "IC": f"{peak[2]:.0f}",
        **dict(summary),
    }
    lines = ["\x02" + names("FID"), names("FID=SEL-351S-R512-V0-Z105105-D20110429")]
    lines += [
        names("MONTH", "DAY", "YEAR", "HOUR", "MIN", "SEC", "MSEC"),
        row(3, 14, 2023, 15, 9, 26, 535),
    ]
    lines += [names(*told), row(*told.values()), names(*columns, "TRIG", BITS)]
    for i in range(n):
        # 50P1, 52A... TRIP from the trigger on
        word = "" if i % 8 else f'"{0x84 if i < trigger else 0x94:02X}80"'
        cells = [*(f"{v:.3f}" for v in values[i]), "0", "124.8", "49.98"][: len(columns)]
        lines.append(row(*cells, ">" if i == trigger else "", word))
    return [*lines, names("SETTINGS"), '"Group 1', "CTR = 40", '","1234"', "\x03"]


@pytest.fixture
def write(tmp_path):
    def written(lines):
        path = tmp_path / "feeder 1.CEV"
        path.write_bytes("\r\n".join(lines).encode("latin-1"))
        return path

    return written


@pytest.mark.parametrize("change", ["lost", "double"])
def test_a_row_that_is_lost_or_double_is_noted(write, change):
    """Rows have checksums and no numbers: the cycles that are announced tell."""
    lines = report()
    assert not any("NUM_OF_CYC" in note for note in cev.load(write(lines)).notes)
    lines[600:601] = [] if change == "lost" else 2 * [lines[600]]
    count = 1919 if change == "lost" else 1921
    said = f"{count} samples, and NUM_OF_CYC announces 1920: rows are missing or double"
    assert any(said in note for note in cev.load(write(lines)).notes)


def test_the_checksum_is_that_of_the_manual():
    assert compute_checksum('"FID",') == "0143"  # printed in the manual of the SEL-311L
    assert compute_checksum('"MONTH","DAY","YEAR","HOUR","MIN","SEC","MSEC",') == "0ACA"


def test_a_report_is_read_in_primary_instantaneous_values(write):
    recording = cev.load(write(report()))
    assert [c.name for c in recording.channels] == [
        "IA",
        "IB",
        "IC",
        "IG",
        "VA",
        "VB",
        "VC",
        "VDC",
        "FREQ",
    ]
    assert [c.phase for c in recording.channels[:7]] == ["A", "B", "C", "G", "A", "B", "C"]
    [segment] = recording.segments
    assert segment.rate == pytest.approx(F * PER_CYCLE)
    np.testing.assert_allclose(
        recording.channels[4].values().max(), np.sqrt(2) * KILOVOLT, rtol=4e-3
    )
    np.testing.assert_allclose(
        recording.channels[0].values().max(), np.sqrt(2) * AMPERE / 1e3, rtol=4e-3
    )
    # the battery's 124.8 V are not scaled
    assert recording.channels[7].values()[0] == pytest.approx(0.1248)
    assert (recording.frequency, recording.device) == (50.0, "SEL-351S-R512-V0-Z105105-D20110429")
    assert recording.trigger == pytest.approx(480 / segment.rate)
    assert recording.start + (
        datetime(2023, 3, 14, 15, 9, 26, 535000) - recording.start
    ) == datetime(2023, 3, 14, 15, 9, 26, 535000)
    assert (
        datetime(2023, 3, 14, 15, 9, 26, 535000) - recording.start
    ).total_seconds() == pytest.approx(recording.trigger, abs=1e-6)
    assert not [note for note in recording.notes if "checksum" in note or "check the scale" in note]
    assert "CTR = 40" in recording.extra["settings"]


def test_bits_of_the_relay_word_are_held_between_their_rows(write):
    states = {s.name: s.values() for s in cev.load(write(report())).status}
    assert list(states) == ["50P1", "51P", "TRIP", "52A", "RB1", "RB2", "RB3", "RB4"]
    assert np.flatnonzero(np.diff(states["TRIP"])).tolist() == [479]
    assert states["50P1"].all()
    assert states["RB1"].all()
    assert states["RB4"].all()
    assert not states["52A"].any()


def test_the_reader_gives_the_dip_in_it(write):
    settings = {"name": "sel", "path": str(write(report())), "voltages": ["VA", "VB", "VC"]}
    record = build("data", {**settings, "currents": ["IA", "IB", "IC"]}).read().train[0]
    assert record.base.voltage == pytest.approx(KILOVOLT * np.sqrt(3), rel=1e-3)
    assert record.base.power == pytest.approx(3 * KILOVOLT * AMPERE / 1e3, rel=1e-3)
    assert record.U.min() == pytest.approx(0.6, abs=2e-3)


def test_columns_that_are_not_divided_are_known_by_the_summary(write):
    values = waves(1920, scale=1.0)
    rms = np.hypot(*values[[480, 472], :3]) / np.sqrt(2)
    told = {name: f"{value:.0f}" for name, value in zip(("IA", "IB", "IC"), rms, strict=True)}
    recording = cev.load(write(report(values=values, summary=told)))
    np.testing.assert_allclose(
        recording.channels[4].values().max(), np.sqrt(2) * KILOVOLT, rtol=4e-3
    )
    assert any("not divided" in note for note in recording.notes)


def test_secondary_values_of_a_751_take_the_ratios_of_its_summary(write):
    told = {"PRIM_VAL": '"NO"', "CTR_IA": 40, "PTR_VA": 600}
    recording = cev.load(write(report(summary=told)))
    np.testing.assert_allclose(
        recording.channels[1].values().max(), 40 * np.sqrt(2) * AMPERE / 1e3, rtol=4e-3
    )
    np.testing.assert_allclose(
        recording.channels[5].values().max(), 600 * np.sqrt(2) * KILOVOLT, rtol=4e-3
    )


def test_harmless_faults_are_mended_and_noted(write):
    lines = report()
    lines[10] = lines[10].replace("49.98", "49.99")  # the checksum no longer fits
    made = cev.load(write(["=>>CEV R", "", *lines[:400], *lines[400:-5], lines[30][:20]]))
    assert any("line 13: the checksum does not fit" in note for note in made.notes)
    assert any("line 1: text before the report" in note for note in made.notes)
    assert any("ends within a line" in note for note in made.notes)


def test_a_filtered_report_is_no_waveform(write):
    recording = cev.load(write(report(summary={"SAM/CYC_A": 4})))
    assert any("filtered report; get the raw one" in note for note in recording.notes)
    with pytest.raises(UserError, match="no waveform, for which 10 samples per cycle"):
        recording.waveforms()


def filtered(f, per_cycle=4, U=None, told=()):
    """Lines of a filtered report of a relay that samples by f (N,) [Hz]: phasors after its filter,
    each step a part.
    """
    t = np.concatenate([[0.0], np.cumsum(2 / (f[1:] + f[:-1]))]) / per_cycle
    U = np.where((t >= 0.5) & (t < 0.75), 0.7, 1.0) if U is None else U
    turn = np.exp(1j * (2 * np.pi * np.arange(len(f)) / per_cycle + 0.3))[:, None]
    turn = turn * np.exp(-2j * np.pi / 3 * np.arange(3))
    V, I = KILOVOLT * U[:, None] * turn.real, AMPERE * (U[:, None] * turn * np.exp(-1j * LAG)).real
    columns = ["IA", "IB", "IC", "VA(kV)", "VB(kV)", "VC(kV)", "FREQ"]
    told = {"FREQ": f"{f[0]:.2f}", "SAM/CYC_A": per_cycle, "EVENT": '"ER"', **dict(told)}
    lines = [
        names("FID"),
        names("FID=SEL-710-R415"),
        names("MONTH", "DAY", "YEAR", "HOUR", "MIN", "SEC", "MSEC"),
    ]
    lines += [
        row(3, 14, 2023, 15, 9, 26, 535),
        names(*told),
        row(*told.values()),
        names(*columns, "TRIG", BITS),
    ]
    for k in range(len(f)):
        cells = [*(f"{v:.4f}" for v in (*I[k], *V[k])), f"{f[k]:.2f}"]
        lines.append(row(*cells, ">" if k == len(f) // 3 else "", '"8480"'))
    settings = ["FLA1   := 250.0  ", "LRA1 = 6.0", "CTR1 := 80", 'RID := "FEEDER 1"', '","1234"']
    return t, [*lines, names("SETTINGS"), '"Group 1', *settings]


@pytest.mark.parametrize("per_cycle", [4, 8])
@pytest.mark.parametrize("nominal", [50.0, 60.0])
def test_two_samples_of_a_filtered_report_are_the_phasor(write, per_cycle, nominal):
    f = np.full(round(1.5 * nominal * per_cycle), nominal - 0.4)
    path = write(filtered(f, per_cycle)[1])
    assert find_reader(str(path)).name == "csv"
    [event] = tractexp.read(str(path))
    assert event.record.base.voltage == pytest.approx(KILOVOLT * np.sqrt(3), rel=1e-5)
    assert event.record.base.power == pytest.approx(3 * KILOVOLT * AMPERE / 1e3, rel=1e-5)
    assert event.record.base.frequency == nominal
    assert pytest.approx((np.cos(LAG), np.sin(LAG)), rel=1e-4) == (event.P0, event.Q0)
    assert pytest.approx(1, rel=1e-5) == event.U0
    assert event.depth == pytest.approx(0.3, abs=1e-4)
    assert event.record.rate == pytest.approx(per_cycle * f[0], rel=1e-6)
    assert event.record.U2.max() < 0.2  # but for the two samples on either side of a jump
    assert np.median(event.record.U2) < 1e-5


def test_times_of_a_relay_that_tracks_follow_its_frequency(write):
    f = np.round(np.linspace(50, 44, 400), 2)
    t, lines = filtered(f, U=np.ones(400))
    table = cev.table(write(lines))
    np.testing.assert_allclose(table.columns(0), t[1:], atol=1e-9)
    assert t[-1] == pytest.approx(399 / 4 / 47, rel=2e-3)  # at 50 Hz it would be 0.12 s less
    np.testing.assert_allclose(table.columns(1), f[1:])
    for k, name in enumerate(table.heading.names):
        if name in ("VA", "IA"):
            np.testing.assert_allclose(
                table.columns(k), KILOVOLT if name == "VA" else AMPERE, rtol=1e-4
            )
    assert any("follow the frequency in FREQ, 44 to 50 Hz" in note for note in table.notes)


def test_a_raw_report_of_a_relay_that_tracks_is_evened(write):
    f = np.round(np.linspace(50, 48, 1920), 2)
    t = np.concatenate([[0.0], np.cumsum(2 / (f[1:] + f[:-1]))]) / PER_CYCLE
    values = waves(1920)
    # as the relay has it: of its own rate
    values[:, 4] = KILOVOLT * np.cos(2 * np.pi * np.arange(1920) / PER_CYCLE)
    lines = report(values=values, summary={"FREQ": 50.0})
    first = next(k for k, line in enumerate(lines) if "TRIG" in line) + 1
    for k in range(1920):
        text = lines[first + k].rpartition(',"')[0].replace("49.98", f"{f[k]:.2f}") + ","
        lines[first + k] = f'{text}"{compute_checksum(text)}"'
    recording = cev.load(write(lines))
    [segment] = recording.segments
    assert segment.t[-1] == pytest.approx(t[-1], rel=1e-9)
    whole = np.interp(segment.t, t, np.arange(1920)) / PER_CYCLE
    np.testing.assert_allclose(
        recording.channels[4].values() / np.sqrt(2) / KILOVOLT, np.cos(2 * np.pi * whole), atol=2e-3
    )
    assert recording.trigger == pytest.approx(t[480], rel=1e-9)
    [trip] = np.flatnonzero(np.diff(recording.status[2].values()))
    assert segment.t[trip + 1] == pytest.approx(t[480], abs=1 / segment.rate)


def test_ratings_in_the_settings_are_a_note(write):
    _, lines = filtered(np.full(300, 60.0))
    assert any(
        "the relay's settings: FLA1 = 250.0, LRA1 = 6.0, CTR1 = 80" in note
        for note in cev.table(write(lines)).notes
    )


def test_phasors_of_a_raw_report_are_refused_with_the_way_to_read_it(write):
    with pytest.raises(
        UserError, match=r"32 a cycle: phasors are read from filtered reports of 4 or 8; .*data=sel"
    ):
        cev.table(write(report()))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda lines: [], "no compressed event report: there is no row of column names with TRIG"),
        (
            lambda lines: [line.replace("SAM/CYC_A", "SAM") for line in lines],
            "SAM/CYC_A, the samples in a cycle, is ''",
        ),
        (
            lambda lines: [line.replace("49.98,32", "0,32") for line in lines],
            "FREQ, .* is '0', not a number from 10",
        ),
        (
            lambda lines: [*lines[:20], lines[20].replace(",", ",x", 1), *lines[21:]],
            "line 21: IB 'x.*' is not a number",
        ),
        (
            lambda lines: [*lines[:20], "1,2,3", *lines[21:]],
            "line 21: 3 cells, but 12 columns are named",
        ),
    ],
)
def test_refused(write, change, says):
    with pytest.raises(UserError, match=says):
        cev.load(write(change(report())))


def test_a_column_of_bits_without_names_gives_no_status_channel(write):
    recording = cev.load(write([line.replace(BITS, "") for line in report()]))
    assert recording.status == []
    assert len(recording.channels) == 9


@pytest.mark.parametrize("cut", [2, 4, 9, 20])  # one, a closing quote, loses nothing
def test_a_report_that_is_cut_within_a_line_says_so_and_does_not_use_it(write, cut):
    lines = report()
    samples = [k for k, line in enumerate(lines) if line.count(",") > 10][3:]
    whole = cev.load(write(lines[: samples[-1] + 1]))
    halved = cev.load(write([*lines[: samples[-1]], lines[samples[-1]][:-cut]]))
    assert halved.samples == whole.samples - 1
    assert any("ends within a line" in note for note in halved.notes)
