"""The noise of P and Q together: correlated with each other and in time.

Estimated from the quiet residuals of a fit. They contain the noise of the power channels, the wandering of the load,
and what smoothing left of the voltage's noise, which enters the model and leaves it in P and Q at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tractexp.discrepancy.voltage import Blur
from tractexp.discrepancy.wander import Wander, without_slow
from tractexp.errors import UserError
from tractexp.identify.noise import FEWEST, Autoregression, fit_autoregression
from tractexp.model.drive import Drive
from tractexp.record import Event

HIGHEST = 8  # order of the autoregressions
TAIL = 0.35  # share of the record after the dip that counts as quiet
BURN_IN = 500  # samples
BLURRED = 0.5  # variance that noise of the voltage caused, over that of the power
DROWNED = 4.0  # the same, above which what is left of it after smoothing looks like physics
MANY = 200  # quiet samples from which shocks are drawn as they were seen, with their tails and steps


@dataclass(frozen=True, eq=False)
class Noise:
    """Residuals (P, Q) times `mix` are two independent autoregressions."""

    mix: np.ndarray  # (2, 2)
    channels: tuple[Autoregression, Autoregression]
    shocks: tuple[np.ndarray, np.ndarray] | None = None  # of unit variance, as they were seen; None: normal
    wander: Wander | None = None  # of the mixed channels
    trust: np.ndarray | None = None  # (2, N) by which noise of the voltage lowers a sample's weight
    blurred: bool = False  # whether noise of the voltage did as much as that of the power
    _slow: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def whiten(self, residuals: np.ndarray, drive: Drive, known: np.ndarray) -> np.ndarray:
        """(n, 2, N) to rows (n, 2 N) of independent unit variance; samples that do not count are 0."""
        mixed = np.einsum("ij,njt->nit", self.mix, residuals)
        both = known.all(axis=0)
        rows = np.empty_like(mixed)
        for e in range(drive.events):
            part = drive.part(e)
            for c, channel in enumerate(self.channels):
                rows[:, c, part] = self._settled(channel.whiten(mixed[:, c, part], both[part]), c)
        if self.trust is not None:
            rows *= self.trust
        return rows.reshape(len(rows), -1)

    def _settled(self, white: np.ndarray, c: int) -> np.ndarray:
        """Whitened rows (n, samples) of an event without the excess variance of a wandering load.

        With B the whitened modes, (I + B'B)^(-1/2) by their singular vectors.
        """
        if self.wander is None or not self.wander.intensity[c]:
            return white
        key = c, white.shape[1]
        if key not in self._slow:
            modes = self.channels[c].whiten(self.wander.modes(c, white.shape[1]), np.ones(white.shape[1], dtype=bool))
            _, values, basis = np.linalg.svd(modes, full_matrices=False)
            self._slow[key] = basis, 1 - 1 / np.sqrt(1 + values**2)
        basis, share = self._slow[key]
        return white - ((white @ basis.T) * share) @ basis

    def draw(self, rng: np.random.Generator, count: int, lengths: Sequence[int]) -> np.ndarray:
        """Noise of events of these lengths end to end, (count, 2, N) [pu]."""
        drawn = np.concatenate([self._drawn(rng, count, n) for n in lengths], axis=2)
        if self.trust is not None:
            drawn /= self.trust
        return np.linalg.solve(self.mix, drawn)

    def _drawn(self, rng: np.random.Generator, count: int, samples: int) -> np.ndarray:
        """Mixed channels (count, 2, samples) of one event."""
        from scipy.signal import lfilter

        made = []
        size = (count, samples + BURN_IN)
        for c, channel in enumerate(self.channels):
            shocks = rng.standard_normal(size) if self.shocks is None else rng.choice(self.shocks[c], size)
            shocks *= channel.deviation[-1]
            made.append(lfilter([1.0], np.r_[1.0, -channel.coefficients[-1]], shocks)[:, BURN_IN:])
            if self.wander is not None:
                modes = self.wander.modes(c, samples)
                made[-1] += rng.standard_normal((count, len(modes))) @ modes
        return np.stack(made, axis=1)

    def worth(self, samples: int) -> float:
        """How many independent samples tell as much of the slowest of this noise, by the color's gain at rest."""
        gains = [1 / max(1 - float(a.coefficients[-1].sum()), 1e-3) for a in self.channels]
        spreads = [a.deviation[0] / a.deviation[-1] for a in self.channels]
        return samples / max(1.0, *((g / s) ** 2 for g, s in zip(gains, spreads, strict=True)))

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


def estimate(
    residuals: np.ndarray,
    known: np.ndarray,
    quiet: Sequence[slice],
    wander: Callable[[np.ndarray], Wander | None] = lambda mix: None,
    blur: Blur | None = None,
) -> Noise:
    """Noise from residuals (2, N) in quiet stretches; `wander` tells how the load wanders in channels mixed by `mix`.

    Raises `UserError` where too few samples are quiet.
    """
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
    trust, blurred = None, False
    if blur is not None:
        jitter = np.mean((mix @ np.concatenate([blur.jitter[:, part] for part in quiet], axis=1)) ** 2, axis=1)
        blurred = bool(jitter.max() > BLURRED)
        if jitter.max() > DROWNED:
            raise UserError(
                f"noise of the recorded voltage moves the calculated power by {np.sqrt(jitter.max()):.1f} times the"
                f" noise of the recorded power, and no missing effect can be told from that (up to {np.sqrt(DROWNED):g}"
                " times can be dealt with); record the voltage with less noise, or average it before"
            )
        trust = 1 / np.sqrt(1 + jitter[:, None] * blur.left)
    slow = wander(mix)
    fast = [[(mix @ p)[c] for p in pieces] for c in (0, 1)]
    if slow is not None:
        fast = [[without_slow(p) for p in channel] for channel in fast]
    # Sparing, because a color that is not there changes the weight of slow differences, which every effect makes.
    P, Q = (fit_autoregression(channel, HIGHEST, sparing=True) for channel in fast)
    shocks = None
    if count >= MANY:
        shocks = _shocks(P, fast[0]), _shocks(Q, fast[1])
    return Noise(mix, (P, Q), shocks, slow, trust, blurred)


def _shocks(channel: Autoregression, pieces: Sequence[np.ndarray]) -> np.ndarray:
    """What the past of a channel does not predict, centered and scaled to unit variance."""
    white = np.concatenate([channel.whiten(p, np.ones(len(p), dtype=bool))[channel.order :] for p in pieces])
    return (white - white.mean()) / max(float(white.std()), 1e-300)
