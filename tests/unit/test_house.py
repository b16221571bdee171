"""The floors of the house: imports go down only, as CONTRIBUTING.md says."""

import ast
import functools
import importlib
import re
from pathlib import Path

import pytest

from tractexp.__main__ import COMMANDS

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "tractexp"
# anything else right in the package is the ground, which imports nothing above it
ABOVE = {"conf", "data", "extend", "testing"}  # for authors of plugins, and what is no code


def floors() -> dict[str, int]:
    """{room: its floor}, from the sentence that tells contributors."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (told,) = re.findall(r"Imports go down these floors only: (.*?)\. ", " ".join(text.split()))
    return {
        room: k
        for k, floor in enumerate(told.split(" < "))
        for room in re.findall(r"`(\w+)`", floor)
    }


FLOORS = floors()


@functools.cache
def modules(path: Path) -> list[tuple[str, bool]]:
    """The modules that a file imports by their full names, each with whether its annotations alone
    need it.
    """
    found, nodes = [], [(ast.parse(path.read_text(encoding="utf-8")), False)]
    while nodes:
        node, typed = nodes.pop()
        if isinstance(node, ast.Import):
            found += [(alias.name, typed) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            whole = node.module == "tractexp"
            found += (
                [(f"tractexp.{alias.name}", typed) for alias in node.names]
                if whole
                else [(node.module, typed)]
            )
        elif (
            isinstance(node, ast.If)
            and isinstance(node.test, ast.Name)
            and node.test.id == "TYPE_CHECKING"
        ):
            nodes += [(child, True) for child in node.body] + [
                (child, typed) for child in node.orelse
            ]
        elif not isinstance(node, ast.expr):  # which holds no import
            nodes += [(child, typed) for child in ast.iter_child_nodes(node)]
    return found


def imported(path: Path, *, annotations: bool = False) -> set[str]:
    """Rooms of the package that a module imports, within functions too; those for its annotations
    only where they are asked for.
    """
    return {
        n.split(".")[1]
        for n, typed in modules(path)
        if n.startswith("tractexp.") and (annotations or not typed)
    }


@pytest.mark.parametrize("room", sorted({*FLOORS} - {"__main__"}))
def test_a_room_imports_from_its_own_floor_and_below(room):
    place = PACKAGE / room
    files = sorted(place.rglob("*.py")) if place.is_dir() else [PACKAGE / f"{room}.py"]
    assert files
    up = {
        f"{path.relative_to(PACKAGE)} imports {other}"
        for path in files
        for other in imported(path)
        if FLOORS.get(other, 0) > FLOORS[room]
    }
    assert up == set()


@pytest.mark.parametrize("room", ["noise", "inference", "identification", "discrepancy"])
def test_the_engine_names_nothing_above_it_in_annotations_either(room):
    up = {
        f"{path.relative_to(PACKAGE)} names {other}"
        for path in (PACKAGE / room).rglob("*.py")
        for other in imported(path, annotations=True)
        if FLOORS.get(other, 0) > FLOORS[room]
    }
    assert up == set()


def test_nothing_imports_the_studies():
    """But for the names that `tractexp` gives, each imported at its first use."""
    others = (p for p in PACKAGE.rglob("*.py") if "studies" not in p.parts)
    assert {path.name for path in others if "studies" in imported(path)} == set()


def test_plugins_of_ours_import_what_a_plugin_of_others_may():
    """`tractexp.extend` and what is below it; of their own folder what starts with
    an underscore.
    """
    imports = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in (ROOT / "plugins").rglob("*.py")
        for name, _ in modules(path)
        if name.split(".")[0] in ("tractexp", "tractexp_plugins")
        and name.split(".")[:2] != ["tractexp", "extend"]
    }
    assert imports == set()


def test_one_module_starts_another_python():
    """`tractexp/process/interpreter.py`: with -P, so that a module beside the records is never
    imported.
    """
    sources = [*PACKAGE.rglob("*.py"), *(ROOT / "plugins").rglob("*.py")]
    named = {
        str(path.relative_to(ROOT))
        for path in sources
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "sys.executable"
    }
    # a script that needs no other module of ours, and what may be another program's Python: both
    # say -P themselves
    assert named == {
        "tractexp/process/interpreter.py",
        "tractexp/filetypes/reading_process.py",
        "plugins/formats/andes.py",
    }
    for name in named:
        assert '"-P"' in (ROOT / name).read_text(encoding="utf-8")


def test_one_module_quotes():
    """`tractexp/text/quoting.py`: what quotes for a language elsewhere would be a second door."""
    sources = [*PACKAGE.rglob("*.py"), *(ROOT / "plugins").rglob("*.py")]
    imports = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in sources
        for name, _ in modules(path)
        if name.split(".")[0] in ("html", "shlex") and path != PACKAGE / "text" / "quoting.py"
    }
    assert imports == set()


ENGINE = ("noise", "inference", "identification", "discrepancy")


def engine_imports(path: Path) -> dict[str, set[str]]:
    """{module of the engine: the names that a file imports from it}; of a module that is imported
    as a whole its own name.
    """
    found: dict[str, set[str]] = {}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            pairs = [alias.name.rpartition(".")[::2] for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            pairs = [(node.module or "", alias.name) for alias in node.names]
        else:
            continue
        for module, name in pairs:
            whole = f"{module}.{name}"
            if f"{whole}.".startswith(tuple(f"tractexp.{room}." for room in ENGINE)):
                is_module = (ROOT / whole.replace(".", "/")).with_suffix(".py").exists()
                found.setdefault(whole if is_module else module, set()).add(name)
    return found


def test_a_test_that_knows_the_engine_says_what_of_it_it_tests():
    """All else goes through what a user calls, what a plugin imports, or the command line."""
    silent = set()
    for path in (ROOT / "tests").rglob("test_*.py"):
        known = set().union(*engine_imports(path).values())
        about = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        if known and not known & {*re.findall(r"`(\w+)`", about)}:
            silent.add(path.name)
    assert silent == set()


def test_no_test_knows_more_than_four_modules_of_the_engine():
    """The analytic test of a function needs no more: what a test shows of more goes through the
    front door.
    """
    files = (ROOT / "tests").rglob("test_*.py")
    assert {path.name for path in files if len(engine_imports(path)) > 4} == set()


@pytest.mark.parametrize(("command", "place"), COMMANDS.items())
def test_a_command_beside_the_tasks_is_where_the_program_looks_for_it(command, place):
    module, _, function = place.partition(":")
    assert callable(getattr(importlib.import_module(module), function)), command
