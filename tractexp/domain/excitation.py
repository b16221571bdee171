"""What drives a model through a recorded event, in phasors and in waveforms."""

import numpy as np

from tractexp.domain.averaging import find_averaging
from tractexp.model.drive import Excitation, WaveformDrive
from tractexp.model.model import Model
from tractexp.record import Event, WaveEvent
from tractexp.record.window import sharpen_voltage

# by phases, so that the objective is the mean over them
WEIGHTS = {3: (0.5, 0.5, 1.0), 1: (1.0, 0.0, 0.0)}


def excite_phasors(
    event: Event, model: Model | None = None, weights: tuple[float, float] = (1.0, 1.0)
) -> Excitation:
    """The voltage and the power of an event; squared errors of P and of Q count by `weights`.

    A recorded frequency sets the synchronous speed. A model that is looked at through the
    recorder's window is driven by the voltage that the load saw, computed back through it.
    """
    averaging = find_averaging(event, model)
    if averaging is not None:
        event = sharpen_voltage(event, *averaging)
    record, nominal = event.record, 2 * np.pi * event.record.base.frequency
    return Excitation(
        step=record.step,
        U=record.U,
        P=record.P,
        Q=record.Q,
        U0=event.U0,
        P0=event.P0,
        Q0=event.Q0,
        omega_s=None if record.f is None else 2 * np.pi * record.f - nominal,
        omega_s0=0.0 if record.f is None else 2 * np.pi * event.f0 - nominal,
        omega_n=nominal,
        U2=record.U2,
        U20=float("nan") if record.U2 is None else float(record.U2[event.steady].mean()),
        weight_P=weights[0],
        weight_Q=weights[1],
        window=averaging and averaging.weights,
        U_angle=record.U_angle,
    )


def excite_waveforms(event: WaveEvent) -> WaveformDrive:
    """The voltage's space vector of an event, and its currents."""
    assert event.record.U2 is not None
    return WaveformDrive(
        step=event.record.step,
        v=event.v,
        v_zero=event.v_zero,
        turn=event.turn,
        currents=event.currents,
        U=event.record.U,
        U2=event.record.U2,
        U0=event.U0,
        P0=event.P0,
        Q0=event.Q0,
        U20=float(event.record.U2[event.steady].mean()),
        omega_s0=event.omega_s0,
        omega_n=2 * np.pi * event.record.base.frequency,
        weights=WEIGHTS[event.phases],
    )
