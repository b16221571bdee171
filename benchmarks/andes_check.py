"""Our motors and exports against ANDES, which nobody here wrote (GPL: tests and benchmarks only).
Run: see --help.

ANDES simulates a dip; our model is driven by ANDES's terminal voltage (magnitude, and speed of its
angle) and must draw ANDES's P and Q. ANDES is found in this interpreter or in the one named by
TRACTEXP_ANDES_PYTHON. Its first run on a machine generates code for about 30 s into a folder of the
user's, so that one runs at a time.
"""

import argparse
import importlib.util
import json
import os
import sys

import numpy as np

from tractexp.configuration.plugin import build, get
from tractexp.exchange.format import Identified
from tractexp.identification.result import Result
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose
from tractexp_plugins.formats.andes import respond

CAGES = {
    "rs": 1e-6,
    "xs": 0.1,
    "xm": 3.0,
    "rr1": 0.02,
    "xr1": 0.12,
    "Hm": 0.9,
    "c1": 0.5,
    "c2": 0.0,
    "c3": 0.0,
}
MOTORS = {
    "Motor3": ("electromechanical", CAGES),
    "Motor5": ("double_cage", CAGES | {"rr2": 0.1, "xr2": 0.2}),
}
EXPORTS = {
    "electromechanical": {"T_prime": 0.09, "X_prime": 0.3, "C": 0.88, "M": 0.005, "T_m": 0.5},
    "double_cage": {
        "T_prime": 0.09,
        "X_prime": 0.3,
        "C": 0.88,
        "M": 0.005,
        "T_m": 0.5,
        "T_second": 0.008,
        "X_second": 0.2,
    },
}
STATICS = {
    "exponential": {"p_v": 1.4, "q_v": 2.6},
    "zip": {"a_Z": 0.4, "a_I": 0.3, "b_Z": 0.6, "b_I": 0.3},
    "constant_impedance": {},
}
FREQUENCY = 50.0
OMEGA = 2 * np.pi * FREQUENCY


def interpreter() -> str | None:
    """A Python that has ANDES, or None."""
    if importlib.util.find_spec("andes"):
        return sys.executable
    return os.environ.get("TRACTEXP_ANDES_PYTHON")


def dip(step: float, length: float = 1.2, depth: float = 0.4) -> np.ndarray:
    """The source's voltage at each step [pu of its value before]."""
    t = np.arange(round(length / step) + 1) * step
    fallen, back = (0.5 - 0.5 * np.cos(np.pi * np.clip((t - at) / 0.05, 0, 1)) for at in (0.2, 0.4))
    return 1 - depth * (fallen - back)


def andes(tables: dict, voltage: np.ndarray, step: float) -> dict[str, np.ndarray]:
    """Response of a load's tables in ANDES (see plugins/formats/_andes_run.py)."""
    python = interpreter()
    if python is None:
        raise SystemExit(
            "ANDES is not installed here; name a Python that has it in TRACTEXP_ANDES_PYTHON"
        )
    told = {"step": step, "frequency": FREQUENCY, "voltage": voltage.tolist()}
    return respond(python, json.dumps(tables), told)


def ours(model, parameters: dict, theirs: dict, step: float) -> tuple[np.ndarray, np.ndarray]:
    """P and Q of our model at ANDES's terminal voltage; the static load draws what ANDES's does
    before the dip.
    """
    U, P, Q = theirs["U"], theirs["P"], theirs["Q"]
    speed = np.gradient(theirs["angle"], step, edge_order=2)
    drive = Drive.from_events([Excitation(step, U, P, Q, U[0], P[0], Q[0], speed, 0.0, OMEGA)])
    response = model.simulate(drive, np.array([parameters[name] for name in model.names]), 8)
    return response.P[0], response.Q[0]


