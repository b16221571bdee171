"""How a quantity of a load differs from dip to dip: by hour, by weekday, by season, over the years,
and by chance.

    y = mean + hour + weekday + season + trend + u + error,   u ~ N(0, spread²)

The coefficients of each term scatter about zero, by as much as makes the values seen most likely
(empirical Bayes): a term that the dips do not show vanishes by itself, and one that few dips show
is drawn towards the mean. Source: Searle, Casella and McCulloch 1992, ch. 6 and 7.
"""

import datetime
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.inference.interval import compute_interval_factor

HOUR, WEEKDAY, SEASON, YEAR = TERMS = ("hour", "weekday", "season", "year")
WEEKDAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")
MONTHS = "January February March April May June July August September October November December"
FEWEST_DATED = 8  # dips with a time from which terms are sought
# twice the logarithm of the likelihood that a term adds from which it is told: 1 % of chance for a
# variance that cannot be negative
LEAST_TERM = 5.41
ANYWHERE = 1e3  # times the scatter of what is seen: where the mean may be
NARROWEST, WIDEST = 1e-3, 3.0  # times it: how far coefficients and single dips may scatter
LEAST_SCATTER = 1e-6
DAYS_A_YEAR = 365.25  # of a year
UNKNOWN_SPREAD = 0.1  # pu: of one dip alone nobody knows how far the next is from it


@dataclass(frozen=True, eq=False)
class Composition:
    """What is known of a quantity of a load, such as the share of its motors.

    Attributes
    ----------
    coefficients : (p,)
        Of the columns of `describe_times`, the mean first.
    covariance : (p, p)
        Of the coefficients.
    spread : float
        Standard deviation from dip to dip beside them.
    start : datetime or None
        From when years count; None where too few dips have a time.
    """

    coefficients: np.ndarray
    covariance: np.ndarray
    spread: float
    start: datetime.datetime | None

    def predict(self, times: Sequence[datetime.datetime | None]) -> tuple[np.ndarray, np.ndarray]:
        """The values to be expected.

        Parameters
        ----------
        times : n times
            None stands for a time that is not known: the mean.

        Returns
        -------
        (n,) array
            Expected values.
        (n,) array
            Their standard errors.
        """
        X = describe_times(times, self.start)[:, : len(self.coefficients)]
        errors = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", X, self.covariance, X), 0.0))
        return X @ self.coefficients, errors

    def tabulate(self, term: str) -> list[dict[str, Any]]:
        """The rows of a term.

        Parameters
        ----------
        term : str
            "hour", "weekday", "season" or "year".

        Returns
        -------
        list of dict
            `at`, the expected `value` with everything else in the mean, and its 95 % interval,
            `low` and `high`.
        """
        labels, X = _describe_grid(term)
        X = X[:, : len(self.coefficients)]
        values = X @ self.coefficients
        half = compute_interval_factor() * np.sqrt(np.einsum("ni,ij,nj->n", X, self.covariance, X))
        return [
            {"at": at, "value": float(v), "low": float(v - h), "high": float(v + h)}
            for at, v, h in zip(labels, values, half, strict=True)
        ]


def describe_times(
    times: Sequence[datetime.datetime | None], start: datetime.datetime | None
) -> np.ndarray:
    """The columns of times by which a quantity is told.

    Parameters
    ----------
    times : n times
        None: not known, so that it counts as the mean of all.
    start : datetime or None
        From when years count.

    Returns
    -------
    (n, 15) array
        1; two harmonics of the day; the seven weekdays; one harmonic of the year; years since
        `start`.

    Examples
    --------
    >>> monday = datetime.datetime(2024, 1, 1, 6)
    >>> describe_times([monday], monday)[0, :7].round(6).tolist()
    [1.0, 0.0, -1.0, 1.0, 0.0, 1.0, 0.0]
    """
    return np.array([_describe_time(moment, start) for moment in times])


def _describe_time(
    moment: datetime.datetime | None, start: datetime.datetime | None
) -> list[float]:
    row = np.zeros(15)
    row[0] = 1.0
    if moment is None or start is None:
        return row.tolist()
    hour = moment.hour + moment.minute / 60 + moment.second / 3600
    row[1:5] = _compute_harmonics(hour / 24, 2)
    row[5 + moment.weekday()] = 1.0
    row[12:14] = _compute_harmonics(moment.timetuple().tm_yday / DAYS_A_YEAR, 1)
    row[14] = (moment - start).total_seconds() / 86400 / DAYS_A_YEAR
    return row.tolist()


def _compute_harmonics(turn: float, count: int) -> np.ndarray:
    angles = 2 * np.pi * turn * np.arange(1, count + 1)
    return np.concatenate([np.cos(angles), np.sin(angles)])


COLUMNS = {HOUR: slice(1, 5), WEEKDAY: slice(5, 12), SEASON: slice(12, 14), YEAR: slice(14, 15)}


def _describe_grid(term: str) -> tuple[Sequence[str], np.ndarray]:
    """Labels and columns (n, 15) at which a term is told."""
    labels: Sequence[str]
    if term == HOUR:
        labels = [f"{hour:02d}:30" for hour in range(24)]
        points = [_compute_harmonics((hour + 0.5) / 24, 2) for hour in range(24)]
    elif term == WEEKDAY:
        labels = list(WEEKDAYS)
        points = list(np.eye(7))
    elif term == SEASON:
        labels = MONTHS.split()
        points = [_compute_harmonics((month + 0.5) / 12, 1) for month in range(12)]
    else:
        labels = ["first", "a year later"]
        points = [np.array([0.0]), np.array([1.0])]
    X = np.zeros((len(labels), 15))
    X[:, 0] = 1.0
    X[:, COLUMNS[term]] = points
    return labels, X


