"""Other laws and other places: what was said of them before families, and what is said with them.

    python families.py [--docs]            (from the folder benchmarks)

Development seeds (from 800000), which thresholds were chosen on: no confirmation. Each data set is made by
`hidden_effects`, three events fitted and one held out, white noise of 0.5 %, whole catalogue. *Before* is the same
program with no member of any family tried. Rows are appended to families.jsonl, so that it can be stopped and taken up;
`--docs` writes the table into docs/missing-effects.md.
"""

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import marked
import oracle  # noqa: F401

import tractexp  # noqa: F401 before NumPy: it keeps BLAS to one thread
from hidden_effects import Case, Noise, make
from hidden_effects.generator import scene
from hidden_effects.laws import FAMILY

ROWS, DOCS = Path(__file__).with_suffix(".jsonl"), Path(__file__).parents[1] / "docs" / "missing-effects.md"
MARK = "benchmarks/families.py --docs"  # what makes the table there
NOTHING, SHARP = "nothing", "time_skew"  # what is hidden where nothing is; skew with edges of a few samples
EDGE = 0.008  # s
CASES = [
    ("static_part_trip", 1.0, (800011, 800101, 800102)),
    ("motor_share_trip", 1.0, (800103, 800104)),
    ("trip_in_two_stages", 1.5, (800016, 800105)),
    ("drift_that_begins_at_the_dip", 2.0, (800013, 800106)),
    ("knee_saturation", 0.5, (800012, 800107)),
    ("delayed_power_limit", 1.5, (800112, 800113)),
    ("ramped_return", 2.0, (800114, 800115)),
    ("rectified_power", 1.5, (800116, 800117)),
    ("undervoltage_trip", 1.0, (800011, 800015)),
    ("magnetic_saturation", 0.5, (800014,)),
    ("load_drift", 1.0, (800108,)),
    (SHARP, 5.65, (800002, 800004)),
    ("rotor_skin_effect", 1.0, (800109,)),
    ("subsynchronous_ring", 2.0, (800110,)),
    ("tap_changer_step", 2.0, (800111,)),
    (NOTHING, 1.0, (800050, 800051, 800052, 800053, 800054, 800055)),
]
STRANGERS = ("rotor_skin_effect", "subsynchronous_ring", "tap_changer_step")


def wanted() -> Iterator[tuple[str, float, int, bool]]:
    """(hidden, size, seed, whether members of families are tried)."""
    for families in (True, False):
        for hidden, size, seeds in CASES:
            yield from ((hidden, size, seed, families) for seed in seeds)


def run(hidden: str, size: float, seed: int, families: bool) -> dict:
    """One data set investigated."""
    from tractexp.discrepancy.criteria import Criteria
    from tractexp.discrepancy.discrepancy_json import content
    from tractexp.discrepancy.investigate import investigate
    from tractexp.model.model import compose
    from tractexp.plugin import get
    from tractexp.record import Record, detect

    case = Case(None if hidden == NOTHING else hidden, size, events=4, noise=Noise(0.005))
    if hidden == SHARP:
        drawn = scene(replace(case, effect=None), seed)
        case = replace(case, load=drawn.load, events=tuple(replace(d, fall=EDGE, rise=EDGE) for d in drawn.dips))
    events = [detect(Record(f"event{k + 1}", **r, source=f"{k}").check()) for k, r in enumerate(make(case, seed))]
    model = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
    criteria = Criteria() if families else Criteria(family_p=0.0)
    began = time.perf_counter()
    found = investigate(model, events[:3], events[3:], criteria=criteria, seed=0)
    told = content(found)
    forms = {name: {k: v for k, v in form.items() if k != "curve"} for name, form in told["forms"].items()}
    return {
        "hidden": hidden, "size": size, "seed": seed, "families": families, "verdict": told["verdict"],
        "effects": told["effects"], "name_sets": told["name_sets"], "forms": forms,
        "closed_held": found.validate and found.validate.closed, "seconds": round(time.perf_counter() - began, 1),
    }  # fmt: skip


def said(row: dict) -> str:
    """What was said of one data set, in words."""
    if row["verdict"] != "named":
        return row["verdict"]
    return " and ".join(f"{name} {form['differs']}".strip() for name, form in row["forms"].items())


def table(rows: list[dict]) -> list[str]:
    """The table of what was said, without and with families."""
    lines = ["| hidden | its family | seed | without members | with members |", "|---|---|---|---|---|"]
    for hidden, size, seeds in CASES:
        for seed in seeds:
            mine = [r for r in rows if (r["hidden"], r["size"], r["seed"]) == (hidden, size, seed)]
            both = [next((said(r) for r in mine if r["families"] == on), "not run") for on in (False, True)]
            family = FAMILY.get(hidden, "" if hidden in (NOTHING, *STRANGERS) else "itself")
            lines.append(f"| {hidden} | {family} | {seed} | {both[0]} | {both[1]} |")
    return lines


def main() -> None:
    """Run what is missing; write the table where it is asked for."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--docs", action="store_true", help="write the table into docs/missing-effects.md and stop")
    asked.add_argument("--only", default="", help="only what is hidden under this name")
    chosen = asked.parse_args()
    rows = [json.loads(line) for line in ROWS.read_text().splitlines()] if ROWS.exists() else []
    if chosen.docs:
        marked.replace(DOCS, MARK, "\n".join(table(rows)))
        return
    done = {(r["hidden"], r["size"], r["seed"], r["families"]) for r in rows}
    for trial in wanted():
        if trial in done or chosen.only not in ("", trial[0]):
            continue
        row = run(*trial)
        with ROWS.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        print(row["hidden"], row["seed"], row["families"], said(row), f"{row['seconds']} s", flush=True)


if __name__ == "__main__":
    main()
