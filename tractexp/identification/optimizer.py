"""What an optimizer is given and what it must do. Counting, clipping and keeping the best are not
its business.
"""

import itertools
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from tractexp.configuration.plugin import Plugin
from tractexp.errors import check_choice, check_range
from tractexp.inference.loss import REFUSED
from tractexp.parameter import Box

__all__ = ["REFUSED", "Box", "Evaluate", "Iterative", "Optimizer"]


class Evaluate(Protocol):
    """The batch objective. Both calls clip `x` (n, d) into the box and return the points really
    evaluated.

    `budget` is the number of evaluations the search may make, by which a schedule can be laid out;
    None: any.
    """

    @property
    def budget(self) -> int | None:
        """The evaluations that the search may make; None: any number."""
        ...

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The objectives of a batch of points.

        Parameters
        ----------
        x : (n, d)
            Points; they are clipped into the box.

        Returns
        -------
        (n, d) array
            The points really evaluated.
        (n,) array
            Their objectives: lower is better, never nan.
        """
        ...

    def residuals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The residuals of a batch of points, whose sum of squares is the objective.

        Parameters
        ----------
        x : (n, d)
            Points; they are clipped into the box.

        Returns
        -------
        (n, d) array
            The points really evaluated.
        (n, m) array
            Residuals; a point that cannot be simulated has nan in its whole row.

        Raises
        ------
        UserError
            Where the problem has no residuals.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class Optimizer(Plugin):
    """Base of the optimizer plugins, chosen by `optimizer=NAME`. Its fields are settings of every
    optimizer.

    Attributes
    ----------
    plain : str
        The optimizer that this one is, bit for bit, with all its switches off.
    space : str
        "unit": it searches the unit cube; "raw": the parameters' own units.
    polish : bool
        Whether bounded least squares from the best points end the search, inside the same budget.
    """

    group: ClassVar[str] = "optimizer"
    # the optimizer that this one is, bit for bit, with all its switches off
    plain: ClassVar[str] = ""
    space: str = "unit"  # "unit": search in the unit cube; "raw": in the parameters' own units
    # end with bounded least squares from the best points, inside the same budget
    polish: bool = False

    def end(self, budget: int | None) -> int | None:
        """The iterations after which a search ends by itself.

        Parameters
        ----------
        budget : int or None
            The simulations it may make; None: any number.

        Returns
        -------
        int or None
            None: that is open.
        """
        return getattr(self, "iterations", None)

    def check(self) -> None:
        """Raise `UserError` for a space that is neither "unit" nor "raw"."""
        check_choice("optimizer.space", self.space, ("unit", "raw"))

    @abstractmethod
    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        """Search a box, yielding after the initial population and after each iteration.

        A generator: the search loop runs it until it returns or a budget is spent, in which case
        `evaluate` raises and the generator simply ends. The first `yield` is the start (iteration
        0).

        Parameters
        ----------
        evaluate : Evaluate
            The batch objective, which counts, clips and keeps the best.
        box : Box
            Bounds (d,): the unit cube, or the problem's own where `space` is "raw".
        rng : numpy.random.Generator
            All randomness comes from it.

        Yields
        ------
        None
        """


@dataclass(frozen=True, kw_only=True)
class Iterative(Optimizer):
    """Base of the optimizers that repeat one step, as often as is set, or as the budget lasts for.

    Attributes
    ----------
    usual : int
        Iterations where neither they nor a budget are set.
    iterations : int or None
        How many there are; None: as many as the budget lasts for.
    """

    # where nothing else says: sections 4.2 and 4.3 of the traction load paper
    usual: ClassVar[int] = 300
    # null: as many as the budget lasts for; without a budget the usual number
    iterations: int | None = None

    def check(self) -> None:
        """Raise `UserError` for fewer iterations than one, too."""
        super().check()
        if self.iterations is not None:
            check_range("optimizer.iterations", self.iterations, 1)

    def end(self, budget: int | None) -> int | None:
        """The iterations that are set, else the usual number where there is no budget; None where
        the budget ends the search.
        """
        return self.iterations or (self.usual if budget is None else None)

    def laid_out(self, budget: int | None, first: float, each: float) -> tuple[int, Iterable[int]]:
        """How many iterations a search is laid out for, and their numbers.

        A budget lasts for so many, and then ends them, for the numbers go on.

        Parameters
        ----------
        budget : int or None
            The simulations it may make.
        first : float
            Simulations of the first population.
        each : float
            Simulations of an iteration, on average.

        Returns
        -------
        int
            The iterations that a schedule can count on.
        iterable of ints
            1, 2, ...

        Examples
        --------
        >>> @dataclass(frozen=True, kw_only=True)
        ... class Steps(Iterative):
        ...     def search(self, evaluate, box, rng):
        ...         yield
        >>> Steps().laid_out(budget=120, first=20, each=10)[0]
        10
        >>> Steps(iterations=7).laid_out(None, 20, 10)
        (7, range(1, 8))
        """
        count = self.end(budget)
        if count is not None:
            return count, range(1, count + 1)
        assert budget is not None
        return max(1, round((budget - first) / each)), itertools.count(1)
