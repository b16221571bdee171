"""Exports: the T-circuit gives back what was identified, each file is read back, ANDES agrees,
refusals are clear.
"""

import dataclasses
import itertools
import json
import re

import andes_check
import modelica_check
import numpy as np
import pytest
from command_line import run_command
from scipy.integrate import solve_ivp
from scipy.interpolate import Akima1DInterpolator

import tractexp
from tractexp.api.export import Exported
from tractexp.api.identification import Identification
from tractexp.configuration.plugin import build, discover
from tractexp.errors import UserError
from tractexp.exchange.circuit import TCircuit
from tractexp.exchange.format import Identified
from tractexp.exchange.playback import play_back_export
from tractexp.model.drive import Drive, Excitation

OMEGA = 2 * np.pi * 50
VALUES = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "R_s": 0.02,
    "T_second": 0.01,
    "X_second": 0.18,
    "p_v": 1.4,
    "q_v": 3.0,
    "a_Z": 0.4,
    "a_I": 0.3,
    "b_Z": 0.7,
    "b_I": 0.2,
    "p_f": 1.3,
    "q_f": -1.1,
}
BEFORE = {"U0": 0.98, "P0": 1.0, "Q0": 0.6, "frequency": 50.0}


def identified(motor="electromechanical", static="exponential", effects=(), **options):
    parts = [build("model/motor", {"name": motor}), build("model/static", {"name": static})]
    parts += [build("effect", {"name": name}) for name in effects]
    parameters = {p.name: VALUES.get(p.name, p.default) for part in parts for p in part.parameters}
    settings = {"motor": {"name": motor}, "static": {"name": static}, "effects": list(effects)}
    return Identified(andes_check.result(parameters, settings, BEFORE), **options)


def write(name, load):
    """The text of an export, as the task makes it."""
    form = build("format", {"name": name})
    form.check_parts(load)
    return form.text(load)


@pytest.mark.parametrize("seed", range(5))
def test_the_circuit_of_one_cage_gives_back_what_was_identified(seed):
    rng = np.random.default_rng(seed)
    T, X, C = rng.uniform(0.01, 0.5), rng.uniform(0.05, 1.5), rng.uniform(0.3, 0.99)
    c = TCircuit.single(T, X, C, OMEGA, 0.01)
    assert c.X_prime == pytest.approx(X, rel=1e-12)
    assert pytest.approx(X / (1 - C), rel=1e-12) == c.X
    assert c.T0_prime == pytest.approx(T / (1 - C), rel=1e-12)
    assert (c.X_s, c.R_s) == (c.X_1, 0.01)
    assert c.X_m > 0


@pytest.mark.parametrize("seed", range(20))
def test_the_circuit_of_two_cages_gives_back_what_was_identified(seed):
    rng = np.random.default_rng(seed)
    T, X, C = rng.uniform(0.01, 0.5), rng.uniform(0.05, 1.5), rng.uniform(0.3, 0.99)
    T2, X2 = rng.uniform(0.001, 0.05), X * rng.uniform(0.05, 0.98)
    c = TCircuit.double(T, X, C, T2, X2, OMEGA)
    known = {"T_prime": T, "X_prime": X, "C": C, "T_second": T2, "X_second": X2}
    assert c.parameters() == pytest.approx(known, rel=1e-9)
    assert pytest.approx(X / (1 - C), rel=1e-9) == c.X
    assert c.X_prime == pytest.approx(X, rel=1e-9)
    assert c.X_second == pytest.approx(X2, rel=1e-9)
    assert c.T0_prime == pytest.approx(T / (1 - C), rel=1e-9)
    assert c.T0_second == pytest.approx(T2 * X / X2, rel=1e-9)
    assert min(c.X_s, c.X_m, c.X_1, c.X_2, c.R_1, c.R_2) > 0


