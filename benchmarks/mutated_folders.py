"""Configurations, results and states of runs with a few nodes changed, at the doors that read them.

    python benchmarks/mutated_folders.py [--count 10000] [--first 0] [--seed 1]

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
from mutated_files import command

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


def run(count: int, seed: int, first: int = 0) -> dict:
    """Counts and findings of so many cases, and the table of doors and shapes."""
    with tempfile.TemporaryDirectory() as root, contextlib.redirect_stdout(io.StringIO()):
        doors = tabulate(Path(root))
        found = test_doors.fuzzed(count, seed, Path(root), first)
    return {
        "cases": count,
        "seed": seed,
        "counts": {"folders": {"as allowed": count - len(found)}},
        "worst": {},
        "bad": [{"case": k, "words": why} for k, why in found.items()],
        "doors": doors,
    }


if __name__ == "__main__":
    sys.exit(command(run, __doc__, __file__))
