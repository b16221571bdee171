"""The estimate: least squares, polished by the likelihood of the noise where nothing but noise is
left.

What a model leaves of a real record is mostly its own error, often a hundred times the noise. The
likelihood of that noise is then no likelihood: single samples at the edges of a dip decide, and
move parameters by more than they are worth. Least squares, Eq. (8), need to know nothing of the
error. So the estimate is the minimum of Eq. (8), from wherever a search ended and from all over the
box: the same for one set of records whatever was searched with, and never worse than the search.
Where draws of the noise leave as much as it does, the likelihood of the noise (`likelihood`) is
true and the most precise there is, and the estimate is its maximum.

Channels weighed by the size of what each leaves were tried beside Eq. (8): the same on 37 sets of a
generator, and worse on records of ANDES, whose reactive power then counted for more than its error
is worth.
"""

from collections import OrderedDict
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.errors import MODEL, TASK, UserError
from tractexp.identification.adequacy import ResidualTest, run_residual_test
from tractexp.identification.residual_noise import drop_outliers, estimate_noise_at
from tractexp.identification.uncertainty import Uncertainty, compute_threshold, conclude
from tractexp.inference.blocks import cut_blocks, exceeds
from tractexp.inference.least_squares import Descent
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.multistart import (
    explore_minima,
    place_along_least_certain,
    search_box,
    select_distinct,
)
from tractexp.inference.noise import ROUNDS_OF_NOISE, compute_input_modes
from tractexp.inference.prior import describe_prior, weigh_prior
from tractexp.inference.problem import Problem
from tractexp.inference.records import Records

LARGEST_MINIMUM_RATIO = 1.3  # times the least sum of squares: valleys beyond it are given up
BEHIND = 25.0  # of the deviance under the noise found: valleys farther behind are
# of the deviance, by which a search's valley must be better than those of the box
LEAST_MINIMUM_GAIN = 0.5
SAME_MINIMUM_DISTANCE = 1e-3  # of a range: ends closer than this are one valley
REMEMBERED = 4  # problems whose valleys are kept: the jobs of a sweep share one


@dataclass(frozen=True, eq=False)
class EstimationResult:
    """An estimate.

    Attributes
    ----------
    uncertainty : Uncertainty
        Values, intervals and verdicts.
    surprise : Surprise
        How often noise alone leaves as much.
    starts : list of dict
        The descents that it was chosen from, the best first, as `result.json` has them.
    """

    uncertainty: Uncertainty
    surprise: ResidualTest
    starts: list[dict[str, Any]]


@dataclass(frozen=True, eq=False)
class DescentEnds:
    """Where descents by least squares ended.

    Attributes
    ----------
    records : Records
        The events, their voltages smoothed.
    likelihood : Likelihood
        That of the least squares, driven by these.
    descent : Descent
        Coordinates (n, d) and sums of squares (n,).
    origins : n texts
        Where each began.
    """

    records: Records
    likelihood: Likelihood
    descent: Descent
    origins: tuple[str, ...]

    @property
    def lowest(self) -> float:
        """The least deviance that a descent ended at; inf without one."""
        return float(self.descent.deviance.min(initial=np.inf))

    @property
    def best(self) -> np.ndarray:
        """Coordinates (d,) of the least sum of squares."""
        return self.descent.best

    @property
    def near(self) -> np.ndarray:
        """Coordinates (at most 4, d) of distinct local minima that are not hopeless, the best
        first.
        """
        near = self.descent.deviance <= LARGEST_MINIMUM_RATIO * self.lowest
        return select_distinct(
            Descent(self.descent.unit[near], self.descent.deviance[near], 0), self.likelihood.free
        )

    def compute_input_modes(self, unit: np.ndarray) -> np.ndarray | None:
        """The errors of the records at coordinates (D,), as of `compute_input_modes`."""
        likelihood = self.likelihood
        return compute_input_modes(
            likelihood.problem, self.records.smoothed, likelihood.values(unit)
        )

    def join_descent(self, more: Descent, origin: str) -> "DescentEnds":
        """These and further ends of one origin."""
        return replace(
            self,
            descent=self.descent.join_descent(more),
            origins=(*self.origins, *[origin] * len(more.unit)),
        )

    def looked_beside(self) -> "DescentEnds":
        """These and the ends of descents from beside the best."""
        beside = place_along_least_certain(self.likelihood, self.best)
        return self.join_descent(self.likelihood.descent(beside), "beside the best")

    def no_worse(self, unit: np.ndarray) -> bool:
        """Whether coordinates (D,) of the likelihood fit as well by Eq. (8) as the best do, as far
        as chance explains.

        From the dips on: a load that swings before them makes a loud noise, to which a likelihood
        gives up too much.
        """
        squares = self.likelihood
        problem = self.likelihood.problem
        rows = squares.rows(np.stack([unit[: squares.free], self.best]))
        polished, least = (rows**2).reshape(2, problem.drive.channels, -1).sum(axis=1)
        return not exceeds(
            polished, least, cut_blocks(problem.events, problem.drive, 3, from_dip=True)
        )

    @property
    def starts(self) -> list[dict[str, Any]]:
        """What is told of them, the best first: where each began, "search", "box" or "beside the
        best"; its sum of squares above the best's, in mean squares of what the best leaves; and the
        parameters that it ended at, in their units.
        """
        values = self.likelihood.values(self.descent.unit)
        above = self.descent.deviance - self.lowest
        order = [k for k in np.argsort(above, kind="stable") if np.isfinite(above[k])]
        names = self.likelihood.problem.space.names
        return [
            {
                "from": self.origins[k],
                "above": float(above[k]),
                "parameters": dict(zip(names, values[k].tolist(), strict=True)),
            }
            for k in order
        ]


