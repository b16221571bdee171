"""A composed load model: parameters, simulation and objective of many candidates at once, equations
in LaTeX.
"""

import copy
import functools
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.cache.texts import get_text_of_parts
from tractexp.errors import MODEL, RefusedEffect, UserError, check_choice
from tractexp.kernel import objects
from tractexp.kernel.kernel import NOTHING, Kernel
from tractexp.kernel.layout import EVENT, INPUTS, LANES
from tractexp.model.arithmetic import evaluate_texts
from tractexp.model.drive import DOMAINS, PHASORS, WAVES, Drive
from tractexp.model.parts import Effect, Measurement, Motor, Static
from tractexp.parameter import Parameter
from tractexp.record.window import averaged_power

SUBSTEP_TOLERANCE = 1e-7  # pu, largest step-doubling error of P or Q an automatic substep may leave
MOST_SUBSTEPS = 256
MOST_STORED = 8_000_000  # numbers of responses that are held at once
# Runge-Kutta steps of all candidates in one call: about a second, in which no signal is heard
MOST_STEPS_A_CALL = 2e8
# pu: no load draws as much; what is calculated beyond has diverged, as the flux of a motor that
# stalls and turns backwards ever faster
LARGEST_OUTPUT = 1e6
# Runge-Kutta of order 4, or Eq. (4) as it stands
CLASSICAL, PRINTED = INTEGRATIONS = ("classical", "printed")


@dataclass(frozen=True, eq=False)
class ModelResponse:
    """The response of a load, for n candidates.

    Attributes
    ----------
    outputs : (C, n, N) [pu]
        P and Q, or the currents of waveforms.
    miss : (E, n)
        How far a candidate is from a steady state before each event; its response is valid at 0.
    """

    outputs: np.ndarray  # (C, n, N) pu
    miss: np.ndarray  # (E, n)

    @property
    def P(self) -> np.ndarray:
        """(n, N) pu."""
        return self.outputs[0]

    @property
    def Q(self) -> np.ndarray:
        """(n, N) pu."""
        return self.outputs[1]

    @property
    def by_candidate(self) -> np.ndarray:
        """(n, C, N) pu."""
        return np.swapaxes(self.outputs, 0, 1)


@dataclass(frozen=True, eq=False)
class Errors:
    """Weighted sums of squared errors of n candidates.

    Attributes
    ----------
    sums : (E, C, n) [pu²]
        Of P and Q, or of three currents, by event.
    miss : (n,)
        How far a candidate is from a steady state, summed over the events.
    """

    sums: np.ndarray  # (E, C, n) pu²: P, Q, or three currents
    miss: np.ndarray  # (n,)

    @property
    def is_refused(self) -> np.ndarray:
        """Which candidates (n,) have no steady state, or diverge."""
        return (self.miss > 0) | ~np.isfinite(self.sums).all(axis=(0, 1))


@dataclass(frozen=True)
class Acceptance:
    """Whether a model takes an effect.

    Attributes
    ----------
    refusal : str or None
        The sentence why the effect makes no sense for it; None where it does.
    edits : names
        The sites that the effect edits.
    """

    refusal: str | None
    edits: Sequence[str] = ()  # names of the sites it edits


