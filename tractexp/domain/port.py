"""Voltage and current of an event as a linear network sees them: how they deviate from the steady
state before the dip.

In waveforms both are space vectors in the frame that turns with the voltage before the dip, and
what is periodic there, harmonics and unbalance, goes on. In phasors the voltage is its magnitude
and the current P - jQ. A network of waveforms draws of the fundamental what the load draws before
the dip: so its response to a constant voltage is known. In phasors it is not, for P and Q may
follow any power of the voltage.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tractexp.record import Event, WaveEvent
from tractexp.record.periodic import Periodic
from tractexp.record.wave_event import transform_stationary

Complex = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True, eq=False)
class Port:
    """The deviations of voltage and current at a load's terminals from their course before a dip.

    Attributes
    ----------
    u : (N,) complex [pu]
        Of the voltage.
    i : (N,) complex [pu]
        Of the current; nan where it is not compared.
    step : float [s]
        Between samples.
    start : int
        First sample of the dip.
    steady : complex or None [pu]
        The response to a constant voltage; None where that is not known.
    turns : float [Hz]
        At which the frame turns; 0 of phasors.
    series : bool
        Whether the port is a resistance and an inductance in series.
    """

    u: Complex
    i: Complex
    step: float  # s
    start: int
    steady: complex | None
    turns: float = 0.0
    series: bool = False

    @property
    def steady_response(self) -> Complex:
        """The part of the response (N,) [pu] that the steady state tells: 0 where it tells none."""
        return (0.0 if self.steady is None else self.steady) * self.u


def build_power_port(event: Event) -> Port:
    """The port of phasors: U against P - jQ, both less their means before the dip."""
    record = event.record
    i = (record.P - event.P0) - 1j * (record.Q - event.Q0)
    return Port((record.U - event.U0).astype(complex), i, record.step, event.start, None)


def build_current_ports(event: WaveEvent) -> tuple[Port, ...]:
    """The space vectors, and the zero sequence where it is compared, less their periodic courses
    before the dip.

    Of a single phase the imaginary part is what it was a quarter of a cycle ago, of the current as
    of the voltage.
    """
    step, v = event.record.step, event.v * event.turn
    u = np.stack([v.real, v.imag, event.v_zero])
    u, i = (
        u - continue_periodic_course(event, u),
        event.currents - continue_periodic_course(event, event.currents),
    )
    vector = (
        transform_stationary(i[:1], event.rate, event.f0)[0]
        if event.phases == 1
        else i[0] + 1j * i[1]
    )
    Y = (event.P0 - 1j * event.Q0) / event.U0**2
    vectors = Port(
        (u[0] + 1j * u[1]) / event.turn, vector / event.turn, step, event.start, Y, event.f0
    )
    zero = Port(u[2] + 0j, i[2] + 0j, step, event.start, None, series=True)
    return (vectors, zero) if event.compared_channels[2] else (vectors,)


def continue_periodic_course(event: WaveEvent, channels: np.ndarray) -> np.ndarray:
    """The course of channels before the dip, harmonics included, continued through the event.

    Parameters
    ----------
    event : WaveEvent
        With N samples.
    channels : (C, N)
        Waveforms.

    Returns
    -------
    (C, N) array
        0 of a channel that is not compared.
    """
    t, part = event.record.t, event.steady
    there = np.isfinite(channels[:, part]).all(axis=1)
    course = np.zeros(channels.shape)
    course[there] = Periodic.from_samples(
        t[part], channels[there][:, part], event.f0, event.rate
    ).evaluate_at(t)
    return course
