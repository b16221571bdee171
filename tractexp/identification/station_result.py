"""What all dips of a load tell as one identified model: at the load that it usually is, with the
share of motors that is expected, so that it predicts and exports as any other result does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from tractexp.cache import provenance
from tractexp.identification.adequacy import Adequacy, Grade, ResidualTest, grade_errors
from tractexp.identification.conclude import describe_active_bounds, list_at_bound
from tractexp.identification.fit import Fit, tabulate_model_errors
from tractexp.identification.result import Result
from tractexp.identification.station import LoadSpec, SharedFit
from tractexp.identification.station_constants import Constants
from tractexp.inference.model_error import compute_model_error, compute_relative_errors
from tractexp.record import OwnBase
from tractexp.record.identity import Identity

NOT_JUDGED = ResidualTest(None, "", None, "")  # of noise nothing is said


def build_result(
    spec: LoadSpec,
    fit: SharedFit,
    constants: Constants,
    share: float,
    next_dip: Mapping[str, Any],
    node: Mapping[str, Any],
    predicted: Sequence[Fit],
) -> Result:
    """The model of a load as all its dips tell it, as a result that predicts and exports.

    It is on the base of the load's median apparent power, and graded by the dips it was fitted to
    and those that models before it predicted.

    Parameters
    ----------
    spec : LoadSpec
        Which load it is.
    fit : SharedFit
        The fit to all its dips.
    constants : Constants
        What all dips share, with intervals.
    share : float
        Share of P that the motors draw.
    next_dip : mapping
        The band of the next dip, as `result.json` has it.
    node : mapping
        The model as configured.
    predicted : sequence of Fit
        What models fitted to other dips calculate of each.

    Returns
    -------
    Result
    """
    problem = fit.problem
    usual = _find_usual(fit)
    event = fit.dips[usual].event
    torque = float(np.clip(share * event.P0, *_find_range(fit)))
    values = dict(zip(problem.model.names, fit.spell_parameters(torque).tolist(), strict=True))
    played = [fit.fits[k] for k in fit.regular]
    epsilon_p, epsilon_q = compute_relative_errors(played)
    squares = [_sum_squares(one) for one in played]
    return Result(
        parameters=values,
        objective=float(np.mean(squares)),
        epsilon_p=epsilon_p,
        epsilon_q=epsilon_q,
        simulations=0,
        refused=0,
        iterations=0,
        seconds=0.0,
        status=f"fitted to {len(played)} dips",
        seed=0,
        events=[one.to_dict() for one in played],
        at_bound=list_at_bound(problem, fit.values),
        units={p.name: p.unit for p in problem.parameters},
        bounds={p.name: list(p.bounds) for p in problem.parameters},
        model=dict(node),
        before={
            "U0": event.U0,
            "P0": event.P0,
            "Q0": event.Q0,
            "frequency": event.record.base.frequency,
        },
        model_error=tabulate_model_errors(played),
        adequacy=_grade(fit, played, predicted).to_dict(),
        next_dip=dict(next_dip),
        intervals=_scale_intervals(fit, constants, torque),
        notes=["the motors' share is that expected over all dips; constants are those of all"],
        records=_list_records(played),
        own_base=asdict(OwnBase.from_record(event.record)),
        tractexp_version=provenance.read_version(),
        commit=provenance.find_commit(),
    )


def _grade(fit: SharedFit, played: Sequence[Fit], predicted: Sequence[Fit]) -> Adequacy:
    """What the model is good for, by what it leaves: noise is not asked."""
    fitted = compute_model_error(played)
    ahead = compute_model_error(predicted) if predicted else None
    torques = [fit.problem.space.names[k] for k in fit.problem.shares]
    bounds = describe_active_bounds(fit.problem, fit.values, torques)
    graded = grade_errors(NOT_JUDGED, fitted, ahead, bounds)
    if graded.grade is Grade.WRONG_MODEL:
        return graded
    sentence = f"the model describes this load within {fitted}"
    if ahead is not None:
        sentence += f", dips that it did not know within {ahead}"
    return replace(graded, sentence=sentence)


def _find_usual(fit: SharedFit) -> int:
    """The dip before which the load drew the median apparent power."""
    powers = [OwnBase.from_record(fit.dips[k].event.record).power for k in fit.regular]
    order = np.argsort(powers, kind="stable")
    return fit.regular[int(order[len(order) // 2])]


def _find_range(fit: SharedFit) -> tuple[float, float]:
    """The least and the greatest torque [pu]."""
    at = fit.problem.shares[0]
    return float(fit.problem.lower[at]), float(fit.problem.upper[at])


def _sum_squares(one: Fit) -> float:
    """The mean squared error of a dip, of P plus that of Q [pu²]."""
    record = one.event.record
    left = (one.P - record.P) ** 2 + (one.Q - record.Q) ** 2
    return float(np.nanmean(left))


def _scale_intervals(fit: SharedFit, constants: Constants, torque: float) -> dict[str, list[float]]:
    """95 % intervals of the constants where the motors draw so much [pu]."""
    problem = fit.problem
    exponents = dict(zip(problem.model.names, problem.exponents.tolist(), strict=True))
    names = constants.information.names
    return {
        name: [end * torque ** exponents[name] for end in ends]
        for name, ends in zip(names, constants.intervals.tolist(), strict=True)
    }


def _list_records(played: Sequence[Fit]) -> list[dict[str, Any]]:
    """The records that a result stands on, as `result.json` lists them."""
    records = []
    for one in played:
        record = one.event.record
        row: dict[str, Any] = {"name": record.name, "role": one.role}
        records.append(row | Identity.from_record(record).to_dict())
    return records