def estimate_composition(
    values: np.ndarray, errors: np.ndarray, times: Sequence[datetime.datetime | None]
) -> Composition:
    """Estimate how a quantity differs from dip to dip.

    Parameters
    ----------
    values, errors : (n,)
        The quantity at each dip, and its standard errors.
    times : n times
        When the dips were; None: not known.

    Returns
    -------
    Composition
    """
    seen = _Seen.from_values(values, errors, times)
    _, deviations, spread = seen.find_most_likely(seen.terms)
    coefficients, covariance = seen.solve(deviations, spread)
    return Composition(
        coefficients,
        covariance,
        spread,
        seen.start,
    )


def find_terms(
    values: np.ndarray, errors: np.ndarray, times: Sequence[datetime.datetime | None]
) -> list[str]:
    """Which of the terms hour, weekday, season and year the values depend on beyond chance.

    A likelihood-ratio test of each: twice the logarithm of the likelihood that is lost without the
    term, all others kept, is above `LEAST_TERM` (1 % of chance).

    Parameters
    ----------
    values, errors : (n,)
        The quantity at each dip, such as the share of its motors, and its standard errors.
    times : n times
        When the dips were; None: not known.

    Returns
    -------
    list of str
        Names out of `TERMS`.
    """
    seen = _Seen.from_values(values, errors, times)
    with_all = seen.find_most_likely(seen.terms)[0]
    without = {
        term: seen.find_most_likely([t for t in seen.terms if t != term])[0] for term in seen.terms
    }
    return [term for term, likely in without.items() if 2 * (with_all - likely) > LEAST_TERM]


def shrink(
    values: np.ndarray, errors: np.ndarray, expected: np.ndarray, spread: float
) -> tuple[np.ndarray, np.ndarray]:
    """Draw values towards what is expected of them, as far as their errors exceed the spread.

    Parameters
    ----------
    values, errors : (n,)
        Of each dip by itself.
    expected : (n,)
        By all dips together.
    spread : float
        Standard deviation from dip to dip.

    Returns
    -------
    (n,) array
        The values drawn.
    (n,) array
        Their standard errors.

    Examples
    --------
    >>> drawn, error = shrink(np.array([0.8]), np.array([0.1]), np.array([0.6]), 0.1)
    >>> drawn.round(3).tolist(), error.round(4).tolist()
    ([0.7], [0.0707])
    """
    own = spread**2 / np.maximum(spread**2 + errors**2, 1e-30)
    drawn = expected + own * (values - expected)
    return drawn, np.sqrt(own) * errors


@dataclass(frozen=True, eq=False)
class _Seen:
    """Values (n,) that were seen, with their errors and columns X (n, p).

    `scatter` is their standard deviation, which all other deviations are told in.
    """

    values: np.ndarray
    errors: np.ndarray
    X: np.ndarray
    scatter: float
    start: datetime.datetime | None

    @classmethod
    def from_values(
        cls, values: np.ndarray, errors: np.ndarray, times: Sequence[datetime.datetime | None]
    ) -> "_Seen":
        dated = [moment for moment in times if moment is not None]
        start = min(dated) if len(dated) >= FEWEST_DATED else None
        X = describe_times(times, start)
        scatter = float(np.std(values, ddof=1)) if len(values) > 1 else UNKNOWN_SPREAD
        X = X[:, :1] if start is None else X
        return cls(
            values,
            errors,
            X,
            max(scatter, LEAST_SCATTER),
            start,
        )

    @property
    def terms(self) -> Sequence[str]:
        return () if self.start is None else TERMS

    def find_most_likely(self, terms: Sequence[str]) -> tuple[float, np.ndarray, float]:
        """The log likelihood, the deviations (p,) of the coefficients and the spread that make the
        values most likely.
        """
        from scipy.optimize import minimize

        def lose(logs: np.ndarray) -> float:
            return -self.find_likelihood(*self.spell(logs, terms))

        room = [(np.log(NARROWEST), np.log(WIDEST))] * (1 + len(terms))
        start = np.log(np.r_[0.5, np.full(len(terms), 0.3)])
        best = minimize(lose, start, bounds=room, method="L-BFGS-B")
        return -float(best.fun), *self.spell(best.x, terms)

    def spell(self, logs: np.ndarray, terms: Sequence[str]) -> tuple[np.ndarray, float]:
        """Deviations (p,) and spread of logarithms of them, in units of the scatter."""
        deviations = np.zeros(self.X.shape[1])
        deviations[0] = ANYWHERE * self.scatter
        for term, log in zip(terms, logs[1:], strict=True):
            deviations[COLUMNS[term]] = self.scatter * np.exp(log)
        return deviations, self.scatter * float(np.exp(logs[0]))

    def find_likelihood(self, deviations: np.ndarray, spread: float) -> float:
        """The logarithm of the likelihood of the values, coefficients integrated out."""
        variance = self.errors**2 + spread**2
        scaled = self.X * deviations
        weights = (scaled / variance[:, None]).T
        inner = np.eye(len(deviations)) + weights @ scaled
        side = weights @ self.values
        told = side @ np.linalg.solve(inner, side)
        square = float(np.sum(self.values**2 / variance) - told)
        logs = float(np.sum(np.log(variance)))
        logs += float(np.linalg.slogdet(inner)[1])
        return -0.5 * (square + logs)

    def solve(self, deviations: np.ndarray, spread: float) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients (p,) and their covariance under that prior."""
        variance = self.errors**2 + spread**2
        scaled = self.X * deviations
        weights = (scaled / variance[:, None]).T
        inner = np.linalg.inv(np.eye(len(deviations)) + weights @ scaled)
        side = inner @ (weights @ self.values)
        covariance = deviations[:, None] * inner * deviations
        return deviations * side, covariance
