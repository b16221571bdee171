"""How sure an estimate is: the curvature of the likelihood at its maximum gives intervals and verdicts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tractexp.identification.information import Information
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.residual_tests import Test, jarque_bera, ljung_box
from tractexp.identification.verdict import Verdict, judge
from tractexp.noise.color import FEWEST

LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """What is known about the free parameters; arrays (d,) in the order of `names`."""

    likelihood: Likelihood
    unit: np.ndarray  # (D,) its maximum
    deviance: float
    information: Information
    lower: np.ndarray  # bounds
    upper: np.ndarray
    half: np.ndarray  # half of the 95 % interval, inf where not identifiable
    factor: float  # half over standard error
    verdicts: dict[str, Verdict]
    tests: list[dict[str, Any]]
    noise: list[dict[str, Any]]
    notes: list[str]
    profiled: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # intervals that replace the curvature's
    rivals: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # intervals of valleys that fit as well
    widened: float = 1.0  # by which the noise was made louder, because more than noise is left

    @property
    def names(self) -> tuple[str, ...]:
        return self.information.names

    @property
    def values(self) -> np.ndarray:
        """The most likely values."""
        return self.information.values

    @property
    def intervals(self) -> np.ndarray:
        """(d, 2), 95 %, inside the bounds: by profile where there is one, else by the curvature.

        Where another valley fits as well, they reach over it, too.
        """
        ends = self.values[:, None] + self.half[:, None] * [-1.0, 1.0]
        for name, interval in self.profiled.items():
            ends[self.names.index(name)] = interval
        for name, (low, high) in self.rivals.items():
            a, b = ends[self.names.index(name)]
            ends[self.names.index(name)] = min(a, low), max(b, high)
        return np.clip(ends, self.lower[:, None], self.upper[:, None])

    def fields(self) -> dict[str, Any]:
        """What `result.json` gains; numbers that do not exist are None."""
        number = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731
        errors = self.information.standard_errors
        pairs = zip(self.names, self.intervals.tolist(), strict=True)
        return {
            "standard_errors": {n: number(e) for n, e in zip(self.names, errors, strict=True)},
            "intervals": dict(pairs),
            "verdicts": {name: str(verdict) for name, verdict in self.verdicts.items()},
            "uncertainty": {
                "level": LEVEL,
                "correlation": self.information.correlation.tolist(),
                "profiled": list(self.profiled),
                "noise": self.noise,
                "tests": self.tests,
                "notes": list(self.notes),
            },
        }


def threshold(level: float = LEVEL) -> float:
    """What the deviance may rise by: the chi-squared quantile of one degree of freedom."""
    from scipy.special import chdtri

    return float(chdtri(1, 1 - level))


def conclude(likelihood: Likelihood, unit: np.ndarray, notes: Sequence[str] = ()) -> Uncertainty:
    """Intervals and verdicts at the maximum `unit` (D,) of a likelihood."""
    from scipy.special import stdtrit

    problem, free = likelihood.problem, likelihood.free
    rows, J = likelihood.jacobian(unit)
    width = problem.upper - problem.lower
    values = likelihood.values(unit)
    information = Information.of(problem.space.names, values, width, J[:, :free], J[:, free:])
    factor = float(stdtrit(max(likelihood.samples - len(unit), 1), (1 + LEVEL) / 2))
    half = factor * information.standard_errors
    return Uncertainty(
        likelihood=likelihood,
        unit=unit,
        deviance=float(rows @ rows),
        information=information,
        lower=problem.lower,
        upper=problem.upper,
        half=half,
        factor=factor,
        verdicts=judge(information, problem.lower, problem.upper, half, factor),
        tests=test(likelihood, rows),
        noise=describe_noise(likelihood),
        notes=list(notes),
    )


def test(likelihood: Likelihood, rows: np.ndarray) -> list[dict[str, Any]]:
    """Whiteness and normality of the whitened residuals (2 N,) of each event and channel."""
    drive = likelihood.problem.drive
    white = rows.reshape(drive.channels, -1)
    results = []
    for e, event in enumerate(likelihood.problem.events):
        part = drive.part(e)
        for c, channel in enumerate(drive.names):
            seen = white[c, part][likelihood.known[c, part]]
            if len(seen) < FEWEST:
                continue
            order = likelihood.noise.pair(e)[c].order
            tests: list[Test] = [ljung_box(seen, order), jarque_bera(seen)]
            results += [{"event": event.record.name, "channel": channel, **vars(t)} for t in tests]
    return results


def describe_noise(likelihood: Likelihood) -> list[dict[str, Any]]:
    """Level [pu] and color of the noise of each event and channel, with the level before the dip beside it."""
    rows, noise = [], likelihood.noise
    for e, event in enumerate(likelihood.problem.events):
        pair = noise.pair(e)
        covariance = noise.covariance(e)
        cross = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
        for c, (channel, before) in enumerate(zip(likelihood.problem.drive.names, event.levels, strict=True)):
            rows.append(
                {
                    "event": event.record.name,
                    "channel": channel,
                    "deviation": float(np.sqrt(covariance[c, c])),
                    "before": float(before),
                    "order": pair[c].order,
                    "correlation": 0.0 if pair[c].white else float(pair[c].coefficients[1, 0].real),
                    "between_P_and_Q": float(cross),
                    "wanders": noise.wander is not None,
                    "of_the_voltage": float(np.sqrt(noise.loudest_blur)),
                }
            )
    return rows