def test_the_circuit_draws_what_the_model_draws_before_the_event():
    """The T-circuit at the exported slip, by impedances alone."""
    load = identified()
    c, slip = load.circuit, -load.steady_state["omega_before"] / OMEGA
    rotor = c.R_1 / slip + 1j * c.X_1
    S = 0.98**2 / np.conj(1j * c.X_s + 1j * c.X_m * rotor / (1j * c.X_m + rotor))
    assert S.real == pytest.approx(VALUES["T_m"], rel=1e-9)
    assert S.imag == pytest.approx(load.steady_state["Q_motor"], rel=1e-9)


@pytest.mark.parametrize(
    ("motor", "static"),
    [
        ("electromechanical", "exponential"),
        ("double_cage", "exponential"),
        ("electromechanical", "zip"),
        ("none", "zip"),
        ("none", "constant_impedance"),
    ],
)
def test_the_andes_tables_hold_the_load(motor, static):
    tables = json.loads(write("andes", identified(motor, static, bus=7, power=50.0)))
    assert tables["Bus"][0]["idx"] == 7
    assert {"electromechanical": "Motor3" in tables, "double_cage": "Motor5" in tables}.get(
        motor, True
    )
    law = tables["FLoad" if static == "exponential" else "ZIP"][0]
    if static != "exponential":
        assert law["kpz"] + law["kpi"] + law["kpp"] == pytest.approx(100)
        assert law["kqz"] + law["kqi"] + law["kqp"] == pytest.approx(100)
    drawn = VALUES["T_m"] if motor != "none" else 0.0
    # 50 MVA on ANDES's 100
    assert tables["PQ"][0]["p0"] == pytest.approx((1.0 - drawn) / 2, rel=1e-9)
    if motor == "electromechanical":
        assert tables["Motor3"][0]["Hm"] == pytest.approx(0.006 * OMEGA / 2)
        # ANDES does not convert it
        assert tables["Motor3"][0]["c1"] == pytest.approx(VALUES["T_m"] / 2)


def test_of_two_cages_and_a_stator_flux_andes_has_the_cages():
    tables = json.loads(write("andes", identified("double_cage_stator_flux")))
    assert tables["Motor5"][0]["rs"] == pytest.approx(VALUES["R_s"])


def dyr(text):
    """{model: (bus, load, constants)} of a .dyr file, read by its own rules: free format, records
    end with a slash.
    """
    records = {}
    for record in text.split("/")[:-1]:
        bus, model, load, *constants = [
            field.strip() for field in record.replace("\n", " ").split(",")
        ]
        records[model.strip("'")] = int(bus), load.strip("'"), [float(c) for c in constants]
    return records


@pytest.mark.parametrize("motor", ["electromechanical", "double_cage", "double_cage_stator_flux"])
def test_the_dyr_motor_gives_back_what_was_identified(motor):
    bus, load, c = dyr(write("psse_dyr", identified(motor, bus=12)))["CIM5BL"]
    assert (bus, load, len(c), c[0]) == (12, "M", 20, 1)
    circuit = TCircuit(OMEGA, *c[1:6], *([None, None] if motor == "electromechanical" else c[6:8]))
    assert circuit.X_prime == pytest.approx(VALUES["X_prime"], rel=1e-6)
    assert circuit.T0_prime == pytest.approx(VALUES["T_prime"] / (1 - VALUES["C"]), rel=1e-6)
    if motor != "electromechanical":
        assert circuit.X_second == pytest.approx(VALUES["X_second"], rel=1e-6)
    assert c[8:12] == [0, 0, 0, 0]
    assert c[12:15] == pytest.approx([100.0, 1.0, 0.006 * OMEGA / 2])


