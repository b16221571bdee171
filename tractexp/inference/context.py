"""What every step of an investigation works with: records, coordinates and the kernels that
simulate them.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.cache import store
from tractexp.domain import Domain, Playback, find_domain
from tractexp.inference.catalogue import Catalogue
from tractexp.inference.criteria import Criteria
from tractexp.inference.differences import divide_differences, replace_diverged, step_both_ways
from tractexp.inference.effort import Effort
from tractexp.inference.free_set import FreeSet
from tractexp.inference.kernels import Family, Kernels, Key
from tractexp.inference.prior import compute_prior_rows, weigh_prior
from tractexp.inference.problem import Problem
from tractexp.inference.records import Records
from tractexp.inference.separable import SeparableColumns
from tractexp.model.drive import Drive
from tractexp.model.model import Model
from tractexp.noise import Noise
from tractexp.parameter import find_unlike
from tractexp.record import Event

# Standard deviation of a fault of the measurement before anything is seen, in its relevant sizes:
# clocks, windows and drifts beyond that are seen before a record is used.
FAULT_PRIOR = 5.0


@dataclass(frozen=True, eq=False)
class Context:
    """A base model with a catalogue of effects on the events of an investigation.

    Nothing of it changes but what `effort` counts.

    Attributes
    ----------
    load : Model
        The base model.
    catalogue : Catalogue
        The effects that can be tested.
    records : Records
        The events, as recorded and smoothed.
    kernels : Kernels
        What simulates the model with any set of effects.
    coordinates : FreeSet
        The free numbers of all fits, (D,).
    criteria : Criteria
        The thresholds of the decisions.
    effort : Effort
        The count of simulations.
    prior : float
        Weight of the rows that hold the motor to what machines usually are; 0 is without.
    """

    load: Model
    catalogue: Catalogue
    records: Records
    kernels: Kernels
    coordinates: FreeSet
    criteria: Criteria
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
        criteria: Criteria,
        effort: Effort,
        substeps: int | None = None,
        family: type[Family] = Family,
        *,
        priors: bool = False,
    ) -> "Context":
        """The context of some records; the load is simulated behind the recorder's window, where
        there is one.

        Parameters
        ----------
        load : Model
            The base model.
        catalogue : Catalogue
            The effects that can be tested.
        records : Records
            The events.
        bounds : {name: (lower, upper)}
            Of the base model's parameters, in their units.
        fixed : {name: value}
            Parameters that are held.
        criteria : Criteria
            The thresholds of the decisions.
        effort : Effort
            What counts the simulations.
        substeps : int
            Runge-Kutta steps per sample; None: as many as are needed.
        family : type
            The class that builds the model of a set of effects.
        priors : bool
            Whether there is a prior on the motor.

        Returns
        -------
        Context
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
        """The same model and catalogue on other records, with the same Runge-Kutta steps.

        Its count of simulations is a part of this one's; P0 and Q0 are free where they are here.
        """
        there = self.rebuild(self.catalogue, records, self.effort.anew(), type(self.kernels.family))
        return there if len(self.coordinates.before) else there.with_measured_power

    def move_to_events(self, events: Sequence[Event]) -> "Context":
        """The same on other events of this recorder, as of `move_to_records`."""
        return self.move_to_records(Records.from_events(events, self.records.window))

    def rebuild(
        self, catalogue: Catalogue, records: Records, effort: Effort, family: type[Family]
    ) -> "Context":
        """The same base model, bounds, steps and thresholds with another catalogue or records."""
        kernels = self.kernels
        same = kernels.bounds, kernels.fixed, self.criteria, effort, kernels.substeps, family
        priors = kernels.bare.priors
        return Context.from_records(
            self.load,
            catalogue,
            records,
            *same,
            priors=priors,
        )

    @property
    def with_measured_power(self) -> "Context":
        """The context in which P0 and Q0 of each event are as measured before it, and no part of a
        fit.
        """
        return replace(self, coordinates=replace(self.coordinates, before=np.array([], dtype=int)))

    @property
    def held_to_usual(self) -> "Context":
        """The context with the prior on the motor, where `model.priors` asks for one.

        Its rows are for residuals in units of what is left, as in an identification.
        """
        bare = self.kernels.bare
        if not bare.priors:
            return self
        return replace(self, prior=weigh_prior(self.events, self.drive, bare.space.dimension))

    @property
    def model(self) -> Model:
        """The base model, behind the recorder's window."""
        return self.kernels.family.model

    @property
    def window(self) -> float | str | None:
        """The recorder's window that the model is seen through, as `model.window` names it."""
        found = self.records.window
        return self.load.window if found is None else found.setting

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of all that a fit here depends on beside noise and starts; "" where that is not
        known.
        """
        load = self.load
        at = self.coordinates
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
        return store.compute_key(
            store.describe_environment(), repr(parts), self.records.window, *content
        )

    @property
    def domain(self) -> Domain:
        """The domain that the load's equations are written for: phasors or waves."""
        return find_domain(self.load)

    @property
    def events(self) -> tuple[Event, ...]:
        """The events that are fitted, their voltage smoothed."""
        return self.records.events

    @property
    def problem(self) -> Problem:
        """The problem of everything: base model, all candidates, injected perturbations. It is
        not simulated.
        """
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
        """The number of values that count: of P and Q, or of the currents."""
        return int(np.count_nonzero(self.valid))

    def describe(self, noise: Noise) -> str:
        """The level and color of the noise of each channel that is compared, as a run prints
        them.
        """
        labels = noise.describe(self.drive.labels).split(", ")
        return ", ".join(
            part
            for part, there in zip(labels, [*np.any(self.valid, axis=1), True], strict=True)
            if there
        )

    def residuals(self, unit: np.ndarray, names: Sequence[str], beside: str = "") -> np.ndarray:
        """The residuals at n points with one set of effects.

        Parameters
        ----------
        unit : (n, D)
            Coordinates; effects that are not named have to be at their null.
        names : names
            The effects of the fit.
        beside : str
            One more effect, or the injected perturbations, that may be off its null; "": none.

        Returns
        -------
        (n, C, N) array [pu]
            Calculated minus measured.
        """
        self.effort.spend(len(unit))
        key = self.kernels.family.key(names, beside)
        return self.kernels.residuals(key, unit)

    def residual(self, unit: np.ndarray, names: Sequence[str] = ()) -> np.ndarray:
        """The residual (C, N) [pu] at coordinates (D,), as of `residuals`."""
        return self.residuals(unit[None], names)[0]

    def calculate(self, unit: np.ndarray, names: Sequence[str] = ()) -> np.ndarray:
        """What is compared of the events (C, N) [pu], as calculated at coordinates (D,)."""
        return self.residual(unit, names) + self.drive.measurements

    def cut_playbacks(self, calculated: np.ndarray) -> list[Playback]:
        """Each event beside what is calculated of it, of all events end to end (C, N) [pu]."""
        of_events = zip(self.events, self.drive.parts, strict=True)
        return [self.domain.comparison(event, calculated[:, part]) for event, part in of_events]

    def residuals_of(self, unit: np.ndarray, sets: Sequence[Sequence[str]]) -> np.ndarray:
        """The residuals at n points, each with a set of effects of its own.

        Parameters
        ----------
        unit : (n, D)
            Coordinates.
        sets : n times names
            The effects of each point.

        Returns
        -------
        (n, C, N) array [pu]
            Calculated minus measured.
        """
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
        """The changes of the residuals by one effect beside those of a fit.

        Both sides are simulated by the same kernel, so that what changes nothing is exactly 0.

        Parameters
        ----------
        unit : (D,)
            Coordinates of the fit.
        points : (n, D)
            The fit with one effect each off its null.
        names : names
            The effects of the fit.
        beside : n names
            The effect that differs at each point.

        Returns
        -------
        (n, C, N) array [pu]
            0 where a simulation diverges, too.
        """
        changes = np.empty((len(points), self.drive.channels, self.drive.samples))
        for mine in self._of_one_kernel([(names, other) for other in beside]):
            both = self.residuals(
                np.concatenate([unit[None], points[mine]]), names, beside[mine[0]]
            )
            changes[mine] = replace_diverged(both[1:] - both[0])
        return changes

    def _of_one_kernel(self, sets: Sequence[tuple[Sequence[str], str]]) -> list[list[int]]:
        """The positions of the sets (names, effect beside them), in groups that share a kernel."""
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
        """The rows whose sum of squares is the deviance.

        Parameters
        ----------
        unit : (n, D)
            Coordinates.
        noise : Noise
            That of the records.
        faults : k columns
            The coordinates that have a prior.
        sets : n times names
            The effects of each point.

        Returns
        -------
        (n, C N + k + m) array
            Whitened residuals, then the departures from the priors in standard deviations, then the
            m rows of the motor's prior, where there is one.
        """
        # what is frozen in a lane moves nothing, and moves clipped to a bound are alike
        own = list(dict.fromkeys(map(tuple, sets)))
        of_set = [own.index(tuple(names)) for names in sets]
        chosen, copies = find_unlike(np.column_stack([unit, of_set]))
        raw = self.residuals_of(unit[chosen], [sets[k] for k in map(int, chosen)])
        white = self.whiten(noise, raw)
        white = white if len(chosen) == len(unit) else white[copies]
        at = self.coordinates
        bare = self.kernels.bare
        motor = compute_prior_rows(bare, bare.space.from_unit(unit[:, at.base]), self.prior)
        return np.concatenate([white, at.measure_departures(unit, faults), motor], axis=1)

    def differentiate(
        self, unit: np.ndarray, columns: Sequence[int], names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The residuals (C, N) [pu] of a fit with these effects at coordinates (D,), and their
        derivatives (k, C, N) by k columns, per range.
        """
        points, width = step_both_ways(unit, columns)
        raw = self.residuals(np.concatenate([unit[None], points]), names)
        return raw[0], divide_differences(raw[1:], width)

    def linearize(
        self, unit: np.ndarray, noise: Noise, columns: Sequence[int], names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The residuals of a fit and their derivatives.

        Parameters
        ----------
        unit : (D,)
            Coordinates of the fit.
        noise : Noise
            That of the records.
        columns : k columns
            The coordinates to differentiate by.
        names : names
            The effects of the fit.

        Returns
        -------
        (C, N) array [pu]
            The residuals.
        (1 + k, R) array
            Whitened: the residuals, then their derivatives per range. The first C N columns are
            those of the records, then those of the priors.
        """
        at = self.coordinates
        k = len(columns)
        residual, derivatives = self.differentiate(unit, columns, names)
        white = self.whiten(noise, np.concatenate([residual[None], derivatives]))
        held = [(i, c) for i, c in enumerate(columns) if c in at.prior_deviation]
        prior = np.zeros((1 + k, len(held)))
        prior[0] = at.measure_departures(unit[None], [c for _, c in held])[0]
        for row, (i, c) in enumerate(held):
            prior[1 + i, row] = 1 / at.prior_deviation[c]
        return residual, np.concatenate([white, prior], axis=1)

    @property
    def separable_columns(self) -> SeparableColumns:
        """P0 and Q0 of each event, where they are free, as separable columns: they act on its own
        residuals only.
        """
        first = len(self.coordinates.base) if len(self.coordinates.before) else None
        return SeparableColumns.of_power(self.drive, first)
