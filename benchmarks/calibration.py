"""Are intervals as wide as they should be? python benchmarks/calibration.py [--phasors 440]
[--waves 60]

Simulation-based calibration (Talts et al. 2018): a truth is drawn from the prior of a generator
that is not ours, with its own equations, frame and solver; the product identifies what that load
draws, and the truth gets its rank in what the product reports of a parameter. Ranks of true
intervals are uniform: they crowd at both ends where intervals are too narrow, in the middle where
they are too wide, at one end where estimates are biased. The rank is that of the normal
distribution whose 95 % are the reported interval, each side of the estimate by itself. `phasors`
are sets of `hidden_effects` with nothing missing, two dips under 13 kinds of noise in turn; `waves`
are those of `wave_records`. Rows are appended to calibration.jsonl, so that a study goes on where
it stopped; `--tables` prints what is stored. A row may say which `commit` made it. The seeds are no
other study's.
"""

import argparse
import itertools
import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import model_error  # noqa: E402
import numpy as np  # noqa: E402
import wave_records  # noqa: E402
import waves  # noqa: E402

from hidden_effects import cases  # noqa: E402

STORED = Path(__file__).with_suffix(".jsonl")
SERIES = 48  # of the seeds of waves: `waves.SERIES` are others
BINS = 10  # of the ranks
LEVEL = 0.01  # of the test that ranks are uniform
# standard deviations from the middle of a normal distribution to the end of its 95 %
HALF = 1.959964


def rank(truth: float, value: float, interval: Sequence[float]) -> float:
    """Share of the reported distribution that lies below the truth."""
    from scipy.special import ndtr

    low, high = interval
    side = high - value if truth > value else value - low
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(ndtr(np.nan_to_num(HALF * np.divide(truth - value, side), nan=0.0)))


def ranked(fit: Any, truth: Mapping[str, float]) -> dict[str, Any]:
    """What a row holds of an identification: the rank of each true value, and whether its interval
    holds it.
    """
    result = fit.result
    inside = {
        name: bool(low <= truth[name] <= high)
        for name, (low, high) in result.intervals.items()
        if name in truth
    }
    ranks = {
        name: rank(truth[name], result.parameters[name], result.intervals[name]) for name in inside
    }
    identified = [name for name in inside if result.verdicts[name].startswith("identified")]
    return {"grade": str(fit.grade), "ranks": ranks, "inside": inside, "identified": identified}


