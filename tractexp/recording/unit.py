"""The units of a recording's voltages and currents: as its user says, as its file says, or as their
size leaves it.

What a factor of a thousand hangs on is never assumed: where neither says it, the channel stays in
doubt, and whoever needs it raises the question.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tractexp.errors import DATA, UserError, list_allowed
from tractexp.recording.label import find_kind, find_label_groups
from tractexp.recording.recording import Channel, Recording, find_quantity, find_unit

PLAIN = {"U": ("voltage", "V", "kV"), "I": ("current", "A", "kA")}  # by letter of the setting
# RMS in kV, kA: no network has more, so that a larger number is in V, A
GREATEST = {"U": 1500.0, "I": 100.0}
# kV RMS of a voltage transformer's secondary: 100 to 120 V, of lines or to ground
SECONDARY = 0.04, 0.16
SECONDARY_GROUND = 0.05, 0.072  # kV RMS: of 100 to 120 V, to ground
SECONDARY_LINES = 0.09, 0.125  # kV RMS: the same between phases
ALIVE = 0.2  # of the greatest voltage: what is less is dead, or a zero sequence
LEAST_AMPERES = 1.0  # RMS: fewer beside voltages in V may as well be kA
SECONDARY_VALUES = "these are secondary values"  # a note on them begins so
_AMOUNT = re.compile(r"\s*([+-]?\d+\.?\d*(?:[eE][+-]?\d+)?)\s*(\D.*)", re.ASCII)


def parse_amount(text: str) -> tuple[float, str]:
    """(number, unit) of a setting such as "89.8 kV", what one of the file's units stands for; (1,
    "kV") of "kV".
    """
    match = _AMOUNT.fullmatch(str(text))
    return (float(match[1]), match[2].strip()) if match else (1.0, str(text).strip())


def check_units(units: Mapping[str, Any], quantities: Sequence[str] = tuple(PLAIN)) -> None:
    """Raise `UserError` for a setting that names no quantity of a recording, or a unit that does
    not fit it.
    """
    if not isinstance(units, Mapping):
        raise UserError(
            f"{DATA.units}={units!s:.60} must be a mapping, such as {DATA.units}={{U: kV, I: A}}"
        )
    for letter, text in units.items():
        if letter not in quantities:
            raise UserError(
                f"{DATA.units} names '{letter}'{list_allowed(letter, quantities, 'Quantities')}"
            )
        if letter in PLAIN and (
            find_unit(parse_amount(text)[1])[0] != PLAIN[letter][0] or parse_amount(text)[0] <= 0
        ):
            _, small, large = PLAIN[letter]
            raise UserError(
                f"{DATA.units}: {letter}={text} is no unit of a {PLAIN[letter][0]}; one is {small}"
                f" or {large}, or, where the file has units of its own, so many of them: '89.8"
                f" {large}'"
            )


def _select_channels(
    channels: Sequence[Channel], quantity: str, chosen: Sequence[int]
) -> list[int]:
    """The numbers of the channels that are of a quantity, or are called so by the user and of no
    other.
    """
    called = [i for i, c in enumerate(channels) if find_kind(c) == quantity or i in chosen]
    return [i for i in called if channels[i].quantity in (quantity, "")]


def _find_bare(
    channels: Sequence[Channel], numbers: Sequence[int], letter: str, voltage: str
) -> list[int]:
    """Those of channels of one quantity without a unit, where their size tells it; else none.
    `voltage` is the unit of the file's voltages.
    """
    stated = {channels[i].unit for i in numbers if not is_unit_in_doubt(channels[i])}
    bare = [i for i in numbers if not channels[i].unit.strip()]
    size = max((_measure_size(channels[i]) for i in bare), default=0.0)
    return bare if bare and _is_plainly_volts(letter, size, stated, voltage) else []


def convert_to_units(
    recording: Recording, units: Mapping[str, Any], chosen: Mapping[str, Sequence[int]]
) -> Recording:
    """The recording with the unit of each voltage and current, as far as it can be known, and a
    note where size says.

    `units` {U: kV, I: "0.5 kA"} goes before the file's; `chosen` {U: numbers, I: numbers} are
    channels that the user calls so.
    """
    channels, taken, voltage = [*recording.channels], {}, ""
    for letter, (quantity, small, _) in PLAIN.items():
        ours = _select_channels(channels, quantity, chosen.get(letter, ()))
        if letter in units:
            number, unit = parse_amount(units[letter])
            for i in ours:
                channels[i] = _convert_channel(channels[i], quantity, unit, number)
            continue
        if bare := _find_bare(channels, ours, letter, voltage):
            for i in bare:
                channels[i] = _convert_channel(channels[i], quantity, small)
            taken |= {letter: bare}
        voltage = next((c.unit for c in (channels[i] for i in ours) if not is_unit_in_doubt(c)), "")
    by_size = not {"U", "I"} & {*units} and _have_secondary_size(channels)
    by_size = by_size and not any(c.side for c in channels)
    channels = [*map(_set_secondary, channels)] if by_size else _mark_secondary(channels)
    told = any(note.startswith(SECONDARY_VALUES) for note in recording.notes)
    secondary = [] if told else _note_secondary_values(channels, by_size)
    notes = (*recording.notes, *_note(channels, taken), *secondary)
    return replace(recording, channels=channels, notes=notes)


def _have_secondary_size(channels: Sequence[Channel]) -> bool:
    """Whether all voltages that are alive are those of voltage transformers' secondaries, whatever
    the file says: no network has 50 to 72 V to ground, nor 90 to 125 V between phases.
    """
    volts = {
        i: c
        for i, c in enumerate(channels)
        if c.form == "waveform" and find_kind(c) == "voltage" and not is_unit_in_doubt(c)
    }
    sizes = {i: c.factor * _measure_size(c) for i, c in volts.items()}
    alive = [i for i, size in sizes.items() if size > ALIVE * max(sizes.values())]
    lines = {i for group in find_label_groups(volts) if group.pairs for i in group.numbers}
    limits = {i: SECONDARY_LINES if i in lines else SECONDARY_GROUND for i in alive}
    return bool(alive) and all(limits[i][0] <= sizes[i] <= limits[i][1] for i in alive)


def _mark_secondary(channels: Sequence[Channel]) -> list[Channel]:
    """The channels with S where their values are secondary: if a voltage has the size of one, and
    none is larger.
    """
    if not any(c.side for c in channels):
        return [*channels]
    low, high = SECONDARY
    sizes = np.array([c.factor * _measure_size(c) for c in channels if _is_sided_voltage(c)])
    larger, alike = (sizes > high).any(), ((low <= sizes) & (sizes <= high)).any()
    return [
        _set_secondary(c) if not larger and (alike or c.side == "S") else replace(c, side="")
        for c in channels
    ]


def _is_sided_voltage(channel: Channel) -> bool:
    """Whether a voltage's file says, or leaves open, on which side of the transformer it is."""
    return bool(channel.side) and channel.quantity == "voltage" and not is_unit_in_doubt(channel)


