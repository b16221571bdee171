"""What the kernels compiled by Numba gave for every model of the catalogue: made once, and kept as
a test.

    python benchmarks/kernel_reference.py --make [--processes 2]
        with the commit whose kernels are the reference
    python benchmarks/kernel_reference.py
        how far today's kernels are from it

Each case is a model by names, 57 candidates (usual ones, ones from all of the bounds, ones far
outside) and two events with gaps. Kept are each candidate's sums of squared errors and misses, and
the responses of four at some samples. The 22 cases with a relay and the two with a compensator were
made again when their laws changed: by Numba's kernels, with the new plugin in that commit.
"""

import argparse
import json
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from tractexp.configuration.plugin import discover, get
from tractexp.discrepancy.proposal.effect import Library
from tractexp.errors import UserError
from tractexp.inference.injection import Injection
from tractexp.model.drive import PHASORS, WAVES, Drive, Excitation, WaveformDrive
from tractexp.model.model import Model, compose
from tractexp.parameter import Parameter

FILE = Path(__file__).parents[1] / "tests" / "model" / "kernel_reference.npz"
# candidates; those whose responses are kept, of which each such sample
LANES, SHOWN, EVERY = 57, (0, 7, 30, 56), 5
BASE = {PHASORS: ("electromechanical", "exponential"), WAVES: ("stator_flux", "branch")}
SUBSTEPS = {PHASORS: (2, 3), WAVES: (4, 2)}
PAIRS = (
    ("speed_dependent_torque", "magnetic_saturation"),
    ("undervoltage_trip", "second_motor_group"),
    ("feeder_impedance", "second_motor_group"),
    ("stator_resistance", "exponential_recovery"),
    ("time_skew", "undervoltage_trip"),
    ("measurement_window", "load_change"),
)
SEVEN = (
    "exponential_recovery",
    "feeder_impedance",
    "magnetic_saturation",
    "second_motor_group",
    "shunt_capacitor",
    "speed_dependent_torque",
    "undervoltage_trip",
)
LIBRARIES = ("answer", "timed")
OMEGA = 2 * np.pi * 50.0


def cases() -> Iterator[dict[str, Any]]:
    """Every model by the names of its parts; not all of them compose."""
    known = discover()
    for domain, (motor, static) in BASE.items():
        for m in sorted(known["model/motor"]):
            for s in sorted(known["model/static"]):
                if (
                    m == motor
                    or s == static
                    or (m in ("double_cage", "mechanical") and s in ("zip", "none"))
                ):
                    yield case(domain, m, s)
        for name in sorted(known["effect"]):
            # fits more harmonics than these samples tell apart: rounding, magnified
            if name != "harmonics_source":
                yield case(domain, motor, static, name)
        for names in (*PAIRS, SEVEN, ("injection",), *((f"library {kind}",) for kind in LIBRARIES)):
            yield case(domain, motor, static, *names)
        yield case(domain, "double_cage", static, "undervoltage_trip", "second_motor_group")
        yield case(domain, motor, static, integration="printed")
        yield case(domain, motor, static, "undervoltage_trip", integration="printed")


def case(
    domain: str, motor: str, static: str, *effects: str, integration: str = "classical"
) -> dict[str, Any]:
    return {
        "domain": domain,
        "motor": motor,
        "static": static,
        "effects": effects,
        "integration": integration,
    }


def model(of: dict[str, Any]) -> Model:
    """The model of a case. Raises `UserError` where its parts do not compose."""
    effects = [_effect(name) for name in of["effects"]]
    parts = get("model/motor", of["motor"])(), get("model/static", of["static"])()
    return compose(*parts, effects, of["integration"], of["domain"])


def _effect(name: str) -> Any:
    if name == "injection":
        return Injection()
    kind = name.removeprefix("library ")
    return Library(kind) if kind != name else get("effect", name)()


def drive(domain: str) -> Drive:
    """Two events: a deep dip and a shallow one that begins elsewhere."""
    if domain == WAVES:
        return Drive.from_events([waves(0.4, 0.05, 1.0, 0.10), waves(0.2, 0.0, 0.97, 0.06)])
    return Drive.from_events(
        [phasors(0.45, 5e-3, 60, 1.0, 0.0), phasors(0.2, 10e-3, 45, 0.98, -0.5)]
    )


def phasors(depth: float, step: float, samples: int, U0: float, speed: float) -> Excitation:
    t = np.arange(samples) * step
    shape = np.clip((t - 0.05) / 0.02, 0, 1) - np.clip((t - 0.17) / 0.03, 0, 1)
    P, Q = 1 - 0.6 * shape + 0.05 * np.sin(40 * t), 0.6 - 0.4 * shape
    P[12:19] = Q[9:40:7] = np.nan
    return Excitation(
        step,
        U0 * (1 - depth * shape),
        P,
        Q,
        U0,
        1.0,
        0.6,
        speed - 1.5 * shape,
        speed,
        U2=0.01 + 0.03 * shape,
        U20=0.01,
    )