class Model:
    """A composite load, Eq. (7): a motor in parallel with a static load. Make one with `compose`.

    Candidates are arrays `values` (n, d) in the order of `parameters`, in their units, or (E, n, d)
    where they differ by event.
    """

    def __init__(
        self,
        motor: Motor,
        static: Static,
        effects: Sequence[Effect] = (),
        integration: str = CLASSICAL,
        domain: str = PHASORS,
        window: float | str | None = None,
    ):
        # over which the recorder averages phasors; see `tractexp.domain.averaging`
        self.window = window
        self.motor, self.static, self.integration, self.domain = motor, static, integration, domain
        # the same model in whatever order given
        self.effects = tuple(sorted(effects, key=lambda e: (e.order, e.name)))
        self.measurements = tuple(e for e in self.effects if isinstance(e, Measurement))
        self.recorder: Measurement | None = None
        load = f"{motor.label} motor and {static.name} static load"
        self.title = " with ".join([load, *(effect.name for effect in self.effects)])
        if integration == PRINTED:
            self.title += ", integrated by Eq. (4) as printed"
        if self.waves:
            self.title += ", on waveforms"
        if window is not None:
            length = window if isinstance(window, str) else f"{1000 * window:g} ms"
            self.title += f", behind the recorder's window ({length})"

    @property
    def waves(self) -> bool:
        """Whether it draws sampled currents, not phasors' power."""
        return self.domain == WAVES

    def place_behind_recorder(self, recorder: Measurement | None) -> "Model":
        """The load as a known recorder shows it.

        The recorder has no parameters, and comes before the faults of the measurement. None: the
        model itself.
        """
        if recorder is None:
            return self
        model = copy.copy(self)
        model.recorder, model.measurements = recorder, (recorder, *self.measurements)
        return model

    def extend(self, effects: Iterable[Effect]) -> "Model":
        """The load with further effects, as the same recorder shows it."""
        parts = self.motor, self.static, [*self.effects, *effects]
        model = compose(*parts, self.integration, self.domain, self.window)
        return model.place_behind_recorder(self.recorder)

    @functools.cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters of motor, static load and effects, in this order."""
        return tuple(
            p for part in (self.motor, self.static, *self.effects) for p in part.parameters
        )

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the parameters, in their order."""
        return tuple(p.name for p in self.parameters)

    @property
    def reads(self) -> dict[str, Motor | Static | Effect]:
        """The recorded channels without which this model cannot be identified, each with a part
        that reads it.
        """
        return {
            channel: part
            for part in (self.motor, self.static, *self.effects)
            for channel in part.reads
        }

    @functools.cached_property
    def equations(self) -> Any:
        """The declaration all parts wrote into (an `Equations`). Raises `UserError` for parts that
        do not fit.
        """
        from tractexp.model.declaration import declare_equations

        return declare_equations(self.motor, self.static, self.effects, self.title, self.domain)

    def acceptance(self, effect: Effect) -> "Acceptance":
        """Whether one more effect makes sense for this model, and what it would edit; remembered
        beside the kernels.
        """
        parts = (self.motor, self.static, *self.effects, effect)
        return Acceptance(
            **json.loads(
                get_text_of_parts(
                    parts, lambda: self._try_effect(effect), self._in_cache("acceptance")
                )
            )
        )

    def _try_effect(self, effect: Effect) -> str:
        """Whether an effect can be added, as JSON: the sites it edits, or why not."""
        try:
            eq = compose(
                self.motor, self.static, [*self.effects, effect], domain=self.domain
            ).equations
        except RefusedEffect as refused:
            return json.dumps(
                {"refusal": refused.reason if refused.effect == effect.name else str(refused)}
            )
        return json.dumps({"refusal": None, "edits": eq.edits.get(effect.name, [])})

    @functools.cached_property
    def source(self) -> str:
        """The kernel's text: LLVM IR, the same on every machine."""
        name = "kernel" if self.integration == CLASSICAL else f"kernel_{self.integration}"
        return get_text_of_parts(
            (self.motor, self.static, *self.effects), self._written, self._in_cache(name)
        )

    def _in_cache(self, what: str) -> str:
        """The kind of a text in the cache: those of phasors by themselves."""
        return f"{what}_{self.domain}" if self.waves else what

    def _written(self) -> str:
        """The text of its kernel."""
        from tractexp.kernel.emit import write_kernel
        from tractexp.model.lowering import lower

        return write_kernel(lower(self.equations), self.title, self.integration)

    @functools.cached_property
    def kernel(self) -> Kernel:
        """The kernel, compiled where the cache does not hold it."""
        return Kernel(self.source)

    def compile(self) -> None:
        """Have the kernel in the cache."""
        objects.load_object_code(self.source)

    def format_listing(self) -> str:
        """The kernel for people to read: the equations as they were lowered, and the IR."""
        from tractexp.kernel.listing import list_equations
        from tractexp.model.lowering import lower

        return "\n".join([*list_equations(lower(self.equations)), "", self.source])

    listing = format_listing  # its name in version 0.2

    def simulate(
        self,
        drive: Drive,
        values: np.ndarray,
        substeps: Sequence[int] | np.ndarray | int = 1,
        before: np.ndarray | None = None,
    ) -> ModelResponse:
        """Simulate candidates through events.

        Parameters
        ----------
        drive : Drive
            E events of N samples in all.
        values : (n, d) or (E, n, d)
            Parameters of n candidates.
        substeps : int or (E,) ints
            Runge-Kutta steps per sample.
        before : (E, n, 2) [pu] or None
            P0 and Q0 where candidates differ in them; None: the drive's own.

        Returns
        -------
        ModelResponse
            nan where a candidate has diverged.
        """
        candidates = self._candidates(drive, values, before)
        n = candidates.shape[2]
        outputs = np.empty((drive.channels, n, drive.samples))
        outputs.fill(np.nan)
        _, miss = self._run(drive, candidates, substeps, outputs)
        largest = max(outputs.max(initial=0.0), -outputs.min(initial=0.0))
        if not largest <= LARGEST_OUTPUT:  # nor where it is nan
            outputs[(outputs > LARGEST_OUTPUT) | (outputs < -LARGEST_OUTPUT)] = np.nan
        for e, window in enumerate(drive.windows):
            if window is not None:
                part = drive.part(e)
                outputs[:, :, part] = averaged_power(
                    outputs[:, :, part], drive.find_phasors(e), window
                )
        for effect in self.measurements:
            columns = {p.name: candidates[:, self.names.index(p.name)] for p in effect.parameters}
            outputs = _observe_outputs(effect, outputs, drive, columns)
        return ModelResponse(outputs, miss)

    def errors(
        self, drive: Drive, values: np.ndarray, substeps: Sequence[int] | np.ndarray | int = 1
    ) -> Errors:
        """The weighted squared errors of candidates, in one pass and without storing responses.

        Where the measurement stands between kernel and sums, the responses of a few candidates are
        stored at a time.

        Parameters
        ----------
        drive, values, substeps
            As of `simulate`.

        Returns
        -------
        Errors
        """
        if not (self.measurements or drive.windows):
            sums, miss = self._run(drive, self._candidates(drive, values), substeps)
            return Errors(sums, miss.sum(axis=0))
        values = np.atleast_2d(values)
        together = max(1, MOST_STORED // drive.measurements.size)
        groups = np.split(values, range(together, values.shape[-2], together), axis=-2)
        parts = [self._errors_of_responses(drive, group, substeps) for group in groups]
        return Errors(
            np.concatenate([p.sums for p in parts], axis=2), np.concatenate([p.miss for p in parts])
        )

    def _errors_of_responses(
        self, drive: Drive, values: np.ndarray, substeps: Sequence[int] | np.ndarray | int
    ) -> Errors:
        """Sums of squared errors (E, 2, n) from the responses themselves, for what the kernel
        cannot sum.
        """
        response = self.simulate(drive, values, substeps)
        with np.errstate(over="ignore", invalid="ignore"):  # of what diverges
            square = (response.outputs - drive.measurements[:, None]) ** 2 * drive.weights[:, None]
        sums = np.add.reduceat(square, drive.first[:-1], axis=2)
        return Errors(np.moveaxis(sums, 2, 0), response.miss.sum(axis=0))

    def substeps(
        self,
        drive: Drive,
        values: np.ndarray,
        tolerance: float = SUBSTEP_TOLERANCE,
        share: float = 1.0,
        until: Sequence[float] | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The Runge-Kutta steps per sample that each event needs, by step doubling.

        The error is the largest difference of any output between n and 2 n steps. Integrated as
        printed a model takes one step per sample, as the paper does, whatever error that leaves.

        Parameters
        ----------
        drive, values
            As of `simulate`.
        tolerance : float [pu]
            The error that is allowed.
        share : float
            Share of the candidates with a steady state for which it must hold: those with the least
            error.
        until : E floats or None [s]
            Seconds after each event's first sample up to which the error counts; None: all of it.

        Returns
        -------
        (E,) ints
            Steps per sample.
        (E,) array [pu]
            The error that they leave.
        """
        most = MOST_SUBSTEPS if self.integration == CLASSICAL else 1
        chosen, error = np.ones(drive.events, dtype=np.int64), np.full(drive.events, np.inf)
        parts = [drive.part(e) for e in range(drive.events)]
        if until is not None:
            t = drive.inputs[INPUTS.index("t")]  # from each event's first sample on
            ends = [
                p.start + int(np.searchsorted(t[p], end))
                for p, end in zip(parts, until, strict=True)
            ]
            parts = [slice(p.start, end) for p, end in zip(parts, ends, strict=True)]
        coarse = self.simulate(drive, values, chosen)
        while True:
            fine = self.simulate(drive, values, 2 * chosen)
            for e, part in enumerate(parts):
                good = coarse.miss[e] == 0
                gaps = np.abs(coarse.outputs[:, good, part] - fine.outputs[:, good, part])
                worst = np.sort(np.nan_to_num(gaps.max(axis=(0, 2), initial=0.0), nan=np.inf))
                error[e] = worst[: max(1, int(np.ceil(share * len(worst))))].max(initial=0.0)
            short = ~(error <= tolerance) & (chosen < most)
            if not short.any():
                return chosen, error
            chosen, coarse = np.where(short, 2 * chosen, chosen), fine
            if not short.all():
                coarse = self.simulate(drive, values, chosen)

    def refusal(self, values: np.ndarray, drive: Drive) -> str | None:
        """Why parameters have no steady state before the first event.

        Parameters
        ----------
        values : (d,)
            Of one candidate.
        drive : Drive
            The events.

        Returns
        -------
        str or None
            A sentence; None where they have one.
        """
        _, miss = self._run(drive, self._candidates(drive, values), 1)
        if miss[0, 0] == 0:
            # the kernel found one; the sentence takes the symbols, which take a second to load
            return None
        eq = self.equations
        numbers = dict(zip(self.names, map(float, values), strict=True))
        numbers |= dict(zip((*EVENT, "P0", "Q0"), (*drive.event[0], *drive.before[0]), strict=True))
        starts = [symbol.name for symbol in eq.real_starts()]
        numbers |= zip(starts, self._list_starts(values, drive), strict=True)

        def number(expression: Any) -> float:
            whole = eq.expand(expression)
            return complex(whole.subs({s: numbers[s.name] for s in whole.free_symbols})).real

        missed = [
            r.sentence.format(value=number(r.shown))
            for r in eq.requirements
            if not number(r.slack) >= 0
        ]
        return (
            "; ".join(missed)
            or "no steady state was found before the event; its equations have no solution there"
        )

    def at_rest(self, values: np.ndarray, drive: Drive, event: int = 0) -> dict[str, float]:
        """The steady state of one candidate before an event.

        It is valid where `refusal` has nothing to say; quantities that are phasors are left out.

        Parameters
        ----------
        values : (d,)
            Of one candidate.
        drive : Drive
            The events.
        event : int
            Which of them, from 0.

        Returns
        -------
        {name: value}
            Parameters, states (`NAME_before`) and named quantities.
        """
        stated = json.loads(
            get_text_of_parts(
                (self.motor, self.static, *self.effects), self._at_rest, self._in_cache("rest")
            )
        )
        numbers = [*map(float, (*values, *drive.before[event], *drive.event[event]))]
        substitutes = dict(zip((*self.names, "P0", "Q0", *EVENT), numbers, strict=True))
        starts = self._list_starts(values, drive, event)
        substitutes |= dict(zip(stated["starts"], starts, strict=True))
        return evaluate_texts(stated["quantities"], substitutes)

    def _list_starts(self, values: np.ndarray, drive: Drive, event: int = 0) -> list[float]:
        """What the states of one candidate (d,) start from in an event."""
        candidates = self._candidates(drive, values)[[event]]
        return self.kernel.starts(candidates, drive.event[[event]])[0, :, 0].tolist()

    def _at_rest(self) -> str:
        """Names of what stands in the steady state, as JSON."""
        from tractexp.model.printed import list_stated_quantities

        starts = [symbol.name for symbol in self.equations.real_starts()]
        return json.dumps({"starts": starts, "quantities": list_stated_quantities(self.equations)})

    def latex(self) -> list[str]:
        """The model's equations, one a line; read back from the store, without SymPy, where they
        were printed before.
        """
        parts = (self.motor, self.static, *self.effects)
        printed = get_text_of_parts(
            parts, lambda: json.dumps(self.equations.latex()), self._in_cache("latex")
        )
        return json.loads(printed)

    def _candidates(
        self, drive: Drive, values: np.ndarray, before: np.ndarray | None = None
    ) -> np.ndarray:
        """Kernel rows (E, d + 2, n): the parameters, then P0 and Q0 of the event."""
        values = np.atleast_2d(np.asarray(values, dtype=float))
        if values.shape[-1] != len(self.names):
            raise ValueError(
                f"values {values.shape} must end in {len(self.names)} columns:"
                f" {', '.join(self.names)}"
            )
        n = values.shape[-2]
        rows = np.empty((drive.events, values.shape[-1] + 2, n))
        rows[:, :-2] = values.swapaxes(-1, -2)
        rows[:, -2:] = drive.before[:, :, None] if before is None else np.swapaxes(before, -1, -2)
        return rows

    def _run(
        self,
        drive: Drive,
        candidates: np.ndarray,
        substeps: Sequence[int] | np.ndarray | int,
        outputs: np.ndarray = NOTHING,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Sums (E, C, n) and miss (E, n); writes outputs (C, n, N) where there is room."""
        n = candidates.shape[2]
        sums, miss = np.empty((drive.events, drive.channels, n)), np.empty((drive.events, n))
        steps = np.empty(drive.events, dtype=np.int64)
        steps[:] = substeps
        lanes = LANES * max(
            1, int(MOST_STEPS_A_CALL / (LANES * max(drive.samples * int(steps.max()), 1)))
        )
        if n > lanes:
            for part in (slice(begin, begin + lanes) for begin in range(0, n, lanes)):
                some = np.ascontiguousarray(candidates[..., part])
                written = (
                    np.empty((len(outputs), some.shape[2], drive.samples))
                    if outputs.size
                    else NOTHING
                )
                sums[..., part], miss[..., part] = self._run(drive, some, steps, written)
                if outputs.size:
                    outputs[:, part] = written
            return sums, miss
        self.kernel.run(
            candidates,
            drive.event,
            drive.first,
            drive.inputs,
            drive.measurements,
            drive.weights,
            steps,
            sums,
            miss,
            outputs,
        )
        return sums, miss


def _observe_outputs(
    effect: Measurement, outputs: np.ndarray, drive: Drive, columns: dict[str, np.ndarray]
) -> np.ndarray:
    """Outputs (C, n, N) as a recorder shows them.

    Those of candidates all of whose sizes are at their nulls stay as they are.
    """
    sizes = [columns[p.name] != p.null for p in effect.parameters if p.null is not None]
    off = np.any(sizes, axis=(0, 1)) if sizes else np.ones(outputs.shape[1], dtype=bool)
    if off.all():
        return effect.observe(outputs, drive, columns)
    if off.any():
        outputs[:, off] = effect.observe(
            outputs[:, off], drive, {name: each[:, off] for name, each in columns.items()}
        )
    return outputs


def compose(
    motor: Motor,
    static: Static,
    effects: Sequence[Effect] = (),
    integration: str = CLASSICAL,
    domain: str = PHASORS,
    window: float | str | None = None,
) -> Model:
    """Compose a load of a motor, a static load and effects.

    Parameters
    ----------
    motor : Motor
        Or the plugin `none`.
    static : Static
        The static load.
    effects : sequence of Effect
        In any order.
    integration : str
        "classical", or "printed" as Eq. (4) is.
    domain : str
        "phasors" or "waves".
    window : float [s], str or None
        That over which the recorder averages phasors: seconds, the name of an estimator, or
        `recorded`.

    Returns
    -------
    Model

    Raises
    ------
    UserError
        For an effect named twice, an unknown integration or domain.
    """
    check_choice("model.integration", integration, INTEGRATIONS)
    check_choice("domain", domain, DOMAINS)
    names = [effect.name for effect in effects]
    if twice := next((n for n in names if names.count(n) > 1), None):
        raise UserError(f"{MODEL.effects} names '{twice}' twice; name each effect once")
    return Model(motor, static, effects, integration, domain, window)