_remembered: OrderedDict[str, tuple[DescentEnds, EstimationResult]] = OrderedDict()


def estimate_without_search(problem: Problem) -> EstimationResult:
    """Estimate the parameters of a problem that was not searched, from all over its box.

    Parameters
    ----------
    problem : Problem
        The model on its events.

    Returns
    -------
    EstimationResult

    Raises
    ------
    UserError
        Where nothing of the box can be simulated.
    """
    _, best = _descend_from_box(problem)
    if best is None:
        raise UserError(
            f"no parameter set tried can be simulated before {problem.events[0].record.name}; give"
            " values by"
            f" {TASK.values}=<result.json>, or narrow {MODEL.bounds}"
        )
    return best


def estimate(problem: Problem, values: np.ndarray) -> EstimationResult:
    """Estimate the parameters of a problem whose search has ended.

    A robust loss takes samples more than `OUTLIER` standard deviations off the fit for outliers;
    what is left of the records is then fitted from where the search ended.

    Parameters
    ----------
    problem : Problem
        The model on its events.
    values : (d,)
        Free values at which the search ended.

    Returns
    -------
    EstimationResult
    """
    if not problem.loss.quadratic:
        return _estimate_robust(problem, values)
    ends, best = _descend_from_box(problem)
    own = ends.likelihood.descent(ends.likelihood.to_unit(values))
    whole = ends.join_descent(own, "search")
    if best is None or own.deviance[0] < ends.lowest - LEAST_MINIMUM_GAIN:
        return _choose_estimate(whole.looked_beside())
    return replace(best, starts=whole.starts)


def _estimate_robust(problem: Problem, values: np.ndarray) -> EstimationResult:
    """The estimate of a robust loss, from where the search ended."""
    records = Records.from_events(problem.events)
    smooth = problem.driven_by(records.events)
    squares = Likelihood.of_objective(smooth, float(smooth.objective(values[None])[0]))
    squares = drop_outliers(squares, squares.to_unit(values))
    ends = DescentEnds(records, squares, squares.descent(squares.to_unit(values)), ("search",))
    return _choose_estimate(ends.looked_beside(), robust=True)


def _descend_from_box(problem: Problem) -> tuple[DescentEnds, EstimationResult | None]:
    """The ends of descents from all over the box, and the estimate that they give; None where none
    can be simulated.
    """
    events = [
        (e.record.name, e.start, e.end, e.steady, e.noise_P, e.noise_Q) for e in problem.events
    ]
    key = f"{problem.digest()} {events}"
    if key not in _remembered:
        records = Records.from_events(problem.events)
        likelihood, result = search_box(problem.driven_by(records.events))
        ends = DescentEnds(records, likelihood, result, ("box",) * len(result.unit))
        if not np.isfinite(ends.lowest):
            return ends, None
        ends = _rescale_ends(ends)
        for _ in range(ROUNDS_OF_NOISE):
            ends = _remove_offsets(ends)
        refined = ends.likelihood.descent(select_distinct(ends.descent, likelihood.free))
        ends = ends.join_descent(refined, "box").looked_beside()
        _remembered[key] = ends, _choose_estimate(ends)
        if len(_remembered) > REMEMBERED:
            _remembered.popitem(last=False)
    return _remembered[key]


def _rescale_ends(ends: DescentEnds) -> DescentEnds:
    """The ends in mean squares of what the best leaves: there a descent's tolerance means the same
    for any record.
    """
    variance = max(ends.lowest / ends.likelihood.samples, 1e-12)
    descent = replace(ends.descent, deviance=ends.descent.deviance / variance)
    return replace(ends, likelihood=ends.likelihood.scale_noise(np.sqrt(variance)), descent=descent)


def _remove_offsets(ends: DescentEnds) -> DescentEnds:
    """The ends of waveforms without what their channels' offsets do in the sum of squares; other
    ends as they are.

    Offsets of the currents, and of the voltage as the model passes them on, are larger than a
    model's error there.
    """
    problem = ends.likelihood.problem
    offsets = problem.domain.input_errors(problem, ends.likelihood.values(ends.best))
    if offsets is None:
        return ends
    squares = ends.likelihood
    likelihood = replace(squares, noise=replace(squares.noise, input_modes=offsets))
    return replace(ends, likelihood=likelihood, descent=likelihood.descent(ends.descent.unit))


