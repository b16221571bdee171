"""The command line as a person uses it: the main job, its files and its log, and every refusal in
one sentence.
"""

import json
import os
import re
import sqlite3
import subprocess
import sys

import numpy as np
import pytest
from command_line import run_command, start_command

import tractexp

SHIPPED = "pkg://tractexp.data/tibet_50pct.csv"
QUICK = ("optimizer.iterations=8", "optimizer.population=20", "tracking.enabled=false")
EXACT = ("optimizer=multistart_least_squares", "optimizer.starts=2", "tracking.enabled=false")


@pytest.fixture(scope="module")
def main_job(tmp_path_factory):
    """The README's main job in an empty folder, run once, all of it printed."""
    folder = tmp_path_factory.mktemp("main")
    main = ("optimizer=issa", "data=tibet_50pct", "hydra.run.dir=run", "--all")
    done = start_command(*main, cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done


def test_the_main_job_prints_what_it_read_did_and_found(main_job):
    _, done = main_job
    for part in (
        "dip of 50 %",
        "500 Hz",
        "noise",
        "synthetic stand-in for an unpublished record",
        "7 parameters",
        "Runge-Kutta steps",
        "T_prime",
        "pu s²/rad",
        "95 % interval",
        "model error",
        "epsilon_p",
        "objective",
        "simulations in",
        "below 5 %: holds",
        "report.html",
        "result.json",
        "tractexp ui",
        "search ended at",
    ):
        assert part in done.stdout, part
    # a slow machine tells how far it is
    told = done.stderr.splitlines()
    assert all(line.startswith("  ") for line in told), done.stderr


def test_the_first_line_of_the_answer_is_what_it_is_good_for(main_job):
    """The stand-in's stator transients are missing in the model: the size of its error comes first,
    then two tables.
    """
    _, done = main_job
    answer = done.stdout.partition("optimizer: issa, seed 0")[2]
    assert answer.strip().startswith(
        "Doubtful: the model describes this load within 1.8 % of its response (0.47 % of S); an"
    )
    assert answer.count("95 % interval") == 2  # of the parameters and of the model's error
    assert "task=discrepancy" in answer


def test_the_main_job_writes_the_contracted_result(main_job):
    folder, _ = main_job
    result = json.loads((folder / "run" / "result.json").read_text())
    assert list(result["parameters"]) == ["T_prime", "X_prime", "C", "M", "T_m", "p_v", "q_v"]
    for name, value in result["parameters"].items():
        low, high = result["bounds"][name]
        assert low <= value <= high
    assert result["seed"] == 0
    assert result["iterations"] == 300
    assert result["simulations"] > 15000
    assert result["status"] == "finished its 300 iterations"
    (event,) = result["events"]
    assert event["role"] == "train"
    assert event["epsilon_p"] == result["epsilon_p"] < 0.05
    assert event["epsilon_q"] == result["epsilon_q"] < 0.05
    assert {p.name for p in (folder / "run").iterdir()} == {
        ".hydra",
        "history.csv",
        "mlflow.json",
        "result.json",
        "report.html",
        "sheet.html",
    }
    assert (folder / "run" / "report.html").stat().st_size < 1e6
    rows = np.genfromtxt(folder / "run" / "history.csv", delimiter=",", names=True)
    assert rows["objective"][-1] == result["search"]["objective"]
    assert rows["simulations"][-1] == result["simulations"]
    assert (np.diff(rows["objective"]) <= 0).all()


def test_the_objective_is_that_of_the_calculated_power(main_job):
    """Eq. (8) and Eq. (20) recomputed from predictions for the recorded voltage."""
    folder, _ = main_job
    told = json.loads((folder / "run" / "result.json").read_text())
    (event,) = tractexp.read("tibet_50pct")
    record = event.record
    assert told["before"]["P0"] == event.P0
    made = tractexp.load(folder / "run" / "result.json").predict(t=record.t, U=record.U)
    off_P, off_Q = made.P - record.P, made.Q - record.Q
    assert np.mean(off_P**2 + off_Q**2) == pytest.approx(told["objective"], rel=1e-4)
    epsilon_p = np.sqrt(np.mean(off_P**2) / np.mean(record.P**2))
    assert epsilon_p == pytest.approx(told["epsilon_p"], rel=1e-4)


def test_the_main_job_is_logged_as_contracted(main_job):
    folder, _ = main_job
    result = json.loads((folder / "run" / "result.json").read_text())
    with sqlite3.connect(folder / "outputs" / "mlflow.db") as store:
        ask = lambda text: store.execute(text).fetchall()  # noqa: E731
        assert ask("select status from runs") == [("FINISHED",)]
        assert ("identify tibet_50pct",) in ask("select name from experiments")
        parameters = dict(ask("select key, value from params"))
        metrics = dict(ask("select key, value from latest_metrics"))
        tags = dict(ask("select key, value from tags"))
        curves = dict(ask("select key, count(*) from metrics group by key"))
    assert parameters["optimizer.population"] == "50"
    assert not set(result["parameters"]) & set(parameters), (
        "what was found is a number, and no setting"
    )
    low, high = result["intervals"]["T_prime"]
    assert (metrics["T_prime"], metrics["T_prime_low"], metrics["T_prime_high"]) == (
        result["parameters"]["T_prime"],
        low,
        high,
    )
    assert metrics["search_T_prime"] == result["search"]["parameters"]["T_prime"]
    assert (tags["grade"], metrics["grade"]) == ("effect_missing", 1)
    assert metrics["objective"] == result["objective"]
    assert metrics["search_objective"] == result["search"]["objective"]
    assert metrics["train_1_epsilon_p"] == result["epsilon_p"]
    assert (
        metrics["model_error_over_linear_network"]
        == result["linear_network"]["ratio"]
        == pytest.approx(0.25, abs=0.01)
    )
    assert curves["fitness"] == 301
    assert 20 < curves["fitness_by_simulations"] < 301  # at steps that all runs share
    assert {tags[key] for key in ("optimizer", "data", "model", "seed")} == {
        "issa",
        "tibet_50pct",
        "third_order_exponential",
        "0",
    }
    artifacts = {path.name for path in folder.rglob("outputs/*/**/*") if path.is_file()}
    assert {"report.html", "history.csv", "result.json", "config.yaml", "MLmodel"} <= artifacts


def test_the_logged_model_predicts_in_a_clean_process(main_job):
    folder, _ = main_job
    (model,) = (path.parent for path in folder.rglob("MLmodel"))
    program = (
        "import sys, json, numpy as np, pandas as pd, mlflow.pyfunc;"
        "t = np.arange(600) * 2e-3; U = 1 - 0.3 * ((t > 0.3) & (t < 0.5));"
        "frame = mlflow.pyfunc.load_model(sys.argv[1]).predict(pd.DataFrame({'t': t, 'U': U}));"
        "print(json.dumps([list(frame.columns), frame.P.iloc[0], frame.P.min(), frame.Q.iloc[0]]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(model)], capture_output=True, text=True, cwd="/"
    )
    assert done.returncode == 0, done.stderr
    columns, before, dipped, Q = json.loads(done.stdout.splitlines()[-1])
    result = json.loads((folder / "run" / "result.json").read_text())
    assert columns == ["P", "Q"]
    assert before == pytest.approx(result["before"]["P0"], abs=1e-9)
    assert pytest.approx(result["before"]["Q0"], abs=1e-9) == Q
    assert dipped < 0.8


def run_quickly(folder, *arguments):
    """result.json of a short run."""
    done = run_command(*QUICK, *arguments, "hydra.run.dir=run", cwd=folder)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "run" / "result.json").read_text())


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    return run_quickly(tmp_path_factory.mktemp("quick"), "seed=3")


