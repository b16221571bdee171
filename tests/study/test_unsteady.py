"""Records that begin before a load is steady, end before the voltage is back, or have no rest."""

import functools

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import get
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose

TRUTH = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55, "p_v": 1.2, "q_v": 3}
STEP, BEGIN = 5e-3, 1.5  # s: between samples, and when the dip begins


def record(end, drift=0.0, earlier=None):
    """A dip of 35 % for 0.25 s, or to the record's end where that comes sooner [s]; P drifts by
    this share within the second before it and stays there. Another, of 50 % for 0.3 s, ends
    `earlier` [s] before it.
    """
    t = np.arange(round(end / STEP)) * STEP
    U = np.where((t > BEGIN - STEP / 2) & (t < BEGIN + 0.25), 0.65, 1.0)
    if earlier is not None:
        stop = BEGIN - earlier - STEP / 2
        U[(t > stop - 0.3) & (t < stop)] = 0.5
    still = np.ones(len(t))
    event = Excitation(STEP, U, still, still, 1.0, 1.0, 0.6)
    load = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
    values = np.array([[TRUTH[name] for name in load.names]])
    P, Q = load.simulate(Drive.from_events([event]), values, 4).outputs[:, 0]
    P = P * (1 + drift * np.clip(t - BEGIN + 1, 0, 1))
    noise = 2e-4 * np.random.default_rng(3).standard_normal((2, len(t)))
    return {"t": t, "U": U, "P": P + noise[0], "Q": Q + noise[1], "f": np.full(len(t), 50.0)}


@functools.cache
def fit(end, drift=0.0):
    return tractexp.identify(
        tractexp.read(record(end, drift)),
        "third_order_exponential",
        fixed={"C": TRUTH["C"]},
        optimizer="multistart_least_squares",
        check_intervals=False,
        unbalance=0.0,  # of a positive sequence that is all there is
        progress=False,
    )


@pytest.mark.parametrize("name", ["T_prime", "M", "T_m"])
def test_a_dip_without_recovery_tells_what_its_beginning_tells(name):
    estimate = fit(1.9).parameters[name]
    low, high = estimate.interval
    assert low <= TRUTH[name] <= high
    assert estimate.value == pytest.approx(TRUTH[name], rel=0.02)
    assert estimate.verdict == "identified"


def test_what_the_recovery_would_tell_is_told_by_parameter():
    """Of 0.16 s of a dip q_v is open; the recovery tells it as well as was forecast, ± 0.5 %."""
    cut, whole = fit(1.66).parameters, fit(3.0).parameters
    assert cut["q_v"].verdict.endswith("the recovery it would be known to ± 0.5 %")
    assert "recovery" not in cut["M"].verdict
    low, high = whole["q_v"].interval
    assert whole["q_v"].verdict == "identified"
    assert (high - low) / 2 == pytest.approx(0.005 * whole["q_v"].value, rel=0.1)


def test_what_a_drift_does_is_told_by_parameter():
    """A drift of 1 % moves T_m by 0.0126: nearly by what is told, and within its interval."""
    drifting = fit(3.0, 0.01)
    [note] = drifting.result.uncertainty["notes"]
    assert note.startswith("before the dip of frame the load drifts, P by +0.8")
    assert "for another reason than the voltage; if it drifts on as far, that moves T_pr" in note
    assert "T_m by 0.012" in note
    T_m = drifting.parameters["T_m"]
    assert abs(T_m.value - TRUTH["T_m"]) == pytest.approx(0.012, abs=0.002)
    assert not fit(3.0).result.uncertainty["notes"]


def written(folder, earlier):
    columns = record(4.0, earlier=earlier)
    path = folder / "dips.csv"
    rows = np.column_stack([columns[name] for name in "tUPQ"])
    np.savetxt(path, rows, delimiter=",", header="t,U,P,Q", comments="")
    return path


def test_a_dip_while_machines_still_accelerate_is_fitted_with_the_one_before(tmp_path):
    """As after a breaker that closes onto the fault: 0.25 s after the first dip Q is twice that at
    rest.
    """
    path = written(tmp_path, 0.25)
    [event] = tractexp.read(path)
    assert (event.dips, event.record.t[-1]) == (2, pytest.approx(4.0, abs=0.01))
    np.testing.assert_allclose(event.Q0, 0.6, rtol=0.01)
    assert "dip 2: the load is not at rest before it: it is" in event.record.notes[-1]
    found = tractexp.identify(
        event,
        "third_order_exponential",
        fixed={"C": TRUTH["C"]},
        optimizer="multistart_least_squares",
        check_intervals=False,
        unbalance=0.0,  # of a positive sequence that is all there is
        progress=False,
    )
    for name in ("T_prime", "X_prime", "M", "T_m"):
        assert found.parameters[name].value == pytest.approx(TRUTH[name], rel=0.01)


def test_a_dip_before_which_the_load_has_come_to_rest_is_one_of_its_own(tmp_path):
    first, second = tractexp.read(written(tmp_path, 1.0))
    assert first.record.t[-1] < BEGIN
    np.testing.assert_allclose(second.Q0, 0.6, rtol=0.03)


def test_a_held_out_dip_without_steady_state_makes_a_wrong_model_and_no_refusal():
    """At a voltage of 0.88 a torque of 0.9 behind X' = 0.45 has none."""
    fitted, lower = record(3.0), record(3.0)
    lower["U"] = 0.88 * lower["U"]
    found = tractexp.identify(
        tractexp.read(**fitted, name="fitted"),
        "third_order_exponential",
        validate=tractexp.read(**lower, name="lower"),
        fixed={"C": 0.9, "X_prime": 0.45, "T_m": 0.9, "M": 0.006, "p_v": 1.2},
        optimizer="multistart_least_squares",
        check_intervals=False,
        unbalance=0.0,  # of a positive sequence that is all there is
        progress=False,
    )
    assert found.grade == "wrong_model"
    assert "lower cannot be simulated (no steady state exists before the event" in found.headline
    assert [event["name"] for event in found.result.events] == ["fitted"]
