"""Bounds of a model's parameters that somebody sets in place of its own, and what rests on them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tractexp.errors import MODEL, UserError, list_allowed, name_setting
from tractexp.parameter import Parameter

# of the range: what is closer rests on the bound. Descents clip to it, rounding stays far below.
BOUND_DISTANCE = 1e-3


def narrow_bounds(
    parameters: Sequence[Parameter], bounds: Mapping[str, Sequence[float]]
) -> tuple[Parameter, ...]:
    """The parameters with some of their bounds replaced.

    Parameters
    ----------
    parameters : sequence of Parameter
        Those of a model.
    bounds : {name: (lower, upper)}
        New bounds, in the parameter's own unit; parameters that are not named keep theirs.

    Returns
    -------
    tuple of Parameter
        In the order given. A default outside the new bounds moves to the nearer of them.

    Raises
    ------
    UserError
        For a name that no parameter has, for what is not a pair, and for reversed bounds.

    Examples
    --------
    >>> inertia = Parameter(1.0, (0.1, 4.0), "s", "inertia constant", "an example", name="H")
    >>> (narrow,) = narrow_bounds([inertia], {"H": (2.0, 3.0)})
    >>> narrow.bounds, narrow.default
    ((2.0, 3.0), 2.0)
    """
    by_name = {p.name: p for p in parameters}
    for name, pair in bounds.items():
        check_name(name, by_name, "model.bounds")
        if len(pair) != 2:
            raise UserError(
                f"{MODEL.bounds}.{name}={list(pair)} must be two numbers, [lower, upper]"
            )
        low, high = map(float, pair)
        old = by_name[name]
        inside = min(max(old.default, low), high) if low < high else old.default
        by_name[name] = replace(old, default=inside, bounds=(low, high), physical=None)
        by_name[name].check(f"{MODEL.bounds}.{name}")
    return tuple(by_name.values())


def check_name(name: str, by_name: Mapping[str, object], where: str) -> None:
    """Raise `UserError` for a parameter that the model lacks; `where` is the setting that names
    it.
    """
    if name not in by_name:
        lack = f"this model has no parameter '{name}'{list_allowed(name, by_name, 'Parameters')}"
        raise UserError(f"{name_setting(where)}.{name}: {lack}")


def is_off_bounds(unit: np.ndarray) -> np.ndarray:
    """Which coordinates rest on no bound.

    Parameters
    ----------
    unit : (D,)
        In the unit cube.

    Returns
    -------
    (D,) array of bools
    """
    return (unit > BOUND_DISTANCE) & (unit < 1 - BOUND_DISTANCE)
