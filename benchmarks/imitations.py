"""Which effects predict alike, by simulation: python imitations.py [--count N] [--docs]

In loads of the independent generator one effect is hidden, at four times its detection limit under
noise of 0.5 %. Every effect of the catalogue by itself is fitted to three dips, and takes away a
share of what the base model leaves of the squares of a fourth, which nothing was fitted to and
which has next to no noise. One that takes away as much as a name must (`Criteria.divides`), in the
median of the loads, *imitates* what is hidden: such effects are of its class. Loads in which none
does are left out: there the fourth dip does not show what is hidden.

The seeds are of the development series, so that classes are fixed before a judgement set is drawn.
Rows are appended to imitations.jsonl, a row a load; `--docs` writes the classes into imitations.md.
"""

import argparse
import itertools
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import hidden_effects_evidence as evidence  # noqa: E402
import hidden_effects_study as study  # noqa: E402
import marked  # noqa: E402
import numpy as np  # noqa: E402

from hidden_effects import cases  # noqa: E402
from hidden_effects.effects import PHYSICAL  # noqa: E402
from hidden_effects.generator import make  # noqa: E402
from hidden_effects.noise import Noise  # noqa: E402
from tractexp.discrepancy.gap import share_gone  # noqa: E402
from tractexp.inference.criteria import Criteria  # noqa: E402

STORED = Path(__file__).with_suffix(".jsonl")
PAGE, MARK = STORED.with_suffix(".md"), "benchmarks/imitations.py --docs"
EFFECTS = (*PHYSICAL, "rotor_skin_effect", "stator_transients")
MULTIPLE = 4.0
FITTED = 3
QUIET = Noise(0.0005)  # of the dip that is not fitted
Row = dict[str, Any]


def find_imitators(rows: list[Row]) -> dict[str, tuple[str, ...]]:
    """Of each hidden effect those that imitate it, itself not among them."""
    least = share_gone(Criteria().divides)
    telling: dict[str, list[Row]] = {}
    for row in rows:
        if max(row["shares"].values(), default=0.0) >= least:
            telling.setdefault(row["hidden"], []).append(row["shares"])
    imitators = {}
    for hidden, loads in telling.items():
        names = {name for shares in loads for name in shares} - {hidden}
        middle = {name: np.median([shares.get(name, 0.0) for shares in loads]) for name in names}
        imitators[hidden] = tuple(sorted(name for name in names if middle[name] >= least))
    return imitators


def measure_shares(name: str, seed: int) -> dict[str, float]:
    """Of every effect the share of the base model's squares that it takes away of the dip that was
    not fitted, by the textbook names. Raises where the load cannot be made.
    """
    from tractexp.discrepancy.disagreement import examine_base_fit
    from tractexp.discrepancy.explanations import search_effect_sets
    from tractexp.discrepancy.prediction import predict
    from tractexp.inference.base_fit import fit_base_model
    from tractexp.inference.catalogue import build_catalogue
    from tractexp.inference.context import Context
    from tractexp.inference.effort import Effort
    from tractexp.inference.fitting import refit
    from tractexp.inference.records import Records

    trial = cases.at_limit((name,), MULTIPLE, seed, noise=Noise(0.005), events=FITTED)
    fitted = [study.detect_event(f"dip{k}", one) for k, one in enumerate(make(trial.case, seed))]
    quiet = replace(trial, case=replace(trial.case, noise=QUIET))
    unused = study.detect_event("unused", study.make_unused(quiet))
    model = study.compose_model()
    records = Records.from_events(fitted)
    known = build_catalogue(model, fitted, ())
    context = Context.from_records(model, known, records, {}, {}, Criteria(), Effort(print))
    first = examine_base_fit(fit_base_model(context), 0)
    fits = search_effect_sets([first], {(): first.fit}, 1, lambda line: None)
    at = context.coordinates
    wanted = [(one.names, at.without_faults(one.unit, ())) for one in (first.fit, *fits)]
    there = context.move_to_events([unused])
    left: dict[tuple[str, ...], float] = {}
    for one in refit(context, first.noise, wanted, faults=()):
        family = known.textbook(one.names)
        left[family] = min(predict(there, one).excess, left.get(family, np.inf))
    whole = left.pop(())
    return {family[0]: 1 - excess / whole for family, excess in left.items()}


def run(name: str, seed: int) -> Row:
    """A row: the shares of all effects where one is hidden, or why there are none."""
    row: Row = {"hidden": study.KNOWN.get(name, name), "seed": seed}
    try:
        return row | {"shares": measure_shares(name, seed)}
    except (ValueError, ArithmeticError) as error:
        return row | {"shares": {}, "failed": f"{type(error).__name__}: {error}"}


def make_table(rows: list[Row]) -> str:
    """A line an effect that another one imitates; Markdown."""
    found = find_imitators(rows)
    lines = [
        [tell(hidden), ", ".join(map(tell, names))] for hidden, names in found.items() if names
    ]
    alone = ", ".join(tell(hidden) for hidden, names in found.items() if not names)
    table = marked.table(["hidden", "imitated by"], lines)
    return f"{table}\n\nImitated by none: {alone}. {len(rows)} loads."


def tell(name: str) -> str:
    """A name as code."""
    return f"`{name}`"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=3, help="loads of each effect")
    parser.add_argument("--docs", action="store_true", help="write the classes, and stop")
    asked = parser.parse_args()
    rows = evidence.read(STORED) if STORED.exists() else []
    if asked.docs:
        marked.replace(PAGE, MARK, make_table(rows))
        return
    done = {(row["hidden"], row["seed"]) for row in rows}
    series = {name: cases.seeds(f"imitations {name}") for name in EFFECTS}
    for _, name in itertools.product(range(asked.count), EFFECTS):
        seed = next(series[name])
        if (study.KNOWN.get(name, name), seed) not in done:
            row = run(name, seed)
            with STORED.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            alike = {key: round(share, 2) for key, share in row["shares"].items() if share > 0.5}
            print(name, seed, row.get("failed", alike), flush=True)


if __name__ == "__main__":
    main()
