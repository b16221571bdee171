"""ANDES case file."""

import contextlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tractexp.extend import UserError, plugin
from tractexp.extend.formats import Format, Simulated, TCircuit, dip, lock_file

from ._motor import SMALLEST, restore_load, terms

SYSTEM_MVA = 100.0  # MVA, the system base of ANDES
STEP = 1e-3  # s
LONGEST = 300.0  # s: its first run on a machine generates code, and one process at a time does
GENERATED = Path.home() / ".andes"  # the folder of that code


@plugin
class Andes(Format):
    """Tables of an ANDES case in JSON: the bus, the motor, and the static load with the PQ it
    replaces.

    `electromechanical`, and `stator_flux` without its transients, is Motor3; `double_cage`, and
    `double_cage_stator_flux` without its transients, is Motor5. Their machine base is that of the
    export, with constant load torque (c1, which ANDES reads per unit of the system) and the
    T-circuit of `tractexp.exchange.circuit`; `exponential` and `exponential_frequency` are FLoad,
    the other static loads ZIP. Add the tables to a case and connect the bus.

    Not to be confused with a complete case: there is no source in it.

    Source: ANDES 2.0, models Motor3, Motor5, FLoad, ZIP (parameter tables and equations); Milano
    2010, ch. 14-15.
    Departures: R_s of 0 is written as 1e-6 pu. FLoad filters the frequency it measures; we do not.
    """

    suffix = ".json"
    motors = ("electromechanical", "stator_flux", "double_cage", "double_cage_stator_flux", "none")
    statics = (
        "exponential",
        "exponential_frequency",
        "zip",
        "constant_impedance",
        "branch",
        "constant_power",
        "none",
    )
    effects = ("stator_resistance",)

    def text(self, load):
        bus = {
            "idx": load.bus,
            "name": load.name,
            "Vn": load.voltage,
            "v0": load.steady_state["U0"],
        }
        tables = {"Bus": [bus]}
        if "P_motor" in load.steady_state:
            tables |= self._motor(load)
        if "P_static" in load.steady_state:
            tables |= self._static(load)
        return json.dumps(tables, indent=2) + "\n"

    def notes(self, load):
        slip = -load.steady_state.get("omega_before", 0.0) / load.omega_n
        start = (
            "ANDES starts its power flow at standstill; where it does not converge, start the motor"
        )
        return [*([f"{start} at the slip {slip:.5g}"] if slip else []), *self.omissions(load)]

    def read_back(self, text, load):
        tables, motor, static = json.loads(text), None, (0.0, 0.0)
        for row in (*tables.get("Motor3", ()), *tables.get("Motor5", ())):
            circuit = TCircuit(
                load.omega_n,
                *(row.get(key) for key in ("rs", "xs", "xm", "rr1", "xr1", "rr2", "xr2")),
            )
            motor = circuit, row["Hm"], row["c1"] * SYSTEM_MVA / load.power
        for row in tables.get("PQ", ()):
            static = tuple(SYSTEM_MVA / load.power * row[key] for key in ("p0", "q0"))
        law = {}
        for row in tables.get("FLoad", ()):
            law |= {"p_v": row["ap"], "q_v": row["aq"], "p_f": row["bp"], "q_f": row["bq"]}
        for row in tables.get("ZIP", ()):
            law |= {"a_Z": row["kpz"], "a_I": row["kpi"], "b_Z": row["kqz"], "b_I": row["kqi"]}
            law = {name: percent / 100 for name, percent in law.items()}
        return restore_load(load, motor, law, static)

    def play_back_dip(self, text, load):
        """The response in ANDES, in a process of its own: of this Python, or of the one in
        TRACTEXP_ANDES_PYTHON.
        """
        import numpy as np

        python = (
            sys.executable
            if importlib.util.find_spec("andes")
            else os.environ.get("TRACTEXP_ANDES_PYTHON")
        )
        if not python:
            return None
        dip_settings = {
            "step": STEP,
            "frequency": load.result.before["frequency"],
            "voltage": dip(STEP).tolist(),
        }
        response = respond(python, text, dip_settings)
        speed = np.gradient(response["angle"], STEP, edge_order=2)
        P, Q = (SYSTEM_MVA / load.power * response[power] for power in "PQ")
        return Simulated(f"ANDES {response['version']}", STEP, response["U"], speed, P, Q)

    def _motor(self, load):
        c = load.circuit
        row = {
            "idx": "motor",
            "bus": load.bus,
            "Sn": load.power,
            "Vn": load.voltage,
            "fn": load.result.before["frequency"],
            "rs": max(c.R_s, SMALLEST),
            "xs": c.X_s,
            "xm": c.X_m,
            "rr1": c.R_1,
            "xr1": c.X_1,
            "Hm": load.inertia,
            "c1": load.values["T_m"] * load.power / SYSTEM_MVA,
            "c2": 0.0,
            "c3": 0.0,
        }
        if c.X_2 is None:
            return {"Motor3": [row]}
        return {"Motor5": [row | {"rr2": c.R_2, "xr2": c.X_2}]}

    def _static(self, load):
        scale, before, static = (
            load.power / SYSTEM_MVA,
            load.steady_state,
            load.result.model["static"]["name"],
        )
        power = {"p0": before["P_static"] * scale, "q0": before["Q_static"] * scale}
        pq = {"idx": "static", "bus": load.bus, "Vn": load.voltage, "v0": before["U0"], **power}
        value = load.values.get
        if static.startswith("exponential"):
            exponents = {
                "ap": value("p_v"),
                "aq": value("q_v"),
                "bp": value("p_f", 0.0),
                "bq": value("q_f", 0.0),
            }
            return {
                "PQ": [pq],
                "FLoad": [{"idx": "law", "pq": "static", "kp": 100.0, "kq": 100.0, **exponents}],
            }
        a_Z, a_I, b_Z, b_I = (
            sum(a for a, n in side if n == power) for side in terms(load) for power in (2, 1)
        )
        named = {
            "kpz": a_Z,
            "kpi": a_I,
            "kpp": 1 - a_Z - a_I,
            "kqz": b_Z,
            "kqi": b_I,
            "kqp": 1 - b_Z - b_I,
        }
        return {
            "PQ": [pq],
            "ZIP": [{"idx": "law", "pq": "static", **{k: 100.0 * v for k, v in named.items()}}],
        }


def respond(python, tables, settings):
    """The response along a dip that ANDES calculates for the load of these tables: U, angle, P, Q
    (N,), P and Q on its base.

    Raises `UserError` where it fails.
    """
    import numpy as np

    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        target = Path(folder) / "response.npz"
        case = json.dumps([json.loads(tables), settings])
        program = Path(__file__).with_name("_andes_run.py").read_text(encoding="utf-8")
        try:
            GENERATED.mkdir(exist_ok=True)
            stack.enter_context(lock_file(GENERATED / "tractexp.lock", LONGEST))
            # by its text: this module has ANDES's own name
            command = [python, "-P", "-c", program, target]
            done = subprocess.run(
                command, input=case, capture_output=True, text=True, timeout=LONGEST, cwd=folder
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise UserError(f"not played back in ANDES: {error}") from error
        if done.returncode:
            last = (done.stderr or done.stdout).strip().rpartition("\n")[2]
            raise UserError(f"not played back in ANDES: {last or 'it said nothing'}")
        with np.load(target) as content:
            return dict(content)
