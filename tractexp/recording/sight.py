"""One load that a file shows: its channels, phasors and events."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tractexp.record import Event, Record
from tractexp.record.phasor import Phasors
from tractexp.recording.event_kind import OF_LOADS
from tractexp.recording.feeder import Feeder
from tractexp.recording.happening import Happening
from tractexp.recording.type_test import TypeTest


@dataclass(frozen=True)
class LoadEvent:
    """One event of a load, and the record that a reader cuts out of it."""

    what: Happening
    dip: int | None = None  # its number in the reader
    event: Event | None = None  # what would be fitted
    why: str = ""  # what makes it (not) worth fitting, one sentence

    @property
    def worth(self) -> bool:
        """Whether it is worth fitting, and a reader makes a record of it."""
        return self.what.worth and self.event is not None


def _select_before(changes: Sequence[Happening], phasors: Phasors) -> np.ndarray | slice:
    """The phasors after the last change of a load before the first event that is none; the first
    one where there are none.
    """
    loud = [what for what in changes if what.kind not in OF_LOADS]
    stop = min((what.start for what in (loud or changes)[:1]), default=np.inf)
    begin = max((what.end for what in changes if what.end < stop), default=-np.inf)
    before = np.flatnonzero((phasors.t > begin) & (phasors.t < stop))
    return before if len(before) else slice(0, 1)


def _find_first_powers(record: Record) -> tuple[float, float, float]:
    """Voltage [kV], P [MW] and Q [Mvar] at the beginning of a record; nan of what it has not."""
    first = slice(0, max(1, record.samples // 20))
    rows = (record.U[first], record.P[first], record.Q[first])
    known = (row[np.isfinite(row)] for row in rows)
    U, P, Q = (float(np.median(row)) if len(row) else float("nan") for row in known)
    return U * record.base.voltage, P * record.base.power, Q * record.base.power


@dataclass(frozen=True, eq=False)
class Sight:
    """One load that a file shows: its channels and their phasors by segment, or the record that the
    file is.
    """

    name: str
    events: tuple[LoadEvent, ...] = ()
    feeder: Feeder | None = None
    phasors: tuple[Phasors, ...] = ()
    record: Record | None = None
    # why nothing can be said of what happened to it, one sentence; "" where it was examined
    unexamined: str = ""
    dead_phases: str = ""  # of its voltages without any from first to last, in words
    secondary: bool = False  # its values are secondary, of an unknown ratio: no kV, no MW
    said: tuple[str, ...] = ()  # why parts of it could not be analysed, one sentence each
    type_test: TypeTest | None = None  # what a motor's start or trip tells without a fit
    # by which a reader reads it, without the dips
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_loaded(self) -> bool:
        """Whether it draws more than noise; a record does."""
        return self.feeder is None or self.feeder.loaded

    @property
    def terminals(self) -> tuple[tuple[int, ...], Any] | None:
        """The channels of its voltages and how they are connected; None of a record."""
        return self.feeder and (self.feeder.voltages, self.feeder.connection)

    @property
    def has_powers(self) -> bool:
        """Whether more than a voltage is known of it."""
        if self.record is not None:
            return bool(np.isfinite(self.record.P).any())
        return self.feeder is not None and bool(self.feeder.currents)

    @property
    def dips(self) -> list[int]:
        """The numbers of the dips that are worth fitting."""
        return [s.dip for s in self.events if s.worth and s.dip is not None]

    def choice(self) -> dict[str, Any] | None:
        """The reader's settings that fit what is worth it, first dip first, others held out; None
        where nothing is.
        """
        if not any(s.worth for s in self.events):
            return None
        return {
            **self.settings,
            **({"train": self.dips[:1], "validate": self.dips[1:]} if self.dips else {}),
        }

    @property
    def per_unit(self) -> bool:
        """Whether U, P and Q are per unit of an unknown base, not in kV, MW and Mvar."""
        return self.record is not None and self.record.base.voltage == self.record.base.power == 1

    def powers(self) -> tuple[float, float, float] | None:
        """Voltage [kV], P [MW] and Q [Mvar] before the dip that is worth fitting, else before the
        first event.

        Of a load's own steps, what it draws after the last before that. None without measurements.
        """
        fitted = next((each.event for each in self.events if each.worth), None)
        if fitted is not None:
            base = fitted.record.base
            return fitted.U0 * base.voltage, fitted.P0 * base.power, fitted.Q0 * base.power
        if self.record is not None:
            return _find_first_powers(self.record)
        if not self.phasors:
            return None
        p = self.phasors[0]
        before = _select_before([each.what for each in self.events], p)
        if self.feeder is not None and not self.feeder.currents:
            return float(np.median(p.U[before])), float("nan"), float("nan")
        return tuple(float(np.median(v[before])) for v in (p.U, np.real(p.S), np.imag(p.S)))  # type: ignore[return-value]
