"""The noise of one bench, estimated from what its fits leave where little happens.

Of waveforms it is white but for what noise of the voltage causes (`tractexp.noise.waves`), does not wander within so
short a record, and has the offsets that the channels may have kept.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.context import Context
from tractexp.discrepancy.jumps import jumps
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.problem import Problem
from tractexp.noise import Noise
from tractexp.noise.random_walk import walk_of_load
from tractexp.record import Event


@dataclass(frozen=True, eq=False)
class QuietNoise:
    """Estimates noise on a bench. `blur` (k, C, N) [pu] is what errors of the record do to what is compared."""

    bench: Context
    blur: np.ndarray | None  # of the voltage's noise, None where it has none; of waveforms, of the currents' offsets

    @classmethod
    def at(cls, bench: Context, unit: np.ndarray) -> "QuietNoise":
        """Where errors of the voltage act as they do on the base model at coordinates (D,)."""
        if (errors := bench.domain.input_errors(bench.problem, _values(bench, unit))) is not None:
            return cls(bench, errors)
        most = bench.records.voltage_errors
        if not most:
            return cls(bench, None)
        calm = _at_voltage(bench, bench.events, unit)
        off = [_at_voltage(bench, bench.records.off_by(k), unit) - calm for k in range(most)]
        return cls(bench, np.nan_to_num(np.array(off)))

    def of_fit(self, unit: np.ndarray, names: Sequence[str] | None = None) -> Noise:
        """The noise of the quiet residuals at coordinates (D,), of a fit with these effects, by default of any."""
        return self.of(unit, self.bench.residuals(unit[None], names)[0])

    def of(
        self,
        unit: np.ndarray,
        residual: np.ndarray,
        left: np.ndarray | None = None,
        columns: np.ndarray | None = None,
    ) -> Noise:
        """The noise of one residual (C, N) in quiet stretches, at coordinates (D,).

        What a fit leaves (C, N), and columns of all that could explain it (k, C, N), tell more of how the load wanders.
        Of waveforms the model there tells how noise of the voltage is passed on.
        """
        bench, criteria = self.bench, self.bench.criteria
        walk = functools.partial(
            walk_of_load, bench.events, bench.drive, bench.power, left, columns, bench.known,
            seen=criteria.wandering_seen, within=criteria.wandering_within, less=criteria.wandering_likely,
        )  # fmt: skip
        errors = [shapes for shapes in (self.blur, jumps(bench, unit)) if shapes is not None]
        values, shapes = _values(bench, unit), np.concatenate(errors) if errors else None
        return bench.domain.noise(residual, bench.known, bench.quiet, bench.problem, values, walk, shapes)


def white(bench: Context) -> Noise:
    """White noise of the level before the dips: what is known before the first fit."""
    each = zip(*(e.levels for e in bench.events), strict=True)
    levels = [float(np.sqrt(np.mean([level**2 for level in channel]))) for channel in each]
    return Noise(Noise.white(*levels).pairs, np.eye(len(levels)))


def _values(bench: Context, unit: np.ndarray) -> np.ndarray:
    """Free values (d,) of the problem of everything at coordinates (D,)."""
    space = bench.problem.space
    return space.from_unit(unit[: space.dimension])


def _at_voltage(bench: Context, events: tuple[Event, ...] | list[Event], unit: np.ndarray) -> np.ndarray:
    """Residuals (C, N) of the base model at coordinates (D,), driven by the voltages of other events."""
    kernels, at = bench.kernels, bench.coordinates
    problem = Problem(bench.model, events, kernels.bounds, kernels.fixed, kernels.substeps)
    return Likelihood.of(problem).residuals(np.r_[unit[at.base], unit[at.before]][None])[0]
