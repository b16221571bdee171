"""The noise of P and Q together: correlated with each other and in time.

Estimated from the quiet residuals of a fit. Beside fast noise there may be slow or local shapes of known variance: the
wandering of the load, and what is left of the voltage's noise, which enters the model and leaves it in P and Q at once.
"""

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tractexp.discrepancy.wander import Wander, without_slow
from tractexp.errors import UserError
from tractexp.identification.noise import FEWEST, Autoregression, fit_autoregression
from tractexp.model.drive import Drive
from tractexp.record import Event

HIGHEST = 8  # order of the autoregressions
TAIL = 0.35  # share of the record after the dip that counts as quiet
BURN_IN = 500  # samples
BLURRED = 0.5  # variance that noise of the voltage causes at some sample, over that of the power
SEEN = 0.05  # standard deviations of the fast noise: shapes that do less are left out
MANY = 200  # quiet samples from which shocks are drawn as they were seen, with their tails and steps


@dataclass(frozen=True, eq=False)
class Noise:
    """Residuals (P, Q) times `mix` are two independent autoregressions."""

    mix: np.ndarray  # (2, 2)
    channels: tuple[Autoregression, Autoregression]
    shocks: tuple[np.ndarray, np.ndarray] | None = None  # of unit variance, as they were seen; None: normal
    wander: Wander | None = None  # of the mixed channels
    blur: np.ndarray | None = None  # (k, 2, N) pu: what errors of the voltage do, each of one standard deviation
    _slow: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict, init=False)

    @functools.cached_property
    def blurred(self) -> bool:
        """Whether noise of the voltage does as much as that of the power."""
        return self.blur is not None and bool((self._mixed(self.blur) ** 2).sum(axis=0).max() > BLURRED)

    def on(self, profile: np.ndarray, blur: np.ndarray | None = None) -> "Noise":
        """The same noise on other events: their power over that before (N,), what errors of their voltage do."""
        wander = None if self.wander is None else replace(self.wander, profile=profile)
        return replace(self, wander=wander, blur=blur)

    def _mixed(self, rows: np.ndarray) -> np.ndarray:
        """Channels (n, 2, N) mixed so that their noise is independent."""
        return self.mix @ rows

    def whiten(self, residuals: np.ndarray, drive: Drive, known: np.ndarray) -> np.ndarray:
        """(n, 2, N) to rows (n, 2 N) of independent unit variance; samples that do not count are 0."""
        both = known.all(axis=0)
        with np.errstate(over="ignore", invalid="ignore"):  # what diverges has a deviance that is not finite
            mixed = self._mixed(residuals)
            rows = np.empty_like(mixed)
            for e in range(drive.events):
                part = drive.part(e)
                white = self._fast(mixed[:, :, part], both[part])
                rows[:, :, part] = self._settled(white, e, part, both[part])
        return rows.reshape(len(rows), -1)

    def _fast(self, mixed: np.ndarray, known: np.ndarray) -> np.ndarray:
        """Mixed channels (n, 2, samples) of one event without the color of the fast noise."""
        rows = [channel.whiten(mixed[:, c], known) for c, channel in enumerate(self.channels)]
        return np.stack(rows, axis=1)

    def _settled(self, white: np.ndarray, event: int, part: slice, known: np.ndarray) -> np.ndarray:
        """Whitened rows (n, 2, samples) of an event without the excess variance of its shapes.

        With B the whitened shapes, (I + B'B)^(-1/2) by their singular vectors.
        """
        if self.wander is None and self.blur is None:
            return white
        flat = white.reshape(len(white), -1)
        if event not in self._slow:
            shapes = self._fast(self._shapes(part), known)
            _, values, basis = np.linalg.svd(shapes.reshape(len(shapes), -1), full_matrices=False)
            seen = values > SEEN
            self._slow[event] = basis[seen], 1 - 1 / np.sqrt(1 + values[seen] ** 2)
        basis, share = self._slow[event]
        return (flat - ((flat @ basis.T) * share) @ basis).reshape(white.shape)

    def _shapes(self, part: slice) -> np.ndarray:
        """Shapes (k, 2, samples) of the mixed channels in one event, of one standard deviation each."""
        made = [np.empty((0, 2, part.stop - part.start))]
        if self.wander is not None:
            for c in (0, 1):
                modes = self.wander.modes(c, part)
                made.append(np.zeros((len(modes), *made[0].shape[1:])))
                made[-1][:, c] = modes
        if self.blur is not None:
            made.append(self._mixed(self.blur[:, :, part]))
        return np.concatenate(made)

    def draw(self, rng: np.random.Generator, count: int, lengths: Sequence[int]) -> np.ndarray:
        """Noise of events of these lengths end to end, (count, 2, N) [pu]."""
        ends = np.cumsum([0, *lengths])
        drawn = [self._drawn(rng, count, slice(a, b)) for a, b in itertools.pairwise(ends.tolist())]
        return np.linalg.solve(self.mix, np.concatenate(drawn, axis=2))

    def _drawn(self, rng: np.random.Generator, count: int, part: slice) -> np.ndarray:
        """Mixed channels (count, 2, samples) of one event."""
        made = []
        size = (count, part.stop - part.start + BURN_IN)
        for c, channel in enumerate(self.channels):
            shocks = rng.standard_normal(size) if self.shocks is None else rng.choice(self.shocks[c], size)
            shocks *= channel.deviation[-1]
            made.append(channel.recurring(shocks)[:, BURN_IN:])
        shapes = self._shapes(part)
        return np.stack(made, axis=1) + np.einsum("bk,kct->bct", rng.standard_normal((count, len(shapes))), shapes)

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
    blur: np.ndarray | None = None,
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
    slow = wander(mix)
    fast = [[(mix @ p)[c] for p in pieces] for c in (0, 1)]
    if slow is not None:
        fast = [[without_slow(p) for p in channel] for channel in fast]
    # Sparing, because a color that is not there changes the weight of slow differences, which every effect makes.
    P, Q = (fit_autoregression(channel, HIGHEST, sparing=True) for channel in fast)
    shocks = None
    if count >= MANY:
        shocks = _shocks(P, fast[0]), _shocks(Q, fast[1])
    return Noise(mix, (P, Q), shocks, slow, blur)


def _shocks(channel: Autoregression, pieces: Sequence[np.ndarray]) -> np.ndarray:
    """What the past of a channel does not predict, centered and scaled to unit variance."""
    white = np.concatenate([channel.whiten(p, np.ones(len(p), dtype=bool))[channel.order :] for p in pieces])
    return (white - white.mean()) / max(float(white.std()), 1e-300)
