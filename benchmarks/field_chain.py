"""From a recorder's channels to parameters, measured: python benchmarks/field_chain.py [PART ...]

Parts, each kept in field_chain.json and shown in docs/records.md: `phasors` (magnitude and power of known waveforms),
`speed` (ten minutes of three phases read and measured), `windows` (what the estimator's window does to identified
parameters, and what taking it into account does), `chain` (the shipped dips from COMTRADE and from CSV against their
truth). A few minutes on one core, most of them for `windows`.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import marked
import numpy as np
import oracle  # noqa: F401
from make_tibet import DIPS, EDGES, LOAD, MACHINE

from independent import Dip, Load, Waveforms, simulate
from independent.recorder import PHASES
from tractexp.plugin import chosen
from tractexp.record import Event, Record, detect
from tractexp.record.phasor import measure

STORED = Path(__file__).with_suffix(".json")
DOCS = Path(__file__).resolve().parents[1] / "docs" / "records.md"
MAKER = "benchmarks/field_chain.py"
ESTIMATORS = ("one_cycle", "p_class", "m_class")
RATE = 4000.0  # Hz
HARMONICS = {3: 0.5, 5: 0.7, 7: 0.51}  # shares of the distortion, root of the sum of squares 1
TEN_MINUTES = 600.0  # s


def distorted(f: float, phases: int, t: np.ndarray, rng: np.random.Generator, lag: float = 0.5) -> np.ndarray:
    """Voltages and currents (2 K, N) of 1 kV and 1 kA with 3 % of harmonics and noise 60 dB below the fundamental."""
    k, made = np.arange(phases)[:, None], []
    for angle in (0.0, -lag):
        turn = 2 * np.pi * (f * t - k / 3) + angle
        x = np.cos(turn) + 0.03 * sum(share * np.cos(h * turn + h) for h, share in HARMONICS.items())
        made.append(np.sqrt(2) * x + 1e-3 * rng.standard_normal((phases, len(t))))
    return np.concatenate(made)


def phasors() -> list[dict[str, Any]]:
    """The largest errors over two seconds at 48 to 52 Hz: U in % of it, P and Q in % of the apparent power."""
    t, rows = np.arange(round(2 * RATE)) / RATE, []
    for estimator in ESTIMATORS:
        for phases in (3, 1):
            worst = np.zeros(3)
            for k, f in enumerate(np.arange(48.0, 52.25, 0.5)):
                x = distorted(f, phases, t, np.random.default_rng(k))
                made = measure(x, RATE, 50.0, window=chosen("estimator", estimator).averager)
                S = made.S / phases - np.exp(0.5j)
                off = [made.U / np.sqrt(phases) - 1, S.real, S.imag]
                worst = np.maximum(worst, [100 * np.abs(one).max() for one in off])
            rows.append({"estimator": estimator, "phases": phases} | dict(zip("UPQ", worst.tolist(), strict=True)))
    return rows


def ten_minutes(folder: Path) -> Path:
    """A COMTRADE record of six channels at 4 kHz, 50.02 Hz."""
    from tractexp.filetypes.comtrade import write
    from tractexp.recording import Channel, Recording, Segment

    t = np.arange(round(TEN_MINUTES * RATE)) / RATE
    made = []
    for name, unit, angle in (("U", "V", 0.0), ("I", "A", 0.5)):
        for k in range(3):
            raw = np.round(2e4 * np.cos(2 * np.pi * (50.02 * t - k / 3) - angle)).astype(np.int16)
            made.append(Channel(f"{name}{'abc'[k]}", raw, unit, phase="ABC"[k], gain=0.01, ratio=200.0))
    return write(Recording("ten minutes", made, [Segment(0, len(t), RATE, 0.0)]), folder / "long.cfg")[0]


def speed() -> list[dict[str, Any]]:
    """CPU seconds and peak memory [MB] of a process that reads the ten minutes and has U, P and Q of them."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        path = ten_minutes(Path(folder))
        for estimator in ESTIMATORS:
            done = subprocess.run(
                [sys.executable, __file__, "--timed", str(path), estimator], check=True, capture_output=True, text=True
            )
            rows.append({"estimator": estimator} | json.loads(done.stdout))
    return rows


