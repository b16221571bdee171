"""`task=simulate` as a person uses it, and every pair of motor and static load as a predictor."""

import itertools
import json

import numpy as np
import pytest
from command_line import run_command

import tractexp
from tractexp.api.simulate import order_values
from tractexp.configuration.plugin import get
from tractexp.errors import UserError

TRUTH = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "p_v": 1.4,
    "q_v": 3.0,
}
MOTORS = ("mechanical", "voltage", "electromechanical", "stator_flux", "double_cage", "none")
STATICS = (
    "exponential",
    "zip",
    "constant_impedance",
    "constant_power",
    "exponential_frequency",
    "none",
)
PAIRS = [pair for pair in itertools.product(MOTORS, STATICS) if pair != ("none", "none")]


def simulate_command(*arguments, cwd):
    return run_command("task=simulate", *arguments, "tracking.enabled=false", cwd=cwd)


def write_result(path, motor="electromechanical", static="exponential", parameters=None):
    """A result.json of known values."""
    content = {
        "parameters": TRUTH if parameters is None else parameters,
        "objective": 0.0,
        "epsilon_p": 0.0,
        "epsilon_q": 0.0,
        "simulations": 1,
        "refused": 0,
        "iterations": 1,
        "seconds": 0.0,
        "status": "known",
        "seed": 0,
        "events": [],
        "at_bound": [],
        "units": {},
        "bounds": {},
        "model": {"motor": {"name": motor}, "static": {"name": static}, "effects": []},
        "before": {"U0": 1.0, "P0": 1.0, "Q0": 0.6, "frequency": 50.0},
    }
    path.write_text(json.dumps(content))
    return path


@pytest.fixture
def saved(tmp_path):
    return write_result(tmp_path / "result.json")


def read(path):
    return np.genfromtxt(path, delimiter=",", names=True)


