"""The noise of P and Q together: correlated with each other (through the voltage's noise) and in time.

The voltage's noise enters the model as an input and leaves it in P and Q at once. The residuals of a fit contain
it with the noise of the power channels, so what is estimated here from quiet residuals covers both.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.errors import UserError
from tractexp.identify.noise import FEWEST, Autoregression, fit_autoregression
from tractexp.model.drive import Drive
from tractexp.record import Event

HIGHEST = 8  # order of the autoregressions
TAIL = 0.35  # share of the record after the dip that counts as quiet
BURN_IN = 500  # samples
MANY = 200  # quiet samples from which shocks are drawn as they were seen, with their tails and steps


@dataclass(frozen=True, eq=False)
class Noise:
    """Residuals (P, Q) times `mix` are two independent autoregressions."""

    mix: np.ndarray  # (2, 2)
    channels: tuple[Autoregression, Autoregression]
    shocks: tuple[np.ndarray, np.ndarray] | None = None  # of unit variance, as they were seen; None: normal

    def whiten(self, residuals: np.ndarray, drive: Drive, known: np.ndarray) -> np.ndarray:
        """(n, 2, N) to rows (n, 2 N) of independent unit variance; samples that do not count are 0."""
        mixed = np.einsum("ij,njt->nit", self.mix, residuals)
        both = known.all(axis=0)
        rows = np.empty_like(mixed)
        for e in range(drive.events):
            part = drive.part(e)
            for c, channel in enumerate(self.channels):
                rows[:, c, part] = channel.whiten(mixed[:, c, part], both[part])
        return rows.reshape(len(rows), -1)

    def draw(self, rng: np.random.Generator, count: int, samples: int) -> np.ndarray:
        """Stretches of noise (count, 2, samples) [pu]."""
        from scipy.signal import lfilter

        made = []
        size = (count, samples + BURN_IN)
        for c, channel in enumerate(self.channels):
            shocks = rng.standard_normal(size) if self.shocks is None else rng.choice(self.shocks[c], size)
            shocks *= channel.deviation[-1]
            made.append(lfilter([1.0], np.r_[1.0, -channel.coefficients[-1]], shocks)[:, BURN_IN:])
        return np.linalg.solve(self.mix, np.stack(made, axis=1))

    def describe(self) -> str:
        """Level and color, as a run prints them."""
        level = [
            np.sqrt(np.linalg.inv(self.mix)[c] ** 2 @ [a.deviation[0] ** 2 for a in self.channels]) for c in (0, 1)
        ]
        color = (
            "white" if all(a.white for a in self.channels) else f"colored (order {max(a.order for a in self.channels)})"
        )
        return f"P {level[0]:.2g} pu, Q {level[1]:.2g} pu, {color}"


def quiet_stretches(events: Sequence[Event], drive: Drive) -> list[slice]:
    """The samples before each dip and those at the end of the record, where little happens."""
    parts = []
    for e, event in enumerate(events):
        first, n = int(drive.first[e]), event.record.samples
        tail = round(n - TAIL * (n - event.end))
        parts += [slice(first, first + event.start), slice(first + tail, first + n)]
    return [p for p in parts if p.stop - p.start >= 8]


def estimate(residuals: np.ndarray, known: np.ndarray, quiet: Sequence[slice]) -> Noise:
    """Noise from residuals (2, N) in quiet stretches. Raises `UserError` where too few samples are quiet."""
    both = known.all(axis=0)
    pieces = [residuals[:, part][:, both[part]] for part in quiet]
    count = sum(p.shape[1] for p in pieces)
    if count < FEWEST:
        raise UserError(
            f"the noise cannot be told from {count} quiet samples before and after the dips: at least {FEWEST} are"
            " needed; give records that start earlier"
        )
    together = np.concatenate(pieces, axis=1)
    covariance = together @ together.T / count
    covariance += 1e-18 * np.eye(2)
    mix = np.linalg.inv(np.linalg.cholesky(covariance))
    # Sparing, because a color that is not there changes the weight of slow differences, which every effect makes.
    P, Q = (fit_autoregression([(mix @ p)[c] for p in pieces], HIGHEST, sparing=True) for c in (0, 1))
    if count < MANY:
        return Noise(mix, (P, Q))
    return Noise(mix, (P, Q), (_shocks(P, [(mix @ p)[0] for p in pieces]), _shocks(Q, [(mix @ p)[1] for p in pieces])))


def _shocks(channel: Autoregression, pieces: Sequence[np.ndarray]) -> np.ndarray:
    """What the past of a channel does not predict, centered and scaled to unit variance."""
    white = np.concatenate([channel.whiten(p, np.ones(len(p), dtype=bool))[channel.order :] for p in pieces])
    return (white - white.mean()) / max(float(white.std()), 1e-300)
