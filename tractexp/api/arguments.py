"""What a person may give: arguments checked against a signature, and choices found by name as Hydra
finds them.
"""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ParamSpec, TypeVar, get_type_hints

from tractexp.configuration import plugin
from tractexp.configuration.choices import read_default_choices
from tractexp.configuration.composition import read_choice
from tractexp.configuration.kinds import check_kind
from tractexp.errors import UserError, check_distinct, list_allowed, name_settings_as
from tractexp.outcome import Plain
from tractexp.process.blas import limit_threads

P = ParamSpec("P")
R = TypeVar("R")


def public(function: Callable[P, R]) -> Callable[P, R]:
    """A call whose arguments are checked: an unknown name or a wrong type is a `UserError` in one
    sentence. Its linear algebra runs in one thread.

    Sentences from below name a setting as the user wrote it: the argument (`bounds.C`) of this
    call, and the key of the configuration (`model.bounds.C`) on the command line, which calls the
    function without this door (`inspect.unwrap`).
    """
    signature = inspect.signature(function)
    named = [p.name for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    where, open_ended = f"{function.__name__}()", len(named) < len(signature.parameters)

    @functools.wraps(function)
    def call_checked(*args: P.args, **keywords: P.kwargs) -> R:
        for name in keywords:
            if name not in named and not open_ended:
                raise UserError(
                    f"{where} has no argument '{name}'{list_allowed(name, named, 'Arguments')}"
                )
        try:
            arguments = signature.bind(*args, **keywords).arguments
        except TypeError as error:
            raise UserError(f"{where}: {error}; Arguments: {', '.join(named)}") from None
        for name, value in arguments.items():
            parameter = signature.parameters[name]
            if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
                check_kind(name, value, parameter.annotation)
        names = name_settings_as(
            function.__name__,
            lambda: {*named, *keywords, *(_collect_settings("data") if open_ended else ())},
        )
        with names, limit_threads():
            return function(*args, **keywords)

    return call_checked


@dataclass(frozen=True)
class Choice(Plain):
    """A choice of a group: its name, and the name and settings of the plugin that it stands for."""

    name: str
    node: Mapping[str, Any]

    @classmethod
    def from_argument(
        cls, group: str, chosen: "str | Mapping[str, Any] | Sequence[Any] | Choice | None"
    ) -> "Choice":
        """The choice of a name, of a mapping of `name` and settings that replace the choice's own,
        or of several.

        None is the default of `conf/config.yaml`.
        """
        if isinstance(chosen, Choice):
            return cls(chosen.name, complete_settings(group, chosen.node))
        chosen = read_default_choices()[group] if chosen is None else chosen
        check_kind(group, chosen, str | Mapping[str, Any] | Sequence[Any])
        if isinstance(chosen, Sequence) and not isinstance(chosen, str):
            chosen = plugin.join_choices(group, chosen)
        asked = {"name": chosen} if isinstance(chosen, str) else dict(chosen)
        if "name" not in asked:
            raise UserError(
                f"{group}={asked} lacks 'name'; give a name, or a mapping of 'name' and settings"
            )
        name = str(asked.pop("name"))
        node = {**read_choice(group, name), **asked}
        return cls(name, complete_settings(group, node))

    @classmethod
    def several(cls, group: str, chosen: Any) -> "list[Choice]":
        """The choices of one, of a list, or of a mapping of the names to call them by to each;
        argument `groups`.

        A mapping that has the key `name` is one choice with settings. Raises `UserError` for none
        and for doubles.
        """
        if isinstance(chosen, Mapping) and "name" not in chosen:
            several = [
                dataclasses.replace(cls.from_argument(group, one), name=name)
                for name, one in chosen.items()
            ]
        else:
            listed = (
                chosen if isinstance(chosen, Sequence) and not isinstance(chosen, str) else [chosen]
            )
            several = [cls.from_argument(group, one) for one in listed]
        check_distinct(f"{group}s", [one.name for one in several])
        return several

    def build(self, group: str) -> Any:
        """The plugin with its settings."""
        return plugin.build(group, self.node)


def complete_settings(group: str, node: Mapping[str, Any]) -> dict[str, Any]:
    """A plugin's node with every setting, checked; what was left out has its default."""
    kinds = get_type_hints(plugin.get(group, node["name"]))
    for key, value in node.items():
        if key != "name" and key in kinds:
            check_kind(f"{group}.{key}", value, kinds[key])
    return {"name": node["name"], **dataclasses.asdict(plugin.build(group, node))}


def _collect_settings(group: str) -> list[str]:
    """The settings of all plugins of a group."""
    classes = plugin.discover().get(group, {}).values()
    return [f.name for cls in classes for f in dataclasses.fields(cls)]  # type: ignore[arg-type]
