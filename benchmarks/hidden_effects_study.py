"""Run the suites through the product and count: false alarms, names found, abstentions, gaps closed.

    python hidden_effects_study.py --suite nulls --count 100        (from the folder benchmarks)

Each trial is made by the independent generator, investigated by `tractexp.discrepancy`, and also ranked by AIC, BIC
and RMSE on the same refits. Rows are appended to a JSON-lines file, so that a study can be stopped and taken up.
"""

import argparse
import json
import os
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from hidden_effects import cases  # noqa: E402
from hidden_effects.effects import CATALOG  # noqa: E402
from hidden_effects.generator import make  # noqa: E402
from hidden_effects.outside import OUTSIDE  # noqa: E402


def suite(name: str, count: int, events: int) -> Iterator[tuple[str, cases.Trial]]:
    """(group, trial) of one suite; `count` data sets of each row."""
    if name == "nulls":
        for noise in cases.NOISES:
            yield from ((f"null, {noise}", t) for t in cases.nulls(noise, count, events=events))
    elif name == "nuisances":
        yield from (("null with nuisances", t) for t in cases.nuisances(count, events=events))
    elif name == "single":
        for multiple in cases.MULTIPLES:
            for effect in CATALOG:
                yield from ((f"{multiple:g} x", t) for t in cases.single(effect, multiple, count, events=events))
    elif name == "outside":
        for multiple in (2.0, 4.0, 8.0):
            for effect in OUTSIDE:
                yield from (
                    (f"outside {multiple:g} x", t) for t in cases.single(effect, multiple, count, events=events)
                )
    elif name == "pairs":
        for multiple in (2.0, 4.0):
            yield from ((f"pairs {multiple:g} x", t) for t in cases.pairs(multiple, count, events=events))
    else:
        raise SystemExit(f"there is no suite '{name}'; there are nulls, nuisances, single, outside, pairs")


def run(group: str, trial: cases.Trial) -> dict:
    """One data set investigated. What fails is a row too, with its message."""
    from tractexp.discrepancy.investigate import investigate
    from tractexp.errors import UserError
    from tractexp.model.model import compose
    from tractexp.plugin import get
    from tractexp.record import Record, detect

    truth = () if trial.case.effect is None else trial.case.effect
    row = {"group": group, "label": trial.label, "truth": sorted([truth] if isinstance(truth, str) else truth)}
    row |= {"seed": trial.seed, "multiples": list(trial.multiples), "events": trial.case.events}
    started = time.perf_counter()
    try:
        records = make(trial.case, trial.seed)
        made = time.perf_counter() - started
        events = [detect(Record(f"event{k + 1}", **r).check()) for k, r in enumerate(records)]
        model = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
        finding = investigate(model, events, (), {}, {}, seed=0)
        row |= _counted(finding) | {"generated": made}
    except (UserError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        row["failed"] = f"{type(error).__name__}: {error}"
    return row | {"seconds": time.perf_counter() - started}


def _counted(finding) -> dict:
    base, samples = finding.explanation.refits[()], finding.study.likelihood.samples
    return {
        "verdict": finding.verdict,
        "names": list(finding.names),
        "sets": [list(s) for s in finding.sets],
        "chi2": finding.train.after.chi2_per_sample,
        "closed": finding.train.closed,
        "p_first": finding.first.scores[0].p if finding.first.scores else 1.0,
        "first": finding.first.scores[0].name if finding.first.scores else "",
        "stages": [[list(s.fit.names), s.scores[0].name, s.scores[0].p] for s in finding.explanation.stages],
        "unrest": [s.p_left for s in finding.explanation.stages],
        "deviance": base.deviance,
        "samples": samples,
        "drops": {s.name: s.drop for s in finding.first.scores},
        "untestable": sorted(finding.catalogue.untestable),
        "simulations": finding.study.simulations,
    }


def summarize(rows: Iterable[dict]) -> list[dict]:
    """One line per group: how often each verdict came, and how often it was right."""
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(row["group"], []).append(row)
    lines = []
    for group, members in groups.items():
        good = [r for r in members if "failed" not in r]
        found = [r for r in good if r["verdict"] != "none"]
        named = [r for r in good if r["verdict"] == "named"]
        lines.append(
            {
                "group": group, "n": len(members), "failed": len(members) - len(good),
                **{v: sum(r["verdict"] == v for r in good) for v in ("none", "named", "tied", "unexplained")},
                "unique_right": sum(sorted(r["names"]) == r["truth"] for r in named),
                "truth_in_set": sum(r["truth"] in [sorted(s) for s in r["sets"]] for r in found),
                "first_right": sum(r["first"] in r["truth"] for r in good),
                "seconds": float(np.median([r["seconds"] for r in members])),
            }
        )  # fmt: skip
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", action="append", required=True)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--events", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("outputs/hidden_effects.jsonl"))
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no further trial after so long")
    chosen = parser.parse_args()
    from joblib import Parallel, delayed

    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    before = [json.loads(line) for line in chosen.out.read_text().splitlines()] if chosen.out.exists() else []
    done = {(r["group"], r["label"], r["seed"], r["events"]) for r in before}
    started = time.perf_counter()
    wanted = (
        (group, trial)
        for name in chosen.suite
        for group, trial in suite(name, chosen.count, chosen.events)
        if (group, trial.label, trial.seed, trial.case.events) not in done
        and time.perf_counter() - started < 60 * chosen.minutes
    )
    jobs = (delayed(run)(group, trial) for group, trial in wanted)
    with chosen.out.open("a") as file:
        for row in Parallel(n_jobs=chosen.jobs, return_as="generator_unordered", pre_dispatch=4)(jobs):
            before.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
            told = row.get("failed") or f"{row['verdict']} {' '.join(row['names'])}"
            print(f"{row['group']}, {row['label']}, {row['seed']}: {told} ({row['seconds']:.1f} s)", flush=True)
    for line in summarize(before):
        print(json.dumps(line))


if __name__ == "__main__":
    main()
