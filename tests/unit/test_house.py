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
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
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
