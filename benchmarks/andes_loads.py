"""Dips of loads by ANDES, which nobody here wrote: python benchmarks/andes_loads.py --series
calibration --count 40

A set is three dips of one load in Kundur's two-area system: part of the load of bus 7 or 8 becomes
a motor (Motor3, in every eighth set Motor5, the double cage) beside a ZIP load, and faults at the
load's bus or next to it, of drawn depth and length, make the dips. Motor, composition and faults
are drawn by series and number over the ranges of real motors; in every fourth set the motor has no
stator resistance, as the third order assumes. Records are on their own base: P before the fault is
1 pu and U is of nominal. They hold no noise; `noisy` adds it. Motors start in the power flow, so
that rotors are settled before the fault; a set whose motor stalls gets shorter faults, and is
refused where that does not help. ANDES is GPL: benchmarks and tests only. Its first run on a
machine generates code for about 30 s.
"""

import argparse
import itertools
import json
import os
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from zlib import crc32

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import oracle  # noqa: E402, F401

FOLDER = Path(__file__).parents[1] / "outputs" / "andes_loads"
FREQUENCY, SYSTEM, VOLTAGE = 60.0, 100.0, 230.0  # Hz, MVA, kV
OMEGA = 2 * np.pi * FREQUENCY
STEP = 1 / 480  # s, of ANDES: a step of twice this changes the motor's power by 3e-4
# s: the fault in the simulation, what is simulated, and what a record has before
AT, LENGTH, BEFORE = 0.02, 1.6, 0.5
COLUMNS = ("t", "U", "P", "Q", "f", "f_smooth")
# pu of the motor's rating, s: IEEE Task Force 1995 and Kundur 1994, chapter 7, from small to large
# motors
RANGES = {
    "rs": (0.007, 0.03),
    "xs": (0.06, 0.13),
    "xm": (2.2, 4.0),
    "rr1": (0.009, 0.03),
    "xr1": (0.07, 0.18),
    "Hm": (0.4, 1.5),
}
# of Motor5 instead
CAGES = {"rr1": (0.009, 0.02), "xr1": (0.12, 0.25), "rr2": (0.04, 0.1), "xr2": (0.08, 0.15)}
NEAR = {7: (7, 7, 6, 8), 8: (8, 8, 7, 9)}  # buses of the faults by bus of the load
SOURCE = 0.025  # pu of the system's base: about the reactance behind the load's bus
RATES = (240.0, 480.0, 960.0)  # Hz: of the records
DEPTHS, DURATIONS = (0.15, 0.55), (0.06, 0.25)  # of the voltage at once, and s
# of a fault's resistance, its arc, to its reactance: without one the angle jumps by 10 degrees
RATIOS = (0.1, 0.5)
LEVELS = (0.0005, 0.003)  # standard deviation of measurement noise, of P before the fault
STALLED = 0.12  # slip that a motor which recovers does not reach here


class StalledMotor(Exception):
    """No fault that was tried lets the motor of this set recover, or ANDES does not converge."""


@dataclass(frozen=True)
class Load:
    """A motor and a ZIP load on a bus. Powers in pu of 100 MVA; `motor` as ANDES has it, pu of its
    rating.
    """

    kind: str  # "Motor3" or "Motor5"
    bus: int
    motor: dict[str, float]
    static: complex
    shares: dict[str, float]  # a_Z, a_I, b_Z, b_I at the voltage of the power flow


@dataclass(frozen=True)
class Fault:
    """A balanced fault behind an impedance [pu of 100 MVA] for some time [s]."""

    bus: int
    reactance: float
    resistance: float
    duration: float

    @property
    def milder(self) -> "Fault":
        """A shorter one behind more."""
        return Fault(self.bus, 1.5 * self.reactance, 1.5 * self.resistance, 0.6 * self.duration)


@dataclass(frozen=True, eq=False)
class Set:
    """Three dips of one load, columns (N,) of each, and the truth; `train` of them are to be
    fitted, one or two.
    """

    name: str
    dips: list[dict[str, np.ndarray]]
    truth: dict[str, Any] = field(default_factory=dict)

    @property
    def train(self) -> int:
        return int(generator(self.truth["series"], self.truth["number"], "train").integers(1, 3))


