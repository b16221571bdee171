"""What the package runs with: python benchmarks/versions.py [--python PATH ...] [--set NAME ...]

For each interpreter an environment of its own, by uv, of the wheel of this clone with one of the
sets of versions below; in an empty folder of it the main job, a sweep of two jobs on two workers
and an investigation, each logged. A row is stored in versions.json, in the place of an earlier one
of the same Python and set: the versions that were installed, and of each command "runs" or its last
line. A set that this Python has no wheels of is "not installable", with why. `--tables` writes
docs/faq.md from the rows; that all commands ran in each is tested.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import marked

ROOT = Path(__file__).resolve().parents[1]
ROWS = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs" / "faq.md"
TOLD = ("hydra-core", "omegaconf", "numpy", "scipy", "mlflow", "joblib")
SETS: dict[str, Sequence[str]] = {  # arguments of `uv pip install` beside the wheel
    "oldest": ("-r", str(ROOT / ".ci" / "oldest.txt")),
    "looked at": ("-c", str(ROOT / ".ci" / "constraints.txt")),
    "newest": (),
    "candidates": ("hydra-core>=1.4.0rc1", "omegaconf>=2.4.0rc1"),
}
COMMANDS: dict[str, Sequence[str]] = {
    "help": ("--help",),
    "main job": ("optimizer=issa", "data=tibet_50pct"),
    "sweep": ("-m", "optimizer=pso", "budget=200", "seed=range(0,2)", "hydra.launcher.n_jobs=2"),
    "investigation": ("task=discrepancy", "data=contactors"),
}


def run(*command: object, folder: Path) -> str:
    """Run a command in a folder; returns "" where it ends well, else its last line."""
    environment = {key: text for key, text in os.environ.items() if not key.startswith("PYTHON")}
    ended = subprocess.run(
        list(map(str, command)), cwd=folder, env=environment, capture_output=True, text=True
    )
    lines = (ended.stdout + ended.stderr).strip().splitlines()
    return "" if ended.returncode == 0 else (lines or ["it ended without a word"])[-1]


def build_wheel(folder: Path) -> Path:
    """The wheel of this clone, built outside of it."""
    subprocess.run(["uv", "build", "-q", "--wheel", "-o", folder, ROOT], check=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


def measure(python: str, name: str, wheel: Path) -> dict[str, Any]:
    """One row: what was installed for an interpreter, and how each command ended."""
    asked = subprocess.run(
        [python, "-c", "import platform; print(platform.python_version())"],
        capture_output=True,
        text=True,
        check=True,
    )
    row: dict[str, Any] = {"python": asked.stdout.strip(), "set": name}
    with tempfile.TemporaryDirectory() as there:
        folder, desk = Path(there, "environment"), Path(there, "desk")
        desk.mkdir()
        own = folder / "bin" / "python"
        subprocess.run(["uv", "venv", "-q", "--python", python, folder], check=True)
        why = run("uv", "pip", "install", "-q", "-p", own, wheel, *SETS[name], folder=desk)
        if why:
            return {**row, "not installable": why}
        told = f"import importlib.metadata as m, json; print(json.dumps([*map(m.version, {TOLD})]))"
        versions = subprocess.run([own, "-c", told], capture_output=True, text=True, check=True)
        row["versions"] = dict(zip(TOLD, json.loads(versions.stdout), strict=True))
        row["commands"] = {
            command: run(own, "-m", "tractexp", *arguments, folder=desk) or "runs"
            for command, arguments in COMMANDS.items()
        }
    return row


def store(row: dict[str, Any]) -> None:
    """Put a row into the file, in the place of the one of the same Python and set."""
    rows = json.loads(ROWS.read_text(encoding="utf-8")) if ROWS.exists() else []
    rows = [one for one in rows if (one["python"], one["set"]) != (row["python"], row["set"])]
    rows = sorted(
        [*rows, row], key=lambda one: (one["set"], list(map(int, one["python"].split("."))))
    )
    ROWS.write_text(json.dumps(rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def text() -> str:
    """The table of the page."""
    rows = [row for row in json.loads(ROWS.read_text(encoding="utf-8")) if "versions" in row]
    shown = TOLD[:-1]
    return marked.table(
        ["Python", *shown], [[row["python"], *map(row["versions"].get, shown)] for row in rows]
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--python", nargs="+", default=[sys.executable], metavar="PATH")
    parser.add_argument("--set", nargs="+", default=list(SETS), choices=SETS, metavar="NAME")
    parser.add_argument("--tables", action="store_true", help="write the page, and run nothing")
    options = parser.parse_args()
    if options.tables:
        print(marked.replace(PAGE, "benchmarks/versions.py", text()))
        return
    with tempfile.TemporaryDirectory() as there:
        wheel = build_wheel(Path(there))
        for python in options.python:
            for name in options.set:
                row = measure(python, name, wheel)
                store(row)
                print(json.dumps(row, ensure_ascii=False), flush=True)


if __name__ == "__main__":
    main()
