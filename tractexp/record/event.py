"""The event inside a record: where the dip is, what came before it, and how noisy the recording is."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tractexp.errors import UserError
from tractexp.provenance import digest
from tractexp.record.aftermath import loss, until_change
from tractexp.record.change import smear, voltage_changes
from tractexp.record.direction import direction
from tractexp.record.record import DEAD, Record
from tractexp.record.steadiness import steady_part

SHALLOWEST = 0.03  # of the voltage before: anything less is no dip
NOISE_FACTOR = 6.0  # standard deviations of noise that a dip must exceed
RECOVERED = 0.2  # of the depth: the dip ends when no more than this is missing, or the threshold if that is more
FEWEST_BEFORE = 10  # samples before a dip, for the steady state and the noise
MERGED = 0.02  # s: dips closer than one cycle are one
OPEN_POLE = 0.25  # of the voltage: negative sequence of an open pole, of a fault as well
PHASE_GONE = 0.42  # the same where next to nothing of a phase is left
UNCLEARED = 1.5  # s: back-up protection clears a fault within about a second
SAME_CURRENT = 0.1  # of a current that stays: how far it moves, and for how much of the time it may move farther
STEP_AT_MOST = 0.15  # of the voltage: a tap changer or a switched line moves it no farther
STEP_LASTS = 0.3  # s of a new level before it is one
COARSE, FEWEST_INSIDE = 20.0, 5  # Hz, samples: a dip of fewer samples at a lower rate shows no response
NO_POWER = 1e-9  # pu: nothing is a share of less
STEADY = 1.0  # s: the steady state is the mean over at most so long before the dip


@dataclass(frozen=True, eq=False)
class Event:
    """The first dip of `record`. Means and noise are those of the samples `steady`, before the dip.

    Noise is the standard deviation about a straight line. `end` is the first sample after the dip, where the
    voltage has regained all but a fifth of the depth (or all but the threshold, if that is more).
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

    def __repr__(self) -> str:
        return describe(self)

    @property
    def first(self) -> int:
        """The first sample that was recorded."""
        return 0

    @property
    def channels(self) -> tuple[str, ...]:
        """What is recorded beside t, U, P and Q, and these, by name."""
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
        return float(self.record.t[self.start])

    @property
    def t_end(self) -> float:
        return float(self.record.t[self.end])

    @property
    def duration(self) -> float:
        """Length of the dip [s]."""
        return self.t_end - self.t_start

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return self.record.rate


def noise(t: np.ndarray, values: np.ndarray) -> float:
    """Standard deviation of `values` (N,) about their least-squares line, without gaps (nan)."""
    valid = np.isfinite(values)
    if np.count_nonzero(valid) < 3:
        return float("nan")
    x, y = t[valid] - t[valid].mean(), values[valid] - values[valid].mean()
    rest = y - x * (x @ y) / (x @ x)
    return float(np.sqrt(rest @ rest / (len(y) - 2)))


def find_dips(t: np.ndarray, U: np.ndarray) -> list[tuple[int, int]]:
    """All dips of a voltage (N,), in order of time, as (start, end) sample numbers; end = N if never recovered.

    A dip falls by more than 3 % (or six standard deviations of the sample noise) below a reference that starts at
    the level of the first samples, follows slow changes, and starts anew after each dip. Rises are not dips, and a
    swell leaves the reference where it was.
    """
    return _scan(t, U)[0]


def _scan(t: np.ndarray, U: np.ndarray) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """(dips, swells) of a voltage (N,), both as (start, end) sample numbers."""
    margin = _margin(U)
    block = max(FEWEST_BEFORE, round(0.1 * (len(t) - 1) / float(t[-1] - t[0])))
    reference = float(np.median(U[:FEWEST_BEFORE]))
    dips: list[tuple[int, int]] = []
    swells: list[tuple[int, int]] = []
    k = 0
    while k < len(U):
        part = U[k : k + block]
        below = part < (1 - margin) * reference
        if not below.any():
            if float(np.median(part)) > (1 + margin) * reference and (swell := _swell(t, U, k, reference, margin)):
                swells.append(swell)
                k = swell[1]
                continue
            reference += 0.1 * (float(np.median(part)) - reference)
            k += len(part)
            continue
        crossing = k + int(np.argmax(below))
        start = _onset(U, dips[-1][1] if dips else 0, crossing, reference, margin)
        if crossing - start > block:
            start = _after_a_step(t, U, start, crossing, margin)
        end = _recovery(U, crossing, reference, margin)
        if dips and t[start] - t[dips[-1][1]] < MERGED:
            start = dips.pop()[0]
        dips.append((start, end))
        if end < len(U):  # the higher: the short one where another dip follows soon, the long one while U still rises
            reference = max(float(np.median(U[end : end + n])) for n in (FEWEST_BEFORE, block))
        k = end
    return dips, swells


