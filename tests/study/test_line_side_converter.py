"""The line-side converter: a single-phase converter simulated without space vectors is identified
from its record.
"""

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from waves_of import dip, event, vector

import tractexp
from tractexp.configuration.plugin import get
from tractexp.errors import UserError
from tractexp.model.drive import Drive
from tractexp.model.model import compose

OMEGA, RATE, KV, MVA = 2 * np.pi * 50.0, 5000.0, 25.0, 10.0
TRUTH = {
    "P_c": 0.8,
    "X_c": 0.35,
    "current_bandwidth": 700.0,
    "control_delay": 5e-4,
    "pll_bandwidth": 80.0,
    "dc_link": 0.03,
    "dc_bandwidth": 60.0,
    "current_limit": 1.3,
}


@functools.cache
def model(static="none"):
    return compose(
        get("model/motor", "line_side_converter")(), get("model/static", static)(), domain="waves"
    )


def at_fault(t):
    """The phase's voltage [pu of its peak]: a dip to 0.6 with a jump of the angle, and 3 % of third
    harmonic.
    """
    return dip(0.4, jump=0.35, end=0.12, edge=0.002)(t).real + 0.03 * np.cos(3 * OMEGA * t + 1.0)


def single_phase(t, p, resistance=0.05, weakening=5.0):
    """The current (N,) [pu] of a single-phase converter at times t: sines and cosines, angles and
    real numbers only.

    Its phase-locked loop makes a second axis of the voltage a quarter of a cycle ago. The dc link
    carries the ripple of twice the frequency, which a notch takes out of what its control reads.
    """
    u = at_fault
    L, a = p["X_c"] / OMEGA, p["current_bandwidth"]
    K, w_p, i_0 = a * L, p["pll_bandwidth"], p["P_c"]
    wanted = p["P_c"] - resistance * p["X_c"] * i_0**2
    corner = lambda x, b: x + b - np.sqrt((x - b) ** 2 + 0.05**2)  # noqa: E731
    give = lambda x: corner(x, p["current_limit"]) / corner(1.0, p["current_limit"])  # noqa: E731

    def rhs(now, y):
        i, u_c, res, swing, theta, x, u_f, z, b, d = y
        alpha, beta = u(now), u(now - 0.005)
        along = alpha * np.cos(theta) + beta * np.sin(theta)
        ahead = beta * np.cos(theta) - alpha * np.sin(theta)
        seen = z - b
        low = (seen - np.sqrt(seen**2 + 0.05**2) + 0.05) / 2
        load = 1 + weakening * low
        h = i_0 * give(load / u_f - p["dc_bandwidth"] * p["dc_link"] * seen / p["P_c"])
        off = h * np.cos(theta) - i
        return [
            (alpha - resistance * p["X_c"] * i - u_c) / L,
            (alpha - K * off - res - u_c) / p["control_delay"],
            K * a / 10 * off - OMEGA * swing,
            OMEGA * res,
            OMEGA + np.sqrt(2) * w_p * ahead + x,
            w_p**2 * ahead,
            w_p * (along - u_f),
            (2 * u_c * i - wanted * load) / p["dc_link"],
            OMEGA * (z - b) - 2 * OMEGA * d,
            2 * OMEGA * b,
        ]

    before = t[0] - 0.6
    start = [0, 0, 0, 0, OMEGA * before, 0, 1, 0, 0, 0]
    return solve_ivp(
        rhs, (before, t[-1]), start, "DOP853", t, rtol=1e-8, atol=1e-9, max_step=1e-3
    ).y[0]


def recorded(path):
    """A table of the waveforms at 25 kV, with noise of 0.2 % of their peaks."""
    t = np.arange(round(0.45 * RATE)) / RATE - 0.15
    rng, peaks = np.random.default_rng(4), (KV * np.sqrt(2), MVA / KV * np.sqrt(2))
    waves = [
        p * (x + 2e-3 * rng.standard_normal(len(t)))
        for p, x in zip(peaks, (at_fault(t), single_phase(t, TRUTH)), strict=True)
    ]
    table = np.stack([t - t[0], *waves], axis=1)
    np.savetxt(path, table, delimiter=",", header="t [s],u [kV],i [kA]", comments="", fmt="%.9g")
    return path


def test_a_single_phase_converter_is_found_from_its_record(tmp_path):
    """Base power is the converter's: what is per unit counts in it. Its ripple and its notch are
    not in the model.
    """
    dips = tractexp.read(recorded(tmp_path / "arm.csv"))
    made = tractexp.compose(
        "line_side_converter", domain="waves", substeps=4, fixed={"branch_resistance": 0.3}
    )
    fit = tractexp.identify(dips, made, optimizer="multistart_least_squares", budget=400)
    found = {name: e.value for name, e in fit.parameters.items()}
    share = TRUTH["P_c"]
    for name, scale in {
        "P_c": 1 / share,
        "X_c": share,
        "current_bandwidth": 1,
        "control_delay": 1,
        "pll_bandwidth": 1,
        "current_limit": 1,
    }.items():
        assert found[name] == pytest.approx(TRUTH[name] * scale, rel=0.05), name
    gain = TRUTH["dc_link"] * TRUTH["dc_bandwidth"] / share
    assert found["dc_link"] * found["dc_bandwidth"] == pytest.approx(gain, rel=0.1)
    assert fit.result.events[0]["epsilon_i"] < 0.02


def test_before_the_event_nothing_moves():
    of, U0 = model(), 0.97
    made = event(
        lambda t: U0 * np.exp(2j * np.pi * 49.6 * t), f0=49.6, U0=U0, length=0.3, rate=2000.0
    )
    values = np.array([TRUTH[name] for name in of.names])
    current = vector(of.simulate(Drive.from_events([made]), values, 8)) / made.turn
    assert np.abs(current - TRUTH["P_c"] / U0).max() < 1e-9


def test_it_draws_its_power_again_up_to_its_limit():
    of = model()
    values = np.array([TRUTH[name] for name in of.names])
    for depth, power, current in ((0.15, 0.8, 0.8 / 0.85), (0.4, None, 1.3 * 0.8)):
        made = event(dip(depth, jump=0.4, end=10.0, edge=0.002), length=0.6)
        i = vector(of.simulate(Drive.from_events([made]), values, 8)) / made.turn
        P = (made.v * np.conj(i)).real[-1]
        assert abs(i[-1]) == pytest.approx(current, rel=0.02)
        if power is not None:
            assert pytest.approx(power, rel=0.01) == P
    # the loop has found the new angle
    assert (made.v * np.conj(i)).imag[-1] == pytest.approx(0, abs=5e-3)


def test_phasors_are_refused_with_what_to_take():
    with pytest.raises(
        UserError, match="show a converter's power and none of its control; take model/static="
    ) as told:
        _ = compose(
            get("model/motor", "line_side_converter")(), get("model/static", "branch")()
        ).equations
    assert "does not go with domain=phasors" in str(told.value)
