"""Is what a load does beside a dip seen, and nothing else? `python benchmarks/steadiness.py
[--tables]`.

Dips of loads whose parameters, voltage, sampling rate and frequency are drawn, with noise of 0.1
and 1 %. In each kind the load, or its voltage, also changes for another reason, smeared over the
cycle of a phasor. Counted is what `tractexp.record.detect` makes of it; a record without such a
change is a false alarm where anything is noted, refused or cut. The seeds are of a series that
chose no constant; an earlier one had shown a fault of `USUAL_U`. docs/records.md has the table from
steadiness.json.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import marked
import numpy as np

import tractexp
from tractexp.errors import UserError
from tractexp.record import Base, Event, Record, detect
from tractexp.storage import files

SERIES, COUNT = 2026112702, 200  # seeds of these records, and so many of each kind and noise
NOISES = (1e-3, 1e-2)
STORED = Path(__file__).with_suffix(".json")
PAGE = Path(__file__).parents[1] / "docs" / "records.md"
BEGIN, LENGTH = 2.0, 5.0  # s, where the dip begins and the record ends
NEAR = 0.03  # of the apparent power: P0 and Q0 of the state meant
Course = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Drawn:
    """A record with a change at time `at` [s]; `load` is P + jQ right before the dip, and the dip
    ends at `end` [s].
    """

    record: Record
    at: float
    end: float
    load: complex


def plain(rng: np.random.Generator, noise: float) -> Drawn:
    """A dip of a drawn load; drawn again where the load has no steady state."""
    frequency, rate = float(rng.choice([50.0, 60.0])), float(rng.choice([100.0, 200.0, 500.0]))
    model, duration = tractexp.compose(), rng.uniform(0.06, 0.3)
    while True:
        values = {
            "T_prime": rng.uniform(0.03, 0.3),
            "X_prime": rng.uniform(0.15, 0.6),
            "C": rng.uniform(0.8, 0.97),
            "M": rng.uniform(0.003, 0.015),
            "T_m": rng.uniform(0.2, 0.7),
            "p_v": rng.uniform(0.5, 2.5),
            "q_v": rng.uniform(1.0, 5.0),
        }
        try:
            answer = tractexp.simulate(
                model,
                values,
                depth=rng.uniform(0.1, 0.5),
                duration=duration,
                start=BEGIN,
                length=LENGTH,
                rate=rate,
                fall=0.02,
                recovery=rng.uniform(0.03, 0.1),
                Q0=rng.uniform(0.3, 0.7),
            )
            break
        except UserError:
            continue
    t, U, P, Q = (answer.responses[0].to_frame()[name].to_numpy() for name in "tUPQ")
    U, P, Q = (x + noise * rng.standard_normal(len(t)) for x in (U, P, Q))
    record = Record("drawn", t, U, P, Q, base=Base(frequency=frequency), source="drawn.csv")
    return Drawn(record, np.nan, BEGIN + duration, complex(P[0], Q[0]))


def changed(drawn: Drawn, at: float, course: Course) -> Drawn:
    """The same with its load multiplied by a course of time, 1 right before the dip."""
    record = drawn.record
    return replace(
        drawn,
        record=replace(record, P=record.P * course(record.t), Q=record.Q * course(record.t)),
        at=at,
    )


def step(drawn: Drawn, at: float, before: float, after: float) -> Drawn:
    half = 0.5 / drawn.record.base.frequency
    return changed(drawn, at, lambda t: np.interp(t, [at - half, at + half], [before, after]))


def factor(rng: np.random.Generator, low: float, high: float) -> float:
    """1 more or less a share between `low` and `high`."""
    return float(1 + rng.choice([-1, 1]) * rng.uniform(low, high))


def tap(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    at, record = rng.uniform(1.2, 1.7), drawn.record
    ratio = factor(rng, 0.015, 0.028)
    return replace(
        drawn, record=replace(record, U=record.U * np.where(record.t < at, ratio, 1.0)), at=at
    )


def after(drawn: Drawn, rng: np.random.Generator, left: float) -> Drawn:
    return step(drawn, drawn.end + rng.uniform(0.5, 2.0), 1.0, left)


def sine(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    size, f = rng.uniform(0.05, 0.15), rng.uniform(0.8, 4.0)
    return changed(drawn, BEGIN, lambda t: 1 + size * np.sin(2 * np.pi * f * (t - BEGIN)))


def slope(drawn: Drawn, rng: np.random.Generator) -> Drawn:
    size = rng.choice([-1, 1]) * rng.uniform(0.1, 0.3)
    return changed(drawn, BEGIN, lambda t: 1 + size * np.clip(t - BEGIN, -2, 1))


KINDS: dict[str, Callable[[Drawn, np.random.Generator], Drawn]] = {
    "no change": lambda drawn, rng: drawn,
    "step before, 6 to 10 %": lambda d, rng: step(
        d, rng.uniform(1.2, 1.7), factor(rng, 0.06, 0.1), 1.0
    ),
    "step before, 10 to 90 %": lambda d, rng: step(
        d, rng.uniform(1.2, 1.7), factor(rng, 0.1, 0.9), 1.0
    ),
    "step of the voltage before, 1.5 to 2.8 %": tap,
    "rise or fall before, 10 to 30 % a second": slope,
    "swing before, 10 to 30 %, 0.8 to 4 Hz": sine,
    "switched off after": lambda d, rng: after(d, rng, 0.0),
    "step after, to 40 to 90 %": lambda d, rng: after(d, rng, rng.uniform(0.4, 0.9)),
    "loss in the dip, to 0 to 40 %": lambda d, rng: step(
        d, rng.uniform(BEGIN + 0.03, d.end), 1.0, rng.uniform(0, 0.4)
    ),
}
WORDS = {
    "rise": "not steady before the dip",
    "swing": "not steady before the dip",
    "loss": "% of its power in the dip",
}


def seen(kind: str, drawn: Drawn, event: Event) -> bool:
    """Whether a record is treated as its kind asks: nothing noted, begun after, ended before, or
    the sentence said.
    """
    record, said, cycle = (
        event.record,
        " ".join(event.record.notes),
        1 / drawn.record.base.frequency + event.record.step,
    )
    if kind == "no change":
        return not said and record.samples == drawn.record.samples
    if word := WORDS.get(kind.split()[0]):
        return word in said
    if "after" in kind:
        return bool(drawn.at - 5 * cycle < record.t[-1] < drawn.at + cycle)
    near = (
        abs(complex(event.P0, event.Q0) - drawn.load) < NEAR * abs(drawn.load) + 3 * event.noise_P
    )
    return near and bool(drawn.at - cycle < record.t[event.steady.start] < drawn.at + 3 * cycle)


def right(kind: str, noise: float, k: int) -> bool:
    """Whether record k of a kind is treated as it asks."""
    rng = np.random.default_rng([SERIES, list(KINDS).index(kind), round(1 / noise), k])
    drawn = KINDS[kind](plain(rng, noise), rng)
    try:
        return seen(kind, drawn, detect(drawn.record))
    except UserError:
        return False


def row(kind: str, noise: float, drawn: int = COUNT) -> dict[str, object]:
    return {
        "kind": kind,
        "noise": noise,
        "drawn": drawn,
        "right": sum(right(kind, noise, k) for k in range(drawn)),
    }


def table(stored: list[dict[str, float]]) -> str:
    head = ["what else happens", *(f"noise {100 * n:g} %" for n in NOISES)]
    shares = {
        kind: [f"{r['right'] / r['drawn']:.1%}" for r in stored if r["kind"] == kind]
        for kind in KINDS
    }
    return marked.table(head, [[kind, *cells] for kind, cells in shares.items()])


def main() -> int:
    if sys.argv[1:] != ["--tables"]:
        files.write(
            STORED,
            json.dumps([row(kind, noise) for kind in KINDS for noise in NOISES], indent=1) + "\n",
        )
    marked.replace(
        PAGE, "benchmarks/steadiness.py", table(json.loads(STORED.read_text(encoding="utf-8")))
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
