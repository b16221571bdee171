"""The window of an M-class phasor measurement unit."""

import numpy as np

from tractexp.extend import DATA, Estimator, UserError, plugin

# {nominal frequency [Hz]: {reporting rate [1/s]: (reference frequency F_fr [Hz], order N at 16
# samples a cycle)}}
FILTERS = {
    50: {10: (1.779, 806), 25: (4.355, 338), 50: (7.75, 142), 100: (14.1, 66)},
    60: {
        10: (1.78, 968),
        12: (2.125, 816),
        15: (2.64, 662),
        20: (3.5, 502),
        30: (5.02, 306),
        60: (8.19, 164),
        120: (16.25, 70),
    },
}


@plugin
class MClass(Estimator):
    """The windowed sinc of the standard's M-class reference: selective, for measurement; slow.

        w(t) = sinc(4 F_fr t) (0.54 + 0.46 cos(2 pi t / T)),  |t| <= T/2,  T = N / (16 f_0)

    F_fr and N follow from the rate at which the unit reports, so that nothing above half of it gets
    through.

    Source: IEC/IEEE 60255-118-1:2018, annex D.7, eq. (D.7) and table D.1.
    Departures: the sinusoid is taken at the tracked frequency by least squares, where the reference
    turns at the nominal one; phasors are given as often as for the other estimators.
    """

    reporting: int | None = None  # phasors a second of the unit; null: the nominal frequency

    def check(self) -> None:
        supported = sorted({rate for table in FILTERS.values() for rate in table})
        if self.reporting is not None and self.reporting not in supported:
            rates = ", ".join(map(str, supported))
            raise UserError(
                f"{DATA.estimator}.reporting={self.reporting} is none of the standard's rates:"
                f" {rates}"
            )

    def filter(self, nominal: float) -> tuple[float, float]:
        """F_fr [Hz] and the window's length [s]; raises `UserError` where the standard has none."""
        table = FILTERS.get(round(nominal), {}) if abs(nominal - round(nominal)) < 1e-9 else {}
        rate = round(nominal) if self.reporting is None else self.reporting
        if rate not in table:
            rates = f": {', '.join(map(str, table))}" if table else ""
            raise UserError(
                f"{DATA.estimator}=m_class: the standard has no M-class filter for {rate} phasors a"
                f" second at {nominal:g} Hz{rates}; choose another estimator, e.g. one_cycle"
            )
        reference, order = table[rate]
        return reference, order / (16 * nominal)

    def half(self, nominal: float) -> float:
        return self.filter(nominal)[1] / 2

    def weight(self, at: np.ndarray, nominal: float) -> np.ndarray:
        reference, length = self.filter(nominal)
        return np.sinc(4 * reference * at) * (0.54 + 0.46 * np.cos(2 * np.pi * at / length))
