"""What one logged run costs: python benchmarks/tracking.py [--json] [--repeat 3]

Each row is a fresh Python process that logs one run (60 parameters, two curves of 300 points, one
artifact, the model) to SQLite. `fresh` creates the store, `existing` finds it, `second process`
finds it and logs through `tractexp.tracking.process` beside a computation of 1.5 s, which is not
counted. Seconds of wall time, the median of the repeats; `process` is the whole process from start
to end, NumPy and the interpreter included.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

JOB = """
import json, sys, time
laps, last = {}, time.perf_counter()
def lap(name):
    global last
    laps[name], last = time.perf_counter() - last, time.perf_counter()
import numpy as np
from pathlib import Path
from tractexp import tracking
from tractexp.tracking import store
from tractexp.tracking.process import Logger
lap("import_tractexp")
folder, compute = Path(sys.argv[1]), float(sys.argv[2])
uri = tracking.find_default_uri(folder)
if compute:
    logger = Logger(uri)
    end = time.process_time() + compute
    while time.process_time() < end:
        pass
    last += compute
else:
    store.import_mlflow(sql=True)
    lap("import_mlflow")
    tracking.open_store(uri)
    lap("open_store")
steps, fitness = np.arange(300), np.geomspace(1, 1e-5, 300)
result = folder / "result.json"
result.write_text("{}")
run = tracking.TrackedRun(
    "benchmark", "run",
    parameters={f"key.{i}": i for i in range(60)},
    metrics={"objective": 1e-5, "epsilon_p": 0.01, "epsilon_q": 0.01},
    curves={"fitness": (steps, fitness), "fitness_by_simulations": (50 * steps, fitness)},
    artifacts=[result], model=result,
)
logger.log(run) if compute else tracking.log(run, uri)
lap("log_run")
print(json.dumps(laps))
"""


STORES = {"fresh": 0.0, "existing": 0.0, "second process": 1.5}  # seconds of computation beside it


def once(folder: Path, compute: float) -> dict[str, float]:
    """One process, timed from outside and by its own laps, its computation left out."""
    started, before = time.perf_counter(), os.times()
    done = subprocess.run(
        [sys.executable, "-c", JOB, str(folder), str(compute)],
        capture_output=True,
        text=True,
        check=True,
    )
    after = os.times()
    cpu = (
        after.children_user
        + after.children_system
        - before.children_user
        - before.children_system
        - compute
    )
    laps: dict[str, float] = json.loads(done.stdout)
    seconds = time.perf_counter() - started - compute
    return laps | {
        "process": seconds,
        "logging": seconds - laps["import_tractexp"],
        "process_cpu": cpu,
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    parser.add_argument("--repeat", type=int, default=3, help="repetitions (default 3)")
    options = parser.parse_args()
    rows: dict[str, list[dict[str, float]]] = {store: [] for store in STORES}
    for _ in range(options.repeat):
        with tempfile.TemporaryDirectory() as folder:
            for store, compute in STORES.items():
                rows[store].append(once(Path(folder), compute))
    table = {
        store: {lap: statistics.median(run[lap] for run in runs) for lap in runs[0]}
        for store, runs in rows.items()
    }
    if options.json:
        print(json.dumps(table))
        return
    print(f"{'seconds':<16}" + "".join(f"{store:>16}" for store in table))
    for lap in table["fresh"]:
        print(
            f"{lap:<16}"
            + "".join(f"{row[lap]:>16.3f}" if lap in row else " " * 16 for row in table.values())
        )


if __name__ == "__main__":
    main()
