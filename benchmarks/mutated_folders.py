"""Configurations, results and states of runs with a few nodes changed, at the doors that read them.

    python benchmarks/mutated_folders.py [CASES] [SEED]

Each case is read, left out or refused in one sentence; anything else is printed with its number, by
which `fuzzed` in `tests/process/test_doors.py` makes it again. Before, every file takes every shape
that none should have. Counts, and the table of doors and shapes, go to mutated_folders.json.
"""

import contextlib
import io
import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "process"))

import test_doors

from tractexp import files
from tractexp.errors import UserError

REFUSED, READ = "refused", "read or left out"


def tabulate(root: Path) -> dict[str, dict[str, list[str]]]:
    """{file and door: {what becomes of it: shapes}}."""
    table: dict[str, dict[str, list[str]]] = {}
    for name, made, read in test_doors.DOORS:
        of_door = table.setdefault(f"{name} by {read.__name__}", {REFUSED: [], READ: []})
        for k, (shape, give) in enumerate(test_doors.SHAPES.items()):
            folder = made(root / str(k) / "0")
            give(folder / name)
            of_door[tell(read, folder)].append(shape)
            shutil.rmtree(root / str(k))
    return table


def tell(read, folder: Path) -> str:
    """What a door does with a folder; raises what it raises that is no `UserError`."""
    with contextlib.chdir(Path.cwd()), test_doors.limited():
        try:
            read(folder)
        except UserError:
            return REFUSED
    return READ


def main(cases: int = 10_000, seed: int = 1) -> int:
    with tempfile.TemporaryDirectory() as root, contextlib.redirect_stdout(io.StringIO()):
        doors = tabulate(Path(root))
        found = test_doors.fuzzed(cases, seed, Path(root))
    content = {"cases": cases, "seed": seed, "wrong": found, "doors": doors}
    files.write_json(Path(__file__).with_suffix(".json"), content)
    print(f"{cases} cases of {len(test_doors.TREES)} files and doors, {len(found)} of them wrong")
    for number, why in found.items():
        print(f"  {number}: {why}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
