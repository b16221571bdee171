"""Fits of effects whose thresholds and times have hardly a slope: these are moved far, and
descend, in turn.
"""

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from tractexp.inference import fit_effort
from tractexp.inference.context import Context
from tractexp.inference.cores import map_on_cores
from tractexp.inference.fitting import (
    Refit,
    Start,
    find_lag,
    find_prior_columns,
    refit,
    run_descents,
    select_best_fits,
)
from tractexp.inference.promising import select_promising_starts
from tractexp.noise import Noise
from tractexp.parameter import best_distinct


def refit_widely(
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
    return _search_around(
        context, noise, _descend_in_turns(context, noise, wanted, faults), faults, again
    )


def _search_around(
    context: Context, noise: Noise, fits: list[Refit], faults: Sequence[str] | None, again: int
) -> list[Refit]:
    """Fits of one set searched further around the best of them as long as that gains, and the
    nearest then exactly.
    """
    for _ in range(again if context.coordinates.settings(fits[0].names) else 0):
        others = _descend_in_turns(context, noise, scatter_starts(context, fits[0]), faults)
        if others[0].deviance > fits[0].deviance - fit_effort.LEAST_GAIN:
            break
        fits = others
    near = [f.start for f in fits if f.cost < fits[0].cost + fit_effort.NEAR_BEST]
    return refit(context, noise, near, faults)


def _descend_in_turns(
    context: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None
) -> list[Refit]:
    """The best of these starts, each moved and descended in turn as long as it gains more than it
    is behind the best; the best first.
    """
    turning = _begin_fits(context, noise, wanted, faults)
    ended: list[Refit] = []
    for _ in range(fit_effort.MOST_TURNS):
        moved = [(f.names, move_across(context, noise, f, faults)) for f in turning]
        after = run_descents(context, noise, moved, faults, fit_effort.ROUGH_DESCENT)
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


def refit_sets_widely(
    context: Context,
    noise: Noise,
    wanted: Iterable[Sequence[Start]],
    most: int,
    others: Iterable[Refit] = (),
) -> list[Refit]:
    """Fit several sets by `refit_widely`, those that come nearest in a few iterations.

    What is far behind the best of them and of `others` after these, or after its turns, is given
    up.

    Parameters
    ----------
    context, noise
        As of `refit`.
    wanted : starts of each set
        As of `refit_widely`.
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
        return [fits for fits in every if fits[0].cost <= min(best) + find_lag(best)]

    begun = near(
        map_on_cores(
            lambda starts: _begin_fits(context, noise, starts, None), list(wanted), context.effort
        )
    )
    begun = sorted(begun, key=lambda fits: fits[0].cost)[:most]
    again = [[f.start for f in fits] for fits in begun]
    turned = map_on_cores(
        lambda starts: _descend_in_turns(context, noise, starts, None), again, context.effort
    )
    ended = lambda fits: _search_around(context, noise, fits, None, fit_effort.SCATTER_ROUNDS)  # noqa: E731
    return select_best_fits(
        [
            *itertools.chain(*turned),
            *itertools.chain(*map_on_cores(ended, near(turned), context.effort)),
        ]
    )


def _begin_fits(
    context: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None
) -> list[Refit]:
    """The best starts of one set after a few iterations, of those that promise most by one
    simulation each.
    """
    names = wanted[0][0]
    nuisances = [
        *context.coordinates.base,
        *context.coordinates.before,
        *find_prior_columns(context, [names], faults)[0],
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
    begun = run_descents(context, noise, [(names, u) for u in units], faults, effort)
    at = np.array([f.unit for f in begun])
    chosen = best_distinct(
        at, np.array([f.cost for f in begun]), fit_effort.DISTINCT, fit_effort.STARTS_IN_TURNS
    )
    return [begun[k] for k in chosen]


def move_across(
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
    prior = find_prior_columns(context, [fit.names], faults)[1]
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
