"""The measurement chain: instants, windows, delays and instrument transformers between the bus and
the record.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from independent.source import OMEGA, Dip

FINE = 0.001  # s, grid on which windows are averaged

CYCLE = 0.02  # s
PMU_REACH = {"P": CYCLE, "M": 71 / 800}  # s on either side of a time stamp
PASSED = 7.75  # Hz, the reference frequency of the M class at 50 phasors a second

# times (n,) -> voltage and current phasors (n,)
Bus = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Recorder:
    """A recorder of `samples` every 1/`rate`; each further field is an imperfection,
    absent at 0.
    """

    rate: float = 500.0  # Hz
    samples: int = 1000
    skew: float = 0.0  # s, power comes later than voltage
    window: float = 0.0  # s, over which a transducer averages power, centered
    # s, over which voltage and current phasors are both formed, centered
    phasor_window: float = 0.0
    # "P" or "M": phasors are formed by the reference filter of that class of measurement unit
    # instead
    pmu: str = ""
    gain_drift: float = 0.0  # 1/s, of the voltage channel
    # share of current beyond its value before that a saturating current transformer loses
    knee: float = 0.0

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return (self.samples - 1) / self.rate

    @property
    def t(self) -> np.ndarray:
        """Times of the record (samples,) [s]."""
        return np.arange(self.samples) / self.rate

    def read(self, bus: Bus, dip: Dip) -> dict[str, np.ndarray]:
        """Channels `U`, `P`, `Q` (samples,) [pu] of a bus, without noise."""
        U, S = self.power_at(self.t, bus, dip)
        if self.window or self.skew:
            S = self.transduced(self.t - self.skew, bus, dip)
        gain = 1 + self.gain_drift * self.t
        return {"U": gain * U, "P": gain * S.real, "Q": gain * S.imag}

    def transduced(self, t: np.ndarray, bus: Bus, dip: Dip) -> np.ndarray:
        """Complex power at times t, averaged over `window`."""
        if not self.window:
            return self.power_at(t, bus, dip)[1]
        fine = spread(t, self.window)
        return averaged(fine, self.power_at(fine, bus, dip)[1], t, self.window)

    def power_at(self, t: np.ndarray, bus: Bus, dip: Dip) -> tuple[np.ndarray, np.ndarray]:
        """Voltage magnitude and complex power at times t, from the phasors the recorder forms."""
        if not self.phasor_window and not self.pmu:
            V, current = self.instrument(*bus(t))
        else:
            fine = spread(t, 2 * PMU_REACH[self.pmu] if self.pmu else self.phasor_window)
            # a DFT turns with nominal frequency
            turn = np.exp(1j * (dip.phase(fine) - OMEGA * fine))
            V, current = (self.formed(fine, turn * y, t) for y in self.instrument(*bus(fine)))
        return np.abs(V), V * np.conj(current)

    def formed(self, fine: np.ndarray, y: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Phasors at times t of instantaneous ones y, given on a fine grid, by the window or the
        class.
        """
        return (
            weighed(fine, y, t, self.pmu) if self.pmu else averaged(fine, y, t, self.phasor_window)
        )

    def instrument(self, V: np.ndarray, current: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Secondary phasors: the current transformer loses a share of what exceeds the current
        before, and leads.
        """
        if self.knee:
            excess = np.maximum(np.abs(current) / np.abs(current[0]) - 1, 0.0)
            current = current * (1 - self.knee * excess * (1 - 0.5j) / (1 + excess))
        return V, current


def spread(t: np.ndarray, window: float) -> np.ndarray:
    """A fine grid that covers every window around the times t."""
    first, last = t[0] - window / 2, t[-1] + window / 2
    return np.linspace(first, last, int(np.ceil((last - first) / FINE)) + 1)


def averaged(fine: np.ndarray, y: np.ndarray, t: np.ndarray, window: float) -> np.ndarray:
    """Mean of y, given on a fine grid, over the window centered on each of the times t."""
    from scipy.interpolate import PchipInterpolator

    parts = [y.real, y.imag] if np.iscomplexobj(y) else [y]
    integrals = [PchipInterpolator(fine, part).antiderivative() for part in parts]
    means = [(F(t + window / 2) - F(t - window / 2)) / window for F in integrals]
    return means[0] + 1j * means[1] if len(means) == 2 else means[0]


def weighed(fine: np.ndarray, y: np.ndarray, t: np.ndarray, pmu: str) -> np.ndarray:
    """What a measurement unit's reference filter makes of y, given on a fine grid, at each of the
    times t.

    Source: IEC/IEEE 60255-118-1, annex D: a triangle over two cycles (P); a sinc under a Hamming
    window (M, at 50 Hz and 50 phasors a second). Both are applied to the envelope, as functions of
    time, not at a device's own samples.
    """
    from scipy.interpolate import PchipInterpolator

    reach = PMU_REACH[pmu]
    tau = np.linspace(-reach, reach, 101)
    weights = 1 - np.abs(tau) / reach
    if pmu == "M":
        weights = np.sinc(4 * PASSED * tau) * (0.54 + 0.46 * np.cos(np.pi * tau / reach))
    weights[[0, -1]] /= 2
    weights /= weights.sum()
    real, imag = PchipInterpolator(fine, y.real), PchipInterpolator(fine, y.imag)
    near = t[:, None] + tau
    return (real(near) + 1j * imag(near)) @ weights
