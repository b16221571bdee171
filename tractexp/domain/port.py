"""Voltage and current of an event as a linear network sees them: how they deviate from the steady state before the dip.

In waveforms both are space vectors in the frame that turns with the voltage before the dip, in phasors the voltage is
its magnitude and the current P - jQ. A network of waveforms draws in the steady state what the load draws there: so its
response to a constant voltage is known. In phasors it is not, for P and Q may follow any power of the voltage.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tractexp.record import Event, WaveEvent
from tractexp.record.wave_event import stationary

Complex = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, eq=False)
class Port:
    """Deviations of the voltage u (N,) and of the current i (N,) [pu], complex, from the sample `start` of a dip on.

    The current is nan where it is not compared. `steady` [pu] is the response to a constant voltage, None where that is
    not known. `turns` is at how many Hz the frame turns, 0 of phasors. `series`: resistance and inductance in series.
    """

    u: Complex
    i: Complex
    step: float  # s
    start: int
    steady: complex | None
    turns: float = 0.0
    series: bool = False

    @property
    def known(self) -> Complex:
        """What is known of the response (N,) [pu]."""
        return (0.0 if self.steady is None else self.steady) * self.u


def power_port(event: Event) -> Port:
    """U against P - jQ, both less their means before the dip."""
    record = event.record
    i = (record.P - event.P0) - 1j * (record.Q - event.Q0)
    return Port((record.U - event.U0).astype(complex), i, record.step, event.start, None)


def current_ports(event: WaveEvent) -> tuple[Port, ...]:
    """The space vectors, less the fundamental before the dip, and the zero sequence where it is compared.

    Of a single phase the imaginary part is what it was a quarter of a cycle ago, of the current as of the voltage.
    """
    step = event.record.step
    i = event.currents[0] + 1j * event.currents[1]
    if event.phases == 1:
        i, _ = stationary(event.currents[:1], event.rate, event.f0)
    Y = admittance(event)
    vectors = Port(event.v - event.U0, i / event.turn - Y * event.U0, step, event.start, Y, event.f0)
    zero = Port(event.v_zero + 0j, event.currents[2] + 0j, step, event.start, None, series=True)
    return (vectors, zero) if event.compared[2] else (vectors,)


def admittance(event: WaveEvent) -> complex:
    """What the load draws of the fundamental before the dip [pu]."""
    return (event.P0 - 1j * event.Q0) / event.U0**2
