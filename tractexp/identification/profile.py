"""Profile likelihood: the deviance of the best fit for each value of a parameter, all others free.

Where the likelihood is no parabola, the interval of the information matrix misleads; the profile
does not. Its lanes end where the deviance has risen too far, though beyond a crest it may fall
again: so the rest of each range is looked at, too, from every local minimum, and lanes go on from
where the records fit as well. Every point of a profile that the records do not rule out belongs to
the intervals of all parameters, not only of the profiled one: where it lies beyond another's, a
lane of that goes on from there.

Deviances are told over what a parameter's may rise by, in units of the chi-squared quantile: under
least squares, that of another scatter (`Uncertainty.limits`), one threshold holds for all. Source:
Chandler and Bate 2007.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.identification.profile_lanes import (
    End,
    Lanes,
    LikelihoodProfile,
    descend_others,
    find_outermost,
)
from tractexp.identification.uncertainty import Uncertainty, compute_threshold, conclude
from tractexp.identification.verdict import (
    BOUND,
    END_OF_RANGE,
    IDENTIFIED,
    IDENTIFIED_SHARE,
    UNIDENTIFIED,
    WEAK,
    ParameterVerdict,
    choose_scale,
)
from tractexp.text.progress import Counting, make_silent_counter

RESTARTS = 5
DOUBTFUL = 0.05  # of the value: wider half intervals are checked by a profile
GRID = np.linspace(0.02, 0.98, 13)  # of the range, at which the rest of it is looked at
INTERVAL_NEIGHBORHOOD = 0.04  # of the range: places closer than this to an interval are part of it


@dataclass(frozen=True, eq=False)
class Profiles:
    """The profiles of some parameters.

    Attributes
    ----------
    uncertainty : Uncertainty
        The judgement they are drawn around.
    profiles : tuple of LikelihoodProfile
        One a parameter.
    threshold : float
        What the deviance may rise by within an interval.
    simulations, restarts : int
        What they cost, and how often a better optimum restarted them.
    wider : (d,) bools
        Whether points that the records do not rule out lie beyond the interval by curvature.
    """

    uncertainty: Uncertainty
    profiles: tuple[LikelihoodProfile, ...]
    threshold: float
    simulations: int
    restarts: int
    wider: np.ndarray

    @property
    def notes(self) -> list[str]:
        """What happened on the way, in sentences: how often a better optimum restarted the
        profiles.
        """
        if not self.restarts:
            return []
        times = "once" if self.restarts == 1 else f"{self.restarts} times"
        return [
            "a better optimum turned up along a profile; the profiles were restarted from it"
            f" {times}"
        ]

    @property
    def verdicts(self) -> dict[str, ParameterVerdict]:
        """The verdicts of the information matrix, corrected by what the profiles show."""
        uncertainty = self.uncertainty
        bounds = dict(
            zip(
                uncertainty.names,
                zip(uncertainty.lower, uncertainty.upper, strict=True),
                strict=True,
            )
        )
        other = dict(zip(uncertainty.names, uncertainty.elsewhere, strict=True))
        return uncertainty.verdicts | {
            p.name: revise_verdict(
                uncertainty.verdicts[p.name], p, *bounds[p.name], elsewhere=bool(other[p.name])
            )
            for p in self.profiles
        }


def revise_verdict(
    verdict: ParameterVerdict,
    profile: LikelihoodProfile,
    low: float,
    high: float,
    elsewhere: bool = False,
) -> ParameterVerdict:
    """A verdict in the light of a profile.

    The profile's width decides; an open side, a second minimum or another local minimum of the fit
    is a weakness.

    Parameters
    ----------
    verdict : ParameterVerdict
        By curvature.
    profile : LikelihoodProfile
        Of the same parameter.
    low, high : float
        Its bounds, in its unit.
    elsewhere : bool
        Whether another local minimum has another value.

    Returns
    -------
    ParameterVerdict
    """
    a, b = profile.interval
    if verdict.word == UNIDENTIFIED and "leave the record unchanged" in verdict.detail:
        return verdict
    value = (a + b) / 2
    opened = [end is not End.CLOSED for end in profile.ends]
    if all(opened):
        word = UNIDENTIFIED
    elif verdict.word in (BOUND, END_OF_RANGE):
        word = verdict.word
    elif (
        any(opened)
        or profile.minima
        or elsewhere
        or (b - a) / 2 > IDENTIFIED_SHARE * choose_scale(value, low, high)
    ):
        word = WEAK
    else:
        word = IDENTIFIED
    detail = "; ".join(filter(None, (verdict.detail, profile.verdict)))
    return ParameterVerdict(word, detail)


def check_by_profiles(
    uncertainty: Uncertainty, parts: Callable[[int], Counting] = make_silent_counter
) -> Uncertainty:
    """The judgement with profiles in place of curvature, wherever that may mislead.

    It may for intervals wider than `DOUBTFUL` of the value, for parameters that have another value
    at another local minimum, and for those that another's profile leads beyond their interval; else
    a narrow one is a parabola. Parameters that are not identifiable by structure have no profile.

    Parameters
    ----------
    uncertainty : Uncertainty
        The judgement by curvature.
    parts : int -> counter
        Counts the points of the profiles.

    Returns
    -------
    Uncertainty
    """
    bounds = zip(uncertainty.lower, uncertainty.upper, strict=True)
    sizes = np.array(
        [choose_scale(v, *pair) for v, pair in zip(uncertainty.values, bounds, strict=True)]
    )
    doubtful = uncertainty.information.identifiable & (uncertainty.half > DOUBTFUL * sizes)
    doubtful |= uncertainty.information.identifiable & uncertainty.elsewhere
    if not doubtful.any():
        return uncertainty
    result = _profile_doubtful(uncertainty, doubtful, parts)
    return replace(
        result.uncertainty,
        verdicts=result.verdicts,
        profiled={p.name: p.interval for p in result.profiles},
        notes=[*result.uncertainty.notes, *result.notes],
    )


def _profile_doubtful(
    uncertainty: Uncertainty, doubtful: np.ndarray, parts: Callable[[int], Counting]
) -> Profiles:
    """Profiles of the doubtful (d,) parameters and of those that these lead beyond their interval
    by curvature.
    """
    names = [name for name, d in zip(uncertainty.names, doubtful, strict=True) if d]
    result = profile_parameters(uncertainty, names=names, parts=parts)
    wider = doubtful | result.wider & uncertainty.information.identifiable
    if (wider == doubtful).all():
        return result
    whole = _profile_doubtful(result.uncertainty, wider, parts)
    return replace(whole, restarts=result.restarts + whole.restarts)


def profile_parameters(
    uncertainty: Uncertainty,
    points: int = 24,
    names: Sequence[str] | None = None,
    parts: Callable[[int], Counting] = make_silent_counter,
) -> Profiles:
    """The likelihood profiles of parameters.

    Where a point fits better than the optimum did, everything starts again from there.

    Parameters
    ----------
    uncertainty : Uncertainty
        The judgement they are drawn around.
    points : int
        At most so many on either side.
    names : names or None
        The parameters; None: all.
    parts : int -> counter
        Counts the points.

    Returns
    -------
    Profiles
    """
    simulations, restarts, names = 0, 0, names or uncertainty.names
    while True:
        column = np.array([uncertainty.names.index(name) for name in names])
        drawing = _Drawing(uncertainty, column)
        with parts(points) as ended:
            drawing.begin(points, ended)
        if drawing.better is None:
            drawing.join(_start_elsewhere(uncertainty, column, drawing.curves), points)
        for _ in names:  # what one lane went through may lead another on, and that the next
            if drawing.better is not None or not drawing.go_on(points):
                break
        simulations += drawing.simulations
        if drawing.better is None or restarts == RESTARTS:
            return Profiles(
                uncertainty,
                tuple(drawing.curves),
                compute_threshold(),
                simulations,
                restarts,
                drawing.find_wider(),
            )
        descent = uncertainty.likelihood.descent(drawing.better[None])
        simulations += descent.simulations
        noise = None if uncertainty.exact else uncertainty.of_noise
        uncertainty = conclude(uncertainty.likelihood, descent.unit[0], noise, uncertainty.notes)
        restarts += 1


class _Drawing:
    """Profiles of some parameters (k,) about one optimum, as their lanes go on."""

    def __init__(self, uncertainty: Uncertainty, column: np.ndarray):
        """Draw the profiles of the parameters `column` (k,) of an estimate; nothing is drawn
        yet.
        """
        self.uncertainty = uncertainty
        self.column = column
        self.curves: list[LikelihoodProfile] = []
        # the points that lanes passed, as of `find_outermost`
        self.unit = np.empty((0, len(uncertainty.unit)))
        self.rise = np.empty((0, len(uncertainty.names)))
        self.better: np.ndarray | None = None
        self.simulations = 0

    def begin(self, points: int, ended: Callable[[], None]) -> None:
        """Draw every profile from the estimate, at most `points` on either side; `ended` is told of
        each lane.
        """
        k = len(self.column)
        lanes = Lanes(
            self.uncertainty, self.column, np.tile(self.uncertainty.unit, (k, 1)), np.zeros(k)
        )
        self._run(lanes, points, ended)
        self.curves = [lanes.profile(i) for i in range(k)]

    def go_on(self, points: int) -> bool:
        """Lanes from points of all lanes that fit and lie beyond a profile's interval; False where
        there are none.
        """
        where = [
            (int(c), k)
            for c, p in zip(self.column, self.curves, strict=True)
            for k in self._find_outermost(int(c), p.interval)
        ]
        if where:
            c, k = np.array(where).T
            rise = self.rise[k, c] * compute_threshold()
            self.join(Lanes(self.uncertainty, c, self.unit[k], rise), points)
        return bool(where)

    def find_wider(self) -> np.ndarray:
        """Whether points that the records do not rule out lie beyond the interval by curvature,
        (d,).
        """
        known = self.uncertainty
        ends = zip(known.values - known.half, known.values + known.half, strict=True)
        return np.array([bool(self._find_outermost(c, pair)) for c, pair in enumerate(ends)])

    def _find_outermost(self, c: int, interval: tuple[float, float]) -> list[int]:
        """The points that fit and lie farthest beyond an interval of the c-th parameter."""
        unit = _clip_to_range(self.uncertainty, c, interval)
        return find_outermost(self.unit, self.rise, c, unit)

    def join(self, lanes: Lanes, points: int) -> None:
        """Draw lanes that begin elsewhere, and join each with the profile of its parameter."""
        self._run(lanes, points)
        self.curves = [
            _join_profiles(
                p, [lanes.profile(int(k)) for k in np.flatnonzero(lanes.column[::2] == c)]
            )
            for p, c in zip(self.curves, self.column, strict=True)
        ]

    def _run(self, lanes: Lanes, points: int, ended: Callable[[], None] = lambda: None) -> None:
        """Run lanes, and keep what they passed, the simulations they cost and a better optimum."""
        lanes.run(points, ended)
        self.simulations += lanes.simulations
        self.better = lanes.better
        unit, rise = lanes.points
        self.unit = np.concatenate([self.unit, unit])
        self.rise = np.concatenate([self.rise, rise])


def _clip_to_range(
    uncertainty: Uncertainty, c: int, interval: tuple[float, float]
) -> tuple[float, float]:
    """An interval of the c-th parameter in its range."""
    low = uncertainty.lower[c]
    width = uncertainty.upper[c] - uncertainty.lower[c]
    return (interval[0] - low) / width, (interval[1] - low) / width


def _start_elsewhere(
    uncertainty: Uncertainty, column: np.ndarray, curves: Sequence[LikelihoodProfile]
) -> Lanes:
    """Lanes from the best place of each range beyond the profile's interval that fits as well."""
    begin = np.array([uncertainty.unit, *uncertainty.local_minima])
    wanted = []  # (column, value in the range)
    for c, profile in zip(column, curves, strict=True):
        low, high = _clip_to_range(uncertainty, c, profile.interval)
        values = np.concatenate([GRID, begin[1:, c]])
        wanted += [
            (c, v)
            for v in values[
                (values < low - INTERVAL_NEIGHBORHOOD) | (values > high + INTERVAL_NEIGHBORHOOD)
            ]
        ]
    if not wanted:
        return Lanes(
            uncertainty, np.empty(0, dtype=int), np.empty((0, len(uncertainty.unit))), np.empty(0)
        )
    columns = np.repeat([c for c, _ in wanted], len(begin))
    start = np.tile(begin, (len(wanted), 1))
    rows = np.arange(len(start))
    start[rows, columns] = np.repeat([v for _, v in wanted], len(begin))
    descent = descend_others(uncertainty, start, columns, tolerance=0.05)
    rise = (
        (descent.deviance - uncertainty.deviance)
        * compute_threshold()
        / uncertainty.limits[columns]
    )
    best = [rows[columns == c][rise[columns == c].argmin()] for c in np.unique(columns)]
    best = np.array([k for k in best if rise[k] < compute_threshold()], dtype=int)
    return Lanes(uncertainty, columns[best], descent.unit[best], rise[best], descent.simulations)


def _join_profiles(
    profile: LikelihoodProfile, others: Sequence[LikelihoodProfile]
) -> LikelihoodProfile:
    """A profile with what further lanes found: the least of both at each value, and an interval
    over both.

    What fits best of a lane from beyond the interval is another minimum, unless it is in the
    interval.
    """
    for other in others:
        every = sorted((profile, other), key=lambda p: p.interval)
        values = np.union1d(profile.values, other.values)
        least = float(other.values[other.deviance.argmin()])
        low, high = profile.interval
        profile = replace(
            profile,
            values=values,
            deviance=np.minimum(
                *(np.interp(values, p.values, p.deviance, np.inf, np.inf) for p in every)
            ),
            interval=(every[0].interval[0], max(p.interval[1] for p in every)),
            ends=(every[0].ends[0], max(every, key=lambda p: p.interval[1]).ends[1]),
            minima=profile.minima if low <= least <= high else (*profile.minima, least),
        )
    return profile
