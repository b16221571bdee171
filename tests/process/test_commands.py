"""The commands that README, CONTRIBUTING and docs show: composed and built as they stand, and the
quick ones run.

Files that a reader has are stood in for by shipped and made ones of the same name.
`test_ten_minutes.py` and `test_tutorial.py` run all of their pages.
"""

import functools
import importlib.metadata
import re
import shutil
import subprocess
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas
import pytest
import test_cev
import test_event_files
from command_line import run_command
from made_recordings import constant, recording
from test_settings import check, hydra  # noqa: F401  a fixture of this module, too

import tractexp
from site_pages import commands
from tractexp.configuration.overrides import quote_overrides
from tractexp.configuration.plugin import build
from tractexp.filetypes.comtrade_writer import write

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
TUTORIALS = ("start.md", "ten-minutes.md")  # followed by tests of their own
SHOWN = [c for page in PAGES for c in commands.of(page)]
ALL = SHOWN + [c for page in PAGES for c in commands.inline(page)]
WORDS = ("ui", "look", "sync", "doctor", "list", "new", "again")  # subcommands
JOBS = {
    f"{c.page.stem}: {' '.join(c.arguments)}": c.arguments
    for c in ALL
    if c.page.name not in TUTORIALS
    and c.arguments is not None
    and not {*WORDS, "--help", "-sc", "--config-dir"} & {*c.arguments}
}
RUN = {
    " ".join(c.arguments): c.arguments
    for c in SHOWN
    if c.page.name not in TUTORIALS
    and c.arguments
    and {"look", "sync", "doctor", "list", "--help", "--cfg"} & {*c.arguments}
}
# channels of two loads
TWO = ("UA", "UB", "UC", "Q1 IA", "Q1 IB", "Q1 IC", "Q2 IA", "Q2 IB", "Q2 IC")
QUICK = ("task=export", "task=simulate", "task=convert", "task=survey")  # tasks that search nothing
RUN |= {" ".join(a): a for a in JOBS.values() if {*QUICK} & {*a}}
RUN |= {
    " ".join(a): a for a in (c.arguments or [] for c in SHOWN) if "again" in a and {*QUICK} & {*a}
}


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder with every file that the commands name."""
    folder = tmp_path_factory.mktemp("desk")
    shipped = Path(tractexp.__file__).parent / "data"
    for name in ("dip1.csv", "a.csv"):
        shutil.copy(shipped / "tibet_50pct.csv", folder / name)
    for name in ("dip2.csv", "b.csv"):
        shutil.copy(shipped / "tibet_30pct.csv", folder / name)
    shutil.copy(shipped / "tibet_65pct.csv", folder / "dip3.csv")
    frame = pandas.read_csv(shipped / "tibet_50pct.csv")
    whole = pandas.concat([frame] * 8, ignore_index=True)
    whole["t"] = np.arange(len(whole)) * 0.002
    whole.to_csv(folder / "long.csv", index=False)
    real = frame.assign(U=27.5 * frame["U"], P=20 * frame["P"], Q=20 * frame["Q"])
    real.to_csv(folder / "kilovolts.csv", index=False)
    real.rename(columns={"U": "Voltage (kV)", "P": "Total (MW)", "Q": "Q (Mvar)"}).to_excel(
        folder / "scada.xlsx", index=False
    )
    waveforms(folder)
    phases = test_event_files.phase_tables(folder)
    test_event_files.pack(folder / "event.zip", *phases)
    (folder / "report.cev").write_bytes("\r\n".join(test_cev.report()).encode("latin-1"))
    quick = (
        "optimizer=multistart_least_squares",
        "optimizer.starts=2",
        "tracking.enabled=false",
        "hydra.run.dir=RUN",
    )
    done = run_command("data=csv", "data.train=[dip1.csv]", *quick, cwd=folder)
    assert done.returncode == 0, done.stderr
    shutil.copytree(folder / "RUN", folder / "outputs" / "RUN")
    return folder


def waveforms(folder):
    """COMTRADE files and tables of samples."""
    dips = np.concatenate(
        [constant(depth=0.3, length=1.5), constant(depth=0.5, length=1.5)], axis=1
    )
    V, I, nothing = dips[:3], dips[3:], np.zeros_like(dips[:1])
    many = np.concatenate([nothing, nothing, nothing, nothing, V, nothing, I])
    names = [f"X{k}" for k in range(4)] + ["UA", "UB", "UC", "X7", "IA", "IB", "IC"]
    for name in ("station.cfg", "xtz.cfg"):
        write(recording(many, names), folder / name, "BINARY", 1999)
    write(recording(dips), folder / "grid.cfg", "BINARY", 1999)
    write(recording(dips[[0, 3]], ("UA", "IA")), folder / "arm.cfg", "BINARY", 1999)
    for name in ("day 1/e4.cfg", "day 3/e9.cfg"):
        (folder / "recordings" / name).parent.mkdir(parents=True)
        write(
            recording(np.concatenate([dips, I / 2]), TWO),
            folder / "recordings" / name,
            "BINARY",
            1999,
        )
    t = np.arange(dips.shape[1]) / 3200
    V, A = 1e3 * dips[:3], 1e3 * dips[3:]
    for name, of in (
        ("rec.csv", dict(zip(("ua", "ub", "uc", "ia", "ib", "ic"), (*V, *A), strict=True))),
        ("feeder.csv", {"u": V[0], "i": A[0]}),
    ):
        pandas.DataFrame({"t": t, **of}).to_csv(folder / name, index=False)


def single(argument):
    """The first of the values that a sweep goes through."""
    from hydra.core.override_parser.overrides_parser import OverridesParser

    (parsed,) = OverridesParser.create().parse_overrides([argument])
    if not parsed.is_sweep_override():
        return argument
    return f"{parsed.key_or_group}={next(iter(parsed.sweep_string_iterator()))}"


def composed(arguments):
    """The configuration of a command and its plugins, checked as they are before anything runs."""
    given = [
        a for a in arguments if not a.startswith("-") and a != "job" and not a.startswith("hydra")
    ]
    config = check(*map(single, quote_overrides(given)))
    from omegaconf import OmegaConf

    plain = OmegaConf.to_container(config, resolve=False)
    return {
        group: build(group, plain[group])
        for group in ("data", "optimizer", "objective")
        if plain.get(group)
    }


@pytest.mark.parametrize("arguments", JOBS.values(), ids=JOBS)
def test_a_job_composes_and_its_records_are_read(arguments, desk, monkeypatch):
    if "hydra/sweeper=optuna" in arguments:
        pytest.importorskip(
            "hydra_plugins.hydra_optuna_sweeper", reason="the extra optuna is not installed"
        )
    suite = list(importlib.metadata.distributions(name="tractexp-suite"))
    if "experiment=benchmark" in arguments and not suite:
        pytest.skip("benchmarks/suite is not installed")
    monkeypatch.chdir(desk)
    built = composed(arguments)
    words = " ".join(arguments)
    of_folders = {"task=survey", "task=station"} & {*arguments}
    if not of_folders and ("data=" in words or "data.path=" in words):
        assert built["data"].read().train


@pytest.mark.parametrize("arguments", RUN.values(), ids=RUN)
def test_a_quick_command_runs(arguments, desk):
    quiet = ["tracking.enabled=false"] * any(
        "=" in word and word[0] != "-" for word in arguments if "look" not in arguments
    )
    done = run_command(*arguments, *quiet, cwd=desk)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_the_command_of_the_extended_model_runs_as_a_page_tells_it(desk):
    """The file lies where an investigation puts it; it may be named, too."""
    (told,) = [c.arguments for c in ALL if "--config-dir" in (c.arguments or [])]
    (desk / "CONF" / "model").mkdir(parents=True)
    (desk / "CONF" / "model" / "extended.yaml").write_text(
        "defaults:\n  - third_order_exponential\n  - _self_\neffects: [stator_resistance]\n"
    )
    for arguments in (told, ["model=CONF/model/extended.yaml"]):
        done = run_command(*arguments, "--cfg", "job", "--package", "model", cwd=desk)
        assert done.returncode == 0, done.stderr
        assert "stator_resistance" in done.stdout


def test_a_models_file_reaches_nothing_but_the_model(tmp_path):
    """What a stranger's file says of Hydra, or refers to, ends in a sentence."""
    (tmp_path / "conf" / "model").mkdir(parents=True)
    file = tmp_path / "conf" / "model" / "extended.yaml"
    for text in (
        "# @package _global_\nhydra: {callbacks: {x: {_target_: os.getcwd}}}\n",
        "defaults: [third_order_exponential, _self_]\nfixed: {C: '${oc.env:HOME}'}\n",
    ):
        file.write_text(text, encoding="utf-8")
        for chosen in (["--config-dir", "conf", "model=extended"], [f"model={file}"]):
            done = run_command(*chosen, "--cfg", "job", cwd=tmp_path)
            assert done.returncode == 2
            assert re.search("is no key of a model|no references to others", done.stderr)


