"""The floors of the house: imports go down only, as CONTRIBUTING.md says."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "tractexp"
# anything else right in the package is the ground, which imports nothing above it
ABOVE = {"conf", "data", "extend", "testing"}  # for authors of plugins, and what is no code


def floors() -> dict[str, int]:
    """{room: its floor}, from the sentence that tells contributors."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (told,) = re.findall(r"Imports go down these floors only: (.*?)\. ", " ".join(text.split()))
    return {room: k for k, floor in enumerate(told.split(" < ")) for room in re.findall(r"`(\w+)`", floor)}


FLOORS = floors()


def imported(path: Path) -> set[str]:
    """Rooms of the package that a module imports, within functions too, but not for its annotations only."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            node.body = []
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "tractexp":
            parts = (node.module or "").split(".")
            found |= {parts[1]} if len(parts) > 1 else {alias.name for alias in node.names}
    return found


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


def test_nothing_imports_the_studies():
    """But for the names that `tractexp` gives, each imported at its first use."""
    others = (p for p in PACKAGE.rglob("*.py") if "studies" not in p.parts)
    assert {path.name for path in others if "studies" in imported(path)} == set()


def test_plugins_of_ours_import_what_a_plugin_of_others_may():
    """`tractexp.extend` and what is below it; of their own folder what starts with an underscore."""
    imports = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in (ROOT / "plugins").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        for name in names(node)
        if name.split(".")[0] in ("tractexp", "tractexp_plugins") and name.split(".")[:2] != ["tractexp", "extend"]
    }
    assert imports == set()


def names(node: ast.AST) -> list[str]:
    """The modules that a statement imports by their full names."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    return [node.module] if isinstance(node, ast.ImportFrom) and node.module and not node.level else []


def test_one_module_quotes():
    """`tractexp/quoting.py`: what quotes for a language elsewhere would be a second door."""
    sources = [*PACKAGE.rglob("*.py"), *(ROOT / "plugins").rglob("*.py")]
    imports = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in sources
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        for name in names(node)
        if name.split(".")[0] in ("html", "shlex") and path != PACKAGE / "quoting.py"
    }
    assert imports == set()
