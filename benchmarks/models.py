"""Time per Runge-Kutta step and state of every model, objective included, beside the base model. Run: see --help.

Every motor beside the exponential static load, and every static load beside the base motor; 200 candidates, 1,000
samples, one thread. The models take turns, round after round, and each one's fastest round counts: the figure least
disturbed by other work on the machine. Time per state divides by the real numbers that move, a phasor being two. The
static load and the sums of squares cost every model the same (motor `none`): a model of one state carries all of it.
"""

import argparse
import json
import math
import time

import numpy as np
from simulation import CANDIDATES, SAMPLES, excitation

from tractexp.model.drive import Drive
from tractexp.model.model import compose
from tractexp.plugin import discover, get

BASE = ("electromechanical", "exponential")
MOST = 25.0  # ns per step and candidate
TIMES = 3.0  # of the base model's time per step and state


def pairs() -> list[tuple[str, str]]:
    """The base model first, then each plugin beside the base's other part."""
    others = discover()
    motors = [(name, BASE[1]) for name in sorted(others["model/motor"]) if name != BASE[0]]
    statics = [(BASE[0], name) for name in sorted(others["model/static"]) if name != BASE[1]]
    return [BASE, *motors, *statics]


def prepare(motor: str, static: str):
    """A model's number of moving states, and a call that evaluates all candidates."""
    model = compose(get("model/motor", motor)(), get("model/static", static)())
    rng = np.random.default_rng(0)
    values = np.array([p.default for p in model.parameters]) * rng.uniform(0.95, 1.05, (CANDIDATES, len(model.names)))
    drive = Drive.of([excitation()])
    refused = model.errors(drive, values).refused.sum()  # compiles; the refused would be skipped, and look fast
    if refused:
        raise SystemExit(f"{refused} candidates of {motor}, {static} have no steady state; their time means nothing")
    moving = sum(derivative != 0 for _, derivative, _ in model.equations.real_states())
    return moving, lambda: model.errors(drive, values)


def measure(rounds: int) -> list[dict]:
    """One row a model, fastest round of each."""
    prepared = {pair: prepare(*pair) for pair in pairs()}
    fastest = dict.fromkeys(prepared, math.inf)
    for _ in range(rounds):
        for pair, (_, call) in prepared.items():
            started = time.perf_counter()
            call()
            fastest[pair] = min(fastest[pair], time.perf_counter() - started)
    step = {pair: 1e9 * seconds / CANDIDATES / (SAMPLES - 1) for pair, seconds in fastest.items()}
    base = step[BASE] / prepared[BASE][0]
    rows = []
    for (motor, static), (states, _) in prepared.items():
        own = step[motor, static]
        per_state = own / states if states else None
        rows.append({
            "motor": motor, "static": static, "states": states, "nanoseconds_per_step": own,
            "nanoseconds_per_step_and_state": per_state, "times_base_per_state": per_state and per_state / base,
            "times_base": own / step[BASE],
        })  # fmt: skip
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON only")
    parser.add_argument("--rounds", type=int, default=200)
    chosen = parser.parse_args()
    rows = measure(chosen.rounds)
    if not chosen.json:
        print(
            f"{'motor':<20}{'static':<24}{'states':>6}{'ns/step':>9}{'of base':>9}{'ns/step/state':>15}{'of base':>9}"
        )
        for row in rows:
            line = f"{row['motor']:<20}{row['static']:<24}{row['states']:>6}{row['nanoseconds_per_step']:>9.2f}"
            line += f"{row['times_base']:>9.2f}"
            if row["states"]:
                line += f"{row['nanoseconds_per_step_and_state']:>15.2f}{row['times_base_per_state']:>9.2f}"
            print(line)
        print()
    over = [f"{r['motor']}, {r['static']}" for r in rows if (r["times_base_per_state"] or 0) > TIMES]
    slow = [f"{r['motor']}, {r['static']}" for r in rows if r["nanoseconds_per_step"] > MOST]
    print(
        json.dumps(
            {"models": rows, f"above_{TIMES:g}_times_base_per_state": over, f"above_{MOST:g}_ns": slow}, indent=2
        )
    )


if __name__ == "__main__":
    main()
