"""Fits of sets of effects side by side: each is a lane of the batched descent with its own free
columns.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.cache import store
from tractexp.inference import fit_effort
from tractexp.inference.context import Context
from tractexp.inference.cores import each_apart
from tractexp.inference.least_squares import descend
from tractexp.inference.promising import select_promising_starts
from tractexp.noise import Noise
from tractexp.parameter import best_distinct

Names = tuple[str, ...]
Start = tuple[Sequence[str], np.ndarray]  # names of effects, and coordinates (D,) to start from


@dataclass(frozen=True, eq=False)
class Refit:
    """The best fit of one set of effects.

    Attributes
    ----------
    names : names
        The effects.
    unit : (D,)
        Coordinates of the whole context.
    deviance : float
        The sum of squares of the whitened residuals.
    parameters : int
        Number of parameters of the effects.
    """

    names: Names
    unit: np.ndarray
    deviance: float
    parameters: int  # of the effects

    @property
    def cost(self) -> float:
        """Akaike's criterion of the set, but for a constant: the deviance, and 2 for each
        parameter.

        Examples
        --------
        >>> Refit(("trip",), np.zeros(3), 10.0, 2).cost
        14.0
        """
        return self.deviance + 2 * self.parameters


def best_of(fits: Iterable[Refit]) -> list[Refit]:
    """The best fit of each set, in order of cost."""
    best: dict[Names, Refit] = {}
    for fit in sorted(fits, key=lambda r: (r.cost, r.names)):
        best.setdefault(fit.names, fit)
    return list(best.values())


def refit(
    context: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None = None
) -> list[Refit]:
    """Fit sets of effects side by side.

    Parameters
    ----------
    context : Context
        The records and models.
    noise : Noise
        Under which they are fitted.
    wanted : sequence of (names, (D,))
        Sets, and coordinates to start from; a set may have several starts.
    faults : names or None
        Faults of the measurement that are free beside each set; None: all.

    Returns
    -------
    list of Refit
        The best of each set, in order of cost.
    """
    return best_of(_run_descents(context, noise, wanted, faults, fit_effort.EXACT_DESCENT))


def rough_refit(context: Context, noise: Noise, wanted: Sequence[Start]) -> list[Refit]:
    """Fit sets of effects as far as is needed to rank those that are far apart.

    What falls behind in the first iterations is given up. Parameters and result are as of `refit`.
    """
    begun = _run_descents(
        context, noise, wanted, None, (fit_effort.FIRST_ITERATIONS, fit_effort.ROUGH_DESCENT[1])
    )
    best = best_of(begun)
    far = _far([r.cost for r in best])
    promising = [r.names for r in best if r.cost <= best[0].cost + far]
    again = []
    for names in promising:
        starts = sorted((r for r in begun if r.names == names), key=lambda r: r.deviance)
        again += [(names, r.unit) for r in starts[: -(-len(starts) // 2)]]
    return best_of(
        [
            *best,
            *_run_descents(
                context,
                noise,
                again,
                None,
                (
                    fit_effort.ROUGH_DESCENT[0] - fit_effort.FIRST_ITERATIONS,
                    fit_effort.ROUGH_DESCENT[1],
                ),
            ),
        ]
    )


def _far(costs: Sequence[float]) -> float:
    """How far in cost behind the best of these a rough fit is given up."""
    return max(fit_effort.FAR_BEHIND, fit_effort.FAR_SHARE * (max(costs) - min(costs)))


def wide_refit(
    context: Context,
    noise: Noise,
    wanted: Sequence[Start],
    faults: Sequence[str] | None = None,
    again: int = fit_effort.SCATTER_ROUNDS,
) -> list[Refit]:
    """Fit one set whose thresholds and times have hardly a slope: move them far, and descend, in
    turn.

    A descent walks a relay's time by a sample a step, and a wrong time bends what else is fitted.

    Parameters
    ----------
    context, noise, wanted, faults
        As of `refit`; all starts are of one set.
    again : int
        How often the search begins again around the best, as long as that gains.

    Returns
    -------
    list of Refit
        In order of cost.
    """
    return _around(context, noise, _in_turns(context, noise, wanted, faults), faults, again)


def _around(
    context: Context, noise: Noise, fits: list[Refit], faults: Sequence[str] | None, again: int
) -> list[Refit]:
    """Fits of one set searched further around the best of them as long as that gains, and the
    nearest then exactly.
    """
    for _ in range(again if context.coordinates.settings(fits[0].names) else 0):
        others = _in_turns(context, noise, scatter_starts(context, fits[0]), faults)
        if others[0].deviance > fits[0].deviance - fit_effort.LEAST_GAIN:
            break
        fits = others
    near = [(f.names, f.unit) for f in fits if f.cost < fits[0].cost + fit_effort.NEAR_BEST]
    return refit(context, noise, near, faults)


def _in_turns(
    context: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None
) -> list[Refit]:
    """The best of these starts, each moved and descended in turn as long as it gains more than it
    is behind the best; the best first.
    """
    turning = _begun(context, noise, wanted, faults)
    ended: list[Refit] = []
    for _ in range(fit_effort.MOST_TURNS):
        moved = [(f.names, moved_across(context, noise, f, faults)) for f in turning]
        after = _run_descents(context, noise, moved, faults, fit_effort.ROUGH_DESCENT)
        better = [min(pair, key=lambda f: f.deviance) for pair in zip(turning, after, strict=True)]
        best = min(f.deviance for f in (*ended, *better))
        gains = [
            before.deviance - now.deviance for before, now in zip(turning, better, strict=True)
        ]
        promising = [
            gain > max(fit_effort.LEAST_GAIN, f.deviance - best)
            for gain, f in zip(gains, better, strict=True)
        ]
        ended += [f for f, more in zip(better, promising, strict=True) if not more]
        turning = [f for f, more in zip(better, promising, strict=True) if more]
        if not turning:
            break
    return sorted([*ended, *turning], key=lambda f: f.cost)


def scatter_starts(context: Context, fit: Refit) -> list[Start]:
    """Starts around a fit, with all that an effect has beside its sizes moved at once, by little
    and by much.

    Two relays may each be at its best beside the other and still have each other's times: one
    parameter at a time leads nowhere then. The points are Roberts' (2018) sequence R_d, the
    fractional parts of k / phi, k / phi^2, ...

    Parameters
    ----------
    context : Context
        The records and models.
    fit : Refit
        Around which they lie.

    Returns
    -------
    list of (names, (D,))
    """
    columns = context.coordinates.settings(fit.names)
    phi = 2.0
    for _ in range(50):
        phi = (1 + phi) ** (1 / (len(columns) + 1))
    parts = (
        np.outer(
            np.arange(1, fit_effort.SCATTER_POINTS + 1), phi ** -np.arange(1.0, len(columns) + 1)
        )
        % 1.0
    )
    units = np.repeat(fit.unit[None], fit_effort.SCATTER_POINTS, axis=0)
    units[:, columns] = np.clip(
        units[:, columns] + fit_effort.SCATTER_REACH * (2 * parts - 1) ** 3, 0.0, 1.0
    )
    return [(fit.names, unit) for unit in units]


def wide_refits(
    context: Context,
    noise: Noise,
    wanted: Iterable[Sequence[Start]],
    most: int,
    others: Iterable[Refit] = (),
) -> list[Refit]:
    """Fit several sets by `wide_refit`, those that come nearest in a few iterations.

    What is far behind the best of them and of `others` after these, or after its turns, is given
    up.

    Parameters
    ----------
    context, noise
        As of `refit`.
    wanted : starts of each set
        As of `wide_refit`.
    most : int
        How many sets are searched to the end.
    others : iterable of Refit
        Fits that are known.

    Returns
    -------
    list of Refit
        In order of cost.
    """
    costs = [fit.cost for fit in others]

    def near(every: list[list[Refit]]) -> list[list[Refit]]:
        best = [fits[0].cost for fits in every] + costs
        return [fits for fits in every if fits[0].cost <= min(best) + _far(best)]

    begun = near(
        each_apart(
            lambda starts: _begun(context, noise, starts, None), list(wanted), context.effort
        )
    )
    begun = sorted(begun, key=lambda fits: fits[0].cost)[:most]
    again = [[(f.names, f.unit) for f in fits] for fits in begun]
    turned = each_apart(
        lambda starts: _in_turns(context, noise, starts, None), again, context.effort
    )
    ended = lambda fits: _around(context, noise, fits, None, fit_effort.SCATTER_ROUNDS)  # noqa: E731
    return best_of(
        [
            *itertools.chain(*turned),
            *itertools.chain(*each_apart(ended, near(turned), context.effort)),
        ]
    )


def _begun(
    context: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None
) -> list[Refit]:
    """The best starts of one set after a few iterations, of those that promise most by one
    simulation each.
    """
    names = wanted[0][0]
    nuisances = [
        *context.coordinates.base,
        *context.coordinates.before,
        *_with_prior(context, [names], faults)[0],
    ]
    units = select_promising_starts(
        context,
        noise,
        names,
        np.array([unit for _, unit in wanted]),
        nuisances,
        fit_effort.MOST_STARTS,
    )
    effort = fit_effort.FIRST_ITERATIONS, fit_effort.ROUGH_DESCENT[1]
    begun = _run_descents(context, noise, [(names, u) for u in units], faults, effort)
    at = np.array([f.unit for f in begun])
    chosen = best_distinct(
        at, np.array([f.cost for f in begun]), fit_effort.DISTINCT, fit_effort.STARTS_IN_TURNS
    )
    return [begun[k] for k in chosen]


def moved_across(
    context: Context, noise: Noise, fit: Refit, faults: Sequence[str] | None = None
) -> np.ndarray:
    """Move what an effect has beside its sizes, one parameter at a time and by any reach.

    Parameters
    ----------
    context, noise, faults
        As of `refit`.
    fit : Refit
        Where it begins.

    Returns
    -------
    (D,) array
        Coordinates of less deviance; those of the fit where no move gains.
    """
    columns = context.coordinates.settings(fit.names)
    if not columns:
        return fit.unit
    prior = _with_prior(context, [fit.names], faults)[1]
    unit = fit.unit
    deviance = fit.deviance
    for _ in range(fit_effort.MOST_MOVES):
        trials = np.repeat(unit[None], 2 * len(columns) * len(fit_effort.MOVE_REACHES), axis=0)
        for k, mine in zip(columns, np.split(trials, len(columns)), strict=True):
            mine[:, k] = np.clip(
                mine[:, k] + np.r_[fit_effort.MOVE_REACHES, -fit_effort.MOVE_REACHES], 0.0, 1.0
            )
        rows = context.rows(trials, noise, prior, [fit.names] * len(trials))
        deviances = np.nan_to_num(np.einsum("nr,nr->n", rows, rows), nan=np.inf)
        if not deviances.min() < deviance - fit_effort.LEAST_GAIN:
            break
        unit = trials[deviances.argmin()]
        deviance = float(deviances.min())
    return unit


def no_worse_than_subsets(
    context: Context, noise: Noise, refits: Mapping[Names, Refit], fits: Sequence[Refit]
) -> list[Refit]:
    """Refit any set that came out worse than a subset of it, from the best subset.

    Parameters
    ----------
    context, noise
        As of `refit`.
    refits : {names: Refit}
        All sets that were fitted.
    fits : sequence of Refit
        Those to mend.

    Returns
    -------
    list of Refit
        In the order of `fits`.
    """
    again = []
    for fit in fits:
        subsets = [refits[s] for s in refits if set(s) < set(fit.names)]
        best = min(subsets, key=lambda r: r.deviance, default=None)
        if best is not None and fit.deviance > best.deviance + fit_effort.NESTED_TOLERANCE:
            again.append((fit.names, best.unit))
    if not again:
        return list(fits)
    redone = {f.names: f for f in refit(context, noise, again)}
    return [min(f, redone.get(f.names, f), key=lambda r: r.deviance) for f in fits]


def _run_descents(
    context: Context,
    noise: Noise,
    wanted: Sequence[Start],
    faults: Sequence[str] | None,
    effort: tuple[int, float],
) -> list[Refit]:
    """The end of a descent from each start; what was made before, as by a run that was stopped, is
    read.

    `FITS_AT_ONCE` of them take their steps in the same calls, whatever the number of cores: the
    last bits of a fit hang on it.
    """
    at = context.coordinates
    spent = context.effort.total
    measured, prior = _with_prior(context, [names for names, _ in wanted], faults)
    always = [*at.base, *at.before, *measured]
    columns = [
        [*always, *(k for k in at.parameters(names) if k not in always)] for names, _ in wanted
    ]
    table = np.full((len(wanted), max(map(len, columns))), at.dimension)
    for lane, free in enumerate(columns):
        table[lane, : len(free)] = free
    # the last column takes what no lane has
    starts = np.array([np.r_[start, 0.0] for _, start in wanted])

    def descend_group(group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        def rows(x: np.ndarray, lanes: np.ndarray) -> np.ndarray:
            whole = starts[group[lanes]]
            np.put_along_axis(whole, table[group[lanes]], x, axis=1)
            return context.rows(
                whole[:, :-1], noise, prior, [wanted[lane][0] for lane in group[lanes]]
            )

        begin = np.take_along_axis(starts[group], table[group], axis=1)
        done = descend(
            rows, begin, table[group] == at.dimension, *effort, context.separable_columns
        )
        return done.unit, done.deviance

    def all_descended() -> tuple[np.ndarray, ...]:
        groups = np.array_split(np.arange(len(wanted)), -(-len(wanted) // fit_effort.FITS_AT_ONCE))
        units, deviances = zip(*each_apart(descend_group, groups, context.effort), strict=True)
        return (
            np.concatenate(units),
            np.concatenate(deviances),
            np.array(context.effort.total - spent),
        )

    wants = [(tuple(names), unit) for names, unit in wanted]
    key = context.digest and store.key(context.digest, noise, wants, prior, effort)
    unit, deviance, simulations = store.DESCENTS.arrays(key, all_descended)
    # of what was made before, what it took then
    context.effort.spend(int(simulations) + spent - context.effort.total)
    np.put_along_axis(starts, table, unit, axis=1)
    return [
        Refit(
            tuple(sorted(names)),
            starts[lane, :-1].copy(),
            float(deviance[lane]),
            len(at.parameters(names)),
        )
        for lane, (names, _) in enumerate(wanted)
    ]


def _with_prior(
    context: Context, sets: Iterable[Sequence[str]], faults: Sequence[str] | None
) -> tuple[list[int], list[int]]:
    """The columns of the faults of the measurement that are free, and all that have a prior beside
    these sets.
    """
    at = context.coordinates
    measured = at.parameters(at.catalogue.of_measurement if faults is None else tuple(faults))
    return measured, [*measured, *at.shapes(sorted({name for names in sets for name in names}))]


def off_bounds(context: Context, unit: np.ndarray, to: float | None = None) -> list[np.ndarray]:
    """Coordinates with what rests on a bound of the base model moved off it, for there it has no
    slope.

    Parameters
    ----------
    context : Context
        The records and models.
    unit : (D,)
        Coordinates of a fit.
    to : float or None
        Where it is moved to, 0 to 1; None: to its default.

    Returns
    -------
    list of (D,) arrays
        One, or none where nothing rests on a bound.
    """
    moved = unit.copy()
    base = context.coordinates.base
    resting = base[
        (unit[base] <= fit_effort.BOUND_MARGIN) | (unit[base] >= 1 - fit_effort.BOUND_MARGIN)
    ]
    moved[resting] = context.coordinates.null[resting] if to is None else to
    return [moved] if len(resting) else []


def fit_initial_power(
    context: Context, unit: np.ndarray, noise: Noise, names: Sequence[str]
) -> np.ndarray:
    """Fit P0 and Q0 of each event alone.

    Parameters
    ----------
    context : Context
        The records and models.
    unit : (D,)
        Coordinates to begin with.
    noise : Noise
        Under which they are fitted.
    names : names
        The effects of the model.

    Returns
    -------
    (D,) array
        As it was where P0 and Q0 are not free.
    """
    before = context.coordinates.before
    if not len(before):
        return unit

    def rows(x: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        whole = np.tile(unit, (len(x), 1))
        whole[:, before] = x
        return context.rows(whole, noise, (), [names] * len(x))

    moved = unit.copy()
    moved[before] = descend(rows, unit[before][None]).unit[0]
    return moved
