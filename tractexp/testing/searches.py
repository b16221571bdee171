"""What optimizers must satisfy."""

from collections.abc import Callable

import numpy as np

from tractexp.identification.optimizer import Box, Optimizer
from tractexp.identification.search import Limits, SearchResult, search

BUDGET = 1500  # simulations
LEAST_SEARCH_GAIN = 0.5  # of the best of the first batch: more than luck
MOST_ITERATIONS = 25


class Bowl:
    """sum((x - c)^2) over a box of unequal sides; the minimum lies off its center."""

    lower: np.ndarray = np.array([-1.0, 0.0, 10.0])
    upper: np.ndarray = np.array([2.0, 0.1, 30.0])
    best: np.ndarray = np.array([0.3, 0.07, 14.0])

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """The distance (n, d) of points from the minimum, in widths of the box."""
        return (values - self.best) / (self.upper - self.lower)

    def objective(self, values: np.ndarray) -> np.ndarray:
        """The sum of their squares (n,)."""
        return (self.residuals(values) ** 2).sum(axis=1)


class Noted(Bowl):
    """A bowl that stores every batch."""

    def __init__(self) -> None:
        """No batch was asked for yet."""
        self.batches: list[np.ndarray] = []

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """The bowl's residuals; the points are kept."""
        self.batches.append(values.copy())  # an optimizer may change what it was given
        return super().residuals(values)


def says_what_it_is(cls: type[Optimizer]) -> None:
    """The docstring says where the method comes from and what departs from it."""
    for needed in ("Source:", "Departures:"):
        assert needed in (cls.__doc__ or ""), (
            f"the docstring of '{cls.name}' has no line '{needed}'"
        )
    cls().check()


def gives_the_same_bits_for_the_same_seed(cls: type[Optimizer]) -> None:
    """All randomness comes from `rng`: one seed, one history."""
    one, two = _search(cls, Bowl(), 7), _search(cls, Bowl(), 7)
    for name in ("simulations", "objective", "values"):
        same = np.array_equal(getattr(one.history, name), getattr(two.history, name))
        assert same, f"'{cls.name}' gives another history of {name} for the same seed"


def stays_in_the_box_and_ends_at_the_budget(cls: type[Optimizer]) -> None:
    """All evaluated points lie in the bounds, no more of them than the budget says."""
    problem = Noted()
    result = _search(cls, problem, 3)
    points = np.concatenate(problem.batches)
    assert len(points) == result.simulations <= BUDGET, (
        f"'{cls.name}' spent {len(points)} of {BUDGET} simulations"
    )
    assert ((points >= Bowl.lower) & (points <= Bowl.upper)).all(), (
        f"'{cls.name}' was evaluated outside the bounds"
    )


def yields_once_an_iteration(cls: type[Optimizer]) -> None:
    """Each iteration has spent simulations when it yields, and there is more than one."""
    spent = [0]

    class Counted:
        budget: int | None = None

        def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            x, _ = self.residuals(x)
            return x, Bowl().objective(x)

        def residuals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            x = np.clip(np.atleast_2d(x), Bowl.lower, Bowl.upper)
            spent[0] += len(x)
            return x, Bowl().residuals(x)

    counts = []
    for _ in cls().search(Counted(), Box(Bowl.lower, Bowl.upper), np.random.default_rng(5)):
        counts.append(spent[0])
        if len(counts) == MOST_ITERATIONS:
            break
    assert len(counts) > 1, (
        f"'{cls.name}' yields {len(counts)} times; it must yield at the end of each iteration"
    )
    assert (np.diff([0, *counts]) > 0).any(), (
        f"'{cls.name}' yields without having evaluated anything"
    )


def finds_the_bottom_of_a_bowl(cls: type[Optimizer]) -> None:
    """After the budget it is well below the best of its first batch, in either space."""
    for space in ("unit", "raw"):
        problem = Noted()
        result = _search(cls, problem, 11, space)
        first = Bowl().objective(problem.batches[0]).min()
        assert result.objective <= LEAST_SEARCH_GAIN * first, (
            f"'{cls.name}' ends at {result.objective:.3g} after a start of {first:.3g}"
        )


def _search(cls: type[Optimizer], problem: Bowl, seed: int, space: str = "unit") -> SearchResult:
    """The result of an optimizer within the tests' budget."""
    return search(problem, cls(space=space), seed, Limits(BUDGET))


CHECKS: tuple[Callable[[type], None], ...] = (
    says_what_it_is,
    gives_the_same_bits_for_the_same_seed,
    stays_in_the_box_and_ends_at_the_budget,
    yields_once_an_iteration,
    finds_the_bottom_of_a_bowl,
)
SUITE = (Optimizer, (), CHECKS)