def test_completion_is_a_line_that_a_shell_takes(desk):
    (told,) = [c.words for c in SHOWN if "-sc" in c.line]
    inside = re.fullmatch(r"\$\(tractexp (.*)\)", told[1])[1].split()
    done = run_command(*inside, cwd=desk)
    assert subprocess.run(["bash", "-n"], input=done.stdout, text=True).returncode == 0
    assert done.stdout.strip()


def test_the_page_of_the_log_is_told_how_to_open():
    for told in (c.arguments for c in ALL if "ui" in (c.arguments or [])):
        options = {word for word in told if word.startswith("--")}
        help_text = run_command("ui", "--help", cwd=ROOT).stdout
        assert all(option in help_text for option in options)


def test_no_command_holds_what_a_shell_takes_for_a_file():
    """A placeholder in angle brackets reads from a file."""
    for c in ALL:
        bare = re.sub(r"'[^']*'|\"[^\"]*\"", "", c.line).partition(" #")[0]
        assert not re.search(r"[<>]", bare), c.line


def test_scripts_and_their_options_are_there():
    """`python benchmarks/X.py --option`, from the top or from `benchmarks`."""
    tried = 0
    for c in ALL:
        for before, word in pairwise(["", *c.words]):
            if before.endswith("python") and word.endswith(".py") and c.page.name not in TUTORIALS:
                path = (
                    ROOT / word
                    if word.startswith(("benchmarks", "tests"))
                    else ROOT / "benchmarks" / word
                )
                script = (path if path.is_file() else ROOT / "tests" / word).read_text(
                    encoding="utf-8"
                )
                for option in (w for w in c.words if w.startswith("--")):
                    assert f'"{option}"' in script, c.line
                tried += 1
    assert tried > 15


