"""Single missing samples: of tables, of synchrophasors and of waveforms; what is bridged, what is
left out, what is said.
"""

import dataclasses

import made_recordings
import numpy as np
import pytest
from numpy.testing import assert_allclose

import tractexp
from tractexp.filetypes import comtrade
from tractexp.record import gap

RATE = 200.0  # Hz
TIMES = np.arange(400) / RATE
U = np.where((TIMES >= 0.5) & (TIMES < 0.7), 0.6, 1.0) + 1e-3 * np.sin(9 * TIMES)
COLUMNS = {"t": TIMES, "U": U, "P": 0.8 * U, "Q": 0.6 * U**2}
BEFORE, INSIDE = 40, 120  # samples before the dip and in it


def written(path, columns=None, lost=(), blank=(), extra=None):
    """A table without the rows `lost`, and with the cells of the rows `blank` empty."""
    columns = {**(columns or COLUMNS), **(extra or {})}
    lines = [",".join(columns)]
    for k, row in enumerate(zip(*columns.values(), strict=True)):
        cells = [str(x) for x in row]
        lines += (
            []
            if k in lost
            else [cells[0] + "," * (len(cells) - 1) if k in blank else ",".join(cells)]
        )
    path.write_text("\n".join(lines) + "\n")
    return path


def only(path, **settings):
    [event] = tractexp.read(path, **settings)
    return event


def notes_of_look(path):
    return " ".join(tractexp.look(path, progress=False).files.rows[0]["notes"])


class TestArithmetic:
    def test_single_gaps_stand_between_two_that_are_there(self):
        missing = np.zeros(200, bool)
        missing[[0, 5, 9, 10, 20, 199]] = True
        assert gap.find_short_gaps(missing).tolist() == [5, 20]

    def test_what_is_missing_too_often_was_recorded_so(self):
        missing = np.arange(200) % 10 == 5
        assert not len(gap.find_short_gaps(missing))

    def test_single_lost_rows_are_found_by_the_times_that_jump(self):
        t = np.delete(np.arange(300) * 0.02, [50, 90])
        assert gap.find_lost_rows(t).tolist() == [50, 89]
        assert gap.insert_times(t, np.array([50, 89])) == pytest.approx(np.arange(300) * 0.02)

    @pytest.mark.parametrize("lost", [[50, 51], range(5, 300, 9)])
    def test_longer_gaps_and_uneven_times_are_no_lost_rows(self, lost):
        assert not len(gap.find_lost_rows(np.delete(np.arange(300) * 0.02, [*lost])))
        steps = np.random.default_rng(3).uniform(0.5, 2.0, 300)
        assert not len(gap.find_lost_rows(np.cumsum(steps)))

    @pytest.mark.parametrize(("per_cycle", "error"), [(20, 2e-3), (64, 2e-5), (200, 2e-7)])
    def test_the_cubic_is_as_right_as_it_says(self, per_cycle, error):
        x = np.cos(2 * np.pi * np.arange(4 * per_cycle) / per_cycle + 0.4)
        for at in range(2, per_cycle):
            lacking = x.copy()
            lacking[at] = np.nan
            [there] = gap.estimate_wave_values(lacking, np.array([at]))
            assert there == pytest.approx(x[at], abs=error)

    @pytest.mark.parametrize(("per_cycle", "lost", "error"), [(64, 5, 2e-3), (128, 11, 2e-3)])
    def test_it_is_so_of_as_many_in_a_row_as_are_bridged(self, per_cycle, lost, error):
        assert gap.limit_wave_gap(50.0 * per_cycle, 50.0) == lost
        x = np.cos(2 * np.pi * np.arange(4 * per_cycle) / per_cycle + 0.4)
        for first in range(2, per_cycle):
            at = np.arange(first, first + lost)
            lacking = np.where(np.isin(np.arange(len(x)), at), np.nan, x)
            assert gap.find_short_gaps(np.isnan(lacking), lost).tolist() == at.tolist()
            assert gap.estimate_wave_values(lacking, at) == pytest.approx(x[at], abs=error)


