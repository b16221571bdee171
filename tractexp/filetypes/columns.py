"""The meaning of column names: quantity, phase, unit.

t Time [s] Zeit in ms 时间 U Voltage (kV) Va UA(kV) V1 m:u1:bus in p.u. P [MW] Active power
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from tractexp.filetypes.column_unit import find_unit_quantity
from tractexp.filetypes.column_words import (
    ANGLE,
    BY_UNIT,
    ELECTRICAL,
    FRACTIONS,
    GROUND,
    LINE,
    WORDS,
    find_marked_quantity,
    find_quantity,
    split_words,
)
from tractexp.recording.phase_mark import ORDERS, normalize, spell_marks

# line voltages that are the opposite of those of `data.columns`
BACKWARD = {"ba": "ab", "cb": "bc", "ac": "ca"}
PHASE_KEYS = ("a", "b", "c", "ab", "bc", "ca")
TABLE_ORDERS = (*ORDERS, "UVW")  # the last: UV is the voltage of phase V


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
    roles = filter(None, (find_role(name, unit, order) for name, unit in named))
    marked = [one for one in roles if one.key.removesuffix("_angle")[1:] in PHASE_KEYS]
    keys = {one.key.removesuffix("_angle") for one in marked}
    counts = Counter((key[0], len(key)) for key in keys)
    most = max((n for (_, length), n in counts.items() if 3 in (length, n)), default=0)
    return max(most, len({one.key for one in marked if one.line is False}))


def find_role(name: str, unit: str = "", order: str = ORDERS[0]) -> Role | None:
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
    >>> find_role("active power", "MW").key
    'P'
    """
    words = split_words(name)
    kind = find_unit_quantity(unit)
    electrical = kind in (*BY_UNIT, "angle") or not ELECTRICAL.isdisjoint(map(WORDS.get, words))
    if unmarked := _find_fraction(words, unit) or _find_other_role(words, unit, electrical):
        return unmarked
    spelled, ground = spell_marks(name, order)
    if spelled != normalize(name):
        words = split_words(spelled)
    said = find_marked_quantity(words, kind, ground, electrical)
    if said is None:
        return None
    key, phase = said
    if (key, kind) in (("U", "current"), ("I", "voltage")):  # "Voltage (A)": a phase, no unit
        return find_role(f"{name} {unit}", order=order)
    whole = BACKWARD.get(phase, phase)
    backward = phase in BACKWARD
    if key in ("U", "I") and _is_angle(words, kind):
        return Role(f"{key}{whole}_angle", unit, backward=backward)
    if key == "U":
        return Role(key + whole, unit, _is_between_lines(words, phase, ground), backward)
    return Role(key + whole, unit)


def _find_fraction(words: Sequence[str], unit: str) -> Role | None:
    """The role of a column of fractions of a second; None for any other."""
    for word in words:
        if word in FRACTIONS and (len(words) == 1 or not FRACTIONS[word]):
            return Role("frac", unit or FRACTIONS[word])
    return None


def _find_other_role(words: Sequence[str], unit: str, electrical: bool) -> Role | None:
    """The role of a column of time, frequency and the like; None for any other."""
    said = None if electrical else find_quantity(words)
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
