"""What a terminal shows of a look: the answer, each bus, each load in one line; everything where it
is asked for.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from tractexp.blocks import Report, Table
from tractexp.recording.event_kind import OF_LOADS
from tractexp.recording.event_worth import name_fallen_phases
from tractexp.recording.excursion import HYSTERESIS
from tractexp.recording.transformer import MAYBE_SAME, SAME_CURRENT
from tractexp.report import unfitted
from tractexp.report.look import (
    NO_LOAD,
    NOT_EXAMINED,
    SECONDARY,
    describe_dead_phases,
    describe_joint_fit,
    explain_no_event,
    explain_unnamed,
    format_frequency,
    format_size,
    format_start,
    is_unexamined,
    tabulate_channels,
    tabulate_events,
)
from tractexp.text.wording import count_noun, format_figure, join_words, shorten

NOTES = 3  # of a file that have room
MOST_LINE_EVENTS = 4  # events of a bus that its line has room for
# files, buses of a file, rows of a table of loads, reasons that a screen has room for
MOST_FILES, MOST_BUSES, MOST_LOADS, MOST_REASONS = 2, 2, 5, 2
ONE_LINE, TWO_LINES = 76, 150  # characters
Entry = Mapping[str, Any]  # a file, a load or an event of `look.json`


def build_screen(content: Entry) -> Report:
    """The answer in 25 lines: which load and which dip to fit by which command; then of each file
    where it is from, its buses, and which loads are worth fitting.
    """
    entries = content["files"]
    reasons = unfitted.list_sentences(entries)[:MOST_REASONS]
    page = _begin_with_answer(content).items([shorten(each, TWO_LINES) for each in reasons])
    for entry in entries[:MOST_FILES]:
        page.text(shorten(_describe_recorder(entry), TWO_LINES))
        if notes := entry["notes"]:
            page.items([shorten(f"note: {notes[0]}", ONE_LINE)])
        buses = _group_by_bus(entry["feeders"])
        told = [_describe_bus(entry, n, bus) for n, bus in enumerate(buses, 1) if _is_loaded(bus)]
        page.items([shorten(bus, TWO_LINES) for bus in told[:MOST_BUSES]])
        if buses:
            _add_loads(page, entry, _tabulate_loads(entry, buses))
    if len(entries) > MOST_FILES:
        page.text(f"  {count_noun(len(entries) - MOST_FILES, 'file')} more")
    return page


def _is_loaded(bus: Sequence[Entry]) -> bool:
    return any(feeder["loaded"] for feeder in bus)


def _add_loads(page: Report, entry: Entry, loads: Table) -> None:
    """The table of loads by what decides alone, those that are worth fitting first."""
    detail = {loads.columns.index(name) for name in ("currents", "beside")} | {*loads.detail}
    rows = [[*row[:-1], re.split(", but ", str(row[-1]))[0]] for row in loads.rows]
    rows.sort(key=lambda row: not row[-1].startswith("yes"))
    page.add(replace(loads, rows=rows[:MOST_LOADS], detail=detail))
    if len(rows) > MOST_LOADS:
        page.text(f"  {count_noun(len(rows) - MOST_LOADS, 'load')} more")


def build_summary(content: Entry) -> Report:
    """Which load and dip to fit by which command, then a line for each file, bus and load."""
    page = _begin_with_answer(content).items(unfitted.list_sentences(content["files"]))
    for entry in content["files"]:
        _add_file(page, entry)
        buses = _group_by_bus(entry["feeders"])
        page.text(
            *(f"  {_describe_bus(entry, number, bus)}" for number, bus in enumerate(buses, 1))
        )
        if buses:
            page.add(_tabulate_loads(entry, buses))
        elif len(content["files"]) > 1:
            page.text(f"  {explain_unnamed(entry)}")
        _add_remarks(page, entry["feeders"])
    return page


def _add_file(page: Report, entry: Entry) -> None:
    """A line on a file, and its first notes."""
    held = f"; {count_noun(len(entry['channels']), 'channel')}" if entry["channels"] else ""
    notes = entry["notes"]
    page.text(f"{_describe_recorder(entry)}{held}", *(f"  note: {note}" for note in notes[:NOTES]))
    if len(notes) > NOTES:
        page.text(f"  note: {len(notes) - NOTES} more")


def _add_remarks(page: Report, feeders: Sequence[Entry]) -> None:
    """Which feeders have no load, which may be one load seen twice, and what is said of them."""
    unloaded = [feeder["name"] for feeder in feeders if not feeder["loaded"]]
    if unloaded and len(unloaded) < len(feeders):
        page.text(f"  {NO_LOAD}: {', '.join(unloaded)}")
    alike = [
        f"{feeder['name']}: {said}"
        for feeder in feeders
        for said in feeder["why"]
        if said.startswith(SAME_CURRENT)
        or (_select_worthwhile(feeder) and said.startswith(MAYBE_SAME))
    ]
    page.items(alike)
    page.items(list(dict.fromkeys(said for feeder in feeders for said in feeder["said"])))


def build_full_report(content: Entry) -> Report:
    """Notes, channels, loads and why they are such, all events and all commands of the files."""
    page = _begin_with_answer(content).items(unfitted.list_sentences(content["files"]))
    for entry in content["files"]:
        page.text(_describe_recorder(entry), *(f"  note: {n}" for n in entry["notes"]))
        if entry["channels"]:
            page.add(tabulate_channels(entry))
        for feeder in entry["feeders"]:
            numbers = ", ".join(map(str, (*feeder["voltages"], *feeder["currents"])))
            wired = f" (channels {numbers}, {feeder['connection']})" if numbers else ""
            page.text(f"load {feeder['name']}{wired}: {format_size(feeder) or 'nothing measured'}")
            page.items([*feeder["why"], *feeder["said"]])
            if feeder["events"]:
                page.add(tabulate_events(feeder))
            else:
                page.items([explain_no_event(feeder)])
            if feeder["command"]:
                page.text("  to fit it:").code(feeder["command"])
        if not entry["feeders"]:
            page.text(f"  {explain_unnamed(entry)}")
    return page


def _begin_with_answer(content: Entry) -> Report:
    """A report that begins with the answer; of several files also how dips are fitted together."""
    page = Report().text(_answer(content["files"]))
    joint = content.get("joint")
    if joint is None:
        return page
    return page.text(f"to {describe_joint_fit(joint)}: {joint['command']}")


def _answer(files: Sequence[Entry]) -> str:
    """Which load and which dip are worth fitting, and the command; or why nothing is."""
    best = _find_best(files)
    if best is not None:
        return _propose(best, files)
    feeders = [feeder for entry in files for feeder in entry["feeders"]]
    tested = next((f for f in feeders if f.get("type_test")), None)
    told = f"{tested['name']} is {tested['type_test']['sentence']}" if tested else ""
    return "; ".join(filter(None, [told, _refuse(files), *_list_proposed(files)]))


def _find_best(files: Sequence[Entry]) -> Entry | None:
    """The load whose first dip tells most, of those that are none seen twice; None where none is
    worth fitting.
    """
    feeders = [feeder for entry in files for feeder in entry["feeders"]]
    promising = [feeder for feeder in feeders if _select_worthwhile(feeder)]
    if not promising:
        return None
    sure = [each for each in promising if not _may_be_another(each)] or promising
    best = max(sure, key=lambda feeder: _measure_answer(_select_worthwhile(feeder)[0]))
    # of loads that one command fits, the one whose dip is fitted
    return next(feeder for feeder in promising if feeder["command"] == best["command"])


def _propose(best: Entry, files: Sequence[Entry]) -> str:
    """That the first dip of a load is worth fitting, with reservations and the command."""
    first = _select_worthwhile(best)[0]
    secondary = SECONDARY if best.get("secondary") else ""
    worth = f"is worth fitting{_take_reservation(first['why'])}"
    own = [entry for entry in files if best in entry["feeders"]]
    command = f"to fit it: {best['command']}" if best["command"] else ""
    told = [worth, secondary, best.get("clipped"), *_list_proposed(own), command]
    return f"{_describe_event(first)} of {best['name']} {'; '.join(filter(None, told))}"


def _list_proposed(files: Sequence[Entry]) -> list[str]:
    """That files beside these are of the same event, with the commands."""
    return [entry["proposed"] for entry in files if entry.get("proposed")]


def _may_be_another(feeder: Entry) -> bool:
    """Whether a load may be another one, seen on the other side of a transformer."""
    return any(said.startswith(MAYBE_SAME) for said in feeder["why"])


def _refuse(files: Sequence[Entry]) -> str:
    """Why nothing is worth fitting."""
    feeders = [feeder for entry in files for feeder in entry["feeders"]]
    happened = [(feeder, event) for feeder in feeders for event in feeder["events"]]
    unexamined = [explain_no_event(feeder) for feeder in feeders if feeder.get("unexamined")]
    if not happened and unexamined:
        return unexamined[0]
    if not feeders and all(is_unexamined(entry) for entry in files):
        return f"{NOT_EXAMINED}: {files[0]['lacks']}"
    if not happened:
        return (
            "nothing is worth fitting:"
            f" {next(iter((*map(explain_no_event, feeders), *map(explain_unnamed, files))), '')}"
        )
    feeder, event = max(happened, key=lambda each: _measure_answer(each[1]))
    return f"nothing is worth fitting; {_describe_event(event)} of {feeder['name']}: {event['why']}"


def _measure_answer(event: Entry) -> float:
    """How much of a load answers an event and stays: the depth times the active power after it.

    Not the apparent one: a line of 1 MW and -98 Mvar is no load.
    """
    power = event["P_after"]
    return 0.0 if power is None else abs(event["depth"] * power)


def _select_worthwhile(feeder: Entry) -> list[Entry]:
    """The events that are worth fitting."""
    return [event for event in feeder["events"] if event["worth"]]


def _label(event: Entry) -> str:
    """ "dip 2"."""
    return event["kind"] if event["dip"] is None else f"{event['kind']} {event['dip']}"


def _describe_event(event: Entry) -> str:
    """An event in a phrase: kind, time, depth, duration, phases."""
    fallen = name_fallen_phases(event.get("phases") or ())
    size = [f"{event['depth']:.1%}", f"{1000 * event['duration']:.0f} ms", fallen]
    return f"{_label(event)} at {format_start(event, ' s')} ({', '.join(filter(None, size))})"


def _take_reservation(why: str) -> str:
    """The first clause after the size of an event that is worth fitting: what speaks against it
    nevertheless; "" where nothing.
    """
    return f", but {_take_clause(why, '; ')}" if "; " in why else ""


def _take_clause(why: str, after: str) -> str:
    """The deciding clause of a sentence such as 'the voltage falls by 30 %, but P is negative
    before it: ...'.
    """
    return re.split(r"[:(]", why.split(after, 1)[-1])[0].strip()


def _describe_recorder(entry: Entry) -> str:
    """Where and by what a file was recorded."""
    rates = ", ".join(f"{rate:g} Hz" for rate in dict.fromkeys(entry["rates"]))
    about = [
        entry["station"],
        entry["device"],
        str(entry["start"] or ""),
        f"{entry['seconds']:.3f} s at {rates}",
    ]
    return f"{entry['file']}: {'; '.join(filter(None, [*about, format_frequency(entry)]))}"


def _group_by_bus(feeders: Sequence[Entry]) -> list[list[Entry]]:
    """The loads by the voltages that they have; a load without channels is alone."""
    buses: dict[Any, list[Entry]] = {}
    for k, feeder in enumerate(feeders):
        buses.setdefault(tuple(feeder["voltages"]) or f"load {k}", []).append(feeder)
    return list(buses.values())


def _list_shared_facts(event: Entry) -> tuple[Any, ...]:
    """The facts of an event that two loads' views of it share."""
    return event["kind"], event["start"], event["end"]