class TestTables:
    @pytest.mark.parametrize("how", ["lost", "blank"])
    def test_a_frame_is_bridged_and_in_no_sum(self, tmp_path, how):
        path = written(tmp_path / "a.csv", **{how: (BEFORE, INSIDE)})
        event, whole = only(path), only(written(tmp_path / "whole.csv"))
        assert event.record.t == pytest.approx(TIMES)
        assert_allclose(event.record.U, U, atol=2e-5)
        assert np.flatnonzero(np.isnan(event.record.P)).tolist() == [BEFORE, INSIDE]
        assert np.flatnonzero(np.isnan(event.record.Q)).tolist() == [BEFORE, INSIDE]
        assert (event.start, event.end) == (whole.start, whole.end)
        assert_allclose([event.P0, event.Q0], [whole.P0, whole.Q0], rtol=1e-4)
        said = "2 samples missing at t = 0.2, 0.6 s: bridged, and in no sum of P and Q"
        assert said in event.record.notes
        assert said in notes_of_look(path)

    def test_a_gap_of_p_and_q_alone_is_no_gap_of_the_voltage(self, tmp_path):
        table = {name: x.copy() for name, x in COLUMNS.items()}
        table["P"][[BEFORE, BEFORE + 1]] = np.nan
        record = only(written(tmp_path / "a.csv", table)).record
        assert record.notes == ()
        assert_allclose(record.U, U, atol=1e-12)

    def test_a_frame_from_python_is_bridged_as_well(self):
        table = {name: np.delete(x, INSIDE) for name, x in COLUMNS.items()}
        record = only(table).record
        assert record.t == pytest.approx(TIMES)
        assert np.isnan(record.P[INSIDE])

    @pytest.mark.parametrize("how", ["lost", "blank"])
    def test_frames_in_a_row_are_bridged_where_the_voltage_stays(self, tmp_path, how):
        rows = [*range(BEFORE, BEFORE + 3), *range(INSIDE, INSIDE + 3)]
        record = only(written(tmp_path / "a.csv", **{how: rows})).record
        assert record.t == pytest.approx(TIMES)
        assert_allclose(record.U, U, atol=1e-4)
        assert np.flatnonzero(np.isnan(record.P)).tolist() == rows

    @pytest.mark.parametrize("how", ["lost", "blank"])
    @pytest.mark.parametrize("rows", [(99, 100), (138, 139, 140), range(BEFORE, BEFORE + 4)])
    def test_at_an_edge_of_the_dip_or_of_more_they_are_refused(self, tmp_path, how, rows):
        with pytest.raises(tractexp.UserError, match=r"rows are missing|U = nan is not"):
            only(written(tmp_path / "a.csv", **{how: rows}))

    @pytest.mark.parametrize("how", ["lost", "blank"])
    def test_a_lost_frame_of_a_phasor_unit(self, tmp_path, how):
        angle = 0.05 * 360 * TIMES  # 0.05 Hz above nominal
        phasors = {"t": TIMES}
        for k, p in enumerate("abc"):
            phasors |= {f"V{p} [kV]": 63.5 * U, f"V{p} angle [deg]": angle - 120 * k}
            phasors |= {f"I{p} [A]": 200 * U, f"I{p} angle [deg]": angle - 120 * k - 30}
        path = written(tmp_path / "pmu.csv", phasors, **{how: (BEFORE, INSIDE)})
        record, whole = only(path).record, only(written(tmp_path / "whole.csv", phasors)).record
        assert_allclose(record.U, whole.U, atol=2e-5)
        assert record.f == pytest.approx(50.05, abs=1e-6)
        assert np.flatnonzero(np.isnan(record.P)).tolist() == [BEFORE, INSIDE]

    @pytest.mark.parametrize(
        ("name", "good", "bad"),
        [
            ("Quality", "Good", "Bad"),
            ("STAT", 0, 0x8000),
            ("Status", "0x0000", "0xC000"),
            ("quality", 192, 0),
            ("Qualität", "gut", "ungültig"),
        ],
    )
    def test_a_row_that_is_marked_bad_is_as_missing(self, tmp_path, name, good, bad):
        table = {key: x.copy() for key, x in COLUMNS.items()}
        marks = [good] * len(TIMES)
        for k in (BEFORE, INSIDE):
            marks[k] = bad
            table["U"][k] = table["P"][k] = 1.7  # what a unit sends that has lost its signal
        record = only(written(tmp_path / "a.csv", table, extra={name: marks})).record
        assert_allclose(record.U, U, atol=2e-5)
        assert np.flatnonzero(np.isnan(record.P)).tolist() == [BEFORE, INSIDE]
        assert f"'{name}' marks 2 rows as bad: left out" in record.notes

    @pytest.mark.parametrize("fill", [0.0, -9999.0, 1e30])
    def test_a_frame_that_was_filled_in_is_as_missing(self, tmp_path, fill):
        table = {key: x.copy() for key, x in COLUMNS.items()}
        for key in "UPQ":
            table[key][[BEFORE, INSIDE]] = fill
        record = only(written(tmp_path / "a.csv", table)).record
        assert_allclose(record.U, U, atol=2e-5)
        assert np.flatnonzero(np.isnan(record.P)).tolist() == [BEFORE, INSIDE]
        assert any(f"2 rows hold nothing but {fill:g}" in note for note in record.notes)

    def test_a_voltage_of_zero_alone_is_no_lost_frame(self, tmp_path):
        table = {key: x.copy() for key, x in COLUMNS.items()}
        table["U"][BEFORE] = 0.0
        with pytest.raises(tractexp.UserError, match="U = 0, but voltage must be above zero"):
            only(written(tmp_path / "a.csv", table))

    def test_rows_marked_in_a_row_are_said_and_used(self, tmp_path):
        marks = ["Good"] * len(TIMES)
        marks[300:320] = ["Bad"] * 20
        record = only(written(tmp_path / "a.csv", extra={"Quality": marks})).record
        assert_allclose(record.U, U, atol=1e-12)
        assert any("marks 20 rows as bad, one after another" in note for note in record.notes)

    def test_a_column_of_states_marks_nothing(self, tmp_path):
        states = np.where(TIMES < 0.6, 1, 3)
        record = only(written(tmp_path / "a.csv", extra={"Status": states})).record
        assert not any("marks" in note for note in record.notes)


