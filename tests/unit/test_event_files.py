"""Files of one event: one a phase, voltages and currents apart; in a folder and in a .zip."""

import shlex
import zipfile
from datetime import datetime, timedelta

import field_waves
import made_recordings
import numpy as np
import pytest
from command_line import run_command

import tractexp
from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.recording.event_files import name_one_event, tell_apart

RATE, START = 1600.0, datetime(2026, 3, 1, 10, 0, 0)
T = np.arange(0, 1.0, 1 / RATE)
V = field_waves.dip(T)
WAVES = field_waves.wave(T, np.concatenate([field_waves.phases(V), field_waves.load(V)]))
P, Q = 3 * field_waves.KV * field_waves.KA * np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])


def write_table(path, columns, times=T):
    """A table of columns {name: values}, with times [s] or texts."""
    rows = zip(times, *columns.values(), strict=True)
    lines = [",".join(["t", *columns])]
    lines += [",".join(x if isinstance(x, str) else f"{x:.7g}" for x in row) for row in rows]
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines) + "\n")
    return path


def write_comtrade(path, rows, names, start=START, first=0, stop=None, rate=RATE):
    """A .cfg and .dat of some rows of `WAVES`."""
    values = WAVES[rows, first:stop]
    path.parent.mkdir(exist_ok=True)
    made = made_recordings.recording(values, names, rate=rate, start=start)
    comtrade.write(made, path)
    return path


def phase_tables(folder, marks="ABC", columns=("U [kV]", "I [kA]"), name="ev_{}.csv"):
    """A table for each phase."""
    return [
        write_table(
            folder / name.format(mark),
            {column: WAVES[k + 3 * i] for i, column in enumerate(columns)},
        )
        for k, mark in enumerate(marks)
    ]


def pack(archive, *paths):
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for path in paths:
            packed.write(path, path.relative_to(archive.parent))
    return archive


def look(*paths, **settings):
    seen = tractexp.look(*map(str, paths), progress=False, **settings)
    (load,) = [one for one in seen.feeders if one["loaded"]]
    return seen, load


def check_load(load):
    """The load of `WAVES`, whichever files it came from."""
    assert (load["U"], load["P"], load["Q"]) == pytest.approx((110, P, Q), rel=2e-3)
    assert load["connection"] == "three_phase"


@pytest.mark.parametrize(
    ("marks", "columns", "name"),
    [
        ("ABC", ("U [kV]", "I [kA]"), "ev_{}.csv"),
        (("L1", "L2", "L3"), ("Voltage [kV]", "Current [kA]"), "2026-03-01 {} bay.csv"),
        ("RST", ("U [kV]", "I [kA]"), "phase {}.csv"),
        ("RYB", ("V [kV]", "I [kA]"), "{}-phase.csv"),
        ("UVW", ("U [kV]", "I [kA]"), "rec-{}.csv"),
        ("АВС", ("U [kV]", "I [kA]"), "фаза {}.csv"),
        ("ABC", ("U [kV]", "I [kA]"), "{}/record.csv"),
        ("ABC", ("电压 [kV]", "电流 [kA]"), "{}相.csv"),
    ],
)
def test_one_file_a_phase_is_one_load_from_a_zip(tmp_path, marks, columns, name):
    paths = phase_tables(tmp_path, marks, columns, name)
    seen, load = look(pack(tmp_path / "event.zip", *paths))
    check_load(load)
    assert "joined sample by sample" in " ".join(seen.files.rows[0]["notes"])
    assert "data.join=" in load["command"]


def test_one_file_a_channel_is_named_by_its_file(tmp_path):
    names = ("UA", "UB", "UC", "IA", "IB", "IC")
    paths = [
        write_table(tmp_path / f"{name}.csv", {f"Value [{'kV' if k < 3 else 'kA'}]": WAVES[k]})
        for k, name in enumerate(names)
    ]
    seen, load = look(pack(tmp_path / "event.zip", *paths))
    check_load(load)
    assert {row["name"] for row in seen.channels} == {*names}


def test_files_that_are_given_together_are_joined(tmp_path):
    paths = phase_tables(tmp_path)
    check_load(look(*paths)[1])
    check_load(look(paths[0], join=[str(path) for path in paths[1:]])[1])


