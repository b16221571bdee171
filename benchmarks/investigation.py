"""Seconds of an investigation on one core and on all, in turns within this one run. Run: see
--help.

The shipped dips, two fitted and one held out, each time by a process of its own in a cache of its
own: the first run compiles, and what it fitted is forgotten before each of the others. Only their
ratio holds for another machine.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

CODE = "code", "texts"  # folders of the cache that a run leaves to the next


def seconds(cache: Path, data: str, cores: Sequence[int]) -> float:
    """Of the command on these cores, without what earlier ones have fitted."""
    for folder in cache.iterdir():
        if folder.name not in CODE:
            shutil.rmtree(folder, ignore_errors=True)
    command = [
        sys.executable,
        "-m",
        "tractexp",
        "task=discrepancy",
        f"data={data}",
        "tracking.enabled=false",
    ]
    with tempfile.TemporaryDirectory() as empty:
        started = time.perf_counter()
        subprocess.run(
            [*command, f"hydra.run.dir={empty}/run"],
            check=True,
            cwd=empty,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "TRACTEXP_CACHE_DIR": str(cache)},
            preexec_fn=lambda: os.sched_setaffinity(0, cores),
        )
        return time.perf_counter() - started


def measure(data: str, rounds: int) -> dict[str, float]:
    """Median seconds on one core and on all that this process may use, and how many these are."""
    every = sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as cache:
        seconds(Path(cache), data, every)
        pairs = [
            [seconds(Path(cache), data, some) for some in (every[:1], every)] for _ in range(rounds)
        ]
    one, all_cores = map(median, zip(*pairs, strict=True))
    return {"cores": len(every), "one_core": one, "all_cores": all_cores, "ratio": one / all_cores}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--data", action="append", help="shipped data sets; default: tibet and contactors"
    )
    parser.add_argument("--rounds", type=int, default=3)
    chosen = parser.parse_args()
    figures = {
        data: measure(data, chosen.rounds) for data in chosen.data or ("tibet", "contactors")
    }
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
