"""The command that fits the events of a load that are worth it."""

from dataclasses import MISSING, fields
from typing import Any

from tractexp.configuration import plugin
from tractexp.configuration.overrides import build_typed_command
from tractexp.record.wave_event import COARSEST, describe_smearing
from tractexp.recording.overview import View
from tractexp.recording.sight import Sight

RACE = "model=auto"  # what a load of the field is made of nobody knows: structures are raced
# cycles that a fit of samples needs before the dip, and one that the estimator of phasors leaves
# out
EARLIER = 3.0


def build_load_command(view: View, shown: Sight) -> str:
    """The command that fits the events of a load that are worth it; "" where none is."""
    choice = shown.choice()
    if choice is None or not view.node:
        return ""
    usual = {f.name: f for f in fields(plugin.get("data", view.node["name"]))}
    settings = {**view.node, **choice}
    text = build_typed_command(
        {
            key: value
            for key, value in settings.items()
            if key == "name" or not _is_usual(usual[key], value)
        }
    )
    raced = [RACE] if _is_from_field(shown) else []
    sampled = ["domain=waves"] if waves_serve(view, shown) else []
    return " ".join([text, *raced, *sampled])


def _is_from_field(shown: Sight) -> bool:
    """Whether the load that is fitted is one whose structure nobody knows: of kV and MW."""
    events = (each.event for each in shown.events if each.worth)
    return any(event is not None and event.record.is_from_field for event in events)


def waves_serve(view: View, shown: Sight) -> bool:
    """Whether the samples of the dip that is fitted first tell more than its phasors, and can be
    fitted.
    """
    first = next(
        (event.what for event in shown.events if event.worth and event.dip is not None), None
    )
    if view.recording is None or first is None:
        return False
    f = view.recording.frequency
    ends = [(s, s.start + (s.stop - s.first) / s.rate) for s in view.recording.waveforms()]
    there = next((s for s, end in ends if s.start <= first.start and first.end <= end), None)
    fine = (
        there is not None and there.rate >= COARSEST * f and first.start - there.start > EARLIER / f
    )
    return fine and bool(describe_smearing(first.end - first.start, first.U2 or 0.0, f))


def _is_usual(setting: Any, value: Any) -> bool:
    """Whether a value is what a setting (a dataclass field) is without it."""
    return value == (
        setting.default if setting.default is not MISSING else setting.default_factory()
    )
