"""Does the band for the next dip hold? python next_dip.py [--count N] [--seconds S] [--docs]

Loads by the independent generator, of which the base model misses 0 to 5 % of the response, under
white noise of 0.05 to 0.5 %; five dips of 5 to 60 % each. One, two or three of them are fitted, and
each of the others is a next dip: does the worst sample of P and of Q lie within the band? Rows are
appended to next_dip.jsonl, so that a study goes on where it stopped; `--docs` writes their table
into docs/coverage.md. `EVENT_SPREAD` of `tractexp/inference/prediction_band.py` was chosen on
the series `choose`, what noise adds to a worst sample on `judge` and `report`; the series `unseen`,
whose seeds are others, is told.
"""

import argparse
import itertools
import json
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import hidden_effects_evidence as evidence  # noqa: E402
import marked  # noqa: E402
import numpy as np  # noqa: E402

from hidden_effects import cases  # noqa: E402
from hidden_effects.generator import make  # noqa: E402
from hidden_effects.noise import Noise  # noqa: E402

HERE = Path(__file__).parent
ROWS = HERE / "next_dip.jsonl"
PAGE = HERE.parent / "docs" / "coverage.md"
MARK = "benchmarks/next_dip.py"
SERIES = ("choose", "judge", "report", "unseen")
EVENTS = 5
FITTED = (1, 2, 3)
LOADS = {"exact": (0.0,), "inexact to 0.5 or 1 %": (0.005, 0.01), "to 2 or 5 %": (0.02, 0.05)}
ERRORS = (0.0, 0.005, 0.01, 0.02, 0.05)  # of the response, that any model misses
LEVELS = (0.0005, 0.001, 0.002, 0.005)  # pu


def draw(series: str) -> Iterator[tuple[int, float, float]]:
    """Seed, error and noise of each load of a series."""
    for seed in cases.seeds(f"next dip {series}"):
        rng = np.random.default_rng([seed, 9])
        yield seed, float(rng.choice(ERRORS)), float(rng.choice(LEVELS))


def run(seed: int, error: float, level: float) -> list[dict[str, Any]]:
    """A row for each number of fitted dips; one with the reason where a load cannot be made."""
    import tractexp
    from tractexp.errors import UserError

    about = {"seed": seed, "error": error, "noise": level}
    try:
        case = cases.imperfect(cases.Case(noise=Noise(level), events=EVENTS), seed, error)
        records = make(case, seed)
        dips = [tractexp.read(**one, name=f"dip{k}")[0] for k, one in enumerate(records, start=1)]
    except (ValueError, ArithmeticError) as reason:
        return [about | {"failed": str(reason)}]
    rows = []
    for count in FITTED:
        try:
            fit = tractexp.identify(
                dips[:count],
                optimizer="multistart_least_squares",
                check_intervals=False,
                progress=False,
            )
            judged = [judge(fit.predict(dip), dip) for dip in dips[count:]]
        except UserError as reason:
            rows.append(about | {"fitted": count, "failed": str(reason)})
            continue
        told = {"grade": fit.grade, "share": fit.result.next_dip.get("share"), "next": judged}
        rows.append(about | {"fitted": count, **told})
    return rows


def judge(response: Any, dip: Any) -> dict[str, Any]:
    """The worst sample from the dip on and half the band, of P and of Q, over S before it."""
    S_0 = float(np.hypot(dip.P0, dip.Q0))
    left = np.subtract(response.measured, (response.P, response.Q))[:, dip.start :]
    worst = np.abs(left).max(axis=1) / S_0
    band = None if response.band is None else [half / S_0 for half in response.band]
    return {"depth": dip.depth, "worst": worst.tolist(), "band": band}


def tabulate(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Markdown: how often the band held, by the number of fitted dips and by what the base model
    misses of the response, with exact intervals, and how wide it was beside the worst sample."""
    head = ["dips fitted", "next dips", "P held", "Q held", "half band of P", "worst of P"]
    done = [row for row in rows if "next" in row]
    groups = [(str(count), [r for r in done if r["fitted"] == count]) for count in FITTED]
    for label, errors in LOADS.items():
        groups.append((f"all, {label}", [r for r in done if r["error"] in errors]))
    groups.append(("all", done))
    lines = []
    for label, some in groups:
        told = [one for row in some for one in row["next"] if one["band"] is not None]
        if not told:
            continue
        worst, band = (np.array([one[key] for one in told]) for key in ("worst", "band"))
        held = [evidence.share(int(one), len(told)) for one in (worst <= band).sum(axis=0)]
        medians = [f"{100 * np.median(one[:, 0]):.2g}%" for one in (band, worst)]
        lines.append([label, len(told), *held, *medians])
    loads = {row["seed"] for row in done}
    without = sum(one["band"] is None for row in done for one in row["next"])
    told = f"{len(loads)} loads; medians, of S; {without} dips without a band."
    return [*marked.table(head, lines).splitlines(), "", told]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--series", choices=SERIES, default=SERIES[-1])
    parser.add_argument("--count", type=int, default=60, help="loads of the series")
    parser.add_argument("--seconds", type=float, default=np.inf, help="begin none later")
    parser.add_argument("--docs", action="store_true", help="write what is stored into the page")
    asked = parser.parse_args()
    until = time.monotonic() + asked.seconds
    rows = [json.loads(line) for line in ROWS.read_text().splitlines()] if ROWS.exists() else []
    known = {row["seed"] for row in rows}
    if not asked.docs:
        for seed, error, level in itertools.islice(draw(asked.series), asked.count):
            if seed in known or time.monotonic() > until:
                continue
            new = [{"series": asked.series, **row} for row in run(seed, error, level)]
            with ROWS.open("a", encoding="utf-8") as file:
                file.writelines(json.dumps(row) + "\n" for row in new)
            rows += new
    lines = tabulate([row for row in rows if row["series"] == asked.series])
    print("\n".join(lines))
    if asked.docs:
        marked.replace(PAGE, MARK, "\n".join(lines))


if __name__ == "__main__":
    main()
