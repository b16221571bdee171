"""An event as its waveforms show it: space vectors in a frame that turns with the voltage before
the dip.

Before the dip the waveforms are periodic: an offset, the fundamental and its harmonics, fitted by
least squares at the frequency really present. The offsets are the recorder's and are taken off; the
fundamental gives the frame and the power; and the periodic voltage, continued to the time before
the record, lets a simulation reach its periodic steady state.
"""

from dataclasses import dataclass, fields, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tractexp.errors import UserError
from tractexp.record.event import Event
from tractexp.record.noise_filter import NoiseFilter
from tractexp.record.periodic import Periodic
from tractexp.record.phasor import TURN
from tractexp.record.record import Record
from tractexp.record.waves import Waves

COARSEST = 16  # samples per cycle
# cycles: of a shorter dip phasors of one cycle show little but their own window
LONGEST_SHORT_DIP = 5.0
LEAST_UNBALANCE = 0.1  # of the voltage before
FEWEST_CYCLES = 2  # before the event
# cycles of the periodic voltage before the record, in which a simulation reaches its steady state
LEAD = 6
# of the voltage: how far it leaves its periodic course where an event begins
LARGEST_PERIODIC_DEPARTURE = 0.03
NOISE_DEVIATIONS = 6.0  # standard deviations of its noise, if that is more
# of the current, and times what is there before: less zero sequence than this is none
SILENT, LOUDER = 0.02, 3.0


@dataclass(frozen=True, eq=False)
class WaveEvent(Event):
    """An event in waveforms. `record` has t, U, P and Q on the waveforms' samples, as the last half
    cycle shows them.

    v (N,) complex is the voltage's space vector in the frame [pu of its peak], v_zero (N,) its zero
    sequence, both filtered of noise; `weights` (2 m + 1,) are the filter's response to the noise of
    one sample. `turn` (N,) turns into the stationary frame of phase a; currents (3, N) are alpha,
    beta and zero sequence there [pu], nan where not compared. The first `lead` samples stand before
    the record. `omega_s0` [rad/s] is the frame's speed relative to nominal; `random` (3,) is what
    is not periodic in the currents before the dip [pu], `noise_U` in either component of the
    voltage's space vector, `unexplained` (3, n) all that is no fundamental there. `offsets` (2 K,)
    [kV, kA] were taken off.
    """

    domain: ClassVar[str] = "waves"
    phasors: Event
    v: NDArray[np.complex128]
    v_zero: np.ndarray
    turn: NDArray[np.complex128]
    currents: np.ndarray
    lead: int
    omega_s0: float
    random: tuple[float, ...]
    unexplained: np.ndarray
    offsets: np.ndarray
    phases: int
    weights: np.ndarray

    @property
    def first(self) -> int:
        """The first sample that is compared: before it the model settles."""
        return self.lead

    @property
    def channels(self) -> tuple[str, ...]:
        """With I0 where the currents' zero sequence is compared."""
        return (*super().channels, *(("I0",) if self.compared_channels[2] else ()))

    @property
    def levels(self) -> tuple[float, ...]:
        """Standard deviation of all that no fundamental explains before the dip, of each current
        [pu].
        """
        return tuple(max(float(np.sqrt(np.mean(row**2))), 1e-9) for row in self.unexplained)

    @property
    def calm(self) -> np.ndarray:
        """The noise: currents before the dip without fundamental and harmonics, [pu]."""
        return self.unexplained

    @property
    def compared_channels(self) -> tuple[bool, ...]:
        """Which of the three currents are compared."""
        return tuple(bool(np.isfinite(row).any()) for row in self.currents)

    compared = compared_channels  # its name in version 0.2

    @property
    def peaks(self) -> tuple[float, float]:
        """One per unit of a phase's voltage [kV] and current [kA]."""
        voltage, *_, current = _scale(self.record, self.phases)
        return float(voltage), float(current)

    def of_phases(self, currents: np.ndarray) -> np.ndarray:
        """Currents (3, N), alpha, beta and zero, as those of the phases, (K, N)."""
        return compute_phases(currents, self.phases)


