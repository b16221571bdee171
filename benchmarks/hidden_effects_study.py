"""Run the suites through the product and count: false alarms, names found, abstentions, gaps closed.

    python hidden_effects_study.py --docs        (from the folder benchmarks)

Each trial is made by the independent generator, its last event held out, and investigated by `tractexp.discrepancy`.
AIC, BIC and RMSE rank the same candidates on the same data. Rows are appended to a JSON-lines file, so that a study
can be stopped and taken up; `--docs` writes tables and figures into docs/missing-effects.md.
"""

import argparse
import itertools
import json
import os
import time
from collections.abc import Container, Iterator
from dataclasses import replace
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import hidden_effects_evidence as evidence  # noqa: E402
import numpy as np  # noqa: E402

from hidden_effects import cases  # noqa: E402
from hidden_effects.effects import CATALOG, PHYSICAL  # noqa: E402
from hidden_effects.generator import make, scene, truth  # noqa: E402
from hidden_effects.outside import OUTSIDE  # noqa: E402

LEFT_OUT = "left out "  # the group of trials whose effect is taken from the catalogue
PAIRED, LARGE = (2.0, 4.0), (2.0, 4.0, 8.0)  # multiples of the detection limit
KNOWN = {"rotor_skin_effect": "second_cage", "stator_transients": "stator_transients"}  # the catalogue has them, too
HIDDEN = {  # one effect is hidden: group of trials, multiples, effects
    "single": ("", cases.MULTIPLES, (*CATALOG, *KNOWN)),
    "outside": ("outside ", LARGE, [name for name in OUTSIDE if name not in KNOWN]),
    "left_out": (LEFT_OUT, LARGE, PHYSICAL),
}
SUITES = ("nulls", "nuisances", *HIDDEN, "pairs")
BEST = 3  # single effects of which the least that any leaves is taken
SAME = {  # effects whose amount is a parameter of the model, in its units
    "stator_resistance": "R_s",
    "speed_dependent_torque": "quadratic_share",
    "second_motor_group": "group_share",
    "undervoltage_trip": "tripped_share",
    "time_skew": "skew",
    "measurement_window": "window",
}


def suite(
    name: str, count: int, events: int, multiples: Container[float] = cases.MULTIPLES
) -> Iterator[tuple[str, cases.Trial]]:
    """(group, trial) of one suite; `count` data sets of each row, hidden effects of these multiples of their limits."""
    if name == "nulls":
        for noise in cases.NOISES:
            yield from ((f"null, {noise}", t) for t in cases.nulls(noise, count, events=events))
    elif name == "nuisances":
        yield from (("null with nuisances", t) for t in cases.nuisances(count, events=events))
    elif name == "pairs":
        for multiple in (m for m in PAIRED if m in multiples):
            yield from ((f"pairs {multiple:g} x", t) for t in cases.pairs(multiple, count, events=events))
    else:
        group, sizes, effects = HIDDEN[name]
        for multiple, effect in itertools.product((m for m in sizes if m in multiples), effects):
            yield from ((f"{group}{multiple:g} x", t) for t in cases.single(effect, multiple, count, events=events))


