"""Which structure wins a race: what the load is, and the simplest of what predicts alike."""

import functools

import numpy as np
import pytest

import tractexp
from tractexp.api.compose import resolve_model
from tractexp.configuration.plugin import get
from tractexp.errors import UserError
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose

TRUTH = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55}
STATIC = {"p_v": 1.2, "q_v": 3.0}
RACED = (
    "static_exponential",
    "second_order_exponential",
    "third_order_exponential",
    "fifth_order_double_cage",
)


@functools.cache
def dip(motor, depth=0.35, noise=1e-3):
    """A dip of a load with this motor ("none" for without) beside an exponential static load."""
    load = compose(get("model/motor", motor)(), get("model/static", "exponential")())
    t = np.arange(400) * 5e-3
    U = np.where((t > 0.5) & (t < 0.75), 1 - depth, 1.0)
    still = np.ones(len(t))
    event = Excitation(5e-3, U, still, still, 1.0, 1.0, 0.6)
    values = np.array([[(TRUTH | STATIC)[name] for name in load.names]])
    P, Q = load.simulate(Drive.from_events([event]), values, 4).outputs[:, 0]
    left = noise * np.random.default_rng([7, round(100 * depth)]).standard_normal((2, len(t)))
    columns = {"t": t, "U": U, "P": P + left[0], "Q": Q + left[1], "f": np.full(len(t), 50.0)}
    return tractexp.read(columns)[0]


def auto(*names):
    model = resolve_model("auto")
    return tractexp.compose(model).with_(candidates={"phasors": names})


@functools.cache
def raced(motor, *depths):
    return auto(*RACED).fit_for([dip(motor, depth) for depth in depths])


@pytest.mark.parametrize("depths", [(0.35,), (0.35, 0.25)])
@pytest.mark.parametrize(
    ("motor", "name"),
    [("none", "static_exponential"), ("electromechanical", "third_order_exponential")],
)
def test_the_structure_that_the_load_has_wins(motor, name, depths):
    """Of one dip, and of two; the second cage fits as well, and has two parameters more."""
    won = raced(motor, *depths)
    assert won.race[0]["name"] == name
    assert won.motor["name"] == motor
    best = min(entry["predicted"] for entry in won.race if entry["predicted"] is not None)
    assert won.race[0]["predicted"] <= 1.05 * best


def test_what_fits_worse_than_the_best_predicts_is_not_asked_to_predict():
    for entry in raced("electromechanical", 0.35).race:
        missed = entry["fitted"] > 1.05 * raced("electromechanical", 0.35).race[0]["predicted"]
        assert (entry["predicted"] is None) == missed
        assert ("leaves more than the best predicts" in entry["why"]) == missed
    lost = [e["name"] for e in raced("electromechanical", 0.35).race if e["predicted"] is None]
    assert "static_exponential" in lost


def test_what_is_known_of_parameters_goes_with_the_winner_and_all_that_race():
    """What is fixed is none of the parameters by which ties are decided."""
    model = auto("static_exponential", "third_order_exponential")
    known = {"bounds": {"q_v": [2.5, 3.5], "M": [0.001, 0.02]}, "fixed": {"p_v": 1.2}}
    free, won = (one.fit_for([dip("electromechanical")]) for one in (model, model.with_(**known)))
    assert {"bounds": won.bounds, "fixed": won.fixed} == known
    count = {entry["name"]: entry["parameters"] for entry in free.race}
    assert {entry["name"]: entry["parameters"] + 1 for entry in won.race} == count


def test_a_structure_that_does_not_go_with_the_records_loses_and_says_why():
    """A converter is of waveforms."""
    won = auto("line_side_converter", "static_exponential").fit_for([dip("none")])
    assert [entry["name"] for entry in won.race] == ["static_exponential", "line_side_converter"]
    assert "domain=phasors" in won.race[1]["why"]
    assert won.race[1]["predicted"] is None


def test_two_structures_that_are_one_on_these_records_are_raced_once():
    again = "third_order_exponential"
    won = auto(again, "static_exponential", again).fit_for([dip("none")])
    assert [entry["name"] for entry in won.race] == ["static_exponential", again, again]
    assert won.race[2]["why"] == f"on these records it is the same as {again}"


def test_where_none_can_be_fitted_it_is_told():
    with pytest.raises(UserError, match=r"none of the structures can be fitted: .*domain=phasors"):
        auto("line_side_converter").fit_for([dip("none")])


def test_a_model_without_candidates_is_not_raced():
    model = resolve_model("third_order_exponential")
    assert model.fit_for([dip("none")]) is model


def test_the_race_is_a_table_and_in_the_result():
    fit = tractexp.identify(
        [dip("none")],
        auto("static_exponential", "static_zip"),
        optimizer="multistart_least_squares",
        check_intervals=False,
        progress=False,
    )
    names = [entry["name"] for entry in fit.result.race]
    assert names == ["static_exponential", "static_zip"]
    text = str(fit.summary())
    assert "Structures raced" in text
    assert text.index("static_exponential") < text.index("static_zip")
    assert fit.result.model["static"]["name"] == "exponential"


def test_machines_raced_in_waveforms_stand_beside_no_negative_element():
    raced = [resolve_model(name) for name in resolve_model("auto").candidates["waves"]]
    machines = [one for one in raced if one.motor["name"] != "line_side_converter"]
    assert {one.static["name"] for one in machines} == {"compensated_branch"}
    assert len(machines) > 1