def compute_phases(stationary: np.ndarray, phases: int) -> np.ndarray:
    """Alpha, beta and zero sequence (3, N) as phases (K, N), three or one."""
    vector, zero = stationary[0] + 1j * stationary[1], np.nan_to_num(stationary[2])
    return np.stack([(vector * TURN ** (-k)).real + zero for k in range(phases)])


def transform_stationary(
    phases: np.ndarray, rate: float, frequency: float
) -> tuple[NDArray[np.complex128], np.ndarray]:
    """Space vector (N,) complex and zero sequence (N,) of phases (K, N).

    A single phase is the real part of its vector; the imaginary part is what it was a quarter of a
    cycle ago, so that the vector turns as that of three phases does.
    """
    if len(phases) == 3:
        return 2 / 3 * (phases[0] + TURN * phases[1] + TURN**2 * phases[2]), phases.mean(axis=0)
    at = np.arange(phases.shape[1])
    return phases[0] + 1j * np.interp(at - rate / frequency / 4, at, phases[0]), np.zeros(
        phases.shape[1]
    )


def convert_to_waves(event: Event) -> WaveEvent:
    """The event in waveforms. Raises `UserError` where its record has none, or too few samples per
    cycle or before it.

    An event that is in waveforms is returned as it is.
    """
    if isinstance(event, WaveEvent):
        return event
    record, nominal = event.record, event.record.base.frequency
    waves = _cut_waves(event)
    t = waves.start + np.arange(waves.samples.shape[1]) / waves.rate
    cycle, K = 1 / nominal, waves.phases
    before = t < event.t_start - cycle  # phasors see an event half a window early
    if np.count_nonzero(before) < FEWEST_CYCLES * cycle * waves.rate:
        have = max(event.t_start - cycle - t[0], 0.0)
        raise UserError(
            f"{record.where}: {1000 * have:.0f} ms of waveforms before the dip at t ="
            f" {event.t_start:.3f} s, and the steady state needs {FEWEST_CYCLES} cycles"
            f" ({1000 * FEWEST_CYCLES * cycle:.0f} ms); take domain=phasors, or a record that"
            " starts earlier"
        )
    x = _scale_to_per_unit(waves, record)
    frequency = _measure_frequency(t[before], x[:K, before], waves.rate, event.f0)
    periodic = Periodic.from_samples(t[before], x[:, before], frequency, waves.rate)
    x = x - periodic.offsets[:, None]
    lead = round(LEAD * waves.rate / frequency)
    time = np.concatenate([t[0] - np.arange(lead, 0, -1) / waves.rate, t])
    x = np.concatenate([periodic.evaluate_at(time[:lead]), x], axis=1)

    V, I = (_extract_positive(part) for part in np.split(periodic.fundamentals, 2))
    turn = np.exp(1j * (2 * np.pi * frequency * (time - periodic.origin) + np.angle(V)))
    (v, v_zero), (i, i_zero) = (
        transform_stationary(part, waves.rate, frequency) for part in np.split(x, 2)
    )
    noise, noise_U = (
        periodic.rest[K:],
        np.sqrt(np.mean(periodic.rest[:K] ** 2) * (2 / 3 if K == 3 else 1)),
    )
    noise_filter = NoiseFilter.from_rate(waves.rate, frequency)
    course, course_zero = transform_stationary(
        periodic.evaluate_at(time)[:K], waves.rate, frequency
    )
    v = course + noise_filter(v - course, 2 * noise_U**2)
    v_zero = course_zero + noise_filter(v_zero - course_zero, noise_U**2 / 2)
    power = V * np.conj(I)
    start = lead + _find_onset(t, x[:K, lead:], periodic, K, before)
    half = average_half_cycle(v / turn, i / turn, turn, waves.rate, frequency)
    currents = np.stack([i.real, i.imag, i_zero])
    currents[:, :lead] = np.nan
    steady = slice(lead, lead + np.count_nonzero(before))
    residual = (i - I * np.exp(-1j * np.angle(V)) * turn)[steady]
    calm = np.stack([residual.real, residual.imag, i_zero[steady]])  # no fundamental
    compared = _choose_compared_components(currents[:, start:], calm, K)
    currents[~compared] = np.nan
    currents[:, _find_bridged_of_dip(waves, event, lead)] = np.nan
    levels = (
        (noise.mean() * np.sqrt(2 / 3),) * 2 + (noise.mean() / np.sqrt(3),)
        if K == 3
        else (noise[0], 1.0, 1.0)
    )
    slow = replace(
        record,
        t=time,
        U=half[0],
        P=np.real(half[1]),
        Q=np.imag(half[1]),
        U2=half[2],
        f=None,
        window=None,
        more={},
        waves=None,
    )
    end = min(max(int(np.searchsorted(time, event.t_end)), start + 1), len(time) - 1)
    return WaveEvent(
        **{f.name: getattr(event, f.name) for f in fields(Event)}
        | {
            "record": slow,
            "start": start,
            "end": end,
            "U0": float(np.abs(V)),
            "P0": float(power.real),
            "Q0": float(power.imag),
            "f0": frequency,
            "noise_U": float(noise_U),
            "steady": steady,
        },
        phasors=event,
        v=v / turn,
        v_zero=v_zero,
        turn=turn,
        currents=currents,
        lead=lead,
        omega_s0=2 * np.pi * (frequency - nominal),
        random=tuple(map(float, levels)),
        unexplained=calm,
        offsets=periodic.offsets * _scale(record, K),
        phases=K,
        weights=noise_filter.weights,
    )


