"""Exports: the T-circuit gives back what was identified, each file is read back, ANDES agrees, refusals are clear."""

import dataclasses
import itertools
import json
import re

import andes_check
import numpy as np
import pytest
from command_line import run_command
from scipy.integrate import solve_ivp
from scipy.interpolate import Akima1DInterpolator

from tractexp.errors import UserError
from tractexp.exchange.circuit import TCircuit
from tractexp.exchange.format import Identified
from tractexp.model.drive import Drive, Excitation
from tractexp.plugin import build, discover

OMEGA = 2 * np.pi * 50
VALUES = {
    "T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55, "R_s": 0.02, "T_second": 0.01,
    "X_second": 0.18, "p_v": 1.4, "q_v": 3.0, "a_Z": 0.4, "a_I": 0.3, "b_Z": 0.7, "b_I": 0.2, "p_f": 1.3, "q_f": -1.1,
}  # fmt: skip
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
    assert pytest.approx(X / (1 - C), rel=1e-9) == c.X
    assert c.X_prime == pytest.approx(X, rel=1e-9)
    assert c.X_second == pytest.approx(X2, rel=1e-9)
    assert c.T0_prime == pytest.approx(T / (1 - C), rel=1e-9)
    assert c.T0_second == pytest.approx(T2 * X / X2, rel=1e-9)
    assert min(c.X_s, c.X_m, c.X_1, c.X_2, c.R_1, c.R_2) > 0


def test_the_circuit_draws_what_the_model_draws_before_the_event():
    """The T-circuit at the exported slip, by impedances alone."""
    load = identified()
    c, slip = load.circuit, -load.before["omega_before"] / OMEGA
    rotor = c.R_1 / slip + 1j * c.X_1
    S = 0.98**2 / np.conj(1j * c.X_s + 1j * c.X_m * rotor / (1j * c.X_m + rotor))
    assert S.real == pytest.approx(VALUES["T_m"], rel=1e-9)
    assert S.imag == pytest.approx(load.before["Q_motor"], rel=1e-9)


@pytest.mark.parametrize("motor", ["electromechanical", "double_cage", "none"])
@pytest.mark.parametrize("static", ["exponential", "zip", "constant_impedance"])
def test_the_andes_tables_hold_the_load(motor, static):
    tables = json.loads(write("andes", identified(motor, static, bus=7, power=50.0)))
    assert tables["Bus"][0]["idx"] == 7
    assert {"electromechanical": "Motor3" in tables, "double_cage": "Motor5" in tables}.get(motor, True)
    law = tables["FLoad" if static == "exponential" else "ZIP"][0]
    if static != "exponential":
        assert law["kpz"] + law["kpi"] + law["kpp"] == pytest.approx(100)
        assert law["kqz"] + law["kqi"] + law["kqp"] == pytest.approx(100)
    drawn = VALUES["T_m"] if motor != "none" else 0.0
    assert tables["PQ"][0]["p0"] == pytest.approx((1.0 - drawn) / 2, rel=1e-9)  # 50 MVA on ANDES's 100
    if motor == "electromechanical":
        assert tables["Motor3"][0]["Hm"] == pytest.approx(0.006 * OMEGA / 2)


def dyr(text):
    """{model: (bus, load, constants)} of a .dyr file, read by its own rules: free format, records end with a slash."""
    records = {}
    for record in text.split("/")[:-1]:
        bus, model, load, *constants = [field.strip() for field in record.replace("\n", " ").split(",")]
        records[model.strip("'")] = int(bus), load.strip("'"), [float(c) for c in constants]
    return records


@pytest.mark.parametrize("motor", ["electromechanical", "double_cage"])
def test_the_dyr_motor_gives_back_what_was_identified(motor):
    bus, load, c = dyr(write("psse_dyr", identified(motor, bus=12)))["CIM5BL"]
    assert (bus, load, len(c), c[0]) == (12, "M", 20, 1)
    circuit = TCircuit(OMEGA, *c[1:6], *([None, None] if motor == "electromechanical" else c[6:8]))
    assert circuit.X_prime == pytest.approx(VALUES["X_prime"], rel=1e-6)
    assert circuit.T0_prime == pytest.approx(VALUES["T_prime"] / (1 - VALUES["C"]), rel=1e-6)
    if motor == "double_cage":
        assert circuit.X_second == pytest.approx(VALUES["X_second"], rel=1e-6)
    assert c[8:12] == [0, 0, 0, 0]
    assert c[12:15] == pytest.approx([100.0, 1.0, 0.006 * OMEGA / 2])


@pytest.mark.parametrize("static", ["exponential", "zip", "constant_impedance", "constant_power"])
def test_the_dyr_static_load_is_its_law(static):
    """IEELBL normalized by the power before, P = P_0 sum(a V^n)/sum(a V_0^n), against our own simulation."""
    text = write("psse_dyr", identified("none", static))
    _, _, c = dyr(text)["IEELBL"]
    U = np.array([0.98, 0.8, 0.5, 1.05])
    event = Excitation(1e-3, U, U, U, 0.98, 1.0, 0.6)
    of = identified("none", static)
    response = of.model.simulate(Drive.of([event]), [[of.values[name] for name in of.model.names]])
    for power, start, exponents, before in ((response.P, 0, 8, 1.0), (response.Q, 3, 11, 0.6)):
        law = lambda V, start=start, exponents=exponents: sum(c[start + k] * V ** c[exponents + k] for k in range(3))  # noqa: E731
        assert power[0] == pytest.approx(before * law(U) / law(0.98), rel=1e-6)
    assert c[6:8] == [0, 0]