@pytest.mark.parametrize("static", ["exponential", "zip", "constant_impedance", "constant_power"])
def test_the_dyr_static_load_is_its_law(static):
    """IEELBL normalized by the power before, P = P_0 sum(a V^n)/sum(a V_0^n), against our own
    simulation.
    """
    text = write("psse_dyr", identified("none", static))
    _, _, c = dyr(text)["IEELBL"]
    U = np.array([0.98, 0.8, 0.5, 1.05])
    event = Excitation(1e-3, U, U, U, 0.98, 1.0, 0.6)
    of = identified("none", static)
    response = of.model.simulate(
        Drive.from_events([event]), [[of.values[name] for name in of.model.names]]
    )
    for power, start, exponents, before in ((response.P, 0, 8, 1.0), (response.Q, 3, 11, 0.6)):

        def law(V, start=start, exponents=exponents):
            return sum(c[start + k] * V ** c[exponents + k] for k in range(3))

        assert power[0] == pytest.approx(before * law(U) / law(0.98), rel=1e-6)
    assert c[6:8] == [0, 0]


def modelica(text):
    """Parameters, start values and equations of our flat Modelica, read as text; expressions as
    Python functions.
    """
    numbers = dict(re.findall(r"parameter Real (\w+) = ([-\d.e+]+)", text))
    starts = dict(re.findall(r"^  Real (\w+)\(start = ([-\d.e+]+), fixed = true\);", text, re.M))
    equations = re.findall(r"^  (\S+) = (.*);$", text.split("\nequation\n")[1], re.M)
    return (
        {k: float(v) for k, v in numbers.items()},
        {k: float(v) for k, v in starts.items()},
        {left: compile(right.replace("^", "**"), left, "eval") for left, right in equations},
    )


@pytest.mark.parametrize(
    ("motor", "static", "effects"),
    [
        ("electromechanical", "exponential", ()),
        ("mechanical", "zip", ()),
        ("voltage", "constant_power", ()),
        ("stator_flux", "exponential_frequency", ()),
        ("double_cage", "constant_impedance", ()),
        ("none", "zip", ()),
        ("electromechanical", "exponential", ("stator_resistance",)),
        ("electromechanical", "exponential", ("speed_dependent_torque",)),
    ],
)
def test_the_modelica_text_simulates_as_our_kernel_does(motor, static, effects):
    """The file's own equations, integrated by SciPy, against the kernel: the round trip of the
    whole model.
    """
    load = identified(motor, static, effects)
    text = write("modelica", load)
    assert text.startswith("model TractionLoad ")
    assert text.endswith("end TractionLoad;\n")
    numbers, starts, equations = modelica(text)
    t = np.arange(251) * 2e-3
    U = 0.98 * (1 - 0.3 * (np.clip((t - 0.1) / 0.04, 0, 1) - np.clip((t - 0.3) / 0.04, 0, 1)))
    speed = 2.0 * np.sin(8 * t)
    smooth = Akima1DInterpolator(t, U, method="makima")
    names = {"sqrt": np.sqrt, "exp": np.exp, "log": np.log, "max": max, "min": min, "abs": abs}

    def evaluate(left, at, x):
        inputs = {"U": float(smooth(at)), "omega_s": float(np.interp(at, t, speed))}
        return eval(
            equations[left], {}, names | numbers | inputs | dict(zip(starts, x, strict=True))
        )

    slopes = [f"der({name})" for name in starts]
    x, rows = np.array(list(starts.values())), []
    for a, b in itertools.pairwise([*t, t[-1]]):
        rows.append([evaluate("P", a, x), evaluate("Q", a, x)])
        if starts and b > a:
            f = lambda at, x: [evaluate(s, at, x) for s in slopes]  # noqa: E731
            x = solve_ivp(f, (a, b), x, method="DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
    P, Q = np.array(rows).T
    event = Excitation(2e-3, U, P, Q, 0.98, 1.0, 0.6, speed, 0.0, OMEGA)
    response = load.model.simulate(
        Drive.from_events([event]), [[load.values[name] for name in load.model.names]], 16
    )
    assert pytest.approx(P, abs=1e-6) == response.P[0]
    assert pytest.approx(Q, abs=1e-6) == response.Q[0]


def test_what_a_modelica_compiler_made_of_our_files_is_what_the_page_says():
    rows = json.loads(modelica_check.ROWS.read_text(encoding="utf-8"))
    assert len(rows) == len(modelica_check.LOADS)
    for row in rows:
        assert row["P"] < 1e-5 * row["moves_P"]
        assert row["Q"] < 1e-5 * row["moves_Q"]
    assert modelica_check.text() in modelica_check.PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.long)])
