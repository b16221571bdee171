"""What an optimizer is given and what it must do. Counting, clipping and keeping the best are not its business."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from tractexp.errors import check_choice
from tractexp.plugin import Plugin

REFUSED = 1e12  # objectives from here up mark candidates that could not be simulated, ranked by how far they miss


@dataclass(frozen=True)
class Box:
    """The search box: the unit cube, or the raw bounds where an optimizer asks for `space="raw"`."""

    lower: np.ndarray  # (d,)
    upper: np.ndarray  # (d,)

    @property
    def dimension(self) -> int:
        return len(self.lower)

    @property
    def width(self) -> np.ndarray:
        return self.upper - self.lower

    def clip(self, x: np.ndarray) -> np.ndarray:
        return np.clip(x, self.lower, self.upper)

    def uniform(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """(n, d) points drawn uniformly."""
        return self.from_unit(rng.random((n, self.dimension)))

    def from_unit(self, unit: np.ndarray) -> np.ndarray:
        """Points (..., d) of the unit cube in this box's coordinates."""
        return self.lower + self.width * unit

    def to_unit(self, x: np.ndarray) -> np.ndarray:
        """Points (..., d) of this box in the unit cube."""
        return (x - self.lower) / self.width


class Evaluate(Protocol):
    """The batch objective. Both calls clip `x` (n, d) into the box and return the points really evaluated."""

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, d) -> (evaluated points (n, d), objectives (n,)). Lower is better; never nan."""
        ...

    def residuals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, d) -> (evaluated points (n, d), residuals (n, m)); the objective is their sum of squares.

        A point that cannot be simulated has nan in its whole row. Raises `UserError` where the problem has no
        residuals.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Optimizer(Plugin):
    """Base of the optimizer plugins, chosen by `optimizer=NAME`. Its fields are settings of every optimizer."""

    group: ClassVar[str] = "optimizer"
    plain: ClassVar[str] = ""  # the optimizer that this one is, bit for bit, with all its switches off
    space: str = "unit"  # "unit": search in the unit cube; "raw": in the parameters' own units
    polish: bool = False  # end with bounded least squares from the best points, inside the same budget

    def check(self) -> None:
        check_choice("optimizer.space", self.space, ("unit", "raw"))

    @abstractmethod
    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        """Search `box`, yielding once at the end of each iteration (the initial population is iteration 0).

        A generator: the search loop runs it until it returns or a budget is spent, in which case `evaluate`
        raises and the generator simply ends. All randomness comes from `rng`.
        """