def _set_secondary(channel: Channel) -> Channel:
    """The channel as one of secondary values, but where its transformer's ratio is applied."""
    stays = channel.quantity == "current" and channel.ratio != 1
    return replace(channel, side="" if stays else "S")


def _note_secondary_values(channels: Sequence[Channel], by_size: bool) -> list[str]:
    """A note on secondary values, which may be told by their size, and the setting that gives their
    ratio; [] where there are none.
    """
    ours = [c for c in channels if c.side == "S" and c.quantity in ("voltage", "current")]
    if not ours:
        return []
    letters = {
        letter: next((c for c in ours if c.quantity == quantity), None)
        for letter, (quantity, _, _) in PLAIN.items()
    }
    examples = {"U": "1.1 kV", "I": "120 A"}
    setting = ", ".join(
        f"{letter}: '{examples[letter]}'" for letter, c in letters.items() if c is not None
    )
    sizes = " and ".join(
        f"{_measure_size(c):.4g} {c.unit.strip()}" for c in letters.values() if c is not None
    )
    told = "and the file gives no ratio of the transformers"
    if by_size:
        told = "by their size, whatever the file says"
    return [
        f"{SECONDARY_VALUES} ({sizes}), {told}: powers are not in MW; say what one of the file's"
        f" units is on the primary side, e.g. {DATA.units}={{{setting}}}"
    ]


