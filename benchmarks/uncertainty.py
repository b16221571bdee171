"""Are the intervals and verdicts true? python benchmarks/uncertainty.py [--records 40] [--part NAME
...] [--tables]

Records of known truth come from the printed, polar Eqs. (1)-(3) solved by SciPy (`printed`), never
from `tractexp.model`, and from the flux-state simulator in `independent`, whose truth lies outside
the model class. Each record is read, searched and judged as `task=identify` does it. Rows are
stored in uncertainty.jsonl record by record, so that an interrupted study goes on where it stopped;
docs/coverage.md has its table from there.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import marked
import numpy as np
import oracle  # noqa: F401
from model_error import rows_of, six_digits

STORED = Path(__file__).with_suffix(".jsonl")
PAGE = Path(__file__).parents[1] / "docs" / "coverage.md"
NAMES = ("T_prime", "X_prime", "C", "M", "T_m", "p_v", "q_v")
LOW = np.array([0.04, 0.2, 0.7, 0.003, 0.3, 0.8, 2.6])  # truths are drawn between these
HIGH = np.array([0.15, 0.5, 0.92, 0.010, 0.6, 2.0, 5.0])
STATIC_Q = (0.2, 0.5)  # pu: reactive power of the static part, without which q_v would mean nothing
CONDITIONS = {
    "white 0.2 %": (0.002, 0.0),
    "white 2 %": (0.02, 0.0),
    "AR(1) 0.2 %": (0.002, 0.7),
    "AR(1) 2 %": (0.02, 0.7),
}


@dataclass(frozen=True)
class Shape:
    """A dip whose edges are raised cosines, so that samples of it say what lies between them."""

    depth: float
    duration: float = 0.2
    step: float = 2e-3
    length: float = 2.0
    start: float = 0.3
    edge: float = 0.05

    def voltage(self) -> tuple[np.ndarray, np.ndarray]:
        t = np.arange(round(self.length / self.step)) * self.step
        ramps = (
            np.clip((t - s) / self.edge, 0, 1) for s in (self.start, self.start + self.duration)
        )
        fall, back = (0.5 - 0.5 * np.cos(np.pi * ramp) for ramp in ramps)
        return t, 1 - self.depth * (fall - back)


def printed(
    truth: np.ndarray, t: np.ndarray, U: np.ndarray, Q_s0: float, P0: float = 1.0
) -> np.ndarray:
    """P and Q (2, N) of Eqs. (1)-(7) as printed, E', delta and omega, by SciPy's DOP853; U by a
    cubic spline.
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicSpline

    voltage = CubicSpline(t, U)
    T_prime, X_prime, C, M, T_m, p_v, q_v = map(float, truth)
    U0 = float(U[0])
    delta = 0.5 * np.arcsin(-2 * T_m * X_prime / (C * U0**2))  # Eq. (3)
    E = C * U0 * np.cos(delta)
    omega = C * U0 * np.sin(delta) / (T_prime * E)  # relative to synchronous

    def slope(now, y):
        u = float(voltage(now))
        E, delta, omega = y
        return [
            (-E + C * u * np.cos(delta)) / T_prime,
            -C * u * np.sin(delta) / (T_prime * E) + omega,
            (-u * E * np.sin(delta) / X_prime - T_m) / M,
        ]

    begin = [E, delta, omega]
    solved = solve_ivp(
        slope, (t[0], t[-1]), begin, "DOP853", t, rtol=1e-9, atol=1e-11, max_step=0.005
    )
    E, delta, _ = solved.y
    P_d, Q_d = -U * E * np.sin(delta) / X_prime, (U**2 - U * E * np.cos(delta)) / X_prime  # Eq. (2)
    P_s = (P0 - P_d[0]) * (U / U0) ** p_v  # Eq. (6)
    Q_s = Q_s0 * (U / U0) ** q_v
    return np.array([P_d + P_s, Q_d + Q_s])


def noise(
    rng: np.random.Generator, samples: int, deviation: float, correlation: float
) -> np.ndarray:
    """Stationary AR(1) noise (2, samples) of this standard deviation."""
    from scipy.signal import lfilter

    shocks = rng.standard_normal((2, samples)) * np.sqrt(1 - correlation**2)
    shocks[:, 0] /= np.sqrt(1 - correlation**2)
    return deviation * lfilter([1.0], [1.0, -correlation], shocks)


def draw(rng: np.random.Generator) -> np.ndarray:
    """A truth with a steady state well inside Eq. (3), so that the motor is not about to stall."""
    while True:
        truth = rng.uniform(LOW, HIGH)
        if 2 * truth[4] * truth[1] / truth[2] < 0.8:
            return truth


