"""Are parameters of waveforms within their intervals, and the grades right? python
benchmarks/waves.py [--count 60]

Drawn loads through drawn faults, sampled by a drawn recorder: `wave_records`, whose equations,
frame and solver are not the product's. Nothing is missing, so every grade but `adequate` is wrong.
Rows are appended to a file, so that a study goes on where it stopped; --store writes its summary
beside this file. Seeds of `--series calibration`, on which thresholds may be looked at, are never
those that are reported. Further parts: `lengths` (what dips of which length, depth and unbalance
tell, in words of relative standard errors), `swapped` (one dip fitted and another held out, and the
other way round), `clean` (no noise, no offsets: what equations and interpolation differ by).
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import wave_records as waves  # noqa: E402

STORED = Path(__file__).with_suffix(".json")
SERIES = {"calibration": 1, "reported": 2}
MODEL = "fifth_order_branch"
NAMES = ("T_prime", "X_prime", "C", "M", "T_m", "R_s", "branch_resistance")
LENGTHS, DEPTHS = (1, 2, 4, 8), (0.3, 0.8)  # cycles, share of the voltage that is lost


def identified(event):
    """A fit as a user makes it."""
    import tractexp

    return tractexp.identify(
        event, model=MODEL, domain="waves", optimizer="multistart_least_squares", progress=False
    )


def truth_of(site: waves.Site, fit) -> dict[str, float]:
    """The parameters of a load, per unit of the base that the product fitted it on."""
    return site.truth(fit.result.records[0]["base"]["power_MVA"])


def judged(fit, site: waves.Site) -> dict:
    """How a fit stands to the truth."""
    truth = truth_of(site, fit)
    result, row = fit.result, {"inside": {}, "z": {}, "off": {}, "wide": {}}
    for name, true in truth.items():
        (low, high), error = result.intervals[name], result.standard_errors[name]
        row["inside"][name] = bool(low <= true <= high)
        row["z"][name] = (result.parameters[name] - true) / error if error else None
        row["off"][name] = result.parameters[name] / true - 1
        row["wide"][name] = (high - low) / 2 / true
    row |= {
        "grade": str(fit.grade),
        "p": result.adequacy["p"],
        "loudest": fit.details.estimation.surprise.loudest,
    }
    return row | {"epsilon_i": result.events[0]["epsilon_i"]}


def covered(series: str, seed: int) -> dict:
    """One drawn record."""
    started = time.perf_counter()
    case, events = waves.drawn_events([SERIES[series], seed])
    made = time.perf_counter()
    row = judged(identified(events[0]), case.site)
    row |= {
        "kind": case.kinds[0],
        "rate": case.sampler.rate,
        "samples": events[0].record.waves.samples.shape[1],
    }
    return row | {"made": made - started, "seconds": time.perf_counter() - made}


def clean(series: str, seed: int) -> dict:
    """The same record without noise, offsets and quantization: errors of equations and
    interpolation alone.
    """
    case, _ = waves.drawn_events([SERIES[series], seed])
    case = replace(case, sampler=replace(case.sampler, noise=0.0, bits=None, offsets=(0.0,) * 6))
    row = judged(identified(waves.events(case, [SERIES[series], seed])[0]), case.site)
    return {
        "off": row["off"],
        "epsilon_i": row["epsilon_i"],
        "rate": case.sampler.rate,
        "kind": case.kinds[0],
    }


def swapped(series: str, seed: int) -> dict:
    """Two dips of one load: either fitted, the other held out; how far apart, and how well it
    carries over.
    """
    import tractexp

    case, events = waves.drawn_events([SERIES[series], 5000 + seed], dips=2)
    settings = {
        "model": MODEL,
        "domain": "waves",
        "optimizer": "multistart_least_squares",
        "progress": False,
    }
    fits = [tractexp.identify(events[k], validate=[events[1 - k]], **settings) for k in (0, 1)]
    one, two = (f.result for f in fits)
    row = {"z": {}, "overlap": {}, "held_out": [r.events[1]["epsilon_i"] for r in (one, two)]}
    row["fitted"] = [r.events[0]["epsilon_i"] for r in (one, two)]
    row["inside"] = {n: [judged(f, case.site)["inside"][n] for f in fits] for n in NAMES}
    for name in NAMES:
        errors = [r.standard_errors[name] or np.inf for r in (one, two)]
        row["z"][name] = float((one.parameters[name] - two.parameters[name]) / np.hypot(*errors))
        (a, b), (c, d) = one.intervals[name], two.intervals[name]
        row["overlap"][name] = bool(a <= d and c <= b)
    return row | {"kinds": case.kinds, "grades": [str(f.grade) for f in fits]}


def lengths(series: str, seed: int) -> dict:
    """Relative standard errors at the truth over length, depth and kind of the fault, of one drawn
    load.
    """
    rng = np.random.default_rng([SERIES[series], 9000 + seed])
    of, rows = waves.site(rng), []
    recorder = replace(waves.sampler(rng), rate=3200.0, bits=16)
    for kind in waves.KINDS:
        for depth in DEPTHS:
            for cycles in LENGTHS:
                fault = replace(
                    waves.fault(rng, kind)[0], duration=cycles / waves.NOMINAL, sag=0.1, start=0.15
                )
                fault = replace(fault, left=left(kind, 1 - depth))
                case = waves.Case(of, (fault,), recorder, (kind,))
                errors = told_at_truth(
                    waves.events(case, [SERIES[series], seed, cycles])[0], of.truth()
                )
                rows.append({"kind": kind, "depth": depth, "cycles": cycles, "relative": errors})
    return {"rows": rows}


def told_at_truth(event, truth: dict[str, float]) -> dict[str, float]:
    """Relative standard errors at the true values, under the noise that the event shows there."""
    from tractexp.configuration.plugin import get
    from tractexp.identification.residual_noise import estimate_noise_at
    from tractexp.identification.uncertainty import conclude
    from tractexp.inference.likelihood import Likelihood
    from tractexp.inference.problem import Problem
    from tractexp.model.model import compose

    load = compose(
        get("model/motor", "stator_flux")(), get("model/static", "branch")(), domain="waves"
    )
    problem = Problem(load, [event])  # its voltages are as recorded: those of waveforms are
    likelihood = Likelihood.from_problem(problem)
    values = np.array([truth[n] for n in problem.space.names])
    unit = likelihood.to_unit(values)[0]
    noise = estimate_noise_at(likelihood, unit, problem.domain.input_errors(problem, values))
    errors = conclude(replace(likelihood, noise=noise), unit).information.standard_errors
    return dict(zip(problem.space.names, (errors / values).tolist(), strict=True))


def left(kind: str, share: float) -> tuple[complex, complex, complex]:
    """What a fault without jump of phase leaves of the phases."""
    if kind == "phase to earth":
        return share, 1.0, 1.0
    if kind == "three phases":
        return share, share, share
    b, c = np.exp(np.array([-2j, 2j]) * np.pi / 3)
    middle, gap = (b + c) / 2, share * (b - c) / 2
    return 1.0, complex((middle + gap) / b), complex((middle - gap) / c)


PARTS = {"coverage": covered, "clean": clean, "swapped": swapped, "lengths": lengths}


def study(part: str, series: str, count: int, path: Path) -> Iterator[dict]:
    """Rows of `count` seeds, those in the file first; what fails is a row with its message."""
    done = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    yield from done[:count]
    with path.open("a") as file:
        for seed in range(len(done), count):
            try:
                row = PARTS[part](series, seed)
            except (ValueError, ArithmeticError, RuntimeError, np.linalg.LinAlgError) as error:
                row = {"failed": f"{type(error).__name__}: {error}"}
            file.write(json.dumps(row | {"seed": seed}) + "\n")
            file.flush()
            print(f"\r{part}: {seed + 1} of {count}", end="", file=sys.stderr, flush=True)
            yield row | {"seed": seed}


def summary(part: str, rows: list[dict]) -> dict:
    """What is stored of a part."""
    good = [r for r in rows if "failed" not in r]
    told: dict = {"records": len(rows), "failed": [r["failed"] for r in rows if "failed" in r]}
    median = lambda key: {n: float(np.median([abs(r[key][n]) for r in good])) for n in NAMES}  # noqa: E731
    if part == "coverage":
        fine = [r for r in good if r["grade"] == "adequate"]
        told |= {
            "adequate": len(fine),
            "others": [
                (r["seed"], r["grade"], r["p"], r["loudest"]) for r in good if r not in fine
            ],
        }
        told["coverage"] = {n: float(np.mean([r["inside"][n] for r in good])) for n in NAMES}
        told["coverage_of_all"] = float(np.mean([list(r["inside"].values()) for r in good]))
        told["coverage_where_adequate"] = float(np.mean([list(r["inside"].values()) for r in fine]))
        told["rms_z"] = {
            n: float(np.sqrt(np.mean([r["z"][n] ** 2 for r in good if r["z"][n] is not None])))
            for n in NAMES
        }
        told |= {"median_error": median("off"), "median_half_width": median("wide")}
        told["by_kind"] = {
            k: float(np.mean([list(r["inside"].values()) for r in good if r["kind"] == k]))
            for k in waves.KINDS
        }
        told["by_rate"] = {
            str(k): float(np.mean([list(r["inside"].values()) for r in good if r["rate"] == k]))
            for k in waves.RATES
        }
        told |= {
            key: float(np.median([r[key] for r in good]))
            for key in ("seconds", "samples", "epsilon_i")
        }
    elif part == "clean":
        told |= {
            "median_error": median("off"),
            "epsilon_i": [
                float(np.median([r["epsilon_i"] for r in good])),
                max(r["epsilon_i"] for r in good),
            ],
        }
        told["largest_error"] = {n: float(max(abs(r["off"][n]) for r in good)) for n in NAMES}
    elif part == "swapped":
        told["agree"] = {n: float(np.mean([r["overlap"][n] for r in good])) for n in NAMES}
        told["within_1.96"] = {
            n: float(np.mean([abs(r["z"][n]) < 1.96 for r in good])) for n in NAMES
        }
        told["coverage"] = float(np.mean([list(r["inside"].values()) for r in good]))
        told |= {key: float(np.median([r[key] for r in good])) for key in ("held_out", "fitted")}
    else:
        told["median_relative_standard_error"] = [
            {
                "kind": k,
                "depth": d,
                "cycles": c,
                "relative": {
                    n: float(
                        np.median(
                            [
                                row["relative"][n]
                                for r in good
                                for row in r["rows"]
                                if (row["kind"], row["depth"], row["cycles"]) == (k, d, c)
                            ]
                        )
                    )
                    for n in NAMES
                },
            }
            for k in waves.KINDS
            for d in DEPTHS
            for c in LENGTHS
        ]
    return told


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--part", choices=list(PARTS), default="coverage")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--series", choices=list(SERIES), default="reported")
    parser.add_argument("--out", type=Path, default=Path("waves.jsonl"))
    parser.add_argument(
        "--store", action="store_true", help=f"write the summary into {STORED.name}"
    )
    chosen = parser.parse_args()
    rows = list(study(chosen.part, chosen.series, chosen.count, chosen.out))
    told = summary(chosen.part, rows)
    print(json.dumps(told, indent=1))
    if chosen.store:
        kept = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
        STORED.write_text(json.dumps(kept | {chosen.part: told}, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
