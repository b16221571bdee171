"""The noise of what is compared: correlated between channels and in time, and how residuals are
whitened by it.

Beside fast noise there may be shapes of known variance, slow or local: the wandering of the load,
and what is left of the voltage's noise, which enters the model and leaves it in P and Q at once.
"""

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tractexp.model.drive import Drive
from tractexp.noise.color import Autoregression, white_noise
from tractexp.noise.random_walk import Load, RandomWalk

BURN_IN = 500  # samples
FEWEST_WORTH = 4.0  # independent quiet samples: the level's error is told as if there were so many
# standard deviations of the fast noise: shapes that do less are left out
LEAST_SHAPE_DEVIATION = 0.05

Pair = tuple[Autoregression, ...]  # of P and of Q, or of each current
Shrunk = tuple[np.ndarray, np.ndarray]  # orthonormal shapes (k, R), and how much of each goes (k,)


@dataclass(frozen=True, eq=False)
class Noise:
    """The noise of what is compared.

    Residuals of each event's C channels, times `mix`, are independent autoregressions. Beside them
    there may be shapes of known variance: a wandering load, and errors of the voltage.

    Attributes
    ----------
    pairs : tuple of Pair
        The autoregressions of the channels, for each event, or a single one for all.
    mix : (C, C) or None
        What makes the channels independent. None: they are as they stand, and a sample of one
        counts where another is missing.
    shocks : C times (n,) or None
        Prediction errors of unit variance as they were seen, to draw from; None: normal ones.
    random_walk : RandomWalk or None
        The wandering of the load, in the mixed channels.
    input_modes : (k, C, N) [pu] or None
        What errors of the voltage do to what is compared, each of one standard deviation.
    vector : bool
        Whether the first two channels are a space vector, whose autoregression is complex.
    """

    pairs: tuple[Pair, ...]
    mix: np.ndarray | None = None  # (C, C)
    # of unit variance, as they were seen; None: normal
    shocks: tuple[np.ndarray, ...] | None = None
    random_walk: RandomWalk | None = None  # of the mixed channels
    # (k, C, N) pu: what errors of the voltage do, each of one standard deviation
    input_modes: np.ndarray | None = None
    # the first two channels are a space vector, whose autoregression is complex
    vector: bool = False
    _shrunk: dict[int, Shrunk] = field(default_factory=dict, init=False)

    @classmethod
    def white(cls, *deviations: float) -> "Noise":
        """Independent noise of these standard deviations [pu], one a channel.

        Examples
        --------
        >>> Noise.white(0.01, 0.02).describe()
        'P 0.01 pu, Q 0.02 pu, white'
        """
        return cls((tuple(map(white_noise, deviations)),))

    @property
    def channels(self) -> int:
        """The number C of channels that are compared."""
        return len(self.pairs[0])

    def pair(self, event: int) -> Pair:
        """The autoregressions of the channels in one event."""
        return self.pairs[event if len(self.pairs) > 1 else 0]

    def select_event(self, event: int) -> "Noise":
        """The noise of one event by itself, without its shapes."""
        return Noise((self.pair(event),), self.mix, vector=self.vector)

    @functools.cached_property
    def loudest_input_mode(self) -> float:
        """The largest variance, at any sample, that noise of the voltage causes, over that of the
        power's own noise.
        """
        return (
            0.0
            if self.input_modes is None
            else float((self._mix_channels(self.input_modes) ** 2).sum(axis=0).max())
        )

    def scale_noise(self, factor: float) -> "Noise":
        """The noise `factor` times as loud, its shapes as well."""
        random_walk = self.random_walk and replace(
            self.random_walk, intensity=self.random_walk.intensity * factor**2
        )
        pairs = tuple(tuple(channel.scale_noise(factor) for channel in pair) for pair in self.pairs)
        louder = replace(
            self,
            pairs=pairs,
            random_walk=random_walk,
            input_modes=None if self.input_modes is None else self.input_modes * factor,
        )
        louder._shrunk.update(self._shrunk)  # shapes and noise keep their ratio
        return louder

    def apply_to_events(self, load: Load, input_modes: np.ndarray | None = None) -> "Noise":
        """The noise on other events.

        Parameters
        ----------
        load : Load
            Their power, by which the load wanders.
        input_modes : (k, C, N) [pu] or None
            What errors of their voltage do.

        Returns
        -------
        Noise
        """
        random_walk = None if self.random_walk is None else replace(self.random_walk, load=load)
        return replace(self, random_walk=random_walk, input_modes=input_modes)

    def whiten(self, residuals: np.ndarray, drive: Drive, valid: np.ndarray) -> np.ndarray:
        """Residuals as rows of independent unit variance.

        Parameters
        ----------
        residuals : (n, C, N) [pu]
            Of n candidates, events end to end.
        drive : Drive
            Where the events begin.
        valid : (C, N) bools
            Which samples count.

        Returns
        -------
        (n, C N) array
            One channel after the other; 0 where a sample does not count.
        """
        valid = self._select_common_samples(valid, drive)
        rows = np.empty(residuals.shape)
        # what diverges has a deviance that is not finite
        with np.errstate(over="ignore", invalid="ignore"):
            mixed = self._mix_channels(residuals)
            for e, part in enumerate(drive.parts):
                self._whiten_fast_noise(mixed[:, :, part], valid[:, part], e, rows[:, :, part])
                self._shrink(rows[:, :, part], valid[:, part], part, e)
        return rows.reshape(len(rows), math.prod(rows.shape[1:]))  # of no rows, too

    def prepare(self, drive: Drive, valid: np.ndarray) -> None:
        """Make ready what `whiten` keeps of the shapes, once, where several processes are about to
        be forked.
        """
        valid = self._select_common_samples(valid, drive)
        for e, part in enumerate(drive.parts):
            self._shrinkage(valid[:, part], part, e)

    def _select_common_samples(self, valid: np.ndarray, drive: Drive) -> np.ndarray:
        """The samples (C, N) that count: where channels are mixed, those at which every measured
        channel does.

        The mixing of currents is triangular, so that an event without the last channel, of zero
        sequence, has the others.
        """
        if self.mix is None:
            return valid
        if self.channels > 2 and drive.events > 1:
            parts = [valid[:, part] for part in drive.parts]
            return np.concatenate([_find_all_measured(part) for part in parts], axis=1)
        return _find_all_measured(valid)

    def draw(self, rng: np.random.Generator, count: int, lengths: Sequence[int]) -> np.ndarray:
        """Draws of the noise.

        Parameters
        ----------
        rng : numpy.random.Generator
            The source of chance.
        count : int
            How many draws.
        lengths : E ints
            Samples of each event.

        Returns
        -------
        (count, C, N) array [pu]
            Events end to end.
        """
        ends = np.cumsum([0, *lengths]).tolist()
        drawn = np.empty((count, self.channels, ends[-1]))
        for e, (a, b) in enumerate(itertools.pairwise(ends)):
            own = self._draw_mixed_channels(rng, count, slice(a, b), e)
            drawn[:, :, a:b] = own if self.mix is None else np.linalg.solve(self.mix, own)
        return drawn

    def draw_white(
        self, rng: np.random.Generator, count: int, drive: Drive, valid: np.ndarray
    ) -> np.ndarray:
        """Draws of whitened noise: of the same law as whitened results of `draw`, without its work.

        Parameters
        ----------
        rng : numpy.random.Generator
            The source of chance.
        count : int
            How many draws.
        drive : Drive
            Where the events begin.
        valid : (C, N) bools
            Which samples count.

        Returns
        -------
        (count, C N) array
            Independent shocks of unit variance; 0 in gaps.
        """
        size = count, drive.samples
        shocks = [
            rng.standard_normal(size) if seen is None else rng.choice(seen, size)
            for seen in self._shocks
        ]
        rows = np.stack(shocks, axis=1) * self._select_common_samples(valid, drive)
        return rows.reshape(count, math.prod(rows.shape[1:]))  # of no rows, too

    def worth(self, samples: int) -> float:
        """The number of independent samples that tell as much of the slowest of this noise as so
        many do.
        """
        channels = [channel for pair in self.pairs for channel in pair]
        gains = [1 / max(float(abs(1 - a.coefficients[-1].sum())), 1e-3) for a in channels]
        spreads = [a.deviation[0] / a.deviation[-1] for a in channels]
        return samples / max(1.0, *((g / s) ** 2 for g, s in zip(gains, spreads, strict=True)))

    def draw_levels(
        self, rng: np.random.Generator, count: int, quiet: Sequence[slice]
    ) -> np.ndarray:
        """Draws (count,) of the noise's level as quiet stretches tell it, over the true one.

        Its square is chi-squared over its degrees of freedom: two channels of as many independent
        samples as this noise lets these be worth.
        """
        samples = sum(part.stop - part.start for part in quiet)
        freedom = 2 * max(self.worth(samples), FEWEST_WORTH)
        return np.sqrt(rng.chisquare(freedom, count) / freedom)

    @property
    def levels(self) -> tuple[float, ...]:
        """The standard deviations (C,) [pu] of the fast noise of the channels in the first
        event.
        """
        return tuple(np.sqrt(self._fast_variance(0)).tolist())

    def memory(self, step: float) -> float:
        """The time [s] within which noise that is as loud at rest as that of P forgets.

        It is that of a first-order autoregression whose neighbors, `step` [s] apart, correlate by
        a, with (1 + a) / (1 - a) the square of the gain at rest over the spread.
        """
        P = self.pairs[0][0]
        gain = P.deviation[-1] / max(1 - float(P.coefficients[-1].sum()), 1e-3)
        ratio = float(gain / P.deviation[0]) ** 2
        a = (ratio - 1) / (ratio + 1)
        return -step / float(np.log(a)) if a > 0 else 0.0

    def describe(self, names: Sequence[str] = ("P", "Q")) -> str:
        """Level and color, as a run prints them."""
        pair = self.pairs[0]
        levels = zip(names, self.levels, strict=True)
        color = (
            "white"
            if all(a.white for a in pair)
            else f"colored (order {max(a.order for a in pair)})"
        )
        return f"{', '.join(f'{name} {level:.2g} pu' for name, level in levels)}, {color}"

    def deviation(self, drive: Drive) -> np.ndarray:
        """The standard deviation (C, N) [pu] of every sample of each channel, errors of the voltage
        included, about what the load wanders.
        """
        variance = np.empty(drive.measurements.shape)
        for e, part in enumerate(drive.parts):
            variance[:, part] = self._fast_variance(e)[:, None]
        if self.input_modes is not None:
            variance += (self.input_modes**2).sum(axis=0)
        return np.sqrt(variance)

    @property
    def _shocks(self) -> Sequence[np.ndarray | None]:
        """The shocks of each channel as they were seen; None where they are normal, as those of a
        space vector are.
        """
        seen = self.shocks or [None] * self.channels
        return [None, None, *seen[2:]] if self.vector else seen

    @property
    def _unmixing_matrix(self) -> np.ndarray:
        """The matrix (C, C) that takes correlated channels apart."""
        return np.eye(self.channels) if self.mix is None else np.linalg.inv(self.mix)

    def covariance(self, event: int) -> np.ndarray:
        """Covariance (C, C) of the fast noise of the channels in one event [pu²]."""
        back = self._unmixing_matrix
        return back @ np.diag([channel.deviation[0] ** 2 for channel in self.pair(event)]) @ back.T

    def _fast_variance(self, event: int) -> np.ndarray:
        """Variance (C,) of the fast noise of the channels [pu²]."""
        return self._unmixing_matrix**2 @ [
            channel.deviation[0] ** 2 for channel in self.pair(event)
        ]

    def _mix_channels(self, rows: np.ndarray) -> np.ndarray:
        """Channels (n, C, N) mixed so that their noise is independent."""
        return rows if self._mix_matrix is None else self._mix_matrix @ rows

    @functools.cached_property
    def _mix_matrix(self) -> np.ndarray | None:
        """What mixes channels; None where they are independent as they stand."""
        is_plain = self.mix is None or np.array_equal(self.mix, np.eye(self.channels))
        return None if is_plain else self.mix

    def _whiten_fast_noise(
        self, mixed: np.ndarray, valid: np.ndarray, event: int, out: np.ndarray
    ) -> np.ndarray:
        """Mixed channels (n, C, samples) of one event without the color of the fast noise, in
        `out`.
        """
        pair = self.pair(event)
        alone = 0
        if self.vector:
            white = pair[0].whiten(mixed[:, 0] + 1j * mixed[:, 1], valid[0])
            out[:, 0], out[:, 1], alone = np.real(white), np.imag(white), 2
        for c, channel in enumerate(pair[alone:], alone):
            channel.whiten(mixed[:, c], valid[c], out[:, c])
        return out

    def _shrink(self, white: np.ndarray, valid: np.ndarray, part: slice, event: int) -> None:
        """Take the excess variance of its shapes out of whitened rows (n, C, samples) of an event.

        With B the whitened shapes, (I + B'B)^(-1/2) by their singular vectors.
        """
        if (shrinkage := self._shrinkage(valid, part, event)) is None:
            return
        basis, share = shrinkage
        flat = white.reshape(len(white), math.prod(white.shape[1:]))
        white -= (((flat @ basis.T) * share) @ basis).reshape(white.shape)

    def _shrinkage(self, valid: np.ndarray, part: slice, event: int) -> Shrunk | None:
        """The shapes of an event as whitening takes them out, decomposed once; None where there are
        none.
        """
        if self.random_walk is None and self.input_modes is None:
            return None
        if event not in self._shrunk:
            shapes = self._shapes(part, event)
            self._shrunk[event] = _decompose_shapes(
                self._whiten_fast_noise(shapes, valid, event, np.empty_like(shapes))
            )
        return self._shrunk[event]

    def _shapes(self, part: slice, event: int) -> np.ndarray:
        """Shapes (k, C, samples) of the mixed channels in one event, of one standard deviation
        each, in their order.
        """
        shapes = [np.empty((0, self.channels, part.stop - part.start))]
        if self.random_walk is not None:
            shapes.append(
                self.random_walk.modes(
                    event, part, np.eye(self.channels) if self.mix is None else self.mix
                )
            )
        if self.input_modes is not None:
            shapes.append(self._mix_channels(self.input_modes[:, :, part]))
        return np.concatenate(shapes)

    def _draw_mixed_channels(
        self, rng: np.random.Generator, count: int, part: slice, event: int
    ) -> np.ndarray:
        """Mixed channels (count, C, samples) of one event."""
        colored = []
        pair = self.pair(event)
        size = (count, part.stop - part.start + BURN_IN)
        if self.vector:
            shocks = rng.standard_normal((2, *size)) * pair[0].deviation[-1]
            turning = pair[0].color_shocks(shocks[0] + 1j * shocks[1])[:, BURN_IN:]
            colored = [np.real(turning), np.imag(turning)]
        for c, channel in list(enumerate(pair))[len(colored) :]:
            seen = self._shocks[c]
            shocks = rng.standard_normal(size) if seen is None else rng.choice(seen, size)
            shocks *= channel.deviation[-1]
            colored.append(channel.color_shocks(shocks)[:, BURN_IN:])
        shapes = self._shapes(part, event)
        return np.stack(colored, axis=1) + np.tensordot(
            rng.standard_normal((count, len(shapes))), shapes, axes=1
        )


def _find_all_measured(valid: np.ndarray) -> np.ndarray:
    """The samples (C, n) at which all channels count that are measured at all."""
    measured = np.any(valid, axis=1)
    return np.all(valid[measured], axis=0) & measured[:, None]


def _decompose_shapes(shapes: np.ndarray) -> Shrunk:
    """Right singular vectors of shapes (k, C, n) that are seen, and 1 - (1 + s²)^(-1/2) of their
    singular values s.

    By the eigenvectors of their products: a fifth of the time of a singular value decomposition.
    """
    flat = shapes.reshape(len(shapes), -1)
    squares, vectors = np.linalg.eigh(flat @ flat.T)
    seen = squares > LEAST_SHAPE_DEVIATION**2
    return (vectors[:, seen] / np.sqrt(squares[seen])).T @ flat, 1 - 1 / np.sqrt(1 + squares[seen])