def generator(series: str, number: int, what: str = "load") -> np.random.Generator:
    """A stream of its own for each series, number and purpose."""
    return np.random.default_rng([crc32(series.encode()), number, crc32(what.encode())])


def draw_load(rng: np.random.Generator, number: int) -> Load:
    """A load that Eq. (3) gives a steady state well inside its limit."""
    double = number % 8 == 7
    while True:
        ranges = RANGES | CAGES if double else RANGES
        motor = {name: float(rng.uniform(*limits)) for name, limits in ranges.items()}
        if number % 4 == 0:
            motor["rs"] = 1e-6
        power, share, loading = rng.uniform(2, 5), rng.uniform(0.3, 0.65), rng.uniform(0.45, 0.85)
        torque = float(power * share)
        motor |= {
            "Sn": SYSTEM * torque / loading,
            "Vn": VOLTAGE,
            "fn": FREQUENCY,
            "c1": torque,
            "c2": 0.0,
            "c3": 0.0,
        }
        static = complex(power * (1 - share), power * (1 - share) * rng.uniform(0.1, 0.5))
        (a_Z, a_I, _), (b_Z, b_I, _) = rng.dirichlet([2, 2, 1]), rng.dirichlet([4, 2, 1])
        shares = {"a_Z": a_Z, "a_I": a_I, "b_Z": b_Z, "b_I": b_I}
        values = circuit(motor, torque)
        if 2 * values["T_m"] * values["X_prime"] / values["C"] < 0.75 * 0.95**2:
            bus = int(rng.choice([7, 8]))
            return Load(
                "Motor5" if double else "Motor3",
                bus,
                motor,
                static,
                {k: float(v) for k, v in shares.items()},
            )


def draw_faults(rng: np.random.Generator, bus: int, count: int = 3) -> list[Fault]:
    """Faults whose depths are spread over their range."""
    low, high = DEPTHS
    depths = low + (high - low) * (rng.permutation(count) + rng.random(count)) / count
    durations = np.exp(rng.uniform(*np.log(DURATIONS), count))
    reactances, ratios = SOURCE * (1 - depths) / depths, rng.uniform(*RATIOS, count)
    rows = zip(reactances.tolist(), (ratios * reactances).tolist(), durations.tolist(), strict=True)
    return [Fault(int(rng.choice(NEAR[bus])), *row) for row in rows]


def circuit(motor: dict[str, float], power: float) -> dict[str, float]:
    """The motor in the third order's names on a base of `power` [pu of 100 MVA]; T_m is its
    torque's power there.

    Source: Kundur 1994, section 7.2, T-circuit; `Hm` [s] is on the motor's rating. What the second
    cage adds, too.
    """
    scale = power * SYSTEM / motor["Sn"]  # of reactances, to the base from the rating
    behind = motor["xm"] * motor["xr1"] / (motor["xm"] + motor["xr1"])
    X, X_1 = motor["xs"] + motor["xm"], motor["xs"] + behind
    T0 = (motor["xr1"] + motor["xm"]) / (OMEGA * motor["rr1"])
    values = {
        "T_prime": X_1 / X * T0,
        "X_prime": X_1 * scale,
        "C": (X - X_1) / X,
        "M": 2 * motor["Hm"] / OMEGA / scale,
        "T_m": (motor["c1"] + motor["c2"] + motor["c3"]) / power,
        "R_s": motor["rs"] * scale,
    }
    if "rr2" in motor:
        X_2 = motor["xs"] + behind * motor["xr2"] / (behind + motor["xr2"])
        values |= {
            "X_second": X_2 * scale,
            "T_second": X_2 / X_1 * (motor["xr2"] + behind) / (OMEGA * motor["rr2"]),
        }
    return values


