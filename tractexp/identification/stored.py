"""What a stored result is checked for when it is read, and the signals that it is asked to predict
from.
"""

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, get_type_hints

import numpy as np

from tractexp.configuration.kinds import check_kind
from tractexp.errors import UserError, list_allowed
from tractexp.text.wording import count_noun


def check_fields(cls: type[Any], content: Any, where: str) -> None:
    """Raise `UserError` unless `content` has the fields of a dataclass, each of its kind; `where`
    names the file.
    """
    unlike = f"{where} is not a result.json of an identification"
    if not isinstance(content, Mapping):
        raise UserError(f"{unlike}: it holds no mapping of names to values")
    own = {f.name: f for f in dataclasses.fields(cls)}
    for name in content:
        if name not in own:
            raise UserError(
                f"{unlike}: it has an unknown key '{name}'{list_allowed(name, own, 'Keys')}"
            )
    for name, f in own.items():
        if name not in content and f.default is f.default_factory is dataclasses.MISSING:
            raise UserError(f"{unlike}: it lacks '{name}'")
    kinds = get_type_hints(cls)
    for name, value in content.items():
        check_kind(f"{where}: {name}", _restore_numbers(value), kinds[name])


def replace_nulls(cls: type[Any], content: Mapping[str, Any]) -> dict[str, Any]:
    """Content with nan in the place of a field's number that did not exist when it was saved."""
    kinds = get_type_hints(cls)
    return {
        key: math.nan if value is None and kinds[key] is float else value
        for key, value in content.items()
    }


def _restore_numbers(value: Any) -> Any:
    """A value with a number in the place of each that did not exist when it was saved, which JSON
    knows as null.
    """
    if isinstance(value, Mapping):
        return {key: _restore_numbers(inner) for key, inner in value.items()}
    return (
        [_restore_numbers(inner) for inner in value]
        if isinstance(value, list)
        else math.nan
        if value is None
        else value
    )


def check_numbers(where: str, numbers: Any) -> None:
    """Raise `UserError` for a value of a mapping, and of those and lists within it, that is no
    finite number.
    """
    for key, value in _list_leaves(where, numbers):
        try:
            finite = not isinstance(value, bool) and math.isfinite(value)
        # what is no number, or a whole one with hundreds of digits
        except (TypeError, OverflowError):
            finite = False
        if not finite:
            raise UserError(f"{key} = {value!r:.40} is no finite number; identify again")


def _list_leaves(where: str, value: Any) -> Iterator[tuple[str, Any]]:
    """(place, value) of everything within a value that is neither mapping nor list."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _list_leaves(f"{where}.{key}", inner)
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            yield from _list_leaves(f"{where}[{k}]", inner)
    else:
        yield where, value


def check_parameters(where: str, values: Mapping[str, float], parts: Iterable[Any]) -> None:
    """Raise `UserError` where a parameter of a model's parts has no value."""
    for part in parts:
        for name in [p.name for p in part.parameters if p.name not in values]:
            raise UserError(
                f"{where}: parameters lacks {name}, which the {part.group} '{part.name}' needs"
            )


def describe_outside(values: Mapping[str, float], bounds: Mapping[str, list[float]]) -> list[str]:
    """Sentences on the values that are outside their bounds, as fixed ones may be, and none that
    was searched.
    """
    return [
        f"{name} = {value:.5g} is outside its bounds, {bounds[name][0]:.5g} to"
        f" {bounds[name][1]:.5g}"
        for name, value in values.items()
        if name in bounds and not bounds[name][0] <= value <= bounds[name][1]
    ]


def read_signals(given: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Signals (N,) by name, t among them, that a model is to be driven by.

    Raises `UserError`, naming signal and sample, for what is no finite number, no array (N,) of two
    samples or more, for a voltage that is not above zero, and for times that are not uniform.
    """
    arrays = {
        name: _read_signal(name, values) for name, values in given.items() if values is not None
    }
    t = arrays["t"]
    for name, values in arrays.items():
        if values.shape != t.shape:
            raise UserError(f"{name} has {len(values)} samples where t has {len(t)}; give as many")
    if len(t) < 2:
        raise UserError(f"t has {count_noun(len(t), 'sample')}; a prediction needs at least two")
    steps = np.diff(t)
    usual = float(np.median(steps))
    if not (usual > 0 and (np.abs(steps - usual) < usual / 2).all()):
        i = int(np.argmin(np.abs(steps - usual) < usual / 2)) + 1
        raise UserError(
            f"t = {t[i]:.9g} s at sample {i + 1} follows {t[i - 1]:.9g} s, and steps of {usual:.6g}"
            " s are usual; give "
            "t and U at uniform times"
        )
    if not (arrays["U"] > 0).all():
        i = int(np.argmin(arrays["U"] > 0))
        raise UserError(
            f"U = {arrays['U'][i]:g} at sample {i + 1}, but voltage must be above zero everywhere"
        )
    return arrays


def _read_signal(name: str, values: Any) -> np.ndarray:
    """A signal (N,) of a stored result. Raises `UserError` for what is no number, no row, or not
    finite, naming the sample.
    """
    try:
        result = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise UserError(f"{name} holds what is no number; give one number per sample") from error
    if result.ndim != 1:
        raise UserError(f"{name} has shape {result.shape}; one number per sample, (N,), is needed")
    if not np.isfinite(result).all():
        i = int(np.argmin(np.isfinite(result)))
        raise UserError(
            f"{name} = {result[i]} at sample {i + 1} is not a finite number; fill the gap, or cut"
            " there"
        )
    return result
