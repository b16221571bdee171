"""The noise of one bench, estimated from what its fits leave where little happens.

Of waveforms it is white but for what noise of the voltage causes (`tractexp.noise.waves`), does not wander within so
short a record, and has the offsets that the channels may have kept.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.jumps import jumps
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.observed import answers, unsure
from tractexp.identification.problem import Problem
from tractexp.noise import Noise
from tractexp.noise.quiet import estimate
from tractexp.noise.wander import Rest, Wander, find
from tractexp.noise.waves import of_waves
from tractexp.record import Event


@dataclass(frozen=True, eq=False)
class QuietNoise:
    """Estimates noise on a bench. `blur` (k, C, N) [pu] is what errors of the record do to what is compared."""

    bench: Bench
    blur: np.ndarray | None  # of the voltage's noise, None where it has none; of waveforms, of the currents' offsets

    @classmethod
    def at(cls, bench: Bench, unit: np.ndarray) -> "QuietNoise":
        """Where errors of the voltage act as they do on the base model at coordinates (D,)."""
        if bench.waves:
            return cls(bench, unsure(bench.problem, _values(bench, unit)))
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
        bench = self.bench
        if bench.waves:
            passed, phases = answers(bench.problem, _values(bench, unit)), bench.records.phases
            blur = np.concatenate([shapes for shapes in (self.blur, jumps(bench, unit)) if shapes is not None])
            return of_waves(residual, bench.known, bench.quiet, passed, phases, blur)
        wander = functools.partial(self._wander, left, columns)
        return estimate(residual, bench.known, bench.quiet, wander, self.blur)

    def _wander(self, left: np.ndarray | None, columns: np.ndarray | None, mix: np.ndarray) -> Wander | None:
        """How the load wanders before the events and during them, in mixed channels."""
        bench, drive, criteria = self.bench, self.bench.drive, self.bench.criteria
        before = [drive.measured[:, drive.part(e)][:, event.steady] for e, event in enumerate(bench.events)]
        rests = []
        if left is not None and columns is not None and bench.known.all():
            mixed, parts = np.einsum("ij,kjt->kit", mix, columns), map(drive.part, range(drive.events))
            rests = [Rest(mix @ left[:, part], mixed[:, :, part], bench.power.apparent[part]) for part in parts]
        return find(
            [mix @ b for b in before if np.isfinite(b).all()], bench.events[0].record.step, bench.power, rests,
            seen=criteria.wandering_seen, within=criteria.wandering_within, less=criteria.wandering_likely,
        )  # fmt: skip


def white(bench: Bench) -> Noise:
    """White noise of the level before the dips: what is known before the first fit."""
    each = zip(*(e.levels for e in bench.events), strict=True)
    levels = [float(np.sqrt(np.mean([level**2 for level in channel]))) for channel in each]
    return Noise(Noise.white(*levels).pairs, np.eye(len(levels)))


def _values(bench: Bench, unit: np.ndarray) -> np.ndarray:
    """Free values (d,) of the problem of everything at coordinates (D,)."""
    return Likelihood.of(bench.problem).values(unit)


def _at_voltage(bench: Bench, events: tuple[Event, ...] | list[Event], unit: np.ndarray) -> np.ndarray:
    """Residuals (C, N) of the base model at coordinates (D,), driven by the voltages of other events."""
    kernels, at = bench.kernels, bench.coordinates
    problem = Problem(bench.model, events, kernels.bounds, kernels.fixed, kernels.substeps)
    return Likelihood.of(problem).residuals(np.r_[unit[at.base], unit[at.before]][None])[0]
