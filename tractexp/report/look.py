"""The page of a look: the file, each load with what happened to it, zoomable, its command, the
channels.
"""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from datetime import datetime
from pathlib import Path
from typing import Any

from tractexp.blocks import Report, Table
from tractexp.recording.overview import View
from tractexp.recording.sight import Sight
from tractexp.report import unfitted
from tractexp.report.look_charts import add_charts, add_unassigned_channels
from tractexp.text.wording import (
    change,
    count_noun,
    finish_sentence,
    format_degrees,
    format_figure,
    share,
)

OPEN = 2  # loads whose charts are drawn at once; those of the others when they are opened
LATE = 60.0  # s: nobody counts more in a file; events after it have the clock's time beside
NOTHING = "nothing happened: the voltage stays within the thresholds of IEC 61000-4-30"
BEFORE = "U, P and Q before the dip that is worth fitting, else at the beginning; P and Q consumed."
UNNAMED = (
    "no voltages and currents of one load were recognised; name them: voltages=[...] currents=[...]"
)
NOT_EXAMINED = "not examined"
SECONDARY = "its values are secondary, of an unknown ratio: no kV, no MW"
NO_CURRENT = "no current is recorded"
NO_LOAD = "no load here: what happens to the voltage is listed with the loads of its bus"


def report(views: Sequence[View], content: Mapping[str, Any]) -> Report:
    """The page of a look: what each file holds, its loads and what happened."""
    files = content["files"]
    page = Report(f"A look at {', '.join(Path(f['file']).name for f in files)}", _lead(files))
    if "joint" in content:
        page.verdict(f"To {describe_joint_fit(content['joint'])}:", kind="good")
        page.code(content["joint"]["command"])
    for view, entry in zip(views, files, strict=True):
        if len(files) > 1:
            page.heading(entry["file"])
        _add_conclusion(page, entry)
        page.table(["", ""], _list_facts(entry), words=(1,))
        if entry["notes"]:
            page.items(entry["notes"])
        if len(entry["feeders"]) > 1:
            page.table(
                ["load", "connected as", "channels", "U", "P", "Q", "events", "worth fitting"],
                [_build_summary_row(f) for f in entry["feeders"]],
                words=(1, 2),
                caption=BEFORE,
            )
        for k, (shown, feeder) in enumerate(zip(view.sights, entry["feeders"], strict=True)):
            _load(page, view, shown, feeder, folded=k >= OPEN)
        if entry["channels"]:
            page.heading("Channels").add(tabulate_channels(entry))
            add_unassigned_channels(page, view)
    return page


def tabulate_channels(entry: Mapping[str, Any]) -> Table:
    """The channels of a file, with their quality in detail."""
    caption = (
        "Numbers count from 0, as data.voltages and data.currents do. RMS of the fundamental; noise"
        " about fundamental and harmonics in the quietest ten cycles of the first calm, as a share"
        " of it."
    )
    columns = [
        "number",
        "name",
        "phase",
        "unit",
        "primary RMS",
        "noise",
        "colour",
        "THD",
        "bits",
        "fit for what",
    ]
    rows = [_build_channel_row(c) for c in entry["channels"]]
    return Table(columns, rows, "", caption, words=(1, 2, 3, 6, 9), detail=(5, 6, 7, 8))


def tabulate_events(entry: Mapping[str, Any]) -> Table:
    """The events of a load, a row each."""
    _, P, Q = entry["units"]
    columns = [
        "dip",
        "kind",
        "starts [s]",
        "lasts [ms]",
        "depth",
        "jump [°]",
        "U2",
        f"P [{P}]",
        f"Q [{Q}]",
        "fit it?",
    ]
    caption = (
        "Depth, U2 and jump against the voltage before. P and Q before and after. Dips are numbered"
        " as data.train and data.validate take them."
    )
    return Table(columns, [list_event_cells(e) for e in entry["events"]], "", caption, words=(1, 9))