def event(t: np.ndarray, U: np.ndarray, power: np.ndarray, name: str = "synthetic"):
    """The product's event of a synthetic record."""
    from tractexp.record import Record, detect

    return detect(Record(name, t, U, power[0], power[1]))


def model():
    from tractexp.configuration.plugin import get
    from tractexp.model.model import compose

    return compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())


def identified(load, events, seed: int = 0, starts: int = 3, bounds: dict | None = None):
    """Search and judgement as in `task=identify`: the values of Eq. (8), and the `Uncertainty`."""
    from tractexp.configuration.plugin import get
    from tractexp.identification.profile import check_by_profiles
    from tractexp.identification.search import search
    from tractexp.inference.problem import Problem

    problem = Problem(load, events, bounds)
    optimizer = get("optimizer", "multistart_least_squares")(starts=starts)
    found = search(problem, optimizer, seed)
    return found, check_by_profiles(judged(problem, found.values).uncertainty)


def judged(problem, values):
    """The estimate for a search that ended at free values (d,), as `task=identify` makes it (an
    `Estimated`).
    """
    from tractexp.identification.estimate import estimate

    return estimate(problem, values)


def bound(load, events, truth: np.ndarray, deviation: float, correlation: float):
    """Cramér-Rao: the information at the truth under the noise that was really added, P0 and Q0
    unknown.
    """
    from tractexp.inference.information import Information
    from tractexp.inference.likelihood import Likelihood
    from tractexp.inference.problem import Problem
    from tractexp.noise import Autoregression, Noise

    shock = deviation * np.sqrt(1 - correlation**2)
    true = Autoregression(np.array([[0.0], [correlation]]), np.array([deviation, shock]))
    problem = Problem(load, events)
    likelihood = Likelihood.from_problem(problem, Noise(((true, true),)))
    unit = likelihood.to_unit(truth)[0]
    _, J = likelihood.jacobian(unit)
    return Information(tuple(NAMES), truth, problem.upper - problem.lower, J.without_own)


def coverage_record(seed: int, only: Sequence[str] = tuple(CONDITIONS)) -> dict:
    """One truth and one dip under each condition: estimates, errors and intervals; of `only` these
    conditions.

    Noise is drawn for every condition, so that a row is the same whatever is asked for beside it.
    """
    rng = np.random.default_rng([11, seed])
    load, truth = model(), draw(rng)
    t, U = Shape(rng.uniform(0.4, 0.65), rng.uniform(0.12, 0.25)).voltage()
    clean = printed(truth, t, U, rng.uniform(*STATIC_Q))
    rows = {}
    for label, (deviation, correlation) in CONDITIONS.items():
        events = [event(t, U, clean + noise(rng, len(t), deviation, correlation))]
        if label not in only:
            continue
        limit = bound(load, events, truth, deviation, correlation).standard_errors
        found, known = identified(load, events, seed)
        rows[label] = {
            "eq8": ((found.values - truth) / limit).tolist(),
            "likely": ((known.values - truth) / limit).tolist(),
            "curvature": (np.abs(known.values - truth) <= known.half).tolist(),
            "inside": (
                (known.intervals[:, 0] <= truth) & (truth <= known.intervals[:, 1])
            ).tolist(),
            "relative": (1.96 * limit / truth).tolist(),
            "words": [v.word for v in known.verdicts.values()],
            "notes": int(not known.exact),  # more than noise is left
        }
    return rows


TYPICAL = np.array([0.08, 0.35, 0.85, 0.006, 0.4, 1.4, 3.6])
SHALLOW, DEEP = (0.15,), (0.5,)
IDENTIFIED, WEAK, UNIDENTIFIED, BOUND = (
    "identified",
    "weakly identified",
    "not identifiable from this record",
    "at its bound",
)


@dataclass(frozen=True)
class Case:
    """Records whose verdicts are known by construction, and why."""

    why: str
    depths: tuple[float, ...]
    deviation: float
    expected: dict[str, str]
    P0: float = 1.0
    bounds: dict | None = None
    motor: str = ""


