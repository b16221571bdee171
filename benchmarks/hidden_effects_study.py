"""Run the suites through the product and count: false alarms, names found, abstentions, proposals,
gaps closed.

    python hidden_effects_study.py
        the development set: seeds that were looked at
    python hidden_effects_study.py --frozen COMMIT [--docs]
        the judgement set (from the folder benchmarks)

Each trial is made by the independent generator, its last event held out, and investigated by
`tractexp.discrepancy`. AIC, BIC, RMSE and sparse regression (PySINDy) choose among the same
candidates on the same data. Rows are appended to a JSON-lines file, so that a study can be stopped
and taken up.

The judgement set's seeds follow from the hash of the commit that froze product and generator, so
that nobody could look at them before; it is refused where either is not what that commit holds.
What is named is held against one further event of each data set, that no fit and no choice saw.
`--docs` writes its tables and figures into docs/judgement.md. A later set is drawn by `--frozen
LATER --out judgement_LATER.jsonl` and takes the place of `NEWEST`.
"""

import argparse
import importlib
import itertools
import json
import os
import subprocess
import time
from collections.abc import Container, Iterable, Iterator
from dataclasses import asdict, replace
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import baselines  # noqa: E402
import hidden_effects_evidence as evidence  # noqa: E402
import numpy as np  # noqa: E402
import oracle  # noqa: E402, F401

import tractexp  # noqa: E402
from hidden_effects import cases  # noqa: E402
from hidden_effects.effects import CATALOG, PHYSICAL  # noqa: E402
from hidden_effects.generator import draw_dips, make, scene, truth  # noqa: E402
from hidden_effects.laws import FAMILY  # noqa: E402
from hidden_effects.limits import part_misfits  # noqa: E402
from hidden_effects.outside import OUTSIDE  # noqa: E402

LEFT_OUT = "left out "  # the group of trials whose effect is taken from the catalogue
PAIRED, LARGE = (2.0, 4.0), (2.0, 4.0, 8.0)  # multiples of the detection limit
# what judges and is judged
FROZEN = ("tractexp", "plugins", "tests/oracle/hidden_effects", "tests/oracle/independent")
ROOT, HERE = Path(__file__).parents[1], Path(__file__).parent
NEWEST = HERE / "judgement.jsonl"  # the judgement set
KNOWN = {  # strangers that the catalogue has, too
    "rotor_skin_effect": "second_cage",
    "stator_transients": "stator_transients",
    "load_step": "load_change",
}
HIDDEN = {  # one effect is hidden: group of trials, multiples, effects
    "single": ("", cases.MULTIPLES, (*CATALOG, *KNOWN)),
    "laws": ("law ", (4.0,), FAMILY),
    "outside": ("outside ", LARGE, [name for name in OUTSIDE if name not in KNOWN]),
    "left_out": (LEFT_OUT, LARGE, PHYSICAL),
}
Trials = Iterator[cases.Planned]
ERROR = 0.01  # of the response: how inexact the loads are in which nothing is hidden
SUITES = ("nulls", "nuisances", "inexact", "foreign", *HIDDEN, "field", "loud", "pairs")
UNUSED_STREAMS = 7, 8  # of a seed's numbers: the dip and the noise of an unused event
BEST = 3  # single effects of which the least that any leaves is taken
SAME = {  # effects whose amount is a parameter of the model, in its units
    "stator_resistance": "R_s",
    "speed_dependent_torque": "quadratic_share",
    "second_motor_group": "group_share",
    "undervoltage_trip": "tripped_share",
    "time_skew": "skew",
    "measurement_window": "window",
}


def rows_of(
    name: str, salt: int | None, multiples: Container[float], **settings: int
) -> Iterator[tuple[str, Trials]]:
    """(group, its endless trials) of each row of a suite; hidden effects of these multiples of
    their limits.
    """
    if name == "nulls":
        yield from (
            (f"null, {noise}", cases.nulls(noise, salt, **settings)) for noise in cases.NOISES
        )
    elif name == "nuisances":
        yield "null with nuisances", cases.nuisances(salt, **settings)
    elif name == "inexact":
        yield f"null, error {ERROR:.0%}", cases.inexact(ERROR, salt, **settings)
    elif name == "foreign":
        trials = cases.inexact(ERROR, salt, is_foreign=True, **settings)
        yield f"null, foreign error {ERROR:.0%}", trials
    elif name == "field":
        for multiple, effect in itertools.product((m for m in PAIRED if m in multiples), PHYSICAL):
            yield f"field {multiple:g} x", cases.in_the_field(effect, multiple, salt, **settings)
    elif name == "loud":
        for start, m, effects in (
            ("loud ", 4.0, PHYSICAL),
            ("loud outside ", 8.0, HIDDEN["outside"][2]),
        ):
            if m in multiples:
                yield from (
                    (f"{start}{m:g} x", cases.loud(effect, m, salt, **settings))
                    for effect in effects
                )
    elif name == "pairs":
        for m in (m for m in PAIRED if m in multiples):
            yield f"{name} {m:g} x", cases.several(2, m, salt, **settings)
    else:
        group, sizes, effects = HIDDEN[name]
        for multiple, effect in itertools.product((m for m in sizes if m in multiples), effects):
            yield f"{group}{multiple:g} x", cases.single(effect, multiple, salt, **settings)


