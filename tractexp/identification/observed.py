"""Records as an identification looks at them: the voltage's own noise smoothed out, the noise of P and Q told from it.

The noise is that of an investigation (`tractexp.noise`): P and Q correlated with each other and in time, a load that
wanders, and what is left of the voltage's noise, which enters the model and leaves it in P and Q at once.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.problem import Problem, excitation, excited
from tractexp.model.drive import Drive
from tractexp.noise.color import SMALLEST
from tractexp.noise.model import Noise
from tractexp.noise.quiet import estimate, louder, quiet_stretches
from tractexp.noise.voltage import Smoothed, smoothed
from tractexp.noise.wander import LESS, WITHIN, Load, Rest, Wander, find, without_slow
from tractexp.noise.waves import of_waves
from tractexp.record import Event, WaveEvent

DIVERGED = 10.0  # pu: a wrong sample of the voltage makes no such difference
OFFSET = 0.005  # pu: what may be left of a channel's offset, which the mean before the dip took off
MOST_BETWEEN = 12  # intervals between samples whose voltage is doubted
ROUGH = 5.0  # standard deviations of its noise, from which a sample off its neighbors' cubic is no noise
SMOOTHER = 8.0  # times the error of a cubic through every second sample over that through all
LEFT = 2.0  # times what white noise leaves of an offset that the mean before the dip took off
ANSWERED = 8  # samples of the lead after which a single wrong sample of the voltage is put there
LEAST_KEPT = 0.2  # of a residual's variance: where the fit takes more, it tells nothing of the noise
# Twice the log-likelihood from which a load is said to wander. An investigation asks for less: a wandering that is not
# there costs it little, and an estimate a third of its precision.
SEEN = 5.0
MOST_SAMPLES = 2_000_000  # of voltages with an error that are simulated at once


@dataclass(frozen=True, eq=False)
class Observed:
    """A problem driven by smoothed voltages, and what may still be wrong with these."""

    problem: Problem
    smoothed: tuple[Smoothed, ...]

    @classmethod
    def of(cls, problem: Problem) -> "Observed":
        """The same problem with the noise taken out of the voltage of each event."""
        if problem.model.waves:  # within a cycle nothing tells noise of the voltage from the voltage
            return cls(problem, tuple(Smoothed(event, np.empty((0, event.record.samples))) for event in problem.events))
        clean = tuple(smoothed(event) for event in problem.events)
        return cls(problem.driven_by([s.event for s in clean]), clean)

    @property
    def events(self) -> tuple[Event, ...]:
        return self.problem.events

    @property
    def drive(self) -> Drive:
        return self.problem.drive

    @functools.cached_property
    def quiet(self) -> list[slice]:
        """The samples in which little happens."""
        return quiet_stretches(self.events, self.drive)

    @functools.cached_property
    def power(self) -> Load:
        """What the load takes, over what it took before each event."""
        return Load.of(self.drive.measured, self.drive.before, self.drive.first)

    def noise(
        self,
        residuals: np.ndarray,
        known: np.ndarray,
        columns: np.ndarray,
        blur: np.ndarray | None,
        whole: bool,
        answers: Sequence[np.ndarray] | None = None,
    ) -> Noise | None:
        """Noise from what a fit leaves (2, N) in quiet, or of the `whole` records; None where too few samples are.

        `columns` (k, 2, N) are what each coordinate could still change; `blur` is that of `blurred`, `answers` that
        of `answers`.
        """
        apart = np.linalg.qr(columns.reshape(len(columns), -1)[np.any(columns != 0, axis=(1, 2))].T)[0]
        kept = np.maximum(1 - (apart**2).sum(axis=1), LEAST_KEPT).reshape(residuals.shape)  # the fit took the rest
        first = self.events[0]
        where = [self.drive.part(e) for e in range(self.drive.events)] if whole else self._noisy(residuals, known)
        try:
            if answers is not None and isinstance(first, WaveEvent):
                return of_waves(residuals / np.sqrt(kept), known, where, answers, first.phases, blur)
            wander = functools.partial(self._wander, residuals, columns, known)
            return estimate(residuals / np.sqrt(kept), known, where, wander, blur)
        except UserError:
            return None

    def _noisy(self, residuals: np.ndarray, known: np.ndarray) -> list[slice]:
        """The quiet stretches whose residual (C, N) is noise: those after a dip only where no louder than before it.

        Where a record has less noise than the model has error, what is left at its end is the model's.
        """
        before = [part for part, calm in self._stretches if calm]
        after = [part for part, calm in self._stretches if not calm]
        for c in np.flatnonzero(known.any(axis=1)):
            calm, late = ([without_slow(residuals[c, p][known[c, p]]) for p in parts] for parts in (before, after))
            if louder(late, calm):
                return before
        return self.quiet

    @functools.cached_property
    def _stretches(self) -> list[tuple[slice, bool]]:
        """The quiet stretches, and whether each lies before its dip."""
        starts = [int(self.drive.first[e]) + event.start for e, event in enumerate(self.events)]
        return [(part, part.stop in starts) for part in self.quiet]

    def _wander(self, left: np.ndarray, columns: np.ndarray, known: np.ndarray, mix: np.ndarray) -> Wander | None:
        """How the load wanders before the events and during them, in mixed channels."""
        parts = [self.drive.part(e) for e in range(self.drive.events)]
        before = [self.drive.measured[:, p][:, event.steady] for p, event in zip(parts, self.events, strict=True)]
        rests = []
        if known.all():
            mixed = np.einsum("ij,kjt->kit", mix, columns)
            rests = [Rest(mix @ left[:, part], mixed[:, :, part], self.power.apparent[part]) for part in parts]
        return find(
            [mix @ b for b in before if np.isfinite(b).all()], self.events[0].record.step, self.power, rests,
            seen=SEEN, within=WITHIN, less=LESS,
        )  # fmt: skip

    def blurred(self, values: np.ndarray) -> np.ndarray | None:
        """What errors of the voltage do to the power at free values (d,): (k, 2, N) [pu], None where it has none.

        Of waveforms, whose voltage stands as recorded, what `unsure` tells.
        """
        if (offsets := self.offsets(values)) is not None:
            return offsets
        most = max(len(s.errors) for s in self.smoothed)
        if not most:
            return None
        together = max(1, MOST_SAMPLES // self.drive.samples)
        shapes = [None, *range(most)]
        parts = [self._driven(values, shapes[k : k + together]) for k in range(0, len(shapes), together)]
        power = np.concatenate(parts)
        return np.nan_to_num(power[1:] - power[0])

    def offsets(self, values: np.ndarray) -> np.ndarray | None:
        """What may be wrong with waveforms and is neither noise nor the model's error, `unsure`; None of phasors."""
        return unsure(self.problem, values) if self.problem.model.waves else None

    def answers(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """`answers` of this problem at free values (d,); None of phasors."""
        return answers(self.problem, values) if self.problem.model.waves else None

    def _driven(self, values: np.ndarray, shapes: Sequence[int | None]) -> np.ndarray:
        """Power (shapes, 2, N) under the smoothed voltages, each with one of its errors; all in one simulation."""
        problem, count = self.problem, len(shapes)
        events = [s.event if k is None else s.off_by(k) for k in shapes for s in self.smoothed]
        drive = Drive.of([excitation(event, problem.model) for event in events])
        own = np.tile(problem.by_event(values), (count, 1, 1))
        response = problem.model.simulate(drive, own, np.tile(problem.step.substeps, count))
        return response.outputs[:, 0].reshape(drive.channels, count, -1).swapaxes(0, 1)


def answers(problem: Problem, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What one standard deviation of a sample of the voltage does to the currents at free values (d,), of waveforms.

    (L,) complex of the space vector and (L,) of the zero sequence, in the stationary frame, from shortly before
    that sample to the dip: what is smooth between samples is changed a little earlier. Of the first event.
    """
    event = problem.events[0]
    assert isinstance(event, WaveEvent)
    noise = max(event.noise_U, SMALLEST)
    shocks = [(noise, 0.0), (1j * noise, 0.0), (0.0, noise / np.sqrt(2))][: event.phases]  # the zero's is a third
    events: list[Event] = [event, *(_struck(event, *shock) for shock in shocks)]
    drive = Drive.of([excited(e, problem.model) for e in events])
    own = np.tile(problem.by_event(values)[:1], (len(events), 1, 1))
    response = problem.model.simulate(drive, own, np.tile(problem.step.substeps[:1], len(events)))
    seen = response.outputs[:, 0].reshape(drive.channels, len(events), -1)[:, :, : event.start]
    off = _finite(seen[:, 1:] - seen[:, :1])
    if event.phases == 1:
        return off[0, 0], np.zeros(1)
    return (off[0, 0] + 1j * off[1, 0] - 1j * (off[0, 1] + 1j * off[1, 1])) / 2, off[2, 2]


def unsure(problem: Problem, values: np.ndarray) -> np.ndarray:
    """What may be wrong with waveforms and is no noise, as the currents show it at free values (d,), (k, 3, N) [pu].

    The offsets that the channels may have, and those of the voltage as the model passes them on.
    """
    shapes = [offsets(problem.drive), *(_of_voltage(problem, values, e) for e in range(problem.drive.events))]
    return np.concatenate(shapes)


def _of_voltage(problem: Problem, values: np.ndarray, event: int) -> np.ndarray:
    """What offsets of the voltage do in one event, and what it may be between samples at its edges, (k, 3, N)."""
    drive, part = problem.drive, problem.drive.part(event)
    plain = problem.events[event]
    assert isinstance(plain, WaveEvent)
    one = Drive.of([excited(e, problem.model) for e in (plain, *_shifted(plain), *_between(plain))])
    own = np.tile(problem.by_event(values)[[event]], (one.events, 1, 1))
    made = problem.model.simulate(one, own, np.tile(problem.step.substeps[[event]], one.events)).outputs[:, 0]
    made = made.reshape(one.channels, one.events, -1).swapaxes(0, 1)
    shapes = np.zeros((len(made) - 1, *drive.measured.shape))
    shapes[:, :, part] = _finite(made[1:] - made[0]) * (drive.weights[:, part] > 0)
    return shapes


def _finite(off: np.ndarray) -> np.ndarray:
    """Differences of responses [pu]; what diverged tells nothing."""
    return np.where(np.abs(off) < DIVERGED, off, 0.0)


def _shifted(event: WaveEvent) -> list[WaveEvent]:
    """The event with the offset that noise may have left in each component of its voltage, from the record on."""
    size = LEFT * event.noise_U / np.sqrt(max(event.start - event.lead, 1))
    there = np.arange(len(event.v)) >= event.lead
    return [replace(event, v=event.v + there * size * way * event.turn.conj()) for way in (1.0, 1j)[: event.phases]]


def _between(event: WaveEvent) -> list[WaveEvent]:
    """The event with what its voltage may be besides between two samples, where it is least smooth.

    How far each sample lies off a cubic through its neighbors tells how far the cubic may be off between samples.
    """
    off = np.abs(off_neighbors(event.v * event.turn))
    off[: event.lead + 3] = 0.0
    seen = np.argsort(-off)[:MOST_BETWEEN]
    seen = np.sort(seen[off[seen] > max(ROUGH * event.noise_U, SMALLEST)])
    made = []
    for k in seen.tolist():
        bump = np.zeros(len(event.v), dtype=complex)
        bump[k] = off[k] / SMOOTHER * event.turn[k].conj()
        made += [replace(event, v=event.v + way * bump) for way in (1.0, 1j)[: event.phases]]
    return made


def off_neighbors(v: np.ndarray) -> np.ndarray:
    """How far each sample of v (N,) lies off the cubic through two on either side; 0 at the ends."""
    off = np.zeros_like(v)
    off[3:-3] = v[3:-3] - (9 * (v[2:-4] + v[4:-2]) - (v[:-6] + v[6:])) / 16
    return off


def offsets(drive: Drive) -> np.ndarray:
    """A constant in each compared current of each event, of one standard deviation, (k, 3, N) [pu]."""
    shapes = []
    for e in range(drive.events):
        for c in range(drive.channels):
            if drive.weights[c, drive.part(e)].any():
                shapes.append(np.zeros(drive.measured.shape))
                shapes[-1][c, drive.part(e)] = OFFSET
    return np.array(shapes)


def _struck(event: WaveEvent, vector: complex, zero: float) -> WaveEvent:
    """The event with one sample of the lead's voltage off, in the stationary frame, and what of it is not smoothed."""
    struck = np.zeros(len(event.v), dtype=complex)
    struck[ANSWERED : ANSWERED + len(event.weights)] = event.weights
    v = vector * struck
    if event.phases == 1:  # whose imaginary part is what the sample was a quarter of a cycle ago
        v = v + 1j * np.roll(v, round(event.rate / event.f0 / 4))
    return replace(event, v=event.v + v * event.turn.conj(), v_zero=event.v_zero + zero * np.real(struck))
