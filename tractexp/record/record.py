"""A recorded event: the measured voltage and the power the load drew from it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.record.angle import measure_frequency, place_jumps
from tractexp.record.gap import (
    MOST_ROWS,
    SAME_VOLTAGE,
    bridge_values,
    describe_bridged,
    find_lost_rows,
    find_short_gaps,
    insert_missing,
    insert_times,
)
from tractexp.record.waves import Waves
from tractexp.record.window import Window
from tractexp.storage.files import PACKAGE

if TYPE_CHECKING:
    import pandas

LARGEST_JITTER = 0.01  # of a step: times closer than this to a uniform grid count as uniform
# s: at coarser sampling a dip of 100 ms has fewer than two samples, and a transient time constant
# T' of 50 to 300 ms cannot be identified. The slowest phasor units that record dips send 25 per
# second.
LEAST_STEP_OF_MS = 0.5  # s: where steps are longer, t may be in ms
LONGEST_STEP = 0.05
SELDOM = 0.05  # of the steps: where more than these are odd, a simulator chose them
# of a step: a step so close to a multiple of the usual one is of missing rows
WHOLE_STEP_TOLERANCE = 0.02
FEWEST_SAMPLES = 20
PLAUSIBLE_VOLTAGE = (0.5, 1.5)  # pu, at the start of a record
DEAD_VOLTAGE_SHARE = 0.05  # of the voltage at the start: less is no voltage at all
PLAUSIBLE_POWER = 20.0  # pu, at the start of a record
PLAUSIBLE_FREQUENCY = 0.2  # of the nominal one: how far off it is at most, but at a jump
LARGEST_JUMP = 0.5  # turns: what an angle jumps by at most, and so what a peak of f may turn it by
SAME_FRAME = 0.01  # Hz: within it f and the slope of an angle are of one frame
GREATEST_CURRENT = 50.0  # kA, of a load before a dip
# of a base [kV, MVA, Hz]
SIZES = {"voltage": (1e-6, 1500.0), "power": (1e-6, 1e7), "frequency": (0.1, 1e4)}


ONLY_SINGLE = "; only P and Q may have gaps (nan), a single sample of the others is bridged"

DECLARATION, LOAD = "given", "load"


@dataclass(frozen=True)
class Base:
    """The base of per-unit values. Voltage is line-to-line RMS; power is three-phase.

    `origin` says who chose it: "load", the steady state of the load itself before a dip, or
    "given", by a user or by the file. A power of 1 from a user or a file means that nobody said how
    many MVA one per unit is.
    """

    voltage: float = 1.0  # kV
    power: float = 1.0  # MVA
    frequency: float = 50.0  # Hz, nominal
    origin: str = field(default=DECLARATION, compare=False)

    @property
    def in_mva(self) -> bool:
        """Whether the base of a file says how many MVA one per unit of power is."""
        return self.origin == LOAD or self.power != 1.0

    def per_unit(self, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Columns in per unit of this base.

        Parameters
        ----------
        columns : {name: array}
            U and U2 [kV], P and P_3, P_5, ... [MW], Q [Mvar]; others stay as they are.

        Returns
        -------
        {name: array}

        Examples
        --------
        >>> Base(voltage=110.0, power=20.0).per_unit({"U": np.array([99.0]), "P": np.array([10.0])})
        {'U': array([0.9]), 'P': array([0.5])}
        """
        return {name: values / self._one(name) for name, values in columns.items()}

    def absolute(self, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Columns in per unit, converted to kV, MW and Mvar: the inverse of `per_unit`."""
        return {name: values * self._one(name) for name, values in columns.items()}

    def _one(self, name: str) -> float:
        """One per unit of a column, in kV, MW or Mvar; 1 of a frequency or an angle."""
        if name in ("P", "Q") or name.startswith("P_"):
            return self.power
        return self.voltage if name in ("U", "U2") else 1.0


@dataclass(frozen=True, eq=False)
class Record:
    """Positive-sequence voltage and power of one event, P and Q positive when consumed.

    All arrays are sampled uniformly, and finite but for gaps of P and Q.

    Attributes
    ----------
    name : str
        What it is called.
    t : (N,) [s]
        Times.
    U, P, Q : (N,) [pu of `base`]
        Voltage and powers; nan is a gap of P or Q, which counts in no sum.
    f : (N,) or None [Hz]
        Frequency; where `U_angle` is recorded that at which it turns between its jumps.
    U2 : (N,) or None [pu]
        Negative-sequence voltage.
    base : Base
        What one per unit stands for.
    source : str
        Where it came from.
    notes : tuple of str
        What was changed in it or is odd about it, one sentence each.
    window : Window or None
        The averaging window of its phasors; None where no one says it.
    more : {name: (N,)}
        Further channels, which no model reads.
    waves : Waves or None
        The waveforms that it was measured from.
    original_base : Base or None
        That of the file; None where that is `base`.
    identity : {key: text}
        Which load it is: station, device, load, channels.
    digest : str
        SHA-256 of its channels as they were read; "" where they still are that.
    U_angle : (N,) or None [rad]
        The voltage's angle.
    """

    name: str
    t: np.ndarray  # s
    U: np.ndarray  # pu
    P: np.ndarray  # pu
    Q: np.ndarray  # pu
    f: np.ndarray | None = None  # Hz
    U2: np.ndarray | None = None  # pu, negative-sequence voltage
    base: Base = Base()
    source: str = ""
    notes: tuple[str, ...] = ()
    window: Window | None = None
    more: Mapping[str, np.ndarray] = field(default_factory=dict)  # P_3, P_5, ... [pu], THD_u, THD_i
    waves: Waves | None = None  # what the phasors were measured from, where the recorder stored it
    original_base: Base | None = None
    identity: Mapping[str, str] = field(default_factory=dict)
    digest: str = ""
    # rad, not wrapped, in a frame that turns at nominal frequency
    U_angle: np.ndarray | None = None

    def __repr__(self) -> str:
        """Name, samples, channels, span and rate in one line."""
        span = f"{self.samples} samples of {', '.join(self.channels)}"
        return f"{self.name}: {span}, {self.t[0]:.3f} to {self.t[-1]:.3f} s, {self.rate:.0f} Hz"

    def to_frame(self) -> "pandas.DataFrame":
        """A pandas frame of what a model reads: t [s], U, P, Q and, where recorded, f [Hz], U2 and
        U_angle [rad], per unit of `base`.
        """
        import pandas

        return pandas.DataFrame(self.channels)

    @property
    def samples(self) -> int:
        """How many samples it has, N."""
        return len(self.t)

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return 1 / self.step

    @property
    def file_base(self) -> Base:
        """The base in which its file was."""
        return self.original_base or self.base

    @property
    def is_shipped(self) -> bool:
        """Whether it lies in an installed package: then it was made, and nothing happened that it
        does not hold.
        """
        return self.source.startswith(PACKAGE)

    @property
    def is_from_field(self) -> bool:
        """Whether it says how many kV and MVA its load takes, as records of instruments do."""
        return self.file_base.in_mva and not self.is_shipped

    @property
    def where(self) -> str:
        """The record's name in messages: its source, else its name."""
        return self.source or self.name

    @property
    def channels(self) -> dict[str, np.ndarray]:
        """The arrays present, by name, time first."""
        every = {"t": self.t, "U": self.U, "P": self.P, "Q": self.Q, "f": self.f, "U2": self.U2}
        every["U_angle"] = self.U_angle
        return {name: values for name, values in every.items() if values is not None}

    def part(self, window: slice) -> "Record":
        """Some of its samples, as a record."""
        channels = {name: values[window] for name, values in self.channels.items()}
        return replace(
            self, more={name: values[window] for name, values in self.more.items()}, **channels
        )

    def check(self, place: Callable[[int], str] | None = None) -> "Record":
        """Return the record; raise `UserError` with the source, the place and the value of what is
        wrong.

        `place(i)` says where sample i stands in the file ("line 17"); by default sample and time
        are named.
        """
        place = place or self._place
        self._check_values(place)
        self._check_times(place)
        self._check_per_unit()
        return self

    def uniform(self, place: Callable[[int], str] | None = None) -> "Record":
        """The record on a uniform time grid.

        Single missing rows and voltages are bridged, and a few in a row of a steady voltage.
        Jitter, and the event instants and steps of a simulator, are resampled linearly; of two rows
        of one time the second holds from then on.

        Parameters
        ----------
        place : int -> str
            Says where sample i stands in the file; None: by sample and time.

        Returns
        -------
        Record
            A note says so where more than `LARGEST_JITTER` of a step was moved.

        Raises
        ------
        UserError
            For more missing rows: steps that are multiples of the usual one.
        """
        given = place or self._place
        if any(values.shape != self.t.shape for values in self.channels.values()):
            self._check_values(given)
        rows = self._find_lost_rows()
        return (
            self._with_rows(rows)
            ._bridge()
            ._even_out(lambda i: given(i - int(np.searchsorted(rows + np.arange(len(rows)), i))))
            ._turn()
        )

    def _turn(self) -> "Record":
        """The record with the frequency at which its angle turns between jumps.

        Where f alone was recorded, its peaks at jumps of the voltage are jumps of an angle. Where f
        says that the angle turns in another frame than that of the nominal
        frequency, a note says so and the angle is left out.
        """
        if self.U_angle is None:
            turned = self.f is not None and place_jumps(
                self.f, self.U, self.step, self.base.frequency
            )
            return replace(self, U_angle=turned[0], f=turned[1]) if turned else self
        f = measure_frequency(self.U_angle, self.step, self.base.frequency)
        if self.f is None or abs(float(np.median(f - self.f))) < SAME_FRAME:
            return replace(self, f=f)
        note = (
            f"U_angle turns as at {np.median(f):.5g} Hz where f is {np.median(self.f):.5g} Hz: it"
            f" is no angle in a frame of {self.base.frequency:g} Hz, and f is used without it"
        )
        return replace(self, U_angle=None, notes=(*self.notes, note))

    def _find_lost_rows(self) -> np.ndarray:
        """The numbers (K,) of the rows before which rows are missing that can be bridged."""
        rows = find_lost_rows(self.t, MOST_ROWS)
        at = rows + np.arange(len(rows))
        bridged = self._with_rows(rows)._find_bridged()
        return rows if np.isin(at, bridged).all() else rows[:0]

    def _find_bridged(self) -> np.ndarray:
        """The samples (K,) of which what drives a model is missing and bridged: single ones, and a
        few in a row where the voltage is the same on either side.
        """
        lacking = np.any(np.isnan(np.stack([*self._drives.values()])), axis=0)
        at = find_short_gaps(lacking, MOST_ROWS)
        there = np.flatnonzero(~lacking)
        near = np.searchsorted(there, at)
        before, after = (there[near - 1], there[near]) if len(at) else (at, at)
        alike = np.abs(self.U[after] - self.U[before]) < SAME_VOLTAGE * self.U[before]
        return at[(after - before == 2) | alike]

    @property
    def _drives(self) -> dict[str, np.ndarray]:
        """The channels that drive a model."""
        return {name: x for name, x in self.channels.items() if name not in ("t", "P", "Q")}

    def _with_rows(self, rows: np.ndarray) -> "Record":
        """The record with rows that are missing (nan) before each of `rows` (K,)."""
        if not len(rows):
            return self
        channels = {name: insert_missing(x, rows) for name, x in self.channels.items()}
        channels["t"] = insert_times(self.t, rows)
        more = {name: insert_missing(x, rows) for name, x in self.more.items()}
        return replace(self, **channels, more=more)

    def _bridge(self) -> "Record":
        """The record with what drives a model bridged where a sample of it is missing.

        P and Q are not invented: of these samples they are in no sum.
        """
        at = self._find_bridged()
        if not len(at):
            return self
        lacking = {name: x for name, x in self._drives.items() if np.isnan(x[at]).any()}
        channels = {name: bridge_values(x, at) for name, x in lacking.items()}
        gaps = np.isin(np.arange(self.samples), at)
        channels |= {name: np.where(gaps, np.nan, self.channels[name]) for name in "PQ"}
        note = f"{describe_bridged(self.t[at].tolist())}: bridged, and in no sum of P and Q"
        return replace(self, **channels, notes=(*self.notes, note))

    def _even_out(self, place: Callable[[int], str]) -> "Record":
        """The record on a uniform grid."""
        self._check_values(place, still=True)
        grid = np.linspace(self.t[0], self.t[-1], len(self.t))
        off = float(np.abs(self.t - grid).max() / self.step)
        if off == 0:
            return self
        if off <= LARGEST_JITTER:
            return replace(self, t=grid)
        steps = np.diff(self.t)
        usual = float(np.median(steps[steps > 0]))
        self._check_steps(steps, usual, place)
        if (np.abs(steps - usual) > 0.5 * usual).any():
            grid = self._grid(steps, usual)
            note = self._uneven(steps, usual)
        else:
            note = (
                f"times were up to {100 * off:.2g} % of a step off a uniform grid: resampled"
                " linearly"
            )
        moved = {name: np.interp(grid, self.t, values) for name, values in self.channels.items()}
        moved["t"] = grid
        more = {name: np.interp(grid, self.t, values) for name, values in self.more.items()}
        return replace(self, **moved, more=more, notes=(*self.notes, note))

    def _grid(self, steps: np.ndarray, usual: float) -> np.ndarray:
        """Uniform times by the usual step. What a simulator writes the instant of jumps halfway
        between two of them: there a curve through the samples has it.
        """
        instants = self.t[1:][steps < 0.5 * usual]
        late = (instants[:1] - self.t[0]) / usual - 0.5
        first = self.t[0] + usual * float(np.mod(late, 1.0).sum())
        return first + usual * np.arange(int((self.t[-1] - first) / usual + 1e-6) + 1)

    def _check_steps(self, steps: np.ndarray, usual: float, place: Callable[[int], str]) -> None:
        """Refuse rows that are missing, and times that stand still other than at an event."""
        still = steps == 0
        if still.mean() > SELDOM:
            i = int(np.argmax(still)) + 1
            raise UserError(
                f"{self.where}: {place(i)}: time does not increase: t = {self.t[i]:.9g} s after"
                f" {self.t[i - 1]:.9g} s, and so at {np.count_nonzero(still)} rows: t has too few"
                " digits; write it with more"
            )
        ratio = steps / usual
        long = ratio > 1.5
        multiple = long & (np.abs(ratio - np.round(ratio)) < WHOLE_STEP_TOLERANCE * ratio)
        seldom = (np.abs(ratio - 1) > 0.5).mean() < SELDOM
        if not long.any() or not (seldom or multiple.sum() > 0.9 * long.sum()):
            return
        i = int(np.argmax(long)) + 1
        if i > 1 and still[i - 2]:
            raise UserError(
                f"{self.where}: {place(i - 1)}: time does not increase: t = {self.t[i - 1]:.9g} s"
                f" after {self.t[i - 2]:.9g} s, and a step of {steps[i - 1]:g} s follows where"
                f" {usual:g} s is usual"
            )
        more = int(np.count_nonzero(long)) - 1
        places = f" here and at {more} more {'places' if more > 1 else 'place'}" if more else ""
        raise UserError(
            f"{self.where}: {place(i)}: t advances by {steps[i - 1]:g} s where {usual:g} s is"
            f" usual: rows are missing{places}; fill them in (P and Q may be nan, U may not) or cut"
            " the record there"
        )

    def _uneven(self, steps: np.ndarray, usual: float) -> str:
        """The note on times that a simulator chose."""
        short, long = (
            int(np.count_nonzero(steps < 0.5 * usual)),
            int(np.count_nonzero(steps > 1.5 * usual)),
        )
        if not long:
            rows = "1 row lies" if short == 1 else f"{short} rows lie"
            what = f"{rows} between the usual ones, as a simulator writes the instants of events"
        else:
            what = (
                f"times are uneven (steps of {steps.min():.3g} to {steps.max():.3g} s), as a"
                " simulator chooses them"
            )
        return f"{what}: resampled linearly every {usual:.6g} s"

    def _place(self, i: int) -> str:
        """ "sample 12 (t = 0.011 s)", for sentences."""
        return f"sample {i + 1} (t = {self.t[i]:g} s)"

    def _check_values(self, place: Callable[[int], str], still: bool = False) -> None:
        """Refuse what is no record; times may stand `still` where the record is to be resampled."""
        n = self.samples
        for name, values in (*self.more.items(), *self.channels.items()):
            if values.shape != (n,):
                raise UserError(
                    f"{self.where}: {name} has shape {values.shape} where t has {n} samples"
                )
        self._check_finite(place)
        if n < FEWEST_SAMPLES:
            raise UserError(
                f"{self.where}: only {n} samples; a record needs at least {FEWEST_SAMPLES}"
            )
        back = np.diff(self.t) < 0 if still and self.t[-1] > self.t[0] else np.diff(self.t) <= 0
        if back.any():
            i = int(np.argmax(back)) + 1
            raise UserError(
                f"{self.where}: {place(i)}: time does not increase: t = {self.t[i]:.9g} s after"
                f" {self.t[i - 1]:.9g} s"
            )
        if (self.U <= 0).any():
            i = int(np.argmax(self.U <= 0))
            raise UserError(
                f"{self.where}: {place(i)}: U = {self.U[i]:g}, but voltage must be above zero"
                " everywhere; without it no load draws power: give the rows before it, or after it,"
                " as a file of their own"
            )

    def _check_finite(self, place: Callable[[int], str]) -> None:
        """Raise `UserError` for a value that is no number, but for gaps of P and Q."""
        for name, values in self.channels.items():
            may_lack = name in ("P", "Q")
            bad = np.isinf(values) if may_lack else ~np.isfinite(values)
            if bad.any():
                i = int(np.argmax(bad))
                gap = "" if may_lack else ONLY_SINGLE
                raise UserError(
                    f"{self.where}: {place(i)}: {name} = {values[i]} is not a finite number{gap}"
                )
            if np.isnan(values).all():
                raise UserError(f"{self.where}: {name} holds no number at all")

    def _check_times(self, place: Callable[[int], str]) -> None:
        """Raise `UserError` for times that are not even, or a record shorter than a cycle."""
        off = np.abs(self.t - np.linspace(self.t[0], self.t[-1], self.samples)) / self.step
        if off.max() > LARGEST_JITTER:
            i = int(np.argmax(off))
            raise UserError(
                f"{self.where}: {place(i)}: sampling is not uniform: t = {self.t[i]:.9g} s is"
                f" {100 * off[i]:.2g} % of a step off the uniform grid; at most"
                f" {100 * LARGEST_JITTER:g} % is allowed"
            )
        span = self.samples * self.step
        if span < 1 / self.base.frequency:
            raise UserError(
                f"{self.where}: the record lasts {span:.3g} s, less than one cycle of"
                f" {self.base.frequency:g} Hz; t must be in seconds, or its heading say its unit"
            )
        if self.step > LONGEST_STEP:
            in_ms = self.step >= LEAST_STEP_OF_MS
            hint = (
                f"; t must be in seconds (where it is in ms: {DATA.units}={{t: ms}}; where it"
                f" counts samples, the time of one: {DATA.units}={{t: '20 ms'}})"
            )
            raise UserError(
                f"{self.where}: one sample every {self.step:.3g} s is too coarse: a motor answers a"
                f" dip within 50 to 300 ms, so at least {1 / LONGEST_STEP:g} samples per second are"
                f" needed{hint if in_ms else ''}"
            )

    def _check_per_unit(self) -> None:
        """Raise `UserError` for a voltage or power that cannot be per unit, with the setting that
        mends it.
        """
        low, high = PLAUSIBLE_VOLTAGE
        U = float(np.median(self.U[:FEWEST_SAMPLES]))
        if not low <= U <= high:
            raise UserError(
                f"{self.where}: U starts at {U:g}, which is not per unit ({low:g} to {high:g} is"
                f" expected); if it is in V or kV, say so, {DATA.units}={{U: V}}, or give the base"
                f" as {DATA.base_voltage} (kV, line to line)"
            )
        S = float(np.nanmax(np.abs([self.P, self.Q])))
        if S > PLAUSIBLE_POWER:
            raise UserError(
                f"{self.where}: P or Q reaches {S:g}, which is not per unit (up to"
                f" {PLAUSIBLE_POWER:g} is expected); if it is in kW or MW, say so,"
                f" {DATA.units}={{P: kW, Q: kvar}}, or give the base as {DATA.base_power} (MVA)"
            )
        self._check_frequency(DEAD_VOLTAGE_SHARE * U)

    def _check_frequency(self, dead: float) -> None:
        """Refuse a frequency that is none, at a voltage above `dead`; below it only noise turns.

        A jump of the angle is a peak of f that turns it by half a turn at most.
        """
        if self.f is None:
            return
        off = np.where(dead < self.U, self.f - self.base.frequency, 0.0)
        odd = np.abs(off) > PLAUSIBLE_FREQUENCY * self.base.frequency
        begins = np.flatnonzero(np.diff(odd, prepend=False) & odd)
        stretches = np.split(np.where(odd, np.abs(off), 0.0), begins)[1:]
        turned = [float(stretch.sum()) * self.step for stretch in stretches]
        if max(turned, default=0.0) > LARGEST_JUMP:
            i = int(begins[int(np.argmax(turned))])
            raise UserError(
                f"{self.where}: {self._place(i)}: f = {self.f[i]:g} is more than"
                f" {100 * PLAUSIBLE_FREQUENCY:.0f} % off the nominal {self.base.frequency:g} Hz at"
                f" a voltage of {self.U[i]:.3g}; f must be in Hz; say its unit, {DATA.units}={{f:"
                f" mHz}}, the nominal frequency, {DATA.frequency}=60, or leave f out,"
                f" {DATA.columns}={{f: null}}"
            )
