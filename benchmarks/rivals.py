"""The base model simulated with its objective in the usual other ways, each written as one who
knows it would.

Each way is a class made from a record and called with candidates (n, 7); it returns their sums of
squared errors (n,). Those that integrate with an error control read the voltage off the same cubics
as the kernel, so that all solve the same equations. Optional packages (`numbalsoda`, `jax` and
`diffrax`) are imported where their way is made.
"""

import math

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from tractexp.model.drive import Excitation, compute_slopes

FAST = {"contract", "reassoc", "arcp", "nsz"}  # as the kernel
fast = njit(cache=True, fastmath=FAST, error_model="numpy")
inlined = njit(cache=True, fastmath=FAST, error_model="numpy", forceinline=True)


@inlined
def _hoisted(p):
    """Initial states, constants of the derivative and of the output."""
    T_prime, X_prime, C, M, T_m, p_v, q_v = p
    twice = 1.0 + (1.0 - 4.0 * (T_m * X_prime / C) ** 2) ** 0.5
    E_re, E_im, omega = C / 2 * twice, -T_m * X_prime, -2.0 * T_m * X_prime / C / (T_prime * twice)
    derivative = -1.0 / T_prime, C / T_prime, -1.0 / (X_prime * M), -T_m / M
    output = (
        1.0 + E_im / X_prime,
        -1.0 / X_prime,
        0.6 - (1.0 - E_re) / X_prime,
        1.0 / X_prime,
        p_v,
        q_v,
    )
    return (E_re, E_im, omega), derivative, output


@inlined
def _slope(E_re, E_im, omega, U, c):
    return c[0] * E_re + c[1] * U - E_im * omega, c[0] * E_im + E_re * omega, c[2] * U * E_im + c[3]


@inlined
def _power(E_re, E_im, U, log_U, c):
    return c[1] * U * E_im + c[0] * math.exp(c[4] * log_U), c[3] * U * (U - E_re) + c[2] * math.exp(
        c[5] * log_U
    )


@fast
def _one_at_a_time(values, U, middle, log_U, P, Q, h):
    totals = np.empty(len(values))
    for n in range(len(values)):
        (E_re, E_im, omega), c, output = _hoisted(values[n])
        total = 0.0
        for i in range(len(U)):
            p, q = _power(E_re, E_im, U[i], log_U[i], output)
            total += (P[i] - p) ** 2 + (Q[i] - q) ** 2
            if i + 1 == len(U):
                break
            a = _slope(E_re, E_im, omega, U[i], c)
            b = _slope(E_re + h / 2 * a[0], E_im + h / 2 * a[1], omega + h / 2 * a[2], middle[i], c)
            d = _slope(E_re + h / 2 * b[0], E_im + h / 2 * b[1], omega + h / 2 * b[2], middle[i], c)
            e = _slope(E_re + h * d[0], E_im + h * d[1], omega + h * d[2], U[i + 1], c)
            E_re += h / 6 * (a[0] + 2 * (b[0] + d[0]) + e[0])
            E_im += h / 6 * (a[1] + 2 * (b[1] + d[1]) + e[1])
            omega += h / 6 * (a[2] + 2 * (b[2] + d[2]) + e[2])
        totals[n] = total
    return totals


@inlined
def _voltage(t, U, rise, h):
    """The voltage at any time: the cubic between samples that the kernel follows."""
    i = min(max(int(t / h), 0), len(U) - 2)
    x, step = t / h - i, U[i + 1] - U[i]
    return U[i] + x * (
        rise[i]
        + x * (3 * step - 2 * rise[i] - rise[i + 1] + x * (rise[i] + rise[i + 1] - 2 * step))
    )


@fast
def _right_hand_side(t, y, U, rise, h, c):
    d = _slope(y[0], y[1], y[2], _voltage(t, U, rise, h), c)
    return np.array(d)


@fast
def _total(y, U, log_U, P, Q, c):
    """Sum of squared errors of states (3, N)."""
    total = 0.0
    for i in range(len(U)):
        p, q = _power(y[0, i], y[1, i], U[i], log_U[i], c)
        total += (P[i] - p) ** 2 + (Q[i] - q) ** 2
    return total


