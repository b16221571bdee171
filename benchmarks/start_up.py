"""What a command costs beside the libraries it needs: python benchmarks/start_up.py [--json]
[--repeat 7]

Fresh Python processes, run in turn so that what else the machine does falls on all of them alike:
the help beside `import hydra`, the main job (logged, with its page) beside `import mlflow`.
Everything is warm: the folder has a store, the kernel is compiled, and so is Python's bytecode,
whatever PYTHONDONTWRITEBYTECODE says. Seconds of wall time, the least and the median of the
repeats, and what the commands take more than the imports.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

COMMANDS = {
    "import hydra": ("-c", "import hydra"),
    "--help": ("-m", "tractexp", "--help"),
    "list": ("-m", "tractexp", "list"),
    "import mlflow": ("-c", "import mlflow"),
    "main job": ("-m", "tractexp", "optimizer=issa", "data=tibet_50pct"),
    "main job, not logged": (
        "-m",
        "tractexp",
        "optimizer=issa",
        "data=tibet_50pct",
        "tracking.enabled=false",
    ),
}
BESIDE = {"--help": "import hydra", "main job": "import mlflow"}


def once(arguments: tuple[str, ...], folder: str) -> float:
    """Seconds of one process from start to end."""
    environment = {
        key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"
    }
    started = time.perf_counter()
    subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, check=True
    )
    return time.perf_counter() - started


def measured(repeat: int) -> dict[str, list[float]]:
    """{command: seconds of each repeat}."""
    rows: dict[str, list[float]] = {name: [] for name in COMMANDS}
    with tempfile.TemporaryDirectory() as folder:
        for round in range(repeat + 1):
            for name, arguments in COMMANDS.items():
                seconds = once(arguments, folder)
                if round:  # the first one warms up
                    rows[name].append(seconds)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    parser.add_argument("--repeat", type=int, default=7, help="repetitions (default 7)")
    options = parser.parse_args()
    rows = measured(options.repeat)
    table = {
        name: {"least": min(row), "median": statistics.median(row)} for name, row in rows.items()
    }
    for name, beside in BESIDE.items():
        for kind in ("least", "median"):
            table[name][f"{kind} ratio"] = table[name][kind] / table[beside][kind]
            table[name][f"{kind} more"] = table[name][kind] - table[beside][kind]
    if options.json:
        print(json.dumps(table))
        return
    print(f"{'seconds':<24}{'least':>8}{'median':>8}")
    for name, row in table.items():
        print(f"{name:<24}{row['least']:>8.2f}{row['median']:>8.2f}", end="")
        if name in BESIDE:
            times, more = (
                f"{row[f'least {k}']:.2f} (median {row[f'median {k}']:.2f})"
                for k in ("ratio", "more")
            )
            print(f"   {times} times {BESIDE[name]}, {more} s more", end="")
        print()


if __name__ == "__main__":
    main()