def composition(coefficients: dict[str, tuple[float, float, float]], U0: float) -> dict[str, float]:
    """Shares of Z and I, and slopes p_v and q_v, at U0 [pu] of a ZIP load of (power, current,
    impedance) terms.
    """
    values = {}
    for power, letter, slope in (("P", "a", "p_v"), ("Q", "b", "q_v")):
        terms = np.array(coefficients[power]) * [1.0, U0, U0**2]
        _, current, impedance = terms / terms.sum()
        values |= {f"{letter}_Z": float(impedance), f"{letter}_I": float(current)}
        values[slope] = float(2 * impedance + current)
    return values


def system(load: Load, fault: Fault) -> Any:
    """Kundur's system with the load in place of as much of its bus's own, and the fault in wait."""
    import andes
    from andes.utils.paths import get_case

    options = ["Runtime.sparselib=umfpack"]
    case = andes.load(
        get_case("kundur/kundur_full.json"),
        setup=False,
        no_output=True,
        default_config=True,
        config_option=options,
    )
    case.Toggle.u.v[0] = 0  # of a line, in the case as it ships
    own = list(case.PQ.bus.v).index(load.bus)
    case.PQ.p0.v[own] -= load.static.real + load.motor["c1"]
    case.PQ.q0.v[own] -= load.static.imag + 0.5 * load.motor["c1"]
    pq = {
        "idx": "static",
        "bus": load.bus,
        "Vn": VOLTAGE,
        "p0": load.static.real,
        "q0": load.static.imag,
    }
    case.add("PQ", pq)
    s = load.shares
    percentages = {"kpz": s["a_Z"], "kpi": s["a_I"], "kqz": s["b_Z"], "kqi": s["b_I"]}
    percentages |= {"kpp": 1 - s["a_Z"] - s["a_I"], "kqp": 1 - s["b_Z"] - s["b_I"]}
    case.add(
        "ZIP",
        {
            "idx": "law",
            "pq": "static",
            **{name: 100 * share for name, share in percentages.items()},
        },
    )
    case.add(load.kind, {"idx": "motor", "bus": load.bus, **load.motor})
    impedance = {"xf": fault.reactance, "rf": fault.resistance}
    case.add("Fault", {"bus": fault.bus, "tf": AT, "tc": AT + fault.duration, **impedance})
    case.setup()
    return case


def simulate(load: Load, fault: Fault) -> dict[str, np.ndarray]:
    """Time series of the load as ANDES steps: t [s], U, P, Q, motor's P and slip [pu of 100 MVA],
    angle [rad].

    The static load's terms (power, current, impedance) are beside them. RuntimeError where ANDES
    does not converge.
    """
    from tractexp_plugins.formats._andes_run import start_running

    case = system(load, fault)
    motor = getattr(case, load.kind)
    start_running(case, motor)
    case.PFlow.config.tol, case.PFlow.config.max_iter = 1e-10, 60
    if not case.PFlow.run():
        raise RuntimeError("the power flow of ANDES did not converge")
    config = case.TDS.config
    config.tf, config.tstep, config.fixt, config.shrinkt = AT + LENGTH, STEP, 1, 0
    config.no_tqdm, config.tol, config.max_iter, config.criteria = 1, 1e-7, 30, 0
    if not case.TDS.run():
        raise RuntimeError("the time domain simulation of ANDES did not converge")
    return series_of(case, motor, load.bus)


def series_of(case: Any, motor: Any, bus: int) -> dict[str, np.ndarray]:
    """What the load's bus saw and the load drew: the motor's own variables, and the static load by
    its law.
    """
    history, k = case.dae.ts, list(case.Bus.idx.v).index(bus)
    U, angle = history.y[:, case.Bus.v.a[k]], history.y[:, case.Bus.a.a[k]]
    law = case.ZIP
    active = tuple(float(term.v[0]) for term in (law.pp0, law.pi0, law.pz0))
    reactive = tuple(float(term.v[0]) for term in (law.qp0, law.qi0, law.qz0))
    p, q = history.y[:, motor.p.a[0]], history.y[:, motor.q.a[0]]
    P, Q = (
        own + terms[0] + terms[1] * U + terms[2] * U**2
        for own, terms in ((p, active), (q, reactive))
    )
    slip = history.x[:, motor.slip.a[0]]
    rows = {
        "t": np.array(history.t),
        "U": U,
        "P": P,
        "Q": Q,
        "motor": p,
        "slip": slip,
        "angle": np.unwrap(angle),
    }
    return rows | {"static_P": np.array(active), "static_Q": np.array(reactive)}


