"""Files a second of a survey: `python benchmarks/survey.py [files]` writes benchmarks/survey.json.

The archive is generated: COMTRADE files of 1 s, of 6 to 12 channels at 3.2 to 4 kHz, binary and
ASCII, with one dip each. Wall seconds are those of the whole call on two processes, their start
included; CPU seconds are those of the whole tree of processes, so they hold on a shared machine
too; the load average says how shared it was.
"""

import argparse
import json
import os
import resource
import tempfile
import time
from datetime import datetime
from pathlib import Path

import numpy as np

import tractexp
from tractexp.filetypes.comtrade_writer import write
from tractexp.recording import Channel, Recording, Segment

CORES = 2


def recording(rng: np.random.Generator) -> Recording:
    """One second of one to three loads on a bus of 110 kV, with a dip of 10 to 60 %."""
    rate, loads = float(rng.choice([3200, 4000])), int(rng.integers(1, 4))
    t = np.arange(round(rate)) / rate
    start, duration, depth = 0.35, rng.uniform(0.08, 0.25), rng.uniform(0.1, 0.6)
    size = 1 - depth * ((t >= start) & (t < start + duration))
    turn = 2 * np.pi * 50 * t - 2 * np.pi / 3 * np.arange(3)[:, None]
    waves = [("U", "kV", 110 / np.sqrt(3), 0.0)]
    waves += [
        (f"Q{k + 1} I", "kA", rng.uniform(0.1, 0.4), rng.uniform(0.2, 0.6)) for k in range(loads)
    ]
    channels = []
    for name, unit, level, lag in waves:
        values = np.sqrt(2) * level * size * np.cos(
            turn - lag
        ) + 1e-3 * level * rng.standard_normal(turn.shape)
        gain = float(np.abs(values).max() / 32000)
        quantity = "voltage" if unit == "kV" else "current"
        channels += [
            Channel(
                f"{name}{phase}",
                np.round(row / gain).astype(np.int16),
                unit,
                quantity,
                phase,
                gain=gain,
            )
            for phase, row in zip("ABC", values, strict=True)
        ]
    segment = Segment(0, len(t), rate, 0.0)
    return Recording("", channels, [segment], 50.0, station="generated", start=datetime(2026, 1, 1))


def archive(folder: Path, count: int) -> None:
    """Write so many files, a fifth of them ASCII."""
    rng = np.random.default_rng(17)
    for k in range(count):
        kind = "ASCII" if k % 5 == 0 else "BINARY"
        write(recording(rng), folder / f"bay{k % 8}" / f"event{k:04d}.cfg", kind, 1999)


def spent() -> float:
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in both)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--files", type=int, default=400)
    count = parser.parse_args().files
    with tempfile.TemporaryDirectory() as name:
        folder, keep = Path(name, "archive"), Path(name, "kept")
        archive(folder, count)
        before, started = spent(), time.perf_counter()
        made = tractexp.survey(folder, cores=CORES, keep=keep, progress=False)
        wall, cpu = time.perf_counter() - started, spent() - before
        started = time.perf_counter()
        tractexp.survey(folder, cores=CORES, keep=keep, progress=False)
        again = time.perf_counter() - started
    found = {
        "files": count,
        "cores": CORES,
        "load_average": round(os.getloadavg()[0], 1),
        "wall_seconds": round(wall, 2),
        "cpu_seconds": round(cpu, 2),
        "files_per_second": round(count / wall, 1),
        "files_per_cpu_second": round(count / cpu, 1),
        "again_seconds": round(again, 3),
        "rows": len(made.rows),
        "worth": sum(row["worth"] for row in made.rows),
        "unread": len(made.unread),
    }
    print(json.dumps(found, indent=2))
    Path(__file__).with_suffix(".json").write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
