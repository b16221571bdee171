"""A motor with stator and rotor flux, solved by SciPy: it starts from standstill on a stiff bus,
runs up against a fan, is tripped and coasts, its rotor's flux giving the voltage at its terminals.
"""

import numpy as np
from scipy.integrate import solve_ivp

OMEGA = 2 * np.pi * 50.0
STARTED = 0.5  # s
R_S, X_M, X_LEAK, FAN = 0.02, 3.5, 0.08, 0.7  # pu; both leakages are alike, FAN at full speed
X_ALL = X_M + X_LEAK
X_PRIME = X_ALL - X_M**2 / X_ALL


def solve_motor(rate, R_r, H, tripped, length, unbalance=0.0):
    """Voltage and current (N,), space vectors [pu], and T0' [s]."""
    t = np.arange(round(length * rate)) / rate
    on, off = (t >= STARTED) & (t < tripped), t >= tripped

    def bus(at):
        return np.exp(1j * OMEGA * at) + unbalance * np.exp(-1j * OMEGA * at)

    def move_connected(at, y):
        stator, rotor, speed = complex(*y[:2]), complex(*y[2:4]), y[4]
        currents = _find_currents(stator, rotor)
        dstator = OMEGA * (bus(at) - R_S * currents[0])
        drotor = -OMEGA * R_r * currents[1] + 1j * OMEGA * speed * rotor
        torque = (np.conj(stator) * currents[0]).imag
        return [*_parts(dstator), *_parts(drotor), (torque - FAN * speed**2) / (2 * H)]

    def move_open(at, y):
        rotor, speed = complex(*y[:2]), y[2]
        drotor = -OMEGA * R_r * rotor / X_ALL + 1j * OMEGA * speed * rotor
        return [*_parts(drotor), -FAN * speed**2 / (2 * H)]

    opened = t[off][0]
    run = _solve(move_connected, STARTED, [0.0] * 5, np.append(t[on], opened))
    coast = _solve(move_open, opened, run[2:, -1], t[off])
    V, I = np.zeros(len(t), complex), np.zeros(len(t), complex)
    V[~off] = bus(t[~off])
    I[on] = _find_currents(run[0] + 1j * run[1], run[2] + 1j * run[3])[0][:-1]
    rates = np.array([move_open(0.0, y)[:2] for y in coast.T])
    V[off] = X_M / X_ALL * (rates[:, 0] + 1j * rates[:, 1]) / OMEGA
    return V, I, X_ALL / (OMEGA * R_r)


def _find_currents(stator, rotor):
    determinant = X_ALL**2 - X_M**2
    return (X_ALL * stator - X_M * rotor) / determinant, (
        X_ALL * rotor - X_M * stator
    ) / determinant


def _parts(z):
    return z.real, z.imag


def _solve(move, begin, start, times):
    ended = solve_ivp(
        move, (begin, times[-1]), start, t_eval=times, rtol=1e-7, atol=1e-8, max_step=1e-3
    )
    return ended.y
