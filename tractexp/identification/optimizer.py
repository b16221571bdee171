"""What an optimizer is given and what it must do. Counting, clipping and keeping the best are not its business."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from tractexp.errors import check_choice
from tractexp.parameter import Box
from tractexp.plugin import Plugin

__all__ = ["REFUSED", "Box", "Evaluate", "Optimizer"]

REFUSED = 1e12  # objectives from here up mark candidates that could not be simulated, ranked by how far they miss


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
