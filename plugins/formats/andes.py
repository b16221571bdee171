"""ANDES case file."""

import json

from tractexp.extend import plugin
from tractexp.extend.formats import Format

SMALLEST = 1e-6  # pu: ANDES reads a resistance of 0 as "not given" and takes 0.01
SYSTEM = 100.0  # MVA, the system base of ANDES


@plugin
class Andes(Format):
    """Tables of an ANDES case in JSON: the bus, the motor, and the static load with the PQ it replaces.

    `electromechanical`, and `stator_flux` without its transients, is Motor3 and `double_cage` Motor5, on a machine base
    equal to that of the export, with constant load torque (c1 = T_m) and the T-circuit of `tractexp.exchange.circuit`;
    `exponential` and `exponential_frequency` are FLoad, the other static loads ZIP. Add the tables to a case and
    connect the bus.

    Not to be confused with a complete case: there is no source in it.

    Source: ANDES 2.0, models Motor3, Motor5, FLoad, ZIP (parameter tables and equations); Milano 2010, ch. 14-15.
    Departures: R_s of 0 is written as 1e-6 pu. FLoad filters the frequency it measures; we do not.
    """

    suffix = ".json"
    motors = ("electromechanical", "stator_flux", "double_cage", "none")
    statics = ("exponential", "exponential_frequency", "zip", "constant_impedance", "branch", "constant_power", "none")
    effects = ("stator_resistance",)

    def text(self, load):
        bus = {"idx": load.bus, "name": "traction load", "Vn": load.voltage, "v0": load.before["U0"]}
        tables = {"Bus": [bus]}
        if "P_motor" in load.before:
            tables |= self._motor(load)
        if "P_static" in load.before:
            tables |= self._static(load)
        return json.dumps(tables, indent=2) + "\n"

    def notes(self, load):
        slip = -load.before.get("omega_before", 0.0) / load.omega_n
        start = "ANDES starts its power flow at standstill; where it does not converge, start the motor"
        return [*([f"{start} at the slip {slip:.5g}"] if slip else []), *self.omissions(load)]

    def _motor(self, load):
        c = load.circuit
        row = {
            "idx": "motor", "bus": load.bus, "Sn": load.power, "Vn": load.voltage,
            "fn": load.result.before["frequency"], "rs": max(c.R_s, SMALLEST), "xs": c.X_s, "xm": c.X_m,
            "rr1": c.R_1, "xr1": c.X_1, "Hm": load.inertia, "c1": load.values["T_m"], "c2": 0.0, "c3": 0.0,
        }  # fmt: skip
        if c.X_2 is None:
            return {"Motor3": [row]}
        return {"Motor5": [row | {"rr2": c.R_2, "xr2": c.X_2}]}

    def _static(self, load):
        scale, before, static = load.power / SYSTEM, load.before, load.result.model["static"]["name"]
        power = {"p0": before["P_static"] * scale, "q0": before["Q_static"] * scale}
        pq = {"idx": "static", "bus": load.bus, "Vn": load.voltage, "v0": before["U0"], **power}
        value = load.values.get
        if static.startswith("exponential"):
            exponents = {"ap": value("p_v"), "aq": value("q_v"), "bp": value("p_f", 0.0), "bq": value("q_f", 0.0)}
            return {"PQ": [pq], "FLoad": [{"idx": "law", "pq": "static", "kp": 100.0, "kq": 100.0, **exponents}]}
        shares = {"constant_impedance": (1, 0, 1, 0), "branch": (1, 0, 1, 0), "constant_power": (0, 0, 0, 0)}.get(
            static
        )
        a_Z, a_I, b_Z, b_I = shares or (value(name) for name in ("a_Z", "a_I", "b_Z", "b_I"))
        named = {"kpz": a_Z, "kpi": a_I, "kpp": 1 - a_Z - a_I, "kqz": b_Z, "kqi": b_I, "kqp": 1 - b_Z - b_I}
        return {"PQ": [pq], "ZIP": [{"idx": "law", "pq": "static", **{k: 100.0 * v for k, v in named.items()}}]}
