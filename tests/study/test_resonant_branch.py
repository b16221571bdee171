"""A ringing branch that an independent circuit draws is found by its effect, and none where there
is none.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import wave_records as waves

import tractexp
from independent.source import OMEGA

QUICK = {
    "optimizer": "multistart_least_squares",
    "budget": 1500,
    "check_intervals": False,
    "progress": False,
}
MODEL = {"model": "fifth_order_branch", "domain": "waves", "effects": ["resonant_branch"]}
FINE = {"bounds": {"resonance_frequency": [120.0, 300.0], "ringing_time": [0.005, 0.1]}}


@dataclass(frozen=True)
class Ringing:
    """Resistance, reactance and capacitive susceptance in series [pu]: flux linkage and charge are
    states.
    """

    R: float
    X: float
    B: float

    def settled(self, voltage, frequency):
        i = voltage / (self.R + 1j * self.X * frequency + 1 / (1j * self.B * frequency))
        return self, np.array([i, i / (1j * self.B * frequency)])

    def rates(self, x, v, zero):
        return [OMEGA * (v - self.R * x[0] - x[1]) / self.X, OMEGA * x[0] / self.B]

    def current(self, x, at):
        return x[0]


def beside(*devices):
    """An event of a load drawn by lot, recorded at 6.4 kHz, with more devices beside it."""
    case = waves.case([5, 1], kind="two phases")
    sampler = replace(case.sampler, rate=6400.0)
    return waves.events(
        replace(case, sampler=sampler, site=replace(case.site, more=devices)), [5, 1]
    )


@pytest.mark.long
def test_a_planted_branch_is_found():
    b, f, T = 0.25, 190.0, 0.02
    square = (f / 50) ** 2
    X = 1 / (b * (square - 1))
    events = beside(Ringing(2 * X / (OMEGA * T), X, 1 / (square * X)))
    fit = tractexp.identify(events, tractexp.compose(**MODEL, **FINE), **QUICK)
    bare = tractexp.identify(events, "fifth_order_branch", domain="waves", **QUICK)
    assert fit.parameters["resonance_frequency"].value == pytest.approx(f, rel=0.01)
    assert fit.parameters["ringing_time"].value == pytest.approx(T, rel=0.05)
    assert fit.parameters["resonant_susceptance"].value * fit.result.base.ratio == pytest.approx(
        b, rel=0.05
    )
    left = [one.result.events[0]["epsilon_i"] for one in (fit, bare)]
    assert left[0] < 0.2 * left[1]


@pytest.mark.long
def test_where_nothing_rings_none_is_found():
    fit = tractexp.identify(beside(), tractexp.compose(**MODEL, **FINE), **QUICK)
    low, high = fit.parameters["resonant_susceptance"].interval
    assert low == 0.0
    assert high < 0.05
