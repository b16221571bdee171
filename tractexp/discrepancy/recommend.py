"""The event that would decide between effects that fit equally well."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tractexp.discrepancy.study import Study
from tractexp.discrepancy.sure import ONE_SIDED, Rival
from tractexp.discrepancy.tangent import two_sided
from tractexp.model.drive import Drive, Excitation

DEPTHS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
DURATIONS = (0.1, 0.2, 0.4, 0.8)  # s
DECIDED = 0.95


@dataclass(frozen=True)
class Decider:
    """A dip to wait for, and how likely it is to tell the first two sets apart."""

    depth: float
    duration: float
    probability: float


def deciding_event(study: Study, tied: Sequence[Rival]) -> Decider:
    """The mildest realistic dip that tells the first two tied sets apart with 95 %, or else the most likely one.

    lambda = d'(1 + J H^-1 J')^-1 d with d the difference of both predictions, J the rival's tangent and H what the
    training events already know of it; the rival is rejected with probability Phi(sqrt(lambda) - 1.64).
    """
    first, second = tied[0], tied[1]
    options = [(d, w, _lambda(study, first, second, d, w)) for d in DEPTHS for w in DURATIONS]
    rated = [Decider(d, w, float(ndtr(np.sqrt(max(far, 0.0)) - ONE_SIDED))) for d, w, far in options]
    enough = [r for r in rated if r.probability >= DECIDED]
    return min(enough, key=lambda r: r.depth * r.duration) if enough else max(rated, key=lambda r: r.probability)


def _lambda(study: Study, truth: Rival, rival: Rival, depth: float, duration: float) -> float:
    drive = Drive.of([_dip(study, depth, duration)])
    inside = [*study.base, *study.parameters(rival.fit.names)]
    up, down = two_sided(rival.fit.unit, inside)
    width = np.array([u[k] - d[k] for u, d, k in zip(up, down, inside, strict=True)])
    points = np.concatenate([truth.fit.unit[None], rival.fit.unit[None], up, down])[:, : study.problem.space.dimension]
    values = study.problem.full(study.problem.space.from_unit(points))
    response = study.problem.model.simulate(drive, values, int(study.problem.step.substeps.max()))
    rows = rival.stage.noise.on(np.ones(drive.samples)).whiten(
        np.stack([response.P, response.Q], axis=1), drive, drive.weights > 0
    )
    k = len(inside)
    d, J = rows[0] - rows[1], (rows[2 : 2 + k] - rows[2 + k :]) / width[:, None]
    if not np.isfinite(rows).all():
        return 0.0
    R = rival.stage.projection.R
    known = (R.T @ R)[np.ix_(_order(study, rival), _order(study, rival))]
    return float(d @ d - d @ J.T @ np.linalg.pinv(known + J @ J.T, hermitian=True) @ J @ d)


def _order(study: Study, rival: Rival) -> list[int]:
    """Where the base's and the rival's parameters stand among the nuisances of its tangent."""
    nb, ne = len(study.base), len(study.before)
    return [*range(nb), *range(nb + ne, nb + ne + len(study.parameters(rival.fit.names)))]


def _dip(study: Study, depth: float, duration: float) -> Excitation:
    """A dip as the events of this study start and are sampled, with edges of two cycles."""
    event = study.events[0]
    step, lead = event.record.step, 0.3
    t = np.arange(round((lead + duration + 1.5) / step)) * step
    fall, rise = np.clip((t - lead) / 0.04, 0, 1), np.clip((t - lead - duration) / 0.04, 0, 1)
    U = event.U0 * (1 - depth * (fall - rise))
    return Excitation(
        step, U, np.zeros(len(t)), np.zeros(len(t)), event.U0, event.P0, event.Q0,
        omega_n=2 * np.pi * event.record.base.frequency, U2=np.zeros(len(t)), U20=0.0,
    )  # fmt: skip
