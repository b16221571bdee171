"""What the names of channels say: which three (or two) belong together as phases, which one is
residual.

One mark in a name stands for its phase: `Ia`, `UL1`, `VRS`. Three names equal but for that mark are
a group, so that no list of naming schemes is needed: only the alphabets that number phases, and
where in a name the mark may stand.
"""

import functools
import itertools
import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from tractexp.recording.phase_mark import (
    CYRILLIC,
    DIGITS,
    MOST_KNOWN_NAMES,
    ORDERS,
    QUANTITY,
    find_pairs,
    has_quantity_before,
    normalize,
    spell_marks,
)
from tractexp.recording.recording import Channel, Recording

RESIDUAL = re.compile(
    (
        r"3[uvi][o0]|(?<![a-z])[uvi][_ ]?[ong0](?![a-z])|(?<![a-z])[ui][_ ]?e(?![a-z])"
        r"|(?<![a-z])3?[uvi][_ ]?(?:res|resid[a-z]*|gnd|ground|earth[a-z]*|neutr[a-z]*|null[a-z]*"
        r"|erde|erdung|terre|tierra|homopol[a-z]*|sum|summe|mp|diff|tank|gestell)(?![a-z])"
        r"|(?:residual|neutral|earth|ground|zero[- ]sequence) (?:current|voltage)"
        r"|erdstrom|summenstrom|nullstrom|零序|接地|中性|нулев|земл|нейтрал|(?<![a-z])i ?[δ地]"
    ).translate(CYRILLIC)
)
# "12-Ia", "F5-VA": a number of its own before the name
COUNTER = re.compile(r"^[a-z]{0,2}\d+[-_. :)]+")
# U21 is V1 - V2 where that name is used (an arrow from 2 to 1), as U12 is elsewhere
PLACE = {"ab": 0, "bc": 1, "ca": 2, "ba": 0, "cb": 1, "ac": 2}
SURE = 3.0  # score of a mark right after the letter of a quantity: "Ia", "UL1", "U21"
BY_NAME = "their names differ in the phase alone"
GLUED = 0.5  # score of a mark at the end of a word, where any word may end
MOST_MARKS = 3  # in a name: "HCSA -HVS1A" has two
MOST_PLACES = 8  # where one of them may stand, by likelihood: their combinations take time
NO_WAVE = re.compile(r"(?<![a-z])(?:mag|magnitude|rms|ang|angle|diff|bias)(?![a-z])")
OTHER_UNITS = frozenset(
    (  # of what is neither voltage nor current, whatever its name begins with
        "hz",
        "mhz",
        "hz/s",
        "w",
        "kw",
        "mw",
        "gw",
        "var",
        "kvar",
        "mvar",
        "va",
        "kva",
        "mva",
        "wh",
        "kwh",
        "deg",
        "°",
        "degree",
        "degrees",
        "rad",
        "s",
        "ms",
        "us",
        "min",
        "h",
        "%",
        "rpm",
        "1/min",
        "°c",
        "bar",
        "pa",
        "kpa",
        "ohm",
        "ω",
        "cos",
        "pf",
        "dimensionless",
    )
)
ROMAN = {"i": "1", "ii": "2", "iii": "3", "iv": "4", "v": "5", "vi": "6"}


@dataclass(frozen=True)
class Group:
    """Channels that belong together, in the order of their phases; of `pairs` AB, BC(, CA)."""

    numbers: tuple[int, ...]
    pairs: bool  # line-to-line quantities
    name: str  # what the names share
    certain: bool  # said by the names, not only by the file's phase column or by geometry
    evidence: str  # what says that they belong together
    missing: int | None = None  # the phase that is not there, of two phases
    backward: tuple[int, ...] = ()  # of line voltages those that count down beside others: CB


def is_residual(channel: Channel) -> bool:
    """Whether the name or the phase says that this is a neutral or zero-sequence quantity."""
    return bool(RESIDUAL.search(normalize(channel.name))) or normalize(channel.phase) in (
        "n",
        "g",
        "e",
        "3i0",
        "3u0",
    )


def find_residuals(channels: Sequence[Channel]) -> list[int]:
    """Places in a list of the channels that are residual; U0 beside U4 and U8 is the phase at that
    hour of a clock.
    """
    names = {normalize(channel.name) for channel in channels}
    return [
        k
        for k, channel in enumerate(channels)
        if is_residual(channel) and not _is_hour(normalize(channel.name), names)
    ]


def _is_hour(name: str, names: Collection[str]) -> bool:
    """Whether 0, 4 and 8 in a name are the hours of a clock by which phases are called."""
    return "0" in name and all(name.replace("0", hour) in names for hour in "48")