def test_a_given_dip_is_played_as_described(saved, tmp_path):
    done = simulate_command(
        f"task.parameters={saved}",
        "task.depth=0.4",
        "task.duration=0.2",
        "task.rate=500",
        "task.length=2",
        "hydra.run.dir=run",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    rows = read(tmp_path / "run" / "response.csv")
    assert list(rows.dtype.names) == ["t", "U", "P", "Q"]
    assert len(rows) == 1001
    assert rows["U"].min() == pytest.approx(0.6)
    low = rows["t"][rows["U"] < 0.6 + 1e-9]
    assert low.min() == pytest.approx(0.52)  # start 0.5 and 20 ms of fall
    assert low.max() == pytest.approx(0.70)
    assert rows["P"][:200] == pytest.approx(np.ones(200), abs=1e-8)
    assert rows["P"][-1] == pytest.approx(1.0, abs=1e-2)
    assert (tmp_path / "run" / "response.svg").stat().st_size > 5000
    assert "dip of 40% for 0.2 s" in done.stdout


def test_the_dip_is_the_prediction_of_the_same_result(saved, tmp_path):
    """With a sudden fall: a prediction takes U_0 from the samples before the dip, none of which has
    begun to fall.
    """
    done = simulate_command(
        f"task.parameters={saved}",
        "task.depth=0.4",
        "task.fall=0",
        "hydra.run.dir=run",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    rows = read(tmp_path / "run" / "response.csv")
    made = tractexp.load(saved).predict(t=rows["t"], U=rows["U"])
    assert rows["P"] == pytest.approx(made.P, abs=1e-6)
    assert rows["Q"] == pytest.approx(made.Q, abs=1e-6)


def test_recorded_events_are_played_and_judged(saved, tmp_path):
    done = simulate_command(
        "task=simulate",
        f"task.parameters={saved}",
        "data=tibet_30pct",
        "hydra.run.dir=run",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    rows = read(tmp_path / "run" / "response.csv")
    assert list(rows.dtype.names) == ["t", "U", "P", "Q", "P_measured", "Q_measured"]
    epsilon = np.linalg.norm(rows["P"] - rows["P_measured"]) / np.linalg.norm(rows["P_measured"])
    assert f"{epsilon:.3%}" in done.stdout


def test_values_without_a_result_and_a_value_in_place_of_the_results(saved, tmp_path):
    given = "{" + ", ".join(f"{name}: {value}" for name, value in TRUTH.items()) + "}"
    runs = {
        "alone": [f"task.values={given}"],
        "changed": [f"task.parameters={saved}", "task.values.T_m=0.3"],
    }
    runs["same"] = [f"task.parameters={saved}"]
    for name, arguments in runs.items():
        done = simulate_command(
            *arguments,
            "task.depth=0.4",
            "task.P0=1",
            "task.Q0=0.6",
            f"hydra.run.dir={name}",
            cwd=tmp_path,
        )
        assert done.returncode == 0, done.stderr
    alone, changed, same = (
        read(tmp_path / name / "response.csv")["P"] for name in ("alone", "changed", "same")
    )
    assert np.array_equal(alone, same)
    assert np.abs(changed - same).max() > 0.01


PAPER = {  # Table 3
    "ISSA": ([4.1354, 1.6654, -2.6241, 0.82, 3.378, 3.5867, 3.056], "4.29"),
    "SSA": ([-3.8726, 1.8054, 1.8197, 0.3427, 3.0239, 1.9803, 2.128], "6"),
    "PSO": ([2.1863, 0.75606, 0.627, 1.7738, 1.2298, 2.5629, 1.286], "2.97"),
}


@pytest.mark.parametrize("column", PAPER)
def test_the_papers_table_3_gets_the_sentence_that_explains_it(column, tmp_path):
    values, ratio = PAPER[column]
    given = (
        "{" + ", ".join(f"{name}: {value}" for name, value in zip(TRUTH, values, strict=True)) + "}"
    )
    done = simulate_command(
        "task=simulate", f"task.values={given}", "task.depth=0.5", "hydra.run.dir=run", cwd=tmp_path
    )
    assert done.returncode == 2
    assert f"Eq. (3) needs |2 T_m X'/(C U0²)| at most 1 and it is {ratio}" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            [],
            "no value for T_prime, X_prime, C, M, T_m, p_v, q_v: give task.parameters=result.json",
        ),
        (["task.parameters=nowhere.json"], "there is no result file nowhere.json"),
        (
            ["task.values.T_prim=0.1"],
            "this model has no parameter 'T_prim'; did you mean 'T_prime'?",
        ),
        (["task.depth=1.5"], "task.depth=1.5 is out of range: it must be at least 0 and at most 1"),
        (
            ["task.depth=0.5", "task.length=0.1"],
            "task.length=0.1 is out of range: it must be at least 0.65",
        ),
        (["task.depht=0.5"], "'task' has no key 'depht'; did you mean 'depth'?"),
    ],
)
def test_bad_input_gets_one_sentence_and_leaves_nothing_behind(arguments, sentence, tmp_path):
    done = simulate_command(*arguments, "hydra.run.dir=run", cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_values_given_by_hand_replace_those_found():
    assert order_values(("a", "b"), {"a": 1.0, "b": 2.0}, {"b": 3.0}).tolist() == [1.0, 3.0]
    with pytest.raises(UserError, match="no value for b"):
        order_values(("a", "b"), {"a": 1.0}, {})


@pytest.mark.parametrize(("motor", "static"), PAIRS)
def test_every_pair_predicts_its_power_before_a_dip_and_less_in_it(motor, static, tmp_path):
    """From a written result.json, as mlflow.pyfunc.load_model reads it (test_cli.py loads one for
    real).
    """
    parts = get("model/motor", motor)(), get("model/static", static)()
    defaults = {p.name: p.default for part in parts for p in part.parameters}
    path = write_result(tmp_path / "result.json", motor, static, defaults)
    t = np.arange(400) * 2e-3
    U = 1 - 0.3 * ((t > 0.3) & (t < 0.5))
    made = tractexp.load(path).predict(t=t, U=U, f=50 + 0.0 * t)
    P, Q = made.P, made.Q
    before = 1.0, 0.6
    if static == "none":
        before = defaults["T_m"], Q[0]
        # stator resistance: input above torque
        P_loss = defaults.get("R_s", 0.0) * (P[0] ** 2 + Q[0] ** 2)
        assert P[0] == pytest.approx(defaults["T_m"] + P_loss, rel=1e-6)
    else:
        assert (P[0], Q[0]) == pytest.approx(before, abs=1e-8)
    assert np.isfinite(P).all()
    assert np.isfinite(Q).all()
    if (motor, static) != ("none", "constant_power"):
        assert P[160:240].min() < 0.97 * P[0]