CASES = {
    "one deep dip": Case(
        "noise of 0.2 % on a dip of 50 %", DEEP, 0.002, dict.fromkeys(NAMES, IDENTIFIED)
    ),
    "one shallow dip": Case(
        "C trades against q_v and X'",
        SHALLOW,
        0.01,
        {"C": WEAK, **dict.fromkeys(("M", "T_m", "p_v"), IDENTIFIED)},
    ),
    "three dips": Case(
        "the same noise, with dips of 30 % and 50 % beside it",
        (*SHALLOW, 0.3, 0.5),
        0.01,
        dict.fromkeys(("C", "M", "T_m", "p_v"), IDENTIFIED),
    ),
    "no static P": Case(
        "the motor draws all of P, so p_v has no meaning",
        DEEP,
        0.002,
        {"p_v": UNIDENTIFIED, "M": IDENTIFIED},
        P0=0.4,
    ),
    "bound below the truth": Case(
        "M is 0.006 and its bound 0.005", DEEP, 0.002, {"M": BOUND}, bounds={"M": [0.001, 0.005]}
    ),
    "T-circuit": Case(
        "four numbers for three observables",
        DEEP,
        0.002,
        {
            **dict.fromkeys(("X_s", "X_m", "X_r", "R_r"), UNIDENTIFIED),
            **dict.fromkeys(("M", "T_m", "p_v"), IDENTIFIED),
        },
        motor="TCircuit",
    ),
    "rating": Case(
        "a rating scales reactance and inertia",
        DEEP,
        0.002,
        {
            **dict.fromkeys(("x_prime", "inertia", "rating"), UNIDENTIFIED),
            "T_m": IDENTIFIED,
            "T_prime": IDENTIFIED,
        },
        motor="Rated",
    ),
}


def verdict_record(seed: int) -> dict:
    """One record of each case, another truth and noise for each seed: the words that came, and
    those that should.
    """
    import symmetries

    rng = np.random.default_rng([22, seed])
    truth = TYPICAL * rng.uniform(0.95, 1.05, len(TYPICAL))
    truth[2] = TYPICAL[2]
    rows = {}
    for label, case in CASES.items():
        load = symmetries.load(getattr(symmetries, case.motor)) if case.motor else model()
        events = []
        for k, depth in enumerate(case.depths):
            t, U = Shape(depth).voltage()
            own = truth.copy()
            if case.P0 != 1.0:
                own[4] = case.P0
            clean = printed(own, t, U, Q_s0=0.35, P0=case.P0)
            events.append(
                event(t, U, clean + noise(rng, len(t), case.deviation, 0.0), f"dip {k + 1}")
            )
        _, known = identified(load, events, seed, bounds=case.bounds)
        said = {name: known.verdicts[name].word for name in case.expected}
        rows[label] = {"said": said, "right": said == case.expected}
    return rows


def independent_record(seed: int) -> dict:
    """A record of the flux-state simulator, stator transients and all: the truth is outside the
    model class.
    """
    from independent import Dip, Load, Machine, Recorder, Static, record
    from tractexp.inference.problem import Problem
    from tractexp.record import Record, detect

    rng = np.random.default_rng([33, seed])
    machine = Machine(Rs=0.0, Xs=0.16, Xm=2.0, Rr=0.02, Xr=0.20, H=rng.uniform(0.6, 1.2))
    load = Load(
        machine,
        0.45,
        rng.uniform(0.6, 0.85),
        Static(0.64, 0.36, rng.uniform(1, 2), rng.uniform(2.6, 4)),
    )
    dip = Dip(
        depth=rng.uniform(0.35, 0.6),
        duration=0.2,
        start=0.3,
        fall=0.05,
        rise=0.09,
        sag=0.4,
        settle=0.2,
    )
    r = record(
        load, dip, Recorder(step=0.002, voltage_noise=0.01, current_noise=0.02, bits=14), rng
    )
    truth = np.array([load.truth()[name] for name in NAMES])
    events = [detect(Record("simulated", r["t"], r["U"], r["P"], r["Q"]))]
    found, known = identified(model(), events, seed)
    warned = not judged(Problem(model(), events), found.values).surprise.adequate
    inside = (known.intervals[:, 0] <= truth) & (truth <= known.intervals[:, 1])
    off = (known.values - truth) / truth
    return {"inside": inside.tolist(), "off": off.tolist(), "warned": warned}


def timing(repeats: int = 9) -> dict:
    """Seconds for fit, judgement and seven profiles of a record of 1,000 samples, the kernel
    loaded; medians.
    """
    from tractexp.configuration.plugin import get
    from tractexp.identification.profile import profile_parameters
    from tractexp.identification.search import search
    from tractexp.inference.problem import Problem

    load, (t, U) = model(), Shape(0.5).voltage()
    clean = printed(TYPICAL, t, U, 0.35)
    rows = []
    # a record of its own each time: valleys of one seen before are remembered
    for k in range(repeats + 1):
        events = [event(t, U, clean + noise(np.random.default_rng(k), len(t), 0.005, 0.7))]
        marks = [time.perf_counter()]
        problem = Problem(load, events)
        found = search(problem, get("optimizer", "multistart_least_squares")(starts=3), k)
        marks.append(time.perf_counter())
        known = judged(problem, found.values).uncertainty
        marks.append(time.perf_counter())
        made = profile_parameters(known)
        _ = made.verdicts
        marks.append(time.perf_counter())
        rows.append(np.diff(marks))
    parts = np.median(rows[1:], axis=0)
    return {
        "fit": parts[0],
        "judgement": parts[1],
        "profiles": parts[2],
        "total": parts.sum(),
        "samples": len(t),
    }


