"""The event that would decide between effects that fit equally well."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.survivors import Rival
from tractexp.discrepancy.tangent import two_sided
from tractexp.identification.problem import WEIGHTS
from tractexp.model.drive import Drive, Excitation, Waveforms
from tractexp.record import WaveEvent

DEPTHS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
DURATIONS = (0.1, 0.2, 0.4, 0.8)  # s
BRIEF = (0.04, 0.08, 0.16, 0.32)  # s, of waveforms: as long as their recorders go on
EDGE, SUDDEN = 0.04, 0.002  # s, within which the voltage of phasors and of waveforms falls and rises
ONE_SIDED = 1.6449  # standard deviations: 5 %


@dataclass(frozen=True)
class NextDip:
    """A dip to wait for, and how likely it is to tell the first two sets apart."""

    depth: float
    duration: float
    probability: float
    longest: float = DURATIONS[-1]  # s, of the dips that were tried

    def sentence(self, first: str, second: str, decided: float) -> str:
        """What to wait for, and how surely it tells two explanations apart; `decided` is how surely it should."""
        dip = f"a dip of {self.depth:.0%} or more lasting {1000 * self.duration:.0f} ms"
        if self.probability >= decided:
            return f"record {dip}: it tells {first} from {second} with a probability of {self.probability:.0%}"
        return (
            f"no dip of up to {DEPTHS[-1]:.0%} and {1000 * self.longest:.0f} ms is sure to tell {first} from {second};"
            f" {dip} does so with a probability of {self.probability:.0%}"
        )


def next_dip(bench: Bench, tied: Sequence[Rival]) -> NextDip:
    """The mildest realistic dip that tells the first two tied sets apart as surely as asked, or else the surest.

    lambda = d'(1 + J H^-1 J')^-1 d with d the difference of both predictions, J the rival's tangent and H what the
    training events already know of it; the rival is rejected with probability Phi(sqrt(lambda) - 1.64).
    """
    durations = BRIEF if bench.waves else DURATIONS
    dips = list(itertools.product(DEPTHS, durations))
    d, J = _response(bench, tied[0], tied[1], [_dip(bench, depth, duration) for depth, duration in dips])
    assert tied[1].tests is not None
    R, order = tied[1].tests.projection.R, _order(bench, tied[1])
    known = (R.T @ R)[np.ix_(order, order)]
    likely = [float(ndtr(np.sqrt(_separation(d[e], J[:, e], known)) - ONE_SIDED)) for e in range(len(dips))]
    tried = [NextDip(*dip, p, durations[-1]) for dip, p in zip(dips, likely, strict=True)]
    return mildest(tried, bench.criteria.decided)


def mildest(dips: Sequence[NextDip], decided: float) -> NextDip:
    """The dip of least depth times duration that decides with a probability of `decided`, or else the surest."""
    enough = [dip for dip in dips if dip.probability >= decided]
    return min(enough, key=lambda dip: dip.depth * dip.duration) if enough else max(dips, key=lambda d: d.probability)


def _separation(d: np.ndarray, J: np.ndarray, known: np.ndarray) -> float:
    """lambda of one dip; 0 where a model does not survive it."""
    if not (np.isfinite(d).all() and np.isfinite(J).all()):
        return 0.0
    return max(float(d @ d - d @ J.T @ np.linalg.pinv(known + J @ J.T, hermitian=True) @ J @ d), 0.0)


def _response(
    bench: Bench, truth: Rival, rival: Rival, dips: Sequence[Excitation | Waveforms]
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Whitened difference of both predictions (E, R) and the rival's tangent (k, E, R) in dips of equal length."""
    at = bench.coordinates
    inside = [*at.base, *at.parameters(rival.fit.names)]
    up, down = two_sided(rival.fit.unit, inside)
    width = np.array([u[k] - d[k] for u, d, k in zip(up, down, inside, strict=True)])
    points = np.concatenate([truth.fit.unit[None], rival.fit.unit[None], up, down])
    faults = at.parameters(bench.catalogue.of_measurement)
    points[:, faults] = at.null[faults]  # what the recorder does to those events says nothing of the load
    power = bench.kernels.simulate((*truth.fit.names, *rival.fit.names), points, Drive.of(dips))
    one = Drive.of(dips[:1])
    each = np.moveaxis(power.reshape(len(points), one.channels, len(dips), -1), 2, 1)
    each = each.reshape(-1, one.channels, one.samples)
    assert rival.tests is not None
    noise = rival.tests.noise.on(np.ones(one.samples))
    rows = noise.whiten(each, one, one.weights > 0).reshape(len(points), len(dips), -1)
    k = len(inside)
    return rows[0] - rows[1], (rows[2 : 2 + k] - rows[2 + k :]) / width[:, None, None]


def _order(bench: Bench, rival: Rival) -> list[int]:
    """Where the base's and the rival's parameters stand among the nuisances of its tangent."""
    at = bench.coordinates
    nb, ne = len(at.base), len(at.before)
    return [*range(nb), *range(nb + ne, nb + ne + len(at.parameters(rival.fit.names)))]


def _dip(bench: Bench, depth: float, duration: float) -> Excitation | Waveforms:
    """A dip as the events of this bench start and are sampled, with edges of two cycles.

    Of waveforms, in all three phases alike (or the one there is), with edges as sudden as faults are.
    """
    event = bench.events[0]
    if isinstance(event, WaveEvent):
        return _wave_dip(event, depth, duration)
    step, lead = event.record.step, 0.3
    t = np.arange(round((lead + max(DURATIONS) + 1.5) / step)) * step
    U = event.U0 * (1 - depth * _course(t - lead, duration, EDGE))
    return Excitation(
        step, U, np.zeros(len(t)), np.zeros(len(t)), event.U0, event.P0, event.Q0,
        omega_n=2 * np.pi * event.record.base.frequency, U2=np.zeros(len(t)), U20=0.0,
    )  # fmt: skip


def _wave_dip(event: WaveEvent, depth: float, duration: float) -> Waveforms:
    """A dip of the voltage's space vector, sampled as an event is, drawing what that drew before it."""
    step, lead = event.record.step, 0.1
    n = round((lead + max(BRIEF) + 0.3) / step)
    t = np.arange(n) * step
    v = event.U0 * (1 - depth * _course(t - lead, duration, SUDDEN))
    omega_n = 2 * np.pi * event.record.base.frequency
    compared = np.where(np.array(event.known)[:, None], 0.0, np.nan) * np.ones(n)
    return Waveforms(
        step, v.astype(complex), np.zeros(n), np.exp(1j * (omega_n + event.omega_s0) * t), compared, v, np.zeros(n),
        event.U0, event.P0, event.Q0, omega_s0=event.omega_s0, omega_n=omega_n, weights=WEIGHTS[event.phases],
    )  # fmt: skip


def _course(since: np.ndarray, duration: float, edge: float) -> np.ndarray:
    """How much of a dip is there (N,), 0 to 1, at times [s] since it began."""
    return np.clip(since / edge, 0, 1) - np.clip((since - duration) / edge, 0, 1)
