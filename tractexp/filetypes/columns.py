"""The meaning of column names: quantity, phase, unit.

t Time [s] Zeit in ms 时间 U Voltage (kV) Va UA(kV) V1 m:u1:bus in p.u. P [MW] Active power
"""

import itertools
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tractexp.recording.phase_mark import ORDERS, plain, spell_marks
from tractexp.recording.recording import unit_of
from tractexp.recording.unit import amount

# {unit in lower case, but those of voltage and current: (quantity, factor to s, MW, Mvar, Hz, rad,
# pu)}
UNITS: Mapping[str, tuple[str, float]] = {
    unit: (quantity, size)
    for quantity, sizes in {
        "t": {
            1.0: "s sec second seconds sek 秒 с сек",
            1e-3: "ms msec millisecond milliseconds 毫秒 мс",
            1e-6: "us µs μs usec microseconds 微秒 мкс",
            1e-9: "ns",
            60.0: "min",
            3600.0: "h",
            86400.0: "day days",
        },
        "power": {1.0: "mw мвт 兆瓦", 1e-3: "kw квт 千瓦", 1e-6: "w", 1e3: "gw"},
        "reactive": {
            1.0: "mvar mva мвар 兆乏",
            1e-3: "kvar kva квар 千乏",
            1e-6: "var va",
            1e3: "gvar",
        },
        "frequency": {1.0: "hz гц", 1e-3: "mhz"},
        "rocof": {1.0: "hz/s"},
        "angle": {0.017453292519943295: "deg degree degrees ° grad 度", 1.0: "rad radian radians"},
        "": {1.0: "pu p.u. p.u puv 1", 1e-2: "%"},
    }.items()
    for size, units in sizes.items()
    for unit in units.split()
} | {"per unit": ("", 1.0)}
PER_UNIT = frozenset(unit for unit, (quantity, _) in UNITS.items() if not quantity)
FITTING: Mapping[str, tuple[str, ...]] = {
    "t": ("t",),
    "U": ("voltage", ""),
    "I": ("current", ""),
    "P": ("power", ""),
    "Q": ("reactive", ""),
    "f": ("frequency", ""),
    "dfdt": ("rocof", "frequency", ""),
    "angle": ("angle", ""),
    "day": ("t", ""),
    "frac": ("t", ""),
    "soc": ("t", ""),
}
# as files write them
ALSO: Mapping[str, tuple[str, ...]] = {"P": ("reactive",), "Q": ("power",), "t": ("",)}
BRACKETED = (
    r"(.+?)[\s_]*[\[(（{<]\s*([^\])）}>]*?)\s*[\])）}>]",
    r"(.+?)\s*/\s*(\S+)",
    r"(.+?)\s+in\s+(\S+)",
)
LONGEST_NAME_END = 80  # letters at the end of a name among which its unit is
UNMISTAKABLE = frozenset(
    (  # as units after a space or an underscore, where V and A may be phases
        "kv",
        "ka",
        "mw",
        "kw",
        "mvar",
        "kvar",
        "hz",
        "s",
        "ms",
        "us",
        "pu",
        "deg",
        "rad",
    )
)


def _by_word(words: Mapping[str, str]) -> dict[str, str]:
    """{word: what it stands for}, of {what: its words, parted by spaces}."""
    return {word: what for what, several in words.items() for word in several.split()}


