"""PQDIF files that the tests write themselves, from the layout of IEEE 1159.3."""

import struct
import zlib
from datetime import datetime, timedelta

import made_pqdif as made
import numpy as np
import pytest

import tractexp
from tractexp.errors import UserError
from tractexp.filetypes import pqdif, pqdif_channels, pqdif_records
from tractexp.record.reader import find_reader

START = datetime(2024, 5, 17, 8, 30, 12, 250000)
RATE, COUNT, F = 6400.0, 6400, 50.0
KILOVOLT, AMPERE, LAG = 15.0, 300.0, 0.4  # RMS to ground
SCALE = {"V": 2.0, "A": 0.05}
PHASES = ((1, "A"), (2, "B"), (3, "C"))


def waves(count=COUNT, rate=RATE):
    """(6, N) voltages [V] and currents [A] with a dip to 0.7 from 0.4 to 0.6 s."""
    t = np.arange(count) / rate
    turn = np.exp(1j * (2 * np.pi * F * t - 2 * np.pi / 3 * np.arange(3)[:, None]))
    depth = np.sqrt(2) * np.where((t >= 0.4) & (t < 0.6), 0.7, 1.0)
    return np.vstack(
        [1e3 * KILOVOLT * turn.real * depth, AMPERE * (turn * np.exp(-1j * LAG)).real * depth]
    )


DEFINITIONS = [
    *(made.definition(f"V{mark}", phase, "V") for phase, mark in PHASES),
    *(made.definition(f"I{mark}", phase, "A") for phase, mark in PHASES),
]


def instances(values=None, rate=RATE):
    """The six channels as 16-bit numbers; the first has the times, which the others share."""
    values = waves() if values is None else values
    scales = [SCALE["V"]] * 3 + [SCALE["A"]] * 3
    return [
        made.instance(
            k, 0 if k else [1, len(row), 1 / rate], np.round((row - 7) / scale), scale, 7.0
        )
        for k, (row, scale) in enumerate(zip(values, scales, strict=True))
    ]


def waveform_file(**options):
    records = [made.source(*DEFINITIONS), made.settings(), made.observation(START, *instances())]
    return made.file(records, **options)


@pytest.fixture
def write(tmp_path):
    def written(content, name="quality.pqd"):
        path = tmp_path / name
        path.write_bytes(content)
        return path

    return written


@pytest.mark.parametrize("compressed", [True, False])
def test_waveforms_are_read_in_volts_and_amperes_at_their_times(write, compressed):
    recording = pqdif.load(write(waveform_file(compressed=compressed)))
    assert [(c.name, c.unit, c.quantity, c.phase) for c in recording.channels] == [
        *((f"V{m}", "V", "voltage", m) for m in "ABC"),
        *((f"I{m}", "A", "current", m) for m in "ABC"),
    ]
    for channel, row, step in zip(recording.channels, waves(), [2.0] * 3 + [0.05] * 3, strict=True):
        np.testing.assert_allclose(channel.raw, row, atol=0.51 * step)
        np.testing.assert_allclose(channel.values(), 1e-3 * channel.raw)
    [segment] = recording.segments
    assert (segment.first, segment.stop, segment.start) == (0, COUNT, 0.0)
    assert segment.rate == pytest.approx(RATE, rel=1e-9)
    assert abs(recording.start - START) < timedelta(microseconds=2)
    assert (recording.station, recording.frequency, recording.notes) == ("Substation", 50.0, ())


def test_the_load_and_its_dip_are_found_by_themselves(write):
    path = write(waveform_file())
    assert find_reader(str(path)).name == "pqdif"
    [event] = tractexp.read(str(path))
    assert event.record.base.voltage == pytest.approx(np.sqrt(3) * KILOVOLT, rel=1e-3)
    assert event.record.base.power == pytest.approx(3e-3 * KILOVOLT * AMPERE, rel=1e-3)
    assert pytest.approx((np.cos(LAG), np.sin(LAG)), abs=2e-3) == (event.P0, event.Q0)
    assert event.depth == pytest.approx(0.3, abs=2e-3)


