"""The voltage's angle as an input: between its jumps a frequency, and at them a jump."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tractexp.configuration.plugin import get
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose
from tractexp.record import Record

VALUES = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55}
STEP, BEGIN, END = 2e-3, 0.301, 0.451  # s: it falls and returns between two samples
JUMP = np.radians(10.0)
OMEGA = 2 * np.pi * 50


def voltage(t):
    """A dip of 30 % in which the angle jumps by 10 degrees and back, and turns slowly beside it."""
    inside = (t > BEGIN) & (t < END)
    swing = 0.5 * (np.cos(4 * (t - BEGIN)) - 1) * (t > BEGIN)
    return np.where(inside, 0.7, 1.0), np.where(inside, JUMP, 0.0) + swing


def powers(t, T_prime, X_prime, C, M, T_m):
    """P and Q (N,) of the motor of Eq. (1) and a constant impedance, solved in a frame that turns
    at nominal speed, where a jump of the angle is one of the voltage and no state jumps.
    """
    sine = 2 * T_m * X_prime / C
    cosine = np.sqrt(1 - sine**2)
    E0, slip = C / 2 * (1 + cosine - 1j * sine), -sine / (1 + cosine) / T_prime

    def slopes(at, x):
        U, angle = voltage(at)
        V, E = U * np.exp(1j * angle), x[0] + 1j * x[1]
        current = (V - E) / (1j * X_prime)
        flux = (1j * X_prime * C * current - (1 - C) * E) / T_prime + 1j * x[2] * E
        return [flux.real, flux.imag, ((E * np.conj(current)).real - T_m) / M]

    spans = [t[0], BEGIN, END, t[-1]]
    x, columns = np.array([E0.real, E0.imag, slip]), []
    for k, (a, b) in enumerate(itertools.pairwise(spans)):
        at = t[(t >= a) & (t < b)] if k < 2 else t[t >= a]
        solved = solve_ivp(
            slopes, (a + 1e-12, b - 1e-12), x, dense_output=True, rtol=1e-10, atol=1e-12
        )
        columns.append(solved.sol(at))
        x = solved.y[:, -1]
    E_re, E_im, _ = np.concatenate(columns, axis=1)
    U, angle = voltage(t)
    V = U * np.exp(1j * angle)
    S = V * np.conj((V - E_re - 1j * E_im) / (1j * X_prime))
    static = complex(1.0, 0.6) - S[0]
    return (S + static * U**2).real, (S + static * U**2).imag


@pytest.fixture(scope="module")
def recorded():
    t = np.arange(750) * STEP
    P, Q = powers(t, **VALUES)
    U, angle = voltage(t)
    return {"t": t, "U": U, "P": P, "Q": Q, "U_angle": angle}


def play(recorded, **drive):
    model = compose(
        get("model/motor", "electromechanical")(), get("model/static", "constant_impedance")()
    )
    event = Excitation(STEP, recorded["U"], recorded["P"], recorded["Q"], 1.0, 1.0, 0.6, **drive)
    values = np.array([[VALUES[name] for name in model.names]])
    return model.simulate(Drive.from_events([event]), values, 4).outputs[:, 0]


def test_a_jump_of_the_angle_is_played_as_one(recorded):
    """Of 30 % of P that such a jump makes, all but what the edges of the voltage leave."""
    speed = np.gradient(recorded["U_angle"], STEP)
    record = Record("jump", **recorded).uniform()
    angle = play(recorded, omega_s=2 * np.pi * (record.f - 50), U_angle=record.U_angle)
    slope = play(recorded, omega_s=speed)
    off = [np.abs(out - [recorded["P"], recorded["Q"]]).max() for out in (angle, slope)]
    assert off[0] < 5e-3
    assert off[1] > 0.1