def _find_common_events(bus: Sequence[Entry]) -> list[Entry]:
    """The events that all loads of a bus have: they happened to the voltage."""
    each = [feeder["events"] for feeder in bus if feeder["loaded"]] or [
        feeder["events"] for feeder in bus
    ]
    shared = set.intersection(*({_list_shared_facts(event) for event in events} for events in each))
    return [event for event in each[0] if _list_shared_facts(event) in shared]


def _list_voltage_events(bus: Sequence[Entry]) -> list[Entry]:
    """The events of a bus's voltage, each with the worst that any of its loads shows.

    Circuits that open at different instants divide one fault at different times: it is told from
    first to last.
    """
    shared = _find_common_events(bus)
    loads = [feeder for feeder in bus if feeder["loaded"]] or bus
    rest = [event for feeder in loads for event in feeder["events"] if not _is_current_event(event)]
    told: list[Entry] = []
    for event in sorted(rest, key=lambda each: each["start"]):
        if any(_do_overlap(event, other) for other in shared):
            continue
        if told and _do_overlap(event, told[-1]):
            last = told.pop()
            worst, end = (
                max(last, event, key=lambda each: abs(each["depth"])),
                max(last["end"], event["end"]),
            )
            span = {"start": last["start"], "end": end, "duration": end - last["start"]}
            event = {**last, "depth": worst["depth"], **span, "phases": _join_phases(last, event)}
        told.append(event)
    return sorted((*shared, *told), key=lambda each: each["start"])