def is_to_ground(channel: Channel) -> bool:
    """Whether the name or the phase of a voltage says that it is to ground: AN, L1-G, phase to
    ground.
    """
    return any(
        spell_marks(text, letters)[1]
        for text in (channel.name, channel.phase)
        for letters in ORDERS
    )


def find_kind(channel: Channel) -> str:
    """voltage or current, by unit, else by the letter that starts a word of its name; "" for what
    is no wave.
    """
    if NO_WAVE.search(normalize(channel.name)):
        return ""
    if channel.quantity:
        return channel.quantity if channel.quantity in ("voltage", "current") else ""
    if channel.unit.strip().lower() in OTHER_UNITS:
        return ""
    if normalize(channel.name) in ("u", "v", "i", "udc", "vdc", "idc"):
        return "current" if normalize(channel.name)[0] == "i" else "voltage"
    letter = re.search(
        r"(?<![a-z])(u|v|i)(?=[_ ]?(?:l?[123]|l?[abcrstuvwyn]{1,2})(?![a-z]))",
        normalize(channel.name),
    )
    return "" if letter is None else "current" if letter[1] == "i" else "voltage"


def is_other_quantity(channel: Channel) -> bool:
    """Whether a channel is surely neither a voltage nor a current."""
    unit = channel.unit.strip().lower()
    return channel.quantity not in ("", "voltage", "current") or unit in OTHER_UNITS


def find_phase(channel: Channel, orders: Sequence[str] = ORDERS) -> str:
    """The phase that a channel's label gives in one of the orders: one or two of a, b, c; "" where
    it gives none.
    """
    return _read_phase(channel.phase, tuple(orders))


@functools.lru_cache(maxsize=MOST_KNOWN_NAMES)
def _read_phase(label: str, orders: tuple[str, ...]) -> str:
    """The phases of a label, by one of these orders of letters; "" where it names none."""
    label = re.sub(r"phasen?|phase|fase|фaзa|[-_/ 相]", "", normalize(label))
    label = re.sub(r"(?<=.)(?:n|g|e|pe|gnd)$", "", label)  # to ground, as a phase by itself is
    for text in (label, label.removeprefix("l"), label[1:] if label[:1] in QUANTITY else ""):
        marks = [*text.replace("l", "")]
        for letters in orders:
            if (
                1 <= len(marks) <= 2
                and all(m in letters for m in marks)
                and len(set(marks)) == len(marks)
            ):
                return "".join("abc"[letters.index(m)] for m in marks)
    return ""


def find_label_groups(channels: Mapping[int, Channel]) -> list[Group]:
    """The groups among channels of one quantity, without residual ones, by their
    names and phases.
    """
    free = {i: c for i, c in channels.items() if not is_residual(c)}
    result: list[Group] = []
    readings = [(True, True), (False, True), (True, False), (False, False)]
    searches = [
        functools.partial(_group_by_name, full=full, counters=counters)
        for full, counters in readings
    ]
    every = (*searches, _group_by_column)
    threes, twos = (itertools.product(every, (size,)) for size in (3, 2))
    for search, size in (*threes, (_group_by_mixed_pairs, 2), *twos):
        matches = search(free, size)
        result += matches
        free = {i: c for i, c in free.items() if not any(i in g.numbers for g in matches)}
    return sorted(result, key=lambda g: g.numbers[0])


def order(channels: Sequence[Channel]) -> tuple[tuple[int, ...], bool] | None:
    """Which phase (0, 1, 2) each channel is labelled as, and whether they are line to line; None:
    no label says.

    What the file's phases say comes first, then what the names share.
    """
    return _order_by_phases(channels) or _order_by_names(channels)


def _order_by_phases(channels: Sequence[Channel]) -> tuple[tuple[int, ...], bool] | None:
    """The order of channels by what the file calls the phases."""
    for letters in ORDERS:
        labels = [find_phase(c, (letters,)) for c in channels]
        for two, reading in ((False, "abc".find), (True, lambda mark: PLACE.get(mark, -1))):
            places = tuple(reading(mark) for mark in labels)
            if all(len(mark) == 1 + two for mark in labels) and len(set(places)) == len(places):
                return places, two
    return None


def _order_by_names(channels: Sequence[Channel]) -> tuple[tuple[int, ...], bool] | None:
    """The order of channels by marks at one place of all names, as they stand, else without
    counting numbers.
    """
    names = [normalize(c.name) for c in channels]
    for texts in (names, [COUNTER.sub("", name) for name in names]):
        read = [{m[:3]: m[3:] for m in _list_marks(text)} for text in texts]
        if len(channels) == 2:  # of which one may count down: AB and CB
            read = [{(k[0].removesuffix("-"), *k[1:]): v for k, v in r.items()} for r in read]
        shared = set.intersection(*(set(each) for each in read))
        readings = [
            (max(r[s][1] for r in read), tuple(r[s][0] for r in read), s[2]) for s in shared
        ]
        readings = [each for each in readings if len(set(each[1])) == len(channels)]
        if readings:
            _, places, two = max(readings)
            return places, two
    return None


