"""SEL compressed event reports that the tests write themselves, from the description in SEL's manuals."""

from datetime import datetime

import numpy as np
import pytest

from tractexp.errors import UserError
from tractexp.filetypes import cev
from tractexp.plugin import build

KILOVOLT, AMPERE, LAG, F, PER_CYCLE = 63.5, 200.0, np.deg2rad(30), 49.98, 32
COLUMNS = ["IA", "IB", "IC", "IG", "VA(kV)", "VB(kV)", "VC(kV)", "*", "VDC", "FREQ"]
HALF = 1 / np.sqrt(2)  # what SEL multiplies instantaneous values by
BITS = "50P1 * 51P TRIP 52A RB1 RB2 RB3 RB4"


def row(*cells):
    """Cells of a line with its checksum, as in the appendix Compressed ASCII."""
    text = "".join(f"{cell}," for cell in cells)
    return f'{text}"{cev.checksum(text)}"'


def names(*cells):
    return row(*(f'"{cell}"' for cell in cells))


def waves(n, dip=(0.5, 0.7, 0.4), scale=HALF):
    """(N, 7) columns, instantaneous primary values times `scale`: three currents, their sum, three voltages."""
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
    told = {"FREQ": F, "SAM/CYC_A": PER_CYCLE, "SAM/CYC_D": 4, "NUM_OF_CYC": n // PER_CYCLE, "EVENT": '"ER"',
            "IA": f"{peak[0]:.0f}", "IB": f"{peak[1]:.0f}", "IC": f"{peak[2]:.0f}", **dict(summary)}  # fmt: skip
    lines = ["\x02" + names("FID"), names("FID=SEL-351S-R512-V0-Z105105-D20110429")]
    lines += [names("MONTH", "DAY", "YEAR", "HOUR", "MIN", "SEC", "MSEC"), row(3, 14, 2023, 15, 9, 26, 535)]
    lines += [names(*told), row(*told.values()), names(*columns, "TRIG", BITS)]
    for i in range(n):
        word = "" if i % 8 else f'"{0x84 if i < trigger else 0x94:02X}80"'  # 50P1, 52A... TRIP from the trigger on
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


def test_the_checksum_is_that_of_the_manual():
    assert cev.checksum('"FID",') == "0143"  # printed in the manual of the SEL-311L
    assert cev.checksum('"MONTH","DAY","YEAR","HOUR","MIN","SEC","MSEC",') == "0ACA"


def test_a_report_is_read_in_primary_instantaneous_values(write):
    recording = cev.load(write(report()))
    assert [c.name for c in recording.channels] == ["IA", "IB", "IC", "IG", "VA", "VB", "VC", "VDC", "FREQ"]
    assert [c.phase for c in recording.channels[:7]] == ["A", "B", "C", "G", "A", "B", "C"]
    [segment] = recording.segments
    assert segment.rate == pytest.approx(F * PER_CYCLE)
    np.testing.assert_allclose(recording.channels[4].values().max(), np.sqrt(2) * KILOVOLT, rtol=4e-3)
    np.testing.assert_allclose(recording.channels[0].values().max(), np.sqrt(2) * AMPERE / 1e3, rtol=4e-3)
    assert recording.channels[7].values()[0] == pytest.approx(0.1248)  # the battery's 124.8 V are not scaled
    assert (recording.frequency, recording.device) == (50.0, "SEL-351S-R512-V0-Z105105-D20110429")
    assert recording.trigger == pytest.approx(480 / segment.rate)
    assert recording.start + (datetime(2023, 3, 14, 15, 9, 26, 535000) - recording.start) == datetime(
        2023, 3, 14, 15, 9, 26, 535000
    )
    assert (datetime(2023, 3, 14, 15, 9, 26, 535000) - recording.start).total_seconds() == pytest.approx(
        recording.trigger, abs=1e-6
    )
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
    np.testing.assert_allclose(recording.channels[4].values().max(), np.sqrt(2) * KILOVOLT, rtol=4e-3)
    assert any("not divided" in note for note in recording.notes)


def test_secondary_values_of_a_751_take_the_ratios_of_its_summary(write):
    told = {"PRIM_VAL": '"NO"', "CTR_IA": 40, "PTR_VA": 600}
    recording = cev.load(write(report(summary=told)))
    np.testing.assert_allclose(recording.channels[1].values().max(), 40 * np.sqrt(2) * AMPERE / 1e3, rtol=4e-3)
    np.testing.assert_allclose(recording.channels[5].values().max(), 600 * np.sqrt(2) * KILOVOLT, rtol=4e-3)


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


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda lines: [], "no compressed event report: there is no row of column names with TRIG"),
        (
            lambda lines: [line.replace("SAM/CYC_A", "SAM") for line in lines],
            "SAM/CYC_A, the samples in a cycle, is ''",
        ),
        (lambda lines: [line.replace("49.98,32", "0,32") for line in lines], "FREQ, .* is '0', not a number from 10"),
        (
            lambda lines: [*lines[:20], lines[20].replace(",", ",x", 1), *lines[21:]],
            "line 21: IB 'x.*' is not a number",
        ),
        (lambda lines: [*lines[:20], "1,2,3", *lines[21:]], "line 21: 3 cells, but 12 columns are named"),
    ],
)
def test_refused(write, change, says):
    with pytest.raises(UserError, match=says):
        cev.load(write(change(report())))
