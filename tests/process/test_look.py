"""A look at files without naming channels: what is proposed, what happened, and commands that run
as they stand.
"""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pandas
import pytest
from browser import BROWSER, Worked, drawn
from command_line import run_command
from made_recordings import BASE, RATE, constant, recording, waves
from pages import charts

import tractexp
import tractexp.text.progress
from tractexp.blocks import style
from tractexp.configuration.overrides import format_assignment, quote_override
from tractexp.errors import UserError
from tractexp.filetypes.comtrade_writer import write
from tractexp.recording import StatusChannel
from tractexp.recording.quality import compute_spectrum
from tractexp.recording.trace import compute_half_cycle_rms
from tractexp.report.look_charts import compute_envelope
from tractexp.report.look_console import build_summary

# what a command races is left as it is but for how many structures take part
QUICK_RACE = "model.candidates.phasors=[static_exponential]"


def saved(path, values=None, **more):
    path.parent.mkdir(parents=True, exist_ok=True)
    write(recording(constant() if values is None else values, **more), path, "BINARY", 1999)
    return path


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    """Two loads on one bus and a dip of 40 %; the second load is the first one's half, its current
    reversed.
    """
    first = constant()
    values = np.concatenate([first, -first[3:] / 2])
    names = ("UA", "UB", "UC", "Q1 IA", "Q1 IB", "Q1 IC", "Q2 IA", "Q2 IB", "Q2 IC")
    return saved(tmp_path_factory.mktemp("field") / "站北 (1).cfg", values, names=names)


@pytest.fixture(scope="module")
def looked(station):
    return tractexp.look(station)


def test_file_channels_loads_and_events_are_told_as_tables_and_frames(looked):
    (file,) = looked.files
    assert (file["station"], file["rates"], file["frequency"]) == ("North", [RATE], 50.0)
    assert file["start"] == "2026-03-01T10:00:00"
    assert file["measured_frequency"] == pytest.approx(50, abs=1e-3)
    assert [c["name"] for c in looked.channels][:4] == ["UA", "UB", "UC", "Q1 IA"]
    assert looked.channels.to_frame()["magnitude"][0] == pytest.approx(
        BASE[0] / np.sqrt(3), rel=1e-3
    )
    assert len(looked.feeders) == 2
    first = looked.feeders.rows[0]
    assert (first["U"], first["P"], first["Q"]) == pytest.approx(
        (BASE[0], 0.8 * BASE[1], 0.3 * BASE[1]), rel=1e-3
    )
    assert first["sum_V"] < 1e-3
    event = looked.events.rows[0]
    assert (event["kind"], event["dip"], event["worth"]) == ("dip", 1, True)
    assert event["depth"] == pytest.approx(0.4, abs=2e-3)
    assert event["duration"] == pytest.approx(0.2, abs=0.03)
    assert event["P_before"] == pytest.approx(0.8 * BASE[1], rel=2e-3)
    assert "dip" in str(looked)


