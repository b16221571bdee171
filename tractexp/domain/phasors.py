"""Phasors: P and Q are compared, a few samples in a cycle at most."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tractexp.domain import excitation
from tractexp.domain.domain import DipGrid, Domain, simulate_compared
from tractexp.domain.playback import Playback
from tractexp.domain.port import Complex, Port, build_power_port
from tractexp.model.drive import PHASORS, Drive, Excitation
from tractexp.model.model import Model
from tractexp.noise import Noise
from tractexp.noise.quiet import estimate
from tractexp.noise.random_walk import RandomWalk
from tractexp.noise.voltage import SmoothedEvent, smooth_voltage
from tractexp.record import Base, Event, Record
from tractexp.record.wave_event import describe_smearing, has_fine_samples

if TYPE_CHECKING:
    from tractexp.identification.plan import DipShape
    from tractexp.inference.problem import Problem

FINEST_STEP = 5e-4  # s, longest Runge-Kutta step of a forecast


class PhasorDomain(Domain):
    """P and Q that phasors show, driven by the size of the positive-sequence voltage."""

    name = PHASORS
    setting = ""
    compared = "P and Q"
    epsilons = ("epsilon_p", "epsilon_q")
    finest, probed, aftermath, stiff = 5e-6, 1.0, 10.0, False  # noise of records starts near 1e-4
    quiet_order, noise_from_model = 4, False
    windowed = calibrated = recordable = True
    edge = 0.02
    further = {"jump": "the frequency f", "unbalance": "U2"}
    shaped_by, planned_noise = (), "noise, of P before the dip"
    # the longest is a tap or a bank that is back after 1 s
    dips = DipGrid((0.1, 0.2, 0.4, 0.8), 0.04, 0.3, 2.5)

    def event(self, event: Event) -> Event:
        """The event itself."""
        return event

    def excitation(
        self, event: Event, model: Model | None = None, weights: tuple[float, float] = (1.0, 1.0)
    ) -> Excitation:
        """U, f and U2 of an event as inputs, P and Q as measurements, each with its weight."""
        return excitation.excite_phasors(event, model, weights)

    def lacks(self, channel: str, events: Sequence[Event]) -> bool:
        return any(channel not in event.channels for event in events)

    def smooth_event(self, event: Event) -> SmoothedEvent:
        """The event with its voltage smoothed where it is smooth, and what that leaves of its
        noise.
        """
        return smooth_voltage(event)

    def steady(self, events: Sequence[Event], drive: Drive) -> list[slice]:
        """The samples of the drive before each dip, whose means are P0 and Q0."""
        first = [int(drive.first[e]) for e in range(drive.events)]
        return [
            slice(a + e.steady.start, a + e.steady.stop) for a, e in zip(first, events, strict=True)
        ]

    def longest_step(self, events: Sequence[Event], substeps: np.ndarray) -> float:
        """A step [s] that is fine enough for every dip of phasors."""
        return FINEST_STEP

    def values(self, drive: Drive) -> int:
        """How many numbers are measured, gaps included."""
        return drive.measurements.size

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
        return estimate(residual, valid, quiet, walk, shapes)

    def input_errors(self, problem: "Problem", values: np.ndarray) -> None:
        """None: of phasors the noise of the voltage is a mode of the noise."""
        return None

    def comparison(self, event: Event, outputs: np.ndarray) -> Playback:
        """Calculated P and Q (2, N) beside those recorded."""
        return Playback.of_power(event, outputs[0], outputs[1])

    def ports(self, event: Event) -> tuple[Port, ...]:
        """The one port of an event: U and P - jQ."""
        return (build_power_port(event),)

    def outputs(self, event: Event, responses: Sequence[Complex]) -> np.ndarray:
        """P and Q (2, N) of a network's response to an event."""
        (i,) = responses
        return np.stack([event.P0 + i.real, event.Q0 - i.imag])

    def better(self, event: Event) -> str:
        """Of records that hold no samples, or too few in a cycle, nothing is said."""
        record = event.record
        if not has_fine_samples(record):
            return ""
        U2 = (
            0.0 if record.U2 is None else float(record.U2[event.start : event.end].max() / event.U0)
        )
        why = describe_smearing(event.duration, U2, record.base.frequency)
        return why and f"fit the sampled waveforms, by domain=waves: the dip of {record.name} {why}"

    def slowest(self, frequency: float) -> float:
        """The lowest sampling rate [Hz] of a planned dip."""
        return 5.0

    def rates(self, frequency: float) -> tuple[float, ...]:
        """Sampling rates [Hz] that a plan tries, whatever the frequency of the grid."""
        return (25.0, 50.0, 100.0, 200.0, 500.0, 1000.0)

    def shape(self, event: Event) -> dict[str, float]:
        """{}: a dip of phasors has neither jump nor unbalance."""
        return {}

    def about_noise(self, faults: Sequence[str], judged: bool) -> str:
        """Where the noise is estimated, and that faults of the measurement are free, in
        sentences.
        """
        return (
            "It is estimated where nothing happens, from what the fit leaves there, and so contains"
            " what smoothing leaves of the voltage's noise. Time skew, measurement window and load"
            " drift are free in every fit, each held by what is physically likely."
        )

    def plan_event(
        self, shape: "DipShape", name: str, t: np.ndarray, course: np.ndarray, start: int, end: int
    ) -> Event:
        """P and Q hold the steady state, for no forecast looks at them."""
        record = Record(
            name,
            t,
            1 - shape.depth * course,
            np.full(len(t), shape.P0),
            np.full(len(t), shape.Q0),
            base=Base(frequency=shape.frequency),
        )
        return Event(
            record=record,
            start=start,
            end=min(end, len(t) - 1),
            depth=shape.depth,
            U0=1.0,
            P0=shape.P0,
            Q0=shape.Q0,
            f0=shape.frequency,
            noise_U=0.0,
            noise_P=shape.noise_P,
            noise_Q=shape.noise_Q,
            steady=slice(0, start),
            dips=1,
        )

    def dip(
        self,
        like: Event,
        step: float,
        course: np.ndarray,
        depth: float,
        jump: float,
        unbalance: float,
    ) -> Excitation:
        still = np.zeros(len(course))
        return Excitation(
            step,
            like.U0 * (1 - depth * course),
            still,
            still,
            like.U0,
            like.P0,
            like.Q0,
            omega_s=np.radians(jump) * np.gradient(course, step),
            omega_n=2 * np.pi * like.record.base.frequency,
            U2=unbalance * depth * like.U0 * course,
            U20=0.0,
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
        unknown = np.full(len(U), np.nan)
        event = Excitation(
            step=float((t[-1] - t[0]) / (len(t) - 1)),
            U=U,
            P=unknown,
            Q=unknown,
            U0=before["U0"],
            P0=before["P0"],
            Q0=before["Q0"],
            omega_s=omega_s,
            omega_s0=omega_s0,
            omega_n=2 * np.pi * before["frequency"],
        )
        outputs = simulate_compared(model, values, Drive.from_events([event]))
        return outputs[0], outputs[1]