def test_every_name_in_a_modelica_file_is_declared_in_it(every):
    known = {"der", "time", "sqrt", "exp", "log", "max", "min", "abs", "if", "then", "else"}
    known |= {"sin", "cos", "tan", "tanh", "atan", "atan2", "sign", "noEvent", "and", "or", "not"}
    written = 0
    for name in sorted(discover()["effect"])[::every]:
        try:
            text = write("modelica", identified("stator_flux", "exponential", (name,)))
        except UserError:  # it is refused, or does not fit this model
            continue
        head, equations = re.sub(r'"[^"]*"', "", text).split("\nequation\n")
        declared = {*re.findall(r"Real (\w+)", head), "end", "TractionLoad"}
        used = {*re.findall(r"[A-Za-z_]\w*", re.sub(r"\d[\d.]*e[-+]?\d+", "", equations))}
        assert used - declared <= known, name
        written += 1
    assert written > 20 // every


@pytest.mark.parametrize(
    ("name", "parts", "sentence"),
    [
        (
            "andes",
            ("mechanical", "exponential"),
            "format 'andes' cannot represent the motor 'mechanical'; it can represent",
        ),
        ("andes", ("voltage", "exponential"), "cannot represent the motor 'voltage'"),
        ("psse_dyr", ("voltage", "zip"), "format 'psse_dyr' cannot represent the motor 'voltage'"),
        (
            "powerfactory",
            ("double_cage", "zip"),
            "cannot represent the motor 'double_cage': no open reader of DGS names the columns of a"
            " second cage; it"
            " can represent electromechanical, none, stator_flux; task.format=andes, load_json,"
            " modelica or psse_dyr can represent 'double_cage'",
        ),
        (
            "powerfactory",
            ("electromechanical", "zip", ("time_skew",)),
            "cannot represent the effect 'time_skew'; it can represent stator_resistance",
        ),
        (
            "psse_dyr",
            ("none", "exponential_frequency"),
            "cannot represent the static load 'exponential_frequency'",
        ),
        (
            "andes",
            ("electromechanical", "zip", ("undervoltage_trip",)),
            "cannot represent the effect 'undervoltage_trip'",
        ),
        (
            "modelica",
            ("electromechanical", "zip", ("undervoltage_trip",)),
            "cannot represent 'voltage_last', which acts on",
        ),
        (
            "modelica",
            ("electromechanical", "zip", ("time_skew",)),
            "cannot represent 'time_skew', which acts on samples",
        ),
    ],
)
def test_what_a_format_cannot_represent_is_refused_in_a_sentence(name, parts, sentence):
    with pytest.raises(UserError, match=re.escape(sentence)):
        write(name, identified(*parts))


def test_every_format_says_how_it_reads_its_standard():
    for cls in discover()["format"].values():
        assert "Source:" in cls.__doc__
        assert "Departures:" in cls.__doc__


