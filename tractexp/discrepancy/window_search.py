"""Whether what the base model leaves is the work of the recorder: phasors averaged over whole cycles.

It is looked for before any effect is, among whole cycles where the records do not say what it is. A window that the
recorder does not have makes the voltage bend where the power does not: that costs much, with effects in the load or
without. So one is believed that helps clearly, or at least as much as the best effect does; one that the records say,
where it helps at all, for a model may lack what a sharper voltage calls for.
"""

from collections.abc import Sequence

from tractexp.discrepancy.base_fit import BaseFit, fitted_from
from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.disagreement import Disagreement, disagreement
from tractexp.discrepancy.explanations import starts
from tractexp.discrepancy.fitting import Refit, refit, rough_refit
from tractexp.discrepancy.recorder_window import windows_of
from tractexp.discrepancy.records import Records


def behind_recorder(base: BaseFit, first: Disagreement, seed: int) -> tuple[BaseFit, Disagreement]:
    """The base model's fit and tests behind the recorder's window, where there is one; else those given."""
    bench, noise = base.bench, first.noise
    believed: list[tuple[Bench, Refit]] = []
    if bench.waves:  # samples have no window
        return base, first
    if bench.drive.windows:  # the model is of a kind that is always looked at through what the records say
        return base, first
    if noise.loudest_blur > bench.criteria.blurred:  # noise of the voltage would pass for a window
        return base, first
    least = bench.criteria.least_window(max((s.drop for s in first.scores), default=0.0))
    for k, window in enumerate(windows_of(bench.events)):
        behind = bench.on(Records.of(bench.records.recorded, window))
        valleys = (first.fit.unit, *base.valleys)  # the load's: no window moves them far
        begun = rough_refit(behind, noise, [((), start) for start in valleys])[0]
        fit = refit(behind, noise, [((), begun.unit)])[0]
        gained = first.fit.deviance - fit.deviance
        if k == 0 and gained <= 0:
            break  # an average over several cycles is one of averages over one
        if gained > (0.0 if window.known else least):  # that the recorder has a window it says is no guess
            believed.append((behind, fit))
    if not believed:
        return base, first
    behind, fit = _likeliest(believed, first)
    assert behind.records.window is not None
    bench.effort.say(f"{behind.records.window.describe()}: taken into account from here on")
    base = fitted_from(behind, [fit.unit], base.valleys)
    return base, disagreement(base, seed)


def _likeliest(believed: Sequence[tuple[Bench, Refit]], first: Disagreement) -> tuple[Bench, Refit]:
    """The window behind which the base model fits best or, where an effect explains more than any does, it with that.

    What lacks something large takes a wrong window for a part of it: without stator transients, one of two cycles.
    """
    best = min(believed, key=lambda one: one[1].deviance)
    gained = first.fit.deviance - best[1].deviance
    if len(believed) == 1 or not first.scores or first.scores[0].drop < gained:
        return best
    begun = starts([first], {}, (first.scores[0].name,))
    return min(believed, key=lambda one: refit(one[0], first.noise, begun)[0].deviance)
