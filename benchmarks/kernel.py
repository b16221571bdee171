"""Kernels beside those that Numba compiled: processor time to compile, and time of a step.

    python benchmarks/kernel.py --other PYTHON [--rounds 40] [--store]
        measure both versions and print the tables
    python benchmarks/kernel.py --other PYTHON --narrow [...]
        as on a processor of 256 bits
    python benchmarks/kernel.py --tables
        the tables of the stored runs

PYTHON is the interpreter of an environment with the version to compare with, such as a checkout of
fd91fa8, the last with Numba. Both versions run at the same time in a process each and take turns,
call by call; the fastest call counts, in processor time, so that other work on the machine disturbs
little.
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
from typing import Any

FILE = Path(__file__).with_suffix(".json")
BASE, WAVES = ("phasors", "electromechanical", "exponential"), ("waves", "stator_flux", "branch")
SEVEN = (
    "exponential_recovery",
    "feeder_impedance",
    "magnetic_saturation",
    "second_motor_group",
    "shunt_capacitor",
    "speed_dependent_torque",
    "undervoltage_trip",
)
COMPILED = {
    "base": BASE,
    "double_cage": ("phasors", "double_cage", "exponential"),
    "three effects": (*BASE, "magnetic_saturation", "speed_dependent_torque", "second_motor_group"),
    "seven effects": (*BASE, *SEVEN),
    "waves": WAVES,
}
RUN = {
    "base": BASE,
    "double_cage": COMPILED["double_cage"],
    "two effects": (*BASE, "magnetic_saturation", "speed_dependent_torque"),
    "relay and second group": (*BASE, "undervoltage_trip", "second_motor_group"),
    "waves": WAVES,
}
CANDIDATES = (8, 16, 50, 200, 1024)
SAMPLES = 1000
WIDEST, NARROW = "widest", "narrow"  # vectors: those of the processor, or of 256 bits


def hide_wide_vectors() -> None:
    """Let LLVM find a processor without AVX-512: both versions compile for what llvmlite tells of
    the host.
    """
    from llvmlite import binding as llvm

    features = llvm.get_host_cpu_features()
    features.update({name: False for name in features if name.startswith(("avx512", "avx10"))})
    llvm.get_host_cpu_features = lambda: features
    llvm.get_host_cpu_name = lambda: "x86-64-v3"


def serve(narrow: bool) -> None:
    """Do what is asked, a line each, in the version that this interpreter has; say what it took."""
    if narrow:
        hide_wide_vectors()
    sys.path.insert(0, str(Path(__file__).parent))
    import numpy as np

    from tractexp.model import drive
    from tractexp.model.drive import Drive

    # the name it has in fd91fa8
    vars(drive).setdefault("WaveformDrive", vars(drive).get("Waveforms"))
    import kernel_reference

    def load(parts: list[str]) -> Any:
        return kernel_reference.model(kernel_reference.case(*parts))

    def driven(domain: str) -> Drive:
        if domain == "waves":
            return Drive.from_events([kernel_reference.waves(0.3, 0.05, 1.0, SAMPLES / 1200)])
        return Drive.from_events([kernel_reference.phasors(0.4, 1e-3, SAMPLES, 1.0, 0.0)])

    def compiled(parts: list[str]) -> list[float]:
        model, drive = load(parts), driven(parts[0])
        marks = [time.process_time()]
        for part in ("equations", "source", "kernel"):
            getattr(model, part)
            marks.append(time.process_time())
        model.errors(drive, np.array([[p.default for p in model.parameters]]))
        marks.append(time.process_time())
        return [marks[2] - marks[0], marks[4] - marks[2]]

    calls: dict[str, Any] = {}

    def prepared(key: str, parts: list[str], n: int) -> bool:
        model, rng = load(parts), np.random.default_rng(0)
        values = np.array([p.default for p in model.parameters]) * rng.uniform(
            0.97, 1.03, (n, len(model.names))
        )
        drive, substeps = driven(model.domain), 2 if model.waves else 1
        calls[key] = lambda: model.errors(drive, values, substeps)
        return bool(calls[key]().is_refused.any())

    def called(key: str) -> float:
        started = time.thread_time()  # of this thread alone: others may use the machine
        calls[key]()
        return time.thread_time() - started

    for line in sys.stdin:
        what, *arguments = json.loads(line)
        done = {"compiled": compiled, "prepared": prepared, "called": called}[what](*arguments)
        print(json.dumps(done), flush=True)


class Version:
    """A process of one version."""

    def __init__(self, python: str, folder: str, narrow: bool):
        there = os.environ | {
            "TRACTEXP_CACHE_DIR": str(Path(folder) / "cache"),
            "OPENBLAS_NUM_THREADS": "1",
        }
        command = [python, str(Path(__file__).resolve()), "--serve", *["--narrow"] * narrow]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=there, cwd=folder
        )

    def __call__(self, *what: Any) -> Any:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(what) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())


def measured(ours: Version, other: Version, rounds: int) -> dict[str, Any]:
    """Rows of both tables."""
    from processor import processor  # not where the other version is served

    for version in (ours, other):
        version("compiled", ("phasors", "none", "zip"))  # what the first pays for all
    compiling = []
    for name, parts in COMPILED.items():
        mine, theirs = ours("compiled", parts), other("compiled", parts)
        row = {
            "model": name,
            "derive": mine[0],
            "compile": mine[1],
            "other_derive": theirs[0],
            "other": theirs[1],
        }
        compiling.append(row)
        print(row, file=sys.stderr)
    running = []
    for name, parts in RUN.items():
        for n in CANDIDATES:
            key = f"{name} {n}"
            if ours("prepared", key, parts, n) or other("prepared", key, parts, n):
                raise SystemExit(
                    f"some of {n} candidates of {name} have no steady state; their time means"
                    " nothing"
                )
            best = [float("inf"), float("inf")]
            for _ in range(rounds * max(2, 200 // n)):
                best = [
                    min(b, version("called", key))
                    for b, version in zip(best, (ours, other), strict=True)
                ]
            steps = n * (SAMPLES - 1) * (2 if parts[0] == "waves" else 1)
            row = {
                "model": name,
                "candidates": n,
                "ns": 1e9 * best[0] / steps,
                "other_ns": 1e9 * best[1] / steps,
            }
            running.append(row)
            print(row, file=sys.stderr)
    return {
        "compiling": compiling,
        "running": running,
        "processor": processor(),
        "load": os.getloadavg()[0],
    }


def compile_table(rows: dict[str, Any]) -> str:
    """Seconds to derive and to compile each model, as docs/model.md has them."""
    lines = [
        "| model | declare and lower [s] | IR to machine code [s] | Numba [s] |",
        "|---|---|---|---|",
    ]
    for r in rows["compiling"]:
        lines.append(
            f"| {r['model']} | {r['derive']:.2f} | {r['compile']:.2f} | {r['other']:.1f} |"
        )
    return "\n".join(lines)


def run_table(rows: dict[str, Any]) -> str:
    """Nanoseconds of a step and candidate, as docs/model.md has them."""
    lines = [
        f"| model | {' | '.join(f'{n} candidates' for n in CANDIDATES)} |",
        "|---" * (len(CANDIDATES) + 1) + "|",
    ]
    for name in RUN:
        own = [r for r in rows["running"] if r["model"] == name]
        cells = (f"{r['ns']:.1f} ({r['ns'] / r['other_ns']:.2f})" for r in own)
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def tables(stored: dict[str, Any]) -> list[str]:
    """The paragraphs and tables of docs/model.md."""
    parts = [compile_table(stored[WIDEST])]
    for rows in stored.values():
        ratios = sorted(r["ns"] / r["other_ns"] for r in rows["running"])
        middle, worst = statistics.median(ratios), ratios[-1]
        parts += [
            f"On {rows['processor']}, median {middle:.2f}, at worst {worst:.2f}:",
            run_table(rows),
        ]
    return parts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--other", help="an interpreter of the version to compare with")
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument(
        "--narrow", action="store_true", help="compile as for a processor without AVX-512"
    )
    parser.add_argument("--store", action="store_true")
    parser.add_argument("--tables", action="store_true")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.serve:
        serve(chosen.narrow)
        return
    stored = json.loads(FILE.read_text(encoding="utf-8"))
    if not chosen.tables:
        if chosen.narrow:
            hide_wide_vectors()  # for the processor's own row
        with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as two:
            own, other = (
                Version(sys.executable, one, chosen.narrow),
                Version(chosen.other, two, chosen.narrow),
            )
            stored[NARROW if chosen.narrow else WIDEST] = measured(own, other, chosen.rounds)
        if chosen.store:
            FILE.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
    print("\n\n".join(tables(stored)))


if __name__ == "__main__":
    main()
