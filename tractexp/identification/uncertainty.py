"""How sure an estimate is, in intervals and verdicts.

Where nothing but noise is left, by the curvature of the likelihood at its maximum; else by the
scatter of least squares (`sandwich`), under which the likelihood of everything that follows is as
wide.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.identification.verdict import ParameterVerdict, judge
from tractexp.inference.differences import CENTRAL
from tractexp.inference.information import Information
from tractexp.inference.interval import INTERVAL_LEVEL, compute_interval_factor
from tractexp.inference.least_squares import Descent
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem
from tractexp.inference.residual_tests import run_jarque_bera, run_ljung_box
from tractexp.inference.sandwich import estimate_scatter
from tractexp.inference.separable import Sensitivities
from tractexp.noise.color import FEWEST_NOISE_SAMPLES
from tractexp.storage import files

if TYPE_CHECKING:
    from tractexp.identification.rivals import RivalStructure

OTHERS_ITERATIONS = 25  # of descents of another problem on the same events


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """What is known about d free parameters.

    Intervals, profiles and samples stand on `likelihood`. Where more than noise is left that is Eq.
    (8), as wide as the estimate scatters.

    Attributes
    ----------
    likelihood : Likelihood
        What the intervals stand on.
    unit : (D,)
        Coordinates of its maximum.
    deviance : float
        There.
    information : Information
        Sensitivities and covariance.
    lower, upper : (d,)
        Bounds, in physical units.
    factors : (d,)
        Half of a 95 % interval over the standard error.
    limits : (d,)
        What the deviance may rise by within the interval.
    verdicts : {name: ParameterVerdict}
        What each interval means.
    of_noise : Likelihood
        That of the noise.
    notes : list of str
        What happened on the way.
    profiled : {name: (lower, upper)}
        Intervals by profile, which replace those by curvature.
    local_minima : tuple of (D,) arrays
        Coordinates of others that fit as well.
    rivals : tuple of RivalStructure
        Structures that fit as well.
    unrecorded : {channel: dict}
        Inputs that the records lack, as of `add_unrecorded`.
    """

    likelihood: Likelihood
    unit: np.ndarray  # (D,) its maximum
    deviance: float
    information: Information
    lower: np.ndarray  # bounds
    upper: np.ndarray
    factors: np.ndarray  # half of the 95 % interval over the standard error
    limits: np.ndarray  # what the deviance may rise by within the interval
    verdicts: dict[str, ParameterVerdict]
    of_noise: Likelihood
    notes: list[str]
    # intervals that replace the curvature's
    profiled: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    local_minima: tuple[np.ndarray, ...] = ()  # others that fit as well
    rivals: "tuple[RivalStructure, ...]" = ()  # structures that fit as well
    # inputs that the records lack, by channel
    unrecorded: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def elsewhere(self) -> np.ndarray:
        """Whether another local minimum has a value (d,) beyond the interval by curvature."""
        return np.any(np.abs(self.values_elsewhere - self.values) > self.half, axis=0)

    @property
    def values_elsewhere(self) -> np.ndarray:
        """The free values (n, d) at the other local minima."""
        return self.likelihood.values(np.array(self.local_minima).reshape(-1, len(self.unit)))

    @property
    def half(self) -> np.ndarray:
        """Half of the 95 % interval by curvature (d,), in physical units; inf where not
        identifiable.
        """
        return self.factors * self.information.standard_errors

    def descend_in(self, problem: Problem, points: np.ndarray) -> tuple[Likelihood, Descent]:
        """The ends of descents of another problem on the same events, whose rows count as this
        estimate's do.

        Parameters
        ----------
        problem : Problem
            With other parameters or bounds.
        points : (n, d)
            Its free values in the unit cube to begin at; P0 and Q0, where they are free, begin as
            estimated.

        Returns
        -------
        Likelihood
            Of that problem.
        Descent
        """
        likelihood = replace(self.likelihood, problem=problem)
        start = likelihood.place_parameters(np.clip(points, 0.0, 1.0))
        if self.exact:
            start[:, likelihood.free :] = self.unit[self.likelihood.free :]
        return likelihood, likelihood.descent(start, iterations=OTHERS_ITERATIONS, tolerance=0.01)

    @property
    def exact(self) -> bool:
        """Whether nothing but noise is left, so that the likelihood is that of the noise."""
        return self.likelihood.initial_power

    @functools.cached_property
    def sensitivities(self) -> tuple[np.ndarray, Sensitivities]:
        """The whitened residual (R,) of the estimate, and its derivatives."""
        return self.likelihood.of_records.jacobian(self.unit)

    @functools.cached_property
    def whitened_residual(self) -> np.ndarray:
        """The residual of the estimate over the noise, (2 N,)."""
        return self.of_noise.rows(
            self.unit[None] if self.exact else self.of_noise.place_parameters(self.unit[None])
        )[0]

    @functools.cached_property
    def tests(self) -> list[dict[str, Any]]:
        """Whiteness and normality of the whitened residual of each event and channel."""
        problem = self.of_noise.problem
        valid = self.of_noise.valid
        white = self.whitened_residual.reshape(problem.drive.channels, -1)
        results = []
        for e, event in enumerate(problem.events):
            part = problem.drive.part(e)
            for c, channel in enumerate(problem.drive.names):
                seen = white[c, part][valid[c, part]]
                if len(seen) < FEWEST_NOISE_SAMPLES:
                    continue
                tests = (
                    run_ljung_box(seen, self.of_noise.noise.pair(e)[c].order),
                    run_jarque_bera(seen),
                )
                results += [
                    {"event": event.record.name, "channel": channel, **told} for told in tests
                ]
        return results

    @functools.cached_property
    def noise(self) -> list[dict[str, Any]]:
        """Level [pu] and color of the noise of each event and channel, with the level before the
        dip beside it.
        """
        rows, noise, problem = [], self.of_noise.noise, self.of_noise.problem
        for e, event in enumerate(problem.events):
            pair = noise.pair(e)
            covariance = noise.covariance(e)
            cross = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
            for c, (channel, before) in enumerate(
                zip(problem.drive.names, event.levels, strict=True)
            ):
                rows.append(
                    {
                        "event": event.record.name,
                        "channel": channel,
                        "deviation": float(np.sqrt(covariance[c, c])),
                        "before": float(before),
                        "order": pair[c].order,
                        "correlation": 0.0
                        if pair[c].white
                        else float(pair[c].coefficients[1, 0].real),
                        "between_P_and_Q": float(cross),
                        "wanders": noise.random_walk is not None,
                        "of_the_voltage": float(np.sqrt(noise.loudest_input_mode)),
                    }
                )
        return rows

    @property
    def names(self) -> tuple[str, ...]:
        """The free parameters, in the problem's order."""
        return self.information.names

    @property
    def values(self) -> np.ndarray:
        """The most likely values."""
        return self.information.values

    @property
    def intervals(self) -> np.ndarray:
        """The 95 % intervals (d, 2) in physical units, inside the bounds: by profile where there is
        one, else by the curvature.

        Where another local minimum fits as well, they reach over it, too. Where more than noise is
        left, so do they over what each rival structure makes of a parameter, as far beyond it as
        beyond the estimate, and over what inputs that were not recorded move it by.
        """
        ends = self.values[:, None] + self.half[:, None] * [-1.0, 1.0]
        for name, interval in self.profiled.items():
            ends[self.names.index(name)] = interval
        for values in self.values_elsewhere:
            low, high = ends.T
            ends = np.stack([np.minimum(low, values), np.maximum(high, values)], axis=1)
        own = ends.copy()
        for rival in () if self.exact else self.rivals:
            there = [
                rival.values.get(n, value)
                for n, value in zip(self.names, self.values.tolist(), strict=True)
            ]
            there = own + (np.array(there) - self.values)[:, None]
            ends = np.stack(
                [np.fmin(ends[:, 0], there[:, 0]), np.fmax(ends[:, 1], there[:, 1])], axis=1
            )
        for missing in self.unrecorded.values():
            moves = np.array([missing["moves"][name] for name in self.names])
            ends = ends + moves[:, None] * [-1.0, 1.0]
        return np.clip(ends, self.lower[:, None], self.upper[:, None])

    @property
    def samples(self) -> dict[str, int]:
        """How much the fit stands on: `samples` values compared, `parameters` searched, what is
        left of freedom.
        """
        compared = self.likelihood.samples
        return {
            "samples": compared,
            "parameters": len(self.names),
            "freedom": compared - len(self.unit),
        }

    def fields(self) -> dict[str, Any]:
        """What `result.json` gains; numbers that do not exist are None."""
        errors = self.information.standard_errors
        pairs = zip(self.names, self.intervals.tolist(), strict=True)
        return {
            "standard_errors": files.make_plain(dict(zip(self.names, errors, strict=True))),
            "intervals": dict(pairs),
            "verdicts": {name: str(verdict) for name, verdict in self.verdicts.items()},
            "uncertainty": {
                "level": INTERVAL_LEVEL,
                "names": list(self.names),
                "correlation": self.information.correlation.tolist(),
                **self.samples,
                "profiled": list(self.profiled),
                "noise": self.noise,
                "tests": self.tests,
                "notes": list(self.notes),
            },
        }


