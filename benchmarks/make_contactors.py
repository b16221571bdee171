"""Make the shipped set `contactors`: python benchmarks/make_contactors.py [--out DIR]

The load of `make_tibet` with an effect that has nothing to do with the order of its machine:
contactors that drop out in a dip and come back along a ramp. It comes from the simulator in
`hidden_effects`, whose relay runs on the clean voltage with timers of its own and shares nothing
with the effect of the catalogue; docs/data.md tells more.
"""

import json
from dataclasses import asdict
from pathlib import Path

import make_tibet
import oracle  # noqa: F401

from hidden_effects import Case, Noise, Recorder, make, truth

MADE_BY = "benchmarks/make_contactors.py"
NOTE = (
    "synthetic: simulated with an independent machine, a relay with timers and a noisy recorder,"
    " measured nowhere"
)
SEED = 19  # draws the level and the times of the relay, and the noise
NAMES = {
    f"contactors_{depth}": dip
    for depth, (_, dip) in (
        (name.removeprefix("tibet_"), made) for name, made in make_tibet.DIPS.items()
    )
}
CASE = Case(
    effect="undervoltage_trip",
    size=2.0,  # a tenth of the load
    events=tuple(NAMES.values()),
    noise=Noise(0.002, phi=0.5),
    load=make_tibet.LOAD,
    recorder=Recorder(rate=500.0, samples=1000),
    spread=0.02,
)


def sidecar(name: str, event: int) -> dict[str, object]:
    """What a reader of the record may want to know, the truth first."""
    told = truth(CASE, SEED)
    start = make_tibet.rounded({key: told["events"][event][key] for key in ("P_s0", "Q_s0")})
    return {
        "name": name,
        "note": NOTE,
        "truth": make_tibet.rounded(told["load"]),
        "effects": told["effects"],
        "steady_state": start,
        "base": "voltage: nominal; power: active power before the event, about; frequency: 50 Hz",
        "dip": asdict(CASE.events[event]),
        "noise": told["noise"],
        "seed": SEED,
        "made_by": MADE_BY,
    }


def write(folder: Path) -> list[Path]:
    """Write the three records and their sidecars into `folder`, made if need be, and return their
    paths.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for event, (name, columns) in enumerate(zip(NAMES, make(CASE, SEED), strict=True)):
        contents = {
            ".csv": make_tibet.table(columns),
            ".json": json.dumps(sidecar(name, event), indent=2) + "\n",
        }
        for suffix, text in contents.items():
            written.append(folder / f"{name}{suffix}")
            written[-1].write_bytes(text.encode())
    return written


if __name__ == "__main__":
    make_tibet.main(write, __doc__)
