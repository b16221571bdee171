"""A model parameter, declared once beside the equation that uses it, and the box a search works in."""

from dataclasses import dataclass, field

import numpy as np

from tractexp.errors import UserError, among


@dataclass(frozen=True)
class Parameter:
    """One number to identify: its default, bounds, unit, meaning and source.

    The attribute a plugin assigns it to is its name. `null`, where given, is the value at which the
    equations are as if the term were absent. `symbol` is LaTeX.
    """

    default: float
    bounds: tuple[float, float]
    unit: str
    about: str
    source: str
    symbol: str = ""
    null: float | None = None
    name: str = field(default="", compare=False)

    def __set_name__(self, owner: type, name: str) -> None:
        if not self.name:  # one of several classes' has its name already
            object.__setattr__(self, "name", name)
            object.__setattr__(self, "symbol", self.symbol or name)

    def check(self, where: str) -> None:
        """Raise `UserError` unless low <= default, null <= high, low < high, all finite, and everything is told."""
        for what in ("unit", "about", "source"):
            if not getattr(self, what).strip():
                raise UserError(f"{where}: the parameter has no {what}; say it ('1' where a number has no unit)")
        low, high = self.bounds
        if not (np.isfinite([low, high]).all() and low < high):
            raise UserError(f"{where}: bounds [{low:g}, {high:g}] must be two finite numbers, the lower one first")
        if not low <= self.default <= high:
            raise UserError(f"{where}: the default {self.default:g} is outside the bounds [{low:g}, {high:g}]")
        if self.null is not None and not low <= self.null <= high:
            raise UserError(f"{where}: the null {self.null:g} is outside the bounds [{low:g}, {high:g}]")


@dataclass(frozen=True)
class Space:
    """The box of the free parameters: names <-> columns, physical values <-> the unit cube."""

    names: tuple[str, ...]
    lower: np.ndarray  # (d,)
    upper: np.ndarray  # (d,)

    @classmethod
    def of(cls, parameters: tuple[Parameter, ...]) -> "Space":
        bounds = np.array([p.bounds for p in parameters], dtype=float).reshape(-1, 2)
        return cls(tuple(p.name for p in parameters), bounds[:, 0].copy(), bounds[:, 1].copy())

    @property
    def dimension(self) -> int:
        return len(self.names)

    def to_unit(self, values: np.ndarray) -> np.ndarray:
        """Physical values (..., d) to the unit cube."""
        return (values - self.lower) / (self.upper - self.lower)

    def from_unit(self, unit: np.ndarray) -> np.ndarray:
        """Points of the unit cube (..., d) to physical values, never outside the bounds by rounding."""
        return np.clip(self.lower + unit * (self.upper - self.lower), self.lower, self.upper)

    def index(self, name: str) -> int:
        if name not in self.names:
            raise UserError(f"this model has no parameter '{name}'{among(name, self.names, 'Parameters')}")
        return self.names.index(name)
