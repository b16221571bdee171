"""The sets that are told where nothing explains, and what sets miss beyond the noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.decide import (
    UNEXPLAINED,
)
from tractexp.discrepancy.evidence import Evidence, SetEvidence, Verdict
from tractexp.discrepancy.gap import Curves, compute_curves
from tractexp.discrepancy.held_out import carry_fits
from tractexp.discrepancy.precision import list_estimates
from tractexp.discrepancy.ranking import (
    find_nearest,
)
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.inference.interval import ParameterEstimate
from tractexp.inference.model_error import ModelChange
from tractexp.noise import Noise
from tractexp.record import Event

MOST_NEAR = 4  # sets that are told where nothing explains


@dataclass(frozen=True, eq=False)
class Nearest:
    """Where nothing explains the disagreement: the set that comes nearest, and what it leaves."""

    row: SetEvidence
    # the next ones, and what share of the gap they close on fitted events
    others: list[tuple[tuple[str, ...], float]]
    fitted: ModelChange[Curves]  # of the base model and with these, on the fitted events
    held_out: ModelChange[Curves] | None  # on the held-out ones, if any

    @property
    def names(self) -> tuple[str, ...]:
        """The effects of the set that comes nearest."""
        return self.row.fit.names

    @property
    def estimates(self) -> list[ParameterEstimate]:
        """The parameters of its effects, as its tests know them."""
        tests = self.row.tests
        assert tests is not None
        own = tests.context.catalogue.parameters(self.names)
        return list_estimates(tests, self.row.fit.unit, self.names)[-len(own) :]

    @property
    def closed_shares(self) -> tuple[float, float]:
        """The share of the gap that is closed on the fitted and on the held-out events, nan without
        any.
        """
        there = self.held_out
        return self.fitted.closed_share, np.nan if there is None else there.closed_share


def find_nearest_sets(
    verdict: Verdict, evidence: Evidence, validate: Sequence[Event]
) -> Nearest | None:
    """The best of the sets that were compared; None where something explains, or that is the base
    model.
    """
    assert evidence.last is not None
    assert evidence.base.tests is not None
    context = evidence.base.tests.context
    rows = evidence.rows[:MOST_NEAR]
    is_base = evidence.is_predicted and not find_nearest(evidence, context.criteria).fit.names
    if verdict.word != UNEXPLAINED or not rows or not rows[0].fit.names or is_base:
        return None
    fits = [evidence.base.fit, *(row.fit for row in rows)]
    before, *after = (
        compute_curves(context, fit.unit, evidence.last.noise, fit.names) for fit in fits
    )
    there = _carry_curves(context, validate, fits[:2]) if validate else None
    others = [
        (row.fit.names, ModelChange(before, one).closed_share)
        for row, one in zip(rows[1:], after[1:], strict=True)
    ]
    return Nearest(rows[0], others, ModelChange(before, after[0]), there)


def _carry_curves(
    context: Context, validate: Sequence[Event], fits: Sequence[Refit]
) -> ModelChange[Curves] | None:
    """What two fits leave of held-out events, the base model's first; None where one has no steady
    state there.
    """
    other, units, noise = carry_fits(context, validate, fits)
    pair = (
        compute_curves(other, units[0], noise),
        compute_curves(other, units[1], noise, fits[1].names),
    )
    return ModelChange(*pair) if np.isfinite([one.deviance for one in pair]).all() else None


def measure_least_error(verdict: Verdict, evidence: Evidence, context: Context) -> float:
    """What the best of the sets kept misses beyond the noise of a response."""
    assert evidence.noise is not None
    return min(_measure_error(row, evidence.noise, context) for row in verdict.kept)


def _measure_error(row: SetEvidence, noise: Noise, context: Context) -> float:
    """What a set misses beyond the noise of a response: of the held-out events, or of those it was
    fitted to.
    """
    if row.prediction is not None:
        return row.prediction.error
    if row.gap is not None:
        return row.gap.after.error.certain
    return compute_curves(
        context, row.reported_fit.unit, noise, row.reported_fit.names
    ).error.certain
