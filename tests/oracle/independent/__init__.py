"""An independent simulator of a recorded load: other equations, another solver, instantaneous
waveforms.

It judges the product, so it shares nothing with it: no `tractexp.model`, no plugin is imported. A
stiff three-phase source dips (`source`), an induction machine with stator transients (`machine`)
and a static load (`load`) draw instantaneous currents, and a recorder with noise and a quantizer
turns both into phasors and powers (`recorder`). Every quantity is per unit of the record's base
unless a name says otherwise; a space vector's magnitude is the RMS phasor's, so phase values peak
at 1 pu.
"""

import numpy as np

from independent.load import Load, Static, Waveforms, simulate
from independent.machine import Machine, Stall
from independent.recorder import Recorder
from independent.source import Dip

__all__ = [
    "Dip",
    "Load",
    "Machine",
    "Recorder",
    "Stall",
    "Static",
    "Waveforms",
    "record",
    "simulate",
]


def record(
    load: Load, dip: Dip, recorder: Recorder, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Simulate and record one event.

    Returns `t` [s], `U`, `P`, `Q`, `U2` [pu] and `f` [Hz], each of shape (recorder.samples,), P and
    Q positive when consumed. Raises `Stall` when the load has no steady state before the event.
    """
    return recorder.read(simulate(load, dip, recorder.instants()), rng)
