"""Phasors of one load, their symmetrical components, and the powers that follow from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

TURN = np.exp(2j * np.pi / 3)  # the operator a of symmetrical components


def compute_sequences(phases: np.ndarray) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """The positive and the negative sequence of three phases.

    Parameters
    ----------
    phases : (3, N) complex
        Phasors in the order a, b, c.

    Returns
    -------
    (N,) complex array
        Positive sequence, as phase a has it.
    (N,) complex array
        Negative sequence.

    Notes
    -----
    Source: Fortescue 1918.

    Examples
    --------
    >>> a = np.exp(-2j * np.pi / 3)
    >>> positive, negative = compute_sequences(np.array([[1.0], [a], [a**2]]))
    >>> abs(positive).round(9).tolist(), abs(negative).round(9).tolist()
    ([1.0], [0.0])
    """
    a, b, c = phases
    return (a + TURN * b + TURN**2 * c) / 3, (a + TURN**2 * b + TURN * c) / 3


def compute_symmetrical(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The positive and negative sequence (N,) of phasors (3, N); of a single phase (1, N) itself
    and zero.
    """
    return compute_sequences(X) if len(X) == 3 else (X[0], np.zeros_like(X[0]))


@dataclass(frozen=True, eq=False)
class Phasors:
    """RMS phasors of one load at uniform times.

    Attributes
    ----------
    t : (M,) [s]
        Times.
    V : (K, M) complex [kV]
        Phase to ground; of a single-phase load (K = 1) the voltage it is fed with.
    I : (K, M) complex [kA]
        Into the load.
    f : (M,) [Hz]
        At which the (positive-sequence) voltage turns.
    more : {name: (M,)}
        Powers of harmonics P_3, ..., P_H [MW] and distortions THD_u, THD_i.
    bridged : tuple of float [s]
        When samples were missing in the waveforms.
    """

    t: np.ndarray  # (M,) s
    # (K, M) kV, phase to ground; of a single-phase load the voltage it is fed with
    V: NDArray[np.complex128]
    I: NDArray[np.complex128]  # (K, M) kA, into the load
    f: np.ndarray  # (M,) Hz, at which the (positive-sequence) voltage turns
    # (M,) each: P_3, ..., P_H [MW], THD_u, THD_i
    more: Mapping[str, np.ndarray] = field(default_factory=dict)
    bridged: tuple[float, ...] = ()  # s: samples that were missing in the waveforms

    @property
    def V1(self) -> NDArray[np.complex128]:
        """Positive-sequence voltage (M,) [kV]; of a single-phase load its voltage."""
        return compute_symmetrical(self.V)[0]

    @property
    def V2(self) -> NDArray[np.complex128]:
        """Negative-sequence voltage (M,) [kV]; zero for a single-phase load."""
        return compute_symmetrical(self.V)[1]

    @property
    def I1(self) -> NDArray[np.complex128]:
        """Positive-sequence current (M,) [kA]; of a single-phase load its current."""
        return compute_symmetrical(self.I)[0]

    @property
    def I2(self) -> NDArray[np.complex128]:
        """Negative-sequence current (M,) [kA]; zero for a single-phase load."""
        return compute_symmetrical(self.I)[1]

    @property
    def S(self) -> NDArray[np.complex128]:
        """Power P + jQ [MVA], (M,) complex: of the positive sequence, 3 V1 I1*; of a single-phase
        load V I*.
        """
        return len(self.V) * self.V1 * self.I1.conj()

    @property
    def U(self) -> np.ndarray:
        """Voltage (M,) [kV] as records have it: line to line; of a single-phase load its own."""
        return np.sqrt(len(self.V)) * np.abs(self.V1)

    @property
    def U2(self) -> np.ndarray:
        """Negative-sequence voltage (M,) [kV], line to line."""
        return np.sqrt(len(self.V)) * np.abs(self.V2)


def join_phasors(parts: Sequence[Phasors]) -> Phasors:
    """Join phasors that follow each other without a gap.

    The frame of each part is turned so that V1 goes on where the part before it ends; what no
    window saw at a change of rate is interpolated.

    Parameters
    ----------
    parts : sequence of Phasors
        In order of time.

    Returns
    -------
    Phasors
        Evenly spaced, by the widest of their steps.
    """
    if len(parts) == 1:
        return parts[0]
    turned = [parts[0]]
    for part in parts[1:]:
        angle = np.exp(1j * (np.angle(turned[-1].V1[-1]) - np.angle(part.V1[0])))
        turned.append(replace(part, V=part.V * angle, I=part.I * angle))
    at = np.concatenate([part.t for part in turned])
    step = max(float(part.t[1] - part.t[0]) for part in turned if len(part.t) > 1)
    t = at[0] + step * np.arange(int((at[-1] - at[0]) / step + 1e-6) + 1)

    def join(rows: Sequence[np.ndarray]) -> np.ndarray:
        values = np.concatenate(rows, axis=-1)
        return np.array([np.interp(t, at, row) for row in np.atleast_2d(values)]).reshape(
            *values.shape[:-1], len(t)
        )

    more = {name: join([part.more[name] for part in turned]) for name in turned[0].more}
    V, I, f = (join([getattr(part, name) for part in turned]) for name in ("V", "I", "f"))
    return Phasors(t, V, I, f, more, tuple(each for part in turned for each in part.bridged))