def _join_phases(*events: Entry) -> list[float]:
    """The voltage of each phase that is farthest from that before, in either event."""
    told = [event["phases"] for event in events if event.get("phases")]
    return [max(phase, key=lambda x: abs(x - 1)) for phase in zip(*told, strict=True)]


def _is_current_event(event: Entry) -> bool:
    """Whether an event is one of the currents, of which the voltage shows next to nothing."""
    return event["kind"] in (*OF_LOADS, "inrush") or abs(event["depth"]) < HYSTERESIS


def _do_overlap(a: Entry, b: Entry) -> bool:
    """Whether two events overlap in time."""
    return a["start"] <= b["end"] and b["start"] <= a["end"]


def _describe_bus(entry: Entry, number: int, bus: Sequence[Entry]) -> str:
    """The voltages of a bus, their size, and what happened to them, in one line."""
    names = ", ".join(entry["channels"][k]["name"] for k in bus[0]["voltages"])
    happened = [_describe_event(event) for event in _list_voltage_events(bus)]
    told = happened[:MOST_LINE_EVENTS]
    if len(happened) > MOST_LINE_EVENTS:
        told.append(f"{len(happened) - MOST_LINE_EVENTS} more")
    events = join_words(told)
    if not happened and any(feeder["loaded"] or not feeder["currents"] for feeder in bus):
        events = explain_no_event(bus[0])  # which tells dead phases, too
    dead = describe_dead_phases(bus[0].get("dead_phases")) if happened else ""
    parts = filter(None, [names, format_figure(bus[0]["U"], 4, bus[0]["units"][0]), dead, events])
    return f"bus {number}: {'; '.join(parts)}"


