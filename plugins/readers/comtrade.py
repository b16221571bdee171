"""Records from COMTRADE fault recordings: the dips of one file, numbered in order of time."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError, check_range
from tractexp.plugin import plugin
from tractexp.record import Base, Events, Reader, Record, detect, find_dips
from tractexp.record.event import FEWEST_BEFORE, STEADY
from tractexp.record.phasor import Phasors, measure
from tractexp.record.recording import UNITS, Recording


@dataclass(frozen=True, eq=False)
class Dip:
    """One dip of the file: samples start to end of the phasors it was found in, with room from `first` to `stop`."""

    phasors: Phasors
    first: int  # the end of the dip before, or the segment's first sample
    start: int
    end: int
    stop: int  # the start of the next dip, or the segment's end


@plugin
class COMTRADE(Reader):
    """Dips from three phase voltages and currents of a COMTRADE record (.cfg with its .dat).

    Channels are counted from 0, or named. Secondary values are taken to the primary side. One-cycle phasors at
    the tracked frequency, stamped at the window's center, about one per millisecond, no window across two sampling
    rates; V1, I1 positive, V2 negative sequence: U = |V1|, U2 = |V2|, P + jQ = 3 V1 conj(I1), consumed positive.
    f is the speed at which V1 turns, so a jump of its angle shows as a short peak. One base for the whole file,
    from the steady state before the first dip: its line-to-line voltage and its apparent power. Dips are
    numbered from 1; the first is fitted and the others validate unless said otherwise.

    Source: IEEE C37.111-1999 and -2013 (files); IEEE C37.118.1-2011 (centered phasors); Fortescue 1918.
    Departures: the time skew of channels is corrected on request only; combined .cff files are not read.
    """

    endings = (".cfg",)

    path: str = ""  # the .cfg file
    voltages: list[Any] = field(default_factory=list)  # three channels, phase to ground, in the order a, b, c
    currents: list[Any] = field(default_factory=list)  # three channels, counted positive into the load
    train: list[int] | None = None  # dips to fit; null: the first that can be used
    validate: list[int] | None = None  # dips held out; null: every other one that can be used
    encoding: str | None = None  # of the .cfg; null: the first of utf-8, gbk, cp1251 that fits
    pre: float = 1.0  # s kept before a dip starts, at most
    post: float = 10.0  # s kept after a dip starts, at most
    reverse_current: bool = False  # true where the recorder counts current out of the load as positive
    skew: bool = False  # true: correct the time skew of each channel given in the .cfg

    def check(self) -> None:
        if not self.path:
            raise UserError("data.path is missing: give the .cfg file, e.g. data.path=station.cfg")
        if self.train is not None and not self.train:
            raise UserError("data.train is empty: name at least one dip by its number, e.g. data.train=[1]")
        given = [*(self.train or []), *(self.validate or [])]
        for number in given:
            if given.count(number) > 1:
                raise UserError(f"data.train and data.validate name dip {number} twice; a dip may serve only once")
        check_range("data.pre", self.pre, 0.05)
        check_range("data.post", self.post, 0.1)

    def read(self) -> Events:
        recording = Recording.load(Path(self.path), self.encoding)
        streams = self._streams(recording)
        dips = [dip for phasors in streams for dip in _dips(phasors)]
        if not dips:
            spans = ", ".join(f"{s.t[0]:.3f} to {s.t[-1]:.3f} s" for s in streams)
            raise UserError(f"{self.path}: no dip found in the waveforms ({spans}): the voltage never falls by 3 %")
        base = self._base(dips, recording.frequency)
        tried = {number: self._record(number, dip, base) for number, dip in enumerate(dips, 1)}
        usable = [number for number, made in tried.items() if isinstance(made, Record)]
        fitted = self.train or usable[:1] or [1]
        first, *rest = [self._pick(number, tried) for number in fitted]
        notes = self._notes(recording, dips)  # of the whole file: said once, on the first record
        if self.validate is not None:
            held = [self._pick(number, tried) for number in self.validate]
            return Events([replace(first, notes=notes), *rest], held)
        others = [made for number, made in tried.items() if number not in fitted]
        notes += tuple(f"not used for validation: {made}" for made in others if isinstance(made, UserError))
        return Events([replace(first, notes=notes), *rest], [made for made in others if isinstance(made, Record)])

    def _pick(self, number: int, tried: dict[int, Record | UserError]) -> Record:
        """Dip `number`; raises `UserError` naming the dips that can be used where this one cannot."""
        usable = ", ".join(f"{n} at {r.t[0]:.3f} to {r.t[-1]:.3f} s" for n, r in tried.items() if isinstance(r, Record))
        made = tried.get(number, UserError(f"{self.path}: there is no dip {number}; {len(tried)} are found"))
        if isinstance(made, UserError):
            raise UserError(f"{made}; dips that can be used: {usable or 'none'}")
        return made

    def _streams(self, recording: Recording) -> list[Phasors]:
        """The phasors of each segment that holds waveforms."""
        voltages = recording.phases("voltages", self.voltages)
        currents = recording.phases("currents", self.currents)
        recording.check_order(voltages, currents)
        chosen = [("voltages", i) for i in voltages] + [("currents", i) for i in currents]
        skew = np.array([recording.channels[i].skew for _, i in chosen]) * 1e-6 if self.skew else None
        streams = []
        for segment in recording.waveforms():
            waves = np.array([recording.primary(key, i, segment) for key, i in chosen])
            waves[3:] *= -1 if self.reverse_current else 1
            try:
                phasors = measure(waves, segment.rate, recording.frequency, segment.start, skew=skew)
            except UserError as error:
                raise UserError(f"{self.path}: segment from {segment.start:.3f} s: {error}") from error
            for key, one, two in (("voltages", phasors.V1, phasors.V2), ("currents", phasors.I1, phasors.I2)):
                if np.median(np.abs(two)) > np.median(np.abs(one)):
                    raise UserError(
                        f"data.{key}={[*getattr(self, key)]}: the negative sequence exceeds the positive one; the "
                        "phases are not in the order a, b, c: exchange two of them"
                    )
            streams.append(phasors)
        return streams

    def _base(self, dips: list[Dip], frequency: float) -> Base:
        """Voltage and apparent power before the first dip that has a steady state before it."""
        dip = next((d for d in dips if d.start - d.first >= FEWEST_BEFORE), None)
        if dip is None:
            raise UserError(
                f"{self.path}: none of the {len(dips)} dips has {FEWEST_BEFORE} phasors before it, which the steady "
                "state needs; give a record with a longer pre-fault time"
            )
        before = dip.phasors.t[dip.start] - STEADY <= dip.phasors.t
        before[: dip.first] = before[dip.start :] = False
        U = float(np.abs(dip.phasors.V1[before]).mean() * np.sqrt(3))
        S = float(np.abs(dip.phasors.S[before].mean()))
        if S < 1e-6:
            raise UserError(f"{self.path}: data.currents carry no power before the first dip ({1e6 * S:.2g} VA)")
        return Base(U, S, frequency)

    def _record(self, number: int, dip: Dip, base: Base) -> Record | UserError:
        """The record of a dip, or why it cannot be used."""
        t = dip.phasors.t
        window = slice(
            max(dip.first, int(np.searchsorted(t, t[dip.start] - self.pre))),
            min(dip.stop, int(np.searchsorted(t, t[dip.start] + self.post))),
        )
        S = dip.phasors.S[window] / base.power
        record = Record(
            name=f"{Path(self.path).stem}_dip{number}",
            t=t[window],
            U=np.sqrt(3) * np.abs(dip.phasors.V1[window]) / base.voltage,
            P=S.real,
            Q=S.imag,
            f=dip.phasors.f[window],
            U2=np.sqrt(3) * np.abs(dip.phasors.V2[window]) / base.voltage,
            base=base,
            source=f"{self.path} dip {number}",
        )
        try:
            detect(record.check())
        except UserError as error:
            return error
        return record

    def _notes(self, recording: Recording, dips: list[Dip]) -> tuple[str, ...]:
        step = dips[0].phasors.t[1] - dips[0].phasors.t[0]
        notes = [f"one-cycle phasors every {1000 * step:.3g} ms, {len(dips)} dips found"]
        fast = recording.waveforms()
        slow = [s for s in recording.segments if s not in fast]
        if slow:
            spans = ", ".join(f"{s.rate:g} Hz from {s.start:.3f} s" for s in slow)
            notes.append(f"segments without waveform left out: {spans}")
        chosen = [(key, i) for key in UNITS for i in recording.phases(key, getattr(self, key))]
        unknown = [
            recording.channels[i] for key, i in chosen if recording.channels[i].uu.strip().lower() not in UNITS[key]
        ]
        if unknown:
            notes.append(f"unit '{unknown[0].uu}' of channel '{unknown[0].name}' taken as V or A")
        skew = max(abs(recording.channels[i].skew) for _, i in chosen)
        if skew > 0 and not self.skew:
            notes.append(f"time skew of up to {skew:.3g} microseconds not corrected (data.skew=true does)")
        return tuple(notes)


def _dips(phasors: Phasors) -> list[Dip]:
    found = find_dips(phasors.t, np.abs(phasors.V1))
    firsts = [0, *(end for _, end in found)]
    stops = [*(start for start, _ in found[1:]), len(phasors.t)]
    return [Dip(phasors, first, *dip, stop) for first, dip, stop in zip(firsts, found, stops, strict=False)]