# {word: quantity}; longer ones match within a name too, in scripts that do not part words
WORDS: Mapping[str, str] = _by_word(
    {
        "t": (
            "t time timestamp datetime zeit zeitpunkt uhrzeit zeitstempel clock temps tiempo tempo"
            " tnow utc unixtime epoch время 时间 时刻"
        ),
        "soc": "soc century",
        "day": "date datum 日期 дата",
        "U": (
            "u v vm um voltage volt volts vmag umag urms vrms u1l ul ull uln vll vln ulg vlg uac"
            " vac umean vmean uavg vavg spannung leiterspannung vline uline vph uph vphase uphase"
            " vpn upn 電圧 전압 напряжение напряж 电压 tension tensión voltaje tensione"
        ),
        "I": "i im current curr irms strom ток 电流 courant corriente corrente",
        "P": (
            "p ptot psum ptotal totw pload pl pelec plod powr ppq active real wirkleistung активная"
            " 有功 有功功率"
        ),
        "Q": (
            "q qtot qsum qtotal totvar qload ql qelec qlod vars qpq reactive blindleistung"
            " реактивная 无功 无功功率"
        ),
        "f": "f fe freq frequency fehz fq frequenz frq частота 频率",
        "dfdt": "dfdt df rocof dfreq",
    }
)
# {word of a column that holds the fractions of the seconds in another: their unit, "" where their
# size tells it}
FRACTIONS: Mapping[str, str] = _by_word(
    {
        "": "fracsec frac fraction fractions fractional subsecond subseconds",
        "ms": "ms msec millis millisec millisecond milliseconds 毫秒",
        "us": "usec micros microsec microsecond microseconds 微秒",
        "ns": "nsec nanosecond nanoseconds 纳秒",
    }
)
ANGLE = frozenset(("angle", "ang", "winkel", "arg", "phi", "theta", "угол", "相角", "角度", "deg"))
PHASES: Mapping[str, str] = _by_word(
    {
        "a": "a l1 an ag",
        "b": "b l2 bn bg",
        "c": "c l3 cn cg",
        "ab": "ab 12 l12 l1l2",
        "bc": "bc 23 l23 l2l3",
        "ca": "ca 31 l31 l3l1",
        "ba": "ba",
        "cb": "cb",
        "ac": "ac",
        "1": "pos positive ps 1 正序 mitsystem",
        "2": "neg negative ns 2 负序 gegensystem",
        "0": "0 zero zs 零序",
        "3": "3",
        "n": "n",
    }
)
# line voltages that are the opposite of those of `data.columns`
BACKWARD = {"ba": "ab", "cb": "bc", "ac": "ca"}
LINE = frozenset(
    ("ll", "ul", "ull", "vll", "u1l", "line", "pp", "vline", "uline", "leiterspannung")
)
GROUND = frozenset(
    (
        "vph",
        "uph",
        "vphase",
        "uphase",
        "vpn",
        "upn",
        "ln",
        "lg",
        "uln",
        "vln",
        "ulg",
        "vlg",
        "ph",
        "an",
        "bn",
        "cn",
        "ag",
        "bg",
        "cg",
    )
)
COMPOUND = re.compile(
    r"(u|v|i|p|q)(l1l2|l2l3|l3l1|l12|l23|l31|l1|l2|l3|ab|bc|ca|ba|cb|ac|an|bn|cn|ag|bg|cg|12|23|31|pos|neg|zero|ps|ns"
    r"|a|b|c|0|1|2|3|n)(mag|m|ang|rms)?"
)
PHASE_KEYS = ("a", "b", "c", "ab", "bc", "ca")
TABLE_ORDERS = (*ORDERS, "UVW")  # the last: UV is the voltage of phase V
BY_UNIT: Mapping[str, str] = {"voltage": "U", "current": "I", "power": "P", "reactive": "Q"}
ELECTRICAL = frozenset(BY_UNIT.values())


@dataclass(frozen=True)
class Role:
    """The quantity, phase and unit of a table's column.

    Attributes
    ----------
    key : str
        As in `data.columns`: U, P, Ua, I1_angle and the like.
    unit : str
        As the heading names it, "" where it does not.
    line : bool or None
        Whether a voltage is line to line; None where its name does not say it.
    backward : bool
        Whether its two phases are named the other way round, BA in place of AB.
    """

    # t, frac, soc, U, U2, P, Q, f, dfdt, day; Ua ... Uca, U1, Ia ..., Pa ...; an angle ends in
    # _angle
    key: str
    unit: str = ""
    line: bool | None = None  # of a voltage: line to line, phase to ground, unsaid
    backward: bool = False  # of a line voltage: BA, which is the opposite of AB

    @property
    def quantity(self) -> str:
        """Its key in `data.units`."""
        if self.key.endswith("_angle"):
            return "angle"
        return self.key if self.key in ("t", "f", "dfdt", "frac", "soc", "day") else self.key[0]


def split_unit(name: str) -> tuple[str, str]:
    """A column's name and its unit.

    A unit stands at the end: before its last letters nothing is looked for, which would take hours
    in a name of a million brackets.

    Parameters
    ----------
    name : str
        A heading.

    Returns
    -------
    (str, str)
        The unit is "" where there is none.

    Examples
    --------
    >>> split_unit("Voltage [kV]"), split_unit("P_MW"), split_unit("speed")
    (('Voltage', 'kV'), ('P', 'MW'), ('speed', ''))
    """
    name = name.strip().strip('"').strip("'").strip()
    before = name[:-LONGEST_NAME_END]
    end = name[-LONGEST_NAME_END:]
    for pattern in BRACKETED:
        if (match := re.fullmatch(pattern, end)) and is_unit(match[2]):
            return before + match[1].strip(), match[2]
    match = re.fullmatch(r"(.+?)[\s,_]+([^\s,_]+)", end)
    sure = (
        match is not None
        and match[2] != "S"
        and (  # S: a phase
            match[2].lower() in UNMISTAKABLE or (not match[2].isascii() and is_unit(match[2]))
        )
    )
    return (before + match[1], match[2]) if match and sure else (name, "")


