"""What railways are fed by: contact line with negative feeder or return conductor, and direct
current.

A contact line and a negative feeder have opposite voltages; both carry a part of one load. A return
conductor carries back what the contact line brings, and is no load. A direct voltage is no load's
that is modelled here.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.recording.label import find_kind, normalize
from tractexp.recording.phase_mark import CYRILLIC
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import Snapshots
from tractexp.recording.unit import is_unit_in_doubt

OPPOSITE = 0.15  # of a phasor: two that are nearer to adding up to zero are opposite
TURNED = 40.0  # degrees off 180 that the currents of the two conductors are at most
BETWEEN = (45.0, 62.0)  # kV: a voltage between contact line and negative feeder, of 2x25 kV
EACH = (20.0, 31.0)  # kV: a voltage of either of them to the rail
RETURN = re.compile(
    (
        r"return|retour|retorno|ritorno|rück|schien|carril|binari|booster|erdseil|sheath|screen"
        r"|schirm|(?:ground|earth|protective) (?:wire|conductor)|обр|рельс|回流|回线|钢轨|保护线"
        r"|(?<![a-z])(?:rc|ret|rail|rails|riel|rl|bt|aew|gw|pw|ew)(?![a-z])"
    ).translate(CYRILLIC)
)
CONTACT = re.compile(
    (
        r"cat|contact|cont|ocl|ohl|trolley|oberleit|fahrleit|(?<![a-z])[tck](?![a-z])"
        r"|контакт|接触|кс"
    ).translate(CYRILLIC)
)
FEED = re.compile(
    (r"feed|neg|(?<![a-z])(?:nf|af|f|n)(?![a-z])|speise|питающ|负馈|正馈|馈线").translate(CYRILLIC)
)
DIRECT = 3.0  # times what alternates: a greater mean is a direct voltage
RIPPLE_SECONDS = 0.02  # s over which its ripple is averaged out
LEAST_DC_DIP = 0.03  # of it: a dip
LONGEST = 1 << 20  # samples that are looked at
MAGNITUDES = "the power of a load does not follow without angles, or P and Q"
ALTERNATING = "the models here are those of loads at alternating voltage"
NOMINAL_DIRECT = (0.6, 0.75, 1.5, 3.0)  # kV of direct-current railways (EN 50163)
FROM_NOMINAL_DIRECT = 0.2  # of it, by which the mean may differ
LEAST_DIRECT_RIPPLE = 5e-3  # of the mean: what ripples less may as well be an RMS value
USUAL_RIPPLE = 0.9  # of the windows: what has more in others is a step, or alternated for a while


def find_opposite_pairs(phasors: Snapshots, volts: Sequence[int]) -> list[tuple[int, int]]:
    """Voltages of 25 kV that are opposite to each other while they are alive, two by two: those of
    each arm of a substation.
    """
    free = [i for i in volts if EACH[0] <= phasors.size([i]) <= EACH[1]]
    pairs = []
    while free:
        first = free.pop(0)
        second = next((i for i in free if is_opposite(phasors, first, i)), None)
        if second is not None:
            free.remove(second)
            pairs.append((first, second))
    return pairs


def is_opposite(phasors: Snapshots, first: int, second: int) -> bool:
    """Whether two channels add up to next to nothing."""
    x, y = np.nan_to_num(phasors.select_channels((first, second)))
    large = np.abs(x) + np.abs(y)
    alive = large > 0.5 * large.max(initial=0.0)
    return bool(alive.any() and np.median(np.abs(x + y)[alive] / large[alive]) < OPPOSITE / 2)


def is_between_conductors(phasors: Snapshots, voltage: int) -> bool:
    """Whether a voltage has the size of that between contact line and negative feeder."""
    return BETWEEN[0] <= phasors.size([voltage]) <= BETWEEN[1]


def find_conductor_pairs(
    recording: Recording, phasors: Snapshots, volts: Sequence[int], amps: Sequence[int]
) -> list[tuple[int, int, bool]]:
    """(contact line, negative feeder) currents that belong to `volts`, one voltage each or the one
    between them, and whether that of the feeder is counted the other way.

    Currents of one direction are those of two conductors only where names say so: else they may be
    the contact lines of two tracks.
    """
    if len(volts) == 1 and not is_between_conductors(phasors, volts[0]):
        return []
    names = {
        i: normalize(f"{recording.channels[i].name} {recording.channels[i].circuit}") for i in amps
    }
    feeds = [i for i in amps if FEED.search(names[i]) and not RETURN.search(names[i])]
    contacts = [i for i in amps if i not in feeds and not RETURN.search(names[i])]
    named = len(contacts) == len(feeds)
    if named:
        pairs = [*zip(contacts, feeds, strict=True)]
    else:
        pairs = [*zip(amps[::2], amps[1::2], strict=False)] if len(amps) % 2 == 0 else []
    carried = [(*pair, False) for pair in pairs if _are_opposite_angles(phasors, pair)]
    if named:
        carried += [(*pair, True) for pair in pairs if _are_opposite_angles(phasors, pair, -1.0)]
    return carried


def _are_opposite_angles(phasors: Snapshots, pair: tuple[int, int], sign: float = 1.0) -> bool:
    """Whether two currents are opposite in angle, as those of contact line and feeder are, though
    not in size; with `sign` -1 whether they have one angle.
    """
    x, y = np.nan_to_num(phasors.select_channels(pair))
    y = sign * y
    both = (np.abs(x) > 0.3 * np.abs(x).max(initial=0.0)) & (
        np.abs(y) > 0.3 * np.abs(y).max(initial=0.0)
    )
    both &= (np.abs(x) > 0) & (np.abs(y) > 0)
    return bool(both.any() and abs(np.degrees(np.angle(-np.median((x * y.conj())[both])))) < TURNED)


def find_other_conductor(
    recording: Recording, phasors: Snapshots, current: int, amps: Sequence[int]
) -> int | None:
    """The current of the other conductor of an autotransformer feeder, by name and angle; None
    where there is none.
    """
    name = normalize(recording.channels[current].name)
    for other in amps:
        names = name, normalize(recording.channels[other].name)
        feeds, contacts = (
            [bool(FEED.search(n)) for n in names],
            [bool(CONTACT.search(n)) for n in names],
        )
        apart = feeds[0] != feeds[1] and contacts[feeds.index(False)]
        if other != current and apart and _are_opposite_angles(phasors, (current, other)):
            return other
    return None


def find_unnamed_conductor(
    recording: Recording, phasors: Snapshots, current: int, amps: Sequence[int]
) -> int | None:
    """The only other current, of the same angle, where no name tells their conductors; else
    None.
    """
    names = " ".join(normalize(recording.channels[i].name) for i in amps)
    others = [i for i in amps if i != current]
    if len(others) != 1 or FEED.search(names) or CONTACT.search(names):
        return None
    return others[0] if _are_opposite_angles(phasors, (current, others[0]), -1.0) else None


def is_return(recording: Recording, number: int) -> bool:
    """Whether the name of a current says that it is that of a return conductor or of the rail.

    "I_R" is, where no voltage is called R, as that of a phase is.
    """
    channel = recording.channels[number]
    if RETURN.search(normalize(f"{channel.name} {channel.circuit}")):
        return True
    name = normalize(channel.name)
    voltages = (normalize(c.name) for c in recording.channels if find_kind(c) == "voltage")
    return name in ("ir", "i_r", "i r") and not any(
        re.search(r"(?<![a-z])(?:[uve][_ ]?)?r(?![a-z])", one) for one in voltages
    )


def order_contact_first(recording: Recording, pair: tuple[int, int]) -> tuple[int, int]:
    """Two voltages, that of the contact line first, as far as their names tell."""
    first, second = (normalize(recording.channels[i].name) for i in pair)
    swapped = FEED.search(first) and CONTACT.search(second) and not FEED.search(second)
    return (pair[1], pair[0]) if swapped else pair


def describe_direct_voltage(recording: Recording) -> str:
    """The mean, ripple and dip of direct voltages, one clause; "" where none are recorded."""
    said = ""
    for number, channel in enumerate(recording.channels):
        if (
            channel.form != "waveform"
            or find_kind(channel) != "voltage"
            or is_unit_in_doubt(channel)
        ):
            continue
        seen, start = _measure_direct(recording, number)
        if seen is not None and seen.alternates:
            return ""
        if seen is not None and seen.is_direct:
            said = said or f"{seen.describe(channel.name.strip(), start)}; {seen.why_no_load}"
    return said


def describe_direct_beside(recording: Recording, numbers: Sequence[int]) -> list[str]:
    """One clause for each of these channels that is a direct voltage, beside alternating ones."""
    seen = [(i, *_measure_direct(recording, i)) for i in numbers]
    return [
        f"{voltage.describe(recording.channels[i].name.strip(), start)}; no load is shown of it"
        for i, voltage, start in seen
        if voltage is not None
        and voltage.is_direct
        and find_kind(recording.channels[i]) == "voltage"
    ]


def _measure_direct(recording: Recording, number: int) -> "tuple[DirectVoltage | None, float]":
    """A channel as a direct voltage, and the time of its first sample [s]."""
    segment = max(recording.segments, key=lambda s: s.stop - s.first)
    for most in (LONGEST // 16, LONGEST):  # what alternates shows it at the beginning
        stop = min(segment.stop, segment.first + most)
        values = recording.channels[number].values(segment.first, stop)
        seen = DirectVoltage.from_values(values, segment.rate)
        if seen is not None and seen.alternates:
            break
    return seen, segment.start


@dataclass(frozen=True)
class DirectVoltage:
    """A voltage as a direct one: its mean, what is faster, and the deepest dip, where it is one."""

    mean: float  # kV
    alternating: float  # kV RMS of what is faster than a cycle
    greatest: float  # kV
    fall: float = 0.0  # of the mean
    begin: float = 0.0  # s from the first sample to that of the dip
    seconds: float = 0.0

    @classmethod
    def from_values(cls, x: np.ndarray, rate: float) -> "DirectVoltage | None":
        """Values (N,) [kV]; None where there are too few."""
        n = max(3, round(RIPPLE_SECONDS * rate)) | 1
        x = x[np.isfinite(x)]
        if len(x) < 4 * n:
            return None
        smooth = np.convolve(x, np.full(n, 1 / n), "valid")
        rest = (x[n // 2 : len(x) - n // 2] - smooth)[: len(smooth) // n * n]
        ripple = float(np.sqrt(np.quantile(rest.reshape(-1, n).var(axis=1), USUAL_RIPPLE)))
        found = cls(float(np.median(smooth)), ripple, float(np.abs(x).max()))
        if not found.is_direct:
            return found
        shares = smooth / found.mean
        fall = 1 - float(shares.min())
        below = shares < 1 - max(LEAST_DC_DIP, fall / 2)
        begin, count = (int(np.argmax(below)) + n // 2) / rate, np.count_nonzero(below)
        return replace(found, fall=fall, begin=begin, seconds=count / rate)

    @property
    def alternates(self) -> bool:
        """Whether it is an alternating voltage."""
        return not self.is_direct and self.alternating > DIRECT * abs(self.mean)

    @property
    def is_direct(self) -> bool:
        """Whether it is a direct voltage."""
        return abs(self.mean) > DIRECT * max(self.alternating, self.greatest / 20)

    @property
    def is_magnitude(self) -> bool:
        """Whether it may as well be an RMS value: steady, and no nominal voltage of railways."""
        steady = self.alternating < LEAST_DIRECT_RIPPLE * self.mean
        return steady and not is_near_direct_nominal(self.mean)

    @property
    def why_no_load(self) -> str:
        """Why no load at it is fitted, one clause."""
        return MAGNITUDES if self.is_magnitude else ALTERNATING

    def describe(self, name: str, start: float = 0.0) -> str:
        """One clause, times counted from `start` [s] at the first sample."""
        dip = (
            f", and falls to {_format_voltage(self.mean * (1 - self.fall))} ({self.fall:.1%}) at"
            f" {start + self.begin:.3f} s for {1000 * self.seconds:.0f} ms"
            if self.fall > LEAST_DC_DIP
            else ""
        )
        what = "keeps its sign, as RMS values do" if self.is_magnitude else "is direct"
        return (
            f"the voltage '{name}' {what}: {_format_voltage(self.mean)} in the mean with a ripple"
            f" of {self.alternating / abs(self.mean):.1%} RMS{dip}"
        )


def _format_voltage(kilovolts: float) -> str:
    """A voltage as it is said of direct ones: in V, and in kV above those of railways."""
    large = abs(kilovolts) > 2 * max(NOMINAL_DIRECT)
    return f"{kilovolts:.4g} kV" if large else f"{1000 * kilovolts:.4g} V"


def is_near_direct_nominal(mean: float, within: float = FROM_NOMINAL_DIRECT) -> bool:
    """Whether a mean [kV] is near a nominal direct voltage of railways."""
    return any(abs(mean / nominal - 1) <= within for nominal in NOMINAL_DIRECT)
