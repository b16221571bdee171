r"""The size of a model's error: what it leaves of a load's response beyond the noise, both in
apparent power.

    e² = (sum |S_calculated - S|² - n s²) / (sum |S - S_0|² - n s²)

over the n samples from each dip on, S = P + jQ, S_0 its mean before, s² the variance of the noise
before the dip, its slow part left out: that is drift. Its interval is that of the delete-a-block
jackknife; a second of records and more has blocks of a tenth of a second, less has as many as that.
A test of significance says whether something is left; this says how much it matters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from tractexp.domain import Playback
from tractexp.domain.playback import compute_relative_error
from tractexp.inference.blocks import LENGTH, reach
from tractexp.noise.random_walk import WANDERING_COSINES, remove_drift, remove_slow
from tractexp.record import Event
from tractexp.text.wording import join_words

BLOCKS = 10  # of short records: two or three would tell nothing of chance
COHERENT_SECONDS = 0.02  # s: what is left within a phasor's window hangs together
STALL = "the motor stalls"
LARGEST_TOLD_PERCENT = 10_000  # percent: more tells no more


@dataclass(frozen=True)
class ModelError:
    """The error of a model.

    Attributes
    ----------
    value : float
        As a share of the response.
    interval : (low, high)
        Its 95 % interval.
    of_S : float
        As a share of the apparent power.
    square : float
        Its square as reckoned: below zero where less is left than noise leaves in the mean.
    stalls : names
        Events on which the motor stalls: there the error has no size.
    """

    value: float
    interval: tuple[float, float]
    of_S: float
    square: float = np.nan
    stalls: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As `result.json` has it."""
        own = {"stalls": list(self.stalls)} if self.stalls else {}
        return {"value": self.value, "interval": list(self.interval), "of_S": self.of_S} | own

    @classmethod
    def from_content(cls, content: Mapping[str, Any]) -> "ModelError":
        """The model's error of a `result.json`: `value`, `interval` and `of_S`, or `stalls`."""
        if stalls := content.get("stalls"):
            return cls.of_stall(stalls)
        low, high = content["interval"]
        return cls(content["value"], (low, high), content["of_S"], content["value"] ** 2)

    @property
    def certain(self) -> float:
        """The error where it is more than noise leaves, with its interval; else 0."""
        return self.value if self.interval[0] > 0 else 0.0

    @classmethod
    def of_stall(cls, events: Sequence[str]) -> "ModelError":
        """The error of a model whose motor stalls on these events: infinite."""
        return cls(np.inf, (np.inf, np.inf), np.inf, np.inf, tuple(events))

    def __str__(self) -> str:
        """ "3.1 % of its response (0.9 % of S)"."""
        return f"{format_percent(self.value)} of its response ({format_percent(self.of_S)} of S)"


@dataclass(frozen=True)
class ModelMisfit:
    """How far a model is off some events.

    Attributes
    ----------
    error : ModelError
        Its error as a share of the response.
    epsilon_p, epsilon_q : float
        The relative errors of Eq. (20), as fractions.
    epsilon_i : float or None
        That of the currents, over several events the rms of theirs; None of phasors.
    """

    error: ModelError
    epsilon_p: float
    epsilon_q: float
    epsilon_i: float | None

    @classmethod
    def from_played(cls, played: Sequence[Playback]) -> "ModelMisfit":
        """The misfit of some events together."""
        currents = [one.epsilon_i**2 for one in played if one.epsilon_i is not None]
        of_currents = float(np.sqrt(np.mean(currents))) if currents else None
        return cls(compute_model_error(played), *compute_relative_errors(played), of_currents)


M = TypeVar("M", bound=ModelMisfit)


@dataclass(frozen=True, eq=False)
class ModelChange(Generic[M]):
    """What two models leave of the same events."""

    before: M
    after: M

    @property
    def closed_share(self) -> float:
        """The share of the squared model error that is gone; above 1 where less is left than noise
        leaves in the mean, below 0 where more is left than before. nan where that falls short of
        the noise by more than there was before, which was within the error of the noise's level
        then.
        """
        square = self.before.error.square
        rest = self.after.error.square
        return 1 - rest / square if 0 < square < np.inf and rest >= -square else np.nan


def compute_relative_errors(played: Sequence[Playback]) -> tuple[float, float]:
    """epsilon_p and epsilon_q of Eq. (20) over some events together, as fractions."""
    measured = {c: np.concatenate([getattr(one.event.record, c) for one in played]) for c in "PQ"}
    calculated = {c: np.concatenate([getattr(one, c) for one in played]) for c in "PQ"}
    epsilon_p, epsilon_q = (compute_relative_error(measured[c], calculated[c]) for c in "PQ")
    return epsilon_p, epsilon_q