def waves(depth: float, negative: float, U0: float, length: float) -> WaveformDrive:
    t = np.arange(round(length * 1200)) / 1200 - 0.02
    shape = np.clip(t / 0.004, 0, 1) - np.clip((t - 0.05) / 0.004, 0, 1)
    v = U0 * (1 - depth * shape) * np.exp(0.1j * shape) + negative * shape * np.exp(-2j * OMEGA * t)
    turn = np.exp(1j * OMEGA * t)
    currents = np.stack([turn.real * (1 - 0.3 * shape), turn.imag, 0.02 * shape])
    currents[0, 8:12] = np.nan
    return WaveformDrive(
        step=1 / 1200,
        v=v,
        v_zero=0.03 * shape * np.sin(OMEGA * t),
        turn=turn,
        currents=currents,
        U=np.abs(v),
        U2=negative * shape,
        U0=U0,
        P0=1.0,
        Q0=0.6,
        omega_s0=0.0,
        omega_n=OMEGA,
    )


def candidates(of: Model, name: str) -> np.ndarray:
    """57 candidates (57, d), exact in single precision: 25 usual ones, 20 from all of the bounds,
    12 far outside.
    """
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    low, high = np.array([p.bounds for p in of.parameters]).T
    centre = np.array([_usual(p) for p in of.parameters])
    near = np.clip(centre * rng.uniform(0.85, 1.15, (25, len(centre))), low, high)
    near[0] = centre
    anywhere = rng.uniform(low, high, (20, len(centre)))
    strange = centre * 10.0 ** rng.uniform(-2.0, 1.0, (12, len(centre)))
    return np.concatenate([near, anywhere, strange]).astype(np.float32).astype(float)


def _usual(p: Parameter) -> float:
    """Its default, of a size a third of the way from its null to the farther bound."""
    if p.null is None:
        return p.default
    return p.null + (max(p.bounds, key=lambda bound: abs(bound - p.null)) - p.null) / 3


def played(of: Model, values: np.ndarray, shown: bool = True) -> dict[str, np.ndarray]:
    """What the kernel gives: sums (E, C, n), miss (E, n), and, if `shown`, outputs (C, 4, some) of
    a few candidates.
    """
    driven, substeps = (
        drive(of.domain),
        np.array(SUBSTEPS[of.domain] if of.integration == "classical" else (1, 1)),
    )
    with np.errstate(all="ignore"):
        errors, response = (
            of.errors(driven, values, substeps),
            of.simulate(driven, values, substeps),
        )
    outputs = {"outputs": response.outputs[:, SHOWN, ::EVERY]} if shown else {}
    return {"sums": errors.sums, "miss": response.miss, **outputs}


def _made(of: dict[str, Any]) -> tuple[dict[str, Any], dict[str, np.ndarray]] | None:
    try:
        load = model(of)
        _ = load.equations
    except UserError:
        return None
    values = candidates(load, json.dumps(of))
    return of, {"values": values.astype(np.float32), **played(load, values)}


def make(processes: int) -> None:
    every = [*cases()]
    rows = Parallel(n_jobs=processes, batch_size=1, verbose=5)(delayed(_made)(of) for of in every)
    kept = [row for row in rows if row is not None]
    arrays = {
        f"{k}_{name}": array for k, (_, own) in enumerate(kept) for name, array in own.items()
    }
    np.savez_compressed(FILE, cases=np.array(json.dumps([of for of, _ in kept])), **arrays)
    print(f"{len(kept)} of {len(every)} cases compose; {FILE.stat().st_size / 1e6:.2f} MB")


def stored() -> Iterator[tuple[dict[str, Any], dict[str, np.ndarray]]]:
    """Each case with its candidates and what the reference gave."""
    with np.load(FILE) as kept:
        for k, of in enumerate(json.loads(str(kept["cases"]))):
            yield of, {name: kept[f"{k}_{name}"] for name in ("values", "sums", "miss", "outputs")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--make", action="store_true")
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args()
    if chosen.make:
        make(chosen.processes)
        return
    for of, before in stored():
        now = played(model(of), before["values"].astype(float))
        with np.errstate(all="ignore"):
            off = np.abs(now["sums"] / before["sums"] - 1)[:, :, :25]
        print(f"{np.nanmax(off):10.1e}  {' '.join(map(str, of.values()))}")


if __name__ == "__main__":
    main()
