"""A fault of the network as a load feels it: three phases of their own, through a transformer,
sample by sample.

During the fault each phase of the high-voltage side keeps a share of its voltage, turned by an
angle; the phases are cleared one after the other, at successive zeros of the fault's current. A
delta/star transformer mixes them and keeps the zero sequence out.
"""

from dataclasses import dataclass

import numpy as np

from independent.source import NOMINAL_FREQUENCY, smooth

TURN = np.exp(2j * np.pi / 3)
# s: harmonics are led in so long, so long before the record, that they leave no offset behind
BUILT_UP = (0.3, 0.2)


@dataclass(frozen=True)
class Fault:
    """What is left of each phase's phasor, from `start` [s] for `duration` [s]; the source is
    stiff.

    `edge` [s] is what a phase takes to fall and to come back; the share `sag` comes back with the
    time constant `settle` [s]. `harmonics` are (order, peak [pu], angle [rad]) of the voltage,
    before, during and after alike.
    """

    left: tuple[complex, complex, complex]
    start: float
    duration: float
    voltage: float = 1.0  # pu, peak of a phase before
    frequency: float = NOMINAL_FREQUENCY  # Hz
    angle: float = 0.0  # rad, of phase a at t = 0
    edge: float = 1e-3
    sag: float = 0.0
    settle: float = 0.1
    delta: bool = True  # seen through a delta/star transformer
    harmonics: tuple[tuple[int, float, float], ...] = ()

    @property
    def end(self) -> float:
        """When the last phase is cleared [s]."""
        return self.start + self.duration + 1 / (3 * self.frequency)

    def phases(self, t: np.ndarray | float) -> np.ndarray:
        """Voltages (3, n) [pu of the peak] at times t (n,) [s]."""
        t = np.atleast_1d(t)
        angle = self.angle + 2 * np.pi * self.frequency * t
        seen = np.stack(
            [(self._kept(t, k) * TURN ** (-k) * np.exp(1j * angle)).real for k in range(3)]
        )
        if self.delta:
            seen = (seen - np.roll(seen, 1, axis=0)) / np.sqrt(3)
        seen *= self.voltage
        ramp = smooth((t - self.start + sum(BUILT_UP)) / BUILT_UP[0])
        for order, size, shift in self.harmonics:
            seen += (
                ramp
                * size
                * np.cos(order * (angle - 2 * np.pi / 3 * np.arange(3)[:, None]) + shift)
            )
        return seen

    def _kept(self, t: np.ndarray, phase: int) -> np.ndarray:
        """What is left of a phase's phasor."""
        cleared = t - self.start - self.duration - phase / (6 * self.frequency)
        soft = self.sag * np.exp(-np.maximum(cleared, 0.0) / self.settle)
        gone = smooth((t - self.start) / self.edge) * (
            (1 - self.sag) * (1 - smooth(cleared / self.edge)) + soft
        )
        return 1 + (self.left[phase] - 1) * gone

    def at(self, t: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Space vector and zero sequence (n,) [pu]."""
        return vector(self.phases(t))

    @property
    def before(self) -> complex:
        """The space vector's phasor before the fault, about t = 0 [pu]."""
        shift = np.exp(-1j * np.pi / 6) if self.delta else 1.0  # u_a - u_c lags u_a by 30 degrees
        return self.voltage * np.exp(1j * self.angle) * shift


def vector(phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Space vector (n,) complex and zero sequence (n,) of phases (3, n)."""
    return 2 / 3 * (TURN ** np.arange(3) @ phases), phases.mean(axis=0)
