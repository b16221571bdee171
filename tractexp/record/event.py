"""The event inside a record: where the dip is, what came before it, and how noisy the
recording is.
"""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tractexp.cache.provenance import hash_record
from tractexp.errors import UserError
from tractexp.record.aftermath import cut_at_change, describe_loss
from tractexp.record.direction import explain_negative_power
from tractexp.record.fall import FEWEST_BEFORE, STEADY, find_falls
from tractexp.record.no_dip import explain_no_dip, explain_no_such_dip
from tractexp.record.record import Record
from tractexp.record.steadiness import is_at_rest, keep_steady_part
from tractexp.record.swing import Swing, find_swing

if TYPE_CHECKING:
    import pandas

NO_POWER = 1e-9  # pu: nothing is a share of less
LEAST_TOLD_NOISE = 1e-4  # of P: what shows less noise is not told from what shows so much


@dataclass(frozen=True, eq=False)
class Event:
    """The first dip of `record`. Means and noise are those of the samples `steady`, before the dip.

    Noise is the standard deviation about a straight line. `end` is the first sample after the dip,
    where the voltage has regained all but a fifth of the depth (or all but the threshold, if that
    is more); the last sample of a record that is `unfinished`, as it ends in the dip. `at_rest`
    tells whether the load is, before it.
    """

    domain: ClassVar[str] = "phasors"  # in which models are compared with it
    record: Record
    start: int  # first sample of the dip
    end: int
    depth: float  # 1 - U_min / U0
    U0: float  # pu
    P0: float  # pu
    Q0: float  # pu
    f0: float  # Hz
    noise_U: float  # pu
    noise_P: float  # pu
    noise_Q: float  # pu
    steady: slice
    dips: int  # in the whole record
    swing: Swing | None = field(default=None, kw_only=True)  # of the load before the dip
    unfinished: bool = field(default=False, kw_only=True)
    at_rest: bool = field(default=True, kw_only=True)

    def __repr__(self) -> str:
        """The event in one sentence."""
        return describe(self)

    def to_frame(self) -> "pandas.DataFrame":
        """The record as a pandas frame: `Record.to_frame`."""
        return self.record.to_frame()

    @property
    def first(self) -> int:
        """The first sample that was recorded."""
        return 0

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of all recorded channels, t, U, P and Q among them."""
        return tuple(self.record.channels)

    @property
    def levels(self) -> tuple[float, ...]:
        """Standard deviation of the noise of each channel that is compared [pu]: of P and of Q."""
        return self.noise_P, self.noise_Q

    @property
    def calm(self) -> np.ndarray:
        """Deviations of P and Q from their means before the dip, (2, n) [pu]; nan in a gap."""
        quiet = np.stack([self.record.P[self.steady], self.record.Q[self.steady]])
        return np.stack([row - row[np.isfinite(row)].mean() for row in quiet])

    @property
    def noise_share(self) -> float | None:
        """The noise of P as a share of P before the dip; None where there is none."""
        return self.noise_P / abs(self.P0) if abs(self.P0) > NO_POWER else None

    @property
    def t_start(self) -> float:
        """When the dip starts [s]."""
        return float(self.record.t[self.start])

    @property
    def t_end(self) -> float:
        """When it ends [s]."""
        return float(self.record.t[self.end])

    @property
    def duration(self) -> float:
        """Length of the dip [s]."""
        return self.t_end - self.t_start

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return self.record.rate


def estimate_noise(t: np.ndarray, values: np.ndarray) -> float:
    """The standard deviation of values about their least-squares line.

    Parameters
    ----------
    t : (N,) [s]
        Times.
    values : (N,)
        Gaps (nan) do not count.

    Returns
    -------
    float
        In the unit of the values.
    """
    valid = np.isfinite(values)
    if np.count_nonzero(valid) < 3:
        return float("nan")
    x, y = t[valid] - t[valid].mean(), values[valid] - values[valid].mean()
    rest = y - x * (x @ y) / (x @ x)
    return float(np.sqrt(rest @ rest / (len(y) - 2)))


def measure_promise(depth: float | None, noise_share: float | None) -> float:
    """How much an event may tell: its depth over the noise, a share of P."""
    return (depth or 0.0) / max(noise_share or 0.0, LEAST_TOLD_NOISE)


def detect(record: Record) -> Event:
    """Find the first dip of a record.

    The record begins after an earlier step and ends where its load changes after the dip for
    another reason than the voltage; its notes say what was done.

    Parameters
    ----------
    record : Record
        With at least one dip.

    Returns
    -------
    Event

    Raises
    ------
    UserError
        Where there is no dip, the record ends right after its start, or it comes too early. An
        interruption, an open pole and a step are refused by their names, and so is a load that
        steps right before the dip.
    """
    dips, swells = find_falls(record.t, record.U)
    if not dips:
        raise UserError(explain_no_dip(record))
    start, end = dips[0]
    if start < FEWEST_BEFORE:
        raise UserError(
            f"{record.where}: the dip starts at sample {start + 1} (t = {record.t[start]:g} s): the"
            f" steady state before it needs at least {FEWEST_BEFORE} samples; give a record that"
            " starts earlier"
        )
    if reason := explain_no_such_dip(record, start, end):
        raise UserError(f"{record.where}: {reason}")
    unfinished = end == record.samples
    end = min(end, record.samples - 1)
    usual = _find_steady(record, start, swells)
    before, notes = keep_steady_part(record, usual, _count_least_samples(record))
    if before.start > usual.start:  # what was before is another state, which is not fitted
        first = before.start
        start, end, before = start - first, end - first, slice(0, before.stop - first)
        record = replace(record.part(slice(first, record.samples)), digest=hash_record(record))
    t, U, P, Q = (values[before] for values in (record.t, record.U, record.P, record.Q))
    if np.count_nonzero(np.isfinite(P) & np.isfinite(Q)) < FEWEST_BEFORE:
        raise UserError(
            f"{record.where}: P and Q have fewer than {FEWEST_BEFORE} values in the"
            f" {before.stop - before.start} samples before the dip at t = {record.t[start]:g} s;"
            " the steady state cannot be computed"
        )
    U0, P0, Q0 = float(U.mean()), float(np.nanmean(P)), float(np.nanmean(Q))
    at_rest = is_at_rest(record, before)
    swing = find_swing(record, before)
    notes += [f"before the dip {swing}, which counts as noise"] if swing else []
    notes += [_tell_unfinished(record, start)] if unfinished else []
    if notes := [*notes, *describe_loss(record, end, complex(P0, Q0))]:
        record = replace(record, notes=tuple(dict.fromkeys([*record.notes, *notes])))
    record = cut_at_change(record, start, end, complex(P0, Q0))
    return Event(
        record=record,
        start=start,
        end=end,
        depth=1 - float(record.U[start:end].min()) / U0,
        U0=U0,
        P0=P0,
        Q0=Q0,
        f0=record.base.frequency if record.f is None else float(record.f[before].mean()),
        noise_U=estimate_noise(t, U),
        noise_P=estimate_noise(t, P),
        noise_Q=estimate_noise(t, Q),
        steady=before,
        dips=len(dips),
        swing=swing,
        unfinished=unfinished,
        at_rest=at_rest,
    )


def _tell_unfinished(record: Record, start: int) -> str:
    """That a record ends in its dip, whose recovery nothing can be told of."""
    t = record.t
    lasts = float(t[-1] - t[start])
    return (
        f"the record ends at t = {t[-1]:g} s, {lasts:.2g} s into the dip: it is fitted to its end"
    )


def find_steady_part(record: Record) -> slice:
    """The samples of the steady state before the first dip; all where there is none, or too little
    before it.
    """
    dips, swells = find_falls(record.t, record.U)
    start = dips[0][0] if dips else 0
    if start < FEWEST_BEFORE:
        return slice(0, record.samples)
    return keep_steady_part(
        record, _find_steady(record, start, swells), _count_least_samples(record)
    )[0]


def _count_least_samples(record: Record) -> int:
    """Samples that a steady state has at least."""
    return max(FEWEST_BEFORE, round(0.1 * record.rate))


def _find_steady(record: Record, start: int, swells: list[tuple[int, int]]) -> slice:
    """The last second before the dip, or before a swell that leaves too little room behind it."""
    most = max(FEWEST_BEFORE, round(STEADY * record.rate))
    least = _count_least_samples(record)
    stop, first = start, max(0, start - most)
    for begin, end in reversed([swell for swell in swells if swell[0] < start]):
        if end <= first:
            break
        if stop - end >= least or begin < FEWEST_BEFORE:
            first = min(end, stop - FEWEST_BEFORE)
            break
        stop, first = begin, max(0, begin - most)
    return slice(max(first, 0), stop)


def describe(event: Event) -> str:
    """The line that a run prints about its record; a second sentence notes anything unusual."""
    record = event.record
    sentence = (
        f"{record.name}: dip of {100 * event.depth:.0f} % lasting {1000 * event.duration:.0f} ms at"
        f" t = {event.t_start:.3f} s, {event.start} samples before it, {event.rate:.0f} Hz, noise"
        f" {_measure_noise(event)}"
    )
    odd = []
    if event.dips > 1:
        odd.append(f"the record holds {event.dips} dips, which are fitted as one event")
    if event.P0 <= 0:
        calm = np.zeros(record.samples, bool)
        calm[event.steady] = True
        reason = (
            explain_negative_power(record.U, record.P, record.Q, calm=calm)
            or "no more than noise, so this is no load"
        )
        odd.append(f"P is {event.P0:.3g} before the dip: {reason}")
    gaps = int(np.count_nonzero(np.isnan(record.P) | np.isnan(record.Q)))
    if gaps:
        odd.append(f"{gaps} samples lack P or Q and are not used")
    return sentence + (f". Note: {'; '.join(odd)}" if odd else "")


def _measure_noise(event: Event) -> str:
    """The noise of P and Q as shares of P, per unit where no P is drawn."""
    if event.noise_share is None:
        return f"{event.noise_P:.2g} pu in P and {event.noise_Q:.2g} pu in Q"
    return (
        f"{100 * event.noise_share:.2f} % in P and {100 * event.noise_Q / abs(event.P0):.2f} % in"
        " Q, of P"
    )
