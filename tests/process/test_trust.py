"""What somebody else gave is data: none of it runs, sends, overwrites, or stands in for what is
ours.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from command_line import run_command
from traps import lay_traps

import tractexp.data
from tractexp.cli.again import build_repeat_command
from tractexp.errors import UserError
from tractexp.tracking import TrackedRun
from tractexp.tracking.runfile import FILE, save
from tractexp.tracking.store import open_store
from tractexp.tracking.sync import BROUGHT, sync

DATA = Path(tractexp.data.__file__).parent
QUICK = ("optimizer=random_search", "budget=10", "hydra.run.dir=run")


# Modules beside the records


@pytest.fixture
def trapped(tmp_path) -> Path:
    """A folder of records, beside which modules lie that say when they are imported."""
    lay_traps(tmp_path)
    shutil.copy(DATA / "tibet_30pct.csv", tmp_path / "dip.csv")
    return tmp_path


COMMAND, MODULE = (
    (str(Path(sys.executable).with_name("tractexp")),),
    (sys.executable, "-m", "tractexp"),
)


@pytest.mark.parametrize(
    ("start", "arguments"),
    [
        (COMMAND, ("data=csv", "data.train=[dip.csv]", *QUICK)),
        (MODULE, ("data=csv", "data.train=[dip.csv]", *QUICK, "tracking.enabled=false")),
        (COMMAND, ("task=survey", "data.path=.", "tracking.enabled=false")),
    ],
    ids=["a run that is logged", "the same by python -m", "workers of a survey"],
)
def test_no_module_beside_the_records_is_imported(start, arguments, trapped):
    done = subprocess.run([*start, *arguments], cwd=trapped, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not (trapped / "trapped").exists()


# A run's folder that is done again


def given(folder: Path, *settings: str, cwd: str = ".", searched: str = "") -> Path:
    """The folder of a run that somebody else wrote."""
    (folder / ".hydra").mkdir(parents=True)
    sources = [{"provider": "main", "path": "pkg://x"}]
    sources += [{"provider": "command-line", "path": searched}] if searched else []
    runtime = {"hydra": {"runtime": {"cwd": cwd, "config_sources": sources}}}
    (folder / ".hydra" / "hydra.yaml").write_text(yaml.safe_dump(runtime))
    (folder / ".hydra" / "overrides.yaml").write_text(yaml.safe_dump(list(settings)))
    return folder


@pytest.mark.parametrize(
    "setting",
    [
        "+hydra.callbacks.x._target_=numpy.testing.measure",
        "hydra.run.dir=mine",
        "hydra.sweep.dir=mine",
        "hydra/launcher=basic",
        "hydra.launcher.address=tcp://1.2.3.4:5",
        "hydra.job.env_set={A: b}",
        "hydra.searchpath=[file:///tmp]",
        "tracking.uri=http://1.2.3.4",
        "tracking.experiment=theirs",
        "++tracking.uri=x",
        "~tracking",
        "optimizer@hydra.callbacks=pso",
        "optimizer=../../evil",
        "data=/tmp/evil",
        "seed=${oc.env:HOME}",
        "data.path=${oc.env:HOME}",
        "task.docs=/home",
        "task.sweep=../mine",
        "hydra=x",
        "=5",
        "experiment=../evil",
        "--config-dir=x",
        "unknown=1",
        "model=../evil",
        "model/motor=[../a]",
        "-m",
    ],
)
def test_what_the_folder_of_a_run_may_not_say_is_refused_by_its_name(setting, tmp_path):
    folder = given(tmp_path / "given", "optimizer=pso", setting)
    done = run_command("again", str(folder), cwd=tmp_path)
    assert done.returncode == 2
    name = setting.partition("=")[0]
    assert f"{name[:80]} is not taken over from the folder of a run" in done.stderr
    assert done.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["given"]


def test_what_is_refused_may_be_said_by_the_user(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = given(tmp_path / "given", "optimizer=pso", "tracking.uri=http://1.2.3.4")
    assert build_repeat_command([str(folder), "tracking.uri=null"]) == [
        "optimizer=pso",
        "tracking.uri=null",
    ]


def test_configurations_of_others_are_looked_for_where_the_user_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = given(tmp_path / "given", "optimizer=pso", searched="/theirs")
    with pytest.raises(UserError, match="used configurations in /theirs, which only you can name"):
        build_repeat_command([str(folder)])
    assert build_repeat_command([str(folder), "--config-dir", "mine"]) == [
        "--config-dir",
        str(tmp_path / "mine"),
        "optimizer=pso",
    ]


def test_a_run_is_repeated_above_its_folder_or_here_and_nowhere_else(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    build_repeat_command(
        [str(given(tmp_path / "given", "seed=1", cwd=str(tmp_path / "elsewhere")))]
    )
    assert Path.cwd() == tmp_path
    (tmp_path / "place").mkdir()
    build_repeat_command(
        [str(given(tmp_path / "place" / "runs" / "own", "seed=1", cwd=str(tmp_path / "place")))]
    )
    assert Path.cwd() == tmp_path / "place"


def test_a_job_of_a_sweep_is_repeated_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = given(tmp_path / "sweep" / "0", "seed=2", cwd=str(tmp_path))
    (folder / ".hydra" / "hydra.yaml").write_text(
        yaml.safe_dump({"hydra": {"runtime": {"cwd": str(tmp_path)}}})
    )
    assert build_repeat_command([str(folder)]) == ["seed=2"]


def test_a_second_sweep_in_a_folder_says_who_holds_it(tmp_path):
    from tractexp.storage.run_folder import hold

    sweep = ("-m", "seed=1,2", *QUICK[:2], "tracking.enabled=false", "hydra.sweep.dir=sweep")
    with hold(tmp_path / "sweep"):
        done = run_command(*sweep, cwd=tmp_path)
        assert done.returncode == 2
        assert f"sweep is in use by process {os.getpid()} on " in done.stderr
    assert not (tmp_path / "sweep").exists()


LAUGHS = "- &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"- &a{k + 1} [{', '.join(10 * [f'*a{k}'])}]\n" for k in range(9)
)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (LAUGHS, "holds more than 100000 values, aliases written out"),
        ("- &a [*a]\n", "holds more than 100000 values"),
        ("[" * 5000, "nests them more than 50 deep"),
        ("- !!python/object/apply:os.mkdir [x]\n", "not valid YAML"),
        ("- 2001-99-99\n", "not valid YAML"),
        ("- a: [", "line 2: not valid YAML"),
        ("- \0\n", "not valid YAML"),
        (b"- \xff\n", "is not UTF-8"),
        ("5", "holds no run"),
        ("", "holds no run"),
        (b" " * (4 << 20) + b"x", "a file of its kind at most"),
        (None, "is a named pipe"),
    ],
    ids=[
        "laughs",
        "cycle",
        "deep",
        "object",
        "date",
        "cut",
        "zero",
        "bytes",
        "number",
        "empty",
        "giant",
        "pipe",
    ],
)
def test_a_damaged_configuration_is_a_sentence_and_takes_no_time(content, sentence, tmp_path):
    folder = given(tmp_path / "given", "optimizer=pso")
    path = folder / ".hydra" / "overrides.yaml"
    path.unlink()
    if content is None:
        os.mkfifo(path)
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(UserError, match=sentence):
        build_repeat_command([str(folder)])


# Runs that are brought into a store

PICKLE = {
    "flavors": {
        "python_function": {"loader_module": "mlflow.pyfunc.model", "python_model": "p.pkl"}
    }
}


def brought(folder: Path, uri: str, **content) -> tuple[dict, list[str]]:
    """What the store has of a run whose file somebody else wrote, and what was said."""
    save(folder, TrackedRun("e", "one"), uri)
    whole = json.loads((folder / FILE).read_text())
    (folder / FILE).write_text(json.dumps(whole | {"run": whole["run"] | content}))
    said: list[str] = []
    assert sync(folder, uri, tell=said.append)[BROUGHT] == 1
    client = open_store(uri)
    run = client.get_run(json.loads((folder / FILE).read_text())["run_id"])
    artifacts = [one.path for one in client.list_artifacts(run.info.run_id)]
    return {"tags": run.data.tags, "artifacts": artifacts, "run": run}, said


def test_no_model_of_others_comes_into_the_store_but_as_a_result_that_is_read(tmp_path, uri):
    """MLflow loads a folder by its file `MLmodel`, and what that names: a pickle of its maker's."""
    folder = tmp_path / "given"
    for place in (folder / "model", folder / "figures" / "deep", folder):
        place.mkdir(parents=True, exist_ok=True)
        (place / "MLmodel").write_text(yaml.safe_dump(PICKLE))
        (place / "p.pkl").write_bytes(b"x")
    (folder / "small").mkdir()
    (folder / "small" / "mlmodel").write_text(yaml.safe_dump(PICKLE))
    (folder / "result.json").write_text('{"parameters": {}}')
    ways = ["model", "figures", "MLmodel", "small", "p.pkl"]
    found, said = brought(folder, uri, artifacts=ways, model="result.json")
    assert found["artifacts"] == ["p.pkl"]  # which nothing loads by itself
    assert not found["run"].outputs or not found["run"].outputs.model_outputs
    assert sum("MLflow would load it as a model" in line for line in said) == 4
    assert any("no model is made of" in line for line in said)


