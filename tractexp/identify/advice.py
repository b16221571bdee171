"""What to do next, computed from what an identification leaves open."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tractexp.identify.information import SHARE
from tractexp.identify.plan import Shape, depth_needed, over_depth
from tractexp.identify.uncertainty import Uncertainty
from tractexp.identify.verdict import BOUND, UNIDENTIFIED, WEAK, WITHIN

TIGHTEST = 0.02  # of the value: no dip is asked to do better


def advise(known: Uncertainty, odd: Sequence[str] = ()) -> list[str]:
    """Sentences, the most pressing first. `odd` events do not fit with the rest."""
    missing = any("an effect is missing" in note for note in known.notes)
    said = ["find the missing effect: task=discrepancy"] * missing
    said += [f"leave {name} out, or free what differs there by model.per_event" for name in odd]
    said += [
        f"widen model.bounds.{name}, or ask whether the model is the right one"
        for name, verdict in known.verdicts.items()
        if verdict.word == BOUND
    ]
    for direction in known.information.unseen:
        tied = [n for n, share in zip(known.names, direction, strict=True) if abs(share) > SHARE]
        if len(tied) > 1:
            said.append(f"fix one of {', '.join(tied)} by model.fixed: no record of this kind can tell them apart")
        else:
            said.append(f"fix {tied[0]} by model.fixed: the record does not change with it")
    return [*said, *_deeper(known)] or ["nothing: every parameter is identified"]


def _deeper(known: Uncertainty) -> list[str]:
    """Which further dip would identify what is open but not structurally so."""
    identifiable = known.information.identifiable
    poor = [
        name
        for name, fine in zip(known.names, identifiable, strict=True)
        if fine and known.verdicts[name].word in (WEAK, UNIDENTIFIED)
    ]
    problem = known.likelihood.problem
    if not poor or problem.per_event or not identifiable.all():
        return []
    deepest = int(np.argmax([e.depth for e in problem.events]))
    shape = Shape.of(problem.events[deepest])
    forecasts = over_depth(problem, known.values, shape, known.information, [known.likelihood.noise[deepest]])
    said = []
    for name in poor:
        goal = _goal(known, known.names.index(name))
        needed = depth_needed(forecasts, name, goal)
        if needed.depth is None:
            longer = replace(shape, depth=float(needed.depths[np.argmin(needed.relative)]))
            said.append(
                f"for {name}: no single further dip of {1000 * shape.duration:.0f} ms will do; the best, of"
                f" {100 * longer.depth:.0f} %, would give ± {100 * needed.relative.min():.2g} %; record several, or fix"
                " what it trades against by model.fixed"
            )
        else:
            said.append(
                f"for {name}: record another dip of {100 * needed.depth:.0f} % or more for"
                f" {1000 * shape.duration:.0f} ms, fitted together with this one: ± {100 * goal:.2g} %"
            )
    return said


def _goal(known: Uncertainty, j: int) -> float:
    """Half an interval, as a share of the value, that is narrow enough and keeps off the bounds."""
    value = known.values[j]
    room = min(value - known.lower[j], known.upper[j] - value)
    return max(min(WITHIN, room / max(abs(value), 1e-12)), TIGHTEST)
