"""All loads of a recorder by all dips of its years: constants that all dips share (`fit_dips`), the
share of the motors in each, and each dip predicted by those before it (`predict_in_turn`).
"""

import copy
import importlib.util
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from command_line import run_command
from made_station import MACHINES, SCATTER, make_station

import tractexp
from tractexp.api import station as station_call
from tractexp.api import station_load
from tractexp.errors import UserError
from tractexp.identification.station import LoadSpec, StationDip, fit_dips, predict_in_turn
from tractexp.inference.sized_problem import SizedProblem
from tractexp.record import OwnBase
from tractexp.report import station
from tractexp.text import progress

DIPS, FAULTY = 12, 5


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two loads, twelve dips in five years, the sixth with currents that the recorder clips."""
    folder = tmp_path_factory.mktemp("station")
    shares, moments = make_station(folder / "records", 2, DIPS, faulty=(FAULTY,))
    return folder, shares, moments


@pytest.fixture(scope="module")
def fitted(made):
    folder, *_ = made
    return tractexp.fit_station(folder / "records", cores=1, keep=folder / "kept", progress=False)


def test_the_constants_of_each_load_are_found_within_three_percent(fitted):
    assert [load["dips"] for load in fitted.loads] == [DIPS, DIPS]
    for load, machine in zip(fitted.loads, MACHINES, strict=False):
        found = {row["name"]: row for row in fitted.constants(load["load"])}
        for name, truth in machine.items():
            assert found[name]["value"] == pytest.approx(truth, rel=0.03), name
        assert found["H"]["value"] == pytest.approx(machine["M"] * 50 * np.pi, rel=0.03)
        assert not any(row["spread"] for row in found.values())


def test_through_the_recorders_window_constants_are_found_within_half_a_percent(fitted):
    for load, machine in zip(fitted.content["loads"], MACHINES, strict=False):
        assert load["model"]["window"] == "recorded"
        found = {row["name"]: row for row in load["constants"]}
        for name, truth in machine.items():
            assert found[name]["value"] == pytest.approx(truth, rel=0.005), name


def test_the_share_of_each_dip_is_found(fitted, made):
    _, shares, moments = made
    for k, load in enumerate(fitted.loads):
        events = list(fitted.events(load["load"]))
        assert [e["when"][:10] for e in events] == [f"{m:%Y-%m-%d}" for m in moments]
        found = [e["share"] for e in events if not e["odd"]]
        truth = [shares[k, n] for n, e in enumerate(events) if not e["odd"]]
        assert found == pytest.approx(truth, abs=0.01)


def test_a_fault_of_the_recorder_is_left_out_and_told(fitted):
    for load in fitted.content["loads"]:
        (odd,) = load["odd"]
        assert odd["event"] == load["events"][FAULTY]["event"]
        assert "of its response" in odd["why"]
        assert "left out" in str(fitted.summary())


def test_each_dip_is_predicted_by_those_before_it(fitted):
    for load in fitted.content["loads"]:
        events = load["events"]
        assert events[0]["predicted"] is None
        assert all(0 < e["known"] <= k for k, e in enumerate(events) if k and not e["odd"])
        assert load["next_dip"]["events"] >= 4
        assert 0 < load["next_dip"]["P"] < 0.2


def test_no_later_dip_changes_what_was_predicted():
    dips = [draw_dip(k) for k in range(6)]
    spec = LoadSpec("load", tractexp.compose().model, {}, {})
    shown = [(p.position, p.share, p.error) for p in predict_in_turn(spec, dips, {})]
    early = [(p.position, p.share, p.error) for p in predict_in_turn(spec, dips[:4], {})]
    assert early == shown[:3]


def draw_frame(k):
    """A dip of a load whose motors draw from 40 to 60 % of P."""
    torque = 0.4 + 0.04 * k
    values = {"T_prime": 0.12, "C": 0.9, "p_v": 1.4, "q_v": 3.0, "T_m": torque}
    values |= {"X_prime": 0.15 / torque, "M": 0.011 * torque}
    shape = {"depth": 0.2 + 0.06 * k, "duration": 0.15, "length": 1.5, "rate": 200}
    response = tractexp.simulate(tractexp.compose(), values, P0=0.9, Q0=0.35, **shape).responses[0]
    frame = response.to_frame()
    frame[["P", "Q"]] += 1e-3 * np.random.default_rng(k).standard_normal((len(frame), 2))
    return frame


def draw_dip(k):
    (event,) = tractexp.read(draw_frame(k))
    return StationDip(OwnBase.from_event(event).convert_event(event))


def test_a_motor_of_another_size_has_the_same_constants():
    dips = [draw_dip(k) for k in (0, 5)]
    fit = fit_dips(LoadSpec("load", tractexp.compose().model, {}, {}), dips)
    names = [fit.problem.space.names[k] for k in fit.problem.constants]
    found = dict(zip(names, fit.constants * fit.problem.scale_to_own_power, strict=True))
    assert found["X_prime"] == pytest.approx(0.15, rel=0.05)
    assert found["M"] == pytest.approx(0.011, rel=0.05)
    assert fit.torques == pytest.approx([0.4, 0.6], abs=0.01)


def test_a_stator_resistance_goes_with_the_size_of_the_motors_and_a_capacitor_does_not():
    effects = ["stator_resistance", "shunt_capacitor"]
    model = tractexp.compose(effects=effects).model
    problem = SizedProblem(model, [draw_dip(k).event for k in (0, 5)], {}, {})
    values = (problem.lower + problem.upper) / 2
    values[problem.shares] = 0.25, 0.75
    first, second = (
        dict(zip(model.names, row, strict=True)) for row in problem.by_event(values)[:, 0]
    )
    (capacitor,) = (
        p.name for e in model.effects if e.name == "shunt_capacitor" for p in e.parameters
    )
    assert first["R_s"] == pytest.approx(3 * second["R_s"])
    assert first["X_prime"] == pytest.approx(3 * second["X_prime"])
    assert first[capacitor] == second[capacitor]


def test_tables_of_one_folder_are_of_one_load(tmp_path, monkeypatch):
    for load in ("north", "south"):
        (tmp_path / load).mkdir()
        for k in (0, 5):
            draw_frame(k).to_csv(tmp_path / load / f"dip{k}.csv", index=False)
    found = tractexp.fit_station(tmp_path, cores=1, progress=False)
    names = [f"{tmp_path.name}/{name}" for name in ("north", "south")]
    assert [load["load"] for load in found.loads] == names
    assert [load["dips"] for load in found.loads] == [2, 2]
    for load in found.content["loads"]:
        assert load["composition"]["varies"] == []
        assert [event["when"] for event in load["events"]] == [None, None]
    assert "dip, by its number" in found.report().html
    monkeypatch.setattr(station_call, "find_folder", lambda: None)  # as from Python
    assert found.next_step.startswith(f"find what {names[0]} lacks at its deepest dips: tractexp")


@pytest.mark.long
@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="Dask is not installed: pip install 'tractexp[dask]'",
)
def test_a_cluster_fits_the_same(tmp_path):
    for k in (0, 5):
        draw_frame(k).to_csv(tmp_path / f"dip{k}.csv", index=False)
    of_cluster, own = (
        tractexp.fit_station(tmp_path, cores=1, backend=backend, progress=False)
        for backend in ("dask", "loky")
    )
    assert of_cluster.content == own.content


def test_a_command_counts_files_with_the_time_left_and_not_line_by_line(
    tmp_path, monkeypatch, capsys
):
    """A command's progress is told what begins; of ten thousand files it is told none."""
    monkeypatch.setattr(progress, "FIRST_LINE", 0.0)
    monkeypatch.setattr(progress, "NEXT_LINES", 0.0)
    for k in (0, 5, 7):
        draw_frame(k).to_csv(tmp_path / f"dip{k}.csv", index=False)
    told = []
    tractexp.survey(tmp_path, cores=1, progress=told.append)
    assert not any("of 3 files" in line for line in told)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "  1 of 3 files"
    assert re.fullmatch(r"  2 of 3 files, \S+ a second, about \d+ s left", lines[1])