def test_the_command_writes_one_file_or_nothing(tmp_path):
    identified().result.write(tmp_path / "result.json")
    # an export to ANDES, which plays it back, is run of the docs (test_commands)
    formats = (("psse_dyr", "dyr"), ("modelica", "mo"), ("powerfactory", "dgs"))
    for name, suffix in formats:
        done = run_command(
            "task=export",
            "task.parameters=result.json",
            f"task.format={name}",
            f"hydra.run.dir={name}",
            cwd=tmp_path,
        )
        assert done.returncode == 0, done.stderr
        assert {p.name for p in (tmp_path / name).iterdir()} == {".hydra", f"load.{suffix}"}
        assert done.stdout.splitlines()[0] == f"file: {tmp_path / name / f'load.{suffix}'}"
    identified("mechanical").result.write(tmp_path / "result.json")
    refused = {
        "task.format=andes": "cannot represent the motor 'mechanical'",
        "task.format=ands": "there is no format 'ands'; did you mean 'andes'?",
        "task.parameters=null": "task.parameters is not given; it is the path of a result.json",
        "task.power=0": "task.power=0",
    }
    for argument, sentence in refused.items():
        done = run_command(
            "task=export",
            "task.parameters=result.json",
            argument,
            "hydra.run.dir=none",
            cwd=tmp_path,
        )
        assert done.returncode == 2
        assert sentence in done.stderr
        assert done.stderr.count("\n") == 1
        assert not (tmp_path / "none").exists()


def dgs(text):
    """{class: rows} of a DGS text, by its own rules: a head of columns and their kinds, then a row
    a line.
    """
    tables, rows, columns = {}, [], []
    for line in text.splitlines():
        if line.startswith("$$"):
            name, *columns = line[2:].split(";")
            rows = tables.setdefault(name, [])
        elif not line.startswith("*"):
            cells = line.split(";")
            assert len(cells) == len(columns)
            kinds = {"i": int, "r": float, "p": str, "a": str}
            heads = [re.fullmatch(r"([\w:]+)\(([irpa])(?::\d+)?\)", column) for column in columns]
            rows.append({h[1]: kinds[h[2]](cell) for h, cell in zip(heads, cells, strict=True)})
    return tables


@pytest.mark.parametrize("effects", [(), ("stator_resistance",)])
def test_the_powerfactory_file_holds_the_load(effects):
    load = identified(effects=effects, power=50.0, voltage=27.5)
    tables = dgs(write("powerfactory", load))
    assert tables["General"] == [{"ID": "1", "Descr": "Version", "Val": "5.0"}]
    numbers = [row["ID"] for rows in tables.values() for row in rows]
    assert len({*numbers}) == len(numbers)
    pointed = {
        row[key]
        for rows in tables.values()
        for row in rows
        for key in ("fold_id", "typ_id", "obj_id")
        if row.get(key)
    }
    assert pointed <= {*numbers}
    (motor,), (of_type,), (static,), (law,) = (
        tables[name] for name in ("ElmAsm", "TypAsmo", "ElmLod", "TypLod")
    )
    assert (of_type["pgn"], of_type["ugn"], of_type["frequ"]) == (50_000.0, 27.5, 50.0)
    X = of_type["xstr"] + of_type["xm"]
    behind = of_type["xm"] * of_type["xrtrA"] / (of_type["xm"] + of_type["xrtrA"])
    assert of_type["xstr"] + behind == pytest.approx(VALUES["X_prime"], rel=1e-7)
    assert 1 - (of_type["xstr"] + behind) / X == pytest.approx(VALUES["C"], rel=1e-7)
    assert of_type["rstr"] == (0.02 if effects else 0.0)
    stored = 0.5 * of_type["J"] * (OMEGA / of_type["nppol"]) ** 2 / 50e6  # s
    assert stored == pytest.approx(VALUES["M"] * OMEGA / 2, rel=1e-7)
    assert motor["pgini"] + static["plini"] == pytest.approx(50.0, rel=1e-7)
    assert motor["qgini"] + static["qlini"] == pytest.approx(30.0, rel=1e-7)
    assert (law["aP"], law["kpu0"], law["aQ"], law["kqu0"]) == (
        1.0,
        VALUES["p_v"],
        1.0,
        VALUES["q_v"],
    )
    assert static["u0"] == BEFORE["U0"]


