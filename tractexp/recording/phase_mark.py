"""The marks of phases in names, one vocabulary for tables, phasors and channels: a phase, two
phases, ground.

A, B, C L1, L2, L3 R, S, T R, Y, B R, W, B U, V, W AB L1-L2 U_L1_L2 Ua-Ub V_R-Y V12 YB AN L1N A-G
1-PE фаза А A相 fase R LL, line to line LN, phase to ground
"""

import functools
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass, replace

# letters that stand for the phases, in their order
ORDERS = ("abc", "rst", "uvw", "123", "ryb", "rwb")
DIGITS = "123"
# letters that look like Latin ones, as phases are often typed
CYRILLIC = str.maketrans("авсеіо", "abceio")
LATIN = {latin: other for other, latin in CYRILLIC.items()}
MOST_KNOWN_NAMES = 8192  # whose reading is kept: each load of a file asks for it again
QUANTITY = "uvie"  # letters before a phase's: U, V, E of a voltage, I of a current
GROUND = r"n|g|e|pe|gnd|neutral|ground|earth|neutro|tierra|terre|erde"
ONE_OR_TWO_MARKS = "(?:[abcrstuvwy]{1,2}|l?[123]{1,2})"
START_OR_LETTER = "(?:(?<![a-z])|(?<=(?<![a-z])[uv]))"  # of a word, or after a voltage's letter
SAID = (  # what is said in words, and the word that stands for it
    (r"^(?:phase[- ]?voltage|voltage[- ]phase|[uv][ _]?(?:phase|ф))$", "voltage ln"),
    (r"^[uv][ _]?(?:line|лин|л)$", "voltage ll"),
    (
        rf"(?<![a-z])([uv])[ _]?(ll|ln|lg)[ _]?(?={ONE_OR_TWO_MARKS}(?![a-z\d]))",
        r" \2 \1",
    ),  # VLLab, V_LN_A
    # PhV.phsA, PPV.phsAB of IEC 61850, V_PH_A
    (r"(?<![a-z])phv(?![a-z])", "voltage ln"),
    (r"(?<![a-z])ppv(?![a-z])", "voltage ll"),
    (r"(?<![a-z])phs?[ _.]?(?=[abc]{1,2}(?![a-z]))", "phase "),
    (
        rf"{START_OR_LETTER}(?:l|line|ph|phase)[- ]?(?:to[- ])?(?:l|line|ph|phase)(?![a-z\d])",
        " ll ",
    ),
    (
        rf"{START_OR_LETTER}(?:l|line|ph|phase)[- ]?(?:to[- ])?"
        r"(?:n|g|pe|e|neutral|ground|earth)(?![a-z\d])",
        " ln ",
    ),
    (r"(?<![a-z])to[- ](?:neutral|ground|earth)(?![a-z\d])", " ln "),
    (r"линейн\w*|междуфазн\w*|compuesta|compos[ée]e|verkettet\w*", " ll "),
    (r"фазн\w*|strang\w*|stern|(?<=tension )simple|(?<=tensión )simple", " ln "),
    ("線間電圧", " ll 電圧 "),
    ("相電圧", "相 ln 電圧 "),
    ("线电压", " ll 电压 "),
    ("相电压", "相 ln 电压 "),
)
VOLTAGE = "voltage|volt|volts|spannung|tension|tensión|voltaje"
PHASE = r"phasen?|phase|fase|фаза|фазы|фаз|相"
LETTER = "a-zа-яёà-öø-ÿ"
END = rf"(?=(?:rms|mag|ang|avg|max|min|m)?(?![{LETTER}\d]))"


@dataclass(frozen=True)
class PhaseMark:
    """One reading of a name: which phases (0, 1, 2) a mark stands for, one or two, and where it
    stands.
    """

    places: tuple[int, ...]
    begin: int
    end: int
    ground: bool = False  # said to be between the phase and ground

    @property
    def letters(self) -> str:
        """a, b, c of one phase, ab, bc, ca (or ba, cb, ac) of two."""
        return "".join("abc"[place] for place in self.places)


@functools.lru_cache(maxsize=MOST_KNOWN_NAMES)
def normalize(text: str) -> str:
    """A text in lower case, with full-width, Roman and look-alike Cyrillic letters as Latin ones.

    Examples
    --------
    >>> normalize(" ＵＡ ")
    'ua'
    """
    return unicodedata.normalize("NFKC", text).strip().lower().translate(CYRILLIC)


@functools.cache
def build_pair_pattern(letters: str) -> re.Pattern[str]:
    """Two different phases of one order as a name writes them: AB, A-B, L1-L2, L1L2, Ua-Ub, R/Y."""
    one, before = _build_beginning(letters)
    word = r"\d" if letters == DIGITS else "[a-z]"
    return re.compile(rf"{before}({one})(?:[-_/. ](?:[uve][_ ]?)?)?(l?)({one})(?!{word}(?![ng]))")


def _build_beginning(letters: str) -> tuple[str, str]:
    """(one letter of an order, what may stand before it) as patterns."""
    before = r"(?<!\d)" if letters == DIGITS else rf"(?:(?<![a-z])|(?<=[{QUANTITY}l]))"
    return f"[{letters}]", before


