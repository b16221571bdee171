"""What a recording still tells of its loads where no event of it is worth fitting, and how to have
more.

A voltage that stays at a new level moves the static part of a load: its exponents follow from P and
Q before and after, P_after/P_before = (U_after/U_before)^p_v. They are those of the whole load once
a motor has settled, and a load that changes by itself meanwhile is in them.

Source: IEEE Task Force on Load Representation, 1993 (exponents from staged steps of the voltage).
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from math import log
from typing import Any

from tractexp.record.fall import SHALLOWEST

LASTING = ("step", "ramp")  # kinds of events after which the voltage stays
# of the voltage: a smaller step is less than what loads change by themselves
SMALLEST_VOLTAGE_STEP = 0.005
ITSELF = 0.01  # of the power, by which an error of the exponents is told
DIPS = (
    "a motor answers dips: have the recorder triggered by 3 to 10 % of the voltage"
    f" ({SHALLOWEST:.0%} is the least that is fitted), with 0.2 s and more before it and 1 s after"
)
AMBIENT = (
    "static exponents follow from a change of taps before and after, and from ten minutes of RMS"
    " values each second as slopes of ln P and ln Q over ln U"
)


def list_sentences(files: Sequence[Mapping[str, Any]]) -> list[str]:
    """For files of `look.json`; [] where something is worth fitting, or no load was recognised."""
    feeders = [feeder for entry in files for feeder in entry["feeders"]]
    loads = [feeder for feeder in feeders if feeder["loaded"]]
    events = itertools.chain.from_iterable(feeder["events"] for feeder in feeders)
    if not loads or any(event["worth"] for event in events):
        return []
    return [*itertools.chain.from_iterable(map(_list_exponents, loads)), DIPS, AMBIENT]


def _list_exponents(feeder: Mapping[str, Any]) -> Iterator[str]:
    """The static exponents that each lasting change of the voltage tells of a load."""
    for event in feeder["events"]:
        ratio = 1 - event["depth"]
        if (
            event["kind"] not in LASTING
            or ratio <= 0
            or abs(event["depth"]) < SMALLEST_VOLTAGE_STEP
        ):
            continue
        exponents = {
            name: log(event[f"{power}_after"] / event[f"{power}_before"]) / log(ratio)
            for name, power in (("p_v", "P"), ("q_v", "Q"))
            if _does_flow_alike(event[f"{power}_before"], event[f"{power}_after"])
        }
        if "p_v" not in exponents:
            continue
        values = " and ".join(f"{name} {value:.2g}" for name, value in exponents.items())
        fixed = " ".join(f"model.fixed.{name}={value:.2g}" for name, value in exponents.items())
        yield (
            f"the {event['kind']} of {abs(event['depth']):.1%} at {event['start']:.3f} s tells the"
            f" static exponents of {feeder['name']}: {values}, each wrong by"
            f" {ITSELF / abs(log(ratio)):.1g} for every percent that the load changed by itself;"
            f" for another record of it: {fixed}"
        )


def _does_flow_alike(before: float | None, after: float | None) -> bool:
    """Whether a power is known before and after, and flows the same way."""
    return before is not None and after is not None and before * after > 0
