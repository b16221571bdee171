"""The identification problem: free parameters of a model against recorded events, Eq. (8)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.errors import UserError, among
from tractexp.identify.search import REFUSED
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import MOST_SUBSTEPS, Model
from tractexp.parameter import Parameter, Space
from tractexp.record import Event

PROBES = 64  # candidates across the box on which the Runge-Kutta step is judged
FINE = 5e-6  # pu, largest error of the automatic step on those candidates; noise of records starts near 1e-4


def excitation(event: Event) -> Excitation:
    """What drives the model through a recorded event. A recorded frequency sets the synchronous speed."""
    record, nominal = event.record, 2 * np.pi * event.record.base.frequency
    return Excitation(
        step=record.step,
        U=record.U,
        P=record.P,
        Q=record.Q,
        U0=event.U0,
        P0=event.P0,
        Q0=event.Q0,
        omega_s=None if record.f is None else 2 * np.pi * record.f - nominal,
        omega_s0=0.0 if record.f is None else 2 * np.pi * event.f0 - nominal,
        omega_n=nominal,
        U2=record.U2,
        U20=float("nan") if record.U2 is None else float(record.U2[event.steady].mean()),
    )


def narrowed(parameters: Sequence[Parameter], bounds: Mapping[str, Sequence[float]]) -> tuple[Parameter, ...]:
    """Parameters with some bounds replaced. Raises `UserError` for an unknown name or reversed bounds."""
    known = {p.name: p for p in parameters}
    for name, pair in bounds.items():
        _known(name, known, "model.bounds")
        if len(pair) != 2:
            raise UserError(f"model.bounds.{name}={list(pair)} must be two numbers, [lower, upper]")
        low, high = map(float, pair)
        old = known[name]
        inside = min(max(old.default, low), high) if low < high else old.default
        known[name] = Parameter(inside, (low, high), old.unit, old.about, old.source, old.symbol, old.null, name)
        known[name].check(f"model.bounds.{name}")
    return tuple(known.values())


def _known(name: str, known: Mapping[str, object], where: str) -> None:
    if name not in known:
        raise UserError(f"{where}.{name}: this model has no parameter '{name}'{among(name, known, 'Parameters')}")


@dataclass(frozen=True)
class Step:
    """Runge-Kutta steps per sample, one number per event, and the error they leave [pu] (nan where given by hand)."""

    substeps: np.ndarray
    error: np.ndarray

    def describe(self, events: Sequence[Event]) -> str:
        """The sentence a run prints."""
        sizes = [1e3 * e.record.step / n for e, n in zip(events, self.substeps, strict=True)]
        text = ", ".join(
            f"{n} of {size:g} ms" for n, size in dict(zip(self.substeps.tolist(), sizes, strict=True)).items()
        )
        worst = float(np.max(self.error))
        return f"{text} per sample" + (" (given)" if np.isnan(worst) else f" (largest error {worst:.1e} pu)")


class Problem:
    """Free parameters (columns of `values`) of a model, fitted to events. What the search loop works on."""

    def __init__(
        self,
        model: Model,
        events: Sequence[Event],
        bounds: Mapping[str, Sequence[float]] | None = None,
        fixed: Mapping[str, float] | None = None,
        substeps: int | None = None,
    ):
        """Raises `UserError` for unknown names and values out of range; `substeps` None means automatic."""
        self.model, self.events = model, tuple(events)
        self.parameters = narrowed(model.parameters, bounds or {})
        self.fixed = {name: float(value) for name, value in (fixed or {}).items()}
        for name in self.fixed:
            _known(name, {p.name: p for p in self.parameters}, "model.fixed")
        free = tuple(p for p in self.parameters if p.name not in self.fixed)
        if not free:
            raise UserError("model.fixed fixes every parameter; leave at least one free to identify")
        self.space = Space.of(free)
        self.lower, self.upper = self.space.lower, self.space.upper
        self._columns = [model.names.index(name) for name in self.space.names]
        self._rest = np.array([self.fixed.get(name, np.nan) for name in model.names])
        self.drive = Drive.of([excitation(e) for e in self.events])
        self.step = self._step(substeps)

    def full(self, values: np.ndarray) -> np.ndarray:
        """Free values (n, free) -> all parameters of the model (n, d)."""
        values = np.atleast_2d(values)
        whole = np.tile(self._rest, (len(values), 1))
        whole[:, self._columns] = values
        return whole

    def objective(self, values: np.ndarray) -> np.ndarray:
        """Eq. (8) of free values (n, free): mean squared error of P plus that of Q, over all events [pu²].

        Candidates without a steady state get `REFUSED` times one plus how far they miss it; those that diverge
        get `REFUSED`.
        """
        errors = self.model.errors(self.drive, self.full(values), self.step.substeps)
        f = errors.sums.sum(axis=(0, 1)) / self.drive.samples
        f = np.where(f < REFUSED, f, REFUSED)
        return np.where(errors.miss > 0, REFUSED * (1 + errors.miss), f)

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Calculated minus measured (n, 2 N), P then Q, scaled so that the sum of squares is Eq. (8)."""
        drive = self.drive
        response = self.model.simulate(drive, self.full(values), self.step.substeps)
        scale = np.sqrt(drive.weights / drive.samples)
        sides = [(got - want) * s for got, want, s in zip((response.P, response.Q), drive.measured, scale, strict=True)]
        rows = np.concatenate(sides, axis=1)
        rows[response.miss.max(axis=0) > 0] = np.nan
        return rows

    def _step(self, substeps: int | None) -> Step:
        if substeps is not None:
            if not 1 <= substeps <= MOST_SUBSTEPS:
                raise UserError(f"model.substeps={substeps} is out of range: it must be 1 to {MOST_SUBSTEPS}")
            given = np.full(len(self.events), substeps)
            return Step(given, np.full(len(self.events), np.nan))
        from scipy.stats import qmc

        probes = self.space.from_unit(qmc.Sobol(len(self.space.names), scramble=False).random(PROBES))
        chosen, error = self.model.substeps(self.drive, self.full(probes), FINE)
        if not (error <= FINE).all():
            worst = int(np.argmax(error))
            raise UserError(
                f"{self.events[worst].record.name}: {MOST_SUBSTEPS} Runge-Kutta steps per sample of"
                f" {1e3 * self.events[worst].record.step:g} ms leave an error of {error[worst]:.1e} pu somewhere in the"
                f" bounds; raise the lower bound of the model's time constants (model.bounds), or set model.substeps"
            )
        return Step(chosen, error)