def test_a_zip_load_is_the_polynomial_of_powerfactory():
    (law,) = dgs(write("powerfactory", identified("none", "zip")))["TypLod"]
    v = np.array([0.5, 0.8, 1.0])
    for side, names in (
        ("a", ("aP", "bP", "kpu0", "kpu1", "kpu")),
        ("b", ("aQ", "bQ", "kqu0", "kqu1", "kqu")),
    ):
        a, b, e0, e1, e = (law[name] for name in names)
        Z, current = VALUES[f"{side}_Z"], VALUES[f"{side}_I"]
        assert a * v**e0 + b * v**e1 + (1 - a - b) * v**e == pytest.approx(
            Z * v**2 + current * v + (1 - Z - current), rel=1e-9
        )


PLAYED = [
    (name, motor, static, effects)
    for name in ("andes", "psse_dyr", "powerfactory", "modelica")
    for motor, static, effects in (
        ("electromechanical", "exponential", ()),
        ("electromechanical", "zip", ("stator_resistance",)),
        ("double_cage", "constant_impedance", ()),
        ("none", "zip", ()),
    )
    if (name, motor) != ("powerfactory", "double_cage")
]


@pytest.mark.parametrize(("name", "motor", "static", "effects"), PLAYED)
def test_an_export_played_back_by_its_own_numbers_follows_the_fit(
    name, motor, static, effects, monkeypatch
):
    form, load = (
        build("format", {"name": name}),
        identified(motor, static, effects, power=47.0, ratio=0.7),
    )
    monkeypatch.setattr(type(form), "play_back_dip", lambda *_: None)
    agreement, notes = play_back_export(form, form.text(load), load)
    assert notes == []
    assert agreement.moved[0] > 0.15
    assert agreement.share < 1e-6


@pytest.mark.parametrize(
    ("name", "right", "wrong"),
    [
        ("andes", '"Hm": ', '"Hm": 9'),
        ("psse_dyr", "'CIM5BL', 'M', 1, 0,", "'CIM5BL', 'M', 1, 0.05,"),
        ("powerfactory", ";AS;55", ";AS;45"),
        ("modelica", "Real T_prime = 0.1", "Real T_prime = 0.3"),
    ],
)
def test_a_file_that_holds_another_load_is_seen_when_it_is_played_back(
    name, right, wrong, monkeypatch
):
    form, load = build("format", {"name": name}), identified()
    monkeypatch.setattr(type(form), "play_back_dip", lambda *_: None)
    text = form.text(load)
    assert right in text
    assert play_back_export(form, text.replace(right, wrong, 1), load)[0].share > 0.01


def test_what_a_format_leaves_out_is_in_the_agreement(monkeypatch):
    """The stator's transients, which the machines of ANDES lack."""
    form, load = build("format", {"name": "andes"}), identified("stator_flux")
    monkeypatch.setattr(type(form), "play_back_dip", lambda *_: None)
    assert play_back_export(form, form.text(load), load)[0].share > 1e-4


def test_an_export_says_its_load_base_powers_and_agreement(tmp_path):
    result = dataclasses.replace(
        identified().result,
        records=[
            {
                "name": "a",
                "role": "train",
                "source": {"file": "a.cfg", "station": "North", "load": "T2"},
                "base": {"voltage_kV": 27.5, "power_MVA": 40.0},
            }
        ],
        own_base={"power": 40.0, "file_power": 40.0, "in_mva": True, "origin": "given"},
    )
    done = tractexp.export(Identification(result), "powerfactory", base="own")
    said = "\n".join(done.notes)
    for part in (
        "station North; load T2",
        "per unit of 40 MVA and 27.5 kV",
        "at 26.95 kV: load 40 MW and 24 Mvar",
        "motor 22 MW",
        "played back by our own simulator",
        "not tried in PowerFactory",
    ):
        assert part in said, part
    assert done.agreement < 1e-6
    assert (dgs(done.text)["TypAsmo"][0]["pgn"], dgs(done.text)["ElmTerm"][0]["uknom"]) == (
        40_000.0,
        27.5,
    )
    assert Exported.load(done.save(tmp_path / "export.json")).agreement == done.agreement
    assert "played back" not in "".join(
        tractexp.export(Identification(result), "modelica", playback=False).notes
    )