def _margin(U: np.ndarray) -> float:
    """The share of the reference by which a dip must fall; a voltage that is gone has no noise to exceed."""
    alive = U[DEAD * U.max() < U]
    if len(alive) < FEWEST_BEFORE:
        return SHALLOWEST
    return max(SHALLOWEST, NOISE_FACTOR * float(sample_noise(alive) / np.median(alive)))


def sample_noise(x: np.ndarray) -> np.ndarray:
    """Standard deviation of the noise from sample to sample of x (..., N): robust, and blind to slow changes."""
    return np.median(np.abs(np.diff(x)), axis=-1) / 0.6745 / np.sqrt(2)


def _swell(t: np.ndarray, U: np.ndarray, k: int, reference: float, margin: float) -> tuple[int, int] | None:
    """The swell in the block from k on; None where the voltage stays at its new level, or falls from it after long."""
    first = k + int(np.argmax(U[k:] > (1 + margin) * reference))
    back = U[first:] <= (1 + margin) * reference
    if not back.any():
        return None
    end = first + int(np.argmax(back))
    near = np.flatnonzero(U[:first] <= (1 + margin / 10) * reference)
    first = int(near[-1]) + 1 if len(near) else first
    landed = float(np.median(U[end : end + FEWEST_BEFORE])) >= (1 - margin) * reference
    return (first, end) if landed or t[end] - t[first] <= STEADY else None


def _onset(U: np.ndarray, first: int, crossing: int, reference: float, margin: float) -> int:
    """The sample after the last one, not before `first`, that was still within a tenth of the margin."""
    high = np.flatnonzero(U[first:crossing] >= (1 - margin / 10) * reference)
    return first + int(high[-1]) + 1 if len(high) else crossing


def _after_a_step(t: np.ndarray, U: np.ndarray, start: int, crossing: int, margin: float) -> int:
    """The onset of a dip that comes long after a small step of the voltage, which is none of it."""
    begin = max(0, 2 * start - crossing)
    steps = voltage_changes(U[begin:crossing], MERGED * (len(t) - 1) / float(t[-1] - t[0]))
    if not steps:
        return start
    stop = begin + steps[-1].stop
    return _onset(U, stop, crossing, float(np.median(U[stop:crossing])), margin)


def _recovery(U: np.ndarray, crossing: int, reference: float, margin: float) -> int:
    """The first sample that has recovered from the lowest voltage so far, or len(U)."""
    after = U[crossing:]
    missing = reference - np.minimum.accumulate(after)
    recovered = after >= reference - np.maximum(margin * reference, RECOVERED * missing)
    return crossing + int(np.argmax(recovered)) if recovered.any() else len(U)


def detect(record: Record) -> Event:
    """The first dip of a record; raises `UserError` for none, one that does not end, or one that comes too early.

    An interruption, an open pole and a step are refused by their names, and so is a load that steps right before. The
    record begins after an earlier step and ends where its load changes after the dip for another reason than the
    voltage; its notes say what was done.
    """
    dips, swells = _scan(record.t, record.U)
    if not dips:
        raise UserError(_no_dip(record))
    start, end = dips[0]
    if start < FEWEST_BEFORE:
        raise UserError(
            f"{record.where}: the dip starts at sample {start + 1} (t = {record.t[start]:g} s): the steady state "
            f"before it needs at least {FEWEST_BEFORE} samples; give a record that starts earlier"
        )
    if reason := _no_such_dip(record, start, end):
        raise UserError(f"{record.where}: {reason}")
    usual = _steady(record, start, swells)
    before, notes = steady_part(record, usual, _least(record))
    if before.start > usual.start:  # what was before is another state, which is not fitted
        first = before.start
        start, end, before = start - first, end - first, slice(0, before.stop - first)
        record = replace(record.part(slice(first, record.samples)), digest=digest(record))
    t, U, P, Q = (values[before] for values in (record.t, record.U, record.P, record.Q))
    if np.count_nonzero(np.isfinite(P) & np.isfinite(Q)) < FEWEST_BEFORE:
        raise UserError(
            f"{record.where}: P and Q have fewer than {FEWEST_BEFORE} values in the {before.stop - before.start} "
            f"samples before the dip at t = {record.t[start]:g} s; the steady state cannot be computed"
        )
    U0, P0, Q0 = float(U.mean()), float(np.nanmean(P)), float(np.nanmean(Q))
    if notes := [*notes, *loss(record, end, complex(P0, Q0))]:
        record = replace(record, notes=tuple(dict.fromkeys([*record.notes, *notes])))
    record = until_change(record, start, end, complex(P0, Q0))
    return Event(
        record=record,
        start=start,
        end=end,
        depth=1 - float(record.U[start:end].min()) / U0,
        U0=U0,
        P0=P0,
        Q0=Q0,
        f0=record.base.frequency if record.f is None else float(record.f[before].mean()),
        noise_U=noise(t, U),
        noise_P=noise(t, P),
        noise_Q=noise(t, Q),
        steady=before,
        dips=len(dips),
    )


