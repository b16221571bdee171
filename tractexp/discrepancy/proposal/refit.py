"""The shortlist refitted: the linear rank is none, for where something large is missing the base
fit is biased.

The best terms get their instants, levels and times from ever finer grids, then everything is fitted
at once, from the base fit, from the same with what rests on its bounds moved into the middle, and
from the base model's other local minima.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.proposal.library import ANSWER, Shape, Term, find_term, list_terms
from tractexp.discrepancy.proposal.screen import ScreeningFit, TermScore, score_terms
from tractexp.discrepancy.proposal.term_context import add_terms, place, read_values
from tractexp.inference.context import Context
from tractexp.inference.cores import map_on_cores
from tractexp.inference.fitting import (
    Refit,
    Start,
    move_off_bounds,
    refit,
    refit_from,
    refit_roughly,
    select_best_fits,
)
from tractexp.inference.information import compute_free_standard_errors
from tractexp.inference.wide_fit import refit_widely
from tractexp.noise import Noise

MOST, ANSWERS = 30, 15  # terms refitted, and how many at least are functions of voltage and states
MOST_ALIKE_TERMS = 4  # of one signal and clock at most, so that others are tried, too
ZOOM_ROUNDS = 3
# of the distance to a setting's neighbors on the grid: where else a zoom looks
NEIGHBOR_SHARES = (-0.75, -0.5, -0.25, 0.25, 0.5, 0.75)
EXACT_FIT_SHARE = 0.05  # of what the best explains: the terms that are fitted exactly
MOST_EXACT_FITS = 6  # of them at most
MOST_JUDGED_TERMS = 5  # of the best, that held-out events are asked about
PEAKS, PROMISING = 3, 0.7  # settings of one term, and how good the further ones are of the best
ROUND_ABOUT = 1  # how often the best term is begun anew around its fit
REGRIDDED = 3  # terms whose grid is searched anew where the base model is that of their refit
MOST_MOVED_TERMS = 2  # terms whose signal is tried in the other balances, too
MIDDLE = 0.5  # of its range: where what rests on a bound starts again
AGAIN = 10  # terms that start from the other fits of the base model, too


@dataclass(frozen=True, eq=False)
class TermFits:
    """Terms fitted under one noise, the best first, and the base model alone."""

    context: Context  # with these terms as candidates
    noise: Noise
    bare: Refit
    fits: tuple[Refit, ...]

    def term(self, fit: Refit) -> Term:
        """The term that was fitted."""
        return find_term(fit.names[0])

    def values(self, fit: Refit) -> dict[str, float]:
        """Sizes and setting of a fit's term, by their own names."""
        return read_values(self.context.coordinates, fit.unit, self.term(fit))


def shortlist_terms(screened: Sequence[TermScore]) -> list[TermScore]:
    """The most promising terms of a screen, each at its best setting, so that no kind of signal
    crowds out the others.
    """
    best: dict[str, TermScore] = {}
    for scored in screened:
        if scored.drop > 0:
            best.setdefault(scored.term.name, scored)
    alike: dict[tuple, int] = {}
    diverse = []
    for scored in best.values():
        key = scored.term.signal.name, scored.term.clock
        alike[key] = alike.get(key, 0) + 1
        if alike[key] <= MOST_ALIKE_TERMS:
            diverse.append(scored)
    answers = [f for f in diverse if f.term.signal.kind == ANSWER][:ANSWERS]
    rest = [f for f in diverse if f not in answers][: MOST - len(answers)]
    return sorted([*answers, *rest], key=lambda f: -f.drop)


def find_further_settings(
    screened: Sequence[TermScore], listed: Sequence[TermScore]
) -> list[TermScore]:
    """Further settings of terms, far from those listed on the grid of some parameter: peaks of
    their own.
    """
    more: dict[str, list[TermScore]] = {f.term.name: [f] for f in listed}
    for scored in screened:
        there = more.get(scored.term.name)
        if there and len(there) < PEAKS and all(_is_far(scored, f) for f in there):
            there.append(scored)
    return [f for there in more.values() for f in there[1:] if f.drop > PROMISING * there[0].drop]


def _is_far(a: TermScore, b: TermScore) -> bool:
    """Whether two settings differ by two places of the grid in some parameter."""

    def places(s: Shape) -> int:
        here, there = (int(np.abs(np.array(s.grid) - f.setting[s.name]).argmin()) for f in (a, b))
        return abs(there - here)

    return any(places(s) >= 2 for s in a.term.signal.shapes if s.name != "phase")


def zoom_settings(ground: ScreeningFit, scored: Sequence[TermScore]) -> list[TermScore]:
    """The same terms at better settings, each parameter moved by itself on ever finer grids."""
    best = list(scored)
    for turn in range(ZOOM_ROUNDS):
        for k in range(max((len(f.term.signal.shapes) for f in best), default=0)):
            tried = [
                (i, setting)
                for i, f in enumerate(best)
                for setting in _refine_setting(f, k, 4.0**-turn)
            ]
            again = score_terms(ground, [(best[i].term, setting) for i, setting in tried])
            for (i, _), other in zip(tried, again, strict=True):
                if other.drop > best[i].drop:
                    best[i] = other
    return sorted(best, key=lambda f: -f.drop)


def _refine_setting(scored: TermScore, which: int, scale: float) -> list[dict[str, float]]:
    """Settings between a setting and its neighbors on the grid, one parameter moved."""
    shapes = scored.term.signal.shapes
    if which >= len(shapes) or shapes[which].name == "phase":
        return []
    shape = shapes[which]
    grid = np.array(shape.grid)
    now = scored.setting[shape.name]
    near = np.sort(np.abs(grid - now))
    reach = scale * (near[near > 0][0] if (near > 0).any() else 0.1 * np.ptp(shape.bounds))
    moved = (float(np.clip(now + part * reach, *shape.bounds)) for part in NEIGHBOR_SHARES)
    return [{**scored.setting, shape.name: value} for value in dict.fromkeys(moved) if value != now]


