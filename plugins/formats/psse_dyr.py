"""PSS/E dynamics data: CIM5BL and IEELBL."""

from tractexp.extend import plugin
from tractexp.extend.formats import Format, TCircuit

from ._motor import law, restore_load, terms


@plugin
class PsseDyr(Format):
    """Records of a PSS/E .dyr file: the motor as CIM5BL on load 'M' of the bus, the static load as
    IEELBL on load 'S'.

    CIM5BL: bus, model, load, IT, RA, XA, XM, R1, X1, R2, X2, E1, S(E1), E2, S(E2), MBASE, PMULT, H,
    VI, TI, TB, D, TNOM. Type 1, no saturation, constant torque (D = 0), no undervoltage trip (VI =
    0); MBASE is the export's base. R2 = X2 = 0 is a single cage; of a stator flux that moves the
    transients are left out. IEELBL: three terms a V^n each for P and for Q, then the frequency
    coefficients, then the exponents, n1..n6; coefficients are divided by U_0^n, because V is the
    bus voltage and not U/U_0.

    Not to be confused with the power flow data: the two loads and their MW and Mvar must be in the
    .raw file.

    Source: PowerWorld Simulator help, CIM5 (parameters, MBASE, types); STEPS and uqgrid, which read
    .dyr files, for the order of CIM5BL's and IEELBL's constants and for T0' and X' from them.
    Departures: none.
    """

    suffix = ".dyr"
    motors = ("electromechanical", "stator_flux", "double_cage", "double_cage_stator_flux", "none")
    statics = ("exponential", "zip", "constant_impedance", "branch", "constant_power", "none")
    effects = ("stator_resistance",)

    def text(self, load):
        records = []
        if "P_motor" in load.steady_state:
            c = load.circuit
            cages = (c.R_1, c.X_1, c.R_2 or 0.0, c.X_2 or 0.0)
            saturation, trip = (0.0, 0.0, 0.0, 0.0), (0.0, 9999.0, 0.0)
            rating = (load.power, 1.0, load.inertia)
            records.append(
                _record(
                    load.bus,
                    "CIM5BL",
                    "M",
                    1,
                    c.R_s,
                    c.X_s,
                    c.X_m,
                    *cages,
                    *saturation,
                    *rating,
                    *trip,
                    0.0,
                    0.0,
                )
            )
        if "P_static" in load.steady_state:
            pairs = [pair for side in terms(load) for pair in side]
            coefficients, exponents = (
                [a / load.steady_state["U0"] ** n for a, n in pairs],
                [n for _, n in pairs],
            )
            records.append(_record(load.bus, "IEELBL", "S", *coefficients, 0.0, 0.0, *exponents))
        return "".join(records)

    def notes(self, load):
        lines = self.omissions(load)
        for identifier, part in (("M", "motor"), ("S", "static")):
            if f"P_{part}" in load.steady_state:
                P, Q = (load.power * load.steady_state[f"{power}_{part}"] for power in "PQ")
                lines.append(
                    f"load '{identifier}' of bus {load.bus} in the power flow: {P:.6g} MW, {Q:.6g}"
                    " Mvar"
                )
        return lines

    def read_back(self, text, load):
        motor, own, static = None, {}, (0.0, 0.0)
        for record in text.split("/")[:-1]:
            _, model, _, *rest = (field.strip() for field in record.replace("\n", " ").split(","))
            c = [float(constant) for constant in rest]
            if model == "'CIM5BL'":
                cages = c[4:6] + (c[6:8] if c[7] else [None, None])
                motor = TCircuit(load.omega_n, *c[1:4], *cages), c[14], load.values["T_m"]
            else:
                # in the power flow: see the notes
                static = load.steady_state["P_static"], load.steady_state["Q_static"]
                pairs = [(c[k] * load.steady_state["U0"] ** c[8 + k], c[8 + k]) for k in range(6)]
                own = law(load, (pairs[:3], pairs[3:]))
        return restore_load(load, motor, own, static)


def _record(bus, model, load, *constants):
    """One record, its constants in lines of five."""
    texts = [f"{c:d}" if isinstance(c, int) else f"{c:.8g}" for c in constants]
    rows = [", ".join(texts[k : k + 5]) for k in range(0, len(texts), 5)]
    return f"{bus}, '{model}', '{load}', " + ",\n    ".join(rows) + " /\n"
