"""Waveforms that nobody recorded: a voltage by its space vector, as a dip to plan
for or to play.
"""

import numpy as np

from tractexp.record.event import Event
from tractexp.record.record import Base, Record
from tractexp.record.wave_event import WaveEvent, average_half_cycle
from tractexp.record.waves import Waves


def build_synthetic_event(
    name: str,
    t: np.ndarray,
    v: np.ndarray,
    before: tuple[float, float, float],
    frequency: float,
    start: int,
    end: int,
) -> WaveEvent:
    """The event of a voltage v (N,) complex [pu] in the frame of that before, at uniform times t
    (N,) [s].

    A negative sequence N conj(turn) of the stationary frame is N conj(turn)² here; there is no zero
    sequence. `before` are U0, P0 and Q0 [pu], `start` and `end` samples. The currents are those
    before the event all along: no forecast looks at them, and no load is simulated from them.
    """
    U0, P0, Q0 = before
    rate, turn, absent = (
        1 / (t[1] - t[0]),
        np.exp(2j * np.pi * frequency * t),
        np.full(len(t), np.nan),
    )
    U, _, U2 = average_half_cycle(v, v, turn, rate, frequency)
    waves = Waves(np.empty((6, 0)), float(t[0]), float(rate))
    flat = np.full(len(t), P0), np.full(len(t), Q0)
    record = Record(name, t, U, *flat, U2=U2, base=Base(frequency=frequency), waves=waves)
    fields = {
        "start": start,
        "end": end,
        "depth": 1 - float(U[start:end].min(initial=U0)) / U0,
        "U0": U0,
        "P0": P0,
        "Q0": Q0,
        "f0": frequency,
        "noise_U": 0.0,
        "noise_P": 0.0,
        "noise_Q": 0.0,
        "steady": slice(0, max(start, 1)),
        "dips": 1,
    }
    i = (P0 - 1j * Q0) / U0 * turn
    return WaveEvent(
        record=record,
        **fields,
        phasors=Event(record=record, **fields),
        v=v.astype(complex),
        v_zero=np.zeros(len(t)),
        weights=np.ones(1),
        turn=turn,
        currents=np.stack([i.real, i.imag, absent]),
        lead=0,
        omega_s0=0.0,
        random=(0.0, 0.0, 0.0),
        unexplained=np.zeros((3, max(start, 1))),
        offsets=np.zeros(6),
        phases=3,
    )
