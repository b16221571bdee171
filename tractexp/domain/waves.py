"""Sampled waveforms: the currents of the phases are compared, as space vector and zero sequence.

Of a voltage that no record holds: it is balanced, and the power is instantaneous.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from tractexp.domain import excitation, wave_errors
from tractexp.domain.domain import DipGrid, Domain, simulate_compared
from tractexp.domain.playback import Playback
from tractexp.domain.port import Complex, Port, build_current_ports, continue_periodic_course
from tractexp.model.drive import WAVES, Drive, WaveformDrive
from tractexp.model.model import Model
from tractexp.noise import Noise
from tractexp.noise.random_walk import RandomWalk
from tractexp.noise.voltage import SmoothedEvent
from tractexp.noise.waves import estimate_wave_noise
from tractexp.record import Event, WaveEvent, convert_to_waves
from tractexp.record.synthetic import build_synthetic_event
from tractexp.record.wave_event import COARSEST
from tractexp.text.wording import join_words

if TYPE_CHECKING:
    from tractexp.identification.plan import DipShape
    from tractexp.inference.problem import Problem

PLAYED = 64  # samples per cycle at least, of a voltage that is played


class WaveDomain(Domain):
    """Currents of space vectors and of the zero sequence, driven by the sampled voltages."""

    name = WAVES
    setting = "domain=waves "
    compared = "the currents"
    epsilons = ("epsilon_p", "epsilon_q", "epsilon_i")
    # noise of sampled currents starts near 1e-3
    finest, probed, aftermath, stiff = 5e-5, 0.75, float("inf"), True
    quiet_order, noise_from_model = 0, True  # harmonics are no colored noise
    windowed = calibrated = recordable = False
    edge = 0.001
    further = {}
    shaped_by, planned_noise = ("jump", "unbalance"), "noise of the currents, of P before the dip"
    # as long as recorders of waveforms go on
    dips = DipGrid((0.04, 0.08, 0.16, 0.32), 0.002, 0.1, 0.62)

    def event(self, event: Event) -> WaveEvent:
        """The event with its sampled waveforms. Raises `UserError` for a record of phasors."""
        return convert_to_waves(event)

    def excitation(
        self, event: Event, model: Model | None = None, weights: tuple[float, float] = (1.0, 1.0)
    ) -> WaveformDrive:
        """The sampled voltages of an event as inputs, its currents as measurements."""
        return excitation.excite_waveforms(cast(WaveEvent, event))

    def smooth_event(self, event: Event) -> SmoothedEvent:
        """As recorded: within a cycle nothing tells noise of the voltage from the voltage."""
        return SmoothedEvent(event, np.empty((0, event.record.samples)))

    def steady(self, events: Sequence[Event], drive: Drive) -> list[slice]:
        """[]: the power before the dip is not compared."""
        return []

    def longest_step(self, events: Sequence[Event], substeps: np.ndarray) -> float:
        """The shortest step [s] that one of the events took: fine enough for dips like them."""
        return min(e.record.step / n for e, n in zip(events, substeps, strict=True))

    def values(self, drive: Drive) -> int:
        """The time before the record, and currents that are not compared, do not count."""
        return int(np.count_nonzero(drive.weights))

    def noise(
        self,
        residual: np.ndarray,
        valid: np.ndarray,
        quiet: Sequence[slice],
        problem: "Problem",
        values: np.ndarray,
        walk: Callable[[np.ndarray], RandomWalk | None],
        shapes: np.ndarray | None,
    ) -> Noise:
        """A load does not wander within so short a record."""
        responses = wave_errors.compute_impulse_responses(problem, values)
        return estimate_wave_noise(
            residual, valid, quiet, responses, cast(WaveEvent, problem.events[0]).phases, shapes
        )

    def input_errors(self, problem: "Problem", values: np.ndarray) -> np.ndarray:
        """The modes (k, 3, N) [pu] in which errors of the voltage show in the currents."""
        return wave_errors.compute_input_errors(problem, values)

    def comparison(self, event: Event, outputs: np.ndarray) -> Playback:
        """Calculated currents (C, N) beside those recorded, and the power of both."""
        return Playback.of_currents(cast(WaveEvent, event), outputs)

    def ports(self, event: Event) -> tuple[Port, ...]:
        """The ports of an event: the space vector, and the zero sequence where there is one."""
        return build_current_ports(cast(WaveEvent, event))

    def outputs(self, event: Event, responses: Sequence[Complex]) -> np.ndarray:
        """Currents (3, N) of a network's responses: alpha, beta and zero, with what is periodic
        before the dip.
        """
        event, (vector, *zero) = cast(WaveEvent, event), responses
        i = vector * event.turn
        return continue_periodic_course(event, event.currents) + np.stack(
            [i.real, i.imag, zero[0].real if zero else np.zeros(len(i))]
        )

    def better(self, event: Event) -> str:
        """ "": no domain tells more."""
        return ""

    def slowest(self, frequency: float) -> float:
        """The lowest sampling rate [Hz] of a planned dip."""
        return COARSEST * frequency

    def rates(self, frequency: float) -> tuple[float, ...]:
        """Sampling rates [Hz] that a plan tries: whole numbers of samples a cycle."""
        return tuple(n * frequency for n in (16, 32, 64, 128, 200))

    def shape(self, event: Event) -> dict[str, float]:
        """How far the voltage's phase jumps [degrees], and the negative sequence over its depth."""
        event = cast(WaveEvent, event)
        cycle = max(1, round(event.rate / event.f0 / 2))
        middle = max((event.start + event.end) // 2, event.start + cycle)
        around = slice(middle - cycle, middle + cycle)
        v, turn = event.v[around], event.turn[around]
        negative = abs(np.mean(np.conj(v * turn) / turn)) / max(event.U0 * event.depth, 1e-9)
        return {
            "jump": float(np.degrees(np.angle(v.mean()))),
            "unbalance": float(min(negative, 1.0)),
        }

    def describe_shape(self, shape: "DipShape") -> str:
        """ ", the phase jumping by 10 degrees, negative sequence 50% of the depth"."""
        return (
            f", the phase jumping by {shape.jump:.0f} degrees, negative sequence"
            f" {shape.unbalance:.0%} of the depth"
        )

    @property
    def edges(self) -> str:
        """How steep the edges of a planned dip are, and that it has no zero sequence."""
        return f"{super().edges}, without zero sequence"

    def about_noise(self, faults: Sequence[str], judged: bool) -> str:
        """Where noise is estimated, and which faults of the measurement are free, in sentences."""
        origin = (
            "It is estimated before the dip and at the end of the record, from what the fit leaves"
            " there: harmonics that no equation explains count as noise; noise of the voltage is"
            " passed on as the model does. Beside it each channel may keep a small offset, and how"
            " steep the voltage is at the samples of an edge is known no better than two curves"
            " through them agree."
        )
        how = (
            "each held by what is likely"
            if judged
            else "and not judged: these offsets and edges would pass for them"
        )
        if not faults:
            return origin
        free = f"Faults of the measurement ({join_words(faults)}) are free in every fit, {how}."
        return f"{origin} {free}"

    def plan_event(
        self, shape: "DipShape", name: str, t: np.ndarray, course: np.ndarray, start: int, end: int
    ) -> Event:
        """Of a fault between two phases, types C and D of Bollen 2000, where the unbalance is 1."""
        v = (1 - shape.depth * course) * np.exp(1j * np.radians(shape.jump) * course)
        v = v + shape.unbalance * shape.depth * course * np.exp(-4j * np.pi * shape.frequency * t)
        return build_synthetic_event(
            name, t, v, (1.0, shape.P0, shape.Q0), shape.frequency, start, end
        )

    def dip(
        self,
        like: Event,
        step: float,
        course: np.ndarray,
        depth: float,
        jump: float,
        unbalance: float,
    ) -> WaveformDrive:
        """Without zero sequence, sampled as an event is."""
        like, n = cast(WaveEvent, like), len(course)
        omega_n = 2 * np.pi * like.record.base.frequency
        turn = np.exp(1j * (omega_n + like.omega_s0) * (np.arange(n) * step))
        U, U2 = like.U0 * (1 - depth * course), like.U0 * unbalance * depth * course
        v = U * np.exp(1j * np.radians(jump) * course) + U2 * np.conj(turn) ** 2
        compared = np.where(np.array(like.compared_channels)[:, None], 0.0, np.nan) * np.ones(n)
        return WaveformDrive(
            step,
            v,
            np.zeros(n),
            turn,
            compared,
            U,
            U2,
            like.U0,
            like.P0,
            like.Q0,
            omega_s0=like.omega_s0,
            omega_n=omega_n,
            weights=excitation.WEIGHTS[like.phases],
        )

    def play(
        self,
        model: Model,
        values: np.ndarray,
        t: np.ndarray,
        U: np.ndarray,
        before: Mapping[str, float],
        omega_s: np.ndarray | None = None,
        omega_s0: float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Of three phases, with the oscillation of decaying offsets; the phase turns as omega_s
        says.

        Between its samples the voltage is a straight line.
        """
        nominal = before["frequency"]
        every = max(1, int(np.ceil((t[1] - t[0]) * nominal * PLAYED)))
        fine = np.linspace(t[0], t[-1], every * (len(t) - 1) + 1)
        v = np.interp(fine, t, U).astype(complex)
        if omega_s is not None:
            speed = np.interp(fine, t, omega_s) - omega_s0
            v *= np.exp(
                1j
                * np.cumsum(np.concatenate([[0.0], (speed[1:] + speed[:-1]) / 2 * np.diff(fine)]))
            )
        means = before["U0"], before["P0"], before["Q0"]
        event = build_synthetic_event(
            "played", fine, v, means, nominal + omega_s0 / (2 * np.pi), 1, len(fine) - 1
        )
        i = simulate_compared(model, values, Drive.from_events([self.excitation(event)]))
        power = (v * np.conj((i[0] + 1j * i[1]) / event.turn))[::every]
        return power.real, power.imag