def _choose_estimate(ends: DescentEnds, *, robust: bool = False) -> EstimationResult:
    """Least squares where more than noise is left, and the maximum of the likelihood of the noise
    elsewhere.
    """
    likelihood, units = _fit_under_noise(ends, robust=robust)
    surprising = run_residual_test(likelihood, units[0], ends.likelihood, ends.lowest)
    if not surprising.adequate:
        return _estimate_by_squares(ends, likelihood, surprising)
    modes = ends.compute_input_modes(units[0])
    whole = estimate_noise_at(likelihood, units[0], modes, whole=True)
    likelihood = replace(likelihood, noise=whole)  # nothing but noise is left: all of it tells
    result = likelihood.descent(units)
    best = int(result.deviance.argmin())
    if not ends.no_worse(result.unit[best]):
        return _estimate_by_squares(ends, likelihood, surprising)
    others = result.unit[np.arange(len(units)) != best]
    return EstimationResult(
        widen_by_local_minima(conclude(likelihood, result.unit[best]), others),
        surprising,
        ends.starts,
    )


def _estimate_by_squares(
    ends: DescentEnds, noise: Likelihood, seen: ResidualTest
) -> EstimationResult:
    """The minimum of Eq. (8) as the estimate; with priors that of Eq. (8) and what machines usually
    are.
    """
    uncertainty = conclude(ends.likelihood, ends.best, noise)
    near = ends.near
    if ends.likelihood.problem.priors:
        held = add_usual_prior(ends.likelihood)
        near = _find_prior_minima(held, near)
        uncertainty = conclude(
            held, near[0], noise, [describe_prior(held.problem, held.values(near[0]))]
        )
    return EstimationResult(widen_by_local_minima(uncertainty, near), seen, ends.starts)


def add_usual_prior(squares: Likelihood) -> Likelihood:
    """The likelihood whose rows are in units of what is left, with a prior.

    A block of samples counts as one row of the prior.
    """
    problem = squares.problem
    return replace(squares, prior=weigh_prior(problem.events, problem.drive, squares.free))


def _find_prior_minima(likelihood: Likelihood, near: np.ndarray) -> np.ndarray:
    """Coordinates (at most 4, d) of the local minima with a prior, from those without it and the
    usual.
    """
    space = likelihood.problem.space
    defaults = likelihood.problem.defaults
    starts = np.concatenate([near, space.to_unit(defaults)[None]])
    return select_distinct(
        likelihood.descent(np.concatenate([starts, explore_minima(likelihood).unit])),
        likelihood.free,
    )


def _fit_under_noise(ends: DescentEnds, *, robust: bool) -> tuple[Likelihood, np.ndarray]:
    """The likelihood of the noise that the fit leaves in quiet, and its maxima (n, D), the best
    first.
    """
    likelihood = ends.likelihood.with_initial_power
    units = likelihood.place_parameters(ends.near)
    input_modes = ends.compute_input_modes(units[0])
    for _ in range(ROUNDS_OF_NOISE):
        if robust:
            likelihood = drop_outliers(likelihood, units[:1])
        likelihood = replace(likelihood, noise=estimate_noise_at(likelihood, units[0], input_modes))
        result = likelihood.descent(units)
        order = np.argsort(result.deviance, kind="stable")
        units = result.unit[order[result.deviance[order] <= result.deviance.min() + BEHIND]]
    return likelihood, units


def widen_by_local_minima(uncertainty: Uncertainty, units: np.ndarray) -> Uncertainty:
    """The judgement with other local minima that the records do not rule out: intervals reach over
    them.

    A parameter that has another value at another minimum is not identified, however narrow either
    is.

    Parameters
    ----------
    uncertainty : Uncertainty
        The judgement of the best.
    units : (n, D)
        Coordinates of the others.

    Returns
    -------
    Uncertainty
    """
    rows = uncertainty.likelihood.rows(units) if len(units) else np.empty((0, 1))
    above = (rows**2).sum(axis=1) - uncertainty.deviance
    apart = np.abs(units - uncertainty.unit).max(axis=1, initial=0.0) > SAME_MINIMUM_DISTANCE
    beside = replace(uncertainty, local_minima=tuple(units[apart & (above < compute_threshold())]))
    verdicts = dict(uncertainty.verdicts)
    own = uncertainty.intervals
    for values in beside.values_elsewhere:
        for j in np.flatnonzero((values < own[:, 0]) | (values > own[:, 1])):
            name = uncertainty.names[j]
            verdicts[name] = verdicts[name].add_objection(
                f"another valley, at {values[j]:.4g}, fits as well"
            )
    return replace(beside, verdicts=verdicts)
