"""Loads of a bus whose power is negative: a current transformer that points backward, or what feeds
the bus.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tractexp.record.direction import OUTWARD
from tractexp.recording.event_worth import NEGATIVE
from tractexp.recording.kirchhoff import CLOSED_SUM

if TYPE_CHECKING:
    from tractexp.recording.sight import LoadEvent, Sight

# of what the others of a bus draw: what gives less may be a load, counted the other way
LARGEST_LOAD_SHARE = 0.5


def describe_directions(sights: "Sequence[Sight]") -> "list[Sight]":
    """The loads; those whose power is negative say why, where the others of their bus tell it."""
    buses: dict[object, list[int]] = {}
    for k, shown in enumerate(sights):
        if shown.feeder is not None and shown.feeder.loaded and not shown.secondary:
            buses.setdefault(shown.feeder.voltages, []).append(k)
    told = list(sights)
    for bus in buses.values():
        for k, share, names in _find_negative([(k, sights[k]) for k in bus]):
            told[k] = _describe_direction(sights[k], share, names)
    return told


def _find_negative(bus: "Sequence[tuple[int, Sight]]") -> list[tuple[int, float, list[str]]]:
    """(number, its power over that of the loads that draw power, the names of those) of the loads
    of a bus whose power is negative; [] where none draws power.
    """
    power = {k: _measure_power(sight) for k, sight in bus}
    drawn = sum(P for P in power.values() if P > 0)
    drawing = [sight.name for k, sight in bus if power[k] > 0]
    return [(k, -P / drawn, drawing) for k, P in power.items() if P < 0 < drawn]


def _measure_power(shown: "Sight") -> float:
    """P [MW]; zero where it is not known."""
    powers = shown.powers()
    return float(np.nan_to_num(powers[1])) if powers is not None else 0.0


def _describe_direction(shown: "Sight", share: float, drawing: Sequence[str]) -> "Sight":
    """A load of negative power, which is `share` of what the others draw."""
    assert shown.feeder is not None
    why = " ".join(shown.feeder.why)
    closes = CLOSED_SUM in why and not shown.feeder.reverse_current
    others = ", ".join(drawing)
    if closes or share > LARGEST_LOAD_SHARE:
        cause = f"it feeds what the others of its bus draw ({others})"
    elif OUTWARD in why:
        cause = (
            f"it falls with the voltage as a load's, while {others} draw: its current transformer"
            " points backward (data.reverse_current=true turns it round)"
        )
    else:
        return shown
    said = f"P of {shown.name} is negative: {cause}"
    events = tuple(_replace_cause(event, cause) for event in shown.events)
    return replace(shown, events=events, said=(*shown.said, said))


def _replace_cause(event: "LoadEvent", cause: str) -> "LoadEvent":
    """The event with another cause of its negative power."""
    before, mark, _ = event.why.partition(NEGATIVE)
    return replace(event, why=f"{before}{mark}{cause}") if mark else event
