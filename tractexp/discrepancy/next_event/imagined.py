"""Events that might be recorded next: dips, a tap or bank that is switched and back, other channels
and rates.
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.domain import PHASORS, Domain
from tractexp.inference.context import Context
from tractexp.model.drive import Drive, Excitation, WaveformDrive
from tractexp.noise import Noise
from tractexp.noise.color import forgetting_noise
from tractexp.noise.random_walk import Load
from tractexp.record import Event, Record

DEPTHS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
SWITCHED, LASTING = (0.04, 0.06, 0.1), 1.0  # of the voltage; s until the bank or the tap is back
JUMPS = (-20.0, 20.0)  # degrees, of dips; a bank that is switched turns the voltage by a few
TURNED_BY_BANK = 3.0  # degrees
UNBALANCED_SHARE = 0.5  # of the depth: negative sequence in an unbalanced dip
RATE_FACTOR = 4  # times the record's rate
HIGHEST_PHASOR_RATE = 5000.0  # Hz, of phasors


@dataclass(frozen=True)
class ImaginedDip:
    """An event from the voltage before it back to that voltage.

    Attributes
    ----------
    depth : float
        Share by which the voltage falls.
    duration : float [s]
        From edge to edge.
    jump : float [degrees]
        By which the phase turns while it is low.
    rate : int
        How many times as fast as the records it is sampled.
    unbalance : float
        Negative sequence over the depth.
    switched : bool
        Whether it is the switching of a tap or a capacitor bank, and no dip.
    domain : Domain
        Phasors or waveforms.
    """

    depth: float
    duration: float  # s
    jump: float = 0.0
    rate: int = 1
    unbalance: float = 0.0
    switched: bool = False
    domain: Domain = PHASORS

    def to_dict(self) -> dict[str, Any]:
        """As `discrepancy.json` and `plan.json` have it."""
        fields = {key: value for key, value in vars(self).items() if key != "domain"}
        return fields | {"waves": self.domain.name == "waves"}

    @property
    def words(self) -> str:
        """The event, as a sentence goes on after "record"."""
        if self.switched:
            sentence = (
                "the switching of a tap or a capacitor bank that lowers the voltage by"
                f" {self.depth:.0%} for"
                f" {self.duration:g} s"
            )
        else:
            sentence = f"a dip of {self.depth:.0%} or more lasting {1000 * self.duration:.0f} ms"
        more = []
        if self.jump:
            more.append(
                f"in which the voltage's phase jumps by {self.jump:+.0f}"
                f" degrees{self._channel('jump')}"
            )
        if self.unbalance:
            channel = self._channel("unbalance")
            more.append(
                f"unbalanced (negative sequence {self.unbalance:.0%} of the depth){channel}"
            )
        if self.rate > 1:
            more.append(f"sampled {self.rate} times as fast")
        return ", ".join([sentence, *more])

    def _channel(self, what: str) -> str:
        """The channel that it has to be recorded with, as the sentence goes on."""
        channel = self.domain.further.get(what)
        return f", with {channel}" if channel else ""

    @property
    def burden(self) -> tuple[int, float]:
        """How much it asks for: channels, rates and kinds beyond the records', then depth times
        duration.
        """
        return bool(self.jump) + bool(self.unbalance) + (self.rate > 1), self.depth * self.duration


def imagine_dips(context: Context, reads: Sequence[str] = ()) -> list[ImaginedDip]:
    """What is tried on this context; unbalanced dips that need the channel U2 where one of the
    rivals `reads` it.
    """
    domain = context.domain
    durations = context.domain.dips.durations
    pairs = list(itertools.product(DEPTHS, durations))
    few = list(itertools.product(DEPTHS[::2], durations[::2]))
    imagine = functools.partial(ImaginedDip, domain=domain)
    unbalanced = [imagine(*pair, unbalance=UNBALANCED_SHARE) for pair in few]
    if not domain.further:
        return [imagine(*pair, jump=j) for pair in pairs for j in (0.0, *JUMPS)] + unbalanced
    dips = [imagine(*pair) for pair in pairs]
    dips += [imagine(depth, LASTING, switched=True) for depth in SWITCHED]
    dips += [imagine(*pair, jump=j) for pair in few for j in JUMPS]
    turned = -TURNED_BY_BANK, TURNED_BY_BANK
    dips += [imagine(SWITCHED[1], LASTING, jump=j, switched=True) for j in turned]
    if "U2" in reads:
        dips += unbalanced
    if RATE_FACTOR / context.events[0].record.step <= HIGHEST_PHASOR_RATE:
        dips += [imagine(depth, durations[1], rate=RATE_FACTOR) for depth in DEPTHS[2::2]]
    return dips


def drive_imagined(context: Context, event: ImaginedDip) -> Excitation | WaveformDrive:
    """The voltage of an imagined event, at the power before the first recorded one."""
    like = context.events[0]
    dips = context.domain.dips
    step = like.record.step / event.rate
    t = np.arange(round((dips.lead + dips.length) / step)) * step
    course = _compute_course(t - dips.lead, event.duration, dips.edge)
    return context.domain.dip(like, step, course, event.depth, event.jump, event.unbalance)


def _compute_course(since: np.ndarray, duration: float, edge: float) -> np.ndarray:
    """How much of a dip is there (N,), 0 to 1, at times [s] since it began."""
    return np.clip(since / edge, 0, 1) - np.clip((since - duration) / edge, 0, 1)


def transfer_noise(noise: Noise, drive: Drive, rate: int, step: float) -> Noise:
    """The records' noise on an imagined event; at another rate as loud, and forgotten in the same
    time.
    """
    if rate == 1:
        steady = np.repeat(drive.before.T, np.diff(drive.first), axis=1)
        return noise.apply_to_events(Load.from_powers(steady, drive.before, drive.first))
    memory = noise.memory(step)
    a = float(np.exp(-step / rate / memory)) if memory > 0 else 0.0
    return Noise((tuple(forgetting_noise(level, a) for level in noise.levels),))


def record_imagined(context: Context, event: ImaginedDip, power: np.ndarray) -> Event:
    """An imagined dip as if it had been recorded without noise, with this power (2, N) [pu]."""
    like, dips, drive = context.events[0], context.domain.dips, drive_imagined(context, event)
    assert isinstance(drive, Excitation)
    t = np.arange(len(drive.U)) * drive.step
    start, end = (
        int(np.searchsorted(t, s)) for s in (dips.lead, dips.lead + event.duration + dips.edge)
    )
    channels = {} if like.record.U2 is None else {"U2": drive.U2}
    if like.record.f is not None:
        channels["f"] = np.full(len(t), like.record.base.frequency)
    record = Record(event.words, t, drive.U, *power, base=like.record.base, **channels)
    return replace(
        like,
        record=record,
        start=start,
        end=end,
        depth=event.depth,
        f0=like.record.base.frequency,
        steady=slice(0, start),
        dips=1,
    )
