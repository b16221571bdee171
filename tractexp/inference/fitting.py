"""Fits of sets of effects side by side: each is a lane of the batched descent with its own free
columns.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.cache import store
from tractexp.inference import fit_effort
from tractexp.inference.bounds import is_off_bounds
from tractexp.inference.context import Context
from tractexp.inference.cores import map_on_cores
from tractexp.inference.least_squares import descend
from tractexp.noise import Noise

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
    def start(self) -> Start:
        """The set and where it fits: another fit may begin there."""
        return self.names, self.unit

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


def key_by_names(fits: Iterable[Refit]) -> dict[Names, Refit]:
    """{names: fit}."""
    return {fit.names: fit for fit in fits}


def select_best_fits(fits: Iterable[Refit]) -> list[Refit]:
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
    return select_best_fits(run_descents(context, noise, wanted, faults, fit_effort.EXACT_DESCENT))


def refit_from(
    context: Context,
    noise: Noise,
    names: Sequence[str],
    unit: np.ndarray,
    faults: Sequence[str] | None = None,
) -> Refit:
    """Fit one set of effects from coordinates (D,), as of `refit`."""
    return refit(context, noise, [(names, unit)], faults)[0]


def leave_each_out(context: Context, fit: Refit) -> list[tuple[Names, np.ndarray]]:
    """Starts of a set without each of its effects in turn, in their order: all else as it fits."""
    return [
        (
            tuple(name for name in fit.names if name != left),
            context.coordinates.remove_effects(fit.unit, [left]),
        )
        for left in fit.names
    ]


def refit_roughly(context: Context, noise: Noise, wanted: Sequence[Start]) -> list[Refit]:
    """Fit sets of effects as far as is needed to rank those that are far apart.

    What falls behind in the first iterations is given up. Parameters and result are as of `refit`.
    """
    if not wanted:
        return []
    begun = run_descents(
        context, noise, wanted, None, (fit_effort.FIRST_ITERATIONS, fit_effort.ROUGH_DESCENT[1])
    )
    best = select_best_fits(begun)
    far = find_lag([r.cost for r in best])
    promising = [r.names for r in best if r.cost <= best[0].cost + far]
    again = []
    for names in promising:
        starts = sorted((r for r in begun if r.names == names), key=lambda r: r.deviance)
        again += [(names, r.unit) for r in starts[: -(-len(starts) // 2)]]
    return select_best_fits(
        [
            *best,
            *run_descents(
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


def find_lag(costs: Sequence[float]) -> float:
    """How far in cost behind the best of these a rough fit is given up."""
    return max(fit_effort.FAR_BEHIND, fit_effort.FAR_SHARE * (max(costs) - min(costs)))


def refit_worse_than_subsets(
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
    redone = key_by_names(refit(context, noise, again))
    return [min(f, redone.get(f.names, f), key=lambda r: r.deviance) for f in fits]


def run_descents(
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
    if not wanted:
        return []
    at = context.coordinates
    spent = context.effort.total
    measured, prior = find_prior_columns(context, [names for names, _ in wanted], faults)
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
        units, deviances = zip(*map_on_cores(descend_group, groups, context.effort), strict=True)
        return (
            np.concatenate(units),
            np.concatenate(deviances),
            np.array(context.effort.total - spent),
        )

    wants = [(tuple(names), unit) for names, unit in wanted]
    key = context.digest and store.compute_key(context.digest, noise, wants, prior, effort)
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


def find_prior_columns(
    context: Context, sets: Iterable[Sequence[str]], faults: Sequence[str] | None
) -> tuple[list[int], list[int]]:
    """The columns of the faults of the measurement that are free, and all that have a prior beside
    these sets.
    """
    at = context.coordinates
    measured = at.parameters(at.catalogue.of_measurement if faults is None else tuple(faults))
    return measured, [*measured, *at.shapes(sorted({name for names in sets for name in names}))]


def move_off_bounds(
    context: Context, unit: np.ndarray, to: float | None = None
) -> list[np.ndarray]:
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
    resting = base[~is_off_bounds(unit[base])]
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
