"""Events that might be recorded next: dips, a tap or bank that is switched and back, other channels and rates."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.identification.problem import WEIGHTS
from tractexp.model.drive import Drive, Excitation, Waveforms
from tractexp.noise import Autoregression, Noise
from tractexp.noise.wander import Load
from tractexp.record import Event, Record, WaveEvent

DEPTHS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
DURATIONS = (0.1, 0.2, 0.4, 0.8)  # s
BRIEF = (0.04, 0.08, 0.16, 0.32)  # s, of waveforms: as long as their recorders go on
SWITCHED, LASTING = (0.04, 0.06, 0.1), 1.0  # of the voltage; s until the bank or the tap is back
JUMPS = (-20.0, 20.0)  # degrees, of dips; a bank that is switched turns the voltage by a few
TURNED_BY_BANK = 3.0  # degrees
UNBALANCED = 0.5  # of the depth: negative sequence in an unbalanced dip
FASTER = 4  # times the record's rate
FASTEST = 5000.0  # Hz, of phasors
EDGE, SUDDEN = 0.04, 0.002  # s, within which the voltage of phasors and of waveforms falls and rises
LEAD, LEAD_OF_WAVES = 0.3, 0.1  # s before the event
AFTER, AFTER_OF_WAVES = 1.5, 0.3  # s after the longest


@dataclass(frozen=True)
class Imagined:
    """An event from the voltage before it back to that voltage: the phase turns by `jump` [degrees] while it is low.

    `rate` is how many times as fast as the records it is sampled, `unbalance` its negative sequence over its depth. In
    `waves` neither asks for a channel of its own.
    """

    depth: float
    duration: float  # s
    jump: float = 0.0
    rate: int = 1
    unbalance: float = 0.0
    switched: bool = False
    waves: bool = False

    @property
    def words(self) -> str:
        """The event, as a sentence goes on after "record"."""
        if self.switched:
            told = (
                f"the switching of a tap or a capacitor bank that lowers the voltage by {self.depth:.0%} for"
                f" {self.duration:g} s"
            )
        else:
            told = f"a dip of {self.depth:.0%} or more lasting {1000 * self.duration:.0f} ms"
        more = []
        if self.jump:
            channel = "" if self.waves else ", with the frequency f"
            more.append(f"in which the voltage's phase jumps by {self.jump:+.0f} degrees{channel}")
        if self.unbalance:
            channel = "" if self.waves else ", with U2"
            more.append(f"unbalanced (negative sequence {self.unbalance:.0%} of the depth){channel}")
        if self.rate > 1:
            more.append(f"sampled {self.rate} times as fast")
        return ", ".join([told, *more])

    @property
    def burden(self) -> tuple[int, float]:
        """How much it asks for: channels, rates and kinds beyond the records', then depth times duration."""
        return bool(self.jump) + bool(self.unbalance) + (self.rate > 1), self.depth * self.duration


def imagined(bench: Bench, reads: Sequence[str] = ()) -> list[Imagined]:
    """What is tried on this bench; of phasors unbalanced dips where one of the rivals `reads` U2."""
    if bench.waves:
        turned = itertools.product(DEPTHS, BRIEF, (0.0, *JUMPS))
        unbalanced = itertools.product(DEPTHS[::2], BRIEF[::2])
        made = [Imagined(*pair, jump=j, waves=True) for *pair, j in turned]
        return made + [Imagined(*pair, unbalance=UNBALANCED, waves=True) for pair in unbalanced]
    made = [Imagined(*pair) for pair in itertools.product(DEPTHS, DURATIONS)]
    made += [Imagined(depth, LASTING, switched=True) for depth in SWITCHED]
    made += [Imagined(*p, jump=j) for *p, j in itertools.product(DEPTHS[::2], DURATIONS[::2], JUMPS)]
    made += [Imagined(SWITCHED[1], LASTING, jump=j, switched=True) for j in (-TURNED_BY_BANK, TURNED_BY_BANK)]
    if "U2" in reads:
        made += [Imagined(*pair, unbalance=UNBALANCED) for pair in itertools.product(DEPTHS[::2], DURATIONS[::2])]
    if FASTER / bench.events[0].record.step <= FASTEST:
        made += [Imagined(depth, DURATIONS[1], rate=FASTER) for depth in DEPTHS[2::2]]
    return made