def record(
    rows: dict[str, np.ndarray], fault: Fault, rate: float, offset: float
) -> dict[str, np.ndarray]:
    """Columns (N,) at `rate` [Hz], the fault `offset` [s] after a sample and at t = 0; P0 is 1.

    Samples are the values at their instants: those before, in and after the fault are interpolated
    apart. `f` is the slope of the voltage's angle, jumps and all, over two steps; `f_smooth` leaves
    the jumps of the angle out.
    """
    step = 1 / rate
    count = round(BEFORE * rate)
    t = step * np.arange(-count, int((LENGTH - 0.01) * rate) - 1) - offset
    at = AT + t
    instants = AT, AT + fault.duration
    columns = {
        name: between(rows["t"], rows[name], at, instants) for name in ("U", "P", "Q", "angle")
    }
    jumps = angle_jumps(rows, instants)
    still = columns["angle"] - sum(
        size * (at > instant) for size, instant in zip(jumps, instants, strict=True)
    )
    hertz = lambda angle: FREQUENCY + np.gradient(angle, step) / (2 * np.pi)  # noqa: E731
    P0 = rows["P"][0]
    P, Q = columns["P"] / P0, columns["Q"] / P0
    return {
        "t": t,
        "U": columns["U"],
        "P": P,
        "Q": Q,
        "f": hertz(columns["angle"]),
        "f_smooth": hertz(still),
    }


def between(
    t: np.ndarray, values: np.ndarray, at: np.ndarray, instants: tuple[float, float]
) -> np.ndarray:
    """Values at the times `at` by splines that end at the instants; what is before the first row is
    as the first row.

    ANDES stores a row right at an instant, which still has the state before it.
    """
    from scipy.interpolate import CubicSpline

    result = np.empty_like(at)
    edges = (-np.inf, *instants, np.inf)
    for low, high in itertools.pairwise(edges):
        rows, here = (t > low + 1e-9) & (t <= high + 1e-9), (at > low) & (at <= high)
        inside = np.clip(at[here], t[rows][0], t[rows][-1])
        result[here] = CubicSpline(t[rows], values[rows])(inside)
    return result


def angle_jumps(rows: dict[str, np.ndarray], instants: tuple[float, float]) -> list[float]:
    """By how much the angle of the voltage jumps at each instant [rad]."""
    last = [int(np.searchsorted(rows["t"], instant + 1e-9)) - 1 for instant in instants]
    return [float(rows["angle"][k + 1] - rows["angle"][k]) for k in last]


def is_recovery(rows: dict[str, np.ndarray]) -> bool:
    """Whether the motor came through: a stalled one, or one that crawls at the end, did not."""
    slip = rows["slip"]
    return bool(
        slip.max() < STALLED
        and slip[-1] < 1.5 * slip[0] + 0.005
        and rows["U"][-1] > 0.9 * rows["U"][0]
    )


def survivable(load: Load, fault: Fault) -> tuple[Fault, dict[str, np.ndarray]]:
    """The fault, shorter where the motor would stall, and its time series; `StalledMotor` where
    nothing helps.
    """
    for _ in range(3):
        rows = simulate(load, fault)
        if is_recovery(rows):
            return fault, rows
        fault = fault.milder
    raise StalledMotor(
        f"the motor stalls even in a fault of {fault.duration:.3g} s behind {fault.reactance:.3g}"
        " pu"
    )