def steady(record: Record) -> slice:
    """The samples of the steady state before the first dip; all where there is none, or too little before it."""
    dips, swells = _scan(record.t, record.U)
    start = dips[0][0] if dips else 0
    if start < FEWEST_BEFORE:
        return slice(0, record.samples)
    return steady_part(record, _steady(record, start, swells), _least(record))[0]


def _least(record: Record) -> int:
    """Samples that a steady state has at least."""
    return max(FEWEST_BEFORE, round(0.1 * record.rate))


def _steady(record: Record, start: int, swells: list[tuple[int, int]]) -> slice:
    """The last second before the dip, or before a swell that leaves too little room behind it."""
    most = max(FEWEST_BEFORE, round(STEADY * record.rate))
    least = _least(record)
    stop, first = start, max(0, start - most)
    for begin, end in reversed([swell for swell in swells if swell[0] < start]):
        if end <= first:
            break
        if stop - end >= least or begin < FEWEST_BEFORE:
            first = min(end, stop - FEWEST_BEFORE)
            break
        stop, first = begin, max(0, begin - most)
    return slice(max(first, 0), stop)


def _no_such_dip(record: Record, start: int, end: int) -> str:
    """Why a fall of the voltage is not a dip that can be fitted, a clause; "" where it is one."""
    t, U = record.t, record.U
    before = float(U[:start].mean())
    inside = U[start:end]
    lowest, when = float(inside.min()), f"at t = {t[start]:g} s"
    if _current_stays(record, start, end):
        return (
            f"the voltage falls to {lowest:.3g} {when} while the current stays as it was: a fuse of the voltage "
            "transformers, or their wiring, and no dip of the network; choose another event"
        )
    if lowest < DEAD * before:
        if end < len(U):
            return (
                f"the voltage is gone from t = {t[start]:g} to {t[end]:g} s (U falls to {lowest:.3g}): an "
                "interruption, no dip, after which loads start anew; choose another event"
            )
        return (
            f"the voltage is gone from t = {t[start]:g} s on (U falls to {lowest:.3g}): the line is dead, which is no "
            "dip; choose another event"
        )
    if record.U2 is not None:
        unbalanced = record.U2[start:end] > OPEN_POLE * inside
        if np.count_nonzero(unbalanced) * record.step > UNCLEARED:
            share = float(np.median(record.U2[start:end][unbalanced] / inside[unbalanced]))
            return (
                f"U2 is {100 * share:.3g} % of U for {np.count_nonzero(unbalanced) * record.step:.2g} s {when}, longer "
                "than a fault lasts: one pole is open, which is no dip of all phases; choose another event"
            )
    if end == len(U):
        return _unfinished(record, start, before)
    if record.rate < COARSE and end - start < FEWEST_INSIDE:
        return (
            f"the dip {when} has {end - start} samples at {record.rate:.3g} Hz: too coarse to show a response; give a "
            f"record of at least {COARSE:g} Hz"
        )
    return ""


