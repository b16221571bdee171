"""Whether what a model leaves is the work of the recorder: phasors averaged over whole cycles.

It is looked for before any effect is, among whole cycles where the records do not say what it is. A
window that the recorder does not have makes the voltage bend where the power does not: that costs
much, with effects in the load or without. So one is believed that explains half as much as the best
effect; one that the records say, where it shows. A model that lacks something large may gain
nothing by the right window. So where an explanation has faults of the measurement beside it, it is
fitted behind each window, too: one that leaves no such fault takes their place.
"""

from collections.abc import Sequence

from tractexp.discrepancy.disagreement import Disagreement, examine_base_fit, examine_fit
from tractexp.inference.base_fit import BaseFit, fit_from_starts
from tractexp.inference.chance import BLURRED
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit, refit_from, refit_roughly
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.inference.recorder_window import list_recorder_windows
from tractexp.inference.records import Records
from tractexp.noise import Noise

# of what the best effect explains, that a window must: what lacks much takes a wrong one for a part
WINDOW_SHARE = 0.5


def search_recorder_window(
    base: BaseFit, first: Disagreement, seed: int
) -> tuple[BaseFit, Disagreement]:
    """The base model's fit and tests behind the recorder's window, where there is one; else those
    given.
    """
    context = base.context
    noise = first.noise
    if not context.domain.windowed:
        return base, first
    # the model is of a kind that is always looked at through what the records say
    if context.drive.windows:
        return base, first
    if noise.loudest_input_mode > BLURRED:  # noise of the voltage would pass for a window
        return base, first
    # the context behind each window, and the base model fitted there
    tried: list[tuple[Context, Refit]] = []
    for window in list_recorder_windows(context.events):
        if tried and not tried[0][1].deviance < first.fit.deviance and window.averages:
            continue  # an average over several cycles is one of averages over one
        behind = context.move_to_records(Records.from_events(context.records.recorded, window))
        local_minima = (first.fit.unit, *base.local_minima)  # the load's: no window moves them far
        begun = refit_roughly(behind, noise, [((), start) for start in local_minima])[0]
        tried.append((behind, refit_from(behind, noise, (), begun.unit)))
    believed = _choose_window(tried, first) if tried else None
    if believed is None:
        return base, first
    behind, fit = believed
    assert behind.records.window is not None
    context.effort.say(f"{behind.records.window.describe()}: taken into account from here on")
    base = fit_from_starts(behind, [fit.unit], base.local_minima)
    return base, examine_base_fit(base, seed)


def _choose_window(
    tried: Sequence[tuple[Context, Refit]], first: Disagreement
) -> tuple[Context, Refit] | None:
    """The context behind the window that helps most and the base model's fit there, where it helps
    enough.

    None where an effect explains far more than any window does: what lacks something large takes a
    wrong window for a part of it. Without stator transients one of two cycles fits better than the
    right one.
    """
    best = min(tried, key=lambda one: one[1].deviance)
    most = max((s.drop for s in first.scores), default=0.0)
    window = best[0].records.window
    least = first.criteria.shown
    if window is None or not window.said:  # that the recorder has a window it says is no guess
        least = max(least, WINDOW_SHARE * most)
    return best if first.fit.deviance - best[1].deviance > least else None


def replace_faults_by_window(
    base: BaseFit, bare: Refit, best: Refit, noise: Noise, seed: int
) -> BaseFit | None:
    """The base model's fit behind the recorder's window that does away with the faults of the
    measurement which the best explanation has beside it; None where there is none. Windows are
    tried as long as they leave less than a shorter one. `bare` is the base model's fit without a
    window.
    """
    context = base.context
    if not context.domain.windowed or context.drive.windows:
        return None
    tests = examine_fit(base.quiet, best, noise, seed)
    for window in list_recorder_windows(context.events) if tests.faults else ():
        behind = context.move_to_records(Records.from_events(context.records.recorded, window))
        fit = refit_from(behind, tests.noise, best.names, best.unit)
        if not fit.deviance < bare.deviance:
            break  # it costs more than the explanation gains
        quiet = QuietNoise.from_context(behind, fit.unit)
        there = examine_fit(quiet, fit, tests.noise, seed)
        if there.adequate and not there.faults:
            context.effort.say(f"{window.describe()}: taken into account from here on")
            return fit_from_starts(behind, [bare.unit], base.local_minima)
        if there.p_left < tests.p_left:
            break
        tests = there
    return None
