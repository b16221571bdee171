"""Where a model and the records disagree, if they do: all tests at one fit."""

import functools
from dataclasses import dataclass, replace

import numpy as np

from tractexp.inference.base_fit import BaseFit
from tractexp.inference.blocks import cut_blocks
from tractexp.inference.chance import BLURRED, Chance, draw_chance, draw_scales
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.fit_effort import NOISE_ROUNDS, QUIETER
from tractexp.inference.fitting import Refit, refit_from
from tractexp.inference.goodness_of_fit import GoodnessOfFit
from tractexp.inference.linearization import Linearization, linearize_fit, remove_explained
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.inference.sandwich import compute_moves_without_blocks, compute_robust_root
from tractexp.inference.score_test import Score, ScoreTest
from tractexp.noise import Noise

MISSED = 20.0  # factor by which scales that are not exact may miss p


@dataclass(frozen=True, eq=False)
class Disagreement:
    """The tests at one fit.

    Attributes
    ----------
    fit : Refit
        The fit.
    noise : Noise
        Under which it is tested.
    tangent : Linearization
        All differences there.
    projection : ScoreTest
        These, whitened and with the nuisances projected out.
    chance : Chance
        The null distribution of every statistic.
    robust : (k, d) or None
        Rows of the covariance where what is left is no noise; None: that of independent residuals.
    """

    fit: Refit
    noise: Noise
    tangent: Linearization
    projection: ScoreTest
    chance: Chance
    robust: np.ndarray | None = None  # (k, d) as `root`, where what is left is no noise

    @property
    def root(self) -> np.ndarray:
        """Rows (k, d) whose inverse products are the covariance of all that is free, in its
        coordinates.
        """
        return self.projection.R if self.robust is None else self.robust

    @property
    def freedom(self) -> float:
        """The degrees of freedom of standard errors: samples, or blocks of them where what is
        left is no noise.
        """
        fitted = self.root.shape[1]
        if self.robust is None:
            return self.context.samples - fitted
        return len(cut_blocks(self.context.events, self.context.drive, fitted)) - 1

    @property
    def context(self) -> Context:
        """The events and models that it was found on."""
        return self.tangent.context

    def score_fit(self, context: Context, fit: Refit, noise: Noise) -> "Disagreement":
        """The scores at another fit under a noise, by what chance does at this one."""
        t = linearize_fit(context, fit, noise)
        return Disagreement(fit, noise, t, t.build_score_test(noise), self.chance)

    @functools.cached_property
    def scores(self) -> list[Score]:
        """What each effect outside the fit would gain, the rarest by chance first."""
        return self.projection.scores()

    @property
    def criteria(self) -> Criteria:
        """The thresholds that decide."""
        return self.context.criteria

    @functools.cached_property
    def goodness_of_fit(self) -> GoodnessOfFit:
        """How often chance leaves as much as this fit does."""
        return GoodnessOfFit(self.chance.surprises(self.projection, self.context))

    @property
    def p_by_test(self) -> dict[str, float]:
        """{test: p}: how often chance leaves as much as this fit."""
        return self.goodness_of_fit.p_by_test

    @property
    def p_left(self) -> float:
        """The p of the most significant test, corrected for their number."""
        return self.goodness_of_fit.p

    @property
    def adequate(self) -> bool:
        """Whether chance alone may leave as much as this fit."""
        return self.p_left >= self.criteria.adequate_p

    @property
    def is_undecided(self) -> bool:
        """Whether the draws leave it open if the fit is adequate: their scales are not exact."""
        level = self.criteria.adequate_p
        return not self.chance.scales and level / MISSED < self.p_left < level * MISSED

    @property
    def loudest(self) -> str:
        """The name of the most significant test."""
        return self.goodness_of_fit.most_significant_test

    @property
    def parameters_at_bound(self) -> list[str]:
        """The names of parameters that rest on a bound: better values lie beyond it."""
        names = {k: name for name, k in self.context.coordinates.column.items()}
        return [names[k] for k in self.tangent.held]

    @property
    def asks_for_more(self) -> bool:
        """Whether any further effect of the load helps more than chance does."""
        return bool(self.scores) and self.scores[0].p < self.level

    @property
    def level(self) -> float:
        """The p that one more name must undercut."""
        level = self.chance.critical_p(self.criteria.naming_false_alarms)
        return min(level, self.criteria.further_name_p) if self.fit.names else level

    @property
    def suffices(self) -> bool:
        """Whether this fit leaves nothing, and no further effect helps."""
        return self.adequate and not self.asks_for_more

    @functools.cached_property
    def faults(self) -> tuple[str, ...]:
        """The faults of the measurement that are not at their null.

        None where the voltage is noisy: whatever smooths the calculated power would seem to be
        there.
        """
        if self.noise.loudest_input_mode > BLURRED:
            return ()
        return tuple(
            sorted(name for name, p in self.projection.fault_p().items() if p[0] < self.level)
        )


