"""Fits of sets of effects side by side: each is a lane of the batched descent with its own free columns."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp import store
from tractexp.discrepancy.context import Context
from tractexp.discrepancy.cores import each_apart
from tractexp.discrepancy.promising import promising
from tractexp.identification.descent import descend
from tractexp.noise import Noise

ROUGH, EXACT = (12, 0.3), (40, 0.02)  # iterations and tolerance of the deviance
FIRST = 4  # iterations after which the worse half of a set's starts is given up
CLOSE = 12.0  # of the deviance: a rough refit this near the best is made exact
HOPELESS, SLOW = 60.0, 0.3  # of the deviance, and of what it spans: a set this far behind then is not refined
REACHES = 2.0 ** -np.arange(1, 10)  # of a parameter's range: how far one without a slope is moved
MOVES, WORTH = 8, 1.0  # of such parameters in a row, and the deviance that one must gain
BEGUN = 8  # starts of one set that are begun, of those that promise most
TURNS, KEPT = 3, 6  # of moving and descending in turn, and the starts that take part
SCATTERED, SPREAD, AGAIN = 24, 0.5, 3  # starts around a fit, of the range to either side, and how often
ON_BOUND = 1e-3  # of a coordinate's range: how near a bound a parameter rests on it
NESTED = 0.1  # of the deviance: a set that is worse than its own subset by more has not converged

Start = tuple[Sequence[str], np.ndarray]  # names of effects, and coordinates (D,) to start from


@dataclass(frozen=True, eq=False)
class Refit:
    """The best fit of one set of effects: coordinates (D,) of the whole bench and deviance."""

    names: tuple[str, ...]
    unit: np.ndarray
    deviance: float
    parameters: int  # of the effects

    @property
    def cost(self) -> float:
        """Akaike's criterion, by which sets of the same number of effects are compared: a parameter costs 2."""
        return self.deviance + 2 * self.parameters


def _cost(fit: Refit) -> float:
    return fit.cost


def best_of(fits: Iterable[Refit]) -> list[Refit]:
    """The best fit of each set, in order of cost."""
    best: dict[tuple[str, ...], Refit] = {}
    for fit in sorted(fits, key=lambda r: (r.cost, r.names)):
        best.setdefault(fit.names, fit)
    return list(best.values())


def refit(bench: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None = None) -> list[Refit]:
    """Fit sets of effects side by side, with the named faults of the measurement free beside each (by default all).

    Of several starts of one set the best is returned; the result is in order of cost.
    """
    return best_of(_descended(bench, noise, wanted, faults, EXACT))


