"""What is known of every set of effects: a table with a row for each set, whose columns the steps
fill.

`rival_sets` fills `fit`, `lowered`, `behind`, `p_left`: the fit to the fitted events, what it
gains, how far behind the best set it is, and how often chance leaves as much. `held_out` fills
`final`, `gap`, `without`, `p_of_all` and `behind_of_all`: the fit that is told, what it and each of
its members gain on the held-out events, and the same as before of a fit to all events. `prediction`
fills `prediction`: what it leaves of the held-out events, where every set leaves more than noise.

`decide` reads the numbers of this table and nothing else.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from tractexp.discrepancy.disagreement import Disagreement
from tractexp.discrepancy.gap import MILD, GapTest
from tractexp.inference.blocks import reach
from tractexp.inference.context import Context
from tractexp.inference.fitting import Names, Refit
from tractexp.noise import Noise

FINEST = 0.1  # of the noise: a model's squared error is told no finer
LEAST_SQUARED_ERROR = 1e-12  # pu^2, the least squared error of a model without noise
SLIGHT_ERROR = 0.01  # of the response: less is no difference to anyone


@dataclass(frozen=True, eq=False)
class PredictedError:
    """What a fit leaves of the held-out events in S, in b blocks of time.

    Attributes
    ----------
    squares : (b,) [pu²]
        What is left in each block, noise included.
    noise : (b,) [pu²]
        What of that is expected of the noise.
    response : (b,) [pu²]
        What the load did.
    unit : (D,)
        Coordinates on the held-out events.
    stalls : names
        Events on which the motor stalls: there all is left.
    """

    squares: np.ndarray
    noise: np.ndarray
    response: np.ndarray
    unit: np.ndarray
    stalls: tuple[str, ...] = ()

    @property
    def excess(self) -> float:
        """The squares beyond the noise, no less than can be told of them."""
        return max(float(self.squares.sum() - self.noise.sum()), self.least_excess)

    @property
    def least_excess(self) -> float:
        """The least that can be told of squares beyond the noise."""
        return max(FINEST * float(self.noise.sum()), LEAST_SQUARED_ERROR)

    @property
    def largest_factor(self) -> float:
        """The most by which any set could divide this error: noise hides what is less."""
        return (self.excess / self.least_excess) ** 0.5

    @property
    def error(self) -> float:
        """The model's error, of the response."""
        return float(np.sqrt(self.excess / max(self.response.sum(), 1e-30)))

    def compute_lead(self, other: "PredictedError") -> float:
        """By how much it leaves less, beyond chance: of the ratio's logarithm, by a jackknife over
        the blocks. Not above 0 where that may be chance.
        """
        own_sum = self.squares.sum()
        other_sum = other.squares.sum()
        if not np.isfinite(own_sum):
            return -np.inf
        if not np.isfinite(other_sum):
            return np.inf
        own_rest = own_sum - self.squares
        other_rest = other_sum - other.squares
        without = np.log(np.maximum(other_rest, 1e-300) / np.maximum(own_rest, 1e-300))
        lead = float(np.log(other_sum / own_sum))
        return lead - reach(without, lead)


