"""Errors for users: a sentence that says what, where, the value, what is allowed and how to mend
it; and a stop.
"""

import difflib
import math
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

LEAST_LIKENESS = 0.5  # of a name that an error proposes

_spelling: ContextVar[Callable[[str], str]] = ContextVar("spelling", default=str)


def name_setting(key: str) -> str:
    """A key of the configuration, "model.bounds.C", as the user writes it: in Python the argument,
    "bounds.C".
    """
    return _spelling.get()(key)


@contextmanager
def name_settings_as(call: str, arguments: Callable[[], Collection[str]]) -> Iterator[None]:
    """Within it, keys of task, model and data that are among the arguments of a call are spelled as
    those.

    The events to fit, `data.train`, are the argument `records` of a call that has it, and
    `task=NAME` is the call.
    """
    outer = _spelling.get()

    def spell_key(key: str) -> str:
        if key == f"task={call}":
            return f"{call}()"
        section, _, rest = key.partition(".")
        names = arguments() if section in ("task", "model", "data") else ()
        rest = "records" if key == "data.train" and "records" in names else rest
        return rest if rest.partition(".")[0] in names else outer(key)

    token = _spelling.set(spell_key)
    try:
        yield
    finally:
        _spelling.reset(token)


@dataclass(frozen=True)
class Section:
    """A section of the configuration, to name its settings in sentences: `{DATA.units}` is
    `setting("data.units")`.
    """

    name: str

    def __getattr__(self, key: str) -> str:
        """The setting of that name in this section, as the user writes it."""
        if key.startswith("_"):
            raise AttributeError(key)
        return name_setting(f"{self.name}.{key}")


DATA, MODEL, TASK = Section("data"), Section("model"), Section("task")


class UserError(Exception):
    """Wrong input. The message is a complete sentence for the user; no traceback is shown."""


class RefusedEffect(UserError):
    """An effect does not fit a model, and why."""

    def __init__(self, effect: str, reason: str):
        """An effect, and why it cannot be added, as the end of a sentence."""
        super().__init__(f"the effect '{effect}' cannot be added to this model: {reason}")
        self.effect, self.reason = effect, reason


class Unfit(UserError):
    """Why an effect makes no sense for a model: what it asks for is not there. Raised by what it
    asks `eq` for.
    """


class Stopped(KeyboardInterrupt):
    """The user or the system ends what runs. `code` is the exit code, `result` the result so far,
    or None.

    `state` is that of the search loop at its end, or None.
    """

    def __init__(self, message: str = "", code: int = 130, state: Any = None, result: Any = None):
        """An end with its exit code, what the search had reached and the result so far."""
        super().__init__(message)
        self.code, self.state, self.result = code, state, result

    @classmethod
    def from_interrupt(cls, stop: KeyboardInterrupt, **more: Any) -> "Stopped":
        """The end of an interrupted command, with more of its fields."""
        fields = {name: getattr(stop, name, None) for name in ("state", "result")}
        return cls(str(stop), getattr(stop, "code", 130), **{**fields, **more})


class Unknown(UserError, AttributeError):
    """A plugin reads or assigns a word that the equations do not offer."""


def suggest_nearest(name: str, allowed: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for the closest allowed name, or "" when nothing is close.

    Names are compared letter by letter, and with their words in order.

    Examples
    --------
    >>> suggest_nearest("torque_of_load", ["load_torque", "motor_voltage"])
    "; did you mean 'load_torque'?"
    >>> suggest_nearest("weather", ["load_torque"])
    ''
    """
    ratios = {other: _measure_likeness(str(name), other) for other in allowed}
    closest = max(ratios, key=lambda other: (ratios[other], other), default="")
    return f"; did you mean '{closest}'?" if ratios.get(closest, 0.0) >= LEAST_LIKENESS else ""


def _measure_likeness(name: str, other: str) -> float:
    """Return how alike two names are, from 0 to 1, letter by letter or with their words in order.

    `torque_of_load` is `load_torque` by its words, and like `motor_voltage` by its letters only.
    """
    pairs = ((name, other), (_sort_words(name), _sort_words(other)))
    return max(difflib.SequenceMatcher(None, one, two).ratio() for one, two in pairs)


def _sort_words(name: str) -> str:
    """A name with its words in alphabetical order."""
    return "_".join(sorted(name.split("_")))


def list_allowed(name: object, allowed: Iterable[str], label: str = "Available") -> str:
    """The end of a sentence about an unknown name: the nearest one, and all there are.

    Examples
    --------
    >>> list_allowed("zipp", ["zip", "none"], "Loads")
    "; did you mean 'zip'? Loads: none, zip"
    """
    allowed = sorted(map(str, allowed))
    return f"{suggest_nearest(str(name), allowed) or '.'} {label}: {', '.join(allowed) or 'none'}"


def check_choice(where: str, value: object, allowed: Iterable[object]) -> None:
    """Raise `UserError` unless a value is one of those allowed.

    Parameters
    ----------
    where : str
        The setting's full key.
    value : object
        What was given.
    allowed : iterable
        What may be given.

    Examples
    --------
    >>> check_choice("optimizer.space", "unit", ("unit", "raw"))
    >>> check_choice("optimizer.space", "row", ("unit", "raw"))
    Traceback (most recent call last):
    tractexp.errors.UserError: optimizer.space=row is not one of unit, raw; did you mean 'raw'?
    """
    allowed = tuple(allowed)
    if value not in allowed:
        names = tuple(map(str, allowed))
        text = " ".join(str(value).split())
        meant = suggest_nearest(str(value), names)
        raise UserError(f"{name_setting(where)}={text} is not one of {', '.join(names)}{meant}")


def check_distinct(where: str, values: Iterable[object]) -> None:
    """Raise `UserError` for no values, or for one that is there twice.

    Parameters
    ----------
    where : str
        The setting's full key.
    values : iterable
        What was given.
    """
    values = list(values)
    if not values:
        raise UserError(f"{name_setting(where)} is empty; give at least one")
    for value in values:
        if values.count(value) > 1:
            raise UserError(f"{name_setting(where)} names {value} twice; name each once")


def check_range(
    where: str, value: float | None, low: float = float("-inf"), high: float = float("inf")
) -> None:
    """Raise `UserError` unless a number is within a range and finite.

    Parameters
    ----------
    where : str
        The setting's full key.
    value : float or None
        None is never refused.
    low, high : float
        Least and greatest value allowed.

    Examples
    --------
    >>> check_range("task.depth", 0.5, 0.0, 1.0)
    >>> check_range("task.depth", None, 0.0, 1.0)
    """
    if value is not None and (not low <= value <= high or math.isinf(value)):
        limits = []
        if low > float("-inf"):
            limits.append(f"at least {low:g}")
        if high < float("inf"):
            limits.append(f"at most {high:g}")
        raise UserError(
            f"{name_setting(where)}={value} is out of range: it must be"
            f" {' and '.join(limits) or 'finite'}"
        )
