"""Which files are of one event: one a phase, voltages and currents apart; by their names, and by
when they were sampled.

Files of one event are aligned by the moments that they state, else by equal rate and length.
"""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError, check_distinct, name_setting
from tractexp.recording.phase_mark import normalize, spell_marks
from tractexp.recording.record_files import find_packed
from tractexp.storage import files
from tractexp.text.quoting import shell
from tractexp.text.wording import join_words, list_first

MOST_FILES = 24  # of one event
NAMED_FILES = 5  # of an archive that are told
LARGEST_CLOCK_DIFFERENCE = 1e-3  # of rates that are the same by another clock
FEWEST_COMMON = 10  # samples that all files have
SAME_INSTANT = 0.01  # of a step, within which two samples are of one instant
PART = re.compile(r"[^\W_]+")
QUANTITY = re.compile(
    r"[uvipq]|f|freq\w*|volt\w*|curr\w*|amps?|spann\w*|str[oö]me?|tens\w*|corr\w*|courants?"
    r"|power|напр\w*|ток\w*|电压|电流|\w*(?:ch|chan|channel|analog)\d{1,2}"
)
PHASE = re.compile(r"(?:phase )?[uvi]? ?(?:a|b|c|ab|bc|ca|l[123]|l1 ?l2|l2 ?l3|l3 ?l1)")
ORDERS = ("abc", "rst", "uvw", "ryb", "rwb")  # of phases in files' names, beside L1, L2, L3


def tell_apart(paths: Sequence[str]) -> list[str]:
    """The part of each file's name that the others' have not, the names of their folders included.

    Examples
    --------
    >>> tell_apart(["bay/ev_L1.csv", "bay/ev_L2.csv"])
    ['L1', 'L2']
    """
    names = [Path(path).with_suffix("").parts for path in paths]
    common = 0
    while all(len(n) > common + 1 and n[: common + 1] == names[0][: common + 1] for n in names):
        common += 1
    parts = [PART.findall(" ".join(name[common:])) for name in names]
    shared = set(parts[0]).intersection(*parts)
    return [" ".join(word for word in part if word not in shared) for part in parts]


def name_one_event(paths: Sequence[str]) -> bool:
    """Whether names say that files are of one event: they differ in a phase alone, or in what is
    measured.
    """
    told = [normalize(one) for one in tell_apart(paths)]
    known = all(_names_phase(one) or QUANTITY.fullmatch(one) for one in told)
    return 1 < len(paths) <= MOST_FILES and known and len(set(told)) == len(told)


def _names_phase(told: str) -> bool:
    """Whether a plain name is that of a phase, of two, or of a quantity of one: a, L1, UAB."""
    if not told or told.isdigit():
        return False
    spelled = (spell_marks(told, order)[0].split() for order in ORDERS)
    return any(PHASE.fullmatch(" ".join(words)) for words in spelled)


def event_paths(path: str, join: Sequence[str], wanted: Sequence[str]) -> list[str]:
    """The files that `data.path` and `data.join` name: of a .zip the record in it, or those of one
    event.

    `wanted` are the endings that the reader takes. Raises `UserError` for a .zip without
    any, or with several.
    """
    if not files.is_archive(path):
        return [path, *join]
    inside = [str(p) for p in find_packed(Path(path)) if p.suffix.lower() in wanted]
    if len(inside) > 1 and not name_one_event(inside):
        raise UserError(say_several(path, inside))
    if not inside:
        raise UserError(f"{path} holds no file that ends in {join_words(wanted, 'or')}")
    return [*inside, *join]


def check_joined(where: str, paths: Sequence[Any], endings: Collection[str]) -> None:
    """Raise `UserError` for files of one event that are no texts, twice there, or of another kind
    than one reader reads.
    """
    check_distinct(where, [*map(str, paths)])
    if len(paths) == 1:
        return  # its reader says what is wrong with one file alone
    for path in paths:
        ending = Path(str(path)).suffix.lower()
        if ending not in endings and not files.is_called_archive(str(path)):
            raise UserError(
                f"{name_setting(where)}: {path} is of another kind than {paths[0]}: one reader"
                f" reads all files of an event, here those ending in"
                f" {join_words(sorted(endings), 'or')};"
                " export them alike"
            )


def say_several(archive: str, inside: Sequence[str]) -> str:
    """That an archive holds several records, and how to name one of them."""
    listed = list_first([Path(one).relative_to(archive).as_posix() for one in inside], NAMED_FILES)
    return (
        f"{archive} holds {len(inside)} records, {listed}: name one,"
        f" {shell('tractexp', 'look', inside[0])}, or make a table of all,"
        f" {shell('tractexp', 'task=survey', f'data.path={archive}')}"
    )


