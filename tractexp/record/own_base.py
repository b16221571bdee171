"""Records on the base of their own load, whatever unit of power their files are in.

Bounds and priors of a model mean a load that draws about one per unit. A record in per unit of a
system (100 MVA) is therefore fitted per unit of the apparent power before the first dip that is
fitted, and so are all events beside it. A load that draws between a half and one of its per unit is
on a base of its own, its rating: there the bounds mean what they say, and its user knows the values
on that base.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from tractexp.cache.provenance import hash_record
from tractexp.errors import DATA, UserError
from tractexp.record.event import Event, detect
from tractexp.record.record import DECLARATION, LOAD, Base, Record
from tractexp.record.wave_event import WaveEvent, convert_to_waves

# pu before the dip, on a base of the load: bounds reach to a torque of one
LEAST_S, MOST_P = 0.5, 1.05
SMALLEST_BASE = 1e-6  # pu: less apparent power is no load, and no base

Scalable = TypeVar("Scalable", float, np.ndarray)


@dataclass(frozen=True)
class OwnBase:
    """The base of power that a load is fitted on, and that of its file, both in MVA or in the
    file's per unit.
    """

    power: float = 1.0
    file_power: float = 1.0
    in_mva: bool = False  # whether these are MVA
    origin: str = DECLARATION  # of the file's base

    @classmethod
    def from_record(cls, record: Record) -> "OwnBase":
        """The base of a record."""
        file = record.file_base
        return cls(record.base.power, file.power, file.in_mva, file.origin)

    @classmethod
    def from_event(cls, event: Event) -> "OwnBase":
        """The base for a first fitted event: its power before the dip, or its present base if that
        is its own.
        """
        at, S = cls.from_record(event.record), float(np.hypot(event.P0, event.Q0))
        own = event.record.base.origin == LOAD or (S >= LEAST_S and abs(event.P0) <= MOST_P)
        return at if own or not S > SMALLEST_BASE else replace(at, power=S * at.power)

    @property
    def ratio(self) -> float:
        """How many per units of the file one of this base is."""
        return self.power / self.file_power

    def compute_ratio(self, record: Record) -> float:
        """How many per units of a record one of this base is.

        A record of which nobody said how many MVA its per unit is, is taken to be in the unit of
        this one's file, and the other way round. Bases that were each the steady state of a load
        stay beside each other.
        """
        file = record.file_base
        if self.origin == file.origin == LOAD:
            return 1.0
        if self.in_mva != file.in_mva:
            return self.ratio / (record.base.power / file.power)
        return self.power / record.base.power

    def convert_event(self, event: Event) -> Event:
        """The event on this base; itself where it is on it."""
        ratio = self.compute_ratio(event.record)
        return event if ratio == 1 else convert_base(event, ratio, self)

    @property
    def file(self) -> str:
        """The file's base, in words."""
        return f"the file's base ({self.file_power:.6g} MVA)" if self.in_mva else "the file's base"

    def values(self, values: Mapping[str, float], exponents: Mapping[str, int]) -> dict[str, float]:
        """Parameters by name, or by name and event as `T_m[1]`, on the file's base."""
        return {
            name: scale_parameter(value, exponents[name.partition("[")[0]], self.ratio)
            for name, value in values.items()
        }

    def __str__(self) -> str:
        """ "36 MVA", or per unit of the file where no MVA are known."""
        return f"{self.power:.4g} MVA" if self.in_mva else f"{self.power:.4g} pu of the file"


def rebase_events(events: Sequence[Event]) -> list[Event]:
    """Events of one call, the first one fitted, all on the base of the load in that.

    Raises `UserError` where they must be rebased and some of them do not say how many MVA one per
    unit is.
    """
    if not events:
        return []
    first, own = events[0].record, OwnBase.from_event(events[0])
    for event in events:
        record = event.record
        if own.power != first.base.power and record.file_base.in_mva != own.in_mva:
            which, other = (first, record) if own.in_mva else (record, first)
            raise UserError(
                f"{other.where} does not say how many MVA one per unit is, and {which.where} is per"
                f" unit of {which.file_base.power:g} MVA, so that they cannot be put on one base;"
                f" say it of both ({DATA.base_power} in MVA, with {DATA.units}={{P: pu, Q: pu}}),"
                " or of none"
            )
    return [own.convert_event(event) for event in events]


def convert_base(event: Event, ratio: float, own: OwnBase) -> Event:
    """An event on a base of `ratio` times the power.

    Parameters
    ----------
    event : Event
        As it is.
    ratio : float
        The new base over the present one.
    own : OwnBase
        What the new base is called in the note.

    Returns
    -------
    Event
        Its voltages, times and frequencies are as before.
    """
    if isinstance(event, WaveEvent):  # its currents are per unit of the record's base
        return convert_to_waves(convert_base(event.phasors, ratio, own))
    record = event.record
    by, base = Base(1.0, ratio), replace(record.base, power=ratio * record.base.power, origin=LOAD)
    arrays = by.per_unit({"P": record.P, "Q": record.Q})
    note = (
        f"put on a base of {own}, the apparent power before the first dip that is fitted: on"
        f" {own.file} powers, torque and inertia are {own.ratio:.5g} times, impedances"
        f" {1 / own.ratio:.5g} times the values on this base"
    )
    return detect(
        replace(
            record,
            base=base,
            original_base=record.file_base,
            digest=hash_record(record),
            more=by.per_unit(record.more),
            notes=(*record.notes, *([note] if record.original_base is None else [])),
            **arrays,
        )
    )


def scale_parameter(value: Scalable, power_exponent: int, ratio: float) -> Scalable:
    """The value of a parameter on a base of a `ratio`-th of the power.

    Powers, torques and inertias have the exponent 1, impedances -1, times and ratios 0.

    Examples
    --------
    >>> scale_parameter(0.5, 1, 2.0), scale_parameter(0.5, -1, 2.0)
    (1.0, 0.25)
    """
    return value * ratio**power_exponent
