"""Loads of DPsim (MPL-2.0), which nobody here wrote, beside a machine of motulator's (extra
`strangers`); `strangers.py` judges by them.

DPsim integrates three phases at 50 us: resistance and inductance in series, or a core whose
inductance falls above a knee, behind a small resistance. What a voltage source feeds is the
voltage of the dip, which rises slowly first so that no core has an offset before it. The machine
sees the same voltage, and a recorder takes one-cycle phasors of both.
"""

import itertools
import tempfile
from dataclasses import dataclass
from typing import Any

import numpy as np
import strangers_motulator as motulator

STEP, RISE = 5e-5, 0.6  # s: of DPsim, and in which the voltage rises before the record
THREE = np.eye(3)
TURN = np.exp(-2j * np.pi / 3 * np.arange(3))  # from a space vector to its phases
KINDS = {  # what a load has beside a machine, by the names of the catalogue
    "resistance and inductance": ("inductive_static_load",),
    "saturable core": ("transformer_inrush",),
}
OUTSIDE = ()
NUMBERS = itertools.count()  # DPsim tells simulations of a process apart by their names


@dataclass(frozen=True)
class Branch:
    """R and L in series [pu]; of a core `knee` [pu of flux] and the share of L that is left above
    it.
    """

    resistance: float
    reactance: float
    knee: float = 0.0
    saturated: float = 1.0

    def build(self, name: str, nodes: tuple[Any, Any, Any]) -> tuple[Any, Any]:
        """The resistor and the inductor between three nodes of DPsim's."""
        from dpsimpy.emt import ph3

        begin, middle, end = nodes
        resistor = ph3.Resistor(f"r_{name}")
        resistor.set_parameters(self.resistance * THREE)
        resistor.connect([begin, middle])
        inductance = self.reactance / motulator.OMEGA
        if self.knee:
            flux = self.knee / motulator.OMEGA
            inductor = ph3.PiecewiseLinearInductor(f"l_{name}")
            current = flux / inductance
            beyond = flux / (self.saturated * inductance)
            inductor.set_parameters([0.0, flux, 2 * flux], [0.0, current, current + beyond])
        else:
            inductor = ph3.Inductor(f"l_{name}")
            inductor.set_parameters(inductance * THREE)
        inductor.connect([middle, end])
        return resistor, inductor


def draw_load(kind: str, rng: np.random.Generator) -> tuple[Any, list[Branch]]:
    """A load of motulator's with its static part, and what DPsim adds."""
    load = motulator.draw_load("constant torque", rng)
    if kind == "saturable core":
        core = Branch(0.02, float(rng.uniform(15, 30)), float(rng.uniform(1.05, 1.2)), 0.01)
        return load, [core]
    power, angle = float(rng.uniform(0.15, 0.35)), float(rng.uniform(0.3, 0.7))
    return load, [Branch(np.cos(angle) ** 2 / power, np.sin(angle) * np.cos(angle) / power)]


def record_dip(load: tuple[Any, list[Branch]], dip: motulator.Dip) -> dict[str, np.ndarray]:
    """Columns t [s], U, P, Q [pu], f [Hz] (N,) of one-cycle phasors, without noise."""
    machines, branches = load
    t = motulator.find_times()
    u = dip.find_voltage(t)
    i = motulator.play_machines(machines, dip.find_voltage, t) + play_branches(branches, dip, t)
    return motulator.sample_phasors(t, u, i + np.conj(machines[2](np.abs(u)) / u))


def play_branches(branches: list[Branch], dip: motulator.Dip, t: np.ndarray) -> np.ndarray:
    """The current (N,) [pu] of branches at times t (N,) in the frame of the voltage."""
    import dpsimpy

    emt, name = dpsimpy.emt, f"branches{next(NUMBERS)}"
    bus = emt.SimNode("bus", dpsimpy.PhaseType.ABC)
    middles = [emt.SimNode(f"m{k}", dpsimpy.PhaseType.ABC) for k in range(len(branches))]
    source = emt.ph3.ControlledVoltageSource("source")
    source.set_parameters(np.zeros((3, 1)))
    source.connect([emt.SimNode.gnd, bus])
    pairs = [
        one.build(str(k), (bus, middle, emt.SimNode.gnd))
        for k, (one, middle) in enumerate(zip(branches, middles, strict=True))
    ]
    system = dpsimpy.SystemTopology(
        motulator.FREQUENCY, [bus, *middles], [source, *itertools.chain(*pairs)]
    )
    fine = np.arange(round((t[-1] + STEP / 2 - t[0] + RISE) / STEP) + 1) * STEP + t[0] - RISE
    growth = 0.5 - 0.5 * np.cos(np.pi * np.clip((fine - fine[0]) / (0.8 * RISE), 0, 1))
    turning = np.exp(1j * motulator.OMEGA * fine)
    phases = ((growth * dip.find_voltage(fine) * turning)[:, None] * TURN).real
    simulation = dpsimpy.Simulation(name)
    with tempfile.TemporaryDirectory() as folder:
        dpsimpy.Logger.set_log_dir(folder)
        log = dpsimpy.Logger(name)
        # what nothing logs is not calculated
        for k, (resistor, _) in enumerate(pairs):
            log.log_attribute(f"i{k}", "i_intf", resistor)
        simulation.set_system(system)
        simulation.set_domain(dpsimpy.Domain.EMT)
        simulation.set_time_step(STEP)
        simulation.set_final_time(len(fine) * STEP)
        simulation.add_logger(log)
        simulation.start()
        reference = source.attr("V_ref")
        drawn = [resistor.attr("i_intf") for resistor, _ in pairs]
        currents = np.empty((len(fine), 3))
        for n, row in enumerate(phases):
            reference.set(np.ascontiguousarray(row[:, None]))
            simulation.next()
            currents[n] = -np.sum([np.ravel(one.get()) for one in drawn], axis=0)
        simulation.stop()
    vector = 2 / 3 * currents @ np.conj(TURN) / turning
    return np.interp(t, fine, vector.real) + 1j * np.interp(t, fine, vector.imag)