@dataclass(frozen=True)
class SampledFile:
    """When the samples of a file were taken."""

    source: str
    rate: float  # Hz
    count: int
    first: float = 0.0  # time of its first sample as the file counts it [s]
    begun: datetime | None = None  # the moment of its first sample


@dataclass(frozen=True)
class Alignment:
    """The samples that files have in common: from `first[k]` on in file k, `count` of them, each
    `late[k]` steps before the instant that is meant.
    """

    first: Sequence[int]
    late: Sequence[float]
    count: int
    notes: tuple[str, ...]


def align(sampled: Sequence[SampledFile]) -> Alignment:
    """Where files of one event have the same instants. Raises `UserError` for other rates, and for
    times that do not overlap.
    """
    one, *others = sampled
    for other in others:
        drift = abs(other.rate / one.rate - 1)
        if drift > LARGEST_CLOCK_DIFFERENCE or drift * min(one.count, other.count) > 1:
            raise UserError(
                f"{one.source} has {one.rate:g} samples a second and {other.source} {other.rate:g}:"
                " files of one event are joined at one rate; resample one of them, or read each by"
                " itself"
            )
    moments = [each.begun for each in sampled]
    if all(moments):
        return _align_moments(sampled)
    for other in others:
        shifted = abs(other.first - one.first) * one.rate > 0.5
        if other.count != one.count or shifted:
            raise UserError(
                f"{one.source} begins at {one.first:g} s with {one.count} samples and"
                f" {other.source} at {other.first:g} s with {other.count}, and not all of them say"
                " at which date and time: files of one event are joined by that, or where they have"
                " the same times; cut them to the same samples"
            )
    named = name_files(each.source for each in sampled)
    said = f"{named} are joined sample by sample: equal rates, lengths and times"
    return Alignment([0] * len(sampled), [0.0] * len(sampled), one.count, (said,))


def name_files(sources: Iterable[str]) -> str:
    """The names of files, without their folders, as a sentence lists them."""
    return join_words([Path(source).name for source in sources])


def _align_moments(sampled: Sequence[SampledFile]) -> Alignment:
    """By the clocks of the files; the first file's samples are the instants that are meant."""
    one = sampled[0]
    shifts = [_measure_delay(one, each) * one.rate for each in sampled]
    ends = [shift + each.count for shift, each in zip(shifts, sampled, strict=True)]
    begin = int(np.ceil(max(shifts) - SAME_INSTANT))
    count = int(np.floor(min(ends) - begin + SAME_INSTANT))
    if count < FEWEST_COMMON:
        last, first = sampled[int(np.argmax(shifts))], sampled[int(np.argmin(ends))]
        end = first.begun and first.begun + timedelta(seconds=first.count / first.rate)
        raise UserError(
            f"{first.source} ends at {end} and {last.source} begins at {last.begun}: files of one"
            " event overlap in time; name others, or correct the clock that is wrong"
        )
    places = [begin - shift for shift in shifts]
    last = np.array([each.count for each in sampled]) - count
    firsts = np.clip(np.rint(places), 0, last).astype(int).tolist()
    late = np.subtract(places, firsts).tolist()
    named = name_files(each.source for each in sampled)
    said = [f"{named} are joined by their clocks, at the samples of {Path(one.source).name}"]
    if any(abs(shift) > SAME_INSTANT for shift in shifts):
        said.append(
            f"they begin up to {1e3 * (max(shifts) - min(shifts)) / one.rate:.4g} ms apart; clocks"
            " that differ by 1 ms turn currents by 18 degrees of 50 Hz against voltages"
        )
    return Alignment(firsts, late, count, tuple(said))


def _measure_delay(one: SampledFile, other: SampledFile) -> float:
    """How much later a file begins than another [s]."""
    assert one.begun is not None
    assert other.begun is not None
    return (other.begun - one.begun).total_seconds()


def move_samples(values: np.ndarray, first: int, count: int, late: float) -> np.ndarray:
    """Values at instants that lie between the samples, by cubic splines.

    Parameters
    ----------
    values : (N,)
        At even times; nan stays where it is.
    first, count : int
        Sample to begin with, and how many are wanted.
    late : float
        Steps by which the instants lie after the samples.

    Returns
    -------
    (count,) array

    Examples
    --------
    >>> move_samples(np.arange(6.0) ** 3, 1, 2, 0.5).round(9).tolist()
    [3.375, 15.625]
    """
    if abs(late) <= SAME_INSTANT:
        return values[first : first + count]
    from scipy.interpolate import CubicSpline

    numbers, there = np.arange(len(values)), np.isfinite(values)
    if there.sum() < 4:
        return values[first : first + count]
    moved = CubicSpline(numbers[there], values[there])(first + late + np.arange(count))
    moved[~there[first : first + count]] = np.nan
    return moved
