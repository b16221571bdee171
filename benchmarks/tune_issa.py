"""ISSA's settings tuned by Optuna's own sweeper, against the paper's: python
benchmarks/tune_issa.py [trials]

Needs `pip install 'tractexp[optuna]'`. Tunes on one record, each trial a search of its own seed,
and then runs the best settings and the paper's over other seeds on this record and on two that no
trial saw. Writes tune_issa.json.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

STORED = Path(__file__).with_suffix(".json")
BUDGET, SEEDS, DRAWS = 5000, range(1000, 1020), 10_000
SPACE = {
    "optimizer.population": "choice(20,30,50,80,120)",
    "optimizer.producers": "interval(0.05,0.6)",
    "optimizer.perceivers": "interval(0.0,0.5)",
    "optimizer.tent_alpha": "interval(0.05,0.95)",
    "optimizer.levy": "choice(true,false)",
    "optimizer.gaussian": "choice(true,false)",
    "optimizer.tent_perturbation": "choice(true,false)",
}
TUNED, OTHERS = "tibet_50pct", ("tibet_30pct", "tibet_65pct")
EQUAL = ("optimizer=issa", f"budget={BUDGET}", "tracking.enabled=false")


def run(folder: Path, *arguments: str) -> None:
    """A sweep in a folder."""
    subprocess.run(
        [sys.executable, "-m", "tractexp", "-m", *EQUAL, *arguments], cwd=folder, check=True
    )


def tuned(folder: Path, trials: int) -> dict[str, Any]:
    """What Optuna found: best settings, importance of each, the value of each trial."""
    import optuna

    store = f"sqlite:///{folder / 'issa.db'}"
    sweeper = (
        "hydra/sweeper=optuna",
        f"hydra.sweeper.n_trials={trials}",
        "hydra.sweeper.sampler.seed=1",
    )
    where = (
        f"hydra.sweeper.storage={store}",
        "hydra.sweeper.study_name=issa",
        "hydra.sweep.dir=tuning",
    )
    space = (f"{key}={values}" for key, values in SPACE.items())
    run(folder, *sweeper, *where, *space, f"data={TUNED}", "seed=${hydra:job.num}")
    study = optuna.load_study(study_name="issa", storage=store)
    return {
        "best": study.best_params,
        "importance": optuna.importance.get_param_importances(study),
        "values": [trial.value for trial in study.trials],
        "optuna": optuna.__version__,
    }


def searched(folder: Path, name: str, *settings: str) -> list[float]:
    """Where the searches of all seeds ended [pu²], in their order."""
    seeds = f"seed=range({SEEDS.start},{SEEDS.stop})"
    run(folder, *settings, seeds, f"hydra.sweep.dir={name}", "hydra.sweeper.compare=false")
    ends = [
        json.loads(path.read_text(encoding="utf-8"))
        for path in (folder / name).glob("*/status.json")
    ]
    return [end["metrics"]["search_objective"] for end in sorted(ends, key=lambda end: end["seed"])]


def confirmed(folder: Path, best: dict[str, Any]) -> list[dict[str, Any]]:
    """Each record's objectives by the paper's settings and by the best ones, and the ratio of their
    medians.
    """
    rng, rows = np.random.default_rng(0), []
    settings = [f"{key}={str(value).lower()}" for key, value in best.items()]
    for data in (TUNED, *OTHERS):
        paper = np.array(searched(folder, f"paper_{data}", f"data={data}"))
        found = np.array(searched(folder, f"best_{data}", f"data={data}", *settings))
        drawn = rng.integers(0, len(paper), (DRAWS, len(paper)))  # pairs of one seed stay together
        ratios = np.median(found[drawn], axis=1) / np.median(paper[drawn], axis=1)
        rows.append(
            {
                "data": data,
                "paper": paper.tolist(),
                "best": found.tolist(),
                "ratio": float(np.median(found) / np.median(paper)),
                "interval": np.quantile(ratios, [0.025, 0.975]).tolist(),
            }
        )
    return rows


def main(trials: int = 100) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = tuned(folder, trials)
        content = {
            "trials": trials,
            "budget": BUDGET,
            **study,
            "records": confirmed(folder, study["best"]),
        }
    STORED.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(f"{trials} trials, {trials * BUDGET} simulations; best {study['best']}")
    print("importance:", {key: round(value, 2) for key, value in study["importance"].items()})
    for row in content["records"]:
        low, high = row["interval"]
        print(
            f"{row['data']}: median {row['ratio']:.2f} times the paper's ({low:.2f} to {high:.2f})"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
