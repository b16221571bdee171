"""Are effects hidden in waveforms named, and nothing where nothing is? python
benchmarks/waves_hidden.py [--count 3]

Loads of `wave_records` with one thing more, by laws of `independent.circuit`: two dips each, one
held out, investigated by `domain="waves"` with the whole catalogue, or with `--few` what is hidden
here. A law is the *same* as the plugin's (other equations, frame and solver) or an *other* one;
sizes are those below, and a third and a tenth of them. Rows are appended to a file, so that a study
goes on where it stopped; --store writes what was named beside this file. `--series calibration` has
other seeds, on which thresholds may be looked at.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import oracle  # noqa: E402, F401
import wave_records as waves  # noqa: E402

from independent import Machine, Stall  # noqa: E402
from independent.circuit import (  # noqa: E402
    Arc,
    Breaker,
    Core,
    Device,
    Earthed,
    Group,
    Held,
    Rectifier,
    Relay,
    Shunt,
    Switched,
)
from independent.sampler import CurrentTransformer  # noqa: E402

STORED = Path(__file__).with_suffix(".json")
SERIES = {"reported": 3, "calibration": 4}
SIZES = (1.0, 0.3, 0.1)
MODEL = "fifth_order_branch"
NULL = "nothing"
SAME, OTHER = "same", "other"


@dataclass(frozen=True)
class Hidden:
    """What is hidden: `put` gives a case with `size` of it; `law` tells whether the plugin has the
    same law.
    """

    name: str
    law: str
    put: Callable[[waves.Case, float], waves.Case]
    kinds: tuple[str, str] = ("two phases", "three phases")

    @property
    def label(self) -> str:
        return f"{self.name}, {self.law} law" if self.name != NULL else NULL


def _beside(*made: Device) -> Callable[[waves.Case], waves.Case]:
    return lambda case: replace(case, site=replace(case.site, more=made))


def _group(case: waves.Case, **changes) -> waves.Case:
    return replace(case, site=replace(case.site, group=replace(case.site.group, **changes)))


def _lighter(case: waves.Case, size: float) -> waves.Case:
    """Part of the motors has a quarter of the inertia."""
    own, share = case.site.group, 0.4 * size
    second = Group(replace(own.machine, H=own.machine.H / 4), own.rating * share, own.torque)
    return _beside(second)(_group(case, rating=own.rating * (1 - share)))


def _another(case: waves.Case, size: float) -> waves.Case:
    return _beside(
        Group(Machine(Rs=0.03, Xs=0.09, Xm=2.6, Rr=0.05, Xr=0.09, H=0.15), 0.4 * size, 0.6)
    )(case)


def _earthed(case: waves.Case, size: float) -> waves.Case:
    faults = tuple(replace(f, delta=False) for f in case.faults)
    return _beside(Earthed(R=0.2 / size, X=1.0 / size))(replace(case, faults=faults))


def _saturating(case: waves.Case, size: float) -> waves.Case:
    return replace(
        case, sampler=replace(case.sampler, transformer=CurrentTransformer(knee=2.5 * size**-0.3))
    )


RELAY = Relay(after=0.03, back=0.12)
HIDDEN = (
    Hidden(NULL, SAME, lambda case, size: case),
    Hidden("second_motor_group", SAME, _lighter),
    Hidden("second_motor_group", OTHER, _another),
    Hidden("shunt_capacitor", SAME, lambda case, size: _beside(Shunt(B=0.3 * size))(case)),
    Hidden("zero_sequence_path", SAME, _earthed, ("phase to earth", "three phases")),
    Hidden(
        "negative_sequence_path",
        OTHER,
        lambda case, size: _beside(Held((0.3 + 0.05j) * size))(case),
    ),
    Hidden("speed_dependent_torque", SAME, lambda case, size: _group(case, fan=size)),
    Hidden("magnetic_saturation", OTHER, lambda case, size: _group(case, saturation=0.8 * size)),
    Hidden(
        "transformer_saturation",
        OTHER,
        lambda case, size: _beside(Core(1.15, 0.6 / size, 0.02))(case),
    ),
    Hidden("current_transformer_saturation", OTHER, _saturating),
    Hidden(
        "undervoltage_trip",
        SAME,
        lambda case, size: _beside(Breaker((0.4 * size,) * 3, RELAY))(case),
    ),
    Hidden(
        "undervoltage_trip",
        OTHER,
        lambda case, size: _beside(Switched(Shunt(0.4 * size), 1.0, RELAY))(case),
    ),
    Hidden("fault_resistance", SAME, lambda case, size: _beside(Arc(0.5 * size))(case)),
    Hidden(
        "stuck_pole",
        SAME,
        lambda case, size: _beside(Breaker((0.0, 0.5 * size, 0.0), Relay(0.05)))(case),
    ),
    Hidden(
        "harmonics_source",
        SAME,
        lambda case, size: _beside(Rectifier(0.06j * size, 0.03 * size))(case),
    ),
)


def events(hidden: Hidden, seed: Sequence[int], size: float = 1.0, rate: float = 3200.0):
    """Two dips of a load with something hidden, of two kinds, at one rate."""
    from tractexp.errors import UserError

    for attempt in range(50):
        case = waves.case([*seed, attempt], dips=2)
        rng = np.random.default_rng([*seed, attempt, 9])
        faults = tuple(waves.fault(rng, kind)[0] for kind in hidden.kinds)
        sampler = replace(case.sampler, rate=rate, bits=16)
        made = hidden.put(replace(case, faults=faults, sampler=sampler), size)
        try:
            return made, waves.events(made, [*seed, attempt])
        except (Stall, UserError):
            continue
    raise RuntimeError(f"nothing can be drawn from seed {list(seed)}")


def run(hidden: Hidden, seed: Sequence[int], size: float = 1.0, only: Sequence[str] = ()) -> dict:
    """One investigation. What fails is a row with its message."""
    import tractexp
    from tractexp.errors import UserError

    row = {"hidden": hidden.label, "seed": list(seed), "size": size}
    clock = time.perf_counter()
    try:
        _, dips = events(hidden, seed, size)
        clock = time.perf_counter()
        chosen = {"effects": [*only]} if only else {}
        found = tractexp.investigate(
            dips[:1], validate=dips[1:], model=MODEL, domain="waves", progress=False, **chosen
        )
        near = found.content["nearest"] or {"effects": None, "gap": {"train": {"closed": None}}}
        row |= {
            "verdict": str(found.verdict),
            "names": list(found.names),
            "sets": found.content["name_sets"],
        }
        row |= {
            "nearest": [near["effects"], near["gap"]["train"]["closed"]],
            "p_left": found.content["left"],
        }
        row |= {"gap": asdict(found.gap)}
    except (UserError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        row["failed"] = f"{type(error).__name__}: {error}"
    return row | {"seconds": time.perf_counter() - clock}


def told(row: dict, name: str) -> str:
    """What a row says of what is hidden: right, among, other names, nothing,
    unexplained or failed.
    """
    if "failed" in row:
        return "failed"
    if row["verdict"] in ("none", "unexplained"):
        return "silent" if row["verdict"] == "none" else "unexplained"
    return "right" if row["names"] == [name] else "among" if name in row["names"] else "wrong"


def summary(rows: list[dict]) -> dict:
    """How often what was said of each kind and size of load, and the median time."""
    said = {}
    for hidden in HIDDEN:
        for size in SIZES:
            mine = [
                told(r, hidden.name)
                for r in rows
                if r["hidden"] == hidden.label and r["size"] == size
            ]
            if mine:
                said[f"{hidden.label}, size {size:g}"] = {
                    word: mine.count(word) for word in sorted(set(mine))
                }
    done = [r for r in rows if "failed" not in r]
    return {
        "loads": said,
        "median_seconds": float(np.median([r["seconds"] for r in done])) if done else None,
    }


def wanted(
    count: int, labels: Sequence[str], series: int
) -> Iterator[tuple[Hidden, float, list[int]]]:
    """What is investigated, one seed of everything after the other; nothing is as often as all
    sizes of a thing.
    """
    for seed in range(count):
        for hidden in HIDDEN:
            for k, size in enumerate(SIZES):
                if hidden.label in labels:
                    again = [k] if hidden.name == NULL else []
                    yield hidden, size, [series, seed, *again]


def main() -> int:
    labels = [hidden.label for hidden in HIDDEN]
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=3, help="seeds of each kind and size")
    parser.add_argument("--names", nargs="+", default=labels, choices=labels)
    parser.add_argument(
        "--few", action="store_true", help="only what is hidden here are candidates"
    )
    parser.add_argument("--series", choices=list(SERIES), default="reported")
    parser.add_argument("--out", type=Path, default=Path("waves_hidden.jsonl"))
    parser.add_argument(
        "--store", action="store_true", help=f"write the summary into {STORED.name}"
    )
    chosen = parser.parse_args()
    rows = (
        [json.loads(line) for line in chosen.out.read_text().splitlines()]
        if chosen.out.exists()
        else []
    )
    done = {(r["hidden"], r["size"], tuple(r["seed"])) for r in rows}
    few = (
        sorted({hidden.name for hidden in HIDDEN} - {NULL, "harmonics_source"})
        if chosen.few
        else ()
    )
    with chosen.out.open("a") as file:
        for hidden, size, seed in wanted(chosen.count, chosen.names, SERIES[chosen.series]):
            if (hidden.label, size, tuple(seed)) in done:
                continue
            rows.append(run(hidden, seed, size, few))
            file.write(json.dumps(rows[-1]) + "\n")
            file.flush()
            short = {k: v for k, v in rows[-1].items() if k not in ("gap", "p_left")}
            print(short, file=sys.stderr, flush=True)
    print(json.dumps(summary(rows), indent=1))
    if chosen.store:
        STORED.write_text(json.dumps(summary(rows), indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