def examine_base_fit(base: BaseFit, seed: int) -> Disagreement:
    """The tests of the base model's fit.

    Parameters
    ----------
    base : BaseFit
        The base model's own fit.
    seed : int
        Of the draws.

    Returns
    -------
    Disagreement
    """
    return examine_fit(base.quiet, base.fit, base.noise, seed)


def examine_fit(quiet: QuietNoise, fit: Refit, noise: Noise, seed: int) -> Disagreement:
    """Make all tests at one fit, under the noise of what no candidate explains there.

    Parameters
    ----------
    quiet : QuietNoise
        What estimates the noise.
    fit : Refit
        Where the tests are made.
    noise : Noise
        Under which it was fitted.
    seed : int
        Of the draws.

    Returns
    -------
    Disagreement
    """
    context = quiet.context
    t = linearize_fit(context, fit, noise)
    for _ in range(NOISE_ROUNDS):
        noise = _estimate_unexplained_noise(quiet, t)
        fit = refit_from(context, noise, fit.names, fit.unit)
        t = linearize_fit(context, fit, noise)
        if fit.deviance > QUIETER * context.samples:
            break  # else this is the noise of a worse fit
    projection = t.build_score_test(noise)
    chance = draw_chance(t, projection, noise, seed)
    result = Disagreement(fit, noise, t, projection, chance)
    if result.is_undecided:
        result = replace(
            result, chance=replace(result.chance, scales=draw_scales(t, projection, noise, seed))
        )
    return result


def _estimate_unexplained_noise(quiet: QuietNoise, t: Linearization) -> Noise:
    """The noise of what no candidate explains at a fit."""
    return quiet.estimate_noise(
        t.unit, remove_explained(t, t.residual[None])[0], t.residual, t.explaining_columns
    )


def examine_least_squares(quiet: QuietNoise, fit: Refit, noise: Noise, seed: int) -> Disagreement:
    """Make all tests at a fit by least squares, under the noise that it shows where little happens,
    with a covariance of its parameters that holds where what it leaves is no noise. It was fitted
    under `noise`, that of `assume_residual_noise`.

    Under a wrong model the likelihood of the noise before the dip is no likelihood: a few samples
    at the edges, many times louder than that noise, bend every parameter. Least squares asks for no
    noise, and the covariance of its estimates holds where residuals are correlated within blocks,
    and where they are noise (White 1982; Bell and McCaffrey 2002, as in
    `tractexp.inference.sandwich`).
    """
    quiet = replace(quiet, context=quiet.context.with_measured_power)
    t = linearize_fit(quiet.context, fit, noise)
    root = _compute_robust_rows(quiet.context, t.build_score_test(noise))
    own = _estimate_unexplained_noise(quiet, t)
    projection = t.build_score_test(own)
    chance = draw_chance(t, projection, own, seed)
    return Disagreement(fit, own, t, projection, chance, root)


def _compute_robust_rows(context: Context, projection: ScoreTest) -> np.ndarray:
    """Rows (k, d) whose inverse products are the covariance of all that is free, from blocks left
    out in turn.
    """
    J = projection.Q @ projection.R  # with the rows of the prior
    r = projection.r[0] + projection.Q @ projection.along[0]
    measured = context.drive.measurements
    columns = J[: measured.size].reshape(*measured.shape, -1)
    rows = r[: measured.size].reshape(measured.shape)
    blocks = cut_blocks(context.events, context.drive, J.shape[1])
    return compute_robust_root(J, compute_moves_without_blocks(columns, rows, blocks, J.T @ J))[0]