def planned(
    suites: Iterable[str], count: int, salt: int | None, multiples: Container[float], events: int
) -> Iterator:
    """(group, trial) of `count` data sets of each row, one of every row before the
    second of any.
    """
    rows = [row for name in suites for row in rows_of(name, salt, multiples, events=events)]
    for _ in range(count):
        yield from ((group, next(trials)) for group, trials in rows)


def run(group: str, planned: cases.Planned, events: int, held: int) -> dict:
    """One data set investigated, its last `held` events kept for validation. What fails is a row
    with its message.
    """
    from tractexp.configuration.plugin import discover
    from tractexp.discrepancy.investigate import investigate
    from tractexp.errors import UserError

    row = {
        "group": group,
        "label": planned.label,
        "seed": planned.seed,
        "events": events,
        "held": held,
    }
    started = time.perf_counter()
    try:
        trial = planned.make()
    except (ValueError, ArithmeticError) as error:
        return row | {
            "failed": f"{type(error).__name__}: {error}",
            "seconds": time.perf_counter() - started,
        }
    hidden = [name for name, _ in trial.case.hidden]
    row |= {
        "truth": sorted((KNOWN | FAMILY).get(n, n) for n in hidden),
        "multiples": list(trial.multiples),
    }
    recorder = trial.case.recorder
    row |= {
        "imperfect": bool(trial.case.imperfections),
        "parts": part_misfits(trial.case, trial.seed),
        "noise": asdict(trial.case.noise),
        "rate": recorder.rate,
        "window": recorder.pmu or recorder.phasor_window,
    }
    only = []
    if group.startswith(LEFT_OUT):
        row["truth"], only = [], [n for n in discover()["effect"] if n not in hidden]
    try:
        records = make(trial.case, trial.seed)
        seen = [detect_event(f"event{k}", one) for k, one in enumerate(records, 1)]
        row["generated"] = time.perf_counter() - started
        model, fitted = compose_model(), events - held
        found = investigate(model, seen[:fitted], seen[fitted:], only=only, seed=0)
        row |= _counted(found) | _compared(found, trial)
        row["closed_unused"] = find_share_unused(found, trial)
    except (UserError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        row["failed"] = f"{type(error).__name__}: {error}"
    return row | {"seconds": time.perf_counter() - started}


def compose_model():
    """The base model: a motor of the third order beside an exponential static load."""
    from tractexp.configuration.plugin import get
    from tractexp.model.model import compose

    return compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())


def detect_event(name: str, columns: dict[str, np.ndarray]):
    """The event in a record of these columns."""
    from tractexp.record import Record, detect

    return detect(Record(name, **columns, source=name).check())


def _counted(found) -> dict:
    """What the product said, and what it said it with."""
    at = found.catalogue
    return {
        "verdict": found.verdict.word,
        "complete": found.verdict.complete,
        "names": sorted(set(at.textbook(found.names))),
        "members": list(found.names),
        "sets": [sorted(set(at.textbook(names))) for names in found.verdict.sets],
        "sparse": baselines.sparse(found),
        "proposal": _proposed(found.proposed),
        "no_proposal": found.proposed.why,
        "chi2": found.train.after.chi2_per_sample,
        "closed": found.train.closed_share,
        "refitted": found.fitted_to_both,
        "closed_held": None if found.validate is None else found.validate.closed_share,
        "explained": found.train.explained_share,
        "explained_held": None if found.validate is None else found.validate.explained_share,
        "gain_held": None
        if found.validate is None
        else [found.validate.gain, found.validate.expected],
        "left_of_all": None if found.verdict.chosen is None else found.verdict.chosen.p_of_all,
        "grade": found.final_grade.adequacy.grade,
        "reason": found.reason,
        "left": [s.p_left for s in found.explanations.steps],
        "left_by": found.last.p_by_test,
        "samples": found.context.samples,
        "refits": _refits(found),
        "predicted": _predicted(found),
        "untestable": sorted(at.untestable),
        "simulations": found.context.effort.simulations,
    }


