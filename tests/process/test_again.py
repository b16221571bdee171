"""`tractexp again RUN_FOLDER ...`: an earlier run's configuration with other settings on top."""

import json
import shutil
from pathlib import Path

import pytest
import yaml
from command_line import run_command

import tractexp.data
from tractexp.cli.again import merge_settings

TOLD = [
    "data=comtrade",
    "data.path=x.cfg",
    "data.train=[1]",
    "model=static_zip",
    "++model.bounds.a_Z=[0,1]",
    "seed=3",
    "optimizer=pso",
    "optimizer.population=9",
    "domain=waves",
]
RECORDS = TOLD[:3]


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ([], TOLD),
        (["seed=4"], [*TOLD[:5], *TOLD[6:], "seed=4"]),
        (["data.train=[2]"], [*TOLD[:2], *TOLD[3:], "data.train=[2]"]),
        (["data=tibet"], [*TOLD[3:], "data=tibet"]),
        (["model=static_exponential"], [*RECORDS, *TOLD[5:], "model=static_exponential"]),
        (["optimizer=ssa"], [*TOLD[:6], "domain=waves", "optimizer=ssa"]),
        # which searches nothing
        (["task=discrepancy"], [*TOLD[:6], "domain=waves", "task=discrepancy"]),
        (
            ["task=export", "task.format=andes"],
            ["seed=3", "task=export", "task.format=andes", "task.parameters={result}"],
        ),
        (
            ["task=export", "task.parameters=r.json"],
            ["seed=3", "task=export", "task.parameters=r.json"],
        ),
    ],
)
def test_settings_stay_but_for_what_is_chosen_anew_or_not_read(settings, expected, tmp_path):
    result = [text.format(result=tmp_path / "result.json") for text in expected]
    assert merge_settings(TOLD, settings, tmp_path) == result


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where a run of a record named from there has its folder."""
    place = tmp_path_factory.mktemp("again")
    shutil.copy(Path(tractexp.data.__file__).with_name("tibet_30pct.csv"), place / "my dip.csv")
    done = run_command(
        "data=csv",
        "data.train=[my dip.csv]",
        "optimizer=multistart_least_squares",
        "optimizer.starts=2",
        "tracking.enabled=false",
        "hydra.run.dir=first",
        cwd=place,
    )
    assert done.returncode == 0, done.stderr
    return place


def test_a_run_is_done_again_with_another_setting_from_anywhere(folder, tmp_path):
    done = run_command(
        "again", f"{folder}/first", "model.fixed.C=0.8", "hydra.run.dir=second", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert f"in {folder}, where that run was" in done.stdout
    first, second = (
        json.loads((folder / name / "result.json").read_text()) for name in ("first", "second")
    )
    assert second["parameters"]["C"] == 0.8
    assert second["records"] == first["records"]
    told = yaml.safe_load((folder / "second" / ".hydra" / "overrides.yaml").read_text())
    assert set(yaml.safe_load((folder / "first" / ".hydra" / "overrides.yaml").read_text())) < set(
        told
    )
    assert not (tmp_path / "second").exists()


def test_its_result_is_exported_without_naming_it(folder):
    done = run_command(
        "again", "first", "task=export", "task.format=psse_dyr", "hydra.run.dir=export", cwd=folder
    )
    assert done.returncode == 0, done.stderr
    assert (folder / "export" / "load.dyr").is_file()


def test_a_result_may_be_named_by_the_folder_of_its_run(folder):
    for parameters in ("first", "first/result.json"):
        arguments = [
            "task=export",
            "task.format=psse_dyr",
            f"task.parameters={parameters}",
            "hydra.run.dir=by_folder",
        ]
        done = run_command(*arguments, cwd=folder)
        assert done.returncode == 0, done.stderr
        assert (folder / "by_folder" / "load.dyr").is_file()
    (folder / "empty").mkdir()
    done = run_command("task=export", "task.format=psse_dyr", "task.parameters=empty", cwd=folder)
    assert (done.returncode, "there is no result file empty/result.json" in done.stderr) == (
        2,
        True,
    )


def test_a_folder_alone_is_a_survey_or_tells_the_page_of_its_run(tmp_path):
    (tmp_path / "records").mkdir()
    for name in ("tibet_30pct", "tibet_50pct"):
        shutil.copy(Path(tractexp.data.__file__).with_name(f"{name}.csv"), tmp_path / "records")
    done = run_command("records", "tracking.enabled=false", "hydra.run.dir=table", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("that is: tractexp task=survey data.path=records")
    assert len((tmp_path / "table" / "survey.csv").read_text(encoding="utf-8").splitlines()) == 3
    done = run_command("table", cwd=tmp_path)
    assert done.stdout == f"page: {tmp_path / 'table' / 'survey.html'}\n"
    (tmp_path / "0" / ".hydra").mkdir(parents=True)
    (tmp_path / "0" / "result.json").write_text("{}")
    done = run_command("0", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        "tractexp: 0 holds a run that drew no page, as the jobs of a sweep do; tractexp again 0"
        " repeats it and draws one\n"
    )
    (tmp_path / "empty").mkdir()
    done = run_command("empty", cwd=tmp_path)
    assert (done.returncode, "holds no file that can be read" in done.stderr) == (2, True)


@pytest.mark.parametrize(
    ("word", "end"),
    [
        ("identify", ", but there is task=identify; tractexp --help shows what there is"),
        ("pso", ", but there is optimizer=pso; tractexp --help shows what there is"),
        ("nonsense", "that is there; tractexp --help shows what there is"),
    ],
)
def test_a_word_that_is_nothing_is_told_what_it_looked_like(word, end, tmp_path):
    done = run_command(word, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(
        f"tractexp: {word} is no setting (KEY=VALUE), no command, and no file or folder"
    )
    assert done.stderr.strip().endswith(end)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ["nowhere"],
            "nowhere holds no run (.hydra is missing or damaged); give the folder of one",
        ),
        (
            ["first", "discrepancy"],
            "discrepancy is no setting; give KEY=VALUE, as task=discrepancy",
        ),
        (["first", "task=identfy"], "there is no task 'identfy'; did you mean 'identify'?"),
    ],
)
def test_what_cannot_be_done_again_is_refused_in_a_sentence(folder, arguments, sentence):
    done = run_command("again", *arguments, cwd=folder)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
