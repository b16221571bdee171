"""What every step of an investigation works with: records, coordinates and the kernels that
simulate them.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tractexp.cache import store
from tractexp.domain import Domain, domain_of
from tractexp.inference.catalogue import Catalogue
from tractexp.inference.differences import finite, slopes, two_sided
from tractexp.inference.effort import Effort
from tractexp.inference.free_set import FreeSet
from tractexp.inference.kernels import Family, Kernels, Key
from tractexp.inference.prior import departures, weigh_prior
from tractexp.inference.problem import Problem
from tractexp.inference.records import Records
from tractexp.inference.separable import SeparableColumns
from tractexp.model.drive import Drive
from tractexp.model.model import Model
from tractexp.noise import Noise
from tractexp.record import Event

if TYPE_CHECKING:
    from tractexp.discrepancy.criteria import Criteria

# Standard deviation of a fault of the measurement before anything is seen, in its relevant sizes:
# clocks, windows and drifts beyond that are seen before a record is used.
FAULT_PRIOR = 5.0


@dataclass(frozen=True, eq=False)
class Context:
    """A base model with its catalogue on the events of `records`. Nothing of it changes but what
    `effort` counts.
    """

    load: Model
    catalogue: Catalogue
    records: Records
    kernels: Kernels
    coordinates: FreeSet
    criteria: "Criteria"
    effort: Effort
    prior: float = 0.0  # weight of rows that hold the motor to what machines usually are

    @classmethod
    def from_records(
        cls,
        load: Model,
        catalogue: Catalogue,
        records: Records,
        bounds: Mapping[str, Sequence[float]],
        fixed: Mapping[str, float],
        criteria: "Criteria",
        effort: Effort,
        substeps: int | None = None,
        family: type[Family] = Family,
        *,
        priors: bool = False,
    ) -> "Context":
        """A context for these records; the load is simulated behind the recorder's window, where
        there is one.
        """
        kernels = Kernels(
            family(load.place_behind_recorder(records.window), catalogue),
            records.events,
            bounds,
            fixed,
            substeps,
            priors=priors,
        )
        coordinates = FreeSet.of_effects(kernels.bare, kernels.whole, catalogue, FAULT_PRIOR)
        return cls(load, catalogue, records, kernels, coordinates, criteria, effort)

    def move_to_records(self, records: Records) -> "Context":
        """The same model and catalogue on other records, with the same Runge-Kutta steps and a
        count of its own.
        """
        kernels, criteria, effort = self.kernels, self.criteria, self.effort.anew()
        same = kernels.bounds, kernels.fixed, criteria, effort, kernels.substeps
        priors = kernels.bare.priors
        there = Context.from_records(
            self.load, self.catalogue, records, *same, type(kernels.family), priors=priors
        )
        return there if len(self.coordinates.before) else there.with_measured_power

    @property
    def with_measured_power(self) -> "Context":
        """The same with P0 and Q0 of each event as they were measured before it: they are no part
        of a fit.
        """
        return replace(self, coordinates=replace(self.coordinates, before=np.array([], dtype=int)))

    @property
    def held_to_usual(self) -> "Context":
        """The same for residuals in units of what is left, with the prior of an identification
        where `model.priors` asks for one.
        """
        bare = self.kernels.bare
        if not bare.priors:
            return self
        return replace(self, prior=weigh_prior(self.events, self.drive, bare.space.dimension))

    @property
    def model(self) -> Model:
        """The base model, behind the recorder's window."""
        return self.kernels.family.model

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of all that a fit here depends on beside noise and starts; "" where that is not
        known.
        """
        load, at = self.load, self.coordinates
        parts = (load.motor, load.static, *load.effects, *self.catalogue.effects)
        if not all(map(store.is_installed, parts)):
            return ""
        content = (
            self.kernels.bare.digest(),
            self.kernels.substeps,
            self.criteria,
            at.box.lower,
            at.box.upper,
            at.null,
            at.before,
            at.prior_deviation,
            self.prior,
            sorted(self.kernels.fixed.items()),
        )
        return store.key(store.environment(), repr(parts), self.records.window, *content)

    @property
    def domain(self) -> Domain:
        """The domain that the load's equations are written for: phasors or waves."""
        return domain_of(self.load)

    @property
    def events(self) -> tuple[Event, ...]:
        """The events that are fitted, their voltage smoothed."""
        return self.records.events

    @property
    def problem(self) -> Problem:
        """The problem of everything: base model, all candidates, pushes. It is not simulated."""
        return self.kernels.whole

    @property
    def drive(self) -> Drive:
        """The inputs and measurements (C, N) of all fitted events, one after the other."""
        return self.problem.drive

    @functools.cached_property
    def valid(self) -> np.ndarray:
        """Which samples count, (C, N)."""
        return self.drive.weights > 0

    @property
    def samples(self) -> int:
        """Values that count: of P and Q, or of the currents."""
        return int(np.count_nonzero(self.valid))

    def describe(self, noise: Noise) -> str:
        """Level and color of the noise of what is compared, as a run prints them."""
        labels = noise.describe(self.drive.labels).split(", ")
        return ", ".join(
            part
            for part, there in zip(labels, [*np.any(self.valid, axis=1), True], strict=True)
            if there
        )

    def residuals(self, unit: np.ndarray, names: Sequence[str], beside: str = "") -> np.ndarray:
        """Calculated minus measured (n, C, N) [pu] at coordinates (n, D) where effects but `names`
        are at their null.

        Of what they leave one more effect `beside` them, or the pushes, may be off theirs.
        """
        self.effort.spend(len(unit))
        key = self.kernels.family.key(names, beside)
        return self.kernels.residuals(key, unit)

    def residuals_of(self, unit: np.ndarray, sets: Sequence[Sequence[str]]) -> np.ndarray:
        """As `residuals`, with a set of names for each of the coordinates."""
        of_kernels = self._of_one_kernel([(names, "") for names in sets])
        if len(of_kernels) == 1:
            return self.residuals(unit, sets[0])
        residuals = np.empty((len(unit), self.drive.channels, self.drive.samples))
        for mine in of_kernels:
            residuals[mine] = self.residuals(unit[mine], sets[mine[0]])
        return residuals

    def changes(
        self, unit: np.ndarray, points: np.ndarray, names: Sequence[str], beside: Sequence[str]
    ) -> np.ndarray:
        """What each of the points (n, D) changes (n, C, N) [pu] against coordinates (D,): one
        effect beside the names.

        Both by the same kernel, so that what changes nothing is exactly 0; 0 where a simulation
        diverges, too.
        """
        changes = np.empty((len(points), self.drive.channels, self.drive.samples))
        for mine in self._of_one_kernel([(names, other) for other in beside]):
            both = self.residuals(
                np.concatenate([unit[None], points[mine]]), names, beside[mine[0]]
            )
            changes[mine] = finite(both[1:] - both[0])
        return changes

    def _of_one_kernel(self, sets: Sequence[tuple[Sequence[str], str]]) -> list[list[int]]:
        """Which of the sets share a kernel."""
        lanes: dict[Key, list[int]] = {}
        for lane, (names, beside) in enumerate(sets):
            lanes.setdefault(self.kernels.family.key(names, beside), []).append(lane)
        return list(lanes.values())

    def whiten(self, noise: Noise, residuals: np.ndarray) -> np.ndarray:
        """Residuals (n, C, N) as rows (n, C N) of independent unit variance."""
        return noise.whiten(residuals, self.drive, self.valid)

    def rows(
        self, unit: np.ndarray, noise: Noise, faults: Sequence[int], sets: Sequence[Sequence[str]]
    ) -> np.ndarray:
        """Whitened residuals (n, C N) of coordinates with a set of names each, then the prior of
        the free faults, and that of the motor.
        """
        raw = self.residuals_of(unit, sets)
        white = self.whiten(noise, raw)
        at = self.coordinates
        prior = [(unit[:, k] - at.null[k])[:, None] / at.prior_deviation[k] for k in faults]
        if self.prior:
            bare = self.kernels.bare
            values = bare.space.from_unit(unit[:, at.base])
            prior.append(self.prior * departures(bare, values))
        return np.concatenate([white, *prior], axis=1)

    def linearize(
        self, unit: np.ndarray, noise: Noise, columns: Sequence[int], names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals (C, N) of a fit with the named effects, and rows (1 + k, R): they
        and their differences.

        The rows are whitened: C N of the records, then those of the priors of the faults of the
        measurement.
        """
        at, k = self.coordinates, len(columns)
        points, width = two_sided(unit, columns)
        raw = self.residuals(np.concatenate([unit[None], points]), names)
        white = self.whiten(noise, np.concatenate([raw[:1], slopes(raw[1:], width)]))
        held = [(i, c) for i, c in enumerate(columns) if c in at.prior_deviation]
        prior = np.zeros((1 + k, len(held)))
        for row, (i, c) in enumerate(held):
            prior[1 + i, row] = 1 / at.prior_deviation[c]
            prior[0, row] = (unit[c] - at.null[c]) / at.prior_deviation[c]
        return raw[0], np.concatenate([white, prior], axis=1)

    @property
    def separable_columns(self) -> SeparableColumns:
        """P0 and Q0 of each event where they are free, which act on its own rows only."""
        first = len(self.coordinates.base) if len(self.coordinates.before) else None
        return SeparableColumns.of_power(self.drive, first)