def test_transformer_ratios_are_applied_where_the_settings_say_so(write):
    ratios = dict.fromkeys(range(3), (110e3, 100.0)) | dict.fromkeys(range(3, 6), (600.0, 5.0))
    peaks = {}
    for use in (True, False):
        content = [
            made.source(*DEFINITIONS),
            made.settings(ratios=ratios, use=use),
            made.observation(START, *instances()),
        ]
        recording = pqdif.load(write(made.file(content)))
        peaks[use] = [recording.channels[k].values().max() for k in (0, 3)]
    np.testing.assert_allclose(peaks[True], [1100 * peaks[False][0], 120 * peaks[False][1]])


def test_runs_of_steps_are_segments_of_their_rates(write):
    times = [2, 400, 1 / 6400, 300, 1 / 800]
    rows = [made.instance(k, times, np.arange(700) % 50, dtype="<f4") for k in range(6)]
    recording = pqdif.load(
        write(made.file([made.source(*DEFINITIONS), made.observation(START, *rows)]))
    )
    assert [s.rate for s in recording.segments] == pytest.approx([6400, 800], rel=1e-6)
    assert recording.segments[1].start == pytest.approx(400 / 6400, abs=2 / 800)
    np.testing.assert_array_equal(recording.channels[2].raw, np.arange(700) % 50)


def test_observations_are_segments_at_their_distance_and_others_are_left_out_with_a_note(write):
    later, trigger = START + timedelta(seconds=10), START + timedelta(seconds=0.4)
    records = [
        made.source(*DEFINITIONS),
        made.observation(START, *instances(), triggered=trigger),
        made.observation(later, *instances()),
        made.observation(later + timedelta(seconds=5), instances()[0]),
    ]
    recording = pqdif.load(write(made.file(records)))
    assert [(s.first, s.stop) for s in recording.segments] == [(0, COUNT), (COUNT, 2 * COUNT)]
    assert recording.segments[1].start == pytest.approx(10, abs=1e-5)
    assert recording.trigger == pytest.approx(0.4, abs=1e-5)
    assert any("1 of 3 observations" in note for note in recording.notes)


def test_each_of_several_triggers_lists_its_event_and_any_can_be_chosen(write):
    """Three parts, hours apart; each begins inside another sag, which its trigger tells apart."""
    t = np.arange(COUNT) / RATE
    records, depths = [made.source(*DEFINITIONS)], (0.8, 0.7, 0.6)
    for k, left in enumerate(depths):
        begin = START + timedelta(hours=k)
        fall = np.where((t >= 0.4) & (t < 0.6), left / 0.7, 1.0)
        values = waves() * fall * np.where(t < 0.05, 0.9, 1.0)
        moment = begin + timedelta(seconds=0.4)
        records.append(made.observation(begin, *instances(values), triggered=moment))
    path = str(write(made.file(records)))
    assert pqdif.load(path).find_triggers() == pytest.approx([0.4, 3600.4, 7200.4], abs=1e-4)
    dips = [e for e in tractexp.look(path, progress=False).events if e["depth"] > 0.15]
    assert [e["depth"] for e in dips] == pytest.approx([0.2, 0.3, 0.4], abs=0.01)
    assert [e["dip"] for e in dips] == [2, 4, 6]
    for number, left in zip((2, 4, 6), depths, strict=True):
        [event] = tractexp.read(path, train=[number], validate=[])
        assert event.depth == pytest.approx(1 - left, abs=0.01)