def is_secondary(recording: Recording, numbers: Mapping[str, Sequence[int]]) -> bool:
    """Whether a channel of {U: ..., I: ...} holds secondary values of which no ratio is known."""
    return any(recording.channels[i].side == "S" for ours in numbers.values() for i in ours)


def _note(channels: Sequence[Channel], taken: Mapping[str, Sequence[int]]) -> list[str]:
    """A note on units that were taken for others; [] where none were."""
    names = ", ".join(channels[i].name.strip() for numbers in taken.values() for i in numbers)
    small, large = (
        " and ".join(PLAIN[x][1] for x in taken),
        ", ".join(f"{x}: {PLAIN[x][2]}" for x in taken),
    )
    return (
        [f"no unit of {names}: taken as {small} (data.units={{{large}}} says else)"]
        if taken
        else []
    )


def _convert_channel(channel: Channel, quantity: str, unit: str, number: float = 1.0) -> Channel:
    """A channel of another quantity and unit, of which its own is `number`."""
    gain = number * channel.gain
    offset = number * channel.offset
    return replace(channel, unit=unit, quantity=quantity, gain=gain, offset=offset, side="")


def _is_plainly_volts(letter: str, size: float, stated: set[str], voltage: str) -> bool:
    """Whether numbers without a unit, of that RMS, can be nothing but volts or amperes."""
    if size > GREATEST[letter]:
        return True
    in_volts = bool(voltage) and find_unit(voltage)[1] == find_unit("V")[1]
    return letter == "I" and not stated and in_volts and size >= LEAST_AMPERES


def _measure_size(channel: Channel) -> float:
    """RMS about the mean, as recorded, on the primary side."""
    x = channel.read_values()
    x = x[np.isfinite(x)]
    return abs(channel.ratio) * float(x.std()) if len(x) else 0.0


def is_unit_in_doubt(channel: Channel) -> bool:
    """Whether a channel's unit is none of voltage or current that is known."""
    return not find_unit(channel.unit)[0]


def check_doubt(recording: Recording, numbers: Mapping[str, Sequence[int]]) -> None:
    """Raise `UserError` where a channel of {U: ..., I: ...} is in doubt: the question, and the
    setting that answers.
    """
    odd = {
        x: [recording.channels[i] for i in ours if is_unit_in_doubt(recording.channels[i])]
        for x, ours in numbers.items()
    }
    odd = {letter: channels[0] for letter, channels in odd.items() if channels}
    if not odd:
        return
    said = "; ".join(
        f"'{c.name.strip()}' has {_describe_unit(c, letter)}"
        f" and numbers of an RMS of {_measure_size(c):.4g}"
        for letter, c in odd.items()
    )
    plainly = ", ".join(f"{letter}: {PLAIN[letter][2]}" for letter in odd)
    stands = ", ".join(f"{letter}: '1.5 {PLAIN[letter][2]}'" for letter in odd)
    raise UserError(
        f"{recording.source}: {said}: say the unit, {DATA.units}={{{plainly}}} or V, A, or what one"
        f" of the file's units, or one per unit, stands for, {DATA.units}={{{stands}}}"
    )


def _describe_unit(channel: Channel, letter: str) -> str:
    """The unit of a channel that is in doubt, and what is open about it."""
    unit = channel.unit.strip()
    if not unit:
        return "no unit"
    open_question = (
        f", which may be {PLAIN[letter][1]} or {PLAIN[letter][2]}," if find_quantity(unit) else ""
    )
    return f"the unit '{unit}'{open_question}"
