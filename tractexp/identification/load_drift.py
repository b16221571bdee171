"""What a load that is not steady before its dip could do to the parameters.

P0 and Q0 are means before the dip, and what a model leaves of a drift is no noise. Nobody knows how
the load would have gone on: told is how far each parameter moves where it drifts on as far as it
was seen to, to first order.
"""

from dataclasses import replace

import numpy as np

from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import UNIDENTIFIED, ParameterVerdict
from tractexp.inference.information import Information
from tractexp.record import Event

SMALLEST_DRIFT = 0.005  # of the apparent power before the dip: what drifts less is not told
DRIFT_OVER_NOISE = 4.0  # standard errors of a slope, of noise whose every tenth sample is new
NOISE_MEMORY = 10.0  # samples


def with_load_drift(uncertainty: Uncertainty) -> Uncertainty:
    """The judgement with what a drift of the load that the voltage does not explain could do, where
    the records show one.

    A parameter that it moves beyond its interval is weakly identified.
    """
    problem, likelihood = uncertainty.likelihood.problem, uncertainty.likelihood.of_records
    if problem.drive.of_waves or any(event.record.is_shipped for event in problem.events):
        return uncertainty
    left = -likelihood.residuals(uncertainty.unit[None])[0]
    rows, told = np.zeros(left.shape), []
    for e, event in enumerate(problem.events):
        part = problem.drive.part(e)
        drift = _find_drift(event, left[:, part])
        rows[:, part] = drift[:, None] * _drift_on(event)
        told += [_describe_drift(event, drift)] if drift.any() else []
    if not told:
        return uncertainty
    _, sensitivities = uncertainty.sensitivities
    width = problem.upper - problem.lower
    seen_by = Information(uncertainty.names, uncertainty.values, width, sensitivities.without_own)
    moves = np.abs(seen_by.find_steps(likelihood.whiten(rows[None])))[0]
    by_name = {
        name: float(move)
        for name, move in zip(uncertainty.names, moves, strict=True)
        if uncertainty.verdicts[name].word != UNIDENTIFIED
    }
    moved = ", ".join(f"{name} by {move:.2g}" for name, move in by_name.items())
    note = f"{'; '.join(told)}; if it drifts on as far, that moves {moved}"
    verdicts = _object_to_moved(uncertainty, by_name)
    return replace(uncertainty, notes=[*uncertainty.notes, note], verdicts=verdicts)


def _describe_drift(event: Event, drift: np.ndarray) -> str:
    """A drift of P and Q (2,) [pu] before a dip, as a clause."""
    shares = 100 * drift / np.hypot(event.P0, event.Q0)
    parts = [f"{name} by {share:+.2g} %" for name, share in zip("PQ", shares, strict=True) if share]
    return (
        f"before the dip of {event.record.name} the load drifts, {' and '.join(parts)} of the"
        " apparent power, for another reason than the voltage"
    )


def _object_to_moved(
    uncertainty: Uncertainty, moves: dict[str, float]
) -> dict[str, ParameterVerdict]:
    """The verdicts, with an objection where a drift moves the parameter beyond its interval."""
    verdicts = dict(uncertainty.verdicts)
    for name, (low, high) in zip(uncertainty.names, uncertainty.intervals.tolist(), strict=True):
        if moves.get(name, 0.0) > (high - low) / 2:
            why = (
                f"the load drifts before the dip, and on as far that moves it by {moves[name]:.2g}"
            )
            verdicts[name] = verdicts[name].add_objection(why)
    return verdicts


def _find_drift(event: Event, left: np.ndarray) -> np.ndarray:
    """How far P and Q (2,) [pu] drift over the samples before a dip, by what a fit leaves of them
    (2, N); 0 where they do not.
    """
    t, drift = event.record.t[event.steady], np.zeros(2)
    size = float(np.hypot(event.P0, event.Q0))
    for k, values in enumerate(left[:, event.steady]):
        span, slope = float(np.ptp(t)), float(np.polyfit(t, values, 1)[0])
        error = event.levels[k] * np.sqrt(12 * NOISE_MEMORY / len(t))
        if abs(slope) * span > max(DRIFT_OVER_NOISE * error, SMALLEST_DRIFT * size):
            drift[k] = slope * span
    return drift


def _drift_on(event: Event) -> np.ndarray:
    """The course (N,) of a drift by 1 before the dip, about its mean there, and by 1 after."""
    t, part = event.record.t, event.steady
    first, last = float(t[part.start]), float(t[part.stop - 1])
    span = max(last - first, event.record.step)
    return np.clip((t - first) / span, 0.0, 2.0) - 0.5