def differences(theirs: dict, mine: tuple[np.ndarray, np.ndarray]) -> dict[str, float]:
    """Largest difference of P and Q [pu], and how far they moved."""
    gaps = {
        power: float(np.abs(theirs[power] - own).max())
        for power, own in zip("PQ", mine, strict=True)
    }
    return gaps | {f"swing_{power}": float(np.ptp(theirs[power])) for power in "PQ"}


def cross_check(kind: str, step: float) -> dict[str, float]:
    """Motor3 or Motor5 against our model of its T-circuit, reactances and time constants by the
    textbook.
    """
    name, c = MOTORS[kind]
    X, X_1 = c["xs"] + c["xm"], c["xs"] + c["xm"] * c["xr1"] / (c["xm"] + c["xr1"])
    T0 = (c["xr1"] + c["xm"]) / (OMEGA * c["rr1"])
    parameters = {
        "T_prime": X_1 / X * T0,
        "X_prime": X_1,
        "C": (X - X_1) / X,
        "M": 2 * c["Hm"] / OMEGA,
        "T_m": c["c1"],
    }
    if kind == "Motor5":
        behind = c["xm"] * c["xr1"] / (c["xm"] + c["xr1"])
        X_2 = c["xs"] + behind * c["xr2"] / (behind + c["xr2"])
        T0_2 = (c["xr2"] + behind) / (OMEGA * c["rr2"])
        parameters |= {"X_second": X_2, "T_second": X_2 / X_1 * T0_2}
    row = {"idx": "motor", "bus": 1, "Sn": 100.0, "Vn": 110.0, "fn": FREQUENCY, **c}
    theirs = andes({"Bus": [{"idx": 1, "name": "load", "Vn": 110.0}], kind: [row]}, dip(step), step)
    model = compose(get("model/motor", name)(), get("model/static", "none")())
    return differences(theirs, ours(model, parameters, theirs, step))


def round_trip(motor: str, static: str, step: float) -> dict[str, float]:
    """An identified load, exported to ANDES and simulated there, against our own
    simulation of it.
    """
    parameters = EXPORTS[motor] | STATICS[static]
    before = {"U0": 1.0, "P0": 1.0, "Q0": 0.6, "frequency": FREQUENCY}
    settings = {"motor": {"name": motor}, "static": {"name": static}, "effects": []}
    load = Identified(result(parameters, settings, before))
    theirs = andes(json.loads(build("format", {"name": "andes"}).text(load)), dip(step), step)
    return differences(theirs, ours(load.model, parameters, theirs, step))


def result(parameters: dict, model: dict, before: dict) -> Result:
    """A result as an identification would leave it, of known values."""
    unknown = {
        "objective": 0.0,
        "epsilon_p": 0.0,
        "epsilon_q": 0.0,
        "seconds": 0.0,
        "status": "known",
        "seed": 0,
    }
    counts = {
        "simulations": 0,
        "refused": 0,
        "iterations": 0,
        "events": [],
        "at_bound": [],
        "units": {},
        "bounds": {},
    }
    return Result(parameters=parameters, model=model, before=before, **unknown, **counts)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON only")
    parser.add_argument("--step", type=float, default=1e-3, help="of ANDES, s")
    chosen = parser.parse_args()
    figures = {kind: cross_check(kind, chosen.step) for kind in MOTORS}
    for motor in EXPORTS:
        for static in STATICS:
            figures[f"round trip of {motor}, {static}"] = round_trip(motor, static, chosen.step)
    if not chosen.json:
        print(
            f"largest difference to ANDES along a dip, ANDES's step {1e3 * chosen.step:g} ms [pu]\n"
        )
        for name, row in figures.items():
            print(
                f"{name:<52} P {row['P']:.1e} of {row['swing_P']:.2f}   Q {row['Q']:.1e} of"
                f" {row['swing_Q']:.2f}"
            )
        print()
    print(json.dumps({"step": chosen.step, "differences": figures}, indent=2))


if __name__ == "__main__":
    main()