def test_a_file_of_a_load_without_a_steady_state_is_no_refusal_but_said(monkeypatch):
    form, load = build("format", {"name": "powerfactory"}), identified()
    text = form.text(load).replace(";AS;55", ";AS;955")
    agreement, notes = play_back_export(form, text, load)
    assert agreement is None
    assert notes[0].startswith("not played back: no steady state")


def test_where_the_simulator_fails_ours_plays_the_file_back_and_it_is_said(monkeypatch):
    form, load = build("format", {"name": "andes"}), identified()

    def fails(*_):
        raise UserError("not played back in ANDES: it said nothing")

    monkeypatch.setattr(type(form), "play_back_dip", fails)
    agreement, notes = play_back_export(form, form.text(load), load)
    assert notes == ["not played back in ANDES: it said nothing"]
    assert agreement.by.startswith("our own simulator")


@pytest.fixture
def has_andes():
    if andes_check.interpreter() is None:
        pytest.skip(
            "ANDES is not installed; install the extra 'crosscheck' or name a Python in"
            " TRACTEXP_ANDES_PYTHON"
        )


@pytest.mark.long  # what a load draws is told by the next two
@pytest.mark.usefixtures("has_andes")
@pytest.mark.parametrize("kind", ["Motor3", "Motor5"])
def test_our_motors_draw_what_andes_draws_at_its_terminal_voltage(kind):
    found = andes_check.cross_check(kind, 1e-3)
    assert found["swing_P"] > 0.2
    assert max(found["P"], found["Q"]) < 1e-4


@pytest.mark.usefixtures("has_andes")
@pytest.mark.parametrize(
    ("motor", "static"),
    [
        pytest.param("electromechanical", "exponential", marks=pytest.mark.long),  # as the next
        ("double_cage", "zip"),
    ],
)
def test_an_exported_load_responds_in_andes_as_it_does_here(motor, static):
    found = andes_check.round_trip(motor, static, 1e-3)
    assert found["swing_P"] > 0.2
    assert max(found["P"], found["Q"]) < 1e-3


@pytest.mark.usefixtures("has_andes")
def test_an_export_to_andes_is_played_back_there():
    """At another voltage, power and bus number than ANDES's own."""
    load = identified(effects=("stator_resistance",), bus=12, power=30.0, voltage=27.5)
    form = build("format", {"name": "andes"})
    agreement, notes = play_back_export(form, form.text(load), load)
    assert notes == []
    assert agreement.by.startswith("ANDES ")
    assert agreement.moved[0] > 0.15
    assert agreement.share < 1e-3


def test_what_a_model_is_not_good_for_is_said_when_it_is_exported(tmp_path):
    sentence = "this model does not describe this load: P of dip is off by 9.0%"
    good = identified().result
    for grade, told in (("adequate", False), ("wrong_model", True)):
        graded = dataclasses.replace(
            good, adequacy={"grade": grade, "sentence": sentence, "p": None}
        )
        graded.write(tmp_path / "result.json")
        # of no format that is played back: what is said does not depend on it
        here = ("task.format=modelica", f"hydra.run.dir={grade}")
        command = ("task=export", "task.parameters=result.json", *here)
        done = run_command(*command, cwd=tmp_path)
        assert (done.returncode, sentence in done.stderr) == ((2, True) if told else (0, False))
        assert not told or not list((tmp_path / grade).glob("load.*"))
        done = run_command(*command, "task.doubtful=true", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert (f"mind: {sentence}" in done.stdout) == told
