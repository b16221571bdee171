"""Several events fitted together: what each adds, and which do not fit with the rest."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp import files
from tractexp.identification.descent import MOST_NUMBERS, Rows, descend
from tractexp.identification.information import Information
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.uncertainty import Uncertainty

DISAGREES = 0.01  # p-value below which an event does not fit with the others


@dataclass(frozen=True, eq=False)
class EventAgreement:
    """What each of several events adds. `gains` {event: {name: width of the interval without it over with it}}."""

    gains: dict[str, dict[str, float]]
    odd: list[str]
    notes: list[str]

    def fields(self) -> dict[str, Any]:
        """What `result.json` gains; None where a parameter is not identifiable without the event."""
        return {"gains": files.plain(self.gains), "odd_events": self.odd}


def compare_events(uncertainty: Uncertainty) -> EventAgreement:
    """Each event's share in the precision, and the events that do not fit with the rest (deviance test)."""
    likelihood = uncertainty.likelihood
    _, J = likelihood.of_records.jacobian(uncertainty.unit)
    free, width = likelihood.free, uncertainty.upper - uncertainty.lower

    def information(own: np.ndarray, nuisances: np.ndarray) -> Information:
        return Information.of(uncertainty.names, uncertainty.values, width, own, nuisances)

    def errors(triangles: Sequence[np.ndarray]) -> np.ndarray:
        return information(np.concatenate(triangles), np.empty((sum(map(len, triangles)), 0))).standard_errors

    own_rows = [J[likelihood.part_of(e)] for e in range(likelihood.problem.drive.events)]
    triangles = [np.linalg.qr(information(J[:, :free], J[:, free:]).J).R for J in own_rows]
    whole = errors(triangles)
    gains: dict[str, dict[str, float]] = {}
    for e, event in enumerate(likelihood.problem.events):
        with np.errstate(invalid="ignore"):  # what is not identifiable with the event is not without it either
            ratio = errors(triangles[:e] + triangles[e + 1 :]) / whole
        gains[event.record.name] = dict(zip(uncertainty.names, ratio.tolist(), strict=True))
    odd, notes = disagreeing(uncertainty)
    return EventAgreement(gains, odd, notes)


def disagreeing(uncertainty: Uncertainty) -> tuple[list[str], list[str]]:
    """Events that separate parameters fit much better than shared ones do, the worst first, one at a time.

    Compares the deviance of all events fitted together with that of the rest plus that of the event alone; the
    difference is chi-squared with as many degrees of freedom as there are identifiable parameters.
    """
    from scipy.special import chdtri

    likelihood = uncertainty.likelihood
    left, odd, notes = list(range(likelihood.problem.drive.events)), [], []
    freedom = max(int(np.count_nonzero(uncertainty.information.identifiable)), 1)
    name = lambda e: likelihood.problem.events[e].record.name  # noqa: E731
    while len(left) > 1:
        groups = [left, *([o for o in left if o != e] for e in left), *([e] for e in left)]
        deviance = _deviances(likelihood, uncertainty.unit, groups)
        n = len(left)
        excess = deviance[0] - deviance[1 : n + 1] - deviance[n + 1 :]
        worst = int(excess.argmax())
        limit = float(chdtri(freedom, DISAGREES / n))
        if excess[worst] <= limit:
            break
        measured = f"deviance higher by {excess[worst]:.3g} where {limit:.3g} is the limit of chance"
        if n == 2:
            odd += [name(e) for e in left if name(e) not in odd]
            notes.append(f"{name(left[0])} and {name(left[1])} do not fit together: {measured}")
            break
        odd.append(name(left[worst]))
        notes.append(f"{name(left[worst])} does not fit with the rest: {measured}")
        del left[worst]
    return odd, notes


def _deviances(likelihood: Likelihood, unit: np.ndarray, groups: Sequence[Sequence[int]]) -> np.ndarray:
    """What the best fits to groups of events alone leave, from coordinates (D,), as many at once as memory allows."""
    together = max(1, MOST_NUMBERS // (2 * likelihood.problem.drive.measured.size))
    parts = [groups[k : k + together] for k in range(0, len(groups), together)]
    start = np.tile(unit, (together, 1))
    ends = [descend(only(likelihood, part), start[: len(part)], apart=likelihood.apart) for part in parts]
    return np.concatenate([descent.deviance for descent in ends])


def only(likelihood: Likelihood, groups: Sequence[Sequence[int]]) -> Rows:
    """Rows in which lane k counts the events of `groups[k]` alone."""
    parts = np.array([likelihood.part_of(e) for e in range(likelihood.problem.drive.events)])
    masks = np.array([parts[list(group)].any(axis=0) for group in groups])

    def rows(unit: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        return likelihood.of_records.rows(unit) * masks[lanes]

    return rows