def _lead(files: Sequence[Mapping[str, Any]]) -> str:
    """How many loads and events there are, and how many are worth fitting."""
    loads = sum(len(f["feeders"]) for f in files)
    events = [e for f in files for feeder in f["feeders"] for e in feeder["events"]]
    worth = sum(e["worth"] for e in events)
    return (
        f"{count_noun(loads, 'load')}, {count_noun(len(events), 'event')}, {worth} worth fitting."
    )


def describe_joint_fit(joint: Mapping[str, Any]) -> str:
    """What the command that fits dips of several files does, in words."""
    return f"fit {joint['dips']} dips together, as of one load, {joint['held_out']} held out"


def _add_conclusion(page: Report, entry: Mapping[str, Any]) -> None:
    """Add the commands that fit, or why there is nothing to fit."""
    commands = [(f["name"], f["command"]) for f in entry["feeders"] if f["command"]]
    if not entry["feeders"]:
        page.verdict(f"{finish_sentence(explain_unnamed(entry))} The channels are listed below.")
    elif not commands:
        page.verdict("Nothing here is worth fitting: the events below say why.", kind="bad")
        page.items([finish_sentence(said) for said in unfitted.list_sentences([entry])])
    else:
        page.verdict(
            f"To fit {'what is worth it' if len(commands) > 1 else commands[0][0]}:", kind="good"
        )
        for name, command in commands:
            if len(commands) > 1:
                page.text(f"{name}:")
            page.code(command)


def _list_facts(entry: Mapping[str, Any]) -> list[list[str]]:
    """Rows on the file: samples, frequency, station, notes."""
    segments = [
        f"{s['samples']} samples at {s['rate']:g} Hz from {s['start']:.3f} s"
        for s in entry["segments"]
    ]
    rows = [
        ["path", entry["file"]],
        ["read by", entry["reader"]],
        ["station", entry["station"]],
        ["recorder", entry["device"]],
        ["starts", str(entry["start"] or "")],
        ["sampled", "; ".join(segments)],
        ["lasts", f"{entry['seconds']:.3f} s"],
        ["frequency", format_frequency(entry)],
    ]
    return [row for row in rows if row[1]]


def format_frequency(entry: Mapping[str, Any]) -> str:
    """ "50 Hz nominal, 49.98 Hz measured"."""
    measured = entry["measured_frequency"]
    return f"{entry['frequency']:g} Hz nominal" + (
        "" if measured is None else f", {measured:.3f} Hz measured"
    )


def format_size(entry: Mapping[str, Any]) -> str:
    """U, P and Q of a load at the beginning; "" where they are not known."""
    if entry["U"] is None:
        return ""
    sizes = (
        format_figure(entry[key], 4, unit) for key, unit in zip("UPQ", entry["units"], strict=True)
    )
    return ", ".join(filter(None, sizes))


def _build_channel_row(c: Mapping[str, Any]) -> list[str]:
    """A channel's cells."""
    noise, thd = (None if c[key] is None else 100 * c[key] for key in ("noise_share", "thd"))
    return [
        str(c["number"]),
        c["name"],
        c["phase"],
        c["unit"],
        format_figure(c["magnitude"], 4, c["primary_unit"]),
        format_figure(noise, 2, "%"),
        c["colour"],
        format_figure(thd, 2, "%"),
        format_figure(c["bits"], 3),
        c["fit"],
    ]


def _build_summary_row(entry: Mapping[str, Any]) -> list[str]:
    """A load's cells."""
    sizes = [
        format_figure(entry[key], 4, unit) for key, unit in zip("UPQ", entry["units"], strict=True)
    ]
    channels = ", ".join(map(str, (*entry["voltages"], *entry["currents"])))
    worth = [e for e in entry["events"] if e["worth"]]
    return [
        entry["name"],
        entry["connection"],
        channels,
        *sizes,
        str(len(entry["events"])),
        str(len(worth)),
    ]


