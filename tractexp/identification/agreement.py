"""Several events fitted together: what each adds, and which do not fit with the rest."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tractexp.identification.uncertainty import Uncertainty
from tractexp.inference.differences import Rows
from tractexp.inference.information import Information
from tractexp.inference.least_squares import MOST_NUMBERS, descend
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.separable import Sensitivities

DISAGREES = 0.01  # p-value below which an event does not fit with the others
SUSPECTS = 4  # events that are fitted by themselves, and the others without them


def compare_events(uncertainty: Uncertainty) -> dict[str, Any]:
    """The share of each event in the precision, and the events that do not fit with the rest.

    Parameters
    ----------
    uncertainty : Uncertainty
        The estimate from all events.

    Returns
    -------
    dict
        `gains` {event: {name: width of the parameter's interval without the event, over that with
        it}}, infinite where it is not identifiable without; `odd_events`, which do not fit with the
        rest; and `notes`, a sentence on each of them.
    """
    likelihood = uncertainty.likelihood
    width = uncertainty.upper - uncertainty.lower
    _, J = uncertainty.sensitivities
    own = J.without_own

    def errors(triangle: np.ndarray) -> np.ndarray:
        return Information(uncertainty.names, uncertainty.values, width, triangle).standard_errors

    others, whole = leave_out_each([own[rows] for rows in J.rows])
    together = errors(whole)
    gains: dict[str, dict[str, float]] = {}
    for event, triangle in zip(likelihood.problem.events, others, strict=True):
        # what is not identifiable with the event is not without it either
        with np.errstate(invalid="ignore"):
            ratio = errors(triangle) / together
        gains[event.record.name] = dict(zip(uncertainty.names, ratio.tolist(), strict=True))
    odd, notes = find_disagreeing_events(uncertainty)
    return {"gains": gains, "odd_events": odd, "notes": notes}


def leave_out_each(rows: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
    """Triangles that stand for all rows but those of each event.

    The products of a triangle's rows are those of the rows it stands for: T'T = R'R.

    Parameters
    ----------
    rows : E arrays (R_e, k)
        Rows of each event.

    Returns
    -------
    list of arrays, at most k rows each
        Without each event.
    array, at most (k, k)
        Of all rows.

    Examples
    --------
    >>> others, whole = leave_out_each([np.array([[3.0]]), np.array([[4.0]])])
    >>> [abs(float(t[0, 0])) for t in (*others, whole)]
    [4.0, 3.0, 5.0]
    """
    joined = lambda above, below: np.linalg.qr(np.concatenate([above, below])).R  # noqa: E731
    nothing = rows[0][:0]
    before = list(itertools.accumulate(rows, joined, initial=nothing))
    after = list(itertools.accumulate(rows[::-1], joined, initial=nothing))[::-1]
    return [joined(a, b) for a, b in zip(before[:-1], after[1:], strict=True)], before[-1]


def find_disagreeing_events(uncertainty: Uncertainty) -> tuple[list[str], list[str]]:
    """The events that parameters of their own fit much better than shared ones, the worst first.

    The deviance of all events fitted together is compared with that of the rest plus that of the
    event alone; the difference is chi-squared with as many degrees of freedom as there are
    identifiable parameters. An event is taken out and the rest is tested again. Fits are made for
    the `SUSPECTS` events for which the difference is largest in the linearized model.

    Parameters
    ----------
    uncertainty : Uncertainty
        The estimate from all events.

    Returns
    -------
    list of str
        Names of the events.
    list of str
        A sentence on each.
    """
    from scipy.special import chdtri

    likelihood = uncertainty.likelihood
    left, odd, notes = list(range(likelihood.problem.drive.events)), list[str](), list[str]()
    freedom = max(int(np.count_nonzero(uncertainty.information.identifiable)), 1)
    name = lambda e: likelihood.problem.events[e].record.name  # noqa: E731
    linear = _linear(*uncertainty.sensitivities)
    while len(left) > 1:
        suspects = [
            left[k]
            for k in np.argsort(-_compute_excess([linear[e] for e in left]), kind="stable")[
                :SUSPECTS
            ]
        ]
        groups = [left, *([o for o in left if o != e] for e in suspects), *([e] for e in suspects)]
        deviance = _fit_groups(likelihood, uncertainty.unit, groups)
        n = len(suspects)
        excess = deviance[0] - deviance[1 : n + 1] - deviance[n + 1 :]
        worst = int(excess.argmax())
        limit = float(chdtri(freedom, DISAGREES / len(left)))
        if excess[worst] <= limit:
            break
        measured = (
            f"deviance higher by {excess[worst]:.3g} where {limit:.3g} is the limit of chance"
        )
        if len(left) == 2:
            odd += [name(e) for e in left if name(e) not in odd]
            notes.append(f"{name(left[0])} and {name(left[1])} do not fit together: {measured}")
            break
        odd.append(name(suspects[worst]))
        notes.append(f"{name(suspects[worst])} does not fit with the rest: {measured}")
        left.remove(suspects[worst])
    return odd, notes


def _linear(rows: np.ndarray, J: Sensitivities) -> list[np.ndarray]:
    """Sensitivities and, last, the rows (R,) of each event, less what its own P0 and Q0 take."""
    both = replace(J, columns=np.insert(J.columns, J.k, rows, axis=0), k=J.k + 1).without_own
    return [both[mine] for mine in J.rows]


def _compute_excess(linear: Sequence[np.ndarray]) -> np.ndarray:
    """By how much the deviance of all events is above that of the rest plus that of each, (E,), in
    the linearized model.

    The last number of a triangle is the root of the deviance that is left.
    """
    others, whole = leave_out_each(linear)
    alone = [np.linalg.qr(rows).R for rows in linear]
    least = [
        np.array([triangle[-1, -1] ** 2 for triangle in triangles]) for triangles in (others, alone)
    ]
    return whole[-1, -1] ** 2 - least[0] - least[1]


def _fit_groups(
    likelihood: Likelihood, unit: np.ndarray, groups: Sequence[Sequence[int]]
) -> np.ndarray:
    """The deviances (groups,) of the best fits to groups of events, from coordinates (D,); as many
    at once as memory allows.
    """
    together = max(1, MOST_NUMBERS // (2 * likelihood.problem.drive.measurements.size))
    parts = [groups[k : k + together] for k in range(0, len(groups), together)]
    start = np.tile(unit, (together, 1))
    ends = [
        descend(
            select_group_rows(likelihood, part),
            start[: len(part)],
            apart=likelihood.separable_columns,
        )
        for part in parts
    ]
    return np.concatenate([descent.deviance for descent in ends])


def select_group_rows(likelihood: Likelihood, groups: Sequence[Sequence[int]]) -> Rows:
    """The function of rows in which lane k counts the events of `groups[k]` alone."""
    drive = likelihood.problem.drive
    masks = np.zeros((len(groups), *drive.measurements.shape), dtype=bool)
    for mask, group in zip(masks, groups, strict=True):
        for e in group:
            mask[:, drive.part(e)] = True
    masks = masks.reshape(len(groups), -1)

    def rows(unit: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        return likelihood.of_records.rows(unit) * masks[lanes]

    return rows
