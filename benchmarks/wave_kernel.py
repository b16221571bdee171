"""Time of simulations and fits of waveforms: python benchmarks/wave_kernel.py [--rounds 100]
[--store]

Nanoseconds per Runge-Kutta step and candidate, objective included, of the usual model of waveforms
beside the base model of phasors, in turns within one run, one thread, 200 candidates; the fastest
round of each counts. Then a fit of about 1,300 samples from 20 starts on at most two cores, with
the model's seven parameters and with twelve, and an investigation with the whole catalogue, its
kernels compiled before. Processor seconds stand beside those of the clock: the latter mean little
on a busy machine.
"""

import argparse
import json
import math
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import wave_records as waves
from simulation import excitation

from tractexp.configuration.plugin import get
from tractexp.domain import find_domain
from tractexp.identification.search import search
from tractexp.inference.problem import Problem
from tractexp.model.drive import Drive
from tractexp.model.model import Model, compose
from tractexp.record import convert_to_waves

STORED = Path(__file__).with_suffix(".json")
CANDIDATES, STARTS, RATE = 200, 20, 1600.0  # Hz: some 1,300 samples
# twelve in all
EFFECTS = ("second_motor_group", "speed_dependent_torque", "shunt_capacitor", "magnetic_saturation")


def model(*effects: str) -> Model:
    """The usual model of waveforms, extended."""
    extra = [get("effect", name)() for name in effects]
    return compose(
        get("model/motor", "stator_flux")(), get("model/static", "branch")(), extra, domain="waves"
    )


def recorded(seed: int = 5):
    """A drawn event of some 1,300 samples."""
    case, _ = waves.drawn_events([1, seed])
    case = replace(case, sampler=replace(case.sampler, rate=RATE))
    return convert_to_waves(waves.events(case, [1, seed])[0])


def kernels(rounds: int) -> list[dict]:
    """Nanoseconds per step and candidate of both models, taking turns."""
    rng, event = np.random.default_rng(0), recorded()
    phasors = compose(
        get("model/motor", "electromechanical")(), get("model/static", "exponential")()
    )
    prepared = []
    for load, driving in ((phasors, excitation()), (model(), find_domain(event).excitation(event))):
        values = np.array([p.default for p in load.parameters]) * rng.uniform(
            0.97, 1.03, (CANDIDATES, len(load.names))
        )
        drive, n = Drive.from_events([driving]), np.array([1 if load is phasors else 4])
        refused = load.errors(drive, values, n).is_refused.sum()
        if refused:
            raise SystemExit(f"{refused} candidates have no steady state; their time means nothing")
        steps = CANDIDATES * (drive.samples - 1) * int(n[0])
        prepared.append((load, drive, values, n, steps))
    fastest = [math.inf] * len(prepared)
    for _ in range(rounds):
        for k, (load, drive, values, n, steps) in enumerate(prepared):
            started = time.perf_counter()
            load.errors(drive, values, n)
            fastest[k] = min(fastest[k], 1e9 * (time.perf_counter() - started) / steps)
    return [
        {
            "model": load.title,
            "domain": load.domain,
            "parameters": len(load.names),
            "samples": drive.samples,
            "nanoseconds_per_step": ns,
        }
        for (load, drive, *_), ns in zip(prepared, fastest, strict=True)
    ]


def fits() -> list[dict]:
    """Seconds of searches from `STARTS` starts, and of the judgement behind."""
    from tractexp.identification.estimate import estimate

    rows = []
    event = recorded()
    for extra in ((), EFFECTS):
        load = model(*extra)
        problem = Problem(load, [event])
        # compiles
        problem.objective(problem.space.from_unit(np.full((1, problem.space.dimension), 0.5)))
        marks = [(time.perf_counter(), time.process_time())]
        found = search(problem, get("optimizer", "multistart_least_squares")(starts=STARTS), 0)
        marks.append((time.perf_counter(), time.process_time()))
        estimate(problem, found.values)
        marks.append((time.perf_counter(), time.process_time()))
        rows.append(
            {
                "effects": list(extra),
                "parameters": problem.space.dimension,
                "samples": event.record.samples,
                "substeps": problem.step.substeps.tolist(),
                "simulations": found.simulations,
                "seconds": marks[1][0] - marks[0][0],
                "processor_seconds": marks[1][1] - marks[0][1],
                "judgement_seconds": marks[2][0] - marks[1][0],
                "judgement_processor_seconds": marks[2][1] - marks[1][1],
            }
        )
    return rows


def investigation() -> dict:
    """Seconds of an investigation of two dips, one held out, the second time: its kernels are
    compiled.
    """
    import tractexp

    _, events = waves.drawn_events([1, 5], dips=2)
    spent = []
    for _ in range(2):
        clock, own = time.perf_counter(), time.process_time()
        found = tractexp.investigate(
            events[:1],
            validate=events[1:],
            model="fifth_order_branch",
            domain="waves",
            progress=False,
        )
        spent.append((time.perf_counter() - clock, time.process_time() - own))
    return {
        "verdict": str(found.verdict),
        "seconds": spent[1][0],
        "processor_seconds": spent[1][1],
        "first": spent[0][0],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--parts", nargs="+", default=["kernels", "fits", "investigation"])
    parser.add_argument("--store", action="store_true")
    chosen = parser.parse_args()
    made = {"kernels": lambda: kernels(chosen.rounds), "fits": fits, "investigation": investigation}
    told = {part: made[part]() for part in chosen.parts} | {
        "load_average": os.getloadavg()[0],
        "cores": os.cpu_count(),
    }
    print(json.dumps(told, indent=1))
    if chosen.store:
        kept = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
        STORED.write_text(json.dumps(kept | told, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
