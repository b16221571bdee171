"""Time per Runge-Kutta step and candidate, objective included, beside the usual ways of doing it.
Run: see --help.

All ways simulate the same record of 1,000 samples with the base model and sum the squared errors,
in turns within this one run; the smallest time of each is reported, which is the figure least
disturbed by other work on the machine. The measured power is the solution to ten digits, so that
the objective at the true parameters tells each way's error. Ways that control their error by a
tolerance take the loosest one that meets the error asked for.

Two ways are there where their packages are: `pip install numbalsoda` (C++ LSODA; MIT; builds with a
Fortran compiler) and `pip install diffrax` (on JAX; Apache 2.0). So is ANDES (GPL; extra
`crosscheck`), which solves more than is asked: the network's equations with the load's, one load at
a time, without an objective.
"""

import argparse
import json
import math
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import andes_check
import arithmetic
import numpy as np
import rivals

from tractexp.configuration.plugin import build, get
from tractexp.exchange.format import Identified
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import Model, compose

TRUTH = np.array([0.12, 0.25, 0.9, 0.006, 0.55, 1.4, 3.0])  # T', X', C, M, T_m, p_v, q_v
SAMPLES, CANDIDATES, POPULATION, FEW = 1000, 200, 50, 8
TOLERANCES = [10.0**-k for k in range(3, 12)]
LOOSE = 1e-5  # pu, a root mean square error far below any recorder's noise
SECONDS = 2.0  # at most spent on one way


def excitation() -> Excitation:
    """A 50 % dip of 150 ms with 20 ms edges at 1 kHz."""
    t = np.arange(SAMPLES) * 1e-3
    U = 1 - 0.5 * (np.clip((t - 0.2) / 0.02, 0, 1) - np.clip((t - 0.37) / 0.02, 0, 1))
    return Excitation(1e-3, U, np.ones(SAMPLES), np.full(SAMPLES, 0.6), 1.0, 1.0, 0.6)


def candidates(n: int) -> np.ndarray:
    """The truth, and others around it (n, 7)."""
    values = TRUTH * np.random.default_rng(0).uniform(0.9, 1.1, (n, len(TRUTH)))
    values[0] = TRUTH
    return values


@dataclass
class Way:
    """One way of computing the objectives of candidates, and the fastest it was."""

    label: str
    call: Callable[[np.ndarray], np.ndarray]
    candidates: int
    substeps: int = 1
    seconds: float = math.inf
    spent: float = 0.0

    @property
    def nanoseconds(self) -> float:
        """Per Runge-Kutta step, or sample where another method is used, and candidate."""
        return self.seconds / self.candidates / (SAMPLES - 1) / self.substeps * 1e9

    def error(self) -> float:
        """Root mean square of the errors of P and Q at the truth [pu]; the call that compiles."""
        return float(np.sqrt(self.call(candidates(self.candidates))[0] / (2 * SAMPLES)))

    def time(self, values: np.ndarray) -> None:
        started = time.perf_counter()
        self.call(values[: self.candidates])
        self.seconds = min(self.seconds, time.perf_counter() - started)
        self.spent += time.perf_counter() - started


def ours(model: Model, drive: Drive, substeps: int = 1) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: model.errors(drive, values, substeps).sums.sum(axis=(0, 1))


def base() -> Model:
    return compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())


def loosest(make: Callable[[float], Callable], most: float) -> tuple[Callable, float] | None:
    """A way made with the loosest tolerance whose error is at most so large."""
    for tolerance in TOLERANCES:
        call = make(tolerance)
        if np.sqrt(call(TRUTH[None])[0] / (2 * SAMPLES)) <= most:
            return call, tolerance
    return None