def is_backward(channels: Sequence[Channel]) -> bool:
    """Whether the names of line-to-line voltages count down: U21, BA."""
    return all(
        any(key.endswith("-") for key, *_ in _list_marks(normalize(f"{c.name}"))) for c in channels
    )


def _compare_phase(channel: Channel, letters: str, place: int) -> int:
    """1 where the phase that the file tells of a channel is that of a mark, -1 where it is another
    one, 0 where it tells none or two.
    """
    own = find_phase(channel, (letters,)) or find_phase(channel)
    if own in (("ab", "bc", "ca")[place], "abc"[place]):
        return 1
    return -1 if len(own) == 1 else 0


def _group_by_name(
    channels: Mapping[int, Channel], size: int, full: bool, counters: bool
) -> list[Group]:
    """Groups of names that are equal but for the mark; with their circuits where `full`."""
    buckets: dict[tuple[str, str, bool], dict[int, list[int]]] = defaultdict(
        lambda: defaultdict(list)
    )
    worth: dict[tuple[str, str, bool], float] = defaultdict(float)
    for i, channel in channels.items():
        text = normalize(channel.name)
        text = text if counters else COUNTER.sub("", text)
        for key, letters, two, place, score in _list_marks(text):
            label = (f"{key} {normalize(channel.circuit)}" if full else key, letters, two)
            buckets[label][place].append(i)
            agreement = _compare_phase(channel, letters, place)
            worth[label] = max(worth[label], score + 4 * agreement)
    result = []
    used = set()
    for label in sorted(buckets, key=lambda each: -worth[each]):
        places = buckets[label]
        if size == 2 and not _are_two_enough(label, places, worth[label] >= SURE):
            continue
        for have, missing in _match_sets(places, size):
            if used & set(have):
                continue
            used |= set(have)
            two = label[2] or all(len(find_phase(channels[n])) == 2 for n in have)
            shared = find_shared_name([channels[n] for n in have])
            result.append(Group(have, two, shared, worth[label] >= SURE, BY_NAME, missing))
    return result


def _are_two_enough(
    label: tuple[str, str, bool], places: Mapping[int, list[int]], sure: bool
) -> bool:
    """Two voltages AB and BC, or two currents a and c, are enough; two numbered things, or ...V and
    ...W, are none.
    """
    have = {k for k, numbers in places.items() if numbers}
    return len(have) == 2 and (label[2] or (label[1] != "123" and (sure or label[1] != "uvw")))


@functools.lru_cache(maxsize=MOST_KNOWN_NAMES)
def _list_marks(text: str) -> tuple[tuple[str, str, bool, int, float], ...]:
    """Every reading of a name: (the name without the mark, alphabet, whether a pair, 0 to 2, how
    likely).
    """
    return tuple(_read_marks(text))


def _read_marks(text: str) -> Iterable[tuple[str, str, bool, int, float]]:
    """(name without its marks, letters, whether it is two phases, its place, how likely) of each
    reading.
    """
    for letters in ORDERS:
        for mark in find_pairs(text, letters):
            x, y = mark.places
            backward = "-" if (y - x) % 3 == 2 else ""
            key = f"{text[: mark.begin]}**{text[mark.end :]}{backward}"
            yield key, letters, True, PLACE[mark.letters], 6.0 - 2 * (letters == DIGITS)
        yield from _read_single_marks(text, letters)


def _read_single_marks(text: str, letters: str) -> Iterable[tuple[str, str, bool, int, float]]:
    """The readings of a name with one phase: a mark that stands alone, after a word ("HCSA"), or
    several times.
    """
    digits = letters == DIGITS
    word, glued = (r"\d", r"(?<!\d)") if digits else ("[a-z]", "")
    # {place: [(where it stands, how likely)]}
    marks: dict[int, list[tuple[int, float]]] = defaultdict(list)
    for match in re.finditer(rf"{glued}[{letters}](?!{word}(?<![ng]))", text):
        at = match.start()
        alone = digits or not text[:at][-1:].isalpha() or text[at - 1] in f"{QUANTITY}l"
        score = 3.0 * has_quantity_before(text, at) + 2 * (not digits) if alone else GLUED
        marks[letters.index(match[0])].append((at, score))
    for place, several in marks.items():
        likely = sorted(several, key=lambda mark: -mark[1])[:MOST_PLACES]
        for size in range(1, min(len(likely), MOST_MARKS) + 1):
            for those in itertools.combinations(likely, size):
                places, scores = zip(*those, strict=True)
                yield _mask(text, places), letters, False, place, max(scores)