def _load(page: Report, view: View, shown: Sight, entry: Mapping[str, Any], folded: bool) -> None:
    """One load: what it is, what happened, and charts to look into."""
    page.heading(entry["name"])
    page.items([*_describe_entry(entry), *entry["why"], *entry["said"]])
    if entry["events"]:
        page.add(tabulate_events(entry))
    else:
        page.text(finish_sentence(explain_no_event(entry)))
    with page.fold_blocks(f"Charts of {entry['name']}") if folded else nullcontext():
        add_charts(page, view, shown)


def _describe_entry(entry: Mapping[str, Any]) -> list[str]:
    """A load's channels and what speaks for them, in sentences."""
    sentences = []
    if entry["channels"]:
        numbers = [*entry["voltages"], *entry["currents"]]
        named = ", ".join(f"{n} {c}" for n, c in zip(numbers, entry["channels"], strict=True))
        reverse = ", current reversed" if entry["reverse_current"] else ""
        sentences.append(f"Channels: {named}; connected as {entry['connection']}{reverse}.")
    if text := format_size(entry):
        when = "Before the dip" if any(e["worth"] for e in entry["events"]) else "At first"
        sentences.append(f"{when} {text}.")
    if entry["sum_V"] is not None:
        current = "" if entry["sum_I"] is None else f", the currents to {entry['sum_I']:.2%}"
        sentences.append(
            f"The voltages of the three phases sum to {entry['sum_V']:.2%} of one{current}."
        )
    return sentences


def explain_no_event(entry: Mapping[str, Any]) -> str:
    """The sentence on a load without events."""
    if entry.get("unexamined"):
        return f"{NOT_EXAMINED}: {entry['unexamined']}"
    if dead := describe_dead_phases(entry.get("dead_phases")):
        return dead
    if entry["voltages"] and not entry["currents"]:
        return f"{NO_CURRENT}; {NOTHING}"
    return NOTHING if entry["loaded"] else NO_LOAD


def describe_dead_phases(dead: str | None) -> str:
    """The sentence on phases that have no voltage from first to last; "" of none."""
    return f"no voltage in phase {dead} from first to last" if dead else ""


def is_unexamined(entry: Mapping[str, Any]) -> bool:
    """Whether a file shows no load, nothing that settings mend, and no direct voltage either."""
    return bool(entry.get("lacks")) and not entry["can_be_named"] and not entry.get("direct")


def explain_unnamed(entry: Mapping[str, Any]) -> str:
    """Why a file shows no load, and what would help, if anything does."""
    if entry.get("lacks") and not entry["can_be_named"]:
        return f"no load can be fitted: {entry['lacks']}"
    return UNNAMED


def format_start(event: Mapping[str, Any], unit: str = "") -> str:
    """When an event starts: seconds of the file, and late in a long one the clock's time too, where
    it is known.
    """
    seconds = f"{event['start']:.3f}{unit}"
    if not event.get("when") or event["start"] < LATE:
        return seconds
    moment = datetime.fromisoformat(event["when"])
    return f"{seconds}, {moment.isoformat(' ', 'milliseconds')}"


def list_event_cells(event: Mapping[str, Any]) -> list[str]:
    """The cells of one event, in the order of the table of events: dip, kind, start, duration [ms],
    depth, phase jump, U2, P and Q before and after, and whether it is worth fitting.
    """
    powers = [change(event[f"{x}_before"], event[f"{x}_after"]) for x in "PQ"]
    return [
        "" if event["dip"] is None else str(event["dip"]),
        event["kind"],
        format_start(event),
        f"{1000 * event['duration']:.0f}",
        f"{event['depth']:.1%}",
        format_degrees(event["jump"]),
        share(event["U2"]),
        *powers,
        f"{'yes' if event['worth'] else 'no'}: {event['why']}",
    ]
