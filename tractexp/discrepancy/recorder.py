"""Whether what the base model leaves is the work of the recorder: phasors averaged over whole cycles.

It is looked for before anything else. A window that the recorder does not have makes the voltage bend where the power
does not: that costs much, with effects in the load or without. So one is believed that helps clearly, or at least as
much as the best effect does.
"""

from collections.abc import Callable, Mapping, Sequence

from tractexp.discrepancy.catalogue import Catalogue
from tractexp.discrepancy.phasors import Phasors, windows_of
from tractexp.discrepancy.study import Study
from tractexp.discrepancy.which import Stage, stage
from tractexp.model.model import Model
from tractexp.record import Event

LEAST = 10.0  # of the deviance: what a window must explain
BEHIND = 5.0  # of it: what the best effect may explain beyond that, for effects have parameters to fit
CLEAR, SHARE = 30.0, 0.05  # of it, and of what the best effect explains: enough, for there may be both


def opened(
    model: Model, catalogue: Catalogue, events: Sequence[Event], bounds: Mapping[str, Sequence[float]],
    fixed: Mapping[str, float], seed: int, tell: Callable[[str], None],
) -> tuple[Study, Stage]:  # fmt: skip
    """The study of the events and the tests of its base model, behind the recorder's window if it has one."""
    study = Study(model, catalogue, events, bounds, fixed)
    first = stage(study, *study.base_fit(), seed)
    best = max((s.drop for s in first.scores), default=0.0)
    found, least = None, max(LEAST, min(best - BEHIND, max(CLEAR, SHARE * best)))
    windows = {} if first.noise.blurred else windows_of(study.events)  # noise of the voltage would pass for one
    for cycles, window in windows.items():
        phasors = Phasors(window)
        behind = Study(model.behind(phasors), catalogue, events, bounds, fixed, study.kernels.substeps)
        behind.starts = study.starts  # the load's valleys: no window moves them far
        begun = behind.rough_refit(first.noise, [((), start) for start in (first.fit.unit, *behind.starts)])[0]
        fit = behind.refit(first.noise, [((), begun.unit)])[0]
        gained = first.fit.deviance - fit.deviance
        if cycles == 1 and gained <= 0:
            break  # an average over several cycles is one of averages over one
        if gained > least:
            found, least = (behind, fit, phasors), gained
    if found is None:
        return study, first
    study, fit, phasors = found
    tell(f"{phasors.describe()}: taken into account from here on")
    return study, stage(study, *study.base_fit([fit.unit]), seed)