class Record:
    """What all ways are given: voltage with its slopes, measured power."""

    def __init__(self, e: Excitation):
        self.U, self.P, self.Q, self.h = e.U, e.P, e.Q, e.step
        self.log_U, self.rise, self.t = (
            np.log(e.U),
            compute_slopes(e.U),
            np.arange(len(e.U)) * e.step,
        )
        self.middle = (e.U[:-1] + e.U[1:]) / 2 - np.diff(self.rise) / 8  # on the cubic

    def states(self, p: np.ndarray, method: str, rtol: float, **settings) -> np.ndarray:
        """States (3, N) by SciPy."""
        start, c, _ = _hoisted(tuple(p))
        given = (self.U, self.rise, self.h, c)
        span = (0.0, self.t[-1])
        return solve_ivp(
            _right_hand_side, span, start, method, self.t, args=given, rtol=rtol, **settings
        ).y

    def solution(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """P and Q (N,) of one candidate to ten digits or more: the reference."""
        y = self.states(p, "DOP853", 1e-12, atol=1e-14, max_step=self.h)
        c = _hoisted(tuple(p))[2]
        E_re, E_im, _ = y
        return (
            c[1] * self.U * E_im + c[0] * self.U ** c[4],
            c[3] * self.U * (self.U - E_re) + c[2] * self.U ** c[5],
        )


class OneAtATime:
    """A compiled loop over candidates: the same equations, steps and flags as the kernel's."""

    def __init__(self, record: Record):
        self.r = record

    def __call__(self, values: np.ndarray) -> np.ndarray:
        r = self.r
        return _one_at_a_time(values, r.U, r.middle, r.log_U, r.P, r.Q, r.h)


class Vectorized(OneAtATime):
    """All candidates at once in NumPy, complex internal voltage."""

    def __call__(self, values: np.ndarray) -> np.ndarray:
        T_prime, X_prime, C, M, T_m, p_v, q_v = values.T
        U, h = self.r.U, self.r.h
        sine = 2 * T_m * X_prime / C
        E = C / 2 * (1 + np.sqrt(1 - sine**2) - 1j * sine)
        omega = E.imag / E.real / T_prime
        P_s0, Q_s0 = 1.0 - T_m, 0.6 - (1 - E.real) / X_prime
        total = np.zeros(len(values))

        def slope(E, omega, u):
            return (C * u - E) / T_prime + 1j * omega * E, (-u * E.imag / X_prime - T_m) / M

        for i, u in enumerate(U):
            total += (self.r.P[i] - P_s0 * u**p_v + u * E.imag / X_prime) ** 2
            total += (self.r.Q[i] - Q_s0 * u**q_v - u * (u - E.real) / X_prime) ** 2
            if i + 1 == len(U):
                break
            um, uc = self.r.middle[i], U[i + 1]
            a = slope(E, omega, u)
            b = slope(E + h / 2 * a[0], omega + h / 2 * a[1], um)
            c = slope(E + h / 2 * b[0], omega + h / 2 * b[1], um)
            d = slope(E + h * c[0], omega + h * c[1], uc)
            E = E + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            omega = omega + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        return total


class SciPy:
    """`solve_ivp` one candidate after another; right-hand side and objective compiled, steps of 20
    ms at most.
    """

    def __init__(self, record: Record, method: str, rtol: float):
        self.r, self.method, self.rtol = record, method, rtol

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return np.array([self._one(p) for p in values])

    def _one(self, p):
        r = self.r
        y = r.states(p, self.method, self.rtol, atol=self.rtol, max_step=0.02)
        return _total(y, r.U, r.log_U, r.P, r.Q, _hoisted(tuple(p))[2])


class NumbaLSODA:
    """numbalsoda's C++ solvers called from a compiled loop over candidates: LSODA, or DOP853."""

    def __init__(self, record: Record, method: str, rtol: float):
        from numba import carray, cfunc
        from numbalsoda import dop853, lsoda, lsoda_sig

        size, h = len(record.U), record.h

        @cfunc(lsoda_sig, fastmath=FAST, error_model="numpy")
        def right_hand_side(t, y, dy, data):
            given = carray(data, (4 + 2 * size,))
            d = _slope(
                y[0], y[1], y[2], _voltage(t, given[4 : 4 + size], given[4 + size :], h), given
            )
            dy[0], dy[1], dy[2] = d

        solve, address = {"LSODA": lsoda, "DOP853": dop853}[method], right_hand_side.address

        @njit(fastmath=FAST, error_model="numpy")
        def run(values, t, U, rise, log_U, P, Q):
            data, totals = np.empty(4 + 2 * size), np.empty(len(values))
            data[4 : 4 + size], data[4 + size :] = U, rise
            for n in range(len(values)):
                start, c, output = _hoisted(values[n])
                data[0], data[1], data[2], data[3] = c
                y, success = solve(address, np.array(start), t, data, rtol, rtol)
                totals[n] = _total(y.T, U, log_U, P, Q, output) if success else np.nan
            return totals

        self.r, self.run, self.kept = record, run, right_hand_side

    def __call__(self, values: np.ndarray) -> np.ndarray:
        r = self.r
        return self.run(values, r.t, r.U, r.rise, r.log_U, r.P, r.Q)


class Diffrax:
    """All candidates at once in diffrax on JAX: `Tsit5` in double precision, steps
    of one sample.
    """

    def __init__(self, record: Record):
        import diffrax
        import jax
        from jax import numpy as jnp

        jax.config.update("jax_enable_x64", True)
        U, rise, log_U, P, Q, t = (
            jnp.asarray(getattr(record, k)) for k in ("U", "rise", "log_U", "P", "Q", "t")
        )
        h, last = record.h, len(record.U) - 2
        grid = diffrax.StepTo(ts=t)

        def voltage(time):
            i = jnp.clip((time / h).astype(int), 0, last)
            x, step = time / h - i, U[i + 1] - U[i]
            a, b = rise[i], rise[i + 1]
            return U[i] + x * (a + x * (3 * step - 2 * a - b + x * (a + b - 2 * step)))

        def one(p):
            start, c, (P_s, dP, Q_s, dQ, p_v, q_v) = _hoisted.py_func(p)
            term = diffrax.ODETerm(
                lambda time, y, c: jnp.stack(_slope.py_func(*y, voltage(time), c))
            )
            solved = diffrax.diffeqsolve(
                term,
                diffrax.Tsit5(),
                t[0],
                t[-1],
                None,
                jnp.stack(start),
                c,
                stepsize_controller=grid,
                saveat=diffrax.SaveAt(ts=t),
                adjoint=diffrax.DirectAdjoint(),
                max_steps=len(record.U),
            )
            E_re, E_im, _ = solved.ys.T
            p = dP * U * E_im + P_s * jnp.exp(p_v * log_U)
            q = dQ * U * (U - E_re) + Q_s * jnp.exp(q_v * log_U)
            return ((P - p) ** 2 + (Q - q) ** 2).sum()

        self.run = jax.jit(jax.vmap(one))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        return np.asarray(self.run(values))
