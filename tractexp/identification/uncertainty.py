"""How sure an identification is: the most likely values, their intervals, and a verdict for each parameter.

The search minimizes Eq. (8). From where it ended, damped least squares climb to the maximum of the likelihood
(`likelihood`), whose noise is estimated on the way; its curvature there gives everything else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tractexp.identification.descent import Rows, descend
from tractexp.identification.information import Information
from tractexp.identification.likelihood import QUIET_ORDER, Likelihood
from tractexp.identification.problem import Problem
from tractexp.identification.residual_tests import Test, jarque_bera, ljung_box, louder
from tractexp.identification.verdict import Verdict, judge
from tractexp.noise.color import FEWEST, fit_autoregression, stretches, white_noise
from tractexp.noise.model import Noise, Pair

LEVEL = 0.95
ALONG = (0.3, 0.6, 0.9)  # of the way to the wall: where other valleys are looked for
OUTLIER = 5.0  # robust standard deviations from which a robust loss takes a sample for an outlier
DISAGREES = 0.01  # p-value below which an event does not fit with the others


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

    @property
    def names(self) -> tuple[str, ...]:
        return self.information.names

    @property
    def values(self) -> np.ndarray:
        """The most likely values."""
        return self.information.values

    @property
    def intervals(self) -> np.ndarray:
        """(d, 2), 95 %, inside the bounds: by profile where there is one, else by the curvature."""
        ends = self.values[:, None] + self.half[:, None] * [-1.0, 1.0]
        for name, interval in self.profiled.items():
            ends[self.names.index(name)] = interval
        return np.clip(ends, self.lower[:, None], self.upper[:, None])

    def fields(self, together: "Together | None" = None, notes: Sequence[str] = ()) -> dict[str, Any]:
        """What `result.json` gains; numbers that do not exist are None. `notes` are added to our own."""
        number = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731
        errors = self.information.standard_errors
        pairs = zip(self.names, self.intervals.tolist(), strict=True)
        return {
            "standard_errors": {n: number(e) for n, e in zip(self.names, errors, strict=True)},
            "intervals": dict(pairs),
            "verdicts": {name: str(verdict) for name, verdict in self.verdicts.items()},
            "uncertainty": {
                "level": LEVEL,
                "most_likely": dict(zip(self.names, self.values.tolist(), strict=True)),
                "correlation": self.information.correlation.tolist(),
                "profiled": list(self.profiled),
                "noise": self.noise,
                "tests": self.tests,
                "notes": [*self.notes, *(together.notes if together else []), *notes],
                "gains": together.fields() if together else {},
                "odd_events": together.odd if together else [],
            },
        }


def assess(problem: Problem, values: np.ndarray, robust: bool = False) -> Uncertainty:
    """Everything above for a problem whose search ended at free `values` (free,).

    `robust` leaves samples out that lie more than `OUTLIER` standard deviations off the fit, as a robust loss does.
    """
    likelihood = Likelihood.of(problem)
    unit = likelihood.to_unit(values)
    if robust:
        likelihood = cleaned(likelihood, unit)
    unit = valleys(likelihood, descend(likelihood.rows, unit).unit[0])[None]
    for _ in range(2):
        if robust:
            likelihood = cleaned(likelihood, unit)
        likelihood = replace(likelihood, noise=noise_of(likelihood, likelihood.residuals(unit)[0]))
        unit = descend(likelihood.rows, unit).unit
    likelihood, notes = widened(likelihood, likelihood.residuals(unit)[0])
    found = descend(likelihood.rows, unit)
    return conclude(likelihood, found.unit[0], notes)


def valleys(likelihood: Likelihood, unit: np.ndarray) -> np.ndarray:
    """The best optimum (D,) along the direction that the records know least, through the optimum `unit` (D,).

    A search may end in one of several valleys: where q_v is near 2, for instance, the static load takes over the
    motor's U²/X' and any C will do, so that there is one valley on either side of it.
    """
    _, J = likelihood.jacobian(unit)
    direction = np.linalg.svd(J[:, : likelihood.free], full_matrices=False)[2][-1]
    starts = [unit]
    for way in (direction, -direction):
        room = np.where(way > 0, 1 - unit[: len(way)], unit[: len(way)]) / np.maximum(np.abs(way), 1e-12)
        for share in ALONG:
            starts.append(unit.copy())
            starts[-1][: len(way)] += share * room.min() * way
    found = descend(likelihood.rows, np.array(starts))
    return found.unit[found.deviance.argmin()]


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


def cleaned(likelihood: Likelihood, unit: np.ndarray) -> Likelihood:
    """The likelihood without the samples beyond `OUTLIER` robust standard deviations of the fit at `unit` (1, D)."""
    drive = likelihood.problem.drive
    known = drive.weights > 0
    residuals = np.abs(replace(likelihood, known=known).residuals(unit)[0])
    for e in range(drive.events):
        for c in range(2):
            part = drive.part(e)
            seen = residuals[c, part][known[c, part]]
            if len(seen):
                known[c, part] &= residuals[c, part] <= max(OUTLIER * 1.4826 * float(np.median(seen)), 1e-12)
    return replace(likelihood, known=known)


def noise_of(likelihood: Likelihood, residuals: np.ndarray) -> Noise:
    """An autoregression of each event's and channel's residual (2, N); what the fit has absorbed is given back."""
    drive = likelihood.problem.drive
    absorbed = likelihood.free + 2 * drive.events
    back = np.sqrt(likelihood.samples / max(likelihood.samples - absorbed, 1))
    pairs: list[Pair] = []
    for e in range(drive.events):
        part, pair = drive.part(e), []
        for c in range(2):
            pieces = stretches(residuals[c, part], likelihood.known[c, part])
            enough = sum(map(len, pieces)) >= FEWEST
            pair.append(fit_autoregression(pieces).scaled(back) if enough else white_noise(1.0))
        pairs.append((pair[0], pair[1]))
    return Noise(tuple(pairs))


def widened(likelihood: Likelihood, residuals: np.ndarray) -> tuple[Likelihood, list[str]]:
    """The likelihood with louder noise where the model does not fit down to the noise, and sentences that say so.

    A residual in the dip that cannot come from the noise before it is no noise. Then its level there, rather than
    its mean, sets the intervals: wider, though still blind to a bias.
    """
    notes: list[str] = []
    pairs: list[Pair] = []
    for e, event in enumerate(likelihood.problem.events):
        pair = []
        for c, channel in enumerate("PQ"):
            noise = likelihood.noise.pair(e)[c]
            ratio, level = misfit(likelihood, residuals[c], e, c)
            if ratio is not None:
                noise = noise.scaled(max(1.0, level))
                notes.append(
                    f"{event.record.name}: what the model leaves of {channel} in the dip is {ratio:.2g} times what the"
                    " noise before it explains: an effect is missing, and the intervals, though wider for it, may miss"
                    " the truth"
                )
            pair.append(noise)
        pairs.append((pair[0], pair[1]))
    return replace(likelihood, noise=Noise(tuple(pairs))), notes


def misfit(likelihood: Likelihood, residual: np.ndarray, e: int, c: int) -> tuple[float | None, float]:
    """How much louder the residual (N,) of channel `c` is from the dip on than the noise before it explains.

    Both are prediction errors of an autoregression fitted before the dip; None where chance explains it, or there
    are too few samples. With it the level of the whole residual's prediction errors in the dip, in their deviations.
    """
    event, part = likelihood.problem.events[e], likelihood.problem.drive.part(e)
    residual, known = residual[part], likelihood.known[c, part]
    before, dip = event.steady, slice(event.start, min(2 * event.end - event.start, event.record.samples))
    if min(np.count_nonzero(known[before]), np.count_nonzero(known[dip])) < FEWEST:
        return None, 1.0
    quiet = fit_autoregression(stretches(residual[before], known[before]), QUIET_ORDER).whiten(residual, known)
    own = likelihood.noise.pair(e)[c].whiten(residual, known)[dip][known[dip]]
    inside, outside = quiet[dip][known[dip]], quiet[before][known[before]]
    ratio = float(np.sqrt(np.mean(inside**2) / np.mean(outside**2))) if louder(inside, outside) else None
    return ratio, float(np.sqrt(np.mean(own**2)))


def test(likelihood: Likelihood, rows: np.ndarray) -> list[dict[str, Any]]:
    """Whiteness and normality of the whitened residuals (2 N,) of each event and channel."""
    drive, white = likelihood.problem.drive, rows.reshape(2, -1)
    results = []
    for e, event in enumerate(likelihood.problem.events):
        part = drive.part(e)
        for c, channel in enumerate("PQ"):
            seen = white[c, part][likelihood.known[c, part]]
            if len(seen) < FEWEST:
                continue
            order = likelihood.noise.pair(e)[c].order
            tests: list[Test] = [ljung_box(seen, order), jarque_bera(seen)]
            results += [{"event": event.record.name, "channel": channel, **vars(t)} for t in tests]
    return results


def describe_noise(likelihood: Likelihood) -> list[dict[str, Any]]:
    """Level [pu] and color of the noise of each event and channel, with the level before the dip beside it."""
    rows = []
    for e, event in enumerate(likelihood.problem.events):
        for channel, noise, before in zip("PQ", likelihood.noise.pair(e), (event.noise_P, event.noise_Q), strict=True):
            rows.append(
                {
                    "event": event.record.name,
                    "channel": channel,
                    "deviation": float(noise.deviation[0]),
                    "before": float(before),
                    "order": noise.order,
                    "correlation": 0.0 if noise.white else float(noise.coefficients[1, 0]),
                }
            )
    return rows


@dataclass(frozen=True, eq=False)
class Together:
    """What each of several events adds. `gains` {event: {name: width of the interval without it over with it}}."""

    gains: dict[str, dict[str, float]]
    odd: list[str]
    notes: list[str]

    def fields(self) -> dict[str, dict[str, float | None]]:
        """The gains for a JSON file: None where a parameter is not identifiable without the event."""
        kept = lambda ratio: ratio if np.isfinite(ratio) else None  # noqa: E731
        return {event: {name: kept(ratio) for name, ratio in gain.items()} for event, gain in self.gains.items()}


def compare_events(known: Uncertainty) -> Together:
    """Each event's share in the precision, and the events that do not fit with the rest (deviance test)."""
    likelihood = known.likelihood
    _, J = likelihood.jacobian(known.unit)
    free, errors = likelihood.free, known.information.standard_errors
    gains: dict[str, dict[str, float]] = {}
    for e, event in enumerate(likelihood.problem.events):
        rest = J * ~likelihood.part_of(e)[:, None]
        without = Information.of(known.names, known.values, known.upper - known.lower, rest[:, :free], rest[:, free:])
        ratio = without.standard_errors / errors
        gains[event.record.name] = dict(zip(known.names, ratio.tolist(), strict=True))
    odd, notes = disagreeing(known)
    return Together(gains, odd, notes)


