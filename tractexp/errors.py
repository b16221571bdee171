"""Errors for users: a sentence that says what, where, the value, what is allowed and how to mend it; and a stop."""

import difflib
import math
from collections.abc import Iterable
from typing import Any


class UserError(Exception):
    """Wrong input. The message is a complete sentence for the user; no traceback is shown."""


class Unfit(UserError):
    """Why an effect makes no sense for a model: what it asks for is not there. Raised by what it asks `eq` for."""


class Stopped(KeyboardInterrupt):
    """The user or the system ends what runs. `code` is the exit code, `result` the result so far, or None.

    `state` is that of the search loop at its end, or None.
    """

    def __init__(self, message: str = "", code: int = 130, state: Any = None, result: Any = None):
        super().__init__(message)
        self.code, self.state, self.result = code, state, result

    @classmethod
    def of(cls, stop: KeyboardInterrupt, **more: Any) -> "Stopped":
        """The same end with more of its fields."""
        fields = {name: getattr(stop, name, None) for name in ("state", "result")}
        return cls(str(stop), getattr(stop, "code", 130), **{**fields, **more})


class Unknown(UserError, AttributeError):
    """A plugin reads or assigns a word that the equations do not offer."""


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for the closest allowed name, or "" when nothing is close."""
    close = difflib.get_close_matches(str(name), list(allowed), n=1, cutoff=0.5)
    return f"; did you mean '{close[0]}'?" if close else ""


def among(name: object, allowed: Iterable[str], label: str = "Available") -> str:
    """The end of a sentence about an unknown name: the nearest one, and all there are."""
    allowed = sorted(map(str, allowed))
    return f"{nearest(str(name), allowed) or '.'} {label}: {', '.join(allowed) or 'none'}"


def check_choice(where: str, value: object, allowed: Iterable[object]) -> None:
    """Raise `UserError` unless `value` is one of `allowed`; `where` is the setting's full key."""
    allowed = tuple(allowed)
    if value not in allowed:
        names = tuple(map(str, allowed))
        raise UserError(
            f"{where}={' '.join(str(value).split())} is not one of {', '.join(names)}{nearest(str(value), names)}"
        )


def check_distinct(where: str, values: Iterable[object]) -> None:
    """Raise `UserError` for no values, or for one that is there twice; `where` is the setting's full key."""
    values = list(values)
    if not values:
        raise UserError(f"{where} is empty; give at least one")
    for value in values:
        if values.count(value) > 1:
            raise UserError(f"{where} names {value} twice; name each once")


def check_range(where: str, value: float, low: float = float("-inf"), high: float = float("inf")) -> None:
    """Raise `UserError` unless low <= value <= high and it is finite; `where` is the setting's full key."""
    if not low <= value <= high or math.isinf(value):
        limits = [f"at least {low:g}"] * (low > float("-inf")) + [f"at most {high:g}"] * (high < float("inf"))
        raise UserError(f"{where}={value} is out of range: it must be {' and '.join(limits) or 'finite'}")
