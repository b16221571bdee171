"""The gap between simulation and measurement, the model's error, before and after an effect is
added.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.inference.context import Context
from tractexp.inference.differences import step_both_ways
from tractexp.inference.injection import PUSHES, inject_perturbations
from tractexp.inference.linearization import find_active_bounds
from tractexp.inference.model_error import ModelChange, ModelMisfit
from tractexp.noise import Noise
from tractexp.noise.span import compute_basis, project_out

SHOWN, MILD, DENIED = "shown", "mild", "denied"  # what events say of an extension
# roots of what is expected: in 95 % of cases no more than so many are lacking of it
SPREAD = 2 * 1.645
# singular values below this share of the largest: pushes that differ from others in noise only
LEAST_DISTINCT_PUSH = 0.03


@dataclass(frozen=True, eq=False)
class Curves(ModelMisfit):
    """What a model calculates of all events end to end, and what it leaves.

    Attributes
    ----------
    calculated : (C, N) [pu]
        P and Q, or currents.
    deviance, chi2_per_sample : float
        The sum of squares of whitened residuals, and that per sample.
    """

    calculated: np.ndarray
    deviance: float
    chi2_per_sample: float


@dataclass(frozen=True, eq=False)
class GapTest(ModelChange[Curves]):
    """The model's error before and after, and whether some events bear the extension out.

    Attributes
    ----------
    before, after : Curves
        Of the base and of the extended model.
    gain : float
        The deviance gained.
    left : float
        What injected perturbations would still gain beyond chance: sharper than the model's error
        where the gap is no larger than the noise.
    expected : float
        What a true explanation would gain: the squared distance of both curves in standard
        deviations. A true one scatters about it by twice its root.
    shown : float
        The gain from which the events show the extension.
    noise : Noise
        Of the events, by which both are judged.
    context : Context or None
        The events and models.
    units : two (D,) arrays
        Coordinates of both models in `context`.
    by_event : E floats
        What of `expected` is of each event.
    """

    gain: float
    left: float
    expected: float
    shown: float
    noise: Noise
    context: Context | None = None
    units: tuple[np.ndarray, ...] = ()
    by_event: tuple[float, ...] = ()

    @property
    def explained_share(self) -> float:
        """The share of what could be explained: of what was gained and what is left. 0 where that
        is nothing.
        """
        if self.gain == np.inf:  # the model diverges without it
            return 1.0
        whole = self.gain + max(self.left, 0.0)
        return self.gain / whole if whole > 0 else 0.0

    @property
    def outcome(self) -> str:
        """What these events say of the extension: `SHOWN`, `DENIED` where they gain less than a
        true one does in 95 % of cases, or `MILD` where they are too mild for either.
        """
        if self.gain >= self.shown:
            return SHOWN
        least = self.expected - SPREAD * self.expected**0.5
        # of no steady state neither is a number
        return MILD if self.gain >= least else DENIED


def share_gone(factor: float) -> float:
    """The share of squares that is gone where their root is divided by a factor.

    Examples
    --------
    >>> share_gone(2.0)
    0.75
    """
    return 1 - 1 / factor**2


def compute_curves(
    context: Context, unit: np.ndarray, noise: Noise, names: Sequence[str] = ()
) -> Curves:
    """What a fit with the named effects leaves; beyond all measure where it has no steady state."""
    residual = context.residuals(unit[None], names)
    white = context.whiten(noise, residual)[0]
    calculated = residual[0] + context.drive.measurements
    deviance = float(np.nan_to_num(white @ white, nan=np.inf))
    misfit = ModelMisfit.from_played(context.cut_playbacks(calculated))
    chi2 = deviance / max(context.samples, 1)
    return Curves(**vars(misfit), calculated=calculated, deviance=deviance, chi2_per_sample=chi2)


def compute_gap(
    context: Context,
    base: np.ndarray,
    extended: np.ndarray,
    names: Sequence[str],
    noise: Noise,
    fitted: Sequence[int] | np.ndarray,
    without: Sequence[str] = (),
    changes: np.ndarray | None = None,
) -> GapTest:
    """Compare two fits on the events of a context.

    Parameters
    ----------
    context : Context
        The events and models.
    base, extended : (D,)
        Coordinates of both fits.
    names : names
        Effects of the extended one.
    noise : Noise
        Of the events.
    fitted : columns
        Coordinates that were fitted to these events in the extended model.
    without : names
        Effects of the base one.
    changes : (c, C N) or None
        Whitened changes that could still gain; None: injected perturbations of the balances.

    Returns
    -------
    GapTest
    """
    before = compute_curves(context, base, noise, without)
    after = compute_curves(context, extended, noise, names)
    gained = before.deviance - after.deviance
    left = np.inf
    if np.isfinite(after.deviance):
        if changes is None:
            changes = compute_pushed_changes(context, extended, names, noise)
        left = compute_gain_beyond_chance(context, extended, names, noise, fitted, changes)
    apart = (after.calculated - before.calculated)[None] * context.valid
    rows = np.nan_to_num(context.whiten(noise, apart)[0], nan=np.inf).reshape(
        context.drive.channels, -1
    )
    by_event = tuple(float(np.sum(rows[:, part] ** 2)) for part in context.drive.parts)
    shown = context.criteria.shown
    units = (base, extended)
    return GapTest(
        before,
        after,
        float(gained),
        left,
        float(np.sum(rows**2)),
        shown,
        noise,
        context,
        units,
        by_event,
    )


def compute_pushed_changes(
    context: Context, unit: np.ndarray, names: Sequence[str], noise: Noise
) -> np.ndarray:
    """The changes (c, C N), whitened, that perturbations of all balances in all windows make at
    coordinates (D,).
    """
    points, _ = inject_perturbations(context, unit)
    return context.whiten(noise, context.changes(unit, points, names, [PUSHES] * len(points)))


def compute_gain_beyond_chance(
    context: Context,
    unit: np.ndarray,
    names: Sequence[str],
    noise: Noise,
    fitted: Sequence[int] | np.ndarray,
    changes: np.ndarray,
) -> float:
    """By how much more than chance some changes would still lower the deviance.

    It is unbiased: the energy in their space less its dimension, what is fitted projected out.

    Parameters
    ----------
    context : Context
        The events and models.
    unit : (D,)
        Coordinates of the fit.
    names : names
        Its effects.
    noise : Noise
        Of the events.
    fitted : columns
        Coordinates that were fitted to these events.
    changes : (c, C N)
        Whitened.

    Returns
    -------
    float
    """
    raw = context.residuals(np.concatenate([unit[None], step_both_ways(unit, fitted)[0]]), names)
    rows = np.nan_to_num(context.whiten(noise, raw))
    r = rows[0]
    k = len(fitted)
    nuisance = rows[1 : 1 + k] - rows[1 + k :]
    nuisance = nuisance[~find_active_bounds(context, unit, fitted, nuisance @ r)]
    Q = np.linalg.qr(nuisance.T)[0]
    basis = compute_basis(project_out(changes, Q.T), LEAST_DISTINCT_PUSH)
    return float(np.sum((basis @ r) ** 2) - len(basis))
