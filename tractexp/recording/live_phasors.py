"""Phasors of a feeder while it is alive, and the power in them."""

from dataclasses import dataclass

import numpy as np

from tractexp.configuration.plugin import build_chosen
from tractexp.record.direction import find_values_at_level
from tractexp.record.phasor import compute_sequences
from tractexp.recording.feeder import Feeder
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import choose_frequency, take_snapshots

LEAST_LIVE_SEQUENCE = 0.5  # of the upper level of V1: less is a fault, or a dead line
LOADED = 0.2  # of the upper level of I1, as well
LARGEST_CALM_VOLTAGE_SHARE = 0.05  # of the median V1: the state in which orders are compared
LEAST_FAULT_UNBALANCE = 0.05  # V2 over V1 of a fault that is none of all phases
# degrees of I2 / V2 of a passive load: inductive, at most a little capacitive
ANSWERS = (-110.0, 30.0)
ADDED = 0.02  # V2 over V1 that must be added before the answer in I2 counts
# times the current before: more feeds a fault behind the current transformer, and says nothing of a
# load
FAULT = 2.5


@dataclass(frozen=True, eq=False)
class LivePhasors:
    """Phasors of a feeder while it is alive, (3, M) each, and which of them are calm."""

    V: np.ndarray
    I: np.ndarray
    calm: np.ndarray
    current_turns: bool  # some current is a wave of the network's frequency, and not noise


def measure_live_phasors(recording: Recording, feeder: Feeder) -> LivePhasors | None:
    """The feeder's phasors while voltage and current are alive; None where they never are."""
    numbers = [*feeder.voltages, *feeder.currents]
    windows = take_snapshots(recording, numbers, choose_frequency(recording, feeder.voltages))
    if windows is None or not any(windows.pure(i) for i in feeder.voltages):
        return None  # noise has no order
    connection = build_chosen("connection", feeder.connection)
    V = connection.voltage() @ windows.select_channels(feeder.voltages)
    I = (
        connection.current()
        @ windows.select_channels(feeder.currents)
        * (-1 if feeder.reverse_current else 1)
    )
    valid = np.isfinite(V).all(axis=0) & np.isfinite(I).all(axis=0)
    V, I = V[:, valid], I[:, valid]
    size, load = (np.linalg.norm(x, axis=0) for x in (V, I))
    if not V.shape[1] or size.max() == 0 or load.max() == 0:
        return None
    alive = size > LEAST_LIVE_SEQUENCE * np.percentile(size, 90)
    if len(V) == 3:
        small, large = np.sort(np.abs(compute_sequences(V)), axis=0)  # whatever the order is
        even = alive & (small < LEAST_FAULT_UNBALANCE * large)
        even = even if even.any() else alive
    else:
        even = alive
    calm = np.zeros(len(size), bool)
    calm[even] = find_values_at_level(size[even], LARGEST_CALM_VOLTAGE_SHARE)
    # not of all: a fault may last longer than the calm
    alive &= load > LOADED * np.median(load[calm])
    if not (alive & calm).any():
        return None
    turns = any(windows.pure(i) for i in feeder.currents)
    return LivePhasors(V[:, alive], I[:, alive], calm[alive], turns)


def measure_zero_sequence(x: np.ndarray) -> np.ndarray:
    """The size of the zero sequence of three channels (3, N)."""
    return np.abs(x.mean(axis=0))


def compute_power(live: LivePhasors, permutation: tuple[int, ...]) -> complex:
    """P + jQ [MVA] in the calm state with the currents in another order."""
    S = 3 * compute_sequences(live.V)[0] * compute_sequences(live.I[[*permutation]])[0].conj()
    S = S[live.calm]
    return complex(np.median(S.real), np.median(S.imag))


def measure_angle(S: complex | np.complexfloating) -> float:
    """The angle of a power [degrees]."""
    return float(np.degrees(np.angle(S)))


def format_power(S: complex) -> str:
    """ "P = 12 MW, Q = 3 Mvar"."""
    P, Q = (0.0 if abs(x) < 1e-6 * abs(S) else x for x in (S.real, S.imag))
    return f"P = {P:.3g} MW, Q = {Q:.3g} Mvar"


def find_answer(live: LivePhasors, permutation: tuple[int, ...] = (0, 1, 2)) -> int:
    """1 where the added I2 is what a passive load draws from the added V2, -1 where it is turned
    round, else 0.
    """
    V2, I2 = compute_sequences(live.V)[1], compute_sequences(live.I[[*permutation]])[1]
    V1 = np.abs(compute_sequences(live.V)[0])
    V2, I2 = V2 * _find_turns(live), I2 * _find_turns(live)
    dV, dI = V2 - np.median(V2[live.calm]), I2 - np.median(I2[live.calm])
    changed = np.abs(dV) > ADDED * np.median(V1)
    most = np.abs(live.I).max(axis=0)
    if np.count_nonzero(changed) < 2 or most[changed].max() > FAULT * np.median(most[live.calm]):
        return 0
    Y = np.vdot(dV[changed], dI[changed])
    low, high = ANSWERS
    if low <= measure_angle(Y) <= high:
        return 1
    return -1 if low <= measure_angle(-Y) <= high else 0


def _find_turns(live: LivePhasors) -> np.ndarray:
    """The factors (M,) that turn phasors so that V1 has angle zero: windows far apart can then be
    compared.
    """
    V1 = compute_sequences(live.V)[0]
    return V1.conj() / np.maximum(np.abs(V1), 1e-12)