def test_currents_at_half_the_rate_are_brought_together_with_the_voltages(write):
    values = waves()
    slow = [
        made.instance(k, [1, COUNT // 2, 2 / RATE], values[k, ::2], dtype="<f4")
        for k in range(3, 6)
    ]
    records = [made.source(*DEFINITIONS), made.observation(START, *instances()[:3], *slow)]
    recording = pqdif.load(write(made.file(records)))
    [segment] = recording.segments
    assert segment.rate == pytest.approx(RATE / 2, rel=1e-6)
    np.testing.assert_allclose(recording.channels[0].raw, values[0, ::2], atol=1.1)
    np.testing.assert_allclose(recording.channels[5].raw, values[5, ::2], rtol=1e-6)
    assert any("sampled at 2 rates" in note for note in recording.notes)


def test_times_in_cycles_are_of_the_nominal_frequency(write):
    definitions = [made.definition(f"V{mark}", phase, "V", time="cycles") for phase, mark in PHASES]
    rows = [made.instance(k, [1, COUNT, F / RATE], waves()[k] / 2, 2.0) for k in range(3)]
    content = made.file(
        [made.source(*definitions), made.settings(50.0), made.observation(START, *rows)]
    )
    recording = pqdif.load(write(content))
    assert recording.segments[0].rate == pytest.approx(RATE, rel=1e-6)
    assert any("taken of 50 Hz" in note for note in recording.notes)


def log_file(units=("V", "V", "V", "W", "var", "Hz"), times=None, more=()):
    """Logs of RMS voltages to ground, total P and Q, f, every 10 ms, with a dip to 0.7 from 3 to
    3.2 s.
    """
    t = np.arange(1000) / 100
    U = np.where((t >= 3) & (t < 3.2), 0.7, 1.0)
    columns = [15e3 * U, 15e3 * U, 15e3 * U, 12e6 * U**1.5, 4e6 * U**2, np.full(1000, 49.98)]
    marks = [
        ("RMS A", 1),
        ("RMS B", 2),
        ("RMS C", 3),
        ("Total P", 13),
        ("Total Q", 13),
        ("Frequency", 0),
    ]
    what = {
        "W": "a6b31ae1-b451-11d1-ae17-0060083a2628",
        "var": "a6b31ae4-b451-11d1-ae17-0060083a2628",
        "Hz": "07ef68af-9ff5-11d2-b30b-006008b37183",
    }
    definitions = [
        made.definition(name, phase, unit, "log", scaled=False, characteristic=what.get(unit))
        for (name, phase), unit in zip(marks, units, strict=True)
    ]
    rows = [
        made.instance(k, times or [1, 1000, 0.01], v, dtype="<f8") for k, v in enumerate(columns)
    ]
    return made.file([made.source(*definitions), made.observation(START, *rows), *more])


def test_logs_of_rms_values_and_powers_are_a_table(write):
    path = write(log_file())
    assert find_reader(str(path)).name == "csv"
    [event] = tractexp.read(str(path))
    assert event.record.base.voltage == pytest.approx(np.sqrt(3) * 15, rel=1e-6)
    assert event.record.base.power == pytest.approx(np.hypot(12, 4), rel=1e-6)
    assert pytest.approx((12 / np.hypot(12, 4), 4 / np.hypot(12, 4)), rel=1e-6) == (
        event.P0,
        event.Q0,
    )
    assert event.depth == pytest.approx(0.3, rel=1e-6)
    assert event.t_start == pytest.approx(3.0, abs=0.011)
    np.testing.assert_allclose(event.record.f, 49.98)


def test_a_file_of_one_kind_says_how_the_other_is_read(write):
    with pytest.raises(UserError, match=r"there are no waveforms in this PQDIF file; .*data=csv"):
        pqdif.load(write(log_file()))
    with pytest.raises(UserError, match=r"there are no logs .* read by data=pqdif"):
        pqdif.table(write(waveform_file()))


def test_a_truncated_file_is_read_as_far_as_it_goes(write):
    two = [
        made.source(*DEFINITIONS),
        made.observation(START, *instances()),
        made.observation(START, *instances()),
    ]
    whole = made.file(two)
    recording = pqdif.load(write(whole[:-100]))
    assert len(recording.segments) == 1
    assert any("ends within record 4" in note for note in recording.notes)


def changed(content, at, raw):
    return content[:at] + raw + content[at + len(raw) :]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (lambda: b"", "no PQDIF file"),
        (lambda: b"PK\3\4" + bytes(200), "no PQDIF file"),
        (lambda: waveform_file()[:200], "no waveforms"),
        (
            lambda: changed(waveform_file(), waveform_file().rindex(b"PQDIF"), b"XXXXX"),
            "is no header of a record",
        ),
        (
            lambda: changed(waveform_file(), len(waveform_file()) - 400, bytes(300)),
            "compressed body is damaged",
        ),
        (
            lambda: changed(waveform_file(compressed=False), 64, struct.pack("<i", 10**6)),
            "more than fit into",
        ),
        (
            lambda: made.file(
                [made.source(*DEFINITIONS[:2]), made.observation(START, *instances())]
            ),
            "channel 2 is obs",
        ),
        (lambda: log_file(times=[1, 10**9, 1e-3]), "1000000000 of them, for 1000 values"),
        (lambda: log_file(times=[10**6, 1, 1]), "does not say how many"),
    ],
)
def test_damaged_files_are_refused_with_a_sentence(write, content, says):
    path = write(content())
    with pytest.raises(UserError, match=says):
        (pqdif.table if "values" in says or "how many" in says else pqdif.load)(path)


