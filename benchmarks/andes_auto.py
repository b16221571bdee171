"""Which structure `model=auto` gives made loads of ANDES:
python benchmarks/andes_auto.py --count 40 [--seconds S] [--rows FILE]

Sets of `andes_loads`, in order, none left out: a motor with and without stator resistance or a
double cage, beside a ZIP load; half of the sets have noise. One or two of the three dips are
fitted, the others judge. A choice is right where it has the motor and the effects that the load
has, and equal where it predicts the dips that judge as well as these do, within the band of the
race. Rows go to benchmarks/andes_auto.json; sets that have one are not run again, and after S
seconds of processor time no other set is begun.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import andes_loads

import tractexp
from tractexp.errors import UserError
from tractexp.identification.race import AS_GOOD

ROWS = Path(__file__).with_suffix(".json")
SERIES = "auto"


def name_truth(truth: dict[str, Any]) -> str:
    """The choice of model whose motor and effects the load has."""
    if truth["kind"] == "Motor5":
        return "fifth_order_double_cage_resistance"
    has_resistance = truth["motor"]["rs"] > 1e-5
    return "third_order_resistance" if has_resistance else "third_order_zip"


def predict(model: str, fitted: Sequence[Any], held: Sequence[Any]) -> float:
    """The model's error of the dips that judge, as a fraction of their response."""
    fit = tractexp.identify(
        fitted,
        model,
        validate=held,
        optimizer="multistart_least_squares",
        check_intervals=False,
        frequency_swing=0.0,
        unbalance=0.0,
        progress=False,
    )
    error = fit.model_error_held_out
    assert error is not None
    return error.value


def judge(number: int) -> dict[str, Any]:
    """The row of one set; of a set that has no dips, why."""
    begun = time.process_time()
    row: dict[str, Any] = {"number": number}
    try:
        one = andes_loads.set_of(SERIES, number)
    except andes_loads.StalledMotor as error:
        return row | {"verdict": "refused", "why": str(error)}
    made = time.process_time()
    rng = andes_loads.generator(SERIES, number, "noise")
    dips, level = one.dips, 0.0
    if rng.random() < 0.5:
        dips, level = andes_loads.noisy(dips, rng)
    events = andes_loads.events(dips, f"andes{number} dip")
    fitted, held = events[: one.train], events[one.train :]
    true = name_truth(one.truth)
    row |= {"kind": one.truth["kind"], "noise": level, "fitted": one.train, "true": true}
    race = tractexp.compose("auto").fit_for(fitted).race
    won = race[0]["name"]
    row |= {"won": won, "race": {entry["name"]: entry["predicted"] for entry in race}}
    row |= {"making_s": made - begun, "race_s": time.process_time() - made}
    if won == true:
        return row | {"verdict": "right"}
    try:
        errors = {name: predict(name, fitted, held) for name in (won, true)}
    except UserError as error:
        return row | {"verdict": "not judged", "why": str(error)}
    equal = errors[won] <= AS_GOOD * errors[true]
    return row | {"judged": errors, "verdict": "equal" if equal else "worse"}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=float("inf"))
    parser.add_argument("--rows", type=Path, default=ROWS)
    options = parser.parse_args()
    place = options.rows
    rows = json.loads(place.read_text(encoding="utf-8")) if place.exists() else []
    for number in range(len(rows), options.count):
        if time.process_time() > options.seconds:
            break
        rows.append(judge(number))
        place.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
        print({k: v for k, v in rows[-1].items() if k != "race"}, flush=True)
    verdicts = [row["verdict"] for row in rows]
    print({word: verdicts.count(word) for word in sorted(set(verdicts))}, "of", len(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