def _find_bridged_of_dip(waves: Waves, event: Event, lead: int) -> list[int]:
    """The samples, `lead` after those of the waves, that were bridged within the dip, and a cycle
    about it.
    """
    cycle = 1 / event.record.base.frequency
    first, last = event.t_start - cycle, event.t_end + cycle
    within = [t for t in waves.bridged if max(first, waves.start) <= t <= min(last, waves.end)]
    return [lead + round((t - waves.start) * waves.rate) for t in within]


def describe_smearing(duration: float, U2: float, frequency: float) -> str:
    """The harm that phasors do to a dip of this duration [s] and share of U2, as the end of a
    sentence; "" where none.
    """
    if duration * frequency < LONGEST_SHORT_DIP:
        return (
            f"lasts {1000 * duration:.0f} ms, less than {LONGEST_SHORT_DIP:g} cycles, which phasors"
            " smear"
        )
    if U2 > LEAST_UNBALANCE:
        return f"is unbalanced, U2 {U2:.0%} of U, which phasors leave out"
    return ""


def has_fine_samples(record: Record) -> bool:
    """Whether a record has samples, and enough in a cycle for `domain=waves`."""
    waves = record.waves
    return waves is not None and waves.rate >= COARSEST * record.base.frequency


def _cut_waves(event: Event) -> Waves:
    """The waveforms of an event, from as early and to as late as its record may use them."""
    record, waves = event.record, event.record.waves
    if waves is None:
        raise UserError(
            f"{record.where} has no waveforms: domain=waves needs the samples of voltages and"
            " currents, as a COMTRADE file or a table of waveforms has them; take domain=phasors"
        )
    if waves.rate < COARSEST * record.base.frequency:
        raise UserError(
            f"{record.where}: {waves.rate:g} samples per second are"
            f" {waves.rate / record.base.frequency:.3g} per cycle, and domain=waves needs"
            f" {COARSEST}; take domain=phasors"
        )
    cycle = 1.5 / record.base.frequency
    first = waves.start if record.t[0] - waves.start < cycle else float(record.t[0]) + cycle / 3
    last = waves.end if waves.end - record.t[-1] < cycle else float(record.t[-1]) - cycle / 3
    return waves.between(first, last)


