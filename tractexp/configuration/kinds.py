"""Values checked against annotations: what a person or a file gave, and what it must
be, in words.
"""

import types
from collections.abc import Mapping, Sequence
from inspect import Parameter
from numbers import Integral, Real
from typing import Any, Union, get_args, get_origin

from tractexp.errors import UserError, name_setting

WORDS: Mapping[Any, str] = {
    int: "a whole number",
    float: "a number",
    bool: "True or False",
    str: "a text",
    type(None): "nothing",
    Any: "anything",
}
GIVEN: Mapping[Any, str] = {
    bool: "a truth value",
    dict: "a mapping",
    list: "a list",
    tuple: "a list",
}


def check_kind(name: str, value: Any, annotation: Any) -> None:
    """Raise `UserError` where a value is not of the kind an annotation says."""
    if not _is_of_kind(value, annotation):
        kinds = (
            get_args(annotation)
            if get_origin(annotation) in (Union, types.UnionType)
            else (annotation,)
        )
        allowed = " or ".join(dict.fromkeys(_describe_kind(kind) for kind in kinds))
        raise UserError(
            f"{name_setting(name)}={value!r:.60} is {_describe_kind_of(value)},"
            f" but it must be {allowed}"
        )


def _is_of_kind(value: Any, kind: Any) -> bool:
    """Whether a value is of a kind, as annotations write it."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return any(_is_of_kind(value, one) for one in inner)
    if kind in (int, float):
        return _is_number(value, kind)
    if origin in (Sequence, list, tuple):
        return _is_list(value, inner[0])
    if origin in (Mapping, dict):
        return _is_mapping(value, inner[1])
    kind = origin or kind
    if not isinstance(kind, type) or kind in (Any, Parameter.empty):
        return True
    return isinstance(value, kind)


def _is_number(value: Any, kind: type) -> bool:
    """Whether a value is an integer or a real number; no truth value is."""
    number = Integral if kind is int else Real
    return isinstance(value, number) and not isinstance(value, bool)


def _is_list(value: Any, kind: Any) -> bool:
    """Whether a value is a list whose items are of a kind; no text is."""
    if not isinstance(value, Sequence) or isinstance(value, str | bytes):
        return False
    return all(_is_of_kind(one, kind) for one in value)


def _is_mapping(value: Any, kind: Any) -> bool:
    """Whether a value is a mapping whose values are of a kind."""
    if not isinstance(value, Mapping):
        return False
    return all(_is_of_kind(one, kind) for one in value.values())


def _describe_kind(kind: Any) -> str:
    """A kind in words."""
    origin = get_origin(kind)
    if origin in (Sequence, list, tuple):
        return f"a list, each {_describe_kind(get_args(kind)[0])}"
    if origin is Mapping or origin is dict:
        return f"a mapping, each value {_describe_kind(get_args(kind)[1])}"
    return WORDS.get(kind) or _add_article(getattr(kind, "__name__", str(kind)))


def _describe_kind_of(value: Any) -> str:
    """The kind of a value in words: "a number", "a list"."""
    return GIVEN.get(type(value)) or WORDS.get(type(value)) or _add_article(type(value).__name__)


def _add_article(name: str) -> str:
    """A name with its article."""
    return f"{'an' if name[0].lower() in 'aeiou' else 'a'} {name}"
