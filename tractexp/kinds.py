"""Values checked against annotations: what a person or a file gave, and what it must
be, in words.
"""

import types
from collections.abc import Mapping, Sequence
from inspect import Parameter
from numbers import Integral, Real
from typing import Any, Union, get_args, get_origin

from tractexp.errors import UserError, setting

WORDS: Mapping[Any, str] = {
    int: "a whole number",
    float: "a number",
    bool: "True or False",
    str: "a text",
    type(None): "None",
    Any: "anything",
}
GIVEN: Mapping[Any, str] = {
    bool: "a truth value",
    type(None): "nothing",
    dict: "a mapping",
    list: "a list",
    tuple: "a list",
}


def check_kind(name: str, value: Any, annotation: Any) -> None:
    """Raise `UserError` where a value is not of the kind an annotation says."""
    if not _is(value, annotation):
        kinds = (
            get_args(annotation)
            if get_origin(annotation) in (Union, types.UnionType)
            else (annotation,)
        )
        allowed = " or ".join(dict.fromkeys(_word(kind) for kind in kinds))
        raise UserError(
            f"{setting(name)}={value!r:.60} is {_kind(value)}, but it must be {allowed}"
        )


def _is(value: Any, kind: Any) -> bool:
    """Whether a value is of a kind, as annotations write it."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return any(_is(value, one) for one in inner)
    if kind in (int, float):
        return isinstance(value, Integral if kind is int else Real) and not isinstance(value, bool)
    if origin in (Sequence, list, tuple):
        listed = isinstance(value, Sequence) and not isinstance(value, str | bytes)
        return listed and all(_is(one, inner[0]) for one in value)
    if origin is Mapping or origin is dict:
        return isinstance(value, Mapping) and all(_is(one, inner[1]) for one in value.values())
    kind = origin or kind
    return not isinstance(kind, type) or kind in (Any, Parameter.empty) or isinstance(value, kind)


def _word(kind: Any) -> str:
    """A kind in words."""
    origin = get_origin(kind)
    if origin in (Sequence, list, tuple):
        return f"a list, each {_word(get_args(kind)[0])}"
    if origin is Mapping or origin is dict:
        return f"a mapping, each value {_word(get_args(kind)[1])}"
    return WORDS.get(kind) or _article(getattr(kind, "__name__", str(kind)))


def _kind(value: Any) -> str:
    """What a value is, in the words in which it is said what it must be."""
    return GIVEN.get(type(value)) or WORDS.get(type(value)) or _article(type(value).__name__)


def _article(name: str) -> str:
    """A name with its article."""
    return f"{'an' if name[0].lower() in 'aeiou' else 'a'} {name}"
