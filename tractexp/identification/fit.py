"""What a model calculates of each event that was fitted or held out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.domain import Playback, find_domain
from tractexp.errors import UserError
from tractexp.inference.model_error import compute_model_error
from tractexp.inference.problem import Problem
from tractexp.model.drive import Drive
from tractexp.model.model import Model
from tractexp.record import Event

TRAIN, VALIDATE = "train", "validate"


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit(Playback):
    """Measured and calculated power of one event that was fitted or held out."""

    role: str  # TRAIN or VALIDATE

    def to_dict(self) -> dict[str, Any]:
        """As `result.json` has it; where Q is a small share of S, Eq. (20) divides its error by
        little.
        """
        record = self.event.record
        share = float(
            np.sqrt(np.nansum(record.Q**2) / max(np.nansum(record.P**2 + record.Q**2), 1e-30))
        )
        row: dict[str, Any] = {"name": record.name, "role": self.role}
        row |= {"epsilon_p": self.epsilon_p, "epsilon_q": self.epsilon_q, "Q_over_S": share}
        return (
            row
            if self.epsilon_i is None
            else row | {"epsilon_i": self.epsilon_i, "unsettled": self.unsettled}
        )


def respond(model: Model, values: np.ndarray, event: Event, role: str) -> Fit:
    """Play one event through the model. Raises `UserError` where these parameters have no steady
    state there.
    """
    domain = find_domain(model)
    event = domain.event(event)
    drive = Drive.from_events([domain.excitation(event, model)])
    if refusal := model.refusal(values, drive):
        raise UserError(f"{event.record.name}: {refusal}")
    substeps, _ = model.substeps(drive, values)
    response = model.simulate(drive, values, substeps)
    return Fit(role=role, **vars(domain.comparison(event, response.outputs[:, 0])))


def explain_refusal(model: Model, values: np.ndarray, event: Event) -> str:
    """Return why an event cannot be played through the model at these values; "" where it can."""
    domain = find_domain(model)
    return (
        model.refusal(values, Drive.from_events([domain.excitation(domain.event(event), model)]))
        or ""
    )


def tabulate_model_errors(fits: Sequence[Fit]) -> dict[str, Any]:
    """The model's error on the fitted events together, on those held out, and on each."""
    held_out = [f for f in fits if f.role != TRAIN]
    each = [
        {"name": f.event.record.name, "role": f.role, **compute_model_error([f]).to_dict()}
        for f in fits
    ]
    fitted = compute_model_error([f for f in fits if f.role == TRAIN]).to_dict()
    return {
        **fitted,
        "held_out": compute_model_error(held_out).to_dict() if held_out else None,
        "events": each,
    }


def play(problem: Problem, free: np.ndarray, validate: Sequence[Event] = ()) -> list[Fit]:
    """The fitted events at free values (d,), then those of `validate`, at which
    nothing was fitted.
    """
    own = problem.by_event(free)[:, 0]
    fits = [
        respond(problem.model, v, event, TRAIN)
        for v, event in zip(own, problem.events, strict=True)
    ]
    shared = problem.full(free)[0]
    return fits + [respond(problem.model, shared, event, VALIDATE) for event in validate]
