"""Does the model describe the load? What an estimate leaves, against what noise alone leaves, and
the grade for it.

Draws of the estimated noise go through the same whitening and projection as the residual; windows,
steps, pulses, oscillations and, of several events, parameters of their own tell how much louder the
residual is. Under a right model least squares and the likelihood agree, too: a last test asks
whether the likelihood gives up more of Eq. (8) than it would on the draws (Hausman 1978), which it
does where it takes a model's error for slow noise. A model is *adequate* where chance may leave as
much. Where it may not, the size of the model's error grades it: an effect is missing, or the model
is the wrong one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from tractexp.inference import residual_statistics
from tractexp.inference.bounds import is_off_bounds
from tractexp.inference.goodness_of_fit import (
    ADEQUATE_P,
    LEAST_DISTINCT_SHARE,
    NULL_DRAWS,
    GoodnessOfFit,
    compare_with_draws,
)
from tractexp.inference.least_squares import MOST_NUMBERS
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.model_error import ModelError, describe_stall
from tractexp.inference.problem import Problem
from tractexp.inference.residual_statistics import PER_EVENT
from tractexp.inference.separable import Sensitivities, SeparableBasis

JUDGEMENT_SEED = 20201  # of the draws: the judgement of one record is always the same
ACCEPTED = 0.05  # Eq. (20): a load model is acceptable below 5 %
# of the response: a model that leaves a fifth of it does not describe the load. A word for a size.
WRONG = 0.2
APART = "least squares apart from the likelihood"


class Grade(StrEnum):
    """What an estimate is good for."""

    ADEQUATE = "adequate"
    EFFECT_MISSING = "effect_missing"
    WRONG_MODEL = "wrong_model"


@dataclass(frozen=True)
class ResidualTest:
    """How often noise alone leaves as much as an estimate does.

    Attributes
    ----------
    p : float or None
        By the most significant test, corrected for all; None: not judged, for too few samples are
        quiet.
    loudest : str
        What that test looks for.
    ratio : float or None
        The loudest stretch of the whitened residual over what noise leaves there.
    where : str
        Which stretch that is.
    """

    p: float | None
    loudest: str
    ratio: float | None
    where: str

    @property
    def adequate(self) -> bool:
        """Whether nothing but noise is left, as far as that can be told."""
        return self.p is not None and self.p >= ADEQUATE_P


@dataclass(frozen=True)
class Adequacy:
    """The grade of an estimate, its sentence, and `p` as in `ResidualTest`."""

    grade: Grade
    sentence: str
    p: float | None

    def to_dict(self) -> dict[str, Any]:
        """As `result.json` has it."""
        return {"grade": str(self.grade), "sentence": self.sentence, "p": self.p}


def run_residual_test(
    likelihood: Likelihood,
    unit: np.ndarray,
    squares: Likelihood | None = None,
    least: float = np.inf,
) -> ResidualTest:
    """How often noise alone leaves as much as a fit does.

    Parameters
    ----------
    likelihood : Likelihood
        That of the noise, driven by smoothed voltages.
    unit : (D,)
        Coordinates of the fit.
    squares : Likelihood or None
        That of Eq. (8), which the likelihood is compared with; None: it is not.
    least : float
        The least sum of squares of Eq. (8), in the units of `squares`.

    Returns
    -------
    Surprise
        Not judged where too little is quiet.
    """
    if likelihood.noise.mix is None or not likelihood.problem.quiet:
        return ResidualTest(None, "", None, "")
    problem, drive = likelihood.problem, likelihood.problem.drive
    rows, J = likelihood.jacobian(unit)
    inside = is_off_bounds(unit)
    steady = _linear(likelihood)[inside[: likelihood.free]]
    J = J.only(inside)
    rng = np.random.default_rng(JUDGEMENT_SEED)
    drawn = likelihood.noise.draw(rng, NULL_DRAWS, np.diff(drive.first).tolist())
    drawn *= likelihood.valid
    levels = likelihood.noise.draw_levels(rng, NULL_DRAWS, problem.quiet)
    drawn /= levels[:, None, None]
    basis = J.basis()
    split = build_event_basis(J, steady)

    def compute_statistics(rest: np.ndarray) -> dict[str, np.ndarray]:
        by_test = residual_statistics.compute_residual_statistics(
            rest.reshape(len(rest), drive.channels, -1), problem
        )
        return by_test | ({PER_EVENT: split.energy(rest)} if drive.events > 1 else {})

    excess = squares and compare_with_squares(squares, unit, J, least)
    own = basis.project_out(rows[None])
    parts = [compute_statistics(own) | ({APART: excess[0]} if excess else {})]
    together = max(1, MOST_NUMBERS // len(rows))
    for some in np.split(drawn, range(together, NULL_DRAWS, together)):
        white = likelihood.whiten(some)
        parts.append(
            compute_statistics(basis.project_out(white))
            | ({APART: excess[1](white, some)} if excess else {})
        )
    by_test = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    values, draws = (
        {name: rows[part] for name, rows in by_test.items()} for part in (slice(1), slice(1, None))
    )
    fit = GoodnessOfFit(compare_with_draws(values, draws))
    ratio, where = find_loudest_stretch(own.reshape(drive.channels, -1), problem)
    return ResidualTest(fit.p, fit.most_significant_test, ratio, where)


def build_event_basis(J: Sensitivities, steady: np.ndarray) -> SeparableBasis:
    """The basis of what parameters of their own for each event could change.

    Parameters
    ----------
    J : Sensitivities
        To the shared coordinates and those of each event.
    steady : (k,) bools
        Shared coordinates that may differ from event to event.

    Returns
    -------
    SeparableBasis
    """
    shared = J.without_own.T
    columns = np.concatenate([shared[~steady], shared[steady]])
    return replace(J, columns=columns, k=int(np.count_nonzero(~steady))).basis(
        LEAST_DISTINCT_SHARE, 1e-9
    )


def compare_with_squares(
    squares: Likelihood, unit: np.ndarray, J: Sensitivities, least: float
) -> tuple[np.ndarray, Callable[[np.ndarray, np.ndarray], np.ndarray]]:
    """What the likelihood leaves of Eq. (8) over what least squares leave.

    Parameters
    ----------
    squares : Likelihood
        That of Eq. (8).
    unit : (D,)
        Coordinates of the likelihood's fit.
    J : Sensitivities
        Whitened by the noise, to the coordinates off their bounds.
    least : float
        The least sum of squares of Eq. (8).

    Returns
    -------
    (1,) array
        That ratio for the records.
    (white, drawn) -> (b,)
        That of draws of noise (b, C, N) [pu], which whitened are `white` (b, R).
    """
    likelihood = squares.with_initial_power
    rows, plain = likelihood.jacobian(unit)
    inside = is_off_bounds(unit)
    k = plain.k
    off_bounds = plain.only(inside)
    reached = plain.only(inside & (np.arange(len(inside)) < k)).basis()

    def compare_draws(white: np.ndarray, drawn: np.ndarray) -> np.ndarray:
        raw = likelihood.whiten(drawn)
        likely = raw - off_bounds.times(J.fit(white))
        shifted = raw + plain.times(np.pad(_draw_mean_errors(likelihood, drawn), ((0, 0), (k, 0))))
        rest = reached.project_out(shifted)
        return (likely**2).sum(axis=1) / np.maximum((rest**2).sum(axis=1), 1e-300)

    return np.array([rows @ rows / max(least, 1e-300)]), compare_draws


def _draw_mean_errors(plain: Likelihood, drawn: np.ndarray) -> np.ndarray:
    """By how much draws (b, C, N) would have P0 and Q0 of each event wrong, (b, 2 E), in ranges,
    for Eq. (8).
    """
    problem = plain.problem
    wrong = np.zeros((len(drawn), problem.drive.events, 2))
    for e, steady in enumerate(problem.steady):
        wrong[:, e] = drawn[:, :, steady].mean(axis=2)
    return -wrong.reshape(len(drawn), -1) / plain.free_set.box.width[plain.free :]


def _linear(likelihood: Likelihood) -> np.ndarray:
    """Which of the free parameters are no threshold or time of an effect, (free,).

    A relay's instants in an event hang on the noise of the voltage where it crosses the level,
    which no draw has.
    """
    problem = likelihood.problem
    beside = {
        p.name for effect in problem.model.effects for p in effect.parameters if p.null is None
    }
    return np.array([name.partition("[")[0] not in beside for name in problem.space.names])


def find_loudest_stretch(channels: np.ndarray, problem: Problem) -> tuple[float, str]:
    """The loudest window of a whitened residual.

    Parameters
    ----------
    channels : (C, N)
        The residual, in standard deviations.
    problem : Problem
        Whose windows count.

    Returns
    -------
    float
        Its rms: how many times the noise.
    str
        Where it is: channel, event and times [s].
    """
    windows = residual_statistics.list_residual_windows(problem)
    row = problem.drive.labels.index
    level = [float(np.sqrt(np.mean(channels[row(c.channel), c.part] ** 2))) for c in windows]
    k = int(np.argmax(level))
    window = windows[k]
    name = problem.events[window.event].record.name
    return level[k], f"{window.channel} of {name} from {window.start:.3f} to {window.end:.3f} s"


def grade_errors(
    surprise: ResidualTest,
    fitted: ModelError,
    held_out: ModelError | None = None,
    active_bounds: Sequence[str] = (),
) -> Adequacy:
    """The grade of an estimate, by what it leaves.

    Parameters
    ----------
    surprise : Surprise
        How often noise leaves as much.
    fitted, held_out : ModelError, ModelError or None
        The model's error on the fitted and on the held-out events.
    active_bounds : texts
        The bounds that hold a parameter.

    Returns
    -------
    Adequacy
        A wrong model where an error is `WRONG` or more of the response; adequate where noise may
        leave as much; else an effect is missing.
    """
    errors = [error for error in (fitted, held_out) if error]
    noise = surprise.adequate
    sure = max(e.interval[0] if noise else e.value for e in errors)
    held = "".join(f"; a bound holds {bound}" for bound in active_bounds)
    if sure >= WRONG:
        size = _describe_misfit(fitted, held_out)
        return Adequacy(
            Grade.WRONG_MODEL, f"this model does not describe this load: {size}{held}", surprise.p
        )
    said = f"the model describes this load within {fitted}"
    of_fitted = ""
    if held_out:
        said += f", the held-out dips within {held_out}"
        of_fitted = " of the fitted dips"
    if noise:
        said += f": noise alone leaves as much{of_fitted}{held}"
        return Adequacy(Grade.ADEQUATE, said, surprise.p)
    return Adequacy(Grade.EFFECT_MISSING, f"{said}; {_describe_rest(surprise)}{held}", surprise.p)


def _describe_misfit(fitted: ModelError, held_out: ModelError | None) -> str:
    """What a model leaves that does not describe the load, and where it stalls."""
    if stalls := [*fitted.stalls, *(held_out.stalls if held_out else ())]:
        return describe_stall(stalls)
    beside = f", and of the held-out dips {held_out}" if held_out else ""
    return f"it leaves {fitted}{beside}"


def _describe_rest(surprise: ResidualTest) -> str:
    """What is said of a fit that leaves more than noise, as far as that is known."""
    if surprise.p is None:
        return (
            "too few samples before and after the dips are quiet to tell whether an effect is"
            " missing"
        )
    if surprise.ratio is None or surprise.loudest == APART:
        return "an effect is missing"
    return (
        f"an effect is missing, {surprise.where} is {surprise.ratio:.2g} times as loud as the noise"
    )
