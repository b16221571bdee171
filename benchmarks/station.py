"""A made station: `python benchmarks/station.py [--dips N] [--loads N]` adds a row to
benchmarks/station.json; with `--keep FOLDER` it may be ended and goes on.

Four loads on one bus, 300 dips in five years, two of them with currents that the recorder clips
(`tests/made_station.py` writes the files). Told are the largest error of the machines' constants,
that of the share by hour, what was left out, and the time of the whole call on two processes.
"""

import argparse
import json
import os
import resource
import sys
import tempfile
import time
from datetime import datetime, timedelta
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from joblib.externals.loky import get_reusable_executor
from made_station import MACHINES, STATICS, expect_share, make_station

import tractexp

CORES = 2
MONDAY = datetime(2023, 6, 5)


def compare_constants(load: dict, k: int) -> float:
    """The largest relative error of the constants of load k."""
    truth = {**MACHINES[k % 4], **STATICS[k % 3]}
    found = {row["name"]: row["value"] for row in load["constants"]}
    return max(abs(found[name] / value - 1) for name, value in truth.items())


def compare_hours(load: dict, k: int) -> float:
    """The largest error of the motors' share by hour, a fraction of P; weekdays in their mean."""
    rows = load["composition"]["terms"].get("hour")
    if rows is None:
        return float("inf")
    week = [MONDAY + timedelta(days=day, minutes=30) for day in range(7)]
    truth = [
        np.mean([expect_share(k, day + timedelta(hours=hour)) for day in week])
        for hour in range(24)
    ]
    found = [row["value"] for row in rows]
    return float(np.abs(np.array(found) - truth).max())


def compare_shares(load: dict, k: int, shares: dict) -> float:
    """The largest error of the share of a dip that was not left out."""
    return max(
        abs(event["share"] - shares[k, n])
        for n, event in enumerate(load["events"])
        if not event["odd"]
    )


def spent() -> float:
    """CPU seconds of this process and of those that have ended below it."""
    get_reusable_executor().shutdown(wait=True)
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in both)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--dips", type=int, default=300)
    parser.add_argument("--loads", type=int, default=4)
    parser.add_argument("--keep", help="a folder in which a run that was ended goes on")
    given = parser.parse_args()
    faulty = (given.dips // 3, 2 * given.dips // 3)
    with tempfile.TemporaryDirectory() as name:
        place = Path(given.keep or name)
        folder, kept = place / "records", place / "kept"
        fresh = not kept.exists()
        shares, _ = make_station(folder, given.loads, given.dips, faulty, write=fresh)
        before, started = spent(), time.perf_counter()
        made = tractexp.fit_station(folder, cores=CORES, keep=kept, progress=False)
        seconds, cpu = time.perf_counter() - started, spent() - before
    loads = [load for load in made.content["loads"] if "why" not in load]
    row = {
        "loads": given.loads,
        "dips": given.dips,
        "fitted": [load["dips"] for load in loads],
        "cores": CORES,
        "load_average": round(os.getloadavg()[0], 1),
        # of a run that went on nobody knows how long it took
        "seconds": round(seconds, 1) if fresh else None,
        "cpu_seconds": round(cpu, 1) if fresh else None,
        "constants": round(max(compare_constants(o, k) for k, o in enumerate(loads)), 4),
        "by_hour": round(max(compare_hours(o, k) for k, o in enumerate(loads)), 4),
        "shares": round(max(compare_shares(o, k, shares) for k, o in enumerate(loads)), 4),
        "left_out": [len(load["odd"]) for load in loads],
        "predicted": [round(load["predicted"]["last_half"] or 0.0, 4) for load in loads],
    }
    print(json.dumps(row, indent=2))
    path = Path(__file__).with_suffix(".json")
    rows = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else []
    size = lambda one: (one["loads"], one["dips"])  # noqa: E731
    rows = sorted([*(one for one in rows if size(one) != size(row)), row], key=size)
    path.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