def recorded(path, lost=()):
    """A COMTRADE record of a constant impedance, without the samples `lost`, (channel, sample)."""
    whole = made_recordings.recording(made_recordings.constant())
    channels = [dataclasses.replace(c, raw=c.raw.copy(), missing=-32768) for c in whole.channels]
    for channel, sample in lost:
        channels[channel].raw[sample] = -32768
    files = comtrade.write(dataclasses.replace(whole, channels=channels), path)
    return next(file for file in files if file.suffix == ".cfg")


class TestWaveforms:
    lost = ((0, 600), (4, 1900), (5, 1900))  # at 0.1875 s, before the dip, and 0.59375 s, in it

    def test_a_sample_is_bridged_and_its_windows_in_the_dip_are_left_out(self, tmp_path):
        event, whole = (
            only(recorded(tmp_path / "a.cfg", self.lost)),
            only(recorded(tmp_path / "w.cfg")),
        )
        record = event.record
        left_out = np.isnan(record.P)
        assert record.t[left_out] == pytest.approx(0.59375, abs=0.0101)
        assert np.count_nonzero(left_out) > 15
        kept = ~left_out
        assert record.P[kept] == pytest.approx(whole.record.P[kept], abs=2e-6)
        assert_allclose(record.U, whole.record.U, atol=2e-6)
        said = "2 samples missing at t = 0.1875, 0.59375 s (0 'UA', 4 'IB', 5 'IC'): bridged"
        assert any(note.startswith(said) for note in record.notes)
        assert said in notes_of_look(tmp_path / "a.cfg")

    def test_a_table_of_waveforms_without_a_row(self, tmp_path):
        values = made_recordings.constant()
        t = np.arange(values.shape[1]) / made_recordings.RATE
        names = ("ua [kV]", "ub [kV]", "uc [kV]", "ia [kA]", "ib [kA]", "ic [kA]")
        table = {"t": t, **dict(zip(names, values, strict=True))}
        for how in ("lost", "blank"):
            record = only(written(tmp_path / f"{how}.csv", table, **{how: (600, 1900)})).record
            left_out = np.isnan(record.P)
            assert record.t[left_out] == pytest.approx(0.59375, abs=0.0101)
            assert any("bridged" in note for note in record.notes)

    def test_a_tenth_of_a_cycle_in_a_row_is_bridged(self, tmp_path):
        """Five samples of 64."""
        lost = tuple((channel, k) for channel in range(6) for k in range(600, 605))
        record = only(recorded(tmp_path / "a.cfg", lost)).record
        whole = only(recorded(tmp_path / "w.cfg")).record
        assert_allclose(record.U, whole.U, atol=5e-4)
        assert_allclose(record.P, whole.P, atol=1e-3)
        assert any("5 samples missing" in note for note in record.notes)

    def test_a_longer_gap_of_all_channels_parts_the_record(self, tmp_path):
        lost = [(channel, k) for channel in range(6) for k in range(2600, 2700)]
        path = recorded(tmp_path / "a.cfg", lost)
        event, whole = only(path), only(recorded(tmp_path / "w.cfg"))
        assert (event.depth, event.P0) == pytest.approx((whole.depth, whole.P0), rel=1e-5)
        assert event.record.t[-1] < 2600 / made_recordings.RATE
        said = "100 samples have no value in any channel: parts that begin at 0 s, 0.84375 s are"
        assert said in notes_of_look(path)

    def test_more_samples_in_a_row_are_refused_by_name(self, tmp_path):
        path = recorded(tmp_path / "a.cfg", [(0, k) for k in range(1900, 1906)])
        with pytest.raises(tractexp.UserError, match="channel 0 'UA' has no value at sample 1901"):
            only(path)

    def test_waves_keep_what_was_bridged(self, tmp_path):
        waves = only(recorded(tmp_path / "a.cfg", self.lost)).record.waves
        assert waves.bridged == (0.1875, 0.59375)
        assert type(waves).from_content(waves.to_dict()).bridged == waves.bridged
