"""The identification problem: free parameters of a model against recorded events, Eq. (8)."""

import copy
import hashlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.domain import Domain, domain_of
from tractexp.errors import MODEL, UserError, among, check_range, setting
from tractexp.inference.loss import REFUSED, Loss
from tractexp.model.drive import Drive
from tractexp.model.model import CLASSICAL, MOST_SUBSTEPS, Model
from tractexp.model.parts import COMPARED, Effect
from tractexp.noise.quiet import quiet_stretches
from tractexp.noise.random_walk import Load
from tractexp.parameter import Box, Parameter, spread_evenly
from tractexp.record import Event
from tractexp.record.own_base import SMALLEST_BASE

PROBES = 64  # candidates across the box on which the Runge-Kutta step is judged
# share of them that must be calculated where a model has effects: behind an impedance some loads
# collapse, which no number of steps calculates
LEAST_CALCULATED_SHARE = 0.9


def narrow_bounds(
    parameters: Sequence[Parameter], bounds: Mapping[str, Sequence[float]]
) -> tuple[Parameter, ...]:
    """The parameters with some of their bounds replaced.

    Parameters
    ----------
    parameters : sequence of Parameter
        Those of a model.
    bounds : {name: (lower, upper)}
        New bounds, in the parameter's own unit; parameters that are not named keep theirs.

    Returns
    -------
    tuple of Parameter
        In the order given. A default outside the new bounds moves to the nearer of them.

    Raises
    ------
    UserError
        For a name that no parameter has, for what is not a pair, and for reversed bounds.

    Examples
    --------
    >>> inertia = Parameter(1.0, (0.1, 4.0), "s", "inertia constant", "an example", name="H")
    >>> (narrow,) = narrow_bounds([inertia], {"H": (2.0, 3.0)})
    >>> narrow.bounds, narrow.default
    ((2.0, 3.0), 2.0)
    """
    by_name = {p.name: p for p in parameters}
    for name, pair in bounds.items():
        _check_name(name, by_name, "model.bounds")
        if len(pair) != 2:
            raise UserError(
                f"{MODEL.bounds}.{name}={list(pair)} must be two numbers, [lower, upper]"
            )
        low, high = map(float, pair)
        old = by_name[name]
        inside = min(max(old.default, low), high) if low < high else old.default
        by_name[name] = replace(old, default=inside, bounds=(low, high), physical=None)
        by_name[name].check(f"{MODEL.bounds}.{name}")
    return tuple(by_name.values())


def _check_name(name: str, by_name: Mapping[str, object], where: str) -> None:
    """Raise `UserError` for a parameter that the model lacks; `where` is the setting that names
    it.
    """
    if name not in by_name:
        lack = f"this model has no parameter '{name}'{among(name, by_name, 'Parameters')}"
        raise UserError(f"{setting(where)}.{name}: {lack}")


def _check_channels(model: Model, events: Sequence[Event]) -> None:
    """Raise `UserError` where a part of the model is driven by a channel that an event does not
    have.
    """
    for (channel, part), event in itertools.product(model.reads.items(), events):
        if channel in event.channels or channel in COMPARED:
            continue
        if isinstance(part, Effect):
            what, mend = f"effect '{part.name}'", f"leave the effect out of {MODEL.effects}"
        else:
            what, mend = f"{part.group} '{part.name}'", f"choose another {part.group}"
        raise UserError(
            f"the {what} reads {channel}, which {event.record.where} does not have; record"
            f" {channel}, or {mend}"
        )


def _check_power(events: Sequence[Event]) -> None:
    """Raise `UserError` for an event in which nothing draws power: every model fits it, so that it
    tells none from another.
    """
    for event in events:
        drawn = float(np.nanmax(np.hypot(event.record.P, event.record.Q)))
        if not drawn > SMALLEST_BASE:
            raise UserError(
                f"{event.record.where}: P and Q reach {drawn:.3g} pu at most: there is no load in"
                " this record; "
                "give one of a feeder that draws power"
            )