def test_the_same_seed_gives_the_same_bits_and_another_seed_does_not(quick, tmp_path):
    again, other = (run_quickly(tmp_path, f"seed={seed}") for seed in (3, 4))
    assert (
        quick["search"]["parameters"]
        == again["search"]["parameters"]
        != other["search"]["parameters"]
    )
    # one estimate, whatever was searched
    assert quick["parameters"] == again["parameters"] == other["parameters"]


def test_a_held_out_event_is_judged_but_not_fitted(quick, tmp_path):
    both = run_quickly(tmp_path, "seed=3", "data.validate=[pkg://tractexp.data/tibet_30pct.csv]")
    assert quick["parameters"] == both["parameters"]
    assert [e["role"] for e in both["events"]] == ["train", "validate"]
    assert both["epsilon_p"] == quick["epsilon_p"] != both["events"][1]["epsilon_p"]
    assert "tibet_30pct, held out: epsilon_p" in (tmp_path / "run" / "report.html").read_text()


def test_bounds_and_fixed_values_are_kept_and_a_value_at_its_bound_is_marked(tmp_path):
    done = run_command(
        *EXACT,
        "model.bounds.q_v=[0.2,0.4]",
        "model.fixed.C=0.85",
        "hydra.run.dir=run",
        "--all",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert 0.2 <= result["parameters"]["q_v"] <= 0.4
    assert result["parameters"]["C"] == 0.85
    assert result["at_bound"] == ["q_v"]
    assert "a bound holds q_v at 0." in done.stdout
    assert "fixed" in done.stdout


def test_a_budget_is_spent_to_the_last_simulation(tmp_path):
    done = run_command("budget=333", "tracking.enabled=false", "hydra.run.dir=run", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["simulations"] == 333
    assert result["status"] == "stopped at the budget of 333 simulations"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ["optimizer=isa"],
            "optimizer=isa: there is no such choice; did you mean 'issa'? Available:",
        ),
        (
            ["optimzer=issa"],
            "optimzer: the configuration has no key 'optimzer'; did you mean 'optimizer'?",
        ),
        (
            ["optimizer.populatoin=9"],
            "'optimizer' has no key 'populatoin'; did you mean 'population'?",
        ),
        (["+sede=3"], "sede: there is no such key; did you mean 'seed'?"),
        (["+optimizer.sede=3"], "optimizer 'issa' has no setting 'sede'"),
        (["seed=abc"], "seed=abc is not a whole number"),
        (["seed=-1"], "seed=-1 is out of range: it must be at least 0"),
        (["budget=0"], "budget=0 is out of range: it must be at least 1"),
        (["optimizer.population=1"], "optimizer.population=1 is out of range"),
        (["optimizer.acceptance=best"], "optimizer.acceptance=best is not one of"),
        (
            ["model/motor=electromechancal"],
            "there is no such choice; did you mean 'electromechanical'?",
        ),
        (
            ["model.bounds.C=[0.9,0.1]"],
            "model.bounds.C: bounds [0.9, 0.1] must be two finite numbers, the lower one",
        ),
        (["model.bounds.C=[0.9]"], "model.bounds.C=[0.9] must be two numbers, [lower, upper]"),
        (
            ["model.bounds.X_prim=[0,1]"],
            "this model has no parameter 'X_prim'; did you mean 'X_prime'?",
        ),
        (["model.fixed.Cc=0.5"], "model.fixed.Cc: this model has no parameter 'Cc'"),
        (["model.substeps=0"], "model.substeps=0 is out of range: it must be 1 to"),
        (
            ["data=tibet_40pct"],
            "data=tibet_40pct: there is no such choice; did you mean 'tibet_50pct'?",
        ),
        (["data=csv"], "data.train"),
        (["data=csv", "data.train=[nowhere.csv]"], "nowhere.csv"),
        (["data=csv", f"data.train=[{SHIPPED}]", "data.validate=[nowhere.csv]"], "nowhere.csv"),
        (["task=identfy"], "task=identfy: there is no such choice; did you mean 'identify'?"),
        (["task=look"], "task=look: look is no task but a command: tractexp look"),
    ],
)
def test_bad_input_gets_one_sentence_and_leaves_nothing_behind(arguments, sentence, tmp_path):
    done = run_command(*arguments, "hydra.run.dir=run", cwd=tmp_path)
    assert done.returncode != 0
    assert sentence in done.stderr
    assert done.stderr.startswith("tractexp: ")
    assert done.stderr.count("\n") == 1, done.stderr
    assert not (tmp_path / "run").exists()
    assert not (tmp_path / "outputs").exists()


