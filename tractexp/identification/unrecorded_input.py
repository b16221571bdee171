"""Inputs of a load that records may lack, and the courses that they may have had."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from tractexp.configuration.plugin import discover, get
from tractexp.inference.problem import Problem
from tractexp.model.model import Model
from tractexp.model.parts import Effect
from tractexp.record import Event
from tractexp.record.window import make_mean_window

# Hz: how far the frequency of a network strays around a fault
FREQUENCY_SWING = 0.2
# of what U falls by: faults of one phase and of two have as much negative sequence
UNBALANCE = 1.0
AVERAGED_CYCLES = 1.0  # over which most recorders form a phasor
# Hz: swings of one machine against others, and of areas against each other (Kundur 1994, ch. 12)
SWINGS = (0.3, 0.7, 1.5)
FALL = 1.0  # s: within which the frequency follows a lost balance of power


@dataclass(frozen=True)
class UnrecordedInput(ABC):
    """An input that events lack, and how far it may have strayed from `at_rest`.

    Attributes
    ----------
    size : float
        How far; 0: it is known to have rested.
    channel : str
        By which events have it.
    setting : str
        Of the task, for `size`.
    remedy : str
        What to record.
    known : str
        What is so where `size` is 0.
    least : float
        Of the sizes, -1 to 1, of what its course is made of.
    """

    size: float
    channel: ClassVar[str]
    setting: ClassVar[str]
    remedy: ClassVar[str]
    known: ClassVar[str]
    least: ClassVar[float]

    @property
    @abstractmethod
    def words(self) -> str:
        """Its size in words, as a table has them."""

    @abstractmethod
    def describe_course(self, strays: float) -> str:
        """A course that strays so far, as a sentence begins."""

    @abstractmethod
    def list_courses(self, event: Event) -> np.ndarray:
        """Courses (k, N) that it may have had, apart from rest, each of its full size."""

    def list_parts(self, event: Event) -> np.ndarray:
        """All that a course is made of, (k, N), each of its full size."""
        return self.list_courses(event)

    def find_rest(self, event: Event) -> float:
        """Its value at rest, in the unit of the channel."""
        return 0.0

    def is_unknown(self, problem: Problem) -> bool:
        """Whether some event of a problem says nothing of it, and may have had another."""
        shipped = any(event.record.is_shipped for event in problem.events)
        return self.is_lacking(problem) and not shipped

    def is_lacking(self, problem: Problem) -> bool:
        """Whether some event of a problem has no channel of it."""
        return problem.domain.lacks(self.channel, problem.events)

    def act_on(self, problem: Problem) -> Problem:
        """The problem whose load it acts on, with the same free parameters; the input rests.

        What reads it already is as it is; else the effects do by which theory lets it act.
        """
        effects = self._find_effects(problem.model)
        events = self._set_courses(problem.events, [np.zeros(1)] * len(problem.events))
        return problem.extend(effects, events) if effects else problem.driven_by(events)

    def drive(self, acted_on: Problem, courses: Sequence[np.ndarray]) -> Problem:
        """The problem of `act_on` whose events have had such courses (N,), apart from rest."""
        return acted_on.driven_by(self._set_courses(acted_on.events, courses))

    def write_course(self, event: Event, course: np.ndarray) -> dict[str, Any]:
        """What the record has, by name, where the course (N,) is that, apart from rest."""
        return {self.channel: self.find_rest(event) + course + np.zeros(event.record.samples)}

    def _set_courses(
        self, events: Sequence[Event], courses: Sequence[np.ndarray]
    ) -> tuple[Event, ...]:
        driven = []
        for event, course in zip(events, courses, strict=True):
            written = self.write_course(event, course)
            driven.append(replace(event, record=replace(event.record, **written)))
        return tuple(driven)

    def _find_effects(self, model: Model) -> list[Effect]:
        """The effects by which theory lets it act on a load."""
        classes = [get("effect", name) for name in sorted(discover().get("effect", {}))]
        effects = [cls() for cls in classes if cls.theory and cls.reads == (self.channel,)]
        return [effect for effect in effects if not model.acceptance(effect).refusal]


@dataclass(frozen=True)
class UnrecordedFrequency(UnrecordedInput):
    """The frequency: it falls after a lost balance of power, and swings, from the dip on."""

    size: float = FREQUENCY_SWING
    channel, setting = "f", "frequency_swing"
    remedy, known = "record f or U_angle", "where it stood still"
    least = -1.0

    @property
    def words(self) -> str:
        """In Hz."""
        return f"{self.size:g} Hz of f"

    def describe_course(self, strays: float) -> str:
        """In Hz from nominal."""
        return f"a frequency that nobody recorded, {strays:.2g} Hz from nominal at most,"

    def find_rest(self, event: Event) -> float:
        """The nominal frequency [Hz]."""
        return event.record.base.frequency

    def list_courses(self, event: Event) -> np.ndarray:
        """A fall and swings, (k, N) [Hz]."""
        t = _measure_time_since_dip(event)
        swings = [np.sin(2 * np.pi * rate * t) for rate in SWINGS]
        return self.size * np.stack([1 - np.exp(-t / FALL), *swings])

    def list_parts(self, event: Event) -> np.ndarray:
        """Those, and swings that begin at an extreme, (k, N) [Hz]."""
        t = _measure_time_since_dip(event)
        late = [1 - np.cos(2 * np.pi * rate * t) for rate in SWINGS]
        return np.concatenate([self.list_courses(event), self.size * np.stack(late)])


@dataclass(frozen=True)
class UnrecordedUnbalance(UnrecordedInput):
    """Negative sequence: in a fault of one phase or of two it is what the positive one falls by."""

    size: float = UNBALANCE
    channel, setting = "U2", "unbalance"
    remedy, known = "record U2 or the three phases", "where the dips were balanced"
    least = 0.0

    @property
    def words(self) -> str:
        """In percent of what the voltage falls by."""
        return f"U2 of {100 * self.size:g} % of the dip"

    def describe_course(self, strays: float) -> str:
        """In pu."""
        return f"an unbalance that nobody recorded, U2 of {strays:.2g} pu at most,"

    def list_courses(self, event: Event) -> np.ndarray:
        """What the voltage falls by during the dip, and no more than is left of it, (1, N) [pu]."""
        U = event.record.U
        fall = np.zeros(len(U))
        during = slice(event.start, event.end)
        fall[during] = np.minimum(np.maximum(event.U0 - U[during], 0.0), U[during])
        return self.size * fall[None]


@dataclass(frozen=True)
class UnrecordedWindow(UnrecordedInput):
    """The recorder's window, through which a model of what happens within a cycle is looked at. Its
    course is its length [s] in each event.
    """

    size: float = AVERAGED_CYCLES
    channel, setting = "window", "averaged_cycles"
    remedy = "say the recorder's window by data.estimator or model.window"
    known = "where the values are of one instant"
    least = 0.0

    @property
    def words(self) -> str:
        """In cycles."""
        return f"a {self.size:g}-cycle window"

    def describe_course(self, strays: float) -> str:
        """In ms."""
        return f"a recorder's window that nobody told, {1000 * strays:.2g} ms long,"

    def list_courses(self, event: Event) -> np.ndarray:
        """Its length throughout, (1, N) [s]."""
        return np.full((1, event.record.samples), self.size / event.record.base.frequency)

    def write_course(self, event: Event, course: np.ndarray) -> dict[str, Any]:
        """A plain mean of that length; none at rest."""
        length = float(course[0])
        return {self.channel: make_mean_window(length) if length > 0 else None}

    def is_lacking(self, problem: Problem) -> bool:
        """Whether the model would be looked at through the window of a record, and it says none."""
        looked_through = problem.domain.windowed and problem.model.motor.within_a_cycle
        return looked_through and not problem.drive.windows


def list_unrecorded_inputs(
    frequency_swing: float = FREQUENCY_SWING,
    unbalance: float = UNBALANCE,
    averaged_cycles: float = AVERAGED_CYCLES,
) -> list[UnrecordedInput]:
    """All inputs that records may lack, straying so far."""
    return [
        UnrecordedFrequency(frequency_swing),
        UnrecordedUnbalance(unbalance),
        UnrecordedWindow(averaged_cycles),
    ]


def _measure_time_since_dip(event: Event) -> np.ndarray:
    return np.maximum(event.record.t - event.t_start, 0.0)
