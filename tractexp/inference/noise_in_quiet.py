"""The noise of one context, estimated from what its fits leave where little happens.

Of waveforms it is white but for what noise of the voltage causes (`tractexp.noise.waves`), does not
wander within so short a record, and has the offsets that the channels may have kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.inference.jumps import find_jump_errors
from tractexp.inference.noise import compute_input_modes, estimate_noise
from tractexp.noise import Noise


@dataclass(frozen=True, eq=False)
class QuietNoise:
    """Estimates the noise of the fits of one context.

    Attributes
    ----------
    context : Context
        The records and models.
    input_modes : (k, C, N) [pu] or None
        What errors of the record do to what is compared: those of the voltage's noise, None where
        it has none; of waveforms those of the channels' offsets.
    """

    context: Context
    input_modes: np.ndarray | None

    @classmethod
    def from_context(cls, context: Context, unit: np.ndarray) -> "QuietNoise":
        """The estimator whose errors of the record act as on the base model at coordinates (D,)."""
        bare = context.kernels.bare
        values = bare.space.from_unit(unit[context.coordinates.base])
        return cls(context, compute_input_modes(bare, context.records.smoothed, values))

    def of_fit(self, unit: np.ndarray, names: Sequence[str] = ()) -> Noise:
        """The noise of the quiet residuals at coordinates (D,), of a fit with these effects."""
        return self.estimate_noise(unit, self.context.residual(unit, names))

    def estimate_noise(
        self,
        unit: np.ndarray,
        residual: np.ndarray,
        left: np.ndarray | None = None,
        columns: np.ndarray | None = None,
    ) -> Noise:
        """The noise of one residual, from its quiet stretches.

        Parameters
        ----------
        unit : (D,)
            Coordinates of the model; of waveforms it tells how noise of the voltage is passed on.
        residual : (C, N) [pu]
            Whose noise is estimated.
        left : (C, N) [pu] or None
            What a fit leaves; it tells more of how the load wanders.
        columns : (k, C, N) [pu] or None
            What could explain that.

        Returns
        -------
        Noise

        Raises
        ------
        UserError
            Where too few samples are quiet.
        """
        context = self.context
        both = self.input_modes, find_jump_errors(context, unit)
        errors = [shapes for shapes in both if shapes is not None]
        return estimate_noise(
            context.problem,
            residual,
            context.valid,
            context.problem.quiet,
            context.kernels.select_problem(context.coordinates.present(unit), unit),
            np.concatenate(errors) if errors else None,
            left,
            columns,
        )


def assume_white_noise(context: Context) -> Noise:
    """White noise of the level before the dips: what is known before the first fit."""
    each = zip(*(e.levels for e in context.events), strict=True)
    levels = [float(np.sqrt(np.mean([level**2 for level in channel]))) for channel in each]
    return Noise(Noise.white(*levels).pairs, np.eye(len(levels)))


def assume_residual_noise(context: Context, fit: Refit) -> Noise:
    """White noise as loud as what a fit leaves, alike in each channel.

    Under it the deviance is the sum of squares by which names are judged.
    """
    residual = context.residual(fit.unit, fit.names)
    level = float(np.sqrt(np.mean(residual[context.valid] ** 2)))
    return Noise(Noise.white(*[level] * len(residual)).pairs, np.eye(len(residual)))