def _tabulate_loads(entry: Entry, buses: Sequence[Sequence[Entry]]) -> Table:
    """A load in each row: those without load are left out where there are others."""
    loaded = any(feeder["loaded"] for feeder in entry["feeders"])
    rows = [
        [
            feeder["name"],
            number,
            ", ".join(map(str, feeder["currents"])),
            *(format_figure(feeder[key]) for key in "PQ"),
            _describe_own_events(feeder, _find_common_events(bus)),
            _fit(feeder),
        ]
        for number, bus in enumerate(buses, 1)
        for feeder in bus
        if feeder["loaded"] or not loaded
    ]
    P, Q = entry["feeders"][0]["units"][1:]
    columns = ["load", "bus", "currents", f"P [{P}]", f"Q [{Q}]", "beside", "fit it?"]
    empty = {k for k in range(len(columns)) if not any(row[k] for row in rows)}
    return Table(columns, rows, words=(2, 5, 6), detail=empty)


def _describe_own_events(feeder: Entry, common: Sequence[Entry]) -> str:
    """The events of a load that its bus did not have, in words."""
    shared = {_list_shared_facts(event) for event in common}
    own = (event for event in feeder["events"] if _list_shared_facts(event) not in shared)
    return ", ".join(f"{_label(event)} at {format_start(event, ' s')}" for event in own)


def _fit(feeder: Entry) -> str:
    """Which of a load's dips are worth fitting, with what is to be known of the first; else what
    decides against it.
    """
    if worth := _select_worthwhile(feeder):
        return f"yes: {', '.join(map(_label, worth))}{_take_reservation(worth[0]['why'])}"
    if feeder["events"]:
        event = max(feeder["events"], key=_measure_answer)
        is_dip = event["kind"] == "dip"
        return f"no: {_take_clause(event['why'], ', but ') if is_dip else event['kind']}"
    return (
        f"no: {_take_clause(explain_no_event(feeder), ', but ')}"
        if feeder["U"] is not None
        else "no: see below"
    )
