"""The identification problem: free parameters of a model against recorded events, Eq. (8)."""

import copy
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tractexp.domain import Domain, find_domain
from tractexp.errors import MODEL, UserError, check_range
from tractexp.inference.bounds import check_name, narrow_bounds
from tractexp.inference.loss import REFUSED, Loss
from tractexp.inference.records import check_channels, check_power
from tractexp.inference.steps import Step, choose_steps, count_steps
from tractexp.model.drive import Drive
from tractexp.model.model import Model
from tractexp.model.parts import Effect
from tractexp.noise.quiet import find_quiet_stretches
from tractexp.noise.random_walk import Load
from tractexp.parameter import Box, spread_evenly
from tractexp.record import Event

PROBES = 64  # candidates across the box on which the Runge-Kutta step is judged


class Problem:
    """Free parameters of a model that are fitted to events: what the search loop works on.

    A candidate is a row of free values, one column a parameter, in physical units. Many candidates
    are simulated in one call.

    Attributes
    ----------
    model : Model
        The equations of the load.
    parameters : tuple of Parameter
        All parameters of the model, with the bounds of this problem.
    fixed : {name: value}
        Parameters that are not searched.
    space : Box
        Names and bounds of the d free values.
    defaults, lower, upper : (d,)
        Their defaults and bounds.
    per_event : tuple of names
        Parameters with a value of their own in each event.
    loss : Loss
        How a residual counts in the objective.
    priors : bool
        Whether the motor is held to what machines usually are.
    drive : Drive
        Inputs and measurements of all events, one after the other.
    step : Step
        The Runge-Kutta steps of each event.
    """

    def __init__(
        self,
        model: Model,
        events: Sequence[Event],
        bounds: Mapping[str, Sequence[float]] | None = None,
        fixed: Mapping[str, float] | None = None,
        substeps: int | Sequence[int] | None = None,
        per_event: Sequence[str] = (),
        loss: Loss | None = None,
        *,
        priors: bool = False,
    ):
        """State which parameters of a model are fitted to which events.

        Parameters
        ----------
        model : Model
            The equations of the load.
        events : sequence of Event
            The dips, all of them fitted together.
        bounds : {name: (lower, upper)}
            Bounds in place of the model's own, in each parameter's unit.
        fixed : {name: value}
            Parameters that are held at a value.
        substeps : int or ints
            Runge-Kutta steps per sample, of all or of each event; None: as many as the bounds need.
        per_event : names
            Parameters with a value of their own in each of several events; their columns are called
            `T_m[1]`, `T_m[2]`, ...
        loss : Loss
            How a residual counts; None: least squares.
        priors : bool
            Whether the estimate is held to what the model's motor usually is.

        Raises
        ------
        UserError
            For unknown names, values out of range, an event without load, a channel that the model
            needs and an event lacks, and where no parameter is left free.
        """
        self.model = model
        self.priors = priors
        self.events = self.domain.events(events)
        check_channels(model, self.events)
        check_power(events)
        self.parameters = narrow_bounds(model.parameters, bounds or {})
        self.fixed = {name: float(value) for name, value in (fixed or {}).items()}
        for name in self.fixed:
            check_name(name, {p.name: p for p in self.parameters}, "model.fixed")
            check_range(f"{MODEL.fixed}.{name}", self.fixed[name])
        for name in per_event:
            check_name(name, {p.name: p for p in self.parameters}, "model.per_event")
            if name in self.fixed:
                raise UserError(
                    f"{MODEL.per_event} names {name}, which {MODEL.fixed} fixes; it can be only one"
                    " of them"
                )
        own = set(per_event) if len(self.events) > 1 else set()
        free = [
            replace(p, name=f"{p.name}[{e}]") if e else p
            for p in self.parameters
            if p.name not in self.fixed
            for e in (range(1, len(self.events) + 1) if p.name in own else (0,))
        ]
        if not free:
            why = (
                f"{MODEL.fixed} fixes every parameter"
                if self.fixed
                else f"a {model.title} has no parameters"
            )
            raise UserError(f"{why}; leave at least one free to identify")
        self.space = Box.from_parameters(tuple(free))
        self.defaults = np.array([p.default for p in free])
        self.lower = self.space.lower
        self.upper = self.space.upper
        self.per_event = tuple(name for name in model.names if name in own)
        self.loss = loss or Loss()
        self._rest = np.array([self.fixed.get(name, np.nan) for name in model.names])
        where = {name: k for k, name in enumerate(self.space.names)}
        self._columns = np.array(
            [  # (E, d), of the free values; -1: fixed
                [where.get(n, where.get(f"{n}[{e}]", -1)) for n in model.names]
                for e in range(1, len(self.events) + 1)
            ]
        )
        self.drive = self._driven()
        self._scale = self.loss.scales(self.events, self.drive)
        self.step = (
            self._choose_steps(self.domain.probed)
            if substeps is None
            else Step.from_setting(substeps, len(self.events))
        )

    def with_steps_of(self, share: float) -> "Problem":
        """The problem with as many Runge-Kutta steps as a share of the box needs; the rest is
        stiff.

        Parameters
        ----------
        share : float
            Share of the candidates all over the box, 0 to 1, that the steps suffice for.

        Returns
        -------
        Problem
            This one where its steps suffice for no more than that share; see `steps_at`.
        """
        if share >= self.domain.probed:
            return self
        other = copy.copy(self)
        other.step = self._choose_steps(share)
        return other

    def steps_at(self, values: np.ndarray) -> int:
        """The Runge-Kutta steps per sample that some candidates need.

        Parameters
        ----------
        values : (n, d)
            Free values.

        Returns
        -------
        int
            The largest number of all events.
        """
        return count_steps(self.model, self.drive, self.events, self.candidates(values))

    def _choose_steps(self, share: float) -> Step:
        """The fewest Runge-Kutta steps that suffice for a share of candidates all over the box."""
        probes = self.candidates(self.space.from_unit(spread_evenly(PROBES, self.space.dimension)))
        return choose_steps(self.model, self.drive, self.events, probes, share)

    def digest(self) -> str:
        """The SHA-256 of a problem, as 64 hexadecimal digits: equal problems have the same.

        It covers the equations, the records, the bounds, the steps and what is known of the
        parameters.
        """
        drive = self.drive
        free = self.space.names, sorted(self.fixed.items()), self.per_event, self.priors
        content = self.model.source, [repr(effect) for effect in self.model.measurements], free
        sha = hashlib.sha256(repr(content).encode())
        arrays = (
            drive.inputs,
            drive.measurements,
            drive.weights,
            drive.first,
            drive.event,
            drive.before,
        )
        arrays += tuple(window for window in drive.windows if window is not None)
        for array in (*arrays, self.lower, self.upper, self.step.substeps):
            sha.update(np.ascontiguousarray(array).tobytes())
        return sha.hexdigest()

    def driven_by(self, events: Sequence[Event]) -> "Problem":
        """The problem with other events of the same lengths, such as those with a smoothed voltage.

        Parameters
        ----------
        events : sequence of Event
            As many as this problem has, each with as many samples.

        Returns
        -------
        Problem
            Its Runge-Kutta steps and scales are those of this one.
        """
        other = copy.copy(self)
        other.events = tuple(events)
        other.drive = other._driven()
        return other

    def vary(self, model: Model, bounds: Mapping[str, Sequence[float]]) -> "Problem":
        """Another model or other bounds on the same events, with the same steps and loss.

        Parameters
        ----------
        model : Model
            What it has of the fixed parameters, and of those of each event, stays so.
        bounds : {name: (lower, upper)}
            In place of the model's own.

        Returns
        -------
        Problem

        Raises
        ------
        UserError
            As of `Problem`.
        """
        fixed = {name: value for name, value in self.fixed.items() if name in model.names}
        per_event = [name for name in self.per_event if name in model.names]
        substeps = int(self.step.substeps.max())
        return Problem(model, self.events, bounds, fixed, substeps, per_event, self.loss)

    def extend(self, effects: Sequence[Effect], events: Sequence[Event]) -> "Problem":
        """The problem with effects of the size of their `theory`, which nothing frees.

        Parameters
        ----------
        effects : sequence of Effect
            That the model has not.
        events : sequence of Event
            As of `driven_by`, with the channels that the effects read.

        Returns
        -------
        Problem
            Its free parameters and Runge-Kutta steps are those of this one.
        """
        model, bounds = self.model.extend(effects), {p.name: p.bounds for p in self.parameters}
        sizes = {name: size for effect in effects for name, size in effect.theory.items()}
        substeps = self.step.substeps.tolist()
        fixed, priors = self.fixed | sizes, self.priors
        per_event = list(self.per_event)
        return Problem(model, events, bounds, fixed, substeps, per_event, self.loss, priors=priors)

    @property
    def domain(self) -> Domain:
        """The domain in which model and records are compared: phasors or waveforms."""
        return find_domain(self.model)

    @property
    def steady(self) -> list[slice]:
        """The samples of the drive whose means are P0 and Q0, one slice an event; [] where those
        are not compared.
        """
        return self.domain.steady(self.events, self.drive)

    @property
    def quiet(self) -> list[slice]:
        """The stretches of the drive in which little happens: what is left there is noise."""
        return find_quiet_stretches(self.events, self.drive)

    @property
    def power(self) -> Load:
        """The measured power of the load relative to its power before each event."""
        return Load.from_powers(self.drive.measurements, self.drive.before, self.drive.first)

    def _driven(self) -> Drive:
        """The events end to end, squared errors weighed as the loss says."""
        weights = self.loss.weight_P, self.loss.weight_Q
        return Drive.from_events(
            [self.domain.excitation(e, self.model, weights) for e in self.events]
        )

    def by_event(self, values: np.ndarray) -> np.ndarray:
        """All parameters of the model in each event.

        Parameters
        ----------
        values : (n, d)
            Free values of n candidates.

        Returns
        -------
        (E, n, p) array
            The p parameters of the model in the order of its names, fixed ones included.
        """
        values = np.atleast_2d(values)
        return np.where(
            self._columns[:, None] < 0, self._rest, np.moveaxis(values[:, self._columns], 1, 0)
        )

    def full(self, values: np.ndarray) -> np.ndarray:
        """All parameters of the model, one row a candidate.

        Parameters
        ----------
        values : (n, d)
            Free values of n candidates.

        Returns
        -------
        (n, p) array
            A parameter that differs from event to event is told by its mean.
        """
        return self.by_event(values).mean(axis=0) if self.per_event else self.by_event(values)[0]

    def candidates(self, values: np.ndarray) -> np.ndarray:
        """The parameters of the model as its simulation takes them.

        Parameters
        ----------
        values : (n, d)
            Free values of n candidates.

        Returns
        -------
        (n, p) or (E, n, p) array
            The latter where parameters differ from event to event.
        """
        return self.by_event(values) if self.per_event else self.full(values)

    def objective(self, values: np.ndarray) -> np.ndarray:
        """The objective of Eq. (8): mean squared error of P plus that of Q, over all events.

            f = 1/N sum_k (P_k - P_calculated,k)² + (Q_k - Q_calculated,k)²

        Of waveforms it is the mean squared error of the phase currents. Another loss or other
        weights take the place of the squares.

        Parameters
        ----------
        values : (n, d)
            Free values of n candidates.

        Returns
        -------
        (n,) array [pu²]
            A candidate without a steady state before the dip gets `REFUSED` times one plus how far
            it misses it, one that diverges gets `REFUSED`: it is never nan.
        """
        if self.loss.quadratic:
            errors = self.model.errors(self.drive, self.candidates(values), self.step.substeps)
            f = errors.sums.sum(axis=(0, 1)) / self.drive.samples
            miss = errors.miss
        else:
            rows, misses = self._losses(values)
            f = rows.sum(axis=(1, 2)) / self.drive.samples
            miss = misses.sum(axis=0)
        f = np.where(f < REFUSED, f, REFUSED)
        return np.where(miss > 0, REFUSED * (1 + miss), f)

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """The residuals whose squares sum to the objective.

        Parameters
        ----------
        values : (n, d)
            Free values of n candidates.

        Returns
        -------
        (n, C N) array [pu]
            Calculated minus measured over the root of the number of samples, one channel after the
            other; nan for a candidate without a steady state. With a robust loss, the roots of the
            losses.
        """
        drive = self.drive
        if self.loss.quadratic:
            errors, miss = self._errors(values)
            with np.errstate(invalid="ignore"):  # what diverged, in a gap
                rows = errors * np.sqrt(drive.weights / drive.samples)
        else:
            losses, miss = self._losses(values)
            rows = np.sqrt(losses / drive.samples)
        rows[miss.max(axis=0) > 0] = np.nan
        return rows.reshape(len(rows), -1)

    def _errors(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Calculated minus measured (n, C, N) [pu], and how far each event misses a steady state
        (E, n).
        """
        response = self.model.simulate(self.drive, self.candidates(values), self.step.substeps)
        return response.by_candidate - self.drive.measurements, response.miss

    def _losses(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted losses (n, C, N) [pu²], and how far each event misses a steady state (E, n)."""
        errors, miss = self._errors(values)
        with np.errstate(invalid="ignore"):  # what diverged, in a gap
            return self.drive.weights * self._scale**2 * self.loss.rho(
                (errors / self._scale) ** 2
            ), miss