def test_a_run_of_others_sets_no_tag_of_mlflow_and_shows_no_link(tmp_path, uri):
    tags = {
        "mlflow.parentRunId": "x",
        "mlflow.source.name": "theirs",
        "tractexp.key": "y",
        "load": "7",
    }
    picture = "A ![x](http://127.0.0.1:9/x) <img src=x> that is \\<own\\>"
    found, _ = brought(tmp_path / "given", uri, tags=tags, description=picture)
    assert found["tags"]["mlflow.source.name"] == "tractexp"
    assert "mlflow.parentRunId" not in found["tags"]
    assert found["tags"]["load"] == "7"
    note = found["tags"]["mlflow.note.content"]
    assert note == "A !\\[x\\](http://127.0.0.1:9/x) \\<img src=x\\> that is \\<own\\>"


# Lines that are printed


FORGED = "a\nnext: tractexp evil\nb"


def test_a_name_prints_no_line_of_its_own(tmp_path):
    """Of a file, which is refused, and in a record, where it is a word."""
    for suffix in (".cfg", ".dat"):
        shutil.copy(DATA / f"tibet_50pct{suffix}", tmp_path / f"{FORGED}{suffix}")
    done = run_command("look", f"{FORGED}.cfg", cwd=tmp_path)
    assert done.returncode == 2
    assert "this name has a line break; rename the file" in done.stderr
    said = done.stdout + done.stderr
    header, body = (DATA / "tibet_30pct.csv").read_text().split("\n", 1)
    (tmp_path / "dip.csv").write_text(header + "\n" + body)
    (tmp_path / "dip.json").write_text(
        json.dumps({"name": FORGED, "station": FORGED, "source": FORGED})
    )
    said += (done := run_command("look", "dip.csv", cwd=tmp_path)).stdout + done.stderr
    assert not [line for line in said.splitlines() if line.startswith("next:")]


@pytest.mark.parametrize("kind", ["a title", "a text", "an item", "a heading", "a cell"])
def test_a_report_prints_a_name_in_its_line(kind):
    from tractexp.blocks import Report, Table
    from tractexp.blocks.terminal import render_plain

    report = Report(FORGED if kind == "a title" else "Report")
    made = {
        "a text": lambda: report.text(FORGED),
        "an item": lambda: report.items([FORGED]),
        "a heading": lambda: report.heading(FORGED),
        "a cell": lambda: report.add(Table(["name"], [[FORGED]])),
    }
    made.get(kind, lambda: None)()
    assert "next:" in render_plain(report)
    assert not [
        line for line in render_plain(report).splitlines() if line.strip().startswith("next:")
    ]