def _predicted(found) -> list[tuple[list[str], float]]:
    """Sets that were fitted by least squares, the best first, and the model's error with each on
    held-out events; the base model last. None where names went by the deviance.
    """
    if found.evidence.there is None:
        return []
    every = sorted(found.evidence.every, key=lambda row: row.prediction.excess)
    return [([*row.names], row.prediction.error) for row in (*every[:5], found.evidence.base)]


def _refits(found) -> list[tuple[list[str], float, int]]:
    """Every set that the investigation fitted, under one noise: its names, by how much it lowers
    the deviance, and its parameters. What other criteria choose among.
    """
    from tractexp.inference.fitting import refit

    fits = refit(
        found.context,
        found.first.noise,
        [(f.names, f.unit) for f in found.explanations.refits.values()],
    )
    bare = next(f.deviance for f in fits if not f.names)
    textbook = found.catalogue.textbook
    return [
        (sorted(set(textbook(f.names))), bare - f.deviance, f.parameters) for f in fits if f.names
    ]


def _proposed(proposed) -> dict | None:
    """The term of a proposal: where, by which signal, and what it closes."""
    from tractexp.discrepancy.proposal.propose import to_dict

    content = to_dict(proposed, "")
    if content is None:
        return None
    return {k: content["terms"][0][k] for k in ("balance", "signal", "clock")} | {
        "explained": content["explained"]
    }


def _compared(found, trial: cases.Trial) -> dict:
    """What the product said, held against what was made: sizes, places, clean curves, and what was
    to be found.
    """
    from tractexp.discrepancy.discrepancy_json import list_parameters

    told = truth(trial.case, trial.seed)
    row = {
        "places": len(found.places),
        "places_true": sum(_overlaps(p, told["where"]) for p in found.places),
    }
    hidden = [e["name"] for e in told["effects"]]
    if len(hidden) == 1 and list(found.names) == hidden and hidden[0] in SAME:
        own = list_parameters(found)[SAME[found.names[0]]]
        row |= {
            "estimate": own["value"],
            "error": own["standard_error"],
            "amount": told["effects"][0]["amount"],
        }
    made = scene(trial.case, trial.seed)
    clean = _powers(made.records())
    if found.validate is not None:
        other = found.validate.context
        N = other.drive.samples
        sets = [(), found.names]  # members of families have kernels of their own
        got = (
            other.residuals_of(np.array(found.validate.units), sets)
            + other.drive.measurements
            - clean[:, -N:]
        )
        before, after = np.sum(got**2, axis=(1, 2))
        row["closed_true"] = 1 - after / before
    # a stranger may have the name of an effect of waves
    textbook = {name for name, _ in made.effects} & CATALOG.keys()
    if made.effects and not found.catalogue.untestable.keys() & textbook:
        without = _powers(replace(made, effects=()).records())
        N = found.context.drive.samples
        change = (clean - without)[:, :N]
        first = found.first
        projection = first.projection.replace_residuals(
            found.context.whiten(first.noise, -change[None])
        )
        row |= {
            "lambda": float(projection.r[0] @ projection.r[0]),
            "lambda_left": _left(found, clean[:, :N]),
        }
    return row


def find_share_unused(found, trial: cases.Trial) -> float | None:
    """The share of the base model's squared error that what is kept takes away of an unused event;
    None where nothing is kept, or where the load does not survive the event.
    """
    from tractexp.discrepancy.held_out import compare_on

    if (chosen := found.verdict.chosen) is None:
        return None
    try:
        record = make_unused(trial)
    except (ValueError, ArithmeticError):
        return None
    fit = chosen.reported_fit
    event = detect_event("unused", record)
    return compare_on(found.context, [event], found.bare, [fit])[fit.names].closed_share


def make_unused(trial: cases.Trial) -> dict[str, np.ndarray]:
    """One more event of the load, with its own dip and noise."""
    case, made = trial.case, scene(trial.case, trial.seed)
    draws, noise = (np.random.default_rng([trial.seed, k]) for k in UNUSED_STREAMS)
    dips = draw_dips(draws, 1, made.recorder, case.needs("swing"), case.needs("negative"))
    static = made.load.static
    (record,) = replace(made, dips=dips, static=(complex(static.P, static.Q),)).records()
    return case.noise.add(record, noise)


def _left(found, clean: np.ndarray) -> float:
    """Non-centrality that the best effect of the catalogue leaves of clean curves (2, N), refitted
    to the noisy ones.

    At its fit the problem is linear enough: what its parameters and the nuisances can still take is
    projected out.
    """
    from tractexp.discrepancy.explanations import search_effect_sets
    from tractexp.inference.linearization import linearize_fit

    bench, first, refits = found.context, found.first, found.explanations.refits
    singles = [
        f
        for names, f in refits.items()
        if len(names) == 1 and names == found.catalogue.textbook(names)
    ]
    singles = singles or search_effect_sets([first], {(): first.fit}, 1, lambda line: None)
    left = []
    for fit in sorted(singles, key=lambda f: f.cost)[:BEST]:
        t = linearize_fit(bench, fit, first.noise)
        off = (t.residual + bench.drive.measurements - clean) * bench.valid
        rows = (
            t.build_score_test(first.noise)
            .replace_residuals(bench.whiten(first.noise, off[None]))
            .r[0]
        )
        left.append(float(rows @ rows))
    return min(left)


