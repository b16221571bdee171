"""Fewer samples of a record, without what would alias.

Each sample that is kept is the mean of those about it by a triangle as wide as two steps of the
kept ones, which has its zeros at their rate and its multiples: what is near these would fold into
the band. Voltage and current are averaged, as a recorder averages phasors, and the record's window
is the one it had and this one, so that a model may be looked at through both.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tractexp.record.angle import integrate
from tractexp.record.record import Record
from tractexp.record.window import Window, average, averaged_power

NAME = "thinned"  # of the window of a record that said none


def thin_record(record: Record, every: int) -> Record:
    """One of so many samples of a record.

    Parameters
    ----------
    record : Record
        Its waveforms are left out.
    every : int
        How many samples become one; 1 leaves the record as it is.

    Returns
    -------
    Record
        Where a gap of P or Q was is one, a sample wider.
    """
    if every == 1:
        return replace(record, waves=None)
    ramp = np.arange(1, every)
    weights = np.concatenate([ramp, [every], ramp[::-1]]) / every**2
    turned = _find_angle(record)
    u: NDArray[np.complex128] = record.U * np.exp(1j * turned)
    mean = average(u.real, weights) + 1j * average(u.imag, weights)
    P, Q = averaged_power(np.stack([record.P, record.Q]), u, weights)
    averaged = {
        name: average(values, weights)
        for name, values in record.channels.items()
        if name in ("f", "U2")
    }
    if record.U_angle is not None:
        averaged["U_angle"] = turned + np.angle(mean * np.exp(-1j * turned))
    whole = replace(
        record,
        U=np.abs(mean),
        P=P,
        Q=Q,
        waves=None,
        window=_combine_windows(record.window, weights, record.step),
        **averaged,
    )
    return whole.part(slice(None, None, every))


def _find_angle(record: Record) -> np.ndarray:
    """The angle (N,) [rad] of the voltage in a frame that turns at nominal frequency: as recorded,
    else as f turns it, else zero.
    """
    if record.U_angle is not None:
        return record.U_angle
    if record.f is None:
        return np.zeros(record.samples)
    return integrate(2 * np.pi * (record.f - record.base.frequency), record.step)


def _combine_windows(own: Window | None, weights: np.ndarray, step: float) -> Window:
    """A window and then weights (odd,) of samples `step` [s] apart."""
    if own is not None:
        weights = np.convolve(own.compute_weights(step), weights)
    at = step * (np.arange(len(weights)) - len(weights) // 2)
    return Window(own.name if own else NAME, at, weights)
