"""The events of an investigation as the load saw them: the voltage's noise smoothed out, a
recorder's window undone.

Waveforms drive a simulation as they were recorded: within a cycle nothing tells noise of the
voltage from the voltage.
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.domain import find_domain
from tractexp.errors import DATA, MODEL, UserError
from tractexp.inference.recorder_window import RecorderWindow
from tractexp.model.model import Model
from tractexp.model.parts import COMPARED, Effect
from tractexp.noise.voltage import SmoothedEvent
from tractexp.record import Event
from tractexp.record.own_base import SMALLEST_BASE


@dataclass(frozen=True, eq=False)
class Records:
    """Events as they were recorded, and as they drive a simulation.

    Attributes
    ----------
    recorded : tuple of Event
        As read.
    smoothed : tuple of SmoothedEvent
        With the noise of the voltage taken out, and the recorder's window undone where it is known.
    window : RecorderWindow or None
        That over which the recorder forms phasors.
    """

    recorded: tuple[Event, ...]
    smoothed: tuple[SmoothedEvent, ...]
    # over which the recorder forms phasors, where that is known
    window: RecorderWindow | None = None

    @classmethod
    def from_events(
        cls, events: Sequence[Event], window: RecorderWindow | None = None
    ) -> "Records":
        """The records of some events.

        Parameters
        ----------
        events : sequence of Event
            As read.
        window : RecorderWindow or None
            That of the recorder: the voltage is sharpened by it. None: it is not known, or there is
            none.

        Returns
        -------
        Records
        """
        driving = tuple(find_domain(e).smooth_event(e) for e in events)
        if window is not None:
            driving = tuple(replace(s, event=window.sharpen_event(s.event)) for s in driving)
        return cls(tuple(events), driving, window)

    @functools.cached_property
    def events(self) -> tuple[Event, ...]:
        """The events with their voltage smoothed: they drive the simulation."""
        return tuple(s.event for s in self.smoothed)


def check_events(train: Sequence[Event], validate: Sequence[Event]) -> None:
    """Check that events can be investigated together.

    Parameters
    ----------
    train, validate : sequences of Event
        Those that are fitted, and those that are held out.

    Raises
    ------
    UserError
        Where an event is in both, and where one has a channel (f or U2) that another lacks.
    """
    held = [e.record.where for e in validate]
    for event in train:
        if event.record.where in held:
            raise UserError(
                f"{event.record.where} is both in {DATA.train} and in {DATA.validate}; hold out"
                " another event"
            )
    for event in (*train, *validate):
        for channel in ("f", "U2"):
            has = getattr(event.record, channel) is not None
            first = train[0]
            if has != (getattr(first.record, channel) is not None):
                one, other = (event, first) if has else (first, event)
                raise UserError(
                    f"{one.record.where} has the channel {channel} and {other.record.where} has"
                    " not: events of one"
                    " investigation need the same channels; remove the column or add it"
                )


def check_channels(model: Model, events: Sequence[Event]) -> None:
    """Raise `UserError` where a part of the model is driven by a channel that an event does not
    have.
    """
    for (channel, part), event in itertools.product(model.reads.items(), events):
        if channel in event.channels or channel in COMPARED:
            continue
        if isinstance(part, Effect):
            what = f"effect '{part.name}'"
            mend = f"leave the effect out of {MODEL.effects}"
        else:
            what = f"{part.group} '{part.name}'"
            mend = f"choose another {part.group}"
        raise UserError(
            f"the {what} reads {channel}, which {event.record.where} does not have; record"
            f" {channel}, or {mend}"
        )


def check_power(events: Sequence[Event]) -> None:
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
