"""Loads of HERMESS (GPL-3), which nobody here wrote, beside a machine of motulator's (extra
`strangers`); `strangers.py` judges by them.

HERMESS integrates a bus behind a line, with a load of constant impedance, current and power and a
compensator, through a fault at the bus. The machine sees the voltage that HERMESS finds, and a
recorder takes one-cycle phasors of both. What the load draws is told by the law and the states of
HERMESS at each instant. A network without states is refused: a compensator is always at the bus,
and is a part of what is recorded only where the load has it. One feeds less than the load draws:
with HERMESS's own droop it would feed several times as much.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import strangers_motulator as motulator

STEP = 1e-3  # s, of what HERMESS tells
LINE = 0.06 + 0.02j  # pu of 100 MVA: mostly resistive, so that a fault hardly turns the voltage
BASE = 100.0  # MVA
THYRISTOR = 2.5  # the fixed gain of HERMESS's thyristors
KINDS = {  # what a load has beside a machine, by the names of the catalogue
    "constant impedance": (),
    "constant power in part": ("polynomial_static_load",),
    "compensator": ("static_var_compensator",),
}
OUTSIDE = ()
SYSTEM = """StaticInfiniteBus, bus = "1", r = 0, x = 0.0001
SVC, idx = "svc", bus = "2", KA = {gain}, Kd = {droop}, Td = 0.01, q = 0
StaticZIP, bus = "2", z_share = {z}, i_share = {i}, p_share = {p}
Line, bus_i = "1", bus_j = "2", r = {line.real}, x = {line.imag}, g = 0, b = 0, trafo = 1
BusInit, bus = "1", p = 0, v = 1.0, type = "slack"
BusInit, bus = "2", p = {power}, q = {reactive}, type = "PQ"
"""
FAULT = """Disturbance, time = {begin}, type = "FAULT_BUS", bus = "2", y = {admittance}
Disturbance, time = {end}, type = "CLEAR_FAULT_BUS", bus = "2"
"""


@dataclass(frozen=True)
class BusLoad:
    """Shares (3,) of impedance, current and power, the power [pu], and what the compensator feeds
    [pu] of a voltage that falls by 1 pu, and with which time constant [s].
    """

    shares: tuple[float, float, float]
    power: complex
    slope: float
    lag: float
    is_compensated: bool

    def simulate(self, dip: motulator.Dip) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,) [s], voltage (n,) [pu of that before] and current (n,) [pu]."""
        import hermess

        # of the conductance that brings the voltage down by the depth
        admittances = np.linspace(0.0, 200.0, 20_001)
        reached = np.abs(1 / (1 + LINE * admittances))
        admittance = float(np.interp(dip.depth, 1 - reached, admittances))
        z, i, p = self.shares
        gain = self.slope / (THYRISTOR * self.lag)
        values = {"z": z, "i": i, "p": p, "gain": gain, "droop": 1 / self.slope, "line": LINE}
        values |= {"power": BASE * self.power.real, "reactive": BASE * self.power.imag}
        begin = motulator.BEFORE
        instants = {"begin": begin, "end": begin + dip.length, "admittance": admittance}
        with tempfile.TemporaryDirectory() as root:
            folder = Path(root) / "load"
            folder.mkdir()
            (folder / "sim_param.txt").write_text(SYSTEM.format(**values), encoding="utf-8")
            (folder / "sim_dist.txt").write_text(FAULT.format(**instants), encoding="utf-8")
            length = motulator.BEFORE + motulator.AFTER
            settings = {"quiet": True, "line_dyn": False, "T_end": length, "ts": STEP}
            found = hermess.extract_results(hermess.simulate("load", system_root=root, **settings))
        u = found.voltage["2"]
        u0 = u[0]
        ratio = np.abs(u / u0)
        S = self.power * (z * ratio**2 + i * ratio + p)
        if self.is_compensated:
            susceptance = next(one.states["B"] for one in found.devices if "B" in one.states)
            S = S - 1j * susceptance * np.abs(u) ** 2
        return found.t - begin, u / u0, np.conj(S / (u / u0))


def draw_load(kind: str, rng: np.random.Generator) -> tuple[Any, BusLoad]:
    """A load of motulator's, of which the static part is taken away, and the load at the bus."""
    load = motulator.draw_load("constant torque", rng)
    power = complex(rng.uniform(0.25, 0.45), rng.uniform(0.08, 0.2))
    share = float(rng.uniform(0.3, 0.7)) if kind == "constant power in part" else 0.0
    slope, lag = float(rng.uniform(0.4, 1.5)), float(rng.uniform(0.03, 0.15))
    return load, BusLoad((1 - share, 0.0, share), power, slope, lag, kind == "compensator")


def record_dip(load: tuple[Any, BusLoad], dip: motulator.Dip) -> dict[str, np.ndarray]:
    """Columns t [s], U, P, Q [pu], f [Hz] (N,) of one-cycle phasors, without noise."""
    machines, bus = load
    told, u, i = bus.simulate(dip)

    def find_voltage(at: np.ndarray) -> np.ndarray:
        return np.interp(at, told, u.real) + 1j * np.interp(at, told, u.imag)

    t = motulator.find_times()
    drawn = np.interp(t, told, i.real) + 1j * np.interp(t, told, i.imag)
    return motulator.sample_phasors(
        t, find_voltage(t), drawn + motulator.play_machines(machines, find_voltage, t)
    )
