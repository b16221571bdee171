"""Numbers as a person reads them: the one format of probabilities and errors on pages and the
console.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

LONGEST_SENTENCE = 230  # characters of a sentence on a screen: three lines
ELLIPSIS = " ..."
NEGLIGIBLE = 1e-6  # no model of the noise separates one in ten million from one in a billion
# alternatives that share a name, or figures: so many are told by what they have in common
FEWEST_GROUPED = 3
MOST_DIGITS = 7  # after the point: smaller errors are written with powers of ten


# what moves a cursor, recolors a terminal or turns the direction of what follows, and halves of
# characters
UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def escape_text(text: object) -> str:
    """A text of others, such as a channel's name, as a terminal may print it.

    Control characters stand as escapes; line breaks stay.

    Examples
    --------
    >>> escape_text("bus" + chr(27) + "[31m").isprintable()
    True
    """
    return UNSEEN.sub(lambda match: match[0].encode("unicode_escape").decode(), str(text))


def write_on_one_line(text: object) -> str:
    """The text by `escape_text` in one line: a line break would be a line of somebody else's."""
    return escape_text(text).replace("\n", "\\n")


def format_probability(p: float) -> str:
    """A probability for a sentence or a cell.

    Examples
    --------
    >>> format_probability(0.4543), format_probability(0.00012), format_probability(1e-9)
    ('0.45', '0.00012', 'less than one in a million')
    """
    if p < NEGLIGIBLE:
        return "less than one in a million"
    return f"{p:.2g}" if p >= 1e-4 else _shorten_powers(p, 2)


def format_with_error(value: float, error: float) -> str:
    """A value to the digits that its standard error leaves.

    Examples
    --------
    >>> format_with_error(0.0220163, 7.78e-5)
    '0.022016 ± 0.000078'
    >>> format_with_error(0.25, float("nan"))
    '0.25'
    """
    if not (math.isfinite(error) and error > 0):
        return f"{value:.4g}"
    digits = 1 - math.floor(math.log10(error))
    if 0 <= digits <= MOST_DIGITS:
        return f"{value:.{digits}f} ± {error:.{digits}f}"
    return f"{_shorten_powers(value, 4)} ± {_shorten_powers(error, 2)}"


def format_share(share: float) -> str:
    """A share of a whole that is itself estimated, in percent: never below none or above all of it.

    Examples
    --------
    >>> format_share(0.234), format_share(1.08)
    ('23%', '100%')
    """
    return f"{min(max(share, 0.0), 1.0):.0%}"


def format_epsilon(error: float | None) -> str:
    """A relative error of Eq. (20) in percent; "undefined" for a record without that power.

    Examples
    --------
    >>> format_epsilon(0.0123), format_epsilon(None)
    ('1.230%', 'undefined')
    """
    return "undefined" if error is None or not math.isfinite(error) else f"{error:.3%}"


def join_words(names: Sequence[str], last: str = "and") -> str:
    """Names as a sentence lists them.

    Examples
    --------
    >>> join_words(["P"]), join_words(["P", "Q"]), join_words(["U", "P", "Q"], "or")
    ('P', 'P and Q', 'U, P or Q')
    """
    return f" {last} ".join(part for part in (", ".join(names[:-1]), *names[-1:]) if part)