def compute_threshold() -> float:
    """What the deviance may rise by within a 95 % interval: the chi-squared quantile of one degree
    of freedom.

    Examples
    --------
    >>> round(compute_threshold(), 2)
    3.84
    """
    from scipy.special import chdtri

    return float(chdtri(1, 1 - INTERVAL_LEVEL))


def conclude(
    likelihood: Likelihood,
    unit: np.ndarray,
    noise: Likelihood | None = None,
    notes: Sequence[str] = (),
) -> Uncertainty:
    """The intervals and verdicts of an estimate.

    Parameters
    ----------
    likelihood : Likelihood
        That of the noise, or Eq. (8) where more than noise is left.
    unit : (D,)
        Coordinates of its optimum.
    noise : Likelihood or None
        That of the noise, where `likelihood` is not.
    notes : texts
        What happened on the way.

    Returns
    -------
    Uncertainty
    """
    problem = likelihood.problem
    likelihood, deviance, information, factors, limits = (
        _spread_by_curvature(likelihood, unit)
        if likelihood.initial_power
        else _spread_by_scatter(likelihood, unit)
    )
    information = replace(
        information, held=_find_immovable_parameters(likelihood, unit, information.blind)
    )
    verdicts = judge(
        information, problem.lower, problem.upper, factors * information.standard_errors, factors
    )
    return Uncertainty(
        likelihood,
        unit,
        deviance,
        information,
        problem.lower,
        problem.upper,
        factors,
        limits,
        verdicts,
        noise or likelihood,
        list(notes),
    )