def rough_refit(bench: Context, noise: Noise, wanted: Sequence[Start]) -> list[Refit]:
    """As `refit`, good enough to rank sets that are far apart; what falls behind early is given up."""
    begun = _descended(bench, noise, wanted, None, (FIRST, ROUGH[1]))
    best = best_of(begun)
    far = max(HOPELESS, SLOW * (best[-1].cost - best[0].cost))
    promising = [r.names for r in best if r.cost <= best[0].cost + far]
    again = []
    for names in promising:
        starts = sorted((r for r in begun if r.names == names), key=lambda r: r.deviance)
        again += [(names, r.unit) for r in starts[: -(-len(starts) // 2)]]
    return best_of([*best, *_descended(bench, noise, again, None, (ROUGH[0] - FIRST, ROUGH[1]))])


def wide_refit(
    bench: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None = None, again: int = AGAIN
) -> list[Refit]:  # fmt: skip
    """As `refit`, for one set whose thresholds and times have hardly a slope: moved far and descended in turn.

    A descent walks a relay's time by a sample a step, and a wrong time bends what else is fitted. Around the best it is
    begun `again` so often.
    """
    fits = _in_turns(bench, noise, wanted, faults)
    for _ in range(again if bench.coordinates.settings(fits[0].names) else 0):
        others = _in_turns(bench, noise, scattered(bench, fits[0]), faults)
        if others[0].deviance > fits[0].deviance - WORTH:
            break
        fits = others
    return refit(bench, noise, [(f.names, f.unit) for f in fits if f.cost < fits[0].cost + CLOSE], faults)


def _in_turns(bench: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None) -> list[Refit]:
    """The best of these starts, moved and descended in turn until none gains that may end best; the best first."""
    fits = _begun(bench, noise, wanted, faults)
    for _ in range(TURNS):
        moved = [(f.names, moved_across(bench, noise, f, faults)) for f in fits]
        ended = _descended(bench, noise, moved, faults, ROUGH)
        best = min(f.deviance for f in (*fits, *ended))
        gains = [before.deviance - after.deviance for before, after in zip(fits, ended, strict=True)]
        promising = [gain > max(WORTH, f.deviance - best) for gain, f in zip(gains, ended, strict=True)]
        fits = sorted((min(pair, key=lambda f: f.deviance) for pair in zip(fits, ended, strict=True)), key=_cost)
        if not any(promising):
            break
    return fits


def scattered(bench: Context, fit: Refit) -> list[Start]:
    """Starts around a fit, with all that an effect has beside its sizes moved at once, by little and by much.

    Two relays may each be at its best beside the other and still have each other's times: one parameter at a time
    leads nowhere then. The points are Roberts' (2018) sequence R_d, the fractional parts of k / phi, k / phi^2, ...
    """
    columns = bench.coordinates.settings(fit.names)
    phi = 2.0
    for _ in range(50):
        phi = (1 + phi) ** (1 / (len(columns) + 1))
    parts = np.outer(np.arange(1, SCATTERED + 1), phi ** -np.arange(1.0, len(columns) + 1)) % 1.0
    units = np.repeat(fit.unit[None], SCATTERED, axis=0)
    units[:, columns] = np.clip(units[:, columns] + SPREAD * (2 * parts - 1) ** 3, 0.0, 1.0)
    return [(fit.names, unit) for unit in units]


def wide_refits(
    bench: Context, noise: Noise, wanted: Iterable[Sequence[Start]], most: int, faults: Sequence[str] | None = None
) -> list[Refit]:  # fmt: skip
    """`wide_refit` of those `most` sets, each with starts of its own, that come nearest in a few iterations."""
    begun = each_apart(lambda starts: _begun(bench, noise, starts, faults), list(wanted))
    begun = sorted(begun, key=lambda fits: fits[0].cost)[:most]
    again = [[(f.names, f.unit) for f in fits] for fits in begun]
    return best_of(itertools.chain(*each_apart(lambda starts: wide_refit(bench, noise, starts, faults), again)))


def _begun(bench: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None) -> list[Refit]:
    """The best starts of one set after a few iterations, of those that promise most by one simulation each."""
    names = wanted[0][0]
    nuisances = [*bench.coordinates.base, *bench.coordinates.before, *_with_prior(bench, [names], faults)[0]]
    units = promising(bench, noise, names, np.array([unit for _, unit in wanted]), nuisances, BEGUN)
    return sorted(_descended(bench, noise, [(names, u) for u in units], faults, (FIRST, ROUGH[1])), key=_cost)[:KEPT]


def moved_across(bench: Context, noise: Noise, fit: Refit, faults: Sequence[str] | None = None) -> np.ndarray:
    """Coordinates (D,) with what an effect has beside its sizes moved, one parameter at a time and by any reach."""
    columns = bench.coordinates.settings(fit.names)
    if not columns:
        return fit.unit
    prior = _with_prior(bench, [fit.names], faults)[1]
    unit, deviance = fit.unit, fit.deviance
    for _ in range(MOVES):
        trials = np.repeat(unit[None], 2 * len(columns) * len(REACHES), axis=0)
        for k, mine in zip(columns, np.split(trials, len(columns)), strict=True):
            mine[:, k] = np.clip(mine[:, k] + np.r_[REACHES, -REACHES], 0.0, 1.0)
        rows = bench.rows(trials, noise, prior, [fit.names] * len(trials))
        found = np.nan_to_num(np.einsum("nr,nr->n", rows, rows), nan=np.inf)
        if not found.min() < deviance - WORTH:
            break
        unit, deviance = trials[found.argmin()], float(found.min())
    return unit


def no_worse_than_subsets(
    bench: Context, noise: Noise, refits: Mapping[tuple[str, ...], Refit], fits: Sequence[Refit]
) -> list[Refit]:  # fmt: skip
    """Refit from its best subset any set that came out worse than that subset."""
    again = []
    for fit in fits:
        subsets = [refits[s] for s in refits if set(s) < set(fit.names)]
        best = min(subsets, key=lambda r: r.deviance, default=None)
        if best is not None and fit.deviance > best.deviance + NESTED:
            again.append((fit.names, best.unit))
    if not again:
        return list(fits)
    redone = {f.names: f for f in refit(bench, noise, again)}
    return [min(f, redone.get(f.names, f), key=lambda r: r.deviance) for f in fits]


def _descended(
    bench: Context, noise: Noise, wanted: Sequence[Start], faults: Sequence[str] | None, effort: tuple[int, float]
) -> list[Refit]:
    """The end of a descent from each start; of one that was made before, as by a run that was stopped, as it was."""
    spent = 0
    at = bench.coordinates
    measured, prior = _with_prior(bench, [names for names, _ in wanted], faults)
    always = [*at.base, *at.before, *measured]
    columns = [[*always, *(k for k in at.parameters(names) if k not in always)] for names, _ in wanted]
    table = np.full((len(wanted), max(map(len, columns))), at.dimension)
    for lane, free in enumerate(columns):
        table[lane, : len(free)] = free
    starts = np.array([np.r_[start, 0.0] for _, start in wanted])  # the last column takes what no lane has

    def rows(x: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        nonlocal spent
        spent += len(x)
        whole = starts[lanes]
        np.put_along_axis(whole, table[lanes], x, axis=1)
        return bench.rows(whole[:, :-1], noise, prior, [wanted[lane][0] for lane in lanes])

    def made() -> tuple[np.ndarray, ...]:
        begin = np.take_along_axis(starts, table, axis=1)
        done = descend(rows, begin, table == at.dimension, *effort, bench.apart(len(prior)))
        return done.unit, done.deviance, np.array(spent)

    key = bench.told and store.key(bench.told, noise, [(tuple(names), unit) for names, unit in wanted], prior, effort)
    unit, deviance, simulations = store.DESCENTS.arrays(key, made)
    bench.effort.spend(int(simulations) - spent)  # of what was made before, what it took then
    np.put_along_axis(starts, table, unit, axis=1)
    return [
        Refit(tuple(sorted(names)), starts[lane, :-1].copy(), float(deviance[lane]), len(at.parameters(names)))
        for lane, (names, _) in enumerate(wanted)
    ]


def _with_prior(
    bench: Context, sets: Iterable[Sequence[str]], faults: Sequence[str] | None
) -> tuple[list[int], list[int]]:
    """The columns of the faults of the measurement that are free, and all that have a prior beside these sets."""
    at = bench.coordinates
    measured = at.parameters(at.catalogue.of_measurement if faults is None else tuple(faults))
    return measured, [*measured, *at.shapes(sorted({name for names in sets for name in names}))]


def off_bounds(bench: Context, unit: np.ndarray, to: float | None = None) -> list[np.ndarray]:
    """Coordinates (D,) with what rests on a bound of the base model back at its default or at `to`: there it has no
    slope. None where nothing rests."""
    moved, base = unit.copy(), bench.coordinates.base
    resting = base[(unit[base] <= ON_BOUND) | (unit[base] >= 1 - ON_BOUND)]
    moved[resting] = bench.coordinates.null[resting] if to is None else to
    return [moved] if len(resting) else []


def settled(bench: Context, unit: np.ndarray, noise: Noise, names: Sequence[str]) -> np.ndarray:
    """Coordinates (D,) with P0 and Q0 of each event fitted, and nothing else."""
    before = bench.coordinates.before

    def rows(x: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        whole = np.tile(unit, (len(x), 1))
        whole[:, before] = x
        return bench.rows(whole, noise, (), [names] * len(x))

    moved = unit.copy()
    moved[before] = descend(rows, unit[before][None]).unit[0]
    return moved