def list_first(names: Sequence[str], most: int) -> str:
    """The first of some names, and how many more there are.

    Examples
    --------
    >>> list_first(["a", "b", "c", "d"], 2)
    'a, b and 2 more'
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def join_alternatives(sets: Sequence[Sequence[str]]) -> str:
    """Sets of names as alternatives.

    Several that share a name are told by that name and what may stand beside it.

    Examples
    --------
    >>> join_alternatives([["lag"], ["trip", "stall"]])
    'lag or trip and stall'
    >>> join_alternatives([["lag", "b"], ["lag", "c"], ["lag", "d"]])
    'lag beside one more effect (b, c or d)'
    """
    if not sets:
        return ""
    common = Counter(itertools.chain(*sets)).most_common(1)[0][0]
    beside = []
    others = []
    for names in sets:
        rest = [name for name in names if name != common]
        if rest and len(rest) < len(names):
            beside.append(join_words(rest))
        else:
            others.append(join_words(names))
    if len(beside) < FEWEST_GROUPED:
        return join_words(list(map(join_words, sets)), "or")
    shared = f"{common} beside one more effect ({join_words(beside, 'or')})"
    return join_words([shared, *others], "or")


def list_figures(values: Sequence[float], shown: Callable[[float], str]) -> str:
    """Figures as a sentence lists them; of more than three the smallest and the largest.

    Examples
    --------
    >>> list_figures([1.0, 2.0, 3.0, 4.0], str)
    '1.0 to 4.0'
    """
    if len(values) > FEWEST_GROUPED:
        return f"{shown(min(values))} to {shown(max(values))}"
    return join_words([shown(value) for value in values])


def finish_sentence(text: str) -> str:
    """A clause as a sentence of its own.

    It begins with a capital, unless with a parameter's name, and ends with a full stop.

    Examples
    --------
    >>> finish_sentence("the motor stalls"), finish_sentence("T_m is at its bound")
    ('The motor stalls.', 'T_m is at its bound.')
    """
    return f"{text if '_' in text.split(' ')[0] else text[:1].upper() + text[1:]}."


def _shorten_powers(value: float, digits: int) -> str:
    """'2.6e-5' where Python says '2.6e-05'."""
    return f"{value:.{digits}g}".replace("e-0", "e-").replace("e+0", "e")


def format_figure(value: float | None, digits: int = 4, unit: str = "") -> str:
    """A number with so many significant digits and its unit; "" where there is none.

    Examples
    --------
    >>> format_figure(0.123456, 3, "pu"), format_figure(None)
    ('0.123 pu', '')
    """
    return "" if value is None or value != value else f"{value:.{digits}g}{unit and ' '}{unit}"


def change(before: float | None, after: float | None) -> str:
    """A number before and after; a question mark where one is missing.

    Examples
    --------
    >>> change(1.0, None)
    '1 to ?'
    """
    return f"{format_figure(before) or '?'} to {format_figure(after) or '?'}"


def write_quantity(symbol: str, value: float, unit: str) -> str:
    """A voltage or power with its unit; one in per unit with its symbol, for pu does not tell of
    what it is.

    Examples
    --------
    >>> write_quantity("P", 12.0, "MW"), write_quantity("P", 0.8, "pu")
    ('12 MW', 'P 0.8 pu')
    """
    text = f"{value:.4g} {unit}"
    return f"{symbol} {text}" if unit == "pu" else text


def count_noun(number: int, noun: str) -> str:
    """A number with its noun.

    Examples
    --------
    >>> count_noun(1, "dip"), count_noun(3, "dip")
    ('1 dip', '3 dips')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def share(value: float | None) -> str:
    """A share in percent; "" where there is none."""
    return "" if value is None else f"{value:.1%}"


def format_degrees(value: float | None) -> str:
    """An angle to a tenth of a degree, without a minus before zero; "" where there is none."""
    return "" if value is None else f"{round(value, 1) + 0.0:.1f}"


def describe_shown_effects(shown: Mapping[str, str]) -> str:
    """Which effects are in a model because the records show them, in a sentence."""
    return (
        "in the model because the record shows it:"
        f" {'; '.join(f'{name} ({how})' for name, how in shown.items())}"
    )


def shorten_path(path: Path) -> Path:
    """A path as a user types it: from the working folder, where it is below that."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def shorten(sentence: str, longest: int = LONGEST_SENTENCE) -> str:
    """As many clauses of a sentence as there is room for, or words; an ellipsis says that there are
    more.

    Examples
    --------
    >>> shorten("the motor stalls, and the load does not return", 25)
    'the motor stalls ...'
    """
    if len(sentence) <= longest:
        return sentence
    room = longest - len(ELLIPSIS)
    cut = sentence[: room + 1]
    clause = max(cut.rfind("; "), cut.rfind(", "))
    at = clause if clause > longest // 2 else cut.rfind(" ")
    return f"{sentence[: at if at > 0 else room].rstrip(',; ')}{ELLIPSIS}"
