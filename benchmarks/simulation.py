"""Time per Runge-Kutta step and candidate, objective included, beside the usual ways of doing it. Run: see --help.

All ways simulate the same record of 1,000 samples with the same model, in turn, within this one run; the smallest
of several repetitions is reported, which is the figure least disturbed by other work on the machine.
"""

import argparse
import json
import math
import platform
import time

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from tractexp.model.drive import Drive, Excitation, slopes
from tractexp.model.model import compose
from tractexp.plugin import get

TRUTH = np.array([0.12, 0.25, 0.9, 0.006, 0.55, 1.4, 3.0])  # T', X', C, M, T_m, p_v, q_v
SAMPLES, CANDIDATES = 1000, 200


def excitation() -> Excitation:
    """A 50 % dip of 150 ms with 20 ms edges at 1 kHz."""
    t = np.arange(SAMPLES) * 1e-3
    U = 1 - 0.5 * (np.clip((t - 0.2) / 0.02, 0, 1) - np.clip((t - 0.37) / 0.02, 0, 1))
    return Excitation(1e-3, U, np.ones(SAMPLES), np.full(SAMPLES, 0.6), 1.0, 1.0, 0.6)


@njit(cache=True)
def scalar(p, U, middle, P, Q, h):
    """One candidate: the printed polar equations, RK4, mean squared error."""
    T_prime, X_prime, C, M, T_m, p_v, q_v = p
    delta = 0.5 * math.asin(-2 * T_m * X_prime / C)
    E, omega = C * math.cos(delta), math.tan(delta) / T_prime
    P_s0, Q_s0 = 1.0 - T_m, 0.6 - (1 - E * math.cos(delta)) / X_prime
    total = 0.0
    for i in range(len(U)):
        u = U[i]
        p_i = P_s0 * u**p_v - u * E * math.sin(delta) / X_prime
        q_i = Q_s0 * u**q_v + u * (u - E * math.cos(delta)) / X_prime
        total += (P[i] - p_i) ** 2 + (Q[i] - q_i) ** 2
        if i + 1 == len(U):
            break
        um, uc = middle[i], U[i + 1]
        a = _polar(E, delta, omega, u, T_prime, X_prime, C, M, T_m)
        b = _polar(E + h / 2 * a[0], delta + h / 2 * a[1], omega + h / 2 * a[2], um, T_prime, X_prime, C, M, T_m)
        c = _polar(E + h / 2 * b[0], delta + h / 2 * b[1], omega + h / 2 * b[2], um, T_prime, X_prime, C, M, T_m)
        d = _polar(E + h * c[0], delta + h * c[1], omega + h * c[2], uc, T_prime, X_prime, C, M, T_m)
        E += h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        delta += h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        omega += h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2])
    return total / len(U)


@njit(cache=True)
def _polar(E, delta, omega, U, T_prime, X_prime, C, M, T_m):
    s, c = math.sin(delta), math.cos(delta)
    return (-E + C * U * c) / T_prime, -C * U * s / (T_prime * E) + omega, (-U * E * s / X_prime - T_m) / M


def vectorized(values, U, middle, P, Q, h):
    """All candidates at once in NumPy, complex internal voltage."""
    T_prime, X_prime, C, M, T_m, p_v, q_v = values.T
    sine = 2 * T_m * X_prime / C
    E = C / 2 * (1 + np.sqrt(1 - sine**2) - 1j * sine)
    omega = E.imag / E.real / T_prime
    P_s0, Q_s0 = 1.0 - T_m, 0.6 - (1 - E.real) / X_prime
    total = np.zeros(len(values))

    def slope(E, omega, u):
        return (C * u - E) / T_prime + 1j * omega * E, (-u * E.imag / X_prime - T_m) / M

    for i, u in enumerate(U):
        total += (P[i] - P_s0 * u**p_v + u * E.imag / X_prime) ** 2
        total += (Q[i] - Q_s0 * u**q_v - u * (u - E.real) / X_prime) ** 2
        if i + 1 == len(U):
            break
        um, uc = middle[i], U[i + 1]
        a = slope(E, omega, u)
        b = slope(E + h / 2 * a[0], omega + h / 2 * a[1], um)
        c = slope(E + h / 2 * b[0], omega + h / 2 * b[1], um)
        d = slope(E + h * c[0], omega + h * c[1], uc)
        E = E + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        omega = omega + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    return total / len(U)