def driven(bench: Bench, event: Imagined) -> Excitation | Waveforms:
    """The voltage of an imagined event, at the power before the first recorded one; of waveforms without zero sequence,
    with edges as sudden as faults are."""
    like = bench.events[0]
    if isinstance(like, WaveEvent):
        return _waves(like, event)
    step = like.record.step / event.rate
    t = np.arange(round((LEAD + LASTING + AFTER) / step)) * step
    course = _course(t - LEAD, event.duration, EDGE)
    nominal = 2 * np.pi * like.record.base.frequency
    turning = np.radians(event.jump) * np.gradient(course, step)
    return Excitation(
        step, like.U0 * (1 - event.depth * course), np.zeros(len(t)), np.zeros(len(t)), like.U0, like.P0, like.Q0,
        omega_s=turning, omega_n=nominal, U2=event.unbalance * event.depth * like.U0 * course, U20=0.0,
    )  # fmt: skip


def _waves(like: WaveEvent, event: Imagined) -> Waveforms:
    """A dip of the voltage's space vector, sampled as an event is, drawing what that drew before it."""
    step = like.record.step
    n = round((LEAD_OF_WAVES + max(BRIEF) + AFTER_OF_WAVES) / step)
    t = np.arange(n) * step
    course = _course(t - LEAD_OF_WAVES, event.duration, SUDDEN)
    omega_n = 2 * np.pi * like.record.base.frequency
    turn = np.exp(1j * (omega_n + like.omega_s0) * t)
    U, U2 = like.U0 * (1 - event.depth * course), like.U0 * event.unbalance * event.depth * course
    v = U * np.exp(1j * np.radians(event.jump) * course) + U2 * np.conj(turn) ** 2
    compared = np.where(np.array(like.compared)[:, None], 0.0, np.nan) * np.ones(n)
    return Waveforms(
        step, v, np.zeros(n), turn, compared, U, U2,
        like.U0, like.P0, like.Q0, omega_s0=like.omega_s0, omega_n=omega_n, weights=WEIGHTS[like.phases],
    )  # fmt: skip


def _course(since: np.ndarray, duration: float, edge: float) -> np.ndarray:
    """How much of a dip is there (N,), 0 to 1, at times [s] since it began."""
    return np.clip(since / edge, 0, 1) - np.clip((since - duration) / edge, 0, 1)


def noise_of(noise: Noise, drive: Drive, rate: int, step: float) -> Noise:
    """The records' noise on an imagined event; at another rate as loud, and forgotten in the same time."""
    if rate == 1:
        steady = np.repeat(drive.before.T, np.diff(drive.first), axis=1)
        return noise.on(Load.of(steady, drive.before, drive.first))
    memory = noise.memory(step)
    a = float(np.exp(-step / rate / memory)) if memory > 0 else 0.0
    color, shock = np.array([[0.0], [a]]), float(np.sqrt(1 - a * a))
    return Noise((tuple(Autoregression(color, level * np.array([1.0, shock])) for level in noise.levels),))


def as_recorded(bench: Bench, event: Imagined, power: np.ndarray) -> Event:
    """An imagined dip as if it had been recorded without noise, with this power (2, N) [pu]."""
    like, drive = bench.events[0], driven(bench, event)
    assert isinstance(drive, Excitation)
    t = np.arange(len(drive.U)) * drive.step
    start, end = (int(np.searchsorted(t, s)) for s in (LEAD, LEAD + event.duration + EDGE))
    channels = {} if like.record.U2 is None else {"U2": drive.U2}
    if like.record.f is not None:
        channels["f"] = np.full(len(t), like.record.base.frequency)
    record = Record(event.words, t, drive.U, *power, base=like.record.base, **channels)
    return replace(
        like, record=record, start=start, end=end, depth=event.depth, f0=like.record.base.frequency,
        steady=slice(0, start), dips=1,
    )  # fmt: skip
