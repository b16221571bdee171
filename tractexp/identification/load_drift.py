"""What a load that drifts before its dip could do to the parameters.

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


def add_load_drift(uncertainty: Uncertainty) -> Uncertainty:
    """The judgement with what a drift of the load that the voltage does not explain could do, where
    the records show one.

    A parameter that it moves beyond its interval is weakly identified.
    """
    rows, told = _extrapolate_drifts(uncertainty)
    if not told:
        return uncertainty
    moves = _find_moves(uncertainty, rows)
    moved = ", ".join(f"{name} by {move:.2g}" for name, move in moves.items())
    note = f"{'; '.join(told)}; if it drifts on as far, that moves {moved}"
    return replace(
        uncertainty,
        notes=[*uncertainty.notes, note],
        verdicts=_object_to_moved(uncertainty, moves),
    )


def find_load_drifts(uncertainty: Uncertainty) -> list[np.ndarray]:
    """How far P and Q (2,) [pu] drift before the dip of each event, by what a fit leaves; 0 where
    they do not, and of waveforms and shipped records.
    """
    problem = uncertainty.likelihood.problem
    shipped = any(event.record.is_shipped for event in problem.events)
    if shipped or problem.drive.of_waves:
        return [np.zeros(2) for _ in problem.events]
    left = -uncertainty.likelihood.of_records.residuals(uncertainty.unit[None])[0]
    return [
        _find_drift(event, left[:, problem.drive.part(e)]) for e, event in enumerate(problem.events)
    ]


def _extrapolate_drifts(uncertainty: Uncertainty) -> tuple[np.ndarray, list[str]]:
    """P and Q (2, N) [pu] of the drifts of all events, gone on as far, and a clause on each."""
    problem = uncertainty.likelihood.problem
    rows = np.zeros(problem.drive.measurements.shape)
    told = []
    for e, (event, drift) in enumerate(
        zip(problem.events, find_load_drifts(uncertainty), strict=True)
    ):
        part = problem.drive.part(e)
        if drift.any():
            rows[:, part] = drift[:, None] * _continue_drift(event)
            told.append(_describe_drift(event, drift))
    return rows, told


def _find_moves(uncertainty: Uncertainty, rows: np.ndarray) -> dict[str, float]:
    """By how much what is added to P and Q (2, N) moves each parameter that the records tell."""
    likelihood = uncertainty.likelihood.of_records
    problem = likelihood.problem
    _, sensitivities = uncertainty.sensitivities
    seen_by = Information(
        uncertainty.names,
        uncertainty.values,
        problem.upper - problem.lower,
        sensitivities.without_own,
    )
    steps = seen_by.find_steps(likelihood.whiten(rows[None]))[0]
    return {
        name: abs(float(step))
        for name, step in zip(uncertainty.names, steps, strict=True)
        if uncertainty.verdicts[name].word != UNIDENTIFIED
    }


def _object_to_moved(
    uncertainty: Uncertainty, moves: dict[str, float]
) -> dict[str, ParameterVerdict]:
    """The verdicts, with an objection where a drift moves the parameter beyond its interval."""
    verdicts = dict(uncertainty.verdicts)
    intervals = dict(zip(uncertainty.names, uncertainty.intervals.tolist(), strict=True))
    for name, move in moves.items():
        low, high = intervals[name]
        if move > (high - low) / 2:
            why = f"the load drifts before the dip, and on as far that moves it by {move:.2g}"
            verdicts[name] = verdicts[name].add_objection(why)
    return verdicts


def _find_drift(event: Event, left: np.ndarray) -> np.ndarray:
    """How far P and Q (2,) [pu] drift over the samples before a dip, by what a fit leaves of them
    (2, N); 0 where they do not.
    """
    t = event.record.t[event.steady]
    size = float(np.hypot(event.P0, event.Q0))
    span = float(np.ptp(t))
    drift = np.zeros(2)
    for k, level in enumerate(event.levels):
        slope, _ = np.polyfit(t, left[k, event.steady], 1)
        error = level * np.sqrt(12 * NOISE_MEMORY / len(t))
        least = max(DRIFT_OVER_NOISE * error, SMALLEST_DRIFT * size)
        if abs(slope) * span > least:
            drift[k] = slope * span
    return drift


def _continue_drift(event: Event) -> np.ndarray:
    """The course (N,) of a drift by 1 before the dip, about its mean there, and by 1 after."""
    t = event.record.t
    before = t[event.steady]
    span = max(float(np.ptp(before)), event.record.step)
    return np.clip((t - before[0]) / span, 0.0, 2.0) - 0.5


def _describe_drift(event: Event, drift: np.ndarray) -> str:
    """A drift of P and Q (2,) [pu] before a dip, as a clause."""
    shares = 100 * drift / np.hypot(event.P0, event.Q0)
    parts = [f"{name} by {share:+.2g} %" for name, share in zip("PQ", shares, strict=True) if share]
    return (
        f"before the dip of {event.record.name} the load drifts, {' and '.join(parts)} of the"
        " apparent power, for another reason than the voltage"
    )
