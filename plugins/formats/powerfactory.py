"""PowerFactory's DGS exchange format, ASCII: an asynchronous machine and a general load on a
terminal.
"""

from math import pi

from tractexp.extend import plugin
from tractexp.extend.formats import Format, TCircuit

from ._motor import law, restore_load, terms

POLE_PAIRS = 2  # of the machine that is written; only inertia and rated speed are said in them
HEAD = "* written by tractexp; classes and columns as readers of DGS 5 have them\n"
KIND = {int: "i", float: "r", str: "a:40"}
POINTERS = ("fold_id", "typ_id", "obj_id")
TERMS = {"P": ("aP", "bP", "kpu0", "kpu1", "kpu"), "Q": ("aQ", "bQ", "kqu0", "kqu1", "kqu")}


@plugin
class PowerFactory(Format):
    """A DGS file: terminal, motor as ElmAsm with TypAsmo, static load as ElmLod with TypLod, for
    `Import - DGS`.

    The type is given by electrical parameters (i_mode 0): rstr, xstr, xm, xmrtr (0), and the
    rotor's rrtrA, xrtrA, per unit of the rated power, which is the export's base; power factor and
    efficiency of 1 keep that apart from the shaft. J [kg m²] holds the inertia. TypLod is P/P_0 =
    aP v^kpu0 + bP v^kpu1 + (1 - aP - bP) v^kpu, v of the voltage u0 before the event, and so for Q.

    Not to be confused with a whole project: there is no source in it.

    Source: DGS 5 readers of VeraGrid and PowSyBl (classes, columns, kinds of columns); DIgSILENT,
    technical references of the asynchronous machine and of the general load (circuit, polynomial).
    Departures: none known. Not tried in the program; rrtrA, xrtrA and J are named in no open
    reader: see the notes of an export.
    """

    suffix = ".dgs"
    motors = ("electromechanical", "stator_flux", "none")
    lacks = dict.fromkeys(
        ("double_cage", "double_cage_stator_flux"),
        "no open reader of DGS names the columns of a second cage",
    )
    statics = ("exponential", "zip", "constant_impedance", "branch", "constant_power", "none")
    effects = ("stator_resistance",)

    def text(self, load):
        frequency = load.omega_n / (2 * pi)
        bus = {"loc_name": "Traction bus", "fold_id": 2, "uknom": float(load.voltage), "outserv": 0}
        tables = {
            "General": {1: {"Descr": "Version", "Val": "5.0"}},
            "ElmNet": {2: {"loc_name": "Traction load", "fold_id": "", "frnom": frequency}},
            "ElmTerm": {3: bus},
            "StaCubic": {},
        }
        if "P_motor" in load.steady_state:
            tables["StaCubic"][4] = {"loc_name": "Cub_1", "fold_id": 3, "obj_bus": 0, "obj_id": 5}
            tables |= {"ElmAsm": {5: self._machine(load)}, "TypAsmo": {6: self._machine_type(load)}}
        if "P_static" in load.steady_state:
            tables["StaCubic"][7] = {"loc_name": "Cub_2", "fold_id": 3, "obj_bus": 0, "obj_id": 8}
            tables |= {"ElmLod": {8: self._load(load)}, "TypLod": {9: self._load_type(load)}}
        return HEAD + "".join(_table(name, rows) for name, rows in tables.items())

    def notes(self, load):
        lines = ["not tried in PowerFactory itself; readers of DGS named the classes and columns"]
        if "P_motor" in load.steady_state:
            c, t = load.circuit, self._machine_type(load)
            lines += [
                "check the machine's type after the import, for no open reader names rrtrA, xrtrA"
                f" and J: {t['pgn']:.6g} kW and {t['ugn']:.6g} kV, Rs {c.R_s:.5g}, Xs {c.X_s:.5g},"
                f" Xm {c.X_m:.5g}, RrA {c.R_1:.5g}, XrA {c.X_1:.5g} pu, J {t['J']:.6g} kg m² (H"
                f" {load.inertia:.5g} s); its load torque is constant (exponent 0)",
            ]
        if "P_static" in load.steady_state:
            lines.append("take the load's type as static in RMS simulations: 0 % dynamic")
        return [*lines, *self.omissions(load)]

    def read_back(self, text, load):
        tables = _tables(text)
        motor, static = None, (0.0, 0.0)
        for element, of_type in zip(
            tables.get("ElmAsm", ()), tables.get("TypAsmo", ()), strict=True
        ):
            power = of_type["pgn"] / 1e3
            circuit = TCircuit(
                load.omega_n, *(of_type[key] for key in ("rstr", "xstr", "xm", "rrtrA", "xrtrA"))
            )
            P, Q = element["pgini"] / power, element["qgini"] / power
            torque = P - circuit.R_s * (P**2 + Q**2) / load.steady_state["U0"] ** 2  # on the shaft
            inertia = of_type["J"] * (load.omega_n / of_type["nppol"]) ** 2 / (2e6 * power)
            motor = circuit, inertia, torque
        for element in tables.get("ElmLod", ()):
            static = element["plini"] / load.power, element["qlini"] / load.power
        own = {}
        for row in tables.get("TypLod", ()):
            own = law(
                load, [((row[a], row[m]), (row[b], row[n])) for a, b, m, n, _ in TERMS.values()]
            )
        return restore_load(load, motor, own, static)

    def _machine(self, load):
        P, Q = (load.power * load.steady_state[f"{power}_motor"] for power in "PQ")
        return {
            "loc_name": "Motor",
            "fold_id": 2,
            "typ_id": 6,
            "ngnum": 1,
            "i_mot": 1,
            "outserv": 0,
            "bustp": "AS",
            "pgini": P,
            "qgini": Q,
        }

    def _machine_type(self, load):
        c, frequency = load.circuit, load.omega_n / (2 * pi)
        slip = -load.steady_state.get("omega_before", 0.0) / load.omega_n
        return {
            "loc_name": "Motor type",
            "fold_id": "",
            "i_mode": 0,
            "i_cage": 0,
            "nppol": POLE_PAIRS,
            "pgn": 1e3 * load.power,
            "ugn": float(load.voltage),
            "cosn": 1.0,
            "effic": 100.0,
            "frequ": frequency,
            "anend": 60 * frequency / POLE_PAIRS * (1 - slip),
            "rstr": c.R_s,
            "xstr": c.X_s,
            "xm": c.X_m,
            "xmrtr": 0.0,
            "rrtrA": c.R_1,
            "xrtrA": c.X_1,
            "J": 2e6 * load.inertia * load.power / (load.omega_n / POLE_PAIRS) ** 2,
        }

    def _load(self, load):
        P, Q = (load.power * load.steady_state[f"{power}_static"] for power in "PQ")
        return {
            "loc_name": "Static load",
            "fold_id": 2,
            "typ_id": 9,
            "outserv": 0,
            "plini": P,
            "qlini": Q,
            "u0": load.steady_state["U0"],
        }

    def _load_type(self, load):
        row = {"loc_name": "Static load type", "fold_id": ""}
        for names, side in zip(TERMS.values(), terms(load), strict=True):
            row |= dict(zip(names, (*(a for a, _ in side[:2]), *(n for _, n in side)), strict=True))
        return row


def _table(name, rows):
    """A table of DGS, its columns said by the first row; a row a line."""
    first = next(iter(rows.values()))
    columns = [
        f"{key}({'p' if key in POINTERS else KIND[type(value)]})" for key, value in first.items()
    ]
    lines = [";".join([f"$${name}", "ID(a:40)", *columns])]
    lines += [";".join([str(number), *map(_cell, row.values())]) for number, row in rows.items()]
    return "\n".join(lines) + "\n"


def _cell(value):
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _tables(text):
    """{class: rows} of a DGS text; numbers as numbers."""
    tables, name, columns = {}, "", []
    for line in text.splitlines():
        cells = line.split(";")
        if line.startswith("$$"):
            name, columns = cells[0][2:], [cell.partition("(")[0] for cell in cells[1:]]
            tables[name] = []
        elif line and not line.startswith("*"):
            tables[name].append(
                {key: _number(cell) for key, cell in zip(columns, cells, strict=True)}
            )
    return tables


def _number(cell):
    try:
        return float(cell)
    except ValueError:
        return cell