def rival_ways(record: rivals.Record, error: float) -> dict[str, Way]:
    """Everything that is installed, by the key its figures have."""
    ways = {
        "numba_one_at_a_time": Way(
            "Numba, one at a time, the same steps", rivals.OneAtATime(record), CANDIDATES
        ),
        "numpy": Way("NumPy, all at once, the same steps", rivals.Vectorized(record), CANDIDATES),
    }
    adaptive = {
        "solve_ivp": ("SciPy LSODA", lambda rtol: rivals.SciPy(record, "LSODA", rtol), 2),
        "solve_ivp_dop853": ("SciPy DOP853", lambda rtol: rivals.SciPy(record, "DOP853", rtol), 2),
        "numbalsoda": (
            "numbalsoda LSODA",
            lambda rtol: rivals.NumbaLSODA(record, "LSODA", rtol),
            20,
        ),
        "numbalsoda_dop853": (
            "numbalsoda DOP853",
            lambda rtol: rivals.NumbaLSODA(record, "DOP853", rtol),
            20,
        ),
    }
    for key, (label, make, count) in adaptive.items():
        for suffix, most in (("", error), ("_loose", LOOSE)):
            try:
                found = loosest(make, most)
            except (ImportError, OSError) as missing:
                print(f"{label} left out: {missing}", file=sys.stderr)
                break
            if found:
                ways[key + suffix] = Way(f"{label}, tolerance {found[1]:.0e}", found[0], count)
    try:
        ways["diffrax"] = Way(
            "diffrax Tsit5, all at once, a step a sample", rivals.Diffrax(record), CANDIDATES
        )
    except ImportError as missing:
        print(f"diffrax left out: {missing}", file=sys.stderr)
    return ways


def race(ways: list[Way], rounds: int) -> None:
    """All ways in turn, each until it has had its rounds or its seconds."""
    values = candidates(CANDIDATES)
    for _ in range(rounds):
        for way in ways:
            if way.spent < SECONDS:
                way.time(values)


def andes_row() -> dict[str, float] | None:
    """ANDES on the same load behind a line: time per step, and its error at its own terminal
    voltage.
    """
    if andes_check.interpreter() is None:
        return None
    step, voltage = 1e-3, excitation().U
    parameters = dict(zip(base().names, TRUTH, strict=True))
    settings = {
        "motor": {"name": "electromechanical"},
        "static": {"name": "exponential"},
        "effects": [],
    }
    before = {"U0": 1.0, "P0": 1.0, "Q0": 0.6, "frequency": andes_check.FREQUENCY}
    load = Identified(andes_check.result(parameters, settings, before))
    tables = json.loads(build("format", {"name": "andes"}).text(load))
    runs = [andes_check.andes(tables, voltage, step) for _ in range(2)]
    P, Q = andes_check.ours(load.model, parameters, runs[0], step)
    error = np.sqrt(np.mean([(runs[0]["P"] - P) ** 2, (runs[0]["Q"] - Q) ** 2]))
    seconds = min(float(run["seconds"]) for run in runs)
    return {"nanoseconds_per_step": seconds / (len(voltage) - 1) * 1e9, "error": float(error)}


def kernels(drive: Drive) -> dict[tuple[int, int], Way]:
    """Our public batch call by number of candidates and substeps."""
    calls = ((CANDIDATES, 1), (CANDIDATES, 2), (POPULATION, 1), (FEW, 1))
    return {
        (n, substeps): Way("tractexp", ours(base(), drive, substeps), n, substeps)
        for n, substeps in calls
    }


def limits(ways: dict[tuple[int, int], Way], rounds: int) -> list[dict]:
    """What each kernel's arithmetic alone would take, and the share of that reached."""
    rows, least = [], {}
    for (n, substeps), way in ways.items():
        row = {"candidates": n, "substeps": substeps, "nanoseconds_per_step": way.nanoseconds}
        try:
            if substeps not in least:
                least[substeps] = arithmetic.limit(base().source, substeps, rounds)
        except ValueError as reason:
            rows.append(row | {"no_limit": str(reason)})
            continue
        found = least[substeps]
        row |= {"operations_per_step": found.step.all, "operations_per_sample": found.sample.all}
        row |= {"vector_operations_per_nanosecond": found.rate, "limit": found.nanoseconds}
        rows.append(row | {"share": found.nanoseconds / way.nanoseconds})
    return rows


