"""Dips of loads that were not steady before them, solved by SciPy: nothing of the project's own
equations is used.
"""

import numpy as np
from scipy.integrate import solve_ivp

from tractexp.record import Record

NOMINAL = 2 * np.pi * 50.0
TRUTH = {"T_prime": 0.1, "X_prime": 0.3, "C": 0.9, "M": 0.012, "T_m": 0.25, "p_v": 1.4, "q_v": 2.6}
P_SETTLED, Q_SETTLED = 0.6, 0.3  # pu, of all the load
LENGTH, DIP, DEPTH = 2.8, (1.2, 1.45), 0.35  # s, s, of the voltage


def make_start(slip, rate=400.0, noise=5e-4, seed=0, drift=0.0):
    """A record whose motor has so much slip (a share of the nominal speed) at its first sample;
    None: it is steady. `drift` is that of P and Q within the record, shares of them.
    """
    t = np.arange(round(LENGTH * rate)) / rate
    U = _draw_voltage(t)
    settled = _find_settled()
    E = _solve_flux(-slip * NOMINAL) if slip is not None else settled[0] + 1j * settled[1]
    omega = -slip * NOMINAL if slip is not None else settled[2]
    solution = solve_ivp(
        _move,
        (0.0, t[-1]),
        [E.real, E.imag, omega],
        "LSODA",
        t,
        rtol=1e-9,
        atol=1e-10,
        max_step=2e-3,
    )
    E = solution.y[0] + 1j * solution.y[1]
    S = _draw_power(U, E)
    before = _draw_power(1.0, settled[0] + 1j * settled[1])
    static = complex(P_SETTLED, Q_SETTLED) - before
    P = S.real + static.real * U ** TRUTH["p_v"]
    Q = S.imag + static.imag * U ** TRUTH["q_v"]
    course = 1 + drift * (t / LENGTH - 0.5)
    rng = np.random.default_rng(seed)
    P, Q = (x * course + noise * rng.standard_normal(len(t)) for x in (P, Q))
    return Record("start", t, U, P, Q, f=np.full(len(t), 50.0))


def _draw_voltage(t):
    fall, back = (np.clip((t - at) / 0.01, 0.0, 1.0) for at in DIP)
    return 1 - DEPTH * (fall - back)


def _solve_flux(omega):
    """The flux at rest at one speed [rad/s from synchronous], at nominal voltage."""
    return TRUTH["C"] / (1 - 1j * omega * TRUTH["T_prime"])


def _draw_power(U, E):
    current = (U - E) / (1j * TRUTH["X_prime"])
    return U * np.conj(current)


def _differentiate(U, E, omega):
    flux = (TRUTH["C"] * U - E) / TRUTH["T_prime"] + 1j * omega * E
    torque = -U * E.imag / TRUTH["X_prime"]
    return flux, (torque - TRUTH["T_m"]) / TRUTH["M"]


def _move(t, y):
    flux, rate = _differentiate(_draw_voltage(t), y[0] + 1j * y[1], y[2])
    return [flux.real, flux.imag, rate]


def _find_settled():
    """Flux and speed of the steady state, Eq. (3) of Wu, Fan, Zou 2022."""
    delta = -0.5 * np.arcsin(2 * TRUTH["T_m"] * TRUTH["X_prime"] / TRUTH["C"])
    E = TRUTH["C"] * np.cos(delta) * np.exp(1j * delta)
    return E.real, E.imag, np.tan(delta) / TRUTH["T_prime"]