def scipy_ivp(p, U, h):
    """One candidate by solve_ivp, LSODA, right-hand side compiled, the accuracy an engineer would ask for."""
    T_prime, X_prime, C, M, T_m, *_ = p
    t = np.arange(len(U)) * h
    delta = 0.5 * math.asin(-2 * T_m * X_prime / C)
    start = [C * math.cos(delta), delta, math.tan(delta) / T_prime]
    slope = lambda s, y: _polar(*y, np.interp(s, t, U), T_prime, X_prime, C, M, T_m)  # noqa: E731
    return solve_ivp(slope, (0, t[-1]), start, method="LSODA", rtol=1e-6, max_step=0.02, t_eval=t)


def fastest(call, repeats):
    """The smallest wall time of several calls [s]; the first, which may compile, does not count."""
    call()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return min(times)


def measure(repeats):
    """Nanoseconds per Runge-Kutta step and candidate of each way, and the figures derived from them."""
    model = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
    e = excitation()
    drive = Drive.of([e])
    values = TRUTH * np.random.default_rng(0).uniform(0.9, 1.1, (CANDIDATES, 7))
    steps = (SAMPLES - 1) * 1e-9
    middle = (e.U[:-1] + e.U[1:]) / 2 - np.diff(slopes(e.U)) / 8  # on the cubic that the kernel follows
    ours = fastest(lambda: model.errors(drive, values), repeats)
    one = fastest(lambda: [scalar(v, e.U, middle, e.P, e.Q, e.step) for v in values], max(repeats // 4, 3))
    numpy = fastest(lambda: vectorized(values, e.U, middle, e.P, e.Q, e.step), 3)
    ivp = fastest(lambda: scipy_ivp(TRUTH, e.U, e.step), 3)
    figures = {
        "nanoseconds_per_step": ours / CANDIDATES / steps,
        "nanoseconds_per_step_numba_one_at_a_time": one / CANDIDATES / steps,
        "nanoseconds_per_step_numpy": numpy / CANDIDATES / steps,
        "nanoseconds_per_step_solve_ivp": ivp / steps,
    }
    own = figures["nanoseconds_per_step"]
    figures |= {f"ratio_to_{k.removeprefix('nanoseconds_per_step_')}": v / own for k, v in list(figures.items())[1:]}
    difference = np.abs(
        model.errors(drive, values).sums.sum(axis=(0, 1)) / SAMPLES - vectorized(values, e.U, middle, e.P, e.Q, e.step)
    )
    agree = {"simulations_per_second": CANDIDATES / ours, "largest_difference_to_numpy": float(difference.max())}
    return (
        figures
        | agree
        | {"candidates": CANDIDATES, "samples": SAMPLES, "machine": platform.processor() or platform.machine()}
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON only")
    parser.add_argument("--repeats", type=int, default=20)
    chosen = parser.parse_args()
    figures = measure(chosen.repeats)
    if not chosen.json:
        print(f"{SAMPLES} samples, {CANDIDATES} candidates, one thread; per Runge-Kutta step and candidate\n")
        rows = [("tractexp, public batch call with objective", "nanoseconds_per_step")]
        rows += [("Numba, one candidate at a time", "nanoseconds_per_step_numba_one_at_a_time")]
        rows += [("NumPy, all candidates at once", "nanoseconds_per_step_numpy")]
        rows += [("SciPy solve_ivp LSODA, compiled right-hand side", "nanoseconds_per_step_solve_ivp")]
        for label, key in rows:
            print(f"{label:<50}{figures[key]:>12.1f} ns{figures[key] / figures['nanoseconds_per_step']:>10.0f} x")
        print()
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