def disagreeing(known: Uncertainty) -> tuple[list[str], list[str]]:
    """Events that separate parameters fit much better than shared ones do, the worst first, one at a time.

    Compares the deviance of all events fitted together with that of the rest plus that of the event alone; the
    difference is chi-squared with as many degrees of freedom as there are identifiable parameters.
    """
    from scipy.special import chdtri

    likelihood = known.likelihood
    left, odd, notes = list(range(likelihood.problem.drive.events)), [], []
    freedom = max(int(np.count_nonzero(known.information.identifiable)), 1)
    name = lambda e: likelihood.problem.events[e].record.name  # noqa: E731
    while len(left) > 1:
        groups = [left, *([o for o in left if o != e] for e in left), *([e] for e in left)]
        deviance = descend(only(likelihood, groups), np.tile(known.unit, (len(groups), 1))).deviance
        n = len(left)
        excess = deviance[0] - deviance[1 : n + 1] - deviance[n + 1 :]
        worst = int(excess.argmax())
        limit = float(chdtri(freedom, DISAGREES / n))
        if excess[worst] <= limit:
            break
        measured = f"deviance higher by {excess[worst]:.3g} where {limit:.3g} is the limit of chance"
        if n == 2:
            odd += [name(e) for e in left if name(e) not in odd]
            notes.append(f"{name(left[0])} and {name(left[1])} do not fit together: {measured}")
            break
        odd.append(name(left[worst]))
        notes.append(f"{name(left[worst])} does not fit with the rest: {measured}")
        del left[worst]
    return odd, notes


def only(likelihood: Likelihood, groups: Sequence[Sequence[int]]) -> Rows:
    """Rows in which lane k counts the events of `groups[k]` alone."""
    parts = np.array([likelihood.part_of(e) for e in range(likelihood.problem.drive.events)])
    masks = np.array([parts[list(group)].any(axis=0) for group in groups])

    def rows(unit: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        return likelihood.rows(unit) * masks[lanes]

    return rows