def test_what_was_read_and_fitted_is_not_done_again(fitted, made, monkeypatch):
    folder, *_ = made

    def refuse(*_):
        raise AssertionError("it was kept")

    monkeypatch.setattr(station_load, "read_dips", refuse)
    monkeypatch.setattr(station_load, "_fit", refuse)
    again = tractexp.fit_station(folder / "records", cores=1, keep=folder / "kept", progress=False)
    assert again.content == fitted.content


def test_a_load_that_is_seen_once_is_told(made, tmp_path):
    folder, *_ = made
    one = sorted((folder / "records").rglob("*.cfg"))[0]
    for ending in (".cfg", ".dat"):
        shutil.copy(one.with_suffix(ending), tmp_path)
    found = tractexp.fit_station(tmp_path, cores=1, progress=False)
    assert [row["why"] for row in found.not_fitted] == ["1 dip, where 2 are needed"] * 2
    assert "1 dip, where 2 are needed" in str(found)


def test_it_is_saved_and_written(fitted, tmp_path):
    assert tractexp.load(fitted.save(tmp_path / "saved.json")).content == fitted.content
    names = [path.name for path in fitted.write(tmp_path)]
    assert names == ["station.json", "station.csv", "load_1.json", "load_2.json", "station.html"]
    page = (tmp_path / "station.html").read_text(encoding="utf-8")
    for load in fitted.loads:
        assert load["load"] in page
    assert len(fitted.to_frame()) == 2 * DIPS
    with pytest.raises(UserError, match="there is no load 'T9'"):
        fitted.load_named("T9")