@dataclass(frozen=True, eq=False)
class SetEvidence:
    """What is known of one set of effects. A column that no step has filled has its default.

    `names` are its effects with the faults of the measurement beside them, `family` its effects by
    the names of the catalogue.
    """

    fit: Refit
    names: Names
    family: Names
    lowered: float = np.nan  # by how much its deviance is below that of the base model
    behind: float = np.nan  # the best set of its size, of Akaike's criterion
    # how often chance leaves as much of the fitted events; nan where that was not asked
    p_left: float = np.nan
    gap: GapTest | None = None  # on the held-out events
    # against the set without each of several effects
    without: Mapping[str, GapTest] = field(default_factory=dict)
    p_of_all: float = 1.0  # how often chance leaves as much as a fit to all events does
    behind_of_all: float = 0.0  # the best fit to all events, of Akaike's criterion
    is_fitted_to_all: bool = False  # whether `final` is the fit to all events
    prediction: PredictedError | None = None
    fitted_error: PredictedError | None = None  # the base model's on the fitted events
    grade: str = ""  # of the model with it, where one set alone is kept
    is_absent: bool = False  # whether all its sizes are at their null in the model that is graded
    # of its sizes: on a bound, or not known within their bounds, in words
    open_sizes: tuple[str, ...] = ()
    # the share of what it takes away of events with all fitted that it takes away with each left
    # out in turn, the least; nan where noise hides it in each of them, None where none is left out
    replicated_share: float | None = None
    tests: Disagreement | None = None  # at its fit
    final: Refit | None = None  # without the faults of the measurement that do not help

    @property
    def gaps(self) -> tuple[GapTest, ...]:
        """What held-out events say of the set and of each of several effects; none where that was
        not asked.
        """
        return () if self.gap is None else (self.gap, *self.without.values())

    @property
    def held_out_prediction(self) -> PredictedError:
        """What it leaves of the held-out events, where that was asked."""
        assert self.prediction is not None
        return self.prediction

    @property
    def is_slight(self) -> bool:
        """Whether it leaves less than matters of the fitted and of the held-out events."""
        if self.prediction is None or self.fitted_error is None:
            return False
        return max(self.prediction.error, self.fitted_error.error) < SLIGHT_ERROR

    @property
    def reported_fit(self) -> Refit:
        """The fit that is told of it."""
        return self.fit if self.final is None else self.final


@dataclass(frozen=True, eq=False)
class Evidence:
    """The table. `base` is the row of the base model alone, `rows` are those of the sets that are
    compared: the one chosen by the search first, or those kept, then the best. `others` were fitted
    beside them, but are not told.
    """

    base: SetEvidence
    rows: tuple[SetEvidence, ...]
    others: tuple[SetEvidence, ...] = ()
    # that predicts best of the library of terms, where a set predicts well enough
    term: SetEvidence | None = None
    faults: Names = ()  # of the measurement, in every set
    noise: Noise | None = None  # under which all were fitted
    last: Disagreement | None = None  # the tests of the best set
    # the held-out events, where sets are compared by the model's error
    there: Context | None = None

    @property
    def every(self) -> Iterator[SetEvidence]:
        """The base model's row and all others."""
        yield from (self.base, *self.rows, *self.others)

    @property
    def is_predicted(self) -> bool:
        """Whether every set leaves more than noise, so that sets are judged by what
        they predict.
        """
        return self.base.prediction is not None

    @property
    def is_mild(self) -> bool:
        """Whether the held-out events are too mild for all that explains the fitted ones."""
        gaps = [row.gap for row in self.rows if row.gap is not None]
        return bool(gaps) and all(gap.outcome == MILD for gap in gaps)

    def row_of(self, names: Names) -> SetEvidence | None:
        """The row of these effects, None where they were not fitted."""
        return next((row for row in self.every if row.fit.names == tuple(names)), None)

    def contributions(self, names: Names) -> list[SetEvidence]:
        """The base model, then with one member more at a time, the one that helps most: what each
        is good for.
        """
        steps = [self.base]
        missing = set(names)
        while missing:
            wanted = [tuple(sorted((*steps[-1].fit.names, name))) for name in missing]
            found = [row for row in map(self.row_of, wanted) if row is not None]
            if not found:
                break
            steps.append(min(found, key=lambda row: row.held_out_prediction.excess))
            missing -= set(steps[-1].fit.names)
        return steps


@dataclass(frozen=True, eq=False)
class Verdict:
    """What an investigation decides.

    Attributes
    ----------
    word : str
        `none`, `candidate`, `named`, `tied` or `unexplained`.
    kept : tuple of SetEvidence
        The sets that are kept; the extended model has the first.
    complete : bool
        Whether nothing but noise is left.
    """

    word: str
    kept: tuple[SetEvidence, ...]
    complete: bool

    @property
    def chosen(self) -> SetEvidence | None:
        """The set that the extended model has."""
        return self.kept[0] if self.kept else None

    @property
    def sets(self) -> tuple[Names, ...]:
        """The names of all sets kept."""
        return tuple(row.names for row in self.kept)

    @property
    def names(self) -> Names:
        """The effects added."""
        return self.sets[0] if self.kept else ()
