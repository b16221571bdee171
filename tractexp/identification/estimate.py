"""The estimate: the most likely parameters, polished from wherever a search ended and from all over the box.

The search minimizes Eq. (8), which counts every sample alike and holds P0 and Q0 at the means before the dip. The
estimate is the maximum of the likelihood (`likelihood`) under the noise that the records show (`observed`): the same
for one set of records whatever was searched with, unless a search finds a valley that nothing else does.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.adequacy import Surprise, surprise
from tractexp.identification.descent import Descent, descend
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.observed import Observed
from tractexp.identification.problem import Problem
from tractexp.identification.uncertainty import Uncertainty, conclude, threshold
from tractexp.identification.valleys import along_least_known, distinct, explored
from tractexp.identification.verdict import IDENTIFIED, UNIDENTIFIED, WEAK, WITHIN, Verdict, size
from tractexp.noise.color import FEWEST, fit_autoregression, stretches, white_noise
from tractexp.noise.model import Noise, Pair

ROUNDS = 2  # of noise and fit in turn
HOPELESS = 1.3  # times the least deviance under the noise before the dips: valleys beyond it are given up
BEHIND = 25.0  # of the deviance under the noise found: valleys farther behind are
BETTER = 0.5  # of the deviance, by which a search's valley must be better than those of the box
OUTLIER = 5.0  # robust standard deviations from which a robust loss takes a sample for an outlier
REMEMBERED = 4  # problems whose valleys are kept: the jobs of a sweep share one


@dataclass(frozen=True, eq=False)
class Start:
    """One descent: where it began ("search", "box", "beside the best") and the parameters (d,) it ended at.

    `above` is its deviance above the best of all, under the noise before the dips.
    """

    origin: str
    values: np.ndarray
    above: float

    def told(self, names: Sequence[str]) -> dict[str, Any]:
        """As `result.json` has it."""
        return {
            "from": self.origin,
            "above": self.above,
            "parameters": dict(zip(names, self.values.tolist(), strict=True)),
        }


@dataclass(frozen=True, eq=False)
class Estimated:
    """An estimate, how surprising what it leaves is, and the valleys it was chosen from, the best first."""

    known: Uncertainty
    surprise: Surprise
    starts: tuple[Start, ...]


@dataclass(frozen=True, eq=False)
class Ends:
    """Where descents under the noise before the dips ended: coordinates (n, D), deviance (n,) and origins."""

    observed: Observed
    likelihood: Likelihood
    descent: Descent
    origins: tuple[str, ...]

    @property
    def lowest(self) -> float:
        return float(self.descent.deviance.min(initial=np.inf))

    def joined(self, more: Descent, origin: str) -> "Ends":
        """These and further ends of one origin."""
        unit = np.concatenate([self.descent.unit, more.unit])
        deviance = np.concatenate([self.descent.deviance, more.deviance])
        both = Descent(unit, deviance, self.descent.simulations + more.simulations)
        return replace(self, descent=both, origins=(*self.origins, *[origin] * len(more.unit)))

    def looked_beside(self) -> "Ends":
        """These and the ends of descents from beside the best."""
        best = self.descent.unit[self.descent.deviance.argmin()]
        beside = descend(self.likelihood.rows, along_least_known(self.likelihood, best), apart=self.likelihood.apart)
        return self.joined(beside, "beside the best")

    @property
    def starts(self) -> tuple[Start, ...]:
        """What is told of them, the best first."""
        values, above = self.likelihood.values(self.descent.unit), self.descent.deviance - self.lowest
        order = [k for k in np.argsort(above, kind="stable") if np.isfinite(above[k])]
        return tuple(Start(self.origins[k], values[k], float(above[k])) for k in order)


_remembered: OrderedDict[str, tuple[Ends, Estimated]] = OrderedDict()


def polished(problem: Problem) -> Estimated:
    """The estimate where nothing was searched. Raises `UserError` where nothing of the box can be simulated."""
    _, best = _of_box(problem)
    if best is None:
        raise UserError(
            f"no parameter set tried can be simulated before {problem.events[0].record.name}; give values by"
            " task.values=<result.json>, or narrow model.bounds"
        )
    return best


def estimate(problem: Problem, values: np.ndarray) -> Estimated:
    """The estimate for a problem whose search ended at free `values` (d,).

    A robust loss takes samples more than `OUTLIER` standard deviations off the fit for outliers; what is left of the
    records is then polished from where the search ended.
    """
    if not problem.loss.quadratic:
        observed = Observed.of(problem)
        plain = Likelihood.of(observed.problem)
        likelihood = cleaned(plain, plain.to_unit(values))
        ends = Ends(observed, likelihood, descend(likelihood.rows, likelihood.to_unit(values)), ("search",))
        return _finished(ends.looked_beside(), robust=True)
    ends, best = _of_box(problem)
    own = descend(ends.likelihood.rows, ends.likelihood.to_unit(values), apart=ends.likelihood.apart)
    whole = ends.joined(own, "search")
    if best is None or own.deviance[0] < ends.lowest - BETTER:
        return _finished(whole.looked_beside(), robust=False)
    return replace(best, starts=whole.starts)


def _of_box(problem: Problem) -> tuple[Ends, Estimated | None]:
    """The ends of descents from all over the box, and the estimate that they give; None where none can be simulated."""
    events = [(e.record.name, e.start, e.end, e.steady, e.noise_P, e.noise_Q) for e in problem.events]
    key = f"{problem.digest()} {events}"
    if key not in _remembered:
        observed = Observed.of(problem)
        likelihood = Likelihood.of(observed.problem)
        found = explored(likelihood)
        refined = descend(likelihood.rows, distinct(found, likelihood.free), apart=likelihood.apart)
        ends = Ends(observed, likelihood, found, ("box",) * len(found.unit)).joined(refined, "box")
        if not np.isfinite(ends.lowest):
            return ends, None
        ends = ends.looked_beside()
        _remembered[key] = ends, _finished(ends, robust=False)
        if len(_remembered) > REMEMBERED:
            _remembered.popitem(last=False)
    return _remembered[key]


def _finished(ends: Ends, *, robust: bool) -> Estimated:
    """Noise and fit in turn from the best valleys, and the judgement of the best of them."""
    observed, likelihood = ends.observed, ends.likelihood
    near = ends.descent.deviance <= HOPELESS * ends.lowest
    units = distinct(Descent(ends.descent.unit[near], ends.descent.deviance[near], 0), likelihood.free)
    blur = observed.blurred(likelihood.values(units[0]))
    for _ in range(ROUNDS):
        if robust:
            likelihood = cleaned(likelihood, units[:1])
        likelihood = replace(likelihood, noise=noise_at(observed, likelihood, units[0], blur))
        found = descend(likelihood.rows, units, apart=likelihood.apart)
        order = np.argsort(found.deviance, kind="stable")
        units = found.unit[order[found.deviance[order] <= found.deviance.min() + BEHIND]]
    seen = surprise(observed, likelihood, units[0])
    if not seen.adequate:
        factor = louder(likelihood, units[0])
        known = conclude(replace(likelihood, noise=likelihood.noise.scaled(factor)), units[0])
        return Estimated(replace(known, widened=factor), seen, ends.starts)
    whole = noise_at(observed, likelihood, units[0], observed.blurred(likelihood.values(units[0])), whole=True)
    likelihood = replace(likelihood, noise=whole)  # nothing but noise is left: all of it tells
    found = descend(likelihood.rows, units, apart=likelihood.apart)
    best = int(found.deviance.argmin())
    others = np.arange(len(units)) != best
    known = conclude(likelihood, found.unit[best])
    return Estimated(with_rivals(known, found.unit[others], found.deviance[others]), seen, ends.starts)


def noise_at(
    observed: Observed, likelihood: Likelihood, unit: np.ndarray, blur: np.ndarray | None, whole: bool = False
) -> Noise:
    """The noise that a fit at coordinates (D,) leaves in quiet; of the `whole` residual where too little is quiet.

    The whole tells more, too, where what is left is nothing but noise. `blur` is that of `Observed.blurred`.
    """
    measured = likelihood.problem.drive.measured
    rows, J = replace(likelihood, noise=Noise.white(*[1.0] * len(measured))).jacobian(unit)
    residual, columns = rows.reshape(measured.shape), J.T.reshape(-1, *measured.shape)
    answers = observed.answers(likelihood.values(unit))
    seen = observed.noise(residual, likelihood.known, columns, blur, whole, answers)
    return seen or noise_of(likelihood, residual)


def noise_of(likelihood: Likelihood, residuals: np.ndarray) -> Noise:
    """An autoregression of each event's and channel's residual (2, N); what the fit has absorbed is given back."""
    drive = likelihood.problem.drive
    absorbed = likelihood.free + 2 * drive.events
    back = np.sqrt(likelihood.samples / max(likelihood.samples - absorbed, 1))
    pairs: list[Pair] = []
    for e in range(drive.events):
        part, pair = drive.part(e), []
        for c in range(drive.channels):
            pieces = stretches(residuals[c, part], likelihood.known[c, part])
            enough = sum(map(len, pieces)) >= FEWEST
            pair.append(fit_autoregression(pieces).scaled(back) if enough else white_noise(1.0))
        pairs.append(tuple(pair))
    return Noise(tuple(pairs))


def louder(likelihood: Likelihood, unit: np.ndarray) -> float:
    """How many times as loud as the noise the whitened residual is from the dips on; at least one."""
    drive = likelihood.problem.drive
    rows = likelihood.rows(unit[None])[0].reshape(drive.channels, -1)
    parts = [slice(drive.part(e).start + event.start, drive.part(e).stop)
             for e, event in enumerate(likelihood.problem.events)]  # fmt: skip
    after = np.concatenate([rows[:, part][likelihood.known[:, part]] for part in parts])
    return max(1.0, float(np.sqrt(np.mean(after**2)))) if len(after) else 1.0


def cleaned(likelihood: Likelihood, unit: np.ndarray) -> Likelihood:
    """The likelihood without the samples beyond `OUTLIER` robust standard deviations of the fit at `unit` (1, D)."""
    drive = likelihood.problem.drive
    known = drive.weights > 0
    residuals = np.abs(replace(likelihood, known=known).residuals(unit)[0])
    for e in range(drive.events):
        for c in range(drive.channels):
            part = drive.part(e)
            seen = residuals[c, part][known[c, part]]
            if len(seen):
                known[c, part] &= residuals[c, part] <= max(OUTLIER * 1.4826 * float(np.median(seen)), 1e-12)
    return replace(likelihood, known=known)


def with_rivals(known: Uncertainty, units: np.ndarray, deviance: np.ndarray) -> Uncertainty:
    """The judgement with the intervals reaching over other valleys (n, D) that the records do not rule out."""
    limit, own = threshold(), dict(zip(known.names, known.intervals.tolist(), strict=True))
    hull, said = dict(own), dict(known.verdicts)
    for unit, height in zip(units, np.asarray(deviance) - known.deviance, strict=True):
        if not height < limit:
            continue
        other = conclude(known.likelihood, unit)
        reach = np.where(np.isfinite(other.half), other.half, 0.0) * np.sqrt(1 - max(height, 0.0) / limit)
        spans = np.clip(other.values[:, None] + reach[:, None] * [-1, 1], known.lower[:, None], known.upper[:, None])
        for name, value, (low, high) in zip(other.names, other.values, spans.tolist(), strict=True):
            (a, b), (c, d) = own[name], hull[name]
            hull[name] = [min(c, low), max(d, high)]
            if not a <= value <= b:
                said[name] = _of_two(said[name], float(value), hull[name], known, name)
    wider = {n: (a, b) for n, (a, b) in hull.items() if [a, b] != own[n]}
    return replace(known, rivals=wider, verdicts=said)


def _of_two(verdict: Verdict, value: float, hull: Sequence[float], known: Uncertainty, name: str) -> Verdict:
    """A verdict where another valley fits as well: by the width of the interval over both."""
    j = known.names.index(name)
    low, high = known.lower[j], known.upper[j]
    narrow = (hull[1] - hull[0]) / 2 <= WITHIN * size(known.values[j], low, high)
    word = WEAK if verdict.word == IDENTIFIED and not narrow else verdict.word
    word = UNIDENTIFIED if hull[0] <= low and hull[1] >= high else word
    return Verdict(word, f"{verdict.detail}; another valley, at {value:.4g}, fits as well")
