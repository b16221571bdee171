"""What a plugin's method asks for by the names of its arguments, checked when the plugin is
registered.
"""

import inspect
from collections.abc import Sequence
from typing import Any

from tractexp.configuration.plugin import Plugin
from tractexp.errors import UserError, list_allowed

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
    arguments = _list_arguments(cls, method)
    own = [p.name for p in cls.parameters]
    call = f"{where}: {method}()"
    if first is not None:
        if not arguments or arguments[0].kind not in NAMED or arguments[0].name in own:
            raise UserError(f"{call} must take {first} first, then its parameters by name")
        arguments = arguments[1:]
    for argument in arguments:
        _check_argument(argument, (*own, *offered), call)
    if all_taken:
        _check_all_taken(arguments, own, call)


def _list_arguments(cls: type[Plugin], method: str) -> list[inspect.Parameter]:
    """The arguments of a class's method, without `self`."""
    arguments = list(inspect.signature(getattr(cls, method)).parameters.values())
    if isinstance(inspect.getattr_static(cls, method), staticmethod):
        return arguments
    return arguments[1:]


def _check_argument(argument: inspect.Parameter, known: Sequence[str], call: str) -> None:
    """Raise `UserError` for an argument that nothing gives, or that takes values by position."""
    is_named = argument.kind in NAMED
    is_needed = argument.default is argument.empty
    if is_named and is_needed and argument.name not in known:
        raise UserError(
            f"{call} asks for '{argument.name}', which is neither a parameter of it nor"
            f" offered{list_allowed(argument.name, known, 'It may ask for')}"
        )
    # but for the bases' own, which gets nothing
    if argument.kind is argument.VAR_POSITIONAL and argument.name != "_":
        raise UserError(f"{call} gets its parameters by name, so it cannot take *{argument.name}")


def _check_all_taken(arguments: Sequence[inspect.Parameter], own: Sequence[str], call: str) -> None:
    """Raise `UserError` for a parameter of its own that a method does not take."""
    if any(a.kind is a.VAR_KEYWORD for a in arguments):
        return
    taken = {a.name for a in arguments}
    unused = [name for name in own if name not in taken]
    if unused:
        raise UserError(
            f"{call} does not take the parameter '{unused[0]}'; add it to its arguments, or drop it"
        )


def select_arguments(method: Any, given: dict[str, Any]) -> dict[str, Any]:
    """Those of `given` that a method asks for by name."""
    arguments = inspect.signature(method).parameters.values()
    if any(a.kind is a.VAR_KEYWORD for a in arguments):
        return given
    return {a.name: given[a.name] for a in arguments if a.name in given}