def test_the_papers_values_get_the_reason_they_cannot_be_simulated(tmp_path):
    """Table 2, fixed all but one: no candidate has a steady state, and Eq. (3) is named."""
    paper = {
        "T_prime": 4.1354,
        "X_prime": 1.6654,
        "C": -2.6241,
        "M": 0.82,
        "T_m": 3.378,
        "p_v": 3.5867,
    }
    fixed = [f"model.fixed.{name}={value}" for name, value in paper.items()]
    done = run_command(*QUICK, *fixed, "hydra.run.dir=run", cwd=tmp_path)
    assert done.returncode == 2
    assert "none of the" in done.stderr
    assert "parameter sets tried could be simulated" in done.stderr
    assert "Eq. (3) needs |2 T_m X'/(C U0²)| at most 1 and it is 4.2" in done.stderr
    assert "C = (X - X')/X must lie between 0 and 1 and is -2.6241" in done.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "ahead"),
    [
        ([], True),
        (["optimizer=pso", "task=profile"], True),
        (["tracking.enabled=false"], False),
        (["--cfg", "job"], False),
        (["-m", "seed=1,2"], False),
        (["task=export"], False),
    ],
)
def test_only_a_single_job_that_logs_starts_the_process_that_logs(arguments, ahead, monkeypatch):
    import hydra

    from tractexp import __main__
    from tractexp.tracking import process

    started = []
    monkeypatch.setattr(process, "start_ahead", lambda: started.append(True))
    monkeypatch.setattr(hydra, "main", lambda **_: lambda job: lambda: None)
    monkeypatch.setattr(sys, "argv", ["tractexp"])
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # which the command sets for itself
    assert __main__._run(arguments) == 0
    assert bool(started) == ahead


