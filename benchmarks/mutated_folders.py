"""Configurations, results and states of runs with a few nodes changed, at the doors that read them.

    python benchmarks/mutated_folders.py [CASES] [SEED]

Each case is read, left out or refused in one sentence; anything else is printed with its number, by
which `fuzzed` in `tests/process/test_doors.py` makes it again.
"""

import contextlib
import io
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "process"))

import test_doors


def main(cases: int = 10_000, seed: int = 1) -> int:
    with tempfile.TemporaryDirectory() as root, contextlib.redirect_stdout(io.StringIO()):
        found = test_doors.fuzzed(cases, seed, Path(root))
    print(f"{cases} cases of {len(test_doors.TREES)} files and doors, {len(found)} of them wrong")
    for number, why in found.items():
        print(f"  {number}: {why}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
