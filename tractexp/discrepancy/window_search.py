"""Whether what the base model leaves is the work of the recorder: phasors averaged over whole cycles.

It is looked for before any effect is, among whole cycles where the records do not say what it is. A window that the
recorder does not have makes the voltage bend where the power does not: that costs much, with effects in the load or
without. So one is believed that helps clearly, or at least as much as the best effect does; one that the records say,
where it helps at all, for a model may lack what a sharper voltage calls for.
"""

from tractexp.discrepancy.base_fit import BaseFit, fitted_from
from tractexp.discrepancy.disagreement import Disagreement, disagreement
from tractexp.discrepancy.fitting import refit, rough_refit
from tractexp.discrepancy.recorder_window import windows_of
from tractexp.discrepancy.records import Records


def behind_recorder(base: BaseFit, first: Disagreement, seed: int) -> tuple[BaseFit, Disagreement]:
    """The base model's fit and tests behind the recorder's window, where there is one; else those given."""
    bench, noise, best = base.bench, first.noise, None
    if bench.waves:  # samples have no window
        return base, first
    if bench.drive.windows:  # the model is of a kind that is always looked at through what the records say
        return base, first
    if noise.loudest_blur > bench.criteria.blurred:  # noise of the voltage would pass for a window
        return base, first
    least = bench.criteria.least_window(max((s.drop for s in first.scores), default=0.0))
    for k, window in enumerate(windows_of(bench.events)):
        behind = bench.on(Records.of(bench.records.recorded, window))
        starts = (first.fit.unit, *base.valleys)  # the load's valleys: no window moves them far
        begun = rough_refit(behind, noise, [((), start) for start in starts])[0]
        fit = refit(behind, noise, [((), begun.unit)])[0]
        gained = first.fit.deviance - fit.deviance
        if k == 0 and gained <= 0:
            break  # an average over several cycles is one of averages over one
        if gained > (0.0 if window.known else least):  # that the recorder has a window it says is no guess
            best, least = (behind, fit), gained
    if best is None:
        return base, first
    behind, fit = best
    assert behind.records.window is not None
    bench.effort.say(f"{behind.records.window.describe()}: taken into account from here on")
    base = fitted_from(behind, [fit.unit], base.valleys)
    return base, disagreement(base, seed)