def is_unit(text: str) -> bool:
    """Whether a text is a unit of `UNITS`."""
    return meaning(text) is not None and not text.strip().isdigit()


def meaning(unit: str) -> tuple[str, float] | None:
    """What a unit means.

    Parameters
    ----------
    unit : str
        As written.

    Returns
    -------
    (str, float) or None
        The quantity ("" of per unit) and the factor to the unit used inside; None for no unit.

    Examples
    --------
    >>> meaning("kW"), meaning("furlong")
    (('power', 0.001), None)
    """
    if unit.strip() == "mW":
        return "power", 1e-9
    electrical = unit_of(unit)
    return electrical if electrical[0] else UNITS.get(unit.strip().lower())


def factor(unit: str) -> float:
    """The factor from a unit to the one used inside (kV, kA, MW, Mvar, s); 1 for no unit.

    A setting's unit may have a number before it.

    Examples
    --------
    >>> factor("V"), factor("89.8 kV")
    (0.001, 89.8)
    """
    number, unit = amount(unit)
    return number * (meaning(unit) or ("", 1.0))[1]


def fits(quantity: str, unit: str, exact: bool = False) -> bool:
    """Whether a unit is one of a quantity, as `data.units` calls it; P in Mvar, Q in MW are, unless
    `exact`.
    """
    kind = unit_quantity(amount(unit)[1])
    return kind in (FITTING[quantity] if exact else {*FITTING[quantity], *ALSO.get(quantity, ())})


def order_of(names: Sequence[str], units: Sequence[str]) -> str:
    """The order of phases, one of `TABLE_ORDERS`, in which most columns of a table have marks; the
    first of several.
    """
    named = [column for column in zip(names, units, strict=True) if column[0]]
    return max(TABLE_ORDERS, key=lambda order: _count_marks(named, order))


def _count_marks(named: Sequence[tuple[str, str]], order: str) -> int:
    """How many columns of (name, unit) an order of phases gives marks: of the quantity with the
    most, pairs of phases or all three, or of voltages to ground.
    """
    roles = filter(None, (role(name, unit, order) for name, unit in named))
    marked = [one for one in roles if one.key.removesuffix("_angle")[1:] in PHASE_KEYS]
    keys = {one.key.removesuffix("_angle") for one in marked}
    counts = Counter((key[0], len(key)) for key in keys)
    most = max((n for (_, length), n in counts.items() if 3 in (length, n)), default=0)
    return max(most, len({one.key for one in marked if one.line is False}))


def role(name: str, unit: str = "", order: str = ORDERS[0]) -> Role | None:
    """The role of a column, by its name and unit; None where they do not tell.

    Parameters
    ----------
    name : str
        Without the unit.
    unit : str
        "" where there is none.
    order : str
        The order of phases in the table.

    Returns
    -------
    Role or None
        None where the name says nothing that is known.

    Examples
    --------
    >>> role("active power", "MW").key
    'P'
    """
    words = _words(name)
    kind = unit_quantity(unit)
    electrical = kind in (*BY_UNIT, "angle") or not ELECTRICAL.isdisjoint(map(WORDS.get, words))
    if unmarked := _fraction(words, unit) or _other_role(words, unit, electrical):
        return unmarked
    spelled, ground = spell_marks(name, order)
    if spelled != plain(name):
        words = _words(spelled)
    said = _marked_quantity(words, kind, ground, electrical)
    if said is None:
        return None
    key, phase = said
    if (key, kind) in (("U", "current"), ("I", "voltage")):  # "Voltage (A)": a phase, no unit
        return role(f"{name} {unit}", order=order)
    whole = BACKWARD.get(phase, phase)
    backward = phase in BACKWARD
    if key in ("U", "I") and _is_angle(words, kind):
        return Role(f"{key}{whole}_angle", unit, backward=backward)
    if key == "U":
        return Role(key + whole, unit, _is_between_lines(words, phase, ground), backward)
    return Role(key + whole, unit)


def unit_quantity(unit: str) -> str:
    """The quantity of a unit; "" of per unit, and for no unit."""
    return (meaning(unit) or ("",))[0]


def _fraction(words: Sequence[str], unit: str) -> Role | None:
    """The role of a column of fractions of a second; None for any other."""
    for word in words:
        if word in FRACTIONS and (len(words) == 1 or not FRACTIONS[word]):
            return Role("frac", unit or FRACTIONS[word])
    return None