RECORDS = {
    "coverage": coverage_record,
    "verdicts": verdict_record,
    "independent": independent_record,
}
SHARE = {"coverage": 1, "verdicts": len(CASES), "independent": 2}  # of the records asked for


def study(part: str, records: int, path: Path = STORED) -> Iterator[dict[str, Any]]:
    """Rows of so many seeds that the file lacks, added to it as they come."""
    seeds = {row["seed"] for row in rows_of(path) if row["part"] == part}
    for seed in sorted(set(range(records)) - seeds):
        row = {"part": part, "seed": seed, "result": six_digits(RECORDS[part](seed))}
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row, separators=(",", ":")) + "\n")
        yield row


def results(rows: Iterable[dict[str, Any]], part: str) -> list[dict[str, Any]]:
    """What the records of a part came to, by seed."""
    return [
        row["result"] for row in sorted(rows, key=lambda row: row["seed"]) if row["part"] == part
    ]


def text(rows: Sequence[dict[str, Any]]) -> str:
    """The table of the page, and a sentence of each of the other parts; of those that have rows."""
    shown = {
        "coverage": coverage_table,
        "verdicts": verdicts_in_words,
        "independent": independent_in_words,
    }
    return "\n\n".join(
        show(found) for part, show in shown.items() if (found := results(rows, part))
    )


def coverage_table(rows: Sequence[dict[str, Any]]) -> str:
    """How many intervals hold the truth, of parameters that the noise lets be known within 20 % and
    of others.
    """
    head = [
        "noise",
        "known within 20 %",
        "intervals",
        "hold the truth",
        "by curvature alone",
        "error over the bound",
        "that of Eq. (8)",
    ]
    lines = []
    for label in CONDITIONS:
        of = {
            key: np.array([row[label][key] for row in rows])
            for key in rows[0][label]
            if key != "words"
        }
        for word, mask in (("yes", of["relative"] <= 0.2), ("no", of["relative"] > 0.2)):
            share = lambda key, mask=mask, of=of: f"{100 * of[key][mask].mean():.0f} %"  # noqa: E731
            size = lambda key, mask=mask, of=of: f"{np.sqrt(np.mean(of[key][mask] ** 2)):.2f}"  # noqa: E731
            if mask.any():
                cells = [share("inside"), share("curvature"), size("likely"), size("eq8")]
                lines.append([label, word, int(mask.sum()), *cells])
    return marked.table(head, lines)


def verdicts_in_words(rows: Sequence[dict[str, Any]]) -> str:
    """How many records of known verdicts got them."""
    right = {label: sum(row[label]["right"] for row in rows) for label in CASES}
    wrong = [f"{label} {n} of {len(rows)}" for label, n in right.items() if n < len(rows)]
    whole = (
        f"Verdicts are those known by construction in {sum(right.values())} of"
        f" {len(rows) * len(CASES)} records"
    )
    return f"{whole} ({', '.join(wrong)})." if wrong else f"{whole}."


def independent_in_words(rows: Sequence[dict[str, Any]]) -> str:
    """What the flux-state simulator's records came to."""
    inside, off = (np.array([row[key] for row in rows]) for key in ("inside", "off"))
    each = [
        f"{name} {100 * bias:+.0f} %, {held} held"
        for name, held, bias in zip(
            NAMES, inside.sum(axis=0).tolist(), off.mean(axis=0), strict=True
        )
    ]
    warned = sum(row["warned"] for row in rows)
    return (
        f"Of {len(rows)} records of a simulator with stator transients, {warned} are said to lack"
        " an effect; mean"
        f" errors, and how many intervals hold the truth: {'; '.join(each)}."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--records", type=int, default=40)
    parser.add_argument("--part", nargs="*", choices=[*RECORDS, "timing"], default=list(RECORDS))
    parser.add_argument(
        "--tables", action="store_true", help="write the page from what is stored, and run nothing"
    )
    chosen = parser.parse_args()
    if "timing" in chosen.part:
        print(" | ".join(f"{key} {value:.3g}" for key, value in timing().items()))
    for part in () if chosen.tables else [part for part in chosen.part if part in RECORDS]:
        for row in study(part, -(-chosen.records // SHARE[part])):
            print(f"\r{part} {row['seed']}", end="", flush=True)
    print("", marked.replace(PAGE, "benchmarks/uncertainty.py", text(rows_of(STORED))), sep="\n")


if __name__ == "__main__":
    main()