@pytest.mark.parametrize(
    ("module", "name", "limit", "says"),
    [
        (pqdif_records, "LARGEST", 50_000, "hold more than 0 MB decompressed"),
        (pqdif_channels, "MOST_UNPACKED_VALUES", 30_000, "stand for more than 30,000 values"),
    ],
)
def test_what_is_unpacked_is_bounded(write, monkeypatch, module, name, limit, says):
    monkeypatch.setattr(module, name, limit)
    with pytest.raises(UserError, match=says):
        pqdif.load(write(waveform_file()))


def test_a_collection_that_holds_itself_ends(write):
    content = bytearray(waveform_file(compressed=False))
    at = 64 + struct.unpack_from("<i", content, 36)[0] + 64  # the body of the data source
    # its channel definitions are the body itself
    struct.pack_into("<i", content, at + 4 + 28 + 20, 0)
    struct.pack_into("<16s", content, at + 4 + 28, made.guid("b48d858d", "f5f5"))
    with pytest.raises(UserError, match=r"is observed, and 0 are defined|more than fit"):
        pqdif.load(write(bytes(content)))


def four_observations(**options):
    """A file of four observations a minute apart, and where its records begin."""
    observed = [made.observation(START + timedelta(minutes=k), *instances()) for k in range(4)]
    data = made.file([made.source(*DEFINITIONS), made.settings(), *observed], **options)
    starts = [0]
    while following := struct.unpack_from("<i", data, starts[-1] + 40)[0]:
        starts.append(following)
    return data, starts


def linked(data, at, to):
    return data[: at + 40] + struct.pack("<i", to) + data[at + 44 :]


def test_a_whole_file_has_no_remark_on_its_links(write):
    assert pqdif.load(write(four_observations()[0])).notes == ()


@pytest.mark.parametrize(
    ("at", "to", "says"),
    [
        (4, None, "no link leads to 2 records"),  # the link is lost
        (4, 3, "record 5 links back to byte"),
        (4, 3, "no link leads to 2 records"),
        (4, 6, "no link leads to 1 record "),  # one is jumped over
    ],
)
def test_records_behind_a_damaged_link_are_said_to_be_unread(write, at, to, says):
    data, starts = four_observations()
    notes = pqdif.load(write(linked(data, starts[at], starts[to] if to else 0))).notes
    assert any(says in note for note in notes), notes


def test_zeros_between_records_and_at_the_end_are_no_loss(write):
    data = four_observations()[0]
    assert pqdif.load(write(data + bytes(512))).notes == ()


@pytest.mark.parametrize("of", ["compressed", "body"])
@pytest.mark.parametrize("sum_of", [zlib.crc32, zlib.adler32])
@pytest.mark.parametrize("compressed", [True, False])
def test_every_checksum_that_writers_use_is_accepted_and_another_is_told(
    write, compressed, sum_of, of
):
    data, starts = four_observations(compressed=compressed)
    for k, at in enumerate(starts):
        header, size = struct.unpack_from("<ii", data, at + 32)
        content = data[at + header : at + header + size]
        whole = zlib.decompress(content) if compressed and k and of == "body" else content
        data = data[: at + 44] + struct.pack("<I", sum_of(whole)) + data[at + 48 :]
    assert pqdif.load(write(data)).notes == ()
    odd = data[: starts[4] + 44] + struct.pack("<I", 1234) + data[starts[4] + 48 :]
    assert [note.partition(": ")[2] for note in pqdif.load(write(odd)).notes] == [
        "record 5: the checksum does not fit: it was altered, or damaged on its way"
    ]


def test_a_count_of_millions_is_refused_before_it_takes_memory(write, monkeypatch):
    monkeypatch.setattr(pqdif_records, "MOST_ELEMENTS", 3)
    with pytest.raises(UserError, match="more than fit into the record"):
        pqdif.load(write(waveform_file()))