def phasors(number: int) -> dict[str, Any]:
    """The set of this number: a load with nothing missing, fitted to two dips."""
    noise = list(cases.NOISES)[number % len(cases.NOISES)]
    seed = nth(cases.seeds(f"calibration of ranks {noise}"), number // len(cases.NOISES))
    data = model_error.data_of(model_error.Task("null", noise, model_error.EXPONENTIAL, seed))
    fit, _, _ = model_error.identification(
        model_error.Task("null", noise, model_error.EXPONENTIAL, seed), data
    )
    return {"noise": noise} | ranked(fit, data.truth)


def of_waves(number: int) -> dict[str, Any]:
    """The record of this number: a drawn load through a drawn fault."""
    case, events = wave_records.drawn_events([SERIES, number])
    row = {"kind": case.kinds[0], "rate": case.sampler.rate}
    fit = waves.identified(events[0])
    return row | ranked(fit, waves.truth_of(case.site, fit))


def nth(some: Iterator[int], n: int) -> int:
    return next(value for k, value in enumerate(some) if k == n)


DOMAINS: dict[str, Callable[[int], dict[str, Any]]] = {"phasors": phasors, "waves": of_waves}


def uniform(ranks: Iterable[float]) -> float:
    """p of Pearson's chi-square that ranks are uniform, over ten bins of equal width."""
    from scipy.stats import chisquare

    counts, _ = np.histogram(list(ranks), BINS, (0, 1))
    return float(chisquare(counts).pvalue)


def study(domain: str, count: int, path: Path) -> Iterator[dict[str, Any]]:
    """Rows of a domain that are not stored yet; what fails is a row with its message."""
    from tractexp.errors import UserError

    there = {(row["domain"], row["number"]) for row in model_error.rows_of(path)}
    for number in (n for n in range(count) if (domain, n) not in there):
        row, started = {"domain": domain, "number": number}, time.process_time()
        try:
            row |= DOMAINS[domain](number)
        except (
            UserError,
            ValueError,
            ArithmeticError,
            RuntimeError,
            np.linalg.LinAlgError,
        ) as error:
            row |= {"failed": f"{type(error).__name__}: {error}"}
        row["cpu"] = time.process_time() - started
        with path.open("a", encoding="utf-8") as out:
            out.write(
                json.dumps(model_error.six_digits(row), ensure_ascii=False, separators=(",", ":"))
                + "\n"
            )
        yield row


def summary(
    rows: Sequence[Mapping[str, Any]], *, identified: bool = False
) -> dict[str, dict[str, Any]]:
    """Of each parameter, in all sets or in those that identify it: ranks by tenths, p that they are
    uniform, and the share of intervals that hold the truth.
    """
    good = [row for row in rows if "failed" not in row]
    content = {}
    for name in good[0]["ranks"]:
        own = [row for row in good if name in row["identified"]] if identified else good
        ranks = [row["ranks"][name] for row in own]
        content[name] = {
            "tenths": np.histogram(ranks, BINS, (0, 1))[0].tolist(),
            "p": uniform(ranks),
            "inside": float(np.mean([row["inside"][name] for row in own])),
        }
    return content


def tables(rows: Sequence[Mapping[str, Any]]) -> str:
    """What is stored, for people: every parameter, in all sets and in those that identify it."""
    lines = [
        "| domain | parameter | sets | ranks by tenths | p, uniform | hold the truth |",
        f"|{6 * '---|'}",
    ]
    for domain, identified in itertools.product(DOMAINS, (False, True)):
        of = [row for row in rows if row["domain"] == domain]
        for name, found in summary(of, identified=identified).items() if of else ():
            tenths, sets = (
                " ".join(map(str, found["tenths"])),
                f"{sum(found['tenths'])}{', identified' * identified}",
            )
            lines.append(
                f"| {domain} | {name} | {sets} | {tenths} | {found['p']:.2g} |"
                f" {found['inside']:.0%} |"
            )
    return "\n".join(lines)


def in_words(rows: Sequence[Mapping[str, Any]]) -> str:
    """The sentences of docs/coverage.md."""
    sentences = []
    for domain in DOMAINS:
        of = [row for row in rows if row["domain"] == domain]
        every, identified = summary(of), summary(of, identified=True)
        held = sorted(found["inside"] for found in every.values())
        sentences.append(
            f"in {len(of)} sets of {domain} {held[0]:.0%} to {held[-1]:.0%} of the intervals hold"
            " the truth. Ranks are"
            f" uniform (chi-square p > {LEVEL}) of all parameters{_but(every)}, and where they are"
            " identified of all"
            f"{_but(identified)}"
        )
    return "; ".join(sentences)


def _but(found: Mapping[str, Mapping[str, Any]]) -> str:
    """The parameters whose ranks are not uniform, as an exception."""
    uneven = [f"`{name}`" for name, of in found.items() if of["p"] < LEVEL]
    return f" but {' and '.join(uneven)}" * bool(uneven)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--phasors", type=int, default=440, help="sets")
    parser.add_argument("--waves", type=int, default=60, help="records")
    parser.add_argument("--out", type=Path, default=STORED)
    parser.add_argument(
        "--tables", action="store_true", help="print what is stored, and run nothing"
    )
    chosen = parser.parse_args()
    for domain in () if chosen.tables else DOMAINS:
        count = getattr(chosen, domain)
        for row in study(domain, count, chosen.out):
            print(
                f"\r{domain}: {row['number'] + 1} of {count}", end="", file=sys.stderr, flush=True
            )
    print(tables(model_error.rows_of(chosen.out)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
