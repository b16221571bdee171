"""Play a dip through a load in ANDES: run by a Python that has it, in a process of its own (ANDES
is GPL-3).

    python _andes_run.py load.json dip.json response.npz

`load.json` holds the load's tables on one bus, as `task=export task.format=andes` writes them;
`dip.json` the source's voltage at each step. Written: t, and at the load's bus U, angle, P and Q of
each device, 100 MVA base; the seconds that the time domain simulation took, and the version of
ANDES. The line is as long for each load, in per unit of it.
"""

import importlib
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

andes: Any = importlib.import_module("andes")  # of which no type checker need know

GRID_MVA = 100.0  # MVA
SOURCE_BUS = -1  # a number that no load's bus has
SOURCE = {
    "Bus": [{"idx": SOURCE_BUS, "name": "source", "Vn": 110.0}],
    "Line": [
        {
            "idx": "line",
            "bus1": SOURCE_BUS,
            "bus2": 1,
            "Vn1": 110.0,
            "Vn2": 110.0,
            "r": 0.002,
            "x": 0.02,
        }
    ],
    "Slack": [{"idx": "G", "bus": SOURCE_BUS, "Sn": 100.0, "Vn": 110.0, "p0": 1.0, "q0": 0.5}],
    "GENCLS": [
        {
            "idx": "M",
            "bus": SOURCE_BUS,
            "gen": "G",
            "Sn": 100.0,
            "Vn": 110.0,
            "M": 1e6,
            "D": 0.0,
            "xd1": 0.01,
        }
    ],
}


def load_case(tables, frequency):
    """The load behind a short line from an infinite source, on the load's own voltage and power."""
    case = {name: [dict(row) for row in rows] for name, rows in SOURCE.items()}
    (bus,), (line,) = tables["Bus"], case["Line"]
    ratings = [row["Sn"] for name in ("Motor3", "Motor5") for row in tables.get(name, ())]
    ratings += [abs(complex(row["p0"], row["q0"])) * GRID_MVA for row in tables.get("PQ", ())]
    line["bus2"], line["Vn1"], line["Vn2"] = bus["idx"], bus["Vn"], bus["Vn"]
    line |= {key: line[key] * min(1.0, GRID_MVA / max(ratings)) for key in ("r", "x")}
    for name in ("Bus", "Slack", "GENCLS"):
        case[name][0]["Vn"] = bus["Vn"]
    for name, rows in tables.items():
        case.setdefault(name, []).extend(rows)
    case["Line"][0]["fn"] = case["GENCLS"][0]["fn"] = frequency
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.json"
        path.write_text(json.dumps(case))
        options = ["Runtime.sparselib=umfpack", f"System.freq={frequency}"]
        return andes.load(str(path), no_output=True, default_config=True, config_option=options)


def start_running(system, motor):
    """Make the power flow start at a running motor: from standstill, ANDES's own guess, a loaded
    one diverges.
    """
    initialize = system.PFlow.init
    guesses = {"slip": 0.02, "e1d": 0.2, "e1q": 0.85, "e2d": 0.2, "e2q": 0.85}
    size = motor.Sn.v / system.config.mva  # currents are per unit of the system
    guesses |= {"Id": 0.5 * size, "Iq": -0.3 * size}

    def evaluate_system():
        initialize()
        for name, value in guesses.items():
            if hasattr(motor, name):
                array = system.dae.x if name in motor.states else system.dae.y
                array[getattr(motor, name).a] = value
        for name in ("te", "tm", "p"):
            system.dae.y[getattr(motor, name).a] = motor.c1.v
        system.vars_to_models()
        return system.dae.xy

    system.PFlow.init = evaluate_system


def play(tables, dip):
    """Time series of the load at a step of `dip['step']` s."""
    system = load_case(tables, dip["frequency"])
    motor = next(
        (getattr(system, name) for name in ("Motor3", "Motor5") if getattr(system, name).n), None
    )
    if motor is not None:
        start_running(system, motor)
    if not system.PFlow.run():
        raise SystemExit("the power flow of ANDES did not converge")
    before, voltage = system.GENCLS.vf0, np.array(dip["voltage"])
    undisturbed = {}

    def follow(t, system):
        undisturbed.setdefault("vf", before.v.copy())
        before.v[:] = undisturbed["vf"] * voltage[min(round(t / dip["step"]), len(voltage) - 1)]

    system.TDS.callpert = follow
    config = system.TDS.config
    config.tf, config.tstep, config.fixt, config.shrinkt = (
        (len(voltage) - 1) * dip["step"],
        dip["step"],
        1,
        0,
    )
    config.no_tqdm, config.tol, config.honest, config.max_iter = 1, 1e-7, 1, 30
    started = time.perf_counter()
    if not system.TDS.run():
        raise SystemExit("the time domain simulation of ANDES did not converge")
    return {"seconds": time.perf_counter() - started} | response(
        system, motor, tables["Bus"][0]["idx"]
    )


def response(system, motor, bus):
    """The response of the load: the motor's own variables, and the static load by its law."""
    series, k = system.dae.ts, list(system.Bus.idx.v).index(bus)
    U, angle = series.y[:, system.Bus.v.a[k]], series.y[:, system.Bus.a.a[k]]
    P, Q = np.zeros_like(U), np.zeros_like(U)
    if motor is not None:
        P, Q = series.y[:, motor.p.a[0]].copy(), series.y[:, motor.q.a[0]].copy()
    if system.FLoad.n:
        law = system.FLoad
        P += law.pv0.v[0] * U ** law.ap.v[0]
        Q += law.qv0.v[0] * U ** law.aq.v[0]
    if system.ZIP.n:
        law = system.ZIP
        P += law.pp0.v[0] + law.pi0.v[0] * U + law.pz0.v[0] * U**2
        Q += law.qp0.v[0] + law.qi0.v[0] * U + law.qz0.v[0] * U**2
    return {
        "version": andes.__version__,
        "t": np.array(series.t),
        "U": U,
        "angle": angle,
        "P": P,
        "Q": Q,
    }


if __name__ == "__main__":
    andes.config_logger(40)
    np.savez(sys.argv[1], allow_pickle=False, **play(*json.load(sys.stdin)))