def test_extras_files_and_modules_are_there():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [
        extra
        for c in ALL
        for w in c.words
        if "pip" in c.line
        if not w.startswith("modelica")  # another's extra
        for extra in re.findall(r"\[(\w+)\]$", w)
    ]
    assert {"test", "benchmark", "posterior", "slurm", "dask", "cmaes", "dev"} <= {*asked}
    assert {*asked} <= project["optional-dependencies"].keys()
    for name in (".ci/run", ".ci/constraints.txt", "tests/process/test_cli.py"):
        assert any(name in c.line for c in ALL)
        assert (ROOT / name).is_file()


def test_every_command_is_seen_to():
    """A new kind of line asks for a test of its own."""
    kinds = [
        "pip",
        "pipx",
        "pytest",
        "venv",
        "build",
        "bash",
        "cd",
        "eval",
        "sbatch",
        "sphinx",
        "-c",
        "activate",
        "ruff",
        "pyright",
    ]
    for c in ALL:
        seen = (
            c.arguments is not None
            or any(kind in c.line for kind in kinds)
            or c.words[1].endswith(".py")
        )
        assert seen, f"{c.page.name}: {c.line}"


@pytest.mark.parametrize("page", ["README.md", "docs/records.md", "docs/model.md"])
def test_the_python_of_a_page_runs_and_has_what_its_comments_name(
    page, desk, resistive_dips, tmp_path, monkeypatch
):
    """README's on dips of a motor with a stator resistance, of a few effects.

    That of docs/python.md is run by `test_docs_run.py`, which investigates with the whole
    catalogue, that of docs/plugins.md by `test_plugins.py`.
    """
    monkeypatch.chdir(desk)
    if page == "README.md":
        few = functools.partial(
            tractexp.investigate, effects=("stator_resistance", "exponential_recovery")
        )
        monkeypatch.setattr(tractexp, "investigate", few)
        monkeypatch.chdir(tmp_path)
        for path in resistive_dips:
            shutil.copy(path, tmp_path)
    names = {}
    for example in re.findall(
        r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL
    ):
        exec(compile(example, page, "exec"), names)
    if page == "README.md":
        assert names["found"].names == ("stator_resistance",)
        assert all(hasattr(names["found"], told) for told in ("verdict", "gap", "extended"))
        assert names["fit"].parameters["X_prime"].interval
    if page == "docs/records.md":
        told = ("start", "end", "depth", "U0", "P0", "Q0", "f0", "noise_U", "noise_P", "noise_Q")
        assert all(hasattr(names["event"], name) for name in told)
        told = ("t", "U", "P", "Q", "f", "U2", "base", "window", "more", "notes")
        assert all(hasattr(names["event"].record, name) for name in told)
        assert all(
            hasattr(names["seen"], name) for name in ("feeders", "events", "commands", "report")
        )
