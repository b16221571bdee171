"""Make the shipped stand-ins `tibet_50pct`, `tibet_30pct`, `tibet_65pct`: python
benchmarks/make_tibet.py [--out DIR]

The recording the paper uses was never published. These three dips of one load come from the
simulator in `independent`, which shares no equation with the model that is fitted to them;
docs/data.md tells how and why.
"""

import argparse
import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import oracle  # noqa: F401

from independent import Dip, Load, Machine, Recorder, Static, record

MADE_BY = "benchmarks/make_tibet.py"
NOTE = (
    "synthetic stand-in for an unpublished record: simulated with an independent flux-state machine"
    " and a noisy "
    "recorder, not measured in Tibet or anywhere else"
)
# Zero stator resistance, as below Eq. (2) of the paper; the other values lie among those usual for
# industrial groups.
MACHINE = Machine(Rs=0.0, Xs=0.16, Xm=2.0, Rr=0.02, Xr=0.20, H=0.9)
# The power base is the active power before the event, so motor and static load share 1 pu.
LOAD = Load(MACHINE, rating=0.45, torque=0.8, static=Static(P=0.64, Q=0.36, p_v=1.4, q_v=3.6))
RECORDER = Recorder(step=0.002, voltage_noise=0.01, current_noise=0.02, bits=14)
EDGES = {"start": 0.3, "fall": 0.05, "rise": 0.09, "sag": 0.4, "settle": 0.2}
DIPS = {
    "tibet_50pct": (5001, Dip(depth=0.50, duration=0.20, **EDGES)),
    "tibet_30pct": (3001, Dip(depth=0.30, duration=0.20, **EDGES)),
    "tibet_65pct": (6501, Dip(depth=0.65, duration=0.16, **EDGES)),
}
# a hundredth of the noise, and coarse enough to hide the last bits in which platforms differ
DECIMALS = 5


def table(columns: dict[str, np.ndarray]) -> str:
    """The record as CSV, columns t, U, P, Q; the frequency is constant and the voltage balanced, so
    no f and U2.
    """
    lines = ["t,U,P,Q"]
    for t, *values in zip(*(columns[name] for name in ("t", "U", "P", "Q")), strict=True):
        lines.append(",".join([f"{t:.3f}", *(f"{value:.{DECIMALS}f}" for value in values)]))
    return "\n".join(lines) + "\n"


def rounded(values: dict[str, float]) -> dict[str, float]:
    return {name: float(f"{value:.9g}") for name, value in values.items()}


def sidecar(name: str, seed: int, dip: Dip) -> dict[str, object]:
    """What a reader of the record may want to know, the truth first."""
    motor = LOAD.steady_power(dip.before)
    start = {
        "U_0": dip.before,
        "P_d0": motor.real,
        "Q_d0": motor.imag,
        "P_s0": LOAD.static.P,
        "Q_s0": LOAD.static.Q,
    }
    return {
        "name": name,
        "note": NOTE,
        "truth": rounded({**LOAD.truth(), "H": MACHINE.H * LOAD.rating}),
        "steady_state": rounded(start),
        "base": "voltage: nominal; power: active power before the event; frequency: 50 Hz",
        "machine": {**dataclasses.asdict(MACHINE), "rating": LOAD.rating, "torque": LOAD.torque},
        "dip": dataclasses.asdict(dip),
        "recorder": dataclasses.asdict(RECORDER),
        "seed": seed,
        "made_by": MADE_BY,
    }


def make(folder: Path) -> list[Path]:
    """Write the three records and their sidecars into `folder`, made if need be, and return their
    paths.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, (seed, dip) in DIPS.items():
        columns = record(LOAD, dip, RECORDER, np.random.default_rng(seed))
        contents = {
            ".csv": table(columns),
            ".json": json.dumps(sidecar(name, seed, dip), indent=2) + "\n",
        }
        for suffix, text in contents.items():
            written.append(folder / f"{name}{suffix}")
            written[-1].write_bytes(text.encode())  # bytes: no line-end conversion
    return written


def main(make: Callable[[Path], list[Path]] = make, about: str = __doc__) -> None:
    """The command of a script that makes shipped records by `make`."""
    parser = argparse.ArgumentParser(description=about.partition("\n")[0])
    home = Path(__file__).resolve().parents[1] / "tractexp" / "data"
    parser.add_argument(
        "--out", type=Path, default=home, help="folder to write to (default: the shipped data)"
    )
    for path in make(parser.parse_args().out):
        print(path)


if __name__ == "__main__":
    main()