def modelica(text):
    """Parameters, start values and equations of our flat Modelica, read as text; expressions as Python functions."""
    numbers = dict(re.findall(r"parameter Real (\w+) = ([-\d.e+]+)", text))
    starts = dict(re.findall(r"^  Real (\w+)\(start = ([-\d.e+]+), fixed = true\);", text, re.M))
    equations = re.findall(r"^  (\S+) = (.*);$", text.split("\nequation\n")[1], re.M)
    return ({k: float(v) for k, v in numbers.items()}, {k: float(v) for k, v in starts.items()},
            {left: compile(right.replace("^", "**"), left, "eval") for left, right in equations})  # fmt: skip


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
    ],
)
def test_the_modelica_text_simulates_as_our_kernel_does(motor, static, effects):
    """The file's own equations, integrated by SciPy, against the kernel: the round trip of the whole model."""
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
        return eval(equations[left], {}, names | numbers | inputs | dict(zip(starts, x, strict=True)))

    slopes = [f"der({name})" for name in starts]
    x, rows = np.array(list(starts.values())), []
    for a, b in itertools.pairwise([*t, t[-1]]):
        rows.append([evaluate("P", a, x), evaluate("Q", a, x)])
        if starts and b > a:
            f = lambda at, x: [evaluate(s, at, x) for s in slopes]  # noqa: E731
            x = solve_ivp(f, (a, b), x, method="DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
    P, Q = np.array(rows).T
    event = Excitation(2e-3, U, P, Q, 0.98, 1.0, 0.6, speed, 0.0, OMEGA)
    response = load.model.simulate(Drive.of([event]), [[load.values[name] for name in load.model.names]], 16)
    assert pytest.approx(P, abs=1e-6) == response.P[0]
    assert pytest.approx(Q, abs=1e-6) == response.Q[0]


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
        ("psse_dyr", ("none", "exponential_frequency"), "cannot represent the static load 'exponential_frequency'"),
        (
            "andes",
            ("electromechanical", "zip", ("undervoltage_trip",)),
            "cannot represent the effect 'undervoltage_trip'",
        ),
        (
            "modelica",
            ("electromechanical", "zip", ("undervoltage_trip",)),
            "cannot represent 'time_below', which acts on",
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
    for name, suffix in (("andes", "json"), ("psse_dyr", "dyr"), ("modelica", "mo")):
        done = run_command("task=export", "task.parameters=result.json", f"task.format={name}", f"hydra.run.dir={name}",
                        cwd=tmp_path)  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert {p.name for p in (tmp_path / name).iterdir()} == {".hydra", f"load.{suffix}"}
    identified("mechanical").result.write(tmp_path / "result.json")
    refused = {
        "task.format=andes": "cannot represent the motor 'mechanical'",
        "task.format=ands": "there is no format 'ands'; did you mean 'andes'?",
        "task.parameters=null": "task.parameters is not given; it is the path of a result.json",
        "task.power=0": "task.power=0",
    }
    for argument, sentence in refused.items():
        done = run_command("task=export", "task.parameters=result.json", argument, "hydra.run.dir=none", cwd=tmp_path)
        assert done.returncode == 2
        assert sentence in done.stderr
        assert done.stderr.count("\n") == 1
        assert not (tmp_path / "none").exists()


@pytest.fixture
def has_andes():
    if andes_check.interpreter() is None:
        pytest.skip("ANDES is not installed; install the extra 'crosscheck' or name a Python in TRACTEXP_ANDES_PYTHON")


@pytest.mark.usefixtures("has_andes")
@pytest.mark.parametrize("kind", ["Motor3", "Motor5"])
def test_our_motors_draw_what_andes_draws_at_its_terminal_voltage(kind):
    found = andes_check.cross_check(kind, 1e-3)
    assert found["swing_P"] > 0.2
    assert max(found["P"], found["Q"]) < 1e-4


@pytest.mark.usefixtures("has_andes")
@pytest.mark.parametrize(("motor", "static"), [("electromechanical", "exponential"), ("double_cage", "zip")])
def test_an_exported_load_responds_in_andes_as_it_does_here(motor, static):
    found = andes_check.round_trip(motor, static, 1e-3)
    assert found["swing_P"] > 0.2
    assert max(found["P"], found["Q"]) < 1e-3


def test_what_a_model_is_not_good_for_is_said_when_it_is_exported(tmp_path):
    sentence = "this model does not describe this load: P of dip is off by 9.0%"
    good = identified().result
    for grade, told in (("adequate", False), ("wrong_model", True)):
        graded = dataclasses.replace(good, adequacy={"grade": grade, "sentence": sentence, "p": None})
        graded.write(tmp_path / "result.json")
        done = run_command("task=export", "task.parameters=result.json", f"hydra.run.dir={grade}", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert (f"mind: {sentence}" in done.stdout) == told