def _mask(text: str, places: Collection[int]) -> str:
    """A text with a star at each of some places."""
    return "".join("*" if i in places else letter for i, letter in enumerate(text))


def _group_by_mixed_pairs(channels: Mapping[int, Channel], size: int) -> list[Group]:
    """Two line voltages of which one counts down, as voltage transformers in V are named: AB and
    CB.
    """
    buckets: dict[tuple[str, str], dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
    down: dict[tuple[str, str], set[int]] = defaultdict(set)
    for i, channel in channels.items():
        for key, letters, two, place, _ in _list_marks(normalize(channel.name)):
            if two:
                label = key.removesuffix("-"), letters
                buckets[label][place].append(i)
                if key.endswith("-"):
                    down[label].add(i)
    result = list[Group]()
    taken = set[int]()
    for label, places in buckets.items():
        for have, missing in _match_sets(places, size):
            backward = tuple(down[label].intersection(have))
            if len(backward) == 1 and taken.isdisjoint(have):
                taken.update(have)
                shared = find_shared_name([channels[n] for n in have])
                result.append(Group(have, True, shared, True, BY_NAME, missing, backward))
    return result


def _group_by_column(channels: Mapping[int, Channel], size: int) -> list[Group]:
    """Groups by the file's phase column: in order, within a circuit; each channel in the first
    order that fits.
    """
    result = []
    used = set()
    for letters in ORDERS:
        rows: dict[tuple[str, bool], dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
        for i, channel in channels.items():
            mark = find_phase(channel, (letters,))
            if mark and i not in used:
                place = "abc".index(mark) if len(mark) == 1 else PLACE[mark]
                rows[normalize(channel.circuit), len(mark) == 2][place].append(i)
        for (_, two), places in rows.items():
            for have, missing in _match_sets(places, size):
                shared = find_shared_name([channels[n] for n in have])
                result.append(Group(have, two, shared, False, "the file's phases say so", missing))
                used |= set(have)
    return result


def _match_sets(
    places: Mapping[int, list[int]], size: int
) -> Iterator[tuple[tuple[int, ...], int | None]]:
    """Channels, one of each phase, so many together, in the order in which they stand; the phase
    that is missing.
    """
    for numbers in zip_longest(*(places.get(k, []) for k in range(3))):
        have = tuple(n for n in numbers if n is not None)
        if len(have) == size:
            yield have, next((k for k in range(3) if numbers[k] is None), None)


def _find_common_start(texts: Sequence[str]) -> str:
    """The letters that all texts begin with."""
    alike = itertools.takewhile(lambda letters: len({*letters}) == 1, zip(*texts, strict=False))
    return "".join(letters[0] for letters in alike)


def find_shared_name(channels: list[Channel]) -> str:
    """The name of a group: its circuit where the names say no more, else what the names share."""
    names = [c.name.strip() for c in channels]
    head = _find_common_start(names)
    rests = [name.removeprefix(head) for name in names]
    tail = _find_common_start([rest[::-1] for rest in rests])[::-1]
    if len({*map(len, names)}) == 1:  # the mark may stand in several places
        tail = "".join(letters[0] for letters in zip(*rests, strict=True) if len({*letters}) == 1)
    counters = [COUNTER.match(normalize(n)) for n in names]
    head = "" if counters[0] and len({counter and counter[0] for counter in counters}) > 1 else head
    head = re.sub(r"(?i)(?:^|(?<=[^a-z]))[uvi]l?$", "", head)
    name = " ".join(f"{head} {tail}".split()).strip(" _-.:")
    circuit = channels[0].circuit.strip()
    if len(name) > 1:
        return name
    return circuit if re.search(r"[^\W\d_]", circuit) else ""


def split_words(text: str) -> set[str]:
    """The parts of a name, to be compared with another: words, numbers, single
    Chinese characters.
    """
    text = normalize(text)
    parts: set[str] = set(re.findall(r"[a-z]+|\d+|[^\W\d_a-z\u2e80-\u9fff]+|[\u2e80-\u9fff]", text))
    # "2СШ", "T1"
    parts |= set(re.findall(r"\d+[^\W\d_\u2e80-\u9fff]+|[^\W\d_\u2e80-\u9fff]+\d+", text))
    single = {"1", "5"} if re.search(r"[\u2e80-\u9fff][iv](?![a-z])", text) else set()  # "母线I"
    result = {ROMAN.get(word, word) for word in parts if len(word) > 1 or word not in ROMAN}
    return result | {ROMAN[word] for word in parts & {"i", "v"} if ROMAN[word] in single}


def name_channel(recording: Recording, number: int) -> str:
    """ "channel 4 'Ia'"."""
    return f"channel {number} '{recording.channels[number].name}'"
