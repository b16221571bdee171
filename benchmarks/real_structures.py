"""Which structure `model=auto` gives real transformers, and how it predicts the dip that it is not
fitted to: python benchmarks/real_structures.py [--docs]

Station xtz, two transformers and two dips, each fitted in turn, as phasors and as waveforms.
Beside the winner of the race stands in waveforms the model whose machine is held to no range; in
phasors the winner of a race on both dips, its structure with the frequency left out, and how far
the two answers lie apart: what a prediction misses that repeats the fitted dip's answer. Of each
are stored the structure, the motor's share of P, the model's error and epsilon_i, fitted and held
out, and the processor's time; `--docs` writes them into docs/waves.md.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import marked
import numpy as np
from model_error import RECORDS, SHARED

from tractexp.storage import files

STORED = Path(__file__).with_suffix(".json")
DOCS = Path(__file__).parents[1] / "docs" / "waves.md"
MARK = "benchmarks/real_structures.py --docs"
ASKED = ("xtz T1 phasors", "xtz T2 phasors", "xtz T1 waves", "xtz T2 waves")
DIPS = (1, 2)
# the winner of a race on one dip, machines held to no range, the winner of a race on both dips,
# and the structure of the first without the frequency
RACED, FREE, BOTH, WITHOUT = "raced", "free", "both dips", "without frequency"
REPEATED = "repeated"  # the answer of the fitted dip is what the other's is predicted to be
HOWS = {"waves": (RACED, FREE), "phasors": (RACED, BOTH, WITHOUT, REPEATED)}
SHIFTS = np.arange(-3, 3.01, 0.1)  # samples by which the dips' beginnings may be apart
SHOWN = ("record", "fitted", "how", "structure", "share", "error", "epsilon_i", "processor_s")
LEAD = 8  # samples before the dip


def fit(name: str, fitted: int, how: str, won: str) -> dict[str, Any]:
    """One fit, judged by the other dip; `won` is the structure that the race gave."""
    import tractexp

    data = RECORDS[name](SHARED)
    events = [*data.train, *data.validate]
    if how == WITHOUT:
        events = [replace(e, record=replace(e.record, f=None, U_angle=None)) for e in events]
    train, held = [events[fitted - 1]], [events[2 - fitted]]
    row = {"record": name, "fitted": fitted, "how": how}
    if how == REPEATED:
        return row | {"structure": "", "error": [0.0, measure_distance(train[0], held[0])]}
    if how == BOTH:
        train, held = [*train, *held], []
    structure = {FREE: "fifth_order_network", WITHOUT: won}.get(how, "auto")
    physical = False if how == FREE else None
    begun = time.process_time()
    found = tractexp.identify(
        train,
        tractexp.compose(structure, domain=data.domain, physical=physical),
        validate=held,
        optimizer="multistart_least_squares",
        check_intervals=False,
        frequency_swing=0.0,
        unbalance=0.0,
        progress=False,
    )
    result, point = found.result, found.operating_point
    errors = [event["value"] for event in result.model_error["events"]]
    return row | {
        "structure": result.race[0]["name"] if result.race else structure,
        "share": point and point.share,
        "error": errors,
        "epsilon_i": [event.get("epsilon_i") for event in result.events],
        "parameters": result.parameters,
        "race": result.race,
        "processor_s": time.process_time() - begun,
    }


def measure_distance(one: Any, other: Any) -> float:
    """How far the answers P + jQ of two dips lie apart, over the other's, each less its mean before
    and shifted by what lets the voltages agree.
    """
    samples = min(e.record.samples - e.start for e in (one, other))
    near = cut(one, samples)
    shifted = [cut(other, samples, shift) for shift in SHIFTS]
    apart = [float(np.sum((cutout[:2] - near[:2]) ** 2)) for cutout in shifted]
    best = shifted[int(np.argmin(apart))]
    return float(np.linalg.norm(best[2:] - near[2:]) / np.linalg.norm(best[2:]))


def cut(event: Any, samples: int, shift: float = 0.0) -> np.ndarray:
    """U, U2, P and Q (4, N) of an event about its dip, less their means before it."""
    record = event.record
    at = event.start - LEAD + shift + np.arange(samples)
    rows: Sequence[np.ndarray] = (record.U, record.U2, record.P, record.Q)
    index = np.arange(record.samples)
    return np.array([np.interp(at, index, row - row[event.steady].mean()) for row in rows])


def key_of(row: dict[str, Any]) -> tuple[str, int, str]:
    """Which fit a row is of."""
    return row["record"], row["fitted"], row["how"]


def compare_with_free(row: dict[str, Any], rows: list[dict[str, Any]]) -> str:
    """epsilon_i of the held-out dip over that of the free fit."""
    free = next(r for r in rows if key_of(r) == (row["record"], row["fitted"], FREE))
    return f"{row['epsilon_i'][1] / free['epsilon_i'][1]:.2f}"


def tabulate(rows: list[dict[str, Any]]) -> str:
    """Markdown: a line for each race in waveforms."""
    head = ["record", "dip fitted", "structure", "share [%]", "fitted, held out [%]", "ratio"]
    lines = [
        [
            row["record"],
            row["fitted"],
            f"`{row['structure']}`",
            f"{100 * row['share']:.0f}",
            ", ".join(f"{100 * error:.1f}" for error in row["epsilon_i"]),
            compare_with_free(row, rows),
        ]
        for row in rows
        if row["how"] == RACED and row["record"].endswith("waves")
    ]
    return marked.table(head, lines)


def tabulate_phasors(rows: list[dict[str, Any]]) -> str:
    """Markdown: errors of the held-out dip in phasors, dip 1 and dip 2 fitted."""
    lines = []
    for name in (one for one in ASKED if one.endswith("phasors")):
        own = [row for row in rows if row["record"] == name]
        told = [
            ", ".join(f"{100 * row['error'][1]:.1f}" for row in own if row["how"] == how)
            for how in HOWS["phasors"]
        ]
        lines.append([name, *told])
    return marked.table(["record", *HOWS["phasors"]], lines)


def main() -> None:
    chosen = marked.read_command(__doc__ or "", ASKED)
    rows = marked.read_rows(STORED)
    for name in () if chosen.docs else chosen.only:
        for fitted in DIPS:
            won = ""
            for how in HOWS[name.rpartition(" ")[2]]:
                row = fit(name, fitted, how, won)
                won = won or row["structure"]
                rows = [r for r in rows if key_of(r) != key_of(row)] + [row]
                files.write_json(STORED, sorted(rows, key=key_of))
                print({key: row.get(key) for key in SHOWN}, flush=True)
    if chosen.docs:
        marked.replace(DOCS, MARK, f"{tabulate(rows)}\n\n{tabulate_phasors(rows)}")


if __name__ == "__main__":
    main()