def test_a_load_is_an_identified_model_that_predicts(fitted, tmp_path):
    paths = fitted.write_results(tmp_path)
    for number, load in enumerate(fitted.content["loads"], 1):
        model = tractexp.load(tmp_path / f"load_{number}.json")
        assert model.result.parameters == load["result"]["parameters"]
        share = model.result.parameters["T_m"] / model.result.before["P0"]
        assert share == pytest.approx(load["share"]["value"], abs=1e-6)
        low, high = model.result.intervals["X_prime"]
        assert low < model.result.parameters["X_prime"] < high
        t = np.arange(400) * 5e-3
        response = model.predict(t=t, U=np.where((t > 0.5) & (t < 0.7), 0.7, 1.0))
        assert response.P[0] == pytest.approx(model.result.before["P0"], rel=1e-6)
        assert response.band[0] > 0
    assert paths[2].name == "load_1.json"


@pytest.mark.usefixtures("fitted")  # which keeps what the run goes on from
def test_the_command_goes_on_where_it_was(made, tmp_path):
    folder, *_ = made
    run = tmp_path / "outputs" / "stations" / "records"
    shutil.copytree(folder / "kept", run)
    done = run_command(
        "task=station", f"data.path={folder / 'records'}", "tracking.enabled=false", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert "24 dips fitted" in done.stdout
    assert "next: export " in done.stdout
    (result,) = (tmp_path / "outputs" / "stations").glob("*/station.json")
    assert len(json.loads(result.read_text())["loads"]) == 2


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "data.path is missing: give the folder"),
        (("data.path=absent",), "data.path=absent is no folder that is there"),
        (("data=csv", "data.train=[a.csv]"), "data=csv is no folder"),
        (("data.path=.", "task.backend=spark"), "task.backend=spark"),
        (("data.path=.",), "data.path=. holds no file that can be read"),
    ],
)
def test_what_cannot_be_fitted_is_refused_in_a_sentence(tmp_path, arguments, sentence):
    done = run_command("task=station", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"model": "static_exponential"}, "has no motor whose share of the load could differ"),
        ({"fixed": {"T_m": 0.5}}, "model.fixed.T_m cannot be held over several dips"),
    ],
)
def test_a_model_that_cannot_be_shared_is_told_of_each_load(made, settings, sentence):
    folder, *_ = made
    found = tractexp.fit_station(
        folder / "records", cores=1, keep=folder / "kept", progress=False, **settings
    )
    assert len(found.not_fitted) == 2
    assert all(sentence in row["why"] for row in found.not_fitted)


