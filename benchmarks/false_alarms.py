"""How the first test ranks among what chance gives, on development seeds where nothing is missing.

    python false_alarms.py [--count 24] [--jobs 2]        (from the folder benchmarks)

Were chance's draws all there is to it, the share of data sets whose best effect is as rare as a
level of the draws says would be that level. What the search does beyond one linear step, and the
noise's own estimate, make small p more frequent. `NAMING_SHARE` is chosen by it, so that with the
doubts by what is left all false alarms are at most `false_alarms`. Rows go to false_alarms.json; no
rate is ever reported of these seeds.
"""

import argparse
import itertools
import json
import os
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import oracle  # noqa: E402, F401

from hidden_effects import cases  # noqa: E402
from hidden_effects.generator import make  # noqa: E402

RESULTS = Path(__file__).with_name("false_alarms.json")
FITTED, HELD = 3, 1  # events of each data set, as the study has them
LEVELS = (0.01, 0.02, 0.03, 0.04, 0.05, 0.1, 0.2, 0.5)


def ranked(noise: str, planned: cases.Planned) -> dict:
    """The rank of the best effect among chance's draws, from 0 to 1, and p of what the base model
    leaves.
    """
    from tractexp.configuration.plugin import get
    from tractexp.discrepancy.disagreement import examine_base_fit
    from tractexp.inference.base_fit import fit_base_model
    from tractexp.inference.catalogue import build_catalogue
    from tractexp.inference.context import Context
    from tractexp.inference.criteria import Criteria
    from tractexp.inference.effort import Effort
    from tractexp.inference.records import Records
    from tractexp.model.model import compose
    from tractexp.record import Record, detect

    made = make(planned.make().case, planned.seed)[:FITTED]
    events = [
        detect(Record(f"event{k + 1}", **r, source=f"{k}").check()) for k, r in enumerate(made)
    ]
    model = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
    missing = build_catalogue(model, events)
    first = examine_base_fit(
        fit_base_model(
            Context.from_records(
                model, missing, Records.from_events(events), {}, {}, Criteria(), Effort()
            )
        ),
        0,
    )
    drawn, best = first.chance.least_p, first.scores[0]
    rank = (np.count_nonzero(drawn < best.p) + 1) / (len(drawn) + 1)
    return {
        "noise": noise,
        "seed": planned.seed,
        "best": best.name,
        "rank": round(rank, 4),
        "p_left": first.p_left,
    }


def shares(rows: list[dict]) -> dict[float, float]:
    """The share of data sets in which something is named or doubted, for each level of chance that
    naming may take.
    """
    from tractexp.inference.criteria import Criteria

    ranks, left = (np.array([row[what] for row in rows]) for what in ("rank", "p_left"))
    return {
        level: float(np.mean((ranks <= level) | (left < Criteria().adequate_p))) for level in LEVELS
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=24, help="data sets of each noise")
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    from joblib import Parallel, delayed

    from tractexp.storage import files

    planned = [
        (noise, one)
        for noise in cases.NOISES
        for one in itertools.islice(cases.nulls(noise, events=FITTED + HELD), chosen.count)
    ]
    rows = Parallel(n_jobs=chosen.jobs, verbose=5)(
        delayed(ranked)(noise, one) for noise, one in planned
    )
    files.write(RESULTS, json.dumps(files.make_plain(rows), indent=0) + "\n")
    for level, share in shares(rows).items():
        print(f"level {level:<5g} share {share:.3f}")


if __name__ == "__main__":
    main()
