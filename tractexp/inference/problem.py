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
from tractexp.parameter import Box, Parameter, even
from tractexp.record import Event
from tractexp.record.own_base import SMALLEST_BASE

PROBES = 64  # candidates across the box on which the Runge-Kutta step is judged


def narrow_bounds(
    parameters: Sequence[Parameter], bounds: Mapping[str, Sequence[float]]
) -> tuple[Parameter, ...]:
    """Parameters with some bounds replaced. Raises `UserError` for an unknown name or reversed
    bounds.
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
    """Raise `UserError` where a part of the model reads a channel that an event does not have, and
    that drives it.
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
    """Raise `UserError` for an event in which nothing draws power: every model fits it, and none is
    told.
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
    """Runge-Kutta steps per sample, one number per event, and the error they leave [pu] (nan where
    given by hand).
    """

    substeps: np.ndarray
    error: np.ndarray

    def describe(self, events: Sequence[Event]) -> str:
        """The sentence a run prints."""
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
    """Free parameters (columns of `values`) of a model, fitted to events. What the search loop
    works on.
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
        """Raises `UserError` for unknown names and values out of range; `substeps` None means
        automatic.

        Parameters in `per_event` have a value of their own in each of several events; their columns
        are called `T_m[1]`, `T_m[2]`, ... `loss` None means least squares. With `priors` the
        estimate is held to what the model's motor usually is.
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
        """The same with as many Runge-Kutta steps as this share of the box needs;
        see `steps_at`.
        """
        if share >= self.domain.probed:
            return self
        other = copy.copy(self)
        other.step = self._automatic(share)
        return other

    def steps_at(self, values: np.ndarray) -> int:
        """Runge-Kutta steps per sample that free values (n, free) need."""
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
        """SHA-256 of the equations, the records and what is known of the parameters: of equal
        problems the same.
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
        """The same problem with other voltages of the same lengths; Runge-Kutta steps and scales
        stay.
        """
        other = copy.copy(self)
        other.events = tuple(events)
        other.drive = other._driven()
        return other

    @property
    def domain(self) -> Domain:
        """What the model is compared with."""
        return domain_of(self.model)

    @property
    def steady(self) -> list[slice]:
        """The samples of the drive whose means are P0 and Q0 of each event; [] where those are not
        compared.
        """
        return self.domain.steady(self.events, self.drive)

    @property
    def quiet(self) -> list[slice]:
        """The samples of the drive in which little happens."""
        return quiet_stretches(self.events, self.drive)

    @property
    def power(self) -> Load:
        """What the load takes, over what it took before each event."""
        return Load.from_powers(self.drive.measurements, self.drive.before, self.drive.first)

    def _driven(self) -> Drive:
        """The events end to end, squared errors weighed as the loss says."""
        weights = self.loss.weight_P, self.loss.weight_Q
        return Drive.from_events(
            [self.domain.excitation(e, self.model, weights) for e in self.events]
        )

    def by_event(self, values: np.ndarray) -> np.ndarray:
        """Free values (n, free) -> all parameters of the model in each event (E, n, d)."""
        values = np.atleast_2d(values)
        return np.where(
            self._columns[:, None] < 0, self._rest, np.moveaxis(values[:, self._columns], 1, 0)
        )

    def full(self, values: np.ndarray) -> np.ndarray:
        """Free values (n, free) -> all parameters of the model (n, d), a mean where they differ by
        event.
        """
        return self.by_event(values).mean(axis=0) if self.per_event else self.by_event(values)[0]

    def candidates(self, values: np.ndarray) -> np.ndarray:
        """Free values (n, free) as the model simulates them: (n, d), or (E, n, d) where they differ
        by event.
        """
        return self.by_event(values) if self.per_event else self.full(values)

    def objective(self, values: np.ndarray) -> np.ndarray:
        """Eq. (8) of free values (n, free): mean squared error of P plus that of Q, over all events
        [pu²].

        Of waveforms, the mean squared error of the phase currents.

        With another loss or other weights, the mean of those.

        Candidates without a steady state get `REFUSED` times one plus how far they miss it; those
        that diverge get `REFUSED`.
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
        """Calculated minus measured (n, C N), channel by channel, so scaled that their squares sum
        to the objective.
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
        """Weighted losses (n, C, N) [pu²], and the misses as above."""
        errors, miss = self._errors(values)
        with np.errstate(invalid="ignore"):  # what diverged, in a gap
            return self.drive.weights * self._scale**2 * self.loss.rho(
                (errors / self._scale) ** 2
            ), miss

    def _find_lasting(self, candidates: np.ndarray) -> np.ndarray:
        """Which candidates (n, d) do not grow beyond bounds at any step, as circuits with a
        negative reactance may.
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
        """As many steps as that share of candidates all over the box needs."""
        fine, probes = (
            self.domain.finest,
            self.candidates(self.space.from_unit(even(PROBES, self.space.dimension))),
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
        if self.model.integration == CLASSICAL and not (error <= fine).all():
            worst = int(np.argmax(error))
            raise UserError(
                f"{self.events[worst].record.name}: {MOST_SUBSTEPS} Runge-Kutta steps per sample of"
                f" {1e3 * self.events[worst].record.step:g} ms leave an error of {error[worst]:.1e}"
                " pu somewhere in"
                " the bounds; raise the lower bound of the model's time constants"
                f" ({MODEL.bounds}),"
                f" or set {MODEL.substeps}"
            )
        return Step(chosen, error)