def _find_immovable_parameters(
    likelihood: Likelihood, unit: np.ndarray, names: Sequence[str]
) -> tuple[str, ...]:
    """Those of the parameters that no step from coordinates (D,) to either side leaves a steady
    state.
    """
    all_names = likelihood.problem.space.names

    def possible(name: str) -> bool:
        sides = np.tile(unit, (2, 1))
        sides[:, all_names.index(name)] += CENTRAL, -CENTRAL
        sides = np.array([side for side in sides if np.array_equal(side, side.clip(0.0, 1.0))])
        return bool(np.isfinite(likelihood.residuals(sides)).all(axis=(1, 2)).any())

    return tuple(name for name in names if not possible(name))


# with deviance, factors (d,) and limits (d,)
Spread = tuple[Likelihood, float, Information, np.ndarray, np.ndarray]


def _spread_by_curvature(likelihood: Likelihood, unit: np.ndarray) -> Spread:
    """How far the maximum of a likelihood spreads, by its curvature."""
    problem = likelihood.problem
    free = likelihood.free
    rows, J = likelihood.jacobian(unit)
    width = problem.upper - problem.lower
    information = Information(problem.space.names, likelihood.values(unit), width, J.without_own)
    factor = compute_interval_factor(likelihood.samples - len(unit))
    return (
        likelihood,
        float(rows @ rows),
        information,
        np.full(free, factor),
        np.full(free, compute_threshold()),
    )


def _spread_by_scatter(squares: Likelihood, unit: np.ndarray) -> Spread:
    """How far least squares spread, by their scatter over blocks, and the likelihood that is as
    wide.
    """
    left = float(np.sum(squares.of_records.rows(unit[None])[0] ** 2)) / max(
        squares.samples - len(unit), 1
    )
    information, quantile, ratio, spread = estimate_scatter(
        squares.scale_noise(np.sqrt(left)), unit
    )
    likelihood = squares.scale_noise(np.sqrt(left) * spread)
    rows = likelihood.rows(unit[None])[0]
    factors = np.full(len(unit), quantile)
    limits = (factors * ratio / spread) ** 2
    return likelihood, float(rows @ rows), information, factors, limits
