"""Quantities and phases by the words of a column's name, in several languages."""

import itertools
import re
from collections.abc import Mapping, Sequence


def map_words(words: Mapping[str, str]) -> dict[str, str]:
    """{word: what it stands for}, of {what: its words, parted by spaces}."""
    return {word: what for what, several in words.items() for word in several.split()}


# {word: quantity}; longer ones match within a name too, in scripts that do not part words
WORDS: Mapping[str, str] = map_words(
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
PHASES: Mapping[str, str] = map_words(
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
# {word of a column that holds the fractions of the seconds in another: their unit, "" where their
# size tells it}
FRACTIONS: Mapping[str, str] = map_words(
    {
        "": "fracsec frac fraction fractions fractional subsecond subseconds",
        "ms": "ms msec millis millisec millisecond milliseconds 毫秒",
        "us": "usec micros microsec microsecond microseconds 微秒",
        "ns": "nsec nanosecond nanoseconds 纳秒",
    }
)
ANGLE = frozenset(("angle", "ang", "winkel", "arg", "phi", "theta", "угол", "相角", "角度", "deg"))
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
BY_UNIT: Mapping[str, str] = {"voltage": "U", "current": "I", "power": "P", "reactive": "Q"}
ELECTRICAL = frozenset(BY_UNIT.values())


def find_quantity(words: Sequence[str], ground: bool = False) -> tuple[str, str] | None:
    """(quantity, phase) that words say; None where they say none. A letter by itself is a phase
    where `ground` is said.
    """
    return _split_compound(words) or _match_words(words, ground)


def find_marked_quantity(
    words: Sequence[str], kind: str, ground: bool, electrical: bool
) -> tuple[str, str] | None:
    """(quantity, phase) that words say, marks of phases among them; None where they say none."""
    said = find_quantity(words, ground)
    if said and (said[0] in ELECTRICAL or not electrical):
        return said
    return match_mark(words, kind, ground) or said


def match_mark(words: Sequence[str], kind: str, ground: bool) -> tuple[str, str] | None:
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


def split_words(name: str) -> list[str]:
    """The words of a name, in lower case, without numbers of buses and the like."""
    text = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", " ", name)
    text = re.sub(r"[^\w]+|_", " ", text.lower().replace("d/dt", "dt").replace("df/dt", "dfdt"))
    text = re.sub(r"\b(bus|busbar|node|feeder|gen|substation|to|ckt)\s+\d+\b", " ", text)
    text = re.sub(r"\b\d{3,}\b", " ", text)
    return text.split()


def _split_compound(words: Sequence[str]) -> tuple[str, str] | None:
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
