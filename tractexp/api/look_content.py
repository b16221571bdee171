"""The content of `look.json`: the channels, loads and events of a file as plain data."""

from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from tractexp.api.load_command import build_load_command
from tractexp.recording.overview import View
from tractexp.recording.quality import describe_clipped
from tractexp.recording.railway import DIRECT, describe_direct_beside, describe_direct_voltage
from tractexp.recording.recording import find_unit
from tractexp.recording.sight import LoadEvent, Sight
from tractexp.recording.unrecognized import can_be_named, explain_unrecognized

NAME_THEM = "name the channels of one load: voltages=[...] currents=[...]"


def build_event_row(event: LoadEvent, begun: datetime | None = None) -> dict[str, Any]:
    """An event as plain data: times in s, powers in MW and Mvar, voltages as shares of that before.

    `begun` is the moment of t = 0: then `when` is that of the event's start.
    """
    what = event.what
    return {
        "kind": what.kind,
        "start": what.start,
        "when": begun and (begun + timedelta(seconds=what.start)).isoformat(),
        "end": what.end,
        "duration": what.end - what.start,
        "depth": what.depth,
        "jump": what.jump,
        "U2": what.U2,
        "P_before": what.before[0],
        "Q_before": what.before[1],
        "P_after": what.after[0],
        "Q_after": what.after[1],
        "dip": event.dip,
        "worth": event.worth,
        "why": event.why,
        "phases": list(what.phases),
        "exponents": [vars(each) for each in what.exponents],
    }


def build_content(view: View) -> dict[str, Any]:
    """The entry of a file in `look.json`."""
    recording = view.recording
    content: dict[str, Any] = {
        "file": view.source,
        "reader": view.node.get("name", ""),
        "joined": list(view.node.get("join", ())),
        "proposed": view.proposed,
    }
    if recording is None:
        record = view.sights[0].record
        assert record is not None
        content |= {
            "station": "",
            "device": "",
            "start": view.begun and view.begun.isoformat(),
            "frequency": record.base.frequency,
            "rates": [record.rate],
            "seconds": float(record.t[-1] - record.t[0]),
            "segments": [
                {"rate": record.rate, "start": float(record.t[0]), "samples": record.samples}
            ],
            "notes": [*record.notes, *filter(None, [view.proposed])],
            "channels": [],
        }
    else:
        last = recording.segments[-1]
        shown = any(each.feeder is None or each.feeder.currents for each in view.sights)
        lacks = "" if shown else explain_unrecognized(recording)
        named = not lacks or can_be_named(recording)
        remedy = f"; {NAME_THEM}" if lacks and named else ""
        content |= {
            "station": recording.station,
            "device": recording.device,
            "start": recording.start and recording.start.isoformat(),
            "frequency": recording.frequency,
            "rates": [s.rate for s in recording.segments],
            "seconds": last.start + (last.stop - last.first) / last.rate,
            "segments": [
                {"rate": s.rate, "start": s.start, "samples": s.stop - s.first}
                for s in recording.segments
            ],
            "notes": [
                *filter(None, [view.proposed]),
                *recording.notes,
                *([f"no load was recognised: {lacks}{remedy}"] if lacks else _tell_direct(view)),
            ],
            "channels": [
                _build_channel_row(view, number) for number in range(len(recording.channels))
            ],
        }
        direct = bool(lacks and describe_direct_voltage(recording))
        content |= {"lacks": lacks, "can_be_named": named, "direct": direct}
    content["measured_frequency"] = view.frequency
    return content | {"feeders": [_build_feeder_row(view, shown) for shown in view.sights]}


def _tell_direct(view: View) -> list[str]:
    """Sentences on direct voltages beside a load's; [] where there are none."""
    assert view.recording is not None
    steady = [
        number
        for number, channel in enumerate(view.quality)
        if not abs(channel.offset) <= DIRECT * channel.level
    ]
    return describe_direct_beside(view.recording, steady)


def _build_channel_row(view: View, number: int) -> dict[str, Any]:
    """A channel's row: name, unit, phase, quality."""
    assert view.recording is not None
    channel, fitness = view.recording.channels[number], view.quality[number]
    share = fitness.noise / fitness.level if fitness.level > 0 else None
    return {
        "number": number,
        "name": channel.name,
        "phase": channel.phase,
        "unit": channel.unit,
        "quantity": channel.quantity,
        "magnitude": fitness.level,
        "primary_unit": {"voltage": "kV", "current": "kA"}.get(
            find_unit(channel.unit)[0], channel.unit
        ),
        "noise_share": share,
        **asdict(fitness),
    }


def _build_feeder_row(view: View, shown: Sight) -> dict[str, Any]:
    """A load's row: its channels, power and what speaks for it."""
    feeder, powers = shown.feeder, view.powers(shown)
    names = [c.name for c in view.recording.channels] if view.recording else []
    row: dict[str, Any] = {
        "name": shown.name,
        "connection": "",
        "voltages": [],
        "currents": [],
        "channels": [],
        "reverse_current": False,
        "why": [],
        "loaded": True,
    }
    if feeder is not None:
        row |= {
            key: getattr(feeder, key)
            for key in ("voltages", "currents", "reverse_current", "why", "loaded")
        }
        row["connection"] = _name(feeder.connection)
        row["channels"] = [names[i] for i in (*feeder.voltages, *feeder.currents)]
    U, P, Q = powers if powers and not shown.secondary else (None, None, None)
    units = ("pu", "pu", "pu") if shown.per_unit else ("kV", "MW", "Mvar")
    return row | {
        "U": U,
        "P": P,
        "Q": Q,
        "units": units,
        **_measure_sums(shown),
        "said": list(shown.said),
        "type_test": shown.type_test and shown.type_test.to_dict(),
        "unexamined": shown.unexamined,
        "dead_phases": shown.dead_phases,
        "secondary": shown.secondary,
        "clipped": _tell_clipped(view, shown),
        "command": build_load_command(view, shown),
        "events": [
            hide_secondary(build_event_row(event, view.begun), shown) for event in shown.events
        ],
    }


def _tell_clipped(view: View, shown: Sight) -> str:
    """Which channels of a load stop at a limit, one clause; "" where none does."""
    if view.recording is None or shown.feeder is None:
        return ""
    numbers = (*shown.feeder.voltages, *shown.feeder.currents)
    return describe_clipped(view.recording, {k: view.quality[k].clipped for k in numbers})


def hide_secondary(row: dict[str, Any], shown: Sight) -> dict[str, Any]:
    """The row of an event, without powers where they are those of a transformer's secondary."""
    return (
        row | dict.fromkeys(("P_before", "Q_before", "P_after", "Q_after"))
        if shown.secondary
        else row
    )


def _name(connection: Any) -> str:
    """A connection's name."""
    return connection["name"] if isinstance(connection, Mapping) else str(connection)


def _measure_sums(shown: Sight) -> dict[str, Any]:
    """Kirchhoff: the sums of the three voltages and of the three currents, as shares of a phase's,
    at the beginning.
    """
    sums = {}
    for key in "VI":
        value = None
        if shown.phasors and len(shown.phasors[0].V) == 3:
            first = getattr(shown.phasors[0], key)[:, :50]
            scale = float(np.abs(first).mean())
            value = float(np.abs(first.sum(axis=0)).mean()) / scale if scale > 0 else None
        sums[f"sum_{key}"] = value
    return sums
