"""Does the model describe the load? What an estimate leaves, against what noise alone leaves, and the grade for it.

Draws of the estimated noise go through the same whitening and projection as the residual; windows, steps, pulses,
oscillations and, of several events, parameters of their own tell how much louder the residual is. A model is
*adequate* where chance may leave as much; where it may not, an effect is missing, or the model is the wrong one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from tractexp.identification import surprises
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.observed import Observed
from tractexp.identification.surprises import SMALLEST_P, Layout, tail
from tractexp.noise.span import spanned
from tractexp.wording import in_words

DRAWS = 199
# p of what a fit leaves, below which it leaves something. Chosen on the calibration series of benchmarks/adequacy.py:
# where nothing is missing one set in fifty has a smaller one, with an effect of four detection limits nearly all have.
ADEQUATE_P = 0.001
DISTINCT = 1e-3  # of the largest: weaker directions are rounding
WALL = 1e-3  # of a range: what rests on a bound takes nothing from the residual
SEED = 20201  # of the draws: the judgement of one record is always the same
ACCEPTED = 0.05  # Eq. (20): a load model is acceptable below 5 %
PER_EVENT = "parameters of each event"


class Grade(StrEnum):
    """What an estimate is good for."""

    ADEQUATE = "adequate"
    EFFECT_MISSING = "effect_missing"
    WRONG_MODEL = "wrong_model"


@dataclass(frozen=True)
class Surprise:
    """How often noise alone leaves as much as the estimate does: `p` by the most surprised test, corrected for all.

    `ratio` is the loudest stretch of the whitened residual over what noise leaves there. None: not judged.
    """

    p: float | None
    loudest: str
    ratio: float | None
    where: str

    @property
    def adequate(self) -> bool:
        return self.p is None or self.p >= ADEQUATE_P


@dataclass(frozen=True)
class Adequacy:
    """The grade of an estimate and its sentence; `p` as in `Surprise`."""

    grade: Grade
    sentence: str
    p: float | None

    @property
    def good(self) -> bool:
        return self.grade is Grade.ADEQUATE

    def told(self) -> dict[str, Any]:
        """As `result.json` has it."""
        return {"grade": str(self.grade), "sentence": self.sentence, "p": self.p}


def surprise(observed: Observed, likelihood: Likelihood, unit: np.ndarray, seed: int = SEED) -> Surprise:
    """How surprising what the fit at coordinates (D,) leaves is; not judged where there is too little quiet."""
    if likelihood.noise.mix is None or not observed.quiet:
        return Surprise(None, "", None, "")
    rows, J = likelihood.jacobian(unit)
    inside = (unit > WALL) & (unit < 1 - WALL)
    steady = _linear(likelihood)[inside[: likelihood.free]]
    J = J[:, inside]
    rng = np.random.default_rng(seed)
    drawn = likelihood.noise.draw(rng, DRAWS, np.diff(observed.drive.first).tolist()) * likelihood.known
    white = likelihood.whiten(drawn) / _level(likelihood, observed, rng)[:, None]
    Q, _ = np.linalg.qr(J)
    rest = np.concatenate([rows[None], white])
    rest -= (rest @ Q) @ Q.T
    channels = rest.reshape(len(rest), observed.drive.channels, -1)
    by_test = surprises.statistics(channels, observed)
    if observed.drive.events > 1:
        by_test[PER_EVENT] = ((rest @ _of_each_event(likelihood, J[:, : len(steady)][:, steady], Q).T) ** 2).sum(axis=1)
    left = {name: tail(values[1:], values[:1]) for name, values in by_test.items()}
    loudest = min(left, key=left.__getitem__)
    ratio, where = loudest_stretch(channels[0], observed)
    return Surprise(min(1.0, max(len(left) * left[loudest], SMALLEST_P)), loudest, ratio, where)


def _level(likelihood: Likelihood, observed: Observed, rng: np.random.Generator) -> np.ndarray:
    """By how much each draw (DRAWS,) would have estimated its own noise wrongly, from so few quiet samples."""
    worth = max(likelihood.noise.worth(sum(p.stop - p.start for p in observed.quiet)), 4.0)
    return np.sqrt(rng.chisquare(2 * worth, DRAWS) / (2 * worth))


def _linear(likelihood: Likelihood) -> np.ndarray:
    """Which of the free parameters are no threshold or time of an effect, (free,).

    A relay's instants in an event hang on the noise of the voltage where it crosses the level, which no draw has.
    """
    problem = likelihood.problem
    beside = {p.name for effect in problem.model.effects for p in effect.parameters if p.null is None}
    return np.array([name.partition("[")[0] not in beside for name in problem.space.names])


def _of_each_event(likelihood: Likelihood, J: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Orthonormal directions (m, R) along which columns (R, k) of their own for each event would move the rows."""
    events = likelihood.problem.drive.events
    split = np.concatenate([(J * likelihood.part_of(e)[:, None]).T for e in range(events)])
    split -= (split @ Q) @ Q.T
    return spanned(split, DISTINCT, least=1e-9)


def loudest_stretch(channels: np.ndarray, layout: Layout) -> tuple[float, str]:
    """The loudest window of the whitened residual (2, N): how many times the noise, and where it is."""
    cells = surprises.cells_of(layout)
    row = layout.drive.spoken.index
    level = [float(np.sqrt(np.mean(channels[row(c.channel), c.part] ** 2))) for c in cells]
    k = int(np.argmax(level))
    cell = cells[k]
    name = layout.events[cell.event].record.name
    return level[k], f"{cell.channel} of {name} from {cell.start:.3f} to {cell.end:.3f} s"


def graded(surprise: Surprise, errors: Sequence[tuple[str, float]], least_p: float = ADEQUATE_P) -> Adequacy:
    """The grade of an estimate that leaves this, with relative errors [(event and channel, epsilon of Eq. (20))].

    What is left is nothing but noise from p = `least_p` on.
    """
    if surprise.p is None:
        where, worst = max(errors, key=lambda e: e[1])
        if worst >= ACCEPTED:
            return Adequacy(Grade.WRONG_MODEL, _wrong(where, worst), None)
        return Adequacy(
            Grade.EFFECT_MISSING,
            f"it fits within {worst:.1%}, but too few samples before and after the dips are quiet to tell whether an"
            " effect is missing: do not rely on its intervals", None,
        )  # fmt: skip
    if surprise.p >= least_p:
        return Adequacy(Grade.ADEQUATE, "the model describes this load: use it", surprise.p)
    where, worst = max(errors, key=lambda e: e[1])
    if worst >= ACCEPTED:
        return Adequacy(Grade.WRONG_MODEL, _wrong(where, worst), surprise.p)
    return Adequacy(
        Grade.EFFECT_MISSING,
        f"it fits within {worst:.1%}, but an effect is missing: do not use its intervals ({surprise.where} is"
        f" {surprise.ratio:.2g} times as loud as the noise; p of what is left by chance: {in_words(surprise.p)})",
        surprise.p,
    )


def _wrong(where: str, worst: float) -> str:
    off = f"{where} is off by {worst:.1%}, beyond the {ACCEPTED:.0%} of Eq. (20)"
    return f"this model does not describe this load: {off}"