def test_a_traceback_is_shown_when_asked_for(tmp_path):
    done = start_command("seed=-1", cwd=tmp_path, HYDRA_FULL_ERROR="1")
    assert "Traceback" in done.stderr


def test_the_help_is_short_narrow_and_tells_what_each_task_does(tmp_path):
    done = run_command("--help", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert len(lines) < 60
    assert max(map(len, lines)) <= 100
    for part in (
        "  compare         Settle which optimizer is better",
        "identify by default",
        "issa and 12 variants",
        "ssa and 15",
        "pso,",
        "pso_limited,",
        "covariant_sparrow",
        "third_order_exponential, ",
        " others",
        "tractexp list GROUP",
        "tractexp ui",
        "-m optimizer=issa,ssa,pso",
    ):
        assert part in done.stdout, part
    assert "issa_no_levy" not in done.stdout
    assert " held_out" not in done.stdout  # no group that anyone may choose


def test_the_list_tells_every_choice_as_it_is_registered_and_composed(tmp_path):
    from hydra import compose, initialize_config_dir

    from tractexp.configuration.plugin import CONF, discover
    from tractexp.sweep.hydra_groups import register

    done = run_command("list", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert max(map(len, done.stdout.splitlines())) <= 100
    told = {}
    for block in done.stdout.split("\n\n"):
        head, *lines = block.splitlines()
        rows = [line.split(maxsplit=1) for line in lines if line[2] != " "]
        assert all(len(row) == 2 for row in rows), rows  # each has a line that says what it is
        group = head.partition(":")[0]
        told[group] = {name for name, _ in rows}
        for base in re.findall(r"\d+ variants: tractexp list (\w+)", " ".join(block.split())):
            variants = run_command("list", base, cwd=tmp_path).stdout.splitlines()
            told[group] |= {line.split()[0] for line in variants if line[2] != " "}
    files = {f"{p.parent.relative_to(CONF)}/{p.stem}" for p in CONF.glob("[!_]*/**/*.yaml")}
    classes = {f"{group}/{name}" for group, names in discover().items() for name in names}
    assert {f"{group}/{name}" for group, names in told.items() for name in names} == files | classes
    register()
    with initialize_config_dir(str(CONF), version_base="1.3"):
        for name in told["optimizer"]:
            assert (
                compose("config", [f"optimizer={name}"]).optimizer.name
                in classes | told["optimizer"]
            )


def test_the_list_of_a_group_begins_with_its_default_and_counts_as_people_do(tmp_path):
    done = run_command("list", "optimizer", "experiment", cwd=tmp_path)
    assert "optimizer: how the parameters are searched; issa by default\n  issa  " in done.stdout
    assert "issa_no_levy" not in done.stdout  # the ablation's variants do not hide what there is
    assert "12 variants: tractexp list issa\n" in done.stdout
    assert (
        "ISSA without the Lévy flight of Eq. (16).\n"
        in run_command("list", "issa", cwd=tmp_path).stdout
    )
    assert done.stdout.index("figure3 ") < done.stdout.index("figure10 ")
    assert "model/motor" not in done.stdout


def test_a_group_that_is_none_gets_the_nearest_one(tmp_path):
    done = run_command("list", "optimisers", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(
        "tractexp: there is no group 'optimisers'; did you mean 'optimizer'? Groups: connection,"
        " data, "
    )
    assert done.stderr.count("\n") == 1


def test_a_name_given_for_a_group_gets_the_groups_that_have_it(tmp_path):
    done = run_command("list", "none", cwd=tmp_path)
    assert done.stderr == (
        "tractexp: there is no group 'none', but there is such a name in 'tractexp list"
        " model/motor' and"
        " 'tractexp list model/static'\n"
    )


def test_plugins_of_others_are_listed_and_those_that_cannot_be_imported_say_why(tmp_path):
    """Installed as a wheel would be: a base in one module, a plugin by it in another, and two that
    are broken.
    """
    package, record = tmp_path / "late_loads", tmp_path / "late_loads-1.dist-info"
    (package / "deep").mkdir(parents=True)
    record.mkdir()
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: late_loads\nVersion: 1\n")
    (record / "entry_points.txt").write_text(
        "[tractexp.plugins]\nlate = late_loads\ngone = gone_loads\n"
    )
    base = "from tractexp import extend\nclass Slow(extend.Static):\n    pass\n"
    law = (
        '    """A load{}. That is all.\n\n    Source: here.\n    """\n    def law(self, u):\n      '
        "  return u, u\n"
    )
    for name, text in {
        "__init__": "",
        "_bases": base,
        "deep/__init__": "",
        "deep/late": "from tractexp.extend import plugin\nfrom .._bases import Slow\n@plugin\nclass"
        " Late(Slow):\n" + law.format(" that comes late"),
        "missing": "import nowhere\nfrom tractexp.extend import Static, plugin\n@plugin\nclass"
        " Missing(Static):\n" + law.format(" of nowhere"),
        "wrong": "def f(:\n",
        "made": "from tractexp.extend import Static, plugin\n"
        "body = {'__doc__': 'Made here. Source: here.', '__module__': __name__, 'law': lambda self,"
        " u: (u, u)}\n"
        "plugin(type('Made', (Static,), body))\n",
    }.items():
        (package / f"{name}.py").write_text(text)
    (package / "conf" / "optimizer").mkdir(parents=True)
    (package / "conf" / "optimizer" / "pso_slow.yaml").write_text(
        "# PSO, slowed down.\ndefaults: [pso]\n"
    )
    done = start_command(
        "list", "model/static", "optimizer", cwd=tmp_path, PYTHONPATH=str(tmp_path)
    )
    assert (done.returncode, done.stderr) == (0, "")
    told = " ".join(done.stdout.split())
    for part in (
        "late A load that comes late. ",
        "pso_slow PSO, slowed down. ",
        "missing cannot be used: the plugin module 'late_loads.missing' cannot be imported: ",
        "missing.py, line 1: ModuleNotFoundError: No module named 'nowhere'",
        "left out: the plugin module 'late_loads.wrong' cannot be imported: ",
        "wrong.py, line 1: SyntaxError: ",
        "left out: the plugin package 'gone_loads' (entry point 'gone') cannot be imported:"
        " ModuleNotFoundError",
        "made Made here. ",
    ):
        assert part in told, (part, told[-1500:])


def test_help_and_configuration_load_none_of_the_heavy_libraries(tmp_path):
    for argument in ("--help", "--cfg=job"):
        program = (
            f"import sys; sys.argv = ['tractexp', *{argument.split('=')!r}];"
            "import tractexp.__main__ as m; code = m.main();"
            "heavy = {'mlflow', 'llvmlite', 'sympy', 'scipy', 'matplotlib', 'pandas', 'comtrade'} &"
            " sys.modules.keys();"
            "lazy = {'numpy', 'hydra', 'omegaconf'} & sys.modules.keys() if '--help' in sys.argv"
            " else {};"
            "assert not heavy and not lazy, (heavy, lazy); sys.exit(code)"
        )
        done = subprocess.run(
            [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr


def test_the_console_script_completes_words(tmp_path):
    script = os.path.join(os.path.dirname(sys.executable), "tractexp")
    done = subprocess.run(
        [script, "-sc", "query=bash"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ | {"COMP_LINE": "tractexp optimizer=is", "COMP_POINT": "21"},
    )
    assert "optimizer=issa" in done.stdout