def find_pairs(text: str, letters: str) -> Iterator[PhaseMark]:
    """Each reading of two phases in a plain name; of two digits only where L, a quantity or a dash
    says so.
    """
    pattern = build_pair_pattern(letters)
    for match in filter(None, (pattern.match(text, at) for at in range(len(text)))):
        places = letters.index(match[1]), letters.index(match[3])
        if places[0] == places[1]:
            continue
        explicit = text[: match.start()].endswith("l") and bool(match[2])
        dashed = match[0][1:2] in ("-", "/") and not re.search(r"[a-z\d.]$", text[: match.start()])
        if letters != DIGITS or explicit or dashed or has_quantity_before(text, match.start()):
            yield PhaseMark(places, match.start(), match.end())


def has_quantity_before(text: str, at: int) -> bool:
    """Whether a quantity, by its letter but for an L or a line below, or by its name, comes right
    before the mark.
    """
    return bool(
        re.search(
            rf"(?<![a-z])(?:[{QUANTITY}][_ ]?l?|[uv](?:ll|rms)[_ ]?|{VOLTAGE}[_ ])$", text[:at]
        )
    )


def spell_marks(name: str, letters: str) -> tuple[str, bool]:
    """A name with the mark of its phases in plain letters.

    Parameters
    ----------
    name : str
        Of a channel.
    letters : str
        The order of phases of the table, in capitals where two letters side by side are no two
        phases (UU, UV, UW); L1, L2, L3 mean the same in any.

    Returns
    -------
    str
        The mark is a, b, c or ab, bc, ca.
    bool
        Whether the name says that it is to ground.
    """
    name = _say_phases_plainly(name, letters)
    text = name.translate(CYRILLIC)
    marks = (_find_mark(text, order) for order in (letters, DIGITS))
    mark = next((mark for mark in marks if mark is not None), None)
    if mark is None:
        return name, False
    begin = mark.begin
    has_line_letter = re.search(rf"(?:(?<![a-z])|(?<=(?<![a-z])[{QUANTITY}pq]))l$", text[:begin])
    if has_line_letter:  # the L of L1
        begin -= 1
    head = name[:begin]
    if re.search(r"(?<![a-z])e$", text[:begin]):  # E is a voltage
        head = f"{head[:-1]}u"
    glue = "" if head[-1:].isascii() else " "
    return f"{head}{glue}{mark.letters} {name[mark.end :]}", mark.ground


def _say_phases_plainly(name: str, letters: str) -> str:
    """A name in small letters, with "phase" where any language or standard says so before or after
    a mark.
    """
    name = unicodedata.normalize("NFKC", name).strip().lower()
    for pattern, word in SAID:
        name = re.sub(pattern, word, name)
    one = f"[{letters.lower()}{letters.lower().translate(LATIN)}123]"
    name = re.sub(rf"({PHASE})(?=[-_ ]?l?{one}(?![{LETTER}\d]))", " phase ", name)
    return re.sub(rf"(?<![a-z\d])(l?{one})\s*相", r" phase \1 ", name)


def _find_mark(text: str, letters: str) -> PhaseMark | None:
    """The part of a channel's name that says its phases; None where none does.

    Where U and V are phases, a first U or V may stand for the voltage: `U U-V` is between U and V.
    """
    quantity = (
        re.search(r"(?<![a-z])[uv][ _(]*(?=[a-z])", text) if letters.lower() == "uvw" else None
    )
    if quantity is not None:
        at = quantity.end()
        mark = _find_first_mark(text[at:], letters)
        if mark is not None and (letters.isupper() or mark.ground or len(mark.places) == 2):
            return replace(mark, begin=mark.begin + at, end=mark.end + at)
    return _find_first_mark(text, letters)


def _find_first_mark(text: str, letters: str) -> PhaseMark | None:
    """The mark of a name: two phases, else one to ground, else one that is no letter of a quantity
    by itself.
    """
    digits, alone, letters = letters == DIGITS, letters.isupper(), letters.lower()
    two = next((mark for mark in find_pairs(text, letters) if _can_end(text, mark.end)), None)
    two = None if alone and two is not None and two.end - two.begin == len("uv") else two
    if two is not None:
        return two
    start = (
        rf"(?:(?<![{LETTER}\d.])|(?<=(?<![a-z])[{QUANTITY}pql])"
        rf"|(?<=(?<![a-z])[{QUANTITY}pq]l)|(?<=rms))"
    )
    least = "l" if digits else ""  # "1 N" alone is no mark, "L1 N" and "U1N" are
    if match := re.search(
        rf"{start}l?([{letters}])(?:[-_/]?(?:{GROUND}|0)| (?:n|g|pe|gnd)){END}", text
    ):
        sure = not digits or not match[0].endswith("0")
        if sure and (
            not digits
            or least in text[: match.start() + 1]
            or has_quantity_before(text, match.start(1))
        ):
            return PhaseMark((letters.index(match[1]),), *match.span(), ground=True)
    if digits:
        return None
    if match := re.search(rf"{start}([{letters}]){END}", text):
        return PhaseMark((letters.index(match[1]),), *match.span())
    return None


def _can_end(text: str, at: int) -> bool:
    """Whether a mark ends at a place of a text."""
    return re.compile(END).match(text, at) is not None
