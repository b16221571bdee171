"""A domain: what a model is compared with, and all that follows from it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tractexp.domain.playback import Playback
from tractexp.domain.port import Complex, Port
from tractexp.errors import UserError
from tractexp.model.drive import OUTPUTS, Drive, Excitation, WaveformDrive
from tractexp.model.model import Model
from tractexp.noise import Noise
from tractexp.noise.random_walk import RandomWalk
from tractexp.noise.voltage import SmoothedEvent
from tractexp.record import Event

if TYPE_CHECKING:
    from tractexp.identification.plan import DipShape
    from tractexp.inference.problem import Problem


@dataclass(frozen=True)
class DipGrid:
    """Dips that might be recorded next: durations [s] that are tried, edges [s], time before and
    from the start on.
    """

    durations: tuple[float, ...]
    edge: float
    lead: float
    length: float


class Domain(ABC):
    """The kind of outputs a model is compared by: the power of phasors, or sampled currents. See
    `tractexp.domain`.
    """

    name: ClassVar[str]  # as a setting says it
    setting: ClassVar[str]  # what a command needs to choose it, with a space behind it
    compared: ClassVar[str]  # in a sentence
    epsilons: ClassVar[tuple[str, ...]]  # relative errors of each event, as result.json has them
    # integration
    finest: ClassVar[float]  # pu, largest error of the automatic Runge-Kutta step
    probed: ClassVar[float]  # share of the candidates across the box on which that is judged
    # s after a dip until when: a stalled motor runs away ever faster, for ever finer steps
    aftermath: ClassVar[float]
    stiff: ClassVar[bool]  # whether some candidates of the box diverge at any step, and are refused
    # noise
    quiet_order: ClassVar[int]  # of an autoregression of the few samples before a dip
    # whether its color follows from the model, and only its size from the records
    noise_from_model: ClassVar[bool]
    # records
    # whether samples are averages over a recorder's window, which may have to be searched
    windowed: ClassVar[bool]
    # investigation
    calibrated: ClassVar[bool]  # whether criteria were calibrated with members of families
    # whether a dip that nobody recorded can be made a record and fitted beside others
    recordable: ClassVar[bool]
    # planning
    edge: ClassVar[float]  # s, fall and rise of a planned dip
    # channels that a jump of the phase and an unbalance have to be recorded with
    further: ClassVar[Mapping[str, str]]
    # what a planned dip has beside depth, duration, rate and noise
    shaped_by: ClassVar[tuple[str, ...]]
    planned_noise: ClassVar[str]  # what the noise of a plan is
    dips: ClassVar[DipGrid]  # that might be recorded next

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of what is compared."""
        return OUTPUTS[self.name]

    @abstractmethod
    def event(self, event: Event) -> Event:
        """An event as a model is compared with it.

        Parameters
        ----------
        event : Event
            In phasors or waveforms.

        Returns
        -------
        Event

        Raises
        ------
        UserError
            Where the domain needs samples that the record does not have.
        """

    def events(self, events: Sequence[Event]) -> tuple[Event, ...]:
        """Several events as a model is compared with them."""
        return tuple(map(self.event, events))

    @abstractmethod
    def excitation(
        self, event: Event, model: Model | None = None, weights: tuple[float, float] = (1.0, 1.0)
    ) -> Excitation | WaveformDrive:
        """The inputs of a simulation, and what it is compared with.

        Parameters
        ----------
        event : Event
            Of this domain.
        model : Model or None
            What is simulated: it may be looked at through the recorder's window.
        weights : (float, float)
            Of the squared errors of P and of Q.

        Returns
        -------
        Excitation or WaveformDrive
        """

    def lacks(self, channel: str, events: Sequence[Event]) -> bool:
        """Whether nothing recorded says what an input was in one of the events."""
        return False

    @abstractmethod
    def smooth_event(self, event: Event) -> SmoothedEvent:
        """The event with the noise taken out of its voltage, where that can be told from it."""

    @abstractmethod
    def steady(self, events: Sequence[Event], drive: Drive) -> list[slice]:
        """The samples of the drive whose means are P0 and Q0 of each event; [] where those are not
        compared.
        """

    @abstractmethod
    def longest_step(self, events: Sequence[Event], substeps: np.ndarray) -> float:
        """The Runge-Kutta step [s] that is fine enough for dips like these events, which took
        `substeps` (E,) per sample.
        """

    @abstractmethod
    def values(self, drive: Drive) -> int:
        """The number of values of a drive that are judged."""

    @abstractmethod
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
        """The noise of what a fit leaves.

        Parameters
        ----------
        residual : (C, N) [pu]
            What it leaves.
        valid : (C, N) bools
            Which samples count.
        quiet : sequence of slice
            Where little happens.
        problem : Problem
            The model on its events.
        values : (d,)
            Its free values.
        walk : (C, C) -> RandomWalk or None
            How the load wanders, in channels mixed by a matrix.
        shapes : (k, C, N) [pu] or None
            What errors of the record do.

        Returns
        -------
        Noise

        Raises
        ------
        UserError
            Where too few samples are quiet.
        """

    @abstractmethod
    def input_errors(self, problem: "Problem", values: np.ndarray) -> np.ndarray | None:
        """The errors of the record beside the voltage's noise, as what is compared shows them.

        Parameters
        ----------
        problem : Problem
            The model on its events.
        values : (d,)
            Its free values.

        Returns
        -------
        (k, C, N) array [pu] or None
            One standard deviation each; None where there are none.
        """

    @abstractmethod
    def comparison(self, event: Event, outputs: np.ndarray) -> Playback:
        """The calculated outputs (C, N) [pu] of an event beside what was recorded."""

    @abstractmethod
    def ports(self, event: Event) -> tuple[Port, ...]:
        """Voltage and current of an event of this domain, as a linear network sees them."""

    @abstractmethod
    def outputs(self, event: Event, responses: Sequence[Complex]) -> np.ndarray:
        """The compared channels (C, N) [pu], by the response of a linear network.

        Parameters
        ----------
        event : Event
            Of this domain.
        responses : (N,) complex [pu] for each port
            Deviations of the currents.

        Returns
        -------
        (C, N) array [pu]
        """

    @abstractmethod
    def better(self, event: Event) -> str:
        """Why another domain shows more of an event, as a sentence; "" where none does."""

    @abstractmethod
    def slowest(self, frequency: float) -> float:
        """The lowest sampling rate [Hz] of a planned dip in a grid of this frequency [Hz]."""

    @abstractmethod
    def rates(self, frequency: float) -> tuple[float, ...]:
        """Sampling rates [Hz] that a plan tries in a grid of this frequency [Hz]."""

    @abstractmethod
    def shape(self, event: Event) -> dict[str, float]:
        """{name: value} of what `shaped_by` names, measured on a recorded event."""

    def describe_shape(self, shape: "DipShape") -> str:
        """The end of a sentence on the shape of a planned dip."""
        return ""

    @property
    def edges(self) -> str:
        """A clause on how a planned dip falls and comes back."""
        return f"straight edges of {1000 * self.edge:g} ms"

    @abstractmethod
    def about_noise(self, faults: Sequence[str], judged: bool) -> str:
        """Where noise is estimated, and how faults of the measurement are free in every fit, in
        sentences.

        `judged` says whether noise would not pass for these faults.
        """

    @abstractmethod
    def plan_event(
        self, shape: "DipShape", name: str, t: np.ndarray, course: np.ndarray, start: int, end: int
    ) -> Event:
        """A dip as if it had been recorded at times t (N,) [s], `course` (N,) of it
        there: 0 to 1.
        """

    @abstractmethod
    def dip(
        self,
        like: Event,
        step: float,
        course: np.ndarray,
        depth: float,
        jump: float,
        unbalance: float,
    ) -> Excitation | WaveformDrive:
        """The inputs of a dip at the power before a recorded event.

        Parameters
        ----------
        like : Event
            Whose power and voltage before it are taken.
        step : float [s]
            Between samples.
        course : (N,)
            How much of the dip is there: 0 to 1.
        depth : float
            Share by which the voltage falls.
        jump : float [degrees]
            By which its phase turns.
        unbalance : float
            Negative sequence over the depth.

        Returns
        -------
        Excitation or WaveformDrive
        """

    @abstractmethod
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
        """The power that a load draws from a given voltage.

        Parameters
        ----------
        model : Model
            The equations of the load.
        values : (p,)
            All its parameters.
        t : (N,) [s]
            Uniform times.
        U : (N,) [pu]
            Voltage.
        before : mapping
            `U0`, `P0` and `Q0` [pu] before, and the nominal `frequency` [Hz].
        omega_s : (N,) or None [rad/s]
            Synchronous speed relative to nominal.
        omega_s0 : float [rad/s]
            That before.

        Returns
        -------
        (N,) array [pu]
            P.
        (N,) array [pu]
            Q.

        Raises
        ------
        UserError
            Where there is no steady state.
        """


def simulate_compared(model: Model, values: np.ndarray, drive: Drive) -> np.ndarray:
    """The compared channels (C, N) [pu] of one candidate, by as many Runge-Kutta steps as it takes.

    Parameters
    ----------
    model : Model
        The equations of the load.
    values : (p,)
        All its parameters.
    drive : Drive
        The inputs.

    Returns
    -------
    (C, N) array [pu]

    Raises
    ------
    UserError
        Where there is no steady state.
    """
    if refusal := model.refusal(values, drive):
        raise UserError(refusal)
    return model.simulate(drive, values, model.substeps(drive, values)[0]).outputs[:, 0]