def fit_terms(
    ground: ScreeningFit, screened: Sequence[TermScore], local_minima: Sequence[np.ndarray]
) -> TermFits:
    """Refit the shortlist of a screen; `local_minima` (D,) are other fits of the base model, in the
    terms' coordinates.
    """
    listed = shortlist_terms(screened)
    chosen = zoom_settings(ground, [*listed, *find_further_settings(screened, listed[:AGAIN])])
    likely = [f.term for f in chosen]
    context = add_terms(ground.context, [*likely, *(s for t in likely for s in list_siblings(t))])
    noise = ground.noise
    bare = refit_from(context, noise, (), ground.unit)
    fits = refit_roughly(context, noise, _list_starts(context, chosen, [ground.unit]))
    best = {f.names[0] for f in fits[:AGAIN]}
    others = [*move_off_bounds(context, ground.unit, MIDDLE), *local_minima]
    again = _list_starts(context, [f for f in chosen if f.term.name in best], others)
    fits = select_best_fits([*fits, *refit_roughly(context, noise, again)])
    fits = _search_anew(context, noise, fits, REGRIDDED)
    moved = [start for f in fits[:MOST_MOVED_TERMS] for start in start_siblings(context, noise, f)]
    fits = select_best_fits([*fits, *refit_roughly(context, noise, moved)])
    fits = _search_anew(context, noise, fits, 1, scattered=True)
    near = fits[0].cost + max(EXACT_FIT_SHARE * (bare.deviance - fits[0].deviance), 20.0)
    exact = {
        f.names: f
        for f in refit(context, noise, [f.start for f in fits[:MOST_EXACT_FITS] if f.cost <= near])
    }
    ranked = sorted((exact.get(f.names, f) for f in fits), key=lambda f: f.cost)
    return TermFits(context, noise, bare, tuple(ranked))


def _search_anew(
    context: Context, noise: Noise, fits: Sequence[Refit], most: int, *, scattered: bool = False
) -> list[Refit]:
    """The fits, with the shapes of the best terms searched over their grids and moved across their
    ranges.
    """
    again = ROUND_ABOUT if scattered else 0

    def anew(fit: Refit) -> list[Refit]:
        return refit_widely(
            context,
            noise,
            [choose_grid_start(context, noise, fit), fit.start],
            again=again,
        )

    shaped = [f for f in fits[:most] if find_term(f.names[0]).signal.shapes]
    return select_best_fits([*fits, *itertools.chain(*map_on_cores(anew, shaped, context.effort))])


def list_siblings(of: Term) -> list[Term]:
    """The terms with the same signal in other balances."""
    return [t for t in list_terms() if (t.signal, t.clock) == (of.signal, of.clock) and t != of]


def start_siblings(context: Context, noise: Noise, fit: Refit) -> list[Start]:
    """Starts of a term's siblings at its setting, where the base model is that of its own refit.

    At the first fit of the base model they may have ranked far behind, or at another setting.
    """
    chosen, values, there = _fit_without_term(context, noise, fit)
    setting = {s.name: values[s.name] for s in chosen.signal.shapes}
    return _list_starts(
        context, score_terms(there, [(t, setting) for t in list_siblings(chosen)]), [there.unit]
    )


def choose_grid_start(context: Context, noise: Noise, fit: Refit) -> Start:
    """A start for a term at the best setting of its whole grid where the base model is that of its
    own refit.

    At the first fit of the base model, which something missing bends, another setting may have
    seemed the best.
    """
    chosen, _, there = _fit_without_term(context, noise, fit)
    best = max(
        score_terms(there, [(chosen, s) for s in chosen.signal.settings]), key=lambda f: f.drop
    )
    (best,) = zoom_settings(there, [best])
    return fit.names, place(context.coordinates, fit.unit, chosen, best.setting, best.sizes)


def _fit_without_term(
    context: Context, noise: Noise, fit: Refit
) -> tuple[Term, dict[str, float], ScreeningFit]:
    """The term of a fit, its sizes and setting, and the ground of that fit without it."""
    chosen = find_term(fit.names[0])
    at = context.coordinates
    values = read_values(at, fit.unit, chosen)
    return (
        chosen,
        values,
        ScreeningFit.from_coordinates(
            context, place(at, fit.unit, chosen, values, [0.0] * len(chosen.balance.sizes)), noise
        ),
    )


def _list_starts(
    context: Context, chosen: Sequence[TermScore], units: Sequence[np.ndarray]
) -> list[Start]:
    """Each term at its one-step size on each of the base model's fits (D,)."""
    at = context.coordinates
    return [
        ((f.term.name,), place(at, unit, f.term, f.setting, f.sizes))
        for f in chosen
        for unit in units
    ]


def compute_term_errors(result: TermFits, fit: Refit) -> dict[str, float]:
    """Of a term's parameters, by their own names, all else free beside them; infinite where nothing
    is known.
    """
    context = result.context
    chosen = result.term(fit)
    at = context.coordinates
    own = at.parameters(fit.names)
    _, rows = context.linearize(fit.unit, result.noise, [*at.nuisances(()), *own], fit.names)
    spread = compute_free_standard_errors(rows[1:].T)[-len(own) :] * [
        at.width(at.names[k]) for k in own
    ]
    return dict(zip(read_values(at, fit.unit, chosen), spread.tolist(), strict=True))