def test_the_spread_of_single_dips_is_told(fitted):
    for load in fitted.loads:
        assert load["spread"] < 6 * SCATTER


def test_what_dips_before_stayed_below_is_no_matter_of_odd_or_later_ones():
    errors = [None, 0.02, 9.0, *([0.01] * 30), 0.5]
    odd = np.array([error == 9.0 for error in errors])
    limits = station.find_limits(errors, odd)
    assert np.isnan(limits[:2]).all()
    assert limits[2:].tolist() == [0.02] * 21 + [0.01] * 11


def test_the_answer_is_one_screen(fitted):
    lines = str(fitted.screen()).splitlines()
    assert len(lines) <= 25
    short = [line.replace(fitted.content["folder"], "records") for line in lines]
    assert all(len(line) <= 80 for line in short[:5])
    for load in fitted.loads:
        assert any(line.startswith(f"{load['load']}: doubtful: the model") for line in lines)


def test_a_load_that_no_dip_predicts_is_told(fitted):
    content = copy.deepcopy(dict(fitted.content))
    load = content["loads"][0]
    load |= {"next_dip": {}, "curves": [], "usability": "unusable", "reason": "it stalls"}
    load["predicted"] = {"dips": 0, "first_half": None, "last_half": None}
    load["error"] = {"value": None, "interval": [None, None], "of_S": None, "stalls": ["a dip"]}
    for event in load["events"]:
        event |= {"predicted": None, "expected": None, "error": None}
    row = station.tell_load(load)
    assert (row["share"], row["spread"]) == (None, None)
    for text in (station.report(content).html, str(station.build_screen(content))):
        assert "the motor stalls" in text
        assert "unusable" in text
        assert "not told" in text
        assert "unusable: it stalls; so its dips tell nothing of the motors" in text


def test_a_load_whose_dips_are_missed_is_unusable(tmp_path):
    """Two loads of one name, of quite other machines."""
    for k in (0, 5):
        frame = draw_frame(k)
        frame["Q"] = 0.35 + (-1) ** k * (frame["Q"] - 0.35)
        frame.to_csv(tmp_path / f"dip{k}.csv", index=False)
    (load,) = tractexp.fit_station(tmp_path, cores=1, progress=False).content["loads"]
    assert load["usability"] == "unusable"
    assert "does not describe this load" in load["reason"]


def test_the_page_tells_the_stored_run():
    root = Path(__file__).parents[2]
    rows = json.loads((root / "benchmarks" / "station.json").read_text(encoding="utf-8"))
    (few, row) = sorted((one for one in rows if one["loads"] == 4), key=lambda one: one["dips"])
    page = (root / "docs" / "archives.md").read_text(encoding="utf-8")
    page = " ".join(page.split()).replace(" %", "%")
    spent = f"{row['cpu_seconds']:.0f} s of processor time, 50 dips {few['cpu_seconds']:.0f} s"
    assert f"two cores): {spent}" in page
    assert f"the worst constant {row['constants']:.1%}" in page
    assert f"the share by hour {row['by_hour']:.1%} of P" in page
    assert [few["left_out"], row["left_out"]] == [[2, 2, 2, 2], [2, 2, 2, 1]]