def _powers(records: list[dict]) -> np.ndarray:
    """P and Q of all events end to end, (2, N)."""
    return np.concatenate([np.stack([r["P"], r["Q"]]) for r in records], axis=1)


def _overlaps(place, where: list[dict]) -> bool:
    """Whether a place that was found overlaps one in which something was changed."""
    return any(
        place.event == f"event{w['event'] + 1}"
        and place.start <= w["end"]
        and place.end >= w["start"]
        for w in where
    )


def commit_of(commit: str) -> str:
    """The whole hash of the commit that froze a judgement set, from which its seeds are drawn.

    Refused where what judges or is judged has changed since, or is imported from another copy of
    the project.
    """
    git = ("git", "-C", str(ROOT))
    told = subprocess.run(
        [*git, "rev-parse", "--verify", f"{commit}^{{commit}}"], capture_output=True, text=True
    )
    if told.returncode:
        raise SystemExit(
            f"there is no commit '{commit}' in {ROOT}; give that which froze product and generator"
        )
    for package in (tractexp, importlib.import_module("tractexp_plugins")):
        if (there := Path(str(package.__file__)).resolve().parents[1]) != ROOT.resolve():
            raise SystemExit(
                f"{package.__name__} is that of {there}, not of {ROOT}: pip install -e {ROOT}"
            )
    changed = subprocess.run([*git, "diff", "--quiet", commit, "--", *FROZEN], check=False)
    if changed.returncode:
        raise SystemExit(
            f"{', '.join(FROZEN)} have changed since {commit}: check that commit out, or freeze"
            " anew"
        )
    return told.stdout.strip()


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--frozen",
        metavar="COMMIT",
        help="the judgement set of this commit; else the development set",
    )
    parser.add_argument("--suite", action="append", choices=SUITES, help="default: all")
    parser.add_argument("--count", type=int, default=5, help="data sets of each row")
    parser.add_argument(
        "--multiple", action="append", type=float, choices=cases.MULTIPLES, help="default: all"
    )
    parser.add_argument("--events", type=int, default=3, help="events fitted")
    parser.add_argument("--held", type=int, default=1, help="events held out beside them")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--out", type=Path, help="default: the judgement set, or outputs/hidden_effects.jsonl"
    )
    parser.add_argument(
        "--minutes", type=float, default=1e9, help="begin no further trial after so long"
    )
    parser.add_argument(
        "--docs",
        action="store_true",
        help="write tables and figures of the judgement set, and stop",
    )
    chosen = parser.parse_args()
    out = chosen.out or (NEWEST if chosen.frozen else Path("outputs/hidden_effects.jsonl"))
    if chosen.docs:
        evidence.write(evidence.read(NEWEST), ROOT / "docs")
        return
    from joblib import Parallel, delayed

    from tractexp.storage import files

    frozen = commit_of(chosen.frozen) if chosen.frozen else None
    salt = int(frozen[:12], 16) if frozen else None
    out.parent.mkdir(parents=True, exist_ok=True)
    rows = evidence.read(out) if out.exists() else []
    done = {(r["group"], r["label"], r["seed"], r["events"], r["held"]) for r in rows}
    started, total = time.perf_counter(), chosen.events + chosen.held
    trials = planned(
        chosen.suite or SUITES, chosen.count, salt, chosen.multiple or cases.MULTIPLES, total
    )
    wanted = (t for t in trials if (t[0], t[1].label, t[1].seed, total, chosen.held) not in done)
    in_time = itertools.takewhile(
        lambda _: time.perf_counter() - started < 60 * chosen.minutes, wanted
    )
    jobs = (delayed(run)(group, trial, total, chosen.held) for group, trial in in_time)
    with out.open("a") as file:
        for row in Parallel(n_jobs=chosen.jobs, return_as="generator_unordered", pre_dispatch=4)(
            jobs
        ):
            rows.append(files.make_plain(row | {"frozen": frozen}))
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            told = row.get("failed") or f"{row['verdict']} {' '.join(row['names'])}"
            print(
                f"{row['group']}, {row['label']}, {row['seed']}: {told} ({row['seconds']:.1f} s)",
                flush=True,
            )
    print(evidence.tables(rows))


if __name__ == "__main__":
    main()