def weigh_error(error: float, response: float, variance: float, step: float) -> float:
    """How many times noise's variance the error of a model adds to it, in what an event tells.

    The error hangs together within a block of `LENGTH` [s]: what a block's samples add up to of it
    counts so many times, and it does not grow less where the same event is recorded again.

    Parameters
    ----------
    error : float
        The model's, as a share of the response.
    response, variance : float [pu²]
        Mean square of the response in a channel, and variance of its noise.
    step : float [s]
        Between samples.

    Returns
    -------
    float

    Examples
    --------
    >>> round(weigh_error(0.1, 0.01, 1e-4, 0.01), 6)
    10.0
    """
    return error**2 * response / max(variance, 1e-30) * max(LENGTH / step, 1.0)


def describe_stall(events: Sequence[str]) -> str:
    """The words in place of a model's error where its motor stalls on these events."""
    return f"{STALL} in this model on {join_words(events)}"


def tell_error(entry: Mapping[str, Any]) -> str:
    """The size of an error as `result.json` has it, or the words in its place."""
    if entry.get("stalls"):
        return STALL
    value = entry["value"]
    return (
        "beyond all measure" if value is None or not np.isfinite(value) else format_percent(value)
    )


def format_percent(share: float) -> str:
    """A share to two digits, in percent.

    Examples
    --------
    >>> format_percent(0.0057), format_percent(0.12), format_percent(1e6)
    ('0.57 %', '12 %', 'over 10000 %')
    """
    percent = 100 * share
    if percent > LARGEST_TOLD_PERCENT:
        return f"over {LARGEST_TOLD_PERCENT} %"
    return f"{percent:.2g} %" if percent < 99.5 else f"{percent:.0f} %"


def compute_model_error(played: Sequence[Playback]) -> ModelError:
    """The error of a model over some events together.

    Parameters
    ----------
    played : sequence of Playback
        What it calculates of each event.

    Returns
    -------
    ModelError
        Infinite where the motor stalls on one, or there is no steady state.
    """
    if stalls := [one.event.record.name for one in played if one.stalls]:
        return ModelError.of_stall(stalls)
    sums = np.concatenate(sum_blocks(played))  # (blocks, 3)
    left, response, power = sums.sum(axis=0)
    ratio = left / max(response, 1e-30)
    if not np.isfinite(left):  # no steady state
        return ModelError(np.inf, (np.inf, np.inf), np.inf, np.inf)
    without = (left - sums[:, 0]) / np.maximum(response - sums[:, 1], 1e-30)
    half = reach(without, ratio)
    root = lambda square: float(np.sqrt(max(square, 0.0)))  # noqa: E731
    return ModelError(
        root(ratio), (root(ratio - half), root(ratio + half)), root(left / max(power, 1e-30)), ratio
    )


def sum_blocks(played: Sequence[Playback], sharing: float = 0.0) -> list[np.ndarray]:
    """Sums over blocks of time, from each dip on.

    Blocks are shortened, to a cycle at most, until `sharing` of them share the response: the
    inverse of the sum of squares of their shares.

    Parameters
    ----------
    played : sequence of Playback
        What a model calculates of each event.
    sharing : float
        How many blocks are to share the response.

    Returns
    -------
    list of (b, 3) arrays [pu²]
        By event and block: squares of what is left and of the response, both less those of the
        noise, and of the power.
    """
    seconds = sum(
        (one.event.record.samples - one.event.start) * one.event.record.step for one in played
    )
    length = min(LENGTH, seconds / BLOCKS)
    while True:
        sums = [_sum_event_blocks(one, length) for one in played]
        response = np.concatenate([each[:, 1] for each in sums])
        if length <= COHERENT_SECONDS or response.sum() ** 2 >= sharing * np.sum(response**2):
            return sums
        length = max(length / 2, COHERENT_SECONDS)


def _sum_event_blocks(played: Playback, length: float) -> np.ndarray:
    """Sums (3, blocks) from the dip on, by blocks of `length` [s]: squared residual in S and
    squared response less the noise's variance, and squared S; gaps are left out, and what cannot be
    simulated is infinite.
    """
    event = played.event
    record = played.event.record
    S = record.P + 1j * record.Q
    S_0 = event.P0 + 1j * event.Q0
    squares = np.stack(
        [np.abs(played.P + 1j * played.Q - S) ** 2, np.abs(S - S_0) ** 2, np.abs(S) ** 2]
    )
    squares[:2] -= estimate_noise_variance(event)
    valid = np.isfinite(S)
    squares[0, valid & ~np.isfinite(squares[0])] = np.inf  # without a steady state, or diverged
    squares = np.where(valid, squares, 0.0)[:, event.start :]
    return np.add.reduceat(
        squares, np.arange(0, squares.shape[1], max(1, round(length / record.step))), axis=1
    ).T


def estimate_noise_variance(event: Event) -> float:
    """Variance of P plus that of Q before the dip [pu²], without mean, slope and slow
    part: drift.
    """
    total = 0.0
    for row in event.calm:
        quiet = row[np.isfinite(row)]
        if len(quiet) > 4 * WANDERING_COSINES:
            fast = remove_slow(remove_drift([quiet - quiet.mean()])[0])
            total += float(np.sum(fast**2) / (len(quiet) - WANDERING_COSINES - 2))
    return total