def timed(path: Path, estimator: str) -> dict[str, float]:
    """What this process needs for one file, beyond starting."""
    from tractexp.recording import Feeder, comtrade
    from tractexp.recording.measure import phasors_of

    began = time.process_time()
    recording = comtrade.load(path)
    made = phasors_of(recording, Feeder((0, 1, 2), (3, 4, 5), "three_phase"), recording.segments[0], estimator)
    assert np.isfinite(made.U * made.S).all()
    spent = time.process_time() - began
    return {"cpu": spent, "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


SHAPES = {
    "slow": Dip(depth=0.5, duration=0.2, **EDGES),
    "quick": Dip(depth=0.5, duration=0.2, start=0.4, fall=0.01, rise=0.02, sag=0.3, settle=0.2),
    "abrupt": Dip(depth=0.3, duration=0.2, start=0.4, fall=0.002, rise=0.002),
}
TRUTHS: dict[str, Load | None] = {
    "the fitted model": None,
    "a machine": LOAD,
    "a machine with stator resistance": replace(LOAD, machine=replace(MACHINE, Rs=0.02)),
}
WAYS = ("nothing", "output", "both")
THIRD, FIFTH = "third_order_exponential", "fifth_order_stator_flux"
FITTED = [*((truth, THIRD) for truth in TRUTHS), ("a machine with stator resistance", FIFTH)]  # by what model


def model_of(name: str) -> Any:
    """A model as it is chosen by name."""
    from tractexp.api.compose import model_of

    return model_of(name)


def waves_of(load: Load | None, dip: Dip) -> Waveforms:
    """What a load draws from a dip: instantaneous where it is a machine, as the model says where it is that."""
    from tractexp.model.drive import Drive, Excitation

    t = np.arange(round(2.8 * RATE)) / RATE - 0.2
    if load is not None:
        return simulate(load, dip, t)
    model, U, truth = model_of(THIRD).model, dip.magnitude(t), LOAD.truth()
    S = LOAD.steady_power(1.0) + complex(LOAD.static.P, LOAD.static.Q)
    drive = Drive.of([Excitation(1 / RATE, U, 0 * U, 0 * U, 1.0, S.real, S.imag)])
    shown = model.simulate(drive, np.array([[truth[name] for name in model.names]]), 2)
    turn = np.exp(2j * np.pi * 50 * t)
    return Waveforms(t, U * turn, np.conj((shown.P[0] + 1j * shown.Q[0]) / U) * turn, np.empty((3, 0)))


def seen(waves: Waveforms, estimator: str) -> Event:
    """The record that an estimator makes of waveforms with noise 60 dB below them."""
    rng, window = np.random.default_rng(1), chosen("estimator", estimator)
    x = np.concatenate([(w * PHASES[:, None]).real for w in (waves.voltage, waves.current)])
    x += 1e-3 * rng.standard_normal(x.shape)
    made = measure(x * np.sqrt(2), RATE, 50.0, start=waves.t[0], window=window.averager)
    kept = (made.t >= 0) & (made.t <= 2.4)
    S = made.S[kept] / 3
    return detect(Record("seen", made.t[kept], np.abs(made.V1[kept]), S.real, S.imag, window=window.window(50.0)))


def truth_of(load: Load | None) -> dict[str, float]:
    """What models call a load, on the record's base."""
    made = load or LOAD
    return made.truth() | {"R_s": made.machine.Rs / made.rating}


def fitted(event: Event, name: str, way: str, truth: Mapping[str, float]) -> dict[str, float]:
    """Misfit [pu] and error of the parameters [%], root mean squares, of a least-squares fit begun at the truth."""
    from scipy.optimize import least_squares

    from tractexp.discrepancy.recorder_window import RecorderWindow
    from tractexp.identification.problem import Problem

    asked, known = model_of(name), event.record.window
    model = asked.model
    if not (way == "both" and model.motor.within_a_cycle):  # that one does it by itself
        event = replace(event, record=replace(event.record, window=None))
        if way != "nothing":
            recorder = RecorderWindow(known.length, known)
            model = model.behind(recorder)
            event = recorder.sharpened(event) if way == "both" else event
    problem = Problem(model, [event], asked.bounds, asked.fixed)
    goal = np.array([truth[name] for name in problem.space.names])
    span = problem.upper - problem.lower
    begin = np.clip((goal - problem.lower) / span, 1e-6, 1 - 1e-6)
    found = least_squares(
        lambda unit: problem.residuals((problem.lower + unit * span)[None])[0], begin, bounds=(0, 1), x_scale="jac",
        diff_step=1e-4,
    )  # fmt: skip
    off = (problem.lower + found.x * span) / goal - 1
    return {"misfit": float(np.sqrt(2 * found.cost)), "error": float(100 * np.sqrt(np.mean(off**2)))} | {
        name: float(100 * one) for name, one in zip(problem.space.names, off, strict=True)
    }


def windows() -> list[dict[str, Any]]:
    """Every truth and model, shape of dip and estimator, with the window taken into account in each way."""
    rows = []
    for truth, name in FITTED:
        for shape, dip in SHAPES.items():
            waves = waves_of(TRUTHS[truth], dip)
            for estimator in ESTIMATORS:
                event = seen(waves, estimator)
                for way in WAYS:
                    rows.append({"truth": truth, "model": name, "dip": shape, "estimator": estimator, "way": way})
                    rows[-1] |= fitted(event, name, way, truth_of(TRUTHS[truth]))
    return rows


def chain() -> list[dict[str, Any]]:
    """The shipped dips from CSV and from COMTRADE: parameters on the base of the truth, by search and as estimated."""
    import tractexp

    rows = []
    for names, model in (*(([name], THIRD) for name in DIPS), (list(DIPS), THIRD), (list(DIPS), FIFTH)):
        for source, ending in (("CSV", ""), ("COMTRADE", "_comtrade")):
            events = [event for name in names for event in tractexp.read(name + ending)]
            # The COMTRADE records are of a load of 10 MVA, per unit of the apparent power before the dip.
            k = np.mean([e.record.base.power for e in events]) / 10.0 if ending else 1.0
            scale = {"X_prime": 1 / k, "M": k, "T_m": k}
            search = {"optimizer": "multistart_least_squares", "check_intervals": False, "seed": 0}
            found = tractexp.identify(events, model, **search)
            for stage, told in (("search", found.result.search), ("estimate", vars(found.result))):
                record = names[0] if len(names) == 1 else "all three"
                rows.append({"record": record, "model": model, "from": source, "stage": stage})
                rows[-1]["trusted"] = found.adequate
                for n, true in LOAD.truth().items():
                    rows[-1][n] = float(100 * (told["parameters"][n] * scale.get(n, 1.0) / true - 1))
                rows[-1] |= {key: told[key] for key in ("epsilon_p", "epsilon_q")}
    return rows


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def phasor_table(rows: list[dict[str, Any]]) -> str:
    return _table(
        ["estimator", "phases", "U [%]", "P [% of S]", "Q [% of S]"],
        [[f"`{r['estimator']}`", str(r["phases"]), *(f"{r[c]:.3f}" for c in "UPQ")] for r in rows],
    )


def speed_table(rows: list[dict[str, Any]]) -> str:
    return _table(
        ["estimator", "CPU [s]", "peak memory [MB]"],
        [[f"`{r['estimator']}`", f"{r['cpu']:.1f}", f"{r['memory']:.0f}"] for r in rows],
    )


def window_table(rows: list[dict[str, Any]]) -> str:
    made = []
    for truth, name in FITTED:
        for shape in SHAPES:
            for estimator in ESTIMATORS:
                key = (truth, name, shape, estimator)
                of = [r for r in rows if (r["truth"], r["model"], r["dip"], r["estimator"]) == key]
                cells = [f"{1000 * r['misfit']:.2f} / {r['error']:.1f}" for way in WAYS for r in of if r["way"] == way]
                made.append([truth, f"`{name}`", shape, f"`{estimator}`", *cells])
    return _table(["the load is", "fitted by", "dip", "estimator", "nothing", "output averaged", "both"], made)


def chain_table(rows: list[dict[str, Any]]) -> str:
    names = list(LOAD.truth())
    made = [
        [r["record"], f"`{r['model']}`", r["from"], r["stage"], *(f"{r[n]:+.1f}" for n in names),
         *(f"{100 * r[e]:.2f}" for e in ("epsilon_p", "epsilon_q")), "yes" if r["trusted"] else "no"]
        for r in rows
    ]  # fmt: skip
    ends = ["ε_P [%]", "ε_Q [%]", "trusted"]
    return _table(["record", "model", "from", "stage", *(f"`{n}`" for n in names), *ends], made)


PARTS: dict[str, tuple[Callable[[], list[dict[str, Any]]], Callable[[list[dict[str, Any]]], str]]] = {
    "phasors": (phasors, phasor_table),
    "speed": (speed, speed_table),
    "windows": (windows, window_table),
    "chain": (chain, chain_table),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="what to measure (default: all)")
    parser.add_argument("--timed", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.timed:
        print(json.dumps(timed(Path(given.timed[0]), given.timed[1])))
        return
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    for name in given.parts or PARTS:
        stored[name] = PARTS[name][0]()
        STORED.write_text(json.dumps(stored, indent=1) + "\n")
        marked.replace(DOCS, f"{MAKER} {name}", PARTS[name][1](stored[name]))
        print(PARTS[name][1](stored[name]))


if __name__ == "__main__":
    main()