def _current_stays(record: Record, start: int, end: int) -> bool:
    """Whether a voltage that is gone, or unbalanced for longer than a fault lasts, leaves the current as it was."""
    edge = max(1, round(smear(record)))
    inside, before = slice(start + edge, end - edge * (end < record.samples)), slice(max(0, start - 10 * edge), start)
    if inside.stop - inside.start < max(3 * edge, FEWEST_INSIDE):
        return False
    U = record.U[inside]
    share = 0.0 if record.U2 is None else float(np.median(record.U2[inside] / np.maximum(U, 1e-12)))
    gone = float(np.median(U)) < DEAD * float(record.U[:start].mean())
    if not gone and not share > (OPEN_POLE if (end - start) * record.step > UNCLEARED else PHASE_GONE):
        return False
    usual, current = (np.hypot(record.P[at], record.Q[at]) / np.maximum(record.U[at], 1e-12) for at in (before, inside))
    level = float(np.nanmedian(usual)) if np.isfinite(usual).any() else 0.0
    return level > 0 and bool((np.abs(current / level - 1) < SAME_CURRENT).mean() > 1 - SAME_CURRENT)


def _unfinished(record: Record, start: int, before: float) -> str:
    """The reason against a fall that lasts to the record's end."""
    t, U = record.t, record.U
    fall = 1 - float(np.median(U[start:])) / before
    level = np.abs(U[start:] / float(np.median(U[start:])) - 1) <= _margin(U)
    lasts = float(t[-1] - t[start])
    if fall <= STEP_AT_MOST and lasts >= STEP_LASTS and level.mean() > 0.8:
        return (
            f"the voltage falls by {100 * fall:.3g} % at t = {t[start]:g} s and stays there for the {lasts:.2g} s that "
            "remain: a step (a tap changer, or something switched), no dip; choose another event"
        )
    return (
        f"the record is shorter than the dip: it ends at t = {t[-1]:g} s with U = {U[-1]:.3g} where it was "
        f"{before:.3g} before the dip of t = {t[start]:g} s; give a record that shows the recovery"
    )


def _no_dip(record: Record) -> str:
    U, t = record.U, record.t
    reference, margin = float(np.median(U[:FEWEST_BEFORE])), _margin(U)
    if reference <= 0:
        return f"{record.where}: there is no dip: the voltage starts at zero; give a record of a live line"
    low, high = int(np.argmin(U)), int(np.argmax(U))
    fall, rise = 1 - U[low] / reference, U[high] / reference - 1
    start = f"{record.where}: there is no dip: the voltage starts at {reference:.4g} and falls"
    if fall <= margin:
        sentence = (
            f"{start} at most {100 * fall:.3g} % below it (t = {t[low]:g} s), but a dip must exceed "
            f"{100 * SHALLOWEST:g} % and the noise"
        ) + (f", here {100 * margin:.3g} %" if margin > SHALLOWEST else "")
    else:
        sentence = f"{start} by {100 * fall:.3g} % (t = {t[low]:g} s), but slowly: a ramp, no dip"
    if rise > margin:
        sentence += (
            f"; it rises by {100 * rise:.3g} % at t = {t[high]:g} s: a swell is not fitted, and a record that "
            "starts inside a dip lacks the steady state before it"
        )
    return sentence


def describe(event: Event) -> str:
    """The line that a run prints about its record; a second sentence notes anything unusual."""
    record = event.record
    sentence = (
        f"{record.name}: dip of {100 * event.depth:.0f} % lasting {1000 * event.duration:.0f} ms "
        f"at t = {event.t_start:.3f} s, "
        f"{event.start} samples before it, {event.rate:.0f} Hz, noise {_noise(event)}"
    )
    odd = []
    if event.dips > 1:
        odd.append(f"the record holds {event.dips} dips, and the first is used")
    if event.P0 <= 0:
        calm = np.zeros(record.samples, bool)
        calm[event.steady] = True
        reason = direction(record.U, record.P, record.Q, calm=calm) or "no more than noise, so this is no load"
        odd.append(f"P is {event.P0:.3g} before the dip: {reason}")
    gaps = int(np.count_nonzero(np.isnan(record.P) | np.isnan(record.Q)))
    if gaps:
        odd.append(f"{gaps} samples lack P or Q and are not used")
    return sentence + (f". Note: {'; '.join(odd)}." if odd else "")


def _noise(event: Event) -> str:
    """The noise of P and Q as shares of P, per unit where no P is drawn."""
    if event.noise_share is None:
        return f"{event.noise_P:.2g} pu in P and {event.noise_Q:.2g} pu in Q"
    return f"{100 * event.noise_share:.2f} % in P and {100 * event.noise_Q / abs(event.P0):.2f} % in Q, of P"
