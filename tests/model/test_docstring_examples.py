"""Each example of a docstring gives what it says, and what it explains is there."""

import ast
import doctest
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for path in sorted(ROOT.glob("tractexp/**/*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_a_module_give_what_they_say(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = doctest.testmod(importlib.import_module(name))
    assert done.attempted > 0
    assert done.failed == 0


def test_the_front_door_has_examples():
    assert {f"tractexp.api.{name}" for name in ("read", "identify", "simulate")} <= {*MODULES}


def list_explained(docstring: str) -> Iterator[str]:
    """The names of arguments that a docstring's section of parameters explains."""
    _, _, section = docstring.partition("Parameters\n----------\n")
    for line in re.split(r"\n\n\w+\n-+\n", section)[0].splitlines():
        if line and not line.startswith(" "):
            names = line.split(" : ")[0].split(",")
            yield from (name.strip().lstrip("*") for name in names)


@pytest.mark.parametrize("room", sorted(path.name for path in (ROOT / "tractexp").glob("*/")))
def test_arguments_that_a_docstring_explains_are_those_of_the_call(room):
    gone = []
    for path in sorted((ROOT / "tractexp" / room).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                own = {a.arg for a in ast.walk(node.args) if isinstance(a, ast.arg)}
                explained = set(list_explained(ast.get_docstring(node) or ""))
                gone += [f"{path.name} {node.name}: {name}" for name in explained - own]
    assert gone == []


def test_explained_arguments_are_read_from_their_section():
    parameters = "Parameters\n----------\na, b : int\n    Two.\n*c\n    More."
    text = f"Do.\n\n{parameters}\n\nReturns\n-------\nint"
    assert [*list_explained(text)] == ["a", "b", "c"]