def _other_role(words: Sequence[str], unit: str, electrical: bool) -> Role | None:
    """The role of a column of time, frequency and the like; None for any other."""
    said = None if electrical else _quantity(words)
    return Role(said[0], unit) if said and said[0] not in ELECTRICAL else None


def _is_angle(words: Sequence[str], kind: str) -> bool:
    """Whether a phasor's column holds its angle."""
    if kind == "angle" or words[-1] == "phase" or ANGLE.intersection(words):
        return True
    return any(word.endswith("ang") for word in words)


def _is_between_lines(words: Sequence[str], phase: str, ground: bool) -> bool | None:
    """Whether a voltage is line to line; None where its name does not say it."""
    if len(phase) == 2 or LINE.intersection(words):
        return True
    ends = [word[1:] for word in words if word[0] in "uv"]
    return False if ground or GROUND.intersection((*words, *ends)) else None


def _quantity(words: Sequence[str], ground: bool = False) -> tuple[str, str] | None:
    """(quantity, phase) that words say; None where they say none. A letter by itself is a phase
    where `ground` is said.
    """
    return _compound(words) or _match_words(words, ground)


def _marked_quantity(
    words: Sequence[str], kind: str, ground: bool, electrical: bool
) -> tuple[str, str] | None:
    """(quantity, phase) that words say, marks of phases among them; None where they say none."""
    said = _quantity(words, ground)
    if said and (said[0] in ELECTRICAL or not electrical):
        return said
    return _match_mark(words, kind, ground) or said


def _match_mark(words: Sequence[str], kind: str, ground: bool) -> tuple[str, str] | None:
    """(quantity, phase) of a name that is little more than a mark, whose unit says the quantity:
    where it has none, two phases or ground say a voltage. None for any other name.
    """
    phase = next((PHASES[word] for word in words if PHASES.get(word, "0")[0] in "abc"), "")
    more = set(words) - PHASES.keys() - ANGLE - {"mag", "rms"}
    if not phase or (more and not kind):
        return None
    if kind in BY_UNIT:
        return BY_UNIT[kind], phase
    if kind in ("", "angle") and (ground or len(phase) == 2):
        return "U", phase
    return None


def _words(name: str) -> list[str]:
    """The words of a name, in lower case, without numbers of buses and the like."""
    text = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", name)
    text = re.sub(r"[^\w]+|_", " ", text.lower().replace("d/dt", "dt").replace("df/dt", "dfdt"))
    text = re.sub(r"\b(bus|busbar|node|feeder|gen|substation|to|ckt)\s+\d+\b", " ", text)
    text = re.sub(r"\b\d{3,}\b", " ", text)
    return text.split()


def _compound(words: Sequence[str]) -> tuple[str, str] | None:
    """Quantity and phase of a word such as ua, vl1, i_b, V1; None where there is none."""
    for word, after in itertools.pairwise([*words, ""]):
        if match := COMPOUND.fullmatch(word):
            return "U" if match[1] == "v" else match[1].upper(), PHASES[match[2]]
        if (key := WORDS.get(word, "")) in ELECTRICAL and after in PHASES:
            return key, PHASES[after]
    return None


def _match_words(words: Sequence[str], ground: bool) -> tuple[str, str] | None:
    """Quantity and phase of words such as "active power", "phase A voltage", "正序电压"; None
    where they say no quantity.
    """
    quantity = _match_quantity(words)
    if quantity in ("U", "I"):
        return quantity, _match_phase(words, ground)
    return (quantity, "") if quantity else None


def _match_quantity(words: Sequence[str]) -> str:
    """The quantity that words say, "" for none; "reactive" and a rate go before all others."""
    for word in ("dfdt", "rocof", "reactive", *words):
        if word in words and word in WORDS:
            return WORDS[word]
    text = " ".join(words)  # where no spaces part the words
    long = (word for word in WORDS if len(word) > 1 and not word.isascii())
    return next((WORDS[word] for word in long if word in text), "")


def _match_phase(words: Sequence[str], ground: bool) -> str:
    """The phase or sequence that words say, "" for none; a letter by itself only where `ground`
    or something else says that it is one.
    """
    sure = ground or _is_letter_a_phase(words)
    for word in words:
        if word in PHASES and (sure or len(word) > 1 or not word.isascii()):
            return PHASES[word]
    text = " ".join(words)
    if "正序" in text:
        return "1"
    return "2" if "负序" in text else ""


def _is_letter_a_phase(words: Sequence[str]) -> bool:
    """Whether a letter among words is a phase: beside "phase", or as the one word before the
    quantity.
    """
    return "phase" in words or (len(words) == 2 and WORDS.get(words[1]) in ELECTRICAL)