def make(series: str, number: int) -> Set:
    """One set of a series. `StalledMotor` or RuntimeError where this load has none."""
    rng = generator(series, number)
    load = draw_load(rng, number)
    rate = float(rng.choice(RATES))
    dips, faults, jumps = [], [], []
    for draw in draw_faults(rng, load.bus):
        fault, rows = survivable(load, draw)
        dips.append(record(rows, fault, rate, float(rng.uniform(0, 1 / rate))))
        faults.append(asdict(fault))
        jumps.append(np.degrees(angle_jumps(rows, (AT, AT + fault.duration))).tolist())
    P0 = float(rows["P"][0])
    truth = {name: value for name, value in circuit(load.motor, P0).items()} | {
        "T_m": float(rows["motor"][0]) / P0
    }
    truth |= composition(
        {"P": tuple(rows["static_P"]), "Q": tuple(rows["static_Q"])}, float(rows["U"][0])
    )
    description = {
        "series": series,
        "number": number,
        "kind": load.kind,
        "bus": load.bus,
        "rate": rate,
        "motor": load.motor,
        "power": P0 * SYSTEM,
        "U0": float(rows["U"][0]),
        "slip": float(rows["slip"][0]),
        "faults": faults,
        "jumps": jumps,
        "depths": [float(1 - d["U"].min() / d["U"][0]) for d in dips],
        "parameters": truth,
    }
    return Set(f"{series} {number}", dips, truth=description)


def set_of(series: str, number: int, folder: Path = FOLDER) -> Set:
    """A set of the folder, made there where it is absent. `StalledMotor` where there is none, with
    the reason.
    """
    place = folder / series / f"{number:03d}"
    if not (place / "truth.json").exists():
        write(series, number, place)
    truth = json.loads((place / "truth.json").read_text(encoding="utf-8"))
    if "refused" in truth:
        raise StalledMotor(truth["refused"])
    dips = [
        dict(
            zip(
                COLUMNS, np.loadtxt(place / f"dip{k}.csv", delimiter=",", skiprows=1).T, strict=True
            )
        )
        for k in (1, 2, 3)
    ]
    return Set(f"{series} {number}", dips, truth)


def write(series: str, number: int, place: Path) -> None:
    """Make a set and write dip1.csv, dip2.csv, dip3.csv and, last, truth.json; of a refused one the
    reason.
    """
    place.mkdir(parents=True, exist_ok=True)
    try:
        dips, truth = (one := make(series, number)).dips, one.truth
    except (StalledMotor, RuntimeError) as error:
        dips, truth = [], {"refused": str(error)}
    for k, dip in enumerate(dips, 1):
        rows = np.column_stack([dip[name] for name in COLUMNS])
        np.savetxt(place / f"dip{k}.csv", rows, "%.9g", ",", header=",".join(COLUMNS), comments="")
    (place / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


def noisy(
    dips: list[dict[str, np.ndarray]], rng: np.random.Generator
) -> tuple[list[dict[str, np.ndarray]], float]:
    """The dips with noise on P and Q, white or of a first-order autoregression, and its standard
    deviation [pu].
    """
    from hidden_effects.noise import Noise

    level, phi = float(np.exp(rng.uniform(*np.log(LEVELS)))), float(rng.choice([0.0, 0.5]))
    return [Noise(level, phi=phi).add(dip, rng) for dip in dips], level


def events(dips: list[dict[str, np.ndarray]], name: str = "dip", jumps: bool = True) -> list:
    """The product's events. `jumps`: whether the frequency has what the angle jumps, or a recorder
    left that out.
    """
    import tractexp

    return [
        tractexp.read(
            t=dip["t"],
            U=dip["U"],
            P=dip["P"],
            Q=dip["Q"],
            f=dip["f" if jumps else "f_smooth"],
            name=f"{name} {k}",
            frequency=FREQUENCY,
        )[0]
        for k, dip in enumerate(dips, 1)
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--series", default="calibration")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--folder", type=Path, default=FOLDER)
    options = parser.parse_args()
    for number in range(options.count):
        start = time.perf_counter()
        try:
            truth = set_of(options.series, number, options.folder).truth
            values = ", ".join(f"{name} {value:.4g}" for name, value in truth["parameters"].items())
            depths = " ".join(f"{depth:.0%}" for depth in truth["depths"])
            line = f"{truth['kind']} at {truth['rate']:.0f} Hz, dips of {depths}: {values}"
        except StalledMotor as error:
            line = f"refused: {error}"
        print(f"{number}: {line} ({time.perf_counter() - start:.1f} s)", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