def test_what_look_advises_of_one_file_leads_to_the_load(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    voltages = {f"U{p} [kV]": WAVES[k] for k, p in enumerate("ABC")}
    currents = {f"I{p} [kA]": WAVES[3 + k] for k, p in enumerate("ABC")}
    write_table(tmp_path / "rec_U.csv", voltages)
    write_table(tmp_path / "rec_I.csv", currents)
    for name, other in (("rec_U.csv", "rec_I.csv"), ("rec_I.csv", "rec_U.csv")):
        seen = tractexp.look(name, progress=False)
        assert seen.commands == []
        advice = f"it shows a load: tractexp look {name} 'join=[{other}]'"
        assert advice in str(seen.summary()).splitlines()[0]
        check_load(look(name, join=[other])[1])


def test_a_single_phase_names_the_others_beside_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    phase_tables(tmp_path)
    seen, load = look("ev_B.csv")
    assert load["P"] == pytest.approx(P / 3, rel=2e-3)
    assert "tractexp look ev_B.csv 'join=[ev_A.csv,ev_C.csv]'" in str(seen.summary())


def test_tables_of_powers_are_joined(tmp_path):
    u = np.where((T > 0.4) & (T < 0.6), 0.6, 1.0)[::16]
    tables = {"U": 110 * u, "P": 20 * u**1.5, "Q": 8 * u**2}
    units = {"U": "kV", "P": "MW", "Q": "Mvar"}
    paths = [
        write_table(tmp_path / f"log {key}.csv", {f"{key} [{units[key]}]": values}, T[::16])
        for key, values in tables.items()
    ]
    archive = pack(tmp_path / "event.zip", *paths)
    (event,) = tractexp.read(str(archive))
    assert (event.record.base.voltage, event.record.base.power) == pytest.approx(
        (110, np.hypot(20, 8)), rel=1e-3
    )
    _, load = look(archive)
    assert (load["P"], load["Q"]) == pytest.approx((20, 8), rel=1e-3)
    with pytest.raises(UserError, match=r"it shows a load: tractexp look .*join=\["):
        tractexp.look(str(paths[1]), progress=False)


def test_recordings_are_aligned_by_their_clocks(tmp_path):
    """The currents' file begins 100.25 steps later and is shorter: samples between its own."""
    late = 100.25 / RATE
    shifted = field_waves.wave(T + late, field_waves.load(field_waves.dip(T + late)))
    names = ["IA", "IB", "IC"]
    made = made_recordings.recording(
        shifted[:, :1200], names, rate=RATE, start=START + timedelta(seconds=late)
    )
    comtrade.write(made, tmp_path / "rec_I.cfg")
    write_comtrade(tmp_path / "rec_U.cfg", slice(0, 3), ["UA", "UB", "UC"])
    files = [tmp_path / f"rec_{k}{end}" for k in "UI" for end in (".cfg", ".dat")]
    for order in (files[0::2], files[2::-2]):
        seen, load = look(*order)
        check_load(load)
        assert "62.66 ms apart" in " ".join(seen.files.rows[0]["notes"])
    check_load(look(pack(tmp_path / "event.zip", *files))[1])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rate": 800.0}, "800: files of one event are joined at one rate"),
        ({"start": START + timedelta(seconds=5)}, "ends at .* begins at .* overlap in time"),
    ],
)
def test_what_is_not_of_one_event_is_refused(tmp_path, change, words):
    first = write_comtrade(tmp_path / "a.cfg", slice(0, 3), ["UA", "UB", "UC"])
    second = write_comtrade(tmp_path / "b.cfg", slice(3, 6), ["IA", "IB", "IC"], **change)
    with pytest.raises(UserError, match=words):
        tractexp.read(str(first), join=[str(second)])
    assert tractexp.look(str(first), str(second), progress=False).commands == []


def test_times_without_a_date_must_be_the_same(tmp_path):
    first = write_table(tmp_path / "a.csv", {"U [kV]": WAVES[0]})
    second = write_table(tmp_path / "b.csv", {"I [kA]": WAVES[3][:900]}, T[:900])
    with pytest.raises(UserError, match=r"1600 samples and .* 900, and not all of them say"):
        tractexp.read(str(first), join=[str(second)])


def test_a_file_may_serve_only_once(tmp_path):
    first, *_ = phase_tables(tmp_path)
    with pytest.raises(UserError, match="twice"):
        tractexp.read(str(first), join=[str(first)])


def test_a_channel_that_two_files_have_is_there_once(tmp_path):
    names = ["UA", "UB", "UC"]
    write_comtrade(tmp_path / "a.cfg", [0, 1, 2], names)
    write_comtrade(tmp_path / "b.cfg", [0, 3, 4, 5], ["UA", "IA", "IB", "IC"])
    seen, load = look(tmp_path / "a.cfg", join=[str(tmp_path / "b.cfg")])
    check_load(load)
    assert [row["name"] for row in seen.channels] == [*names, "IA", "IB", "IC"]
    assert "channel 'UA' of b.cfg is that of an earlier file" in seen.files.rows[0]["notes"]


@pytest.mark.parametrize("names", [("U", "I"), ("bay U", "bay I"), ("U{}", "I{}")])
def test_a_record_of_each_phase_is_one_of_three(tmp_path, names):
    paths = [
        write_comtrade(
            tmp_path / f"bay7_{mark}.cfg", [k, 3 + k], [name.format(mark) for name in names]
        )
        for k, mark in enumerate("ABC")
    ]
    check_load(look(*paths)[1])
    archive = pack(tmp_path / "e.zip", *tmp_path.glob("bay7*"))
    check_load(look(archive)[1])
    (event,) = tractexp.read(str(archive))
    assert event.depth == pytest.approx(0.4, abs=0.01)