def measure(rounds: int) -> dict:
    """All figures of one run."""
    P, Q = rivals.Record(excitation()).solution(TRUTH)
    record = replace(excitation(), P=P, Q=Q)
    drive, model = Drive.from_events([record]), base()
    own = Way("tractexp, public batch call", ours(model, drive), CANDIDATES)
    halved = Way("tractexp, two steps a sample", ours(model, drive, 2), CANDIDATES)
    error = own.error()
    others = rival_ways(rivals.Record(record), 1.01 * error)
    called = kernels(drive)
    everything = {"": own, "two_substeps": halved, **others}
    errors = {key: way.error() for key, way in everything.items()}
    for way in called.values():
        way.error()  # compiles
    race([*everything.values(), *called.values()], rounds)
    per_sample = {key: way.nanoseconds * way.substeps for key, way in everything.items()}
    values = candidates(CANDIDATES)
    difference = np.abs(own.call(values) - others["numpy"].call(values)).max() / SAMPLES
    figures = {
        "rows": [
            {
                "way": way.label,
                "nanoseconds": per_sample[key],
                "ratio": per_sample[key] / own.nanoseconds,
                "error": errors[key],
            }
            for key, way in everything.items()
        ],
        "kernel": limits(called, rounds),
        "andes": andes_row(),
        "nanoseconds_per_step": own.nanoseconds,
    }
    figures |= {f"nanoseconds_per_step_{key}": per_sample[key] for key in others}
    figures |= {f"ratio_to_{key}": per_sample[key] / own.nanoseconds for key in others}
    return figures | {
        "simulations_per_second": CANDIDATES / own.seconds,
        "largest_difference_to_numpy": float(difference),
        "candidates": CANDIDATES,
        "samples": SAMPLES,
        "machine": platform.processor() or platform.machine(),
    }


def tell(figures: dict) -> None:
    """The tables."""
    print(
        f"{SAMPLES} samples, one thread; per sample and candidate; error: RMS of P and Q at the"
        " truth\n"
    )
    for row in figures["rows"]:
        line = (
            f"{row['way']:<46}{row['nanoseconds']:>10.1f} ns{row['ratio']:>9.1f}"
            f" x{row['error']:>12.1e} pu"
        )
        print(line)
    if row := figures["andes"]:
        times = row["nanoseconds_per_step"] / figures["nanoseconds_per_step"]
        print(
            f"{'ANDES, one load with its network':<46}{row['nanoseconds_per_step']:>10.0f}"
            f" ns{times:>9.0f} x",
            end="",
        )
        print(f"{row['error']:>12.1e} pu, without an objective")
    print(
        "\nkernel, public batch call; ns per Runge-Kutta step and candidate; floating-point"
        " operations per step and"
    )
    print(
        "vector; limit: these alone, at the rate that operations in registers reach in this run\n"
    )
    print(f"{'candidates':>12}{'substeps':>10}{'ns':>8}{'operations':>12}{'limit':>8}{'share':>7}")
    for row in figures["kernel"]:
        line = f"{row['candidates']:>12}{row['substeps']:>10}{row['nanoseconds_per_step']:>8.2f}"
        if "limit" in row:
            operations = row["operations_per_step"] + row["operations_per_sample"] / row["substeps"]
            line += f"{operations:>12.1f}{row['limit']:>8.2f}{row['share']:>7.0%}"
        print(line + row.get("no_limit", ""))
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON only")
    parser.add_argument("--repeats", type=int, default=1500)
    chosen = parser.parse_args()
    figures = measure(chosen.repeats)
    if not chosen.json:
        tell(figures)
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
