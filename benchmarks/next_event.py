"""Whether the event that is recommended for a tie ends it as often as it says: a row each tie in
next_event.json.

    cd benchmarks && python next_event.py [--first 931000] [--count 120] [--most 30] [--minutes 30]

Small effects of `hidden_effects` in two mild dips, of which an investigation leaves several. The
event it recommends is simulated by the same generator, which shares nothing with the product, and
added to the others; the investigation is made again. Only plain dips and switching are recommended
here: the generator has no phase jump. Seeds begin at 931000 and are used nowhere else.
"""

import argparse
import itertools
import json
import os
import textwrap
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import numpy as np  # isort: skip

import oracle  # noqa: F401

from hidden_effects import Case, Noise
from hidden_effects.generator import Scene, scene
from independent import Dip
from tractexp.configuration.plugin import get
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.investigate import investigate
from tractexp.discrepancy.next_event import choose
from tractexp.discrepancy.next_event.choose import NextEvent
from tractexp.discrepancy.next_event.imagined import ImaginedDip, imagine_dips
from tractexp.domain import PHASORS
from tractexp.inference.context import Context
from tractexp.model.model import compose
from tractexp.record import Event, Record, detect

TABLE = Path(__file__).with_suffix(".json")
BINS = (0.0, 0.05, 0.35, 0.65, 0.95, 1.01)
FIRST, COUNT, MOST, MINUTES = 931_000, 120, 30, 30.0
NOISE = Noise(0.004)
AMONG = ("stator_resistance", "feeder_impedance", "speed_dependent_torque", "exponential_recovery")
SIZES = (0.3, 0.5, 0.8)  # of what an engineer would call noticeable


def hidden(seed: int) -> tuple[str, float, Scene]:
    """Name, size and scene of a data set of two mild dips."""
    rng = np.random.default_rng(seed)
    name, size = AMONG[seed % len(AMONG)], float(rng.choice(SIZES))
    dips = tuple(
        Dip(depth=d, start=0.5, duration=float(rng.uniform(0.1, 0.3)))
        for d in rng.uniform(0.08, 0.35, 2)
    )
    return name, size, scene(Case(name, size, events=dips, noise=NOISE), seed)


def recorded(made: Scene, seed: int) -> list[Event]:
    """The events with their noise, which an added one leaves as they were."""
    noisy = [
        NOISE.add(r, np.random.default_rng([seed, 2, k])) for k, r in enumerate(made.records())
    ]
    return [
        detect(Record(f"event{k}", **r, source=f"made {k}").check()) for k, r in enumerate(noisy, 1)
    ]


def plain(bench: Context, reads: Sequence[str] = ()) -> list[ImaginedDip]:
    """What the generator can make of the events that are tried."""
    return [event for event in imagine_dips(bench, reads) if not event.burden[0]]


def with_event(made: Scene, chosen: NextEvent) -> Scene:
    """The scene with the recommended event at the end."""
    event = chosen.best.event
    dip = Dip(
        depth=event.depth,
        start=0.5,
        duration=event.duration,
        fall=PHASORS.dips.edge,
        rise=PHASORS.dips.edge,
    )
    return replace(made, dips=(*made.dips, dip), static=(*made.static, made.static[0]))


def investigated(events: list[Event]) -> Findings:
    model = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
    return investigate(model, events, (), {}, {}, only=AMONG)


def row(seed: int) -> dict | None:
    """What became of one tie; None where there was none, or the truth was not in it."""
    name, size, made = hidden(seed)
    found = investigated(recorded(made, seed))
    chosen, names = found.next_event, [list(names) for names in found.verdict.sets]
    told = {
        "seed": seed,
        "effect": name,
        "size": size,
        "verdict": found.verdict.word,
        "sets": names,
    }
    if found.verdict.word != "tied":
        return told
    chances = chosen.best
    told |= {
        "event": chosen.best.event.words,
        "predicted_least": chances.least,
        "predicted": float(chances.alone[names.index([name])]) if [name] in names else None,
        "indistinguishable": len(chosen.same),
        "no_event": len(chosen.hopeless),
    }
    more = with_event(made, chosen)
    try:
        again = recorded(more, seed)
    except (ValueError, ArithmeticError) as error:  # a motor that stalls
        return told | {"after": None, "why": str(error)}
    after = investigated(again)
    return told | {
        "after": after.verdict.word,
        "sets_after": [list(names) for names in after.verdict.sets],
    }


def table(rows: Sequence[dict]) -> str:
    """Predicted and seen, as docs/coverage.md has it."""
    ties = [r for r in rows if r["verdict"] == "tied"]
    gone = [r for r in ties if r["after"] in ("named", "candidate")]
    right = [r for r in gone if r["sets_after"] == [[r["effect"]]]]
    lines = [
        "| predicted for the truth | ties | predicted, mean | truth alone left |",
        "| --- | --- | --- | --- |",
    ]
    for low, high in itertools.pairwise(BINS):
        own = [r for r in ties if r["predicted"] is not None and low <= r["predicted"] < high]
        if own:
            mean = sum(r["predicted"] for r in own) / len(own)
            seen = sum(r in right for r in own)
            lines.append(
                f"| {low:.0%} to {min(high, 1.0):.0%} | {len(own)} | {mean:.0%} | {seen} |"
            )
    ended = f"{len(gone)} ended with one event, {len(right)} of them with the truth"
    told = f"{len(rows)} data sets, {len(ties)} ties; {ended}."
    return "\n".join(lines) + "\n\n" + textwrap.fill(told, 120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    for flag, default in (("first", FIRST), ("count", COUNT), ("most", MOST), ("minutes", MINUTES)):
        parser.add_argument(f"--{flag}", type=type(default), default=default)
    given = parser.parse_args()
    choose.imagine_dips = plain
    rows, begun = [], time.monotonic()
    for seed in range(given.first, given.first + given.count):
        try:
            rows.append(row(seed))
        except ValueError as error:  # no load that survives, or an effect too large for it
            rows.append({"seed": seed, "verdict": "not made", "why": str(error)})
        print(json.dumps(rows[-1]), flush=True)
        TABLE.write_text(
            json.dumps({"noise": "white 0.4 %", "among": AMONG, "rows": rows}, indent=1) + "\n"
        )
        ties = sum(r["verdict"] == "tied" for r in rows)
        if ties >= given.most or time.monotonic() - begun > 60 * given.minutes:
            break


if __name__ == "__main__":
    main()
