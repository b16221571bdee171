"""Calculated waveforms as the record's estimator would have seen them: P and Q that compare with those of phasors."""

from dataclasses import replace

import numpy as np

from tractexp.record import Event, Record, WaveEvent
from tractexp.record.phasor import Phasors, measure
from tractexp.recording.estimator import estimator_of


def seen_by_estimator(event: WaveEvent, currents: np.ndarray) -> tuple[Event, np.ndarray, np.ndarray]:
    """The event in phasors of its recorded waveforms, and P and Q (M,) [pu] of calculated currents (3, N).

    Both are measured by one estimator from the same samples, so that its window cancels when they are compared.
    """
    measured, calculated = (_phasors(event, i) for i in (np.nan_to_num(event.currents), currents))
    was, own = event.phasors, event.phasors.record
    record = Record(
        own.name, measured.t, measured.U, measured.S.real, measured.S.imag, base=own.base, source=own.source,
        notes=own.notes, original_base=own.original_base, identity=own.identity, digest=own.digest,
    )  # fmt: skip
    start, end = np.searchsorted(measured.t, [was.t_start, was.t_end]).tolist()
    last = len(measured.t) - 1
    made = replace(was, record=record, start=min(start, last), end=min(end, last), steady=slice(0, max(start, 1)))
    return made, calculated.S.real, calculated.S.imag


def _phasors(event: WaveEvent, currents: np.ndarray) -> Phasors:
    """Phasors of the recorded voltage and of currents (3, N) [pu], whose U and S are per unit, too."""
    part = slice(event.lead, None)
    v = event.v * event.turn
    voltage = event.of_phases(np.stack([v.real, v.imag, event.v_zero]))
    size = np.sqrt(2 / event.phases)  # so that K V I* of the peaks' phasors is v i*
    waves = np.concatenate([voltage, event.of_phases(currents)])[:, part] * size
    recorded, base = event.phasors.record.waves, event.phasors.record.base
    assert recorded is not None
    window = estimator_of(recorded.estimator).averager
    return measure(waves, event.rate, base.frequency, float(event.record.t[event.lead]), window=window)