def run(group: str, trial: cases.Trial, held: int) -> dict:
    """One data set investigated, its last `held` events kept for validation. What fails is a row with its message."""
    from tractexp.discrepancy.investigate import investigate
    from tractexp.errors import UserError
    from tractexp.model.model import compose
    from tractexp.plugin import discover, get
    from tractexp.record import Record, detect

    hidden = [name for name, _ in trial.case.hidden]
    row = {
        "group": group,
        "label": trial.label,
        "truth": sorted(KNOWN.get(n, n) for n in hidden),
        "seed": trial.seed,
        "held": held,
    }
    row |= {"multiples": list(trial.multiples), "events": trial.case.events}
    only = []
    if group.startswith(LEFT_OUT):
        row["truth"], only = [], [n for n in discover()["effect"] if n not in hidden]
    started = time.perf_counter()
    try:
        records = make(trial.case, trial.seed)
        events = [detect(Record(f"event{k + 1}", **r, source=f"{k}").check()) for k, r in enumerate(records)]
        model = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
        row["generated"] = time.perf_counter() - started
        train, validate = events[: len(events) - held], events[len(events) - held :]
        found = investigate(model, train, validate, only=only, seed=0)
        row |= _counted(found) | _compared(found, trial)
    except (UserError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        row["failed"] = f"{type(error).__name__}: {error}"
    return row | {"seconds": time.perf_counter() - started}


def _counted(found) -> dict:
    """What the product said, and what it said it with."""
    first = found.first
    return {
        "verdict": found.verdict.word,
        "names": list(found.names),
        "sets": [list(s) for s in found.verdict.sets],
        "chi2": found.train.after.chi2_per_sample,
        "closed": found.train.closed,
        "refitted": found.fitted_to_both,
        "closed_held": None if found.validate is None else found.validate.closed,
        "gain_held": None if found.validate is None else [found.validate.gain, found.validate.expected],
        "left_of_all": None if found.judged is None else found.judged.p_left,
        "p_first": first.scores[0].p if first.scores else 1.0,
        "first": first.scores[0].name if first.scores else "",
        "stages": [[list(s.fit.names), s.scores[0].name, s.scores[0].p] for s in found.explanations.steps],
        "left": [s.p_left for s in found.explanations.steps],
        "left_by": found.last.left,
        "samples": found.bench.samples,
        "drops": {s.name: s.drop for s in first.scores},
        "parameters": {s.name: len(found.catalogue[s.name].effect.parameters) for s in first.scores},
        "untestable": sorted(found.catalogue.untestable),
        "simulations": found.bench.effort.simulations,
    }


def _compared(found, trial: cases.Trial) -> dict:
    """What the product said, held against what was made: sizes, places, clean curves, and what was to be found."""
    from tractexp.discrepancy.discrepancy_json import parameters

    told = truth(trial.case, trial.seed)
    row = {"places": len(found.places), "places_true": sum(_overlaps(p, told["where"]) for p in found.places)}
    hidden = [e["name"] for e in told["effects"]]
    if len(hidden) == 1 and list(found.names) == hidden and hidden[0] in SAME:
        own = parameters(found)[SAME[found.names[0]]]
        row |= {"estimate": own["value"], "error": own["standard_error"], "amount": told["effects"][0]["amount"]}
    made = scene(trial.case, trial.seed)
    clean = _powers(made.records())
    if found.judged is not None:
        other = found.judged.bench
        N = other.drive.samples
        got = other.residuals(np.array(found.judged.units)) + other.drive.measured - clean[:, -N:]
        before, after = np.sum(got**2, axis=(1, 2))
        row["closed_true"] = 1 - after / before
    if made.effects and not found.catalogue.untestable.keys() & {name for name, _ in made.effects}:
        without = _powers(replace(made, effects=()).records())
        N = found.bench.drive.samples
        change = (clean - without)[:, :N]
        projection = found.first.tangent.whitened(found.first.noise, -change[None])
        row |= {"lambda": float(projection.r[0] @ projection.r[0]), "lambda_left": _left(found, clean[:, :N])}
    return row


def _left(found, clean: np.ndarray) -> float:
    """Non-centrality that the best single effect leaves of clean curves (2, N), refitted to the noisy ones.

    At its fit the problem is linear enough: what its parameters and the nuisances can still take is projected out.
    """
    from tractexp.discrepancy.explanations import searched
    from tractexp.discrepancy.tangent import tangent

    bench, first, refits = found.bench, found.first, found.explanations.refits
    singles = [fit for names, fit in refits.items() if len(names) == 1]
    singles = singles or searched([first], {(): first.fit}, 1, lambda line: None)
    left = []
    for fit in sorted(singles, key=lambda f: f.cost)[:BEST]:
        t = tangent(bench, fit, first.noise)
        off = (t.residual + bench.drive.measured - clean) * bench.known
        rows = t.whitened(first.noise, off[None]).r[0]
        left.append(float(rows @ rows))
    return min(left)


def _powers(records: list[dict]) -> np.ndarray:
    """P and Q of all events end to end, (2, N)."""
    return np.concatenate([np.stack([r["P"], r["Q"]]) for r in records], axis=1)


def _overlaps(place, where: list[dict]) -> bool:
    """Whether a place that was found overlaps one in which something was changed."""
    return any(
        place.event == f"event{w['event'] + 1}" and place.start <= w["end"] and place.end >= w["start"] for w in where
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", action="append", choices=SUITES, help="default: all")
    parser.add_argument("--count", type=int, default=5, help="data sets of each row")
    parser.add_argument("--multiple", action="append", type=float, choices=cases.MULTIPLES, help="default: all")
    parser.add_argument("--events", type=int, default=3, help="events fitted")
    parser.add_argument("--held", type=int, default=1, help="events held out beside them")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("outputs/hidden_effects.jsonl"))
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no further trial after so long")
    parser.add_argument("--docs", action="store_true", help="write tables and figures into docs/missing-effects.md")
    chosen = parser.parse_args()
    from joblib import Parallel, delayed

    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in chosen.out.read_text().splitlines()] if chosen.out.exists() else []
    done = {(r["group"], r["label"], r["seed"], r["events"], r["held"]) for r in rows}
    started, total = time.perf_counter(), chosen.events + chosen.held
    trials = (
        found
        for count in range(1, chosen.count + 1)  # one data set of every row before the second of any
        for name in chosen.suite or SUITES
        for found in suite(name, count, total, chosen.multiple or cases.MULTIPLES)
    )
    wanted = (
        (group, trial)
        for group, trial in itertools.takewhile(lambda _: time.perf_counter() - started < 60 * chosen.minutes, trials)
        if (group, trial.label, trial.seed, total, chosen.held) not in done
        and not done.add((group, trial.label, trial.seed, total, chosen.held))
    )
    jobs = (delayed(run)(group, trial, chosen.held) for group, trial in wanted)
    with chosen.out.open("a") as file:
        for row in Parallel(n_jobs=chosen.jobs, return_as="generator_unordered", pre_dispatch=4)(jobs):
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
            told = row.get("failed") or f"{row['verdict']} {' '.join(row['names'])}"
            print(f"{row['group']}, {row['label']}, {row['seed']}: {told} ({row['seconds']:.1f} s)", flush=True)
    print(evidence.tables(rows))
    if chosen.docs:
        evidence.write(rows, Path(__file__).parent.parent / "docs")


if __name__ == "__main__":
    main()