def _scale(record: Record, phases: int) -> np.ndarray:
    """One per unit of each channel (2 K,): peaks [kV, kA]."""
    V = record.base.voltage * np.sqrt(2 / phases)
    return np.repeat([V, 2 * record.base.power / (phases * V)], phases)


def _scale_to_per_unit(waves: Waves, record: Record) -> np.ndarray:
    """(2 K, M) per unit of the peaks, channels that are sampled late moved back."""
    x = waves.samples / _scale(record, waves.phases)[:, None]
    if waves.late is None:
        return x
    at = np.arange(x.shape[1])
    return np.stack(
        [
            np.interp(at + late * waves.rate, at, row)
            for row, late in zip(x, waves.late, strict=True)
        ]
    )


def _extract_positive(phasors: np.ndarray) -> complex:
    """Positive sequence of three phasors, or the only one."""
    return complex(phasors @ TURN ** np.arange(len(phasors)) / len(phasors))


def _measure_frequency(t: np.ndarray, v: np.ndarray, rate: float, guess: float) -> float:
    """Frequency [Hz] of voltages (K, n), from how their fundamental turns from the first half to
    the second.
    """
    frequency = guess
    for _ in range(2):
        whole = max(1, int((t[-1] - t[0]) * frequency / 2)) / frequency  # s: cycles of a half
        n = round(whole * rate)
        halves = (
            Periodic.from_samples(t[part], v[:, part], frequency, rate)
            for part in (slice(0, n), slice(-n, None))
        )
        first, last = halves
        angle = np.angle(
            _extract_positive(last.fundamentals) / _extract_positive(first.fundamentals)
        )
        between = last.origin - first.origin
        frequency += float(np.angle(np.exp(1j * (angle - 2 * np.pi * frequency * between)))) / (
            2 * np.pi * between
        )
    return frequency


def _find_onset(
    t: np.ndarray, v: np.ndarray, periodic: Periodic, K: int, before: np.ndarray
) -> int:
    """The first sample at which a voltage (K, M) departs from its periodic course."""
    off = np.abs(v - periodic.evaluate_at(t)[:K]).max(axis=0)
    limit = max(LARGEST_PERIODIC_DEPARTURE, NOISE_DEVIATIONS * float(periodic.rest[:K].max()))
    beyond = off > limit
    beyond &= np.r_[beyond[1:], False] | np.r_[beyond[2:], False, False]
    beyond[: np.count_nonzero(before) // 2] = False
    return int(np.argmax(beyond)) if beyond.any() else int(np.count_nonzero(before))


def average_half_cycle(
    v: np.ndarray, i: np.ndarray, turn: np.ndarray, rate: float, frequency: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """|V1|, P + jQ and |V2| (N,) of vectors (N,) in the frame, as the mean over the last half
    cycle shows them.

    In half a cycle the other sequence turns whole.
    """
    n = max(1, round(rate / frequency / 2))

    def mean(y: np.ndarray) -> np.ndarray:
        total = np.cumsum(np.concatenate([np.full(n, y[:n].mean()), y]))
        return (total[n:] - total[:-n]) / n

    V, I = mean(v), mean(i)
    return np.abs(V), V * I.conj(), np.abs(mean(np.conj(v * turn) / turn))


def _choose_compared_components(after: np.ndarray, before: np.ndarray, phases: int) -> np.ndarray:
    """Which of alpha, beta and zero (3, n) are compared: of one phase the first, of three zero if
    the dip shows it.
    """
    if phases == 1:
        return np.array([True, False, False])
    size, vector, calm = _compute_rms(after[2]), _compute_rms(after[:2]), _compute_rms(before[2])
    return np.array([True, True, size > max(SILENT * vector, LOUDER * calm)])


def _compute_rms(x: np.ndarray) -> float:
    """The root mean square of all values."""
    return float(np.sqrt(np.mean(x**2)))