@dataclass(frozen=True)
class Step:
    """The Runge-Kutta steps of a simulation.

    Attributes
    ----------
    substeps : (E,) ints
        Steps per sample of each event.
    error : (E,) [pu]
        The largest error that these steps leave; nan where the number was given by hand.
    """

    substeps: np.ndarray
    error: np.ndarray

    def describe(self, events: Sequence[Event]) -> str:
        """The sentence that a run prints: the steps, their lengths [ms] and the error they leave
        [pu].
        """
        sizes = [1e3 * e.record.step / n for e, n in zip(events, self.substeps, strict=True)]
        text = ", ".join(
            f"{n} of {size:g} ms"
            for n, size in dict(zip(self.substeps.tolist(), sizes, strict=True)).items()
        )
        worst = float(np.max(self.error))
        error = (
            "with some values in the bounds it diverges"
            if np.isinf(worst)
            else f"largest error {worst:.1e} pu"
        )
        return f"{text} per sample ({'given' if np.isnan(worst) else error})"


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

    model: Model
    parameters: tuple[Parameter, ...]
    fixed: dict[str, float]
    space: Box
    defaults: np.ndarray  # (d,)
    lower: np.ndarray
    upper: np.ndarray
    per_event: tuple[str, ...]
    loss: Loss
    priors: bool
    drive: Drive
    step: Step

    def __init__(
        self,
        model: Model,
        events: Sequence[Event],
        bounds: Mapping[str, Sequence[float]] | None = None,
        fixed: Mapping[str, float] | None = None,
        substeps: int | None = None,
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
        substeps : int
            Runge-Kutta steps per sample; None: as many as the bounds need.
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
        self.model, self.priors = model, priors
        self.events = self.domain.events(events)
        _check_channels(model, self.events)
        _check_power(events)
        self.parameters = narrow_bounds(model.parameters, bounds or {})
        self.fixed = {name: float(value) for name, value in (fixed or {}).items()}
        for name in self.fixed:
            _check_name(name, {p.name: p for p in self.parameters}, "model.fixed")
            check_range(f"{MODEL.fixed}.{name}", self.fixed[name])
        for name in per_event:
            _check_name(name, {p.name: p for p in self.parameters}, "model.per_event")
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
        self.space, self.defaults = (
            Box.from_parameters(tuple(free)),
            np.array([p.default for p in free]),
        )
        self.lower, self.upper = self.space.lower, self.space.upper
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
        self.step = self._step(substeps)

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
        other.step = self._automatic(share)
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
        candidates = self.candidates(values)
        return int(
            self.model.substeps(self.drive, candidates, self.domain.finest, until=self._until)[
                0
            ].max()
        )

    @property
    def _until(self) -> list[float]:
        """Seconds of each event, from its first sample on, in which the step is judged."""
        ends = [e.record.t[min(e.end, e.record.samples - 1)] - e.record.t[0] for e in self.events]
        return [end + self.domain.aftermath for end in ends]

    def digest(self) -> str:
        """The SHA-256 of a problem, as 64 hexadecimal digits: equal problems have the same.

        It covers the equations, the records, the bounds, the steps and what is known of the
        parameters.
        """
        drive, free = (
            self.drive,
            (self.space.names, sorted(self.fixed.items()), self.per_event, self.priors),
        )
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
        return Problem(
            model,
            self.events,
            bounds,
            fixed,
            substeps,
            per_event,
            self.loss,
        )

    @property
    def domain(self) -> Domain:
        """The domain in which model and records are compared: phasors or waveforms."""
        return domain_of(self.model)

    @property
    def steady(self) -> list[slice]:
        """The samples of the drive whose means are P0 and Q0, one slice an event; [] where those
        are not compared.
        """
        return self.domain.steady(self.events, self.drive)

    @property
    def quiet(self) -> list[slice]:
        """The stretches of the drive in which little happens: what is left there is noise."""
        return quiet_stretches(self.events, self.drive)

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
            f, miss = errors.sums.sum(axis=(0, 1)) / self.drive.samples, errors.miss
        else:
            rows, misses = self._losses(values)
            f, miss = rows.sum(axis=(1, 2)) / self.drive.samples, misses.sum(axis=0)
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

    def _find_lasting(self, candidates: np.ndarray) -> np.ndarray:
        """Which candidates (n, d) stay finite at the finest step, (n,): circuits with a negative
        reactance grow beyond all bounds at any.
        """
        finest = np.full(len(self.events), MOST_SUBSTEPS)
        outputs = self.model.simulate(self.drive, candidates, finest).outputs
        return np.all(np.isfinite(outputs), axis=(0, 2))

    def _step(self, substeps: int | None) -> Step:
        """Substeps per sample of each event (E,), and the errors (E,) that a choice of them was
        made by; of given ones nan.

        Raises `UserError` for a number out of range.
        """
        if substeps is not None:
            if not 1 <= substeps <= MOST_SUBSTEPS:
                raise UserError(
                    f"{MODEL.substeps}={substeps} is out of range: it must be 1 to {MOST_SUBSTEPS}"
                )
            given = np.full(len(self.events), substeps)
            return Step(given, np.full(len(self.events), np.nan))
        return self._automatic(self.domain.probed)

    def _automatic(self, share: float) -> Step:
        """The fewest steps that suffice for a share of `PROBES` candidates all over the box.

        Raises `UserError` where the finest step that is allowed leaves too large an error.
        """
        fine, probes = (
            self.domain.finest,
            self.candidates(self.space.from_unit(spread_evenly(PROBES, self.space.dimension))),
        )
        chosen, error = self.model.substeps(self.drive, probes, fine, share, self._until)
        # Stiff circuits of the box may diverge, and are refused.
        if (
            self.domain.stiff
            and np.isinf(error).any()
            and (lasting := self._find_lasting(probes)).any()
        ):
            chosen, error = self.model.substeps(
                self.drive, probes[lasting], fine, share, self._until
            )
        if self.model.effects and share > LEAST_CALCULATED_SHARE and not (error <= fine).all():
            chosen, error = self.model.substeps(
                self.drive, probes, fine, LEAST_CALCULATED_SHARE, self._until
            )
        if self.model.integration == CLASSICAL and not (error <= fine).all():
            worst = int(np.argmax(error))
            raise UserError(
                f"{self.events[worst].record.name}: {MOST_SUBSTEPS} Runge-Kutta steps per sample of"
                f" {1e3 * self.events[worst].record.step:g} ms leave an error of {error[worst]:.1e}"
                " pu somewhere in"
                " the bounds; raise the lower bound of the model's time constants"
                f" ({MODEL.bounds}),"
                f" or set {MODEL.substeps}; what jumps within a sample in an equation of yours"
                " belongs in a memory"
            )
        return Step(chosen, error)
