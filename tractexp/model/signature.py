"""What a plugin's method asks for by the names of its arguments, checked when the plugin is
registered.
"""

import inspect
from collections.abc import Sequence
from typing import Any

from tractexp.errors import UserError, among
from tractexp.plugin import Plugin

NAMED = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


def check_signature(
    cls: type[Plugin],
    method: str,
    first: str | None,
    where: str,
    offered: Sequence[str] = (),
    all_taken: bool = True,
) -> None:
    """Raise `UserError` unless the method takes `first`, then names of own parameters and of what
    is `offered`.

    `all_taken`: it must take every parameter of its own; `**name` takes all the rest.
    """
    arguments = list(inspect.signature(getattr(cls, method)).parameters.values())
    if not isinstance(inspect.getattr_static(cls, method), staticmethod):
        arguments = arguments[1:]
    own = [p.name for p in cls.parameters]
    if first is not None:
        if not arguments or arguments[0].kind not in NAMED or arguments[0].name in own:
            raise UserError(
                f"{where}: {method}() must take {first} first, then its parameters by name"
            )
        arguments = arguments[1:]
    for argument in arguments:
        if (
            argument.kind in NAMED
            and argument.name not in (*own, *offered)
            and argument.default is argument.empty
        ):
            raise UserError(
                f"{where}: {method}() asks for '{argument.name}', which is neither a parameter of"
                " it nor offered"
                f"{among(argument.name, (*own, *offered), 'It may ask for')}"
            )
        # the bases' own, which gets nothing
        if argument.kind is argument.VAR_POSITIONAL and argument.name != "_":
            raise UserError(
                f"{where}: {method}() gets its parameters by name, so it cannot take"
                f" *{argument.name}"
            )
    rest = any(a.kind is a.VAR_KEYWORD for a in arguments)
    taken = {a.name for a in arguments}
    if all_taken and not rest and (unused := [name for name in own if name not in taken]):
        raise UserError(
            f"{where}: {method}() does not take the parameter '{unused[0]}'; add it to its"
            " arguments, or drop it"
        )


def select_arguments(method: Any, given: dict[str, Any]) -> dict[str, Any]:
    """Those of `given` that a method asks for by name."""
    arguments = inspect.signature(method).parameters.values()
    if any(a.kind is a.VAR_KEYWORD for a in arguments):
        return given
    return {a.name: given[a.name] for a in arguments if a.name in given}