def test_events_of_one_load_are_not_joined(tmp_path):
    """Two events, each with its own voltages and currents, are two records: with a command of each
    there is one that fits them together.
    """
    names = ["UA", "UB", "UC", "IA", "IB", "IC"]
    paths = [write_comtrade(tmp_path / f"{k}.cfg", slice(0, 6), names) for k in ("rec_a", "rec_x")]
    seen = tractexp.look(*map(str, paths), progress=False)
    *single, joint = seen.commands
    assert len(seen.files.rows) == len(single) == 2
    assert "'data.train=[rec_a.cfg#1.1]' 'data.validate=[rec_x.cfg#1.1]'" in joint


def test_names_tell_what_tells_files_apart():
    assert tell_apart(["x/ev_L1.csv", "x/ev_L2.csv"]) == ["L1", "L2"]
    assert tell_apart(["z.zip/A/rec.cfg", "z.zip/B/rec.cfg"]) == ["A", "B"]
    assert name_one_event(["e_ua.csv", "e_ub.csv", "e_ia.csv"])
    assert name_one_event(["volts.csv", "currents.csv"])
    assert not name_one_event(["event_1.csv", "event_2.csv", "event_3.csv"])
    assert not name_one_event(["north.csv", "south.csv"])
    assert not name_one_event(["bay_a1.csv", "bay_a2.csv"])


def test_files_of_other_kinds_and_none_are_refused(tmp_path):
    first = write_comtrade(tmp_path / "a.cfg", slice(0, 3), ["UA", "UB", "UC"])
    table = write_table(tmp_path / "b.csv", {"IA [kA]": WAVES[3]})
    for join, words in (
        (
            [str(table)],
            r"join: .*b.csv is of another kind than .*a.cfg: one reader reads all files",
        ),
        (["absent.cfg"], r"absent.cfg: there is no such file"),
        (5, r"join=5 must be a list of files of the same event"),
    ):
        with pytest.raises(UserError, match=words):
            tractexp.read(str(first), join=join)


def test_why_a_zip_is_not_one_event_is_said(tmp_path):
    """Channels of an oscilloscope, of which nothing says what they measure."""
    paths = [write_table(tmp_path / f"T1CH{k}.csv", {f"CH{k}": WAVES[k]}) for k in (1, 2, 3)]
    with pytest.raises(UserError, match=r"holds 3 records.*not read as one event.*column U"):
        tractexp.look(str(pack(tmp_path / "scope.zip", *paths)), progress=False)


def test_rows_that_one_table_lacks_are_refused(tmp_path):
    """By their clocks, the rows after a lost one would be a step off."""
    times = [(START + timedelta(seconds=float(t))).isoformat() for t in T]
    first = write_table(tmp_path / "e_U.csv", {"U [kV]": WAVES[0]}, times)
    kept = np.arange(len(T)) != 700
    columns = {"I [kA]": WAVES[3][kept]}
    second = write_table(tmp_path / "e_I.csv", columns, [times[k] for k in np.flatnonzero(kept)])
    with pytest.raises(UserError, match=r"rows are missing or double in one of them"):
        tractexp.read(str(first), join=[str(second)])


def test_dead_channels_of_one_name_are_not_one_channel(tmp_path):
    dead = np.zeros(len(T))
    paths = [
        write_table(tmp_path / f"ev_{p}.csv", {"U [kV]": WAVES[k], "I [kA]": dead})
        for k, p in enumerate("ABC")
    ]
    seen = tractexp.look(*map(str, paths), progress=False)
    assert [row["name"] for row in seen.channels] == ["U A", "I A", "U B", "I B", "U C", "I C"]


def test_the_command_of_look_reads_the_files_together(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    marks = ("L1", "L2", "L3")
    pack(tmp_path / "my event.zip", *phase_tables(tmp_path, marks, name="1 März {} (bay).csv"))
    _, load = look("my event.zip")
    words = shlex.split(load["command"].removesuffix(" model=auto"))[1:]
    run = run_command("task=convert", "task.to=parquet", "task.what=events", *words, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert [*tmp_path.rglob("*.parquet")]


def test_a_survey_says_which_files_belong_together(tmp_path):
    write_comtrade(tmp_path / "e_U.cfg", slice(0, 3), ["UA", "UB", "UC"])
    write_comtrade(tmp_path / "e_I.cfg", slice(3, 6), ["IA", "IB", "IC"])
    rows = tractexp.survey(str(tmp_path), cores=1, progress=False).content["rows"]
    assert {row["file"] for row in rows} == {"e_U.cfg", "e_I.cfg"}
    assert all(
        "beside it, of the same event, it shows a load: tractexp look" in row["why"] for row in rows
    )