def test_a_file_as_the_only_argument_is_looked_at(station, tmp_path):
    done = run_command(str(station), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "to fit it:" in done.stdout
    assert list(tmp_path.glob("outputs/looks/*/*.html"))
    done = run_command("missing.cfg", cwd=tmp_path)
    assert done.returncode == 2
    assert "there is no such file" in done.stderr


def test_the_first_line_is_the_answer_and_each_load_has_one(looked):
    first, *others = str(looked).splitlines()
    (command,) = looked.commands
    assert first == f"dip 1 at 0.492 s (40.0%, 220 ms) of Q1 is worth fitting; to fit it: {command}"
    (bus,) = (line for line in others if "UA, UB, UC" in line)
    assert "110 kV; dip 1 at 0.492 s (40.0%, 220 ms)" in bus
    rows = [line.split() for line in others if line.lstrip().startswith("Q")]
    assert [(row[0], row[1], row[7]) for row in rows] == [("Q1", "1", "yes:"), ("Q2", "1", "no:")]
    assert " ".join(rows[1][8:]) == "P is negative before it"


def test_eighty_channels_are_one_screen(tmp_path):
    """24 feeders with and 2 without load on one bus: a table by feeder."""
    first = constant()
    loads = [first[3:] * 0.97**k * (1e-6 if k > 23 else 1.0) for k in range(26)]
    names = ["UA", "UB", "UC", *(f"Q{k} I{p}" for k in range(26) for p in "ABC")]
    made = tractexp.look(
        saved(
            tmp_path / "many.cfg",
            np.concatenate([first, *loads])[[0, 1, 2, *range(6, 84)]],
            names=names,
        )
    )
    lines = str(made).splitlines()
    assert sum(line.strip().startswith("Q") for line in lines) == 24
    assert len(lines) <= 36
    assert lines[-1].endswith("listed with the loads of its bus: Q24, Q25")
    assert "Q0 is worth fitting" in lines[0]


def test_a_note_of_the_reader_is_on_the_screen_and_of_many_three(tmp_path):
    path = saved(tmp_path / "five.cfg")
    path.write_text(path.read_text().replace("\n50\n", "\n0\n"))
    made = tractexp.look(path)
    (note,) = made.content["files"][0]["notes"]
    assert f"  note: {note}" in str(made)
    many = {**made.content["files"][0], "notes": [f"line {k} was mended" for k in range(9)]}
    lines = str(build_summary({"files": [many]})).splitlines()
    assert [line for line in lines if line.startswith("  note")][2:] == [
        "  note: line 2 was mended",
        "  note: 6 more",
    ]


def test_records_that_one_command_fits_are_named_by_what_it_fits():
    first = str(tractexp.look("tibet")).splitlines()[0]
    assert first.startswith(
        "dip at 0.304 s (50.1%, 340 ms) of tibet_50pct is worth fitting; to fit it: tractexp"
    )


@pytest.mark.parametrize("name", ["dfr220kv-shandong/xtz.cfg", "async110kv-wisp/async110.cfg"])
def test_a_recorder_of_a_station_is_one_screen(name, tmp_path):
    path = Path(__file__).parents[3] / "shared" / "data" / name
    if not path.exists():
        pytest.skip(f"{path} is not there")
    done = run_command("look", str(path), "--folder", "x", cwd=tmp_path, COLUMNS="80")
    assert len(done.stdout.splitlines()) <= 25
    words = " ".join(done.stdout.split())  # the answer is longer than a line of 80 columns
    assert ("is worth fitting; to fit it: tractexp" in words) == ("xtz" in name)


def test_a_load_may_be_named_and_is_then_the_only_one(station):
    made = tractexp.look(station, voltages=[0, 1, 2], currents=["Q1 IA", "Q1 IB", "Q1 IC"])
    assert [f["currents"] for f in made.feeders] == [[3, 4, 5]]


def test_every_command_runs_as_it_stands_and_reads_what_was_shown(looked, station, tmp_path):
    """In a shell's words, from another folder, name of the file with a space, brackets and Chinese
    letters.
    """
    for feeder in looked.feeders:
        if feeder["P"] < 0:  # a source, or a load counted backwards: not told which, so not fitted
            assert not feeder["command"]
            assert any("P is negative before it" in e["why"] for e in looked.events)
            continue
        words = shlex.split(feeder["command"])
        assert words[0] == "tractexp"
        done = run_command(
            *words[1:],
            "--all",
            QUICK_RACE,
            "optimizer=random_search",
            "budget=50",
            "tracking.enabled=false",
            "hydra.run.dir=run",
            cwd=tmp_path,
        )
        assert done.returncode == 0, done.stderr
        (event,) = json.loads((tmp_path / "run" / "result.json").read_text())["events"]
        assert event["name"] == f"{station.stem}_dip1"
        assert "dip of 40 %" in done.stdout


def test_dips_of_one_load_in_several_files_are_fitted_by_one_command(tmp_path):
    """The last file's dip is held out; a file of other channels is no dip of this load."""
    depths = {"a.cfg": 0.3, "b c.cfg": 0.5, "d.cfg": 0.4}
    paths = [saved(tmp_path / name, constant(depth=depth)) for name, depth in depths.items()]
    other = ("VA", "VB", "VC", "I1", "I2", "I3")
    stranger = saved(tmp_path / "e.cfg", constant(), names=other)
    made = tractexp.look([*paths, stranger])
    command = made.commands[-1]
    said = f"to fit 3 dips together, as of one load, d.cfg#1.1 held out: {command}"
    assert str(made).splitlines()[1] == said
    assert "fit 3 dips together" in made.report().html
    settings = ["optimizer=random_search", "budget=50", "tracking.enabled=false"]
    done = run_command(
        *shlex.split(command)[1:],
        *(QUICK_RACE, *settings, "hydra.run.dir=run"),
        cwd=tmp_path.parent,
    )
    assert done.returncode == 0, done.stderr
    events = json.loads((tmp_path.parent / "run" / "result.json").read_text())["events"]
    roles = [("a.cfg#1.1", "train"), ("b c.cfg#1.1", "train"), ("d.cfg#1.1", "validate")]
    assert [(event["name"], event["role"]) for event in events] == roles


def test_loads_of_one_file_each_and_files_of_several_folders_have_no_common_command(tmp_path):
    first = saved(tmp_path / "a.cfg")
    elsewhere = saved(tmp_path / "more" / "b.cfg")
    other = saved(tmp_path / "c.cfg", names=("VA", "VB", "VC", "I1", "I2", "I3"))
    for given in ([first], [first, elsewhere], [first, other]):
        assert "joint" not in tractexp.look(given).content
    settings = {"voltages": [0, 1, 2], "currents": [3, 4, 5]}
    assert "joint" not in tractexp.look([first, saved(tmp_path / "d.cfg")], **settings).content


def test_dips_are_numbered_as_the_reader_numbers_them(tmp_path):
    t = np.arange(round(2.5 * RATE)) / RATE
    U = np.ones_like(t)
    # a dip, a swell, a dip
    for start, end, size in ((0.5, 0.6, 0.7), (1.0, 1.15, 1.2), (1.6, 1.8, 0.6)):
        U[(t >= start) & (t < end)] = size
    path = saved(tmp_path / "three.cfg", waves(t, U, 0.8 * U**2, 0.3 * U**2))
    made = tractexp.look(path)
    assert [(e["kind"], e["dip"]) for e in made.events] == [("dip", 1), ("swell", None), ("dip", 2)]
    assert [e["worth"] for e in made.events] == [True, False, True]
    assert "fitted to dips" in made.events.rows[1]["why"]
    assert "'data.train=[1]' 'data.validate=[2]'" in made.commands[0]
    starts = [e.t_start for e in tractexp.read(path)]
    np.testing.assert_allclose([e["start"] for e in made.events if e["dip"]], starts, atol=0.02)


def test_a_short_dip_is_to_be_fitted_in_waves_and_that_command_runs_too(tmp_path):
    """A dip of three cycles is smeared by phasors; one of ten is not, nor one that begins with the
    record.
    """
    short = saved(tmp_path / "short.cfg", constant(start=0.5, end=0.56))
    (command,) = tractexp.look(short).commands
    assert command.endswith(" model=auto domain=waves")
    done = run_command(
        *shlex.split(command)[1:],
        "model.candidates.waves=[fifth_order_branch]",
        "optimizer=random_search",
        "budget=50",
        "tracking.enabled=false",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "domain=waves" not in tractexp.look(saved(tmp_path / "long.cfg")).commands[0]
    early = saved(tmp_path / "early.cfg", constant(start=0.05, end=0.11))
    assert not any("domain=waves" in c for c in tractexp.look(early).commands)


def test_a_file_without_events_or_loads_is_told_and_is_no_error(tmp_path):
    quiet = tractexp.look(saved(tmp_path / "quiet.cfg", constant(depth=0.0)))
    assert (len(quiet.feeders), len(quiet.events), quiet.commands) == (1, 0, [])
    volts = recording(constant()[:3], names=("UA", "UB", "UC"))
    write(volts, tmp_path / "volts.cfg", "BINARY", 1999)
    alone = tractexp.look(tmp_path / "volts.cfg")
    assert (len(alone.channels), len(alone.feeders)) == (3, 1)  # the bus, of which the dip is told
    assert str(alone).startswith("nothing is worth fitting; dip at ")
    assert "no current is recorded" in str(alone).splitlines()[0]
    assert alone.commands == []
    assert str(quiet).startswith("nothing is worth fitting: nothing happened")
    for made in (quiet, alone):
        assert [p.name for p in made.write(tmp_path / "page")] == ["look.json", "look.html"]


def test_a_table_of_powers_is_looked_at_and_its_command_fits_it(resistive_dips, tmp_path):
    made = tractexp.look(resistive_dips[0])
    (event,) = made.events
    assert (event["kind"], event["worth"]) == ("dip", True)
    assert event["depth"] == pytest.approx(0.3, abs=0.01)
    assert made.commands == [
        f"tractexp data=csv data.path={resistive_dips[0]} 'data.train=[1]' 'data.validate=[]'"
    ]
    assert list(made.phasors().columns)[:4] == ["t", "U", "P", "Q"]
    with pytest.raises(UserError, match="without waveforms"):
        made.waveforms()


def test_a_long_table_is_one_load_whose_dips_are_numbered(resistive_dips, tmp_path):
    """Three dips one after the other, and one more that the end of the table cuts short."""
    parts = [pandas.read_csv(path) for path in resistive_dips]
    tail = parts[0][parts[0]["t"] < parts[0]["t"].iloc[0] + 0.45]
    frame = pandas.concat([*parts, tail], ignore_index=True)
    frame["t"] = np.arange(len(frame)) / 200
    frame.to_csv(tmp_path / "long.csv", index=False)
    made = tractexp.look(tmp_path / "long.csv")
    assert len(made.feeders) == 1
    assert [e["dip"] for e in made.events if e["worth"]] == [1, 2, 3]
    np.testing.assert_allclose(
        [e["depth"] for e in made.events if e["worth"]], [0.3, 0.5, 0.4], atol=0.01
    )
    words = shlex.split(made.commands[0])
    assert words[-2:] == ["data.train=[1]", "data.validate=[2,3]"]
    done = run_command(
        *words[1:],
        "optimizer=random_search",
        "budget=50",
        "tracking.enabled=false",
        "hydra.run.dir=run",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    roles = [
        e["role"] for e in json.loads((tmp_path / "run" / "result.json").read_text())["events"]
    ]
    assert roles == ["train", "validate", "validate"]


def test_a_shipped_record_is_looked_at_by_its_name():
    made = tractexp.look("tibet_50pct")
    assert [e["kind"] for e in made.events if e["worth"]] == ["dip"]
    assert "pkg://tractexp.data/tibet_50pct" in made.commands[0]


def test_what_was_read_can_be_looked_at(station, resistive_dips):
    dips = tractexp.read(station, voltages=[0, 1, 2], currents=[3, 4, 5])
    assert len(dips.look().channels) == 9  # the file, not the record that was made of it
    record = dips[0].record
    alone = tractexp.look({"t": record.t, "U": record.U, "P": record.P, "Q": record.Q})
    assert [e["kind"] for e in alone.events] == ["dip"]
    assert alone.commands == []  # a frame has no command line


def test_a_saved_look_shows_the_same_and_gives_its_arrays_again(looked, tmp_path):
    again = tractexp.load(looked.save(tmp_path / "look.json"))
    assert again.content == looked.content
    np.testing.assert_array_equal(again.phasors(1)["P"], looked.phasors(1)["P"])
    assert list(again.waveforms())[:2] == ["t", "UA"]
    with pytest.raises(UserError, match="there is no load 2; there are 2"):
        again.phasors(2)


def test_the_page_holds_every_sample_and_marks_the_events(looked, tmp_path):
    page = looked.write(tmp_path)[-1].read_text(encoding="utf-8")
    whole = charts(page)[0]
    u = next(trace for trace in whole["data"] if trace.get("samples"))
    held = np.frombuffer(__import__("base64").b64decode(u["samples"]["bdata"]), "<i2")
    values = u["samples"]["offset"] + u["samples"]["scale"] * held
    np.testing.assert_allclose(values, looked.waveforms()["UA"], atol=1e-4 * np.abs(values).max())
    (shade,) = [shape for shape in whole["layout"]["shapes"] if shape["type"] == "rect"]
    assert shade["x0"] == looked.events.rows[0]["start"]
    assert {"u [kV]", "i [kA]", "P, Q [MW]", "f [Hz]"} <= {
        axis["title"]["text"] for key, axis in whole["layout"].items() if key.startswith("yaxis")
    }
    for command in looked.commands:
        assert shlex.split(command)[2] in page


def test_the_page_marks_the_trigger_and_draws_the_status_channels_that_change(tmp_path):
    values = constant()
    trip = (np.arange(values.shape[1]) >= 0.55 * RATE).astype(np.uint8)
    status = [StatusChannel("Q1 <trip>", trip), StatusChannel("idle", 0 * trip)]
    page = (
        tractexp.look(saved(tmp_path / "trip.cfg", values, trigger=0.49, status=status))
        .report()
        .html
    )
    whole = charts(page)[0]
    (mark,) = [shape for shape in whole["layout"]["shapes"] if shape["type"] == "line"]
    assert mark["x0"] == pytest.approx(0.49, abs=1e-6)
    assert "trigger" in [note["text"] for note in whole["layout"]["annotations"]]
    (course,) = [trace["course"] for trace in whole["data"] if "course" in trace]
    assert course["at"] == pytest.approx([0, 0.55, 1], abs=1e-3)
    assert course["states"] == [0, 1, 1]
    assert "idle" not in json.dumps(whole["data"])
    waves = [
        trace
        for trace in whole["data"]
        if trace.get("samples") and trace["panel"] in ("u [kV]", "i [kA]")
    ]
    assert [trace["name"] for trace in whole["data"] if trace.get("phasor")] == [*"abcabc"]
    assert [trace["line"]["color"] for trace in waves] == [*style.PHASES, *style.PHASES]
    assert [trace["label"] for trace in waves][::3] == ["a (UA)", "a (IA)"]
    assert 0.49 < whole["cursor"] < 0.6
    assert "Status channels that change are below." in page


def test_channels_of_no_load_have_a_chart_of_their_own(tmp_path):
    values = np.concatenate([constant(), 0.01 * constant()[:1], 0.02 * constant()[3:4]])
    names = ("UA", "UB", "UC", "IA", "IB", "IC", "3U0", "3I0")
    page = tractexp.look(saved(tmp_path / "rest.cfg", values, names=names)).report().html
    last = charts(page)[-1]
    assert "The 2 channels of no load" in page
    assert [(trace["label"], trace["panel"]) for trace in last["data"]] == [
        ("3U0", "u [kV]"),
        ("3I0", "i [kA]"),
    ]


def test_a_page_without_status_channels_or_trigger_says_nothing_of_them(looked):
    page = looked.report().html
    whole = charts(page)[0]
    assert "status" not in {
        axis["title"]["text"] for key, axis in whole["layout"].items() if key.startswith("yaxis")
    }
    assert "Status channels" not in page


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_nothing_of_the_page_is_cut_off_on_a_screen_of_1280_pixels(tmp_path):
    """Channels and status channels with names of one long word."""
    first = constant()
    trip = (np.arange(first.shape[1]) >= 0.55 * RATE).astype(np.uint8)
    names = [
        f"{quantity}{phase}_110kV_bus_section_2_bay_62"
        for quantity in ("U", "I")
        for phase in "ABC"
    ]
    status = [StatusChannel("protection_2_bay_62_single_pole_trip_phase_A", trip)]
    page = tractexp.look(saved(tmp_path / "long.cfg", first, names=names, status=status)).report()
    script = """setTimeout(() => {
      const cut = [...document.querySelectorAll("body, div, figure, table, td, pre")].filter(part =>
        part.clientWidth && part.scrollWidth > part.clientWidth + 1).map(part => part.className);
      charts.forEach(chart => {
        const box = chart.getBoundingClientRect();
        chart.querySelectorAll("text").forEach(text => {
          const {left, right, width} = text.getBoundingClientRect();
          if (width && (left < box.left - 1 || right > box.right + 1)) cut.push(text.textContent);
        });
      });
      document.getElementById("told").textContent = JSON.stringify(cut);
    }, 1000);"""
    dom, complaints = drawn(
        Worked(page, script), tmp_path, "--window-size=1280,900", "--virtual-time-budget=4000"
    )
    assert complaints == []
    assert json.loads(re.findall(r"<p id=.told.>(.*?)</p>", dom)[0]) == []


def test_a_page_of_ten_seconds_of_twenty_channels_is_small(tmp_path):
    length, rate = 10, 4000.0
    t = np.arange(length * 4000) / rate
    U = np.where((t > 4) & (t < 4.2), 0.6, 1.0)
    first = waves(t, U, 0.8 * U**2, 0.3 * U**2)
    values = np.concatenate([first, *(first[3:] * k for k in (0.9, 0.8, 0.7)), first[:5] * 0.01])
    names = [
        "UA",
        "UB",
        "UC",
        *(f"Q{k} I{p}" for k in range(4) for p in "ABC"),
        *(f"X{k}" for k in range(5)),
    ]
    made = tractexp.look(saved(tmp_path / "long.cfg", values, names=names, rate=rate))
    assert len(made.feeders) == 4
    assert made.write(tmp_path / "page")[-1].stat().st_size < 7e6


def test_the_command_line_prints_all_of_it_and_says_where(station, tmp_path):
    done = run_command("look", str(station), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for part in (
        "North",
        "3200 Hz",
        "UA",
        "Q2",
        "dip",
        "fit it?",
        "yes: ",
        "to fit it:",
        "data=comtrade",
        "look.html",
    ):
        assert part in done.stdout, part
    every = run_command("look", str(station), "--all", "--folder", "all", cwd=tmp_path).stdout
    for part in (
        "primary RMS",
        "fit for what",
        "Q1 IA",
        "their names differ in the phase alone",
        "jump [°]",
    ):
        assert (part in every, part in done.stdout) == (True, False), part
    (page,) = (tmp_path / "outputs" / "looks").rglob("look.html")
    assert str(page.relative_to(tmp_path)) in done.stdout
    named = run_command(
        "look",
        str(station),
        "voltages=[0,1,2]",
        "data.currents=[3,4,5]",
        "--folder",
        "x",
        cwd=tmp_path,
    )
    assert named.stdout.count("to fit it:") == 1
    refused = run_command("look", "absent.cfg", cwd=tmp_path)
    assert refused.returncode == 2
    assert "Traceback" not in refused.stderr
    assert "absent.cfg" in refused.stderr


def test_stages_are_told_to_who_listens_and_to_a_log_after_two_seconds(
    station, capsys, monkeypatch
):
    told = []
    tractexp.look(station, progress=told.append)
    assert told == [f"reading {station}", "measuring the quality of the channels"]
    tractexp.look(station)
    assert capsys.readouterr().out == ""
    monkeypatch.setattr(tractexp.text.progress, "FIRST_LINE", 0.0)
    tractexp.look(station)
    printed = capsys.readouterr()
    assert "measuring the quality" in printed.err
    assert printed.out == ""  # whose first line is the answer


@pytest.mark.parametrize(
    "name", ["a b.csv", "站.csv", "x,y.csv", "it's.csv", "[1].csv", "5", "1e5", "d/e4_60.cfg#1.1"]
)
def test_a_name_in_a_command_is_read_back(name):
    from hydra.core.override_parser.overrides_parser import OverridesParser

    told = quote_override(format_assignment("data.train", [name, "other.csv"]))
    assert OverridesParser.create().parse_override(told).value() == [name, "other.csv"]


def test_the_rms_of_half_cycles_is_that_of_the_standard():
    """IEC 61000-4-30: over one cycle, anew each half cycle; exact for a whole cycle of any phase
    and rate.
    """
    t = np.arange(1000) / 1600
    wave = np.sqrt(2) * np.cos(2 * np.pi * 50 * t + 0.3)[None]
    times, rms = compute_half_cycle_rms(wave, 1600, 50)
    np.testing.assert_allclose(rms, 1, atol=1e-12)
    np.testing.assert_allclose(np.diff(times), 0.01)
    assert times[0] == pytest.approx(0.01 - 0.5 / 1600)


def test_a_spectrum_is_right_at_a_harmonic():
    t = np.arange(800) / 4000
    f, rms = compute_spectrum(
        np.sqrt(2) * (10 * np.cos(2 * np.pi * 50 * t) + 0.3 * np.sin(2 * np.pi * 250 * t)) + 5, 4000
    )
    assert rms[f == 50] == pytest.approx(10, rel=1e-6)
    assert rms[f == 250] == pytest.approx(0.3, rel=1e-6)


def test_an_envelope_keeps_every_spike_in_its_place():
    wave = np.zeros(1003)
    wave[[500, 1002]] = 7, -3
    made = compute_envelope(wave, 5)
    assert len(made) == 202
    assert made.max() == 7
    assert made.min() == -3
    assert abs(int(np.argmax(made)) * 5 - 500) <= 10
