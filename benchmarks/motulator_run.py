"""Play a dip through motulator's induction machine: run by a Python that has it (see
motulator_check.py).

    python motulator_run.py case.json response.npz

`case.json` holds the machine in SI units, the load torque, the voltage's peak, the frequency and
the sampling rate. The equations and their state are motulator's; SciPy integrates them. Written: t,
and the space vectors u and i [V, A].
"""

import json
import sys
from types import SimpleNamespace

import numpy as np
from motulator.drive.model import InductionMachine, StiffMechanicalSystem
from scipy.integrate import solve_ivp
from scipy.optimize import root


def voltage(t, case):
    """A dip to 0.55 with a jump of the angle and a negative sequence, between 0 and 0.1 s [V]."""
    smooth = lambda x: 0.5 - 0.5 * np.cos(np.pi * np.clip(x, 0, 1))  # noqa: E731
    there, turn = (
        smooth(t / 0.004) - smooth((t - 0.1) / 0.004),
        np.exp(2j * np.pi * case["frequency"] * t),
    )
    return case["peak"] * ((1 - 0.45 * there) * np.exp(0.5j * there) * turn + 0.2 * there / turn)


class Drive:
    """Machine and shaft as one system of differential equations."""

    def __init__(self, case):
        self.case = case
        self.machine = InductionMachine(
            SimpleNamespace(**{k: case[k] for k in ("n_p", "R_s", "R_r", "L_ell", "L_s")})
        )
        self.shaft = StiffMechanicalSystem(J=case["J"], tau_L=lambda t: case["torque"] + 0 * t)

    def rates(self, t, psi_s, psi_r, speed, u):
        """Time derivatives of both fluxes and of the shaft's speed."""
        machine, shaft = self.machine, self.shaft
        machine.state.psi_ss, machine.state.psi_rs, shaft.state.w_M = psi_s, psi_r, speed
        machine.set_outputs(t)
        shaft.set_outputs(t)
        machine.inp.u_ss, machine.inp.w_M, shaft.inp.tau_M = u, speed, machine.out.tau_M
        return (*machine.rhs(), shaft.rhs()[0])

    def steady(self):
        """Fluxes and speed at which nothing moves in the frame of the voltage."""
        w, U = 2 * np.pi * self.case["frequency"], self.case["peak"]

        def missed(x):
            psi_s, psi_r = complex(x[0], x[1]), complex(x[2], x[3])
            a, b, c = self.rates(0.0, psi_s, psi_r, x[4] * w / self.case["n_p"], U)
            a, b = a / U - 1j * w * psi_s / U, b / U - 1j * w * psi_r / U
            return [a.real, a.imag, b.real, b.imag, float(np.real(c)) / w]

        psi = U / (1j * w)
        found = root(missed, [psi.real, psi.imag, psi.real, psi.imag, 0.97], tol=1e-13)
        x = found.x
        return complex(x[0], x[1]), complex(x[2], x[3]), x[4] * w / self.case["n_p"]

    def play(self, t):
        """The stator current at times t, of which the first is before the dip [A]."""
        psi_s, psi_r, speed = self.steady()
        turn = np.exp(2j * np.pi * self.case["frequency"] * t[0])

        def rhs(now, y):
            rates = self.rates(now, y[0], y[1], y[2].real, voltage(now, self.case))
            return np.array(rates, dtype=complex)

        start = np.array([psi_s * turn, psi_r * turn, speed], dtype=complex)
        y = solve_ivp(
            rhs, (t[0], t[-1]), start, "DOP853", t, rtol=1e-10, atol=1e-10, max_step=1e-3
        ).y
        return y[0] / self.case["L_s"] + (y[0] - y[1]) / self.case["L_ell"]


if __name__ == "__main__":
    with open(sys.argv[1]) as file:
        case = json.load(file)
    t = np.arange(round(0.32 * case["rate"])) / case["rate"] - 0.02
    np.savez(sys.argv[2], t=t, u=voltage(t, case), i=Drive(case).play(t))
