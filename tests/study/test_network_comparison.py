"""Each fit says how much more it leaves than the best linear network of few poles does; what
`compare_with_network` and `describe_poles` tell of it.
"""

import json
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

import tractexp
from tractexp.identification.network_comparison import compare_with_network, describe_poles

CRITERION = "the Bayesian information criterion"
FAST = {
    "optimizer": "multistart_least_squares",
    "budget": 300,
    "check_intervals": False,
    "progress": False,
}
TRUTH = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "p_v": 1.4,
    "q_v": 3.0,
}


def simulated(depth, model="third_order_exponential", noise=0.002, values=TRUTH, **shape):
    """A dip that a model answers, with noise of P and Q [pu]."""
    (made,) = tractexp.simulate(model, values, depth=depth, rate=200, length=2, **shape).responses
    rng = np.random.default_rng(int(100 * depth))
    P, Q = (x + noise * rng.standard_normal(len(x)) for x in (made.P, made.Q))
    (dip,) = tractexp.read(t=made.t, U=made.U, P=P, Q=Q, name=f"dip {depth}")
    return dip


@pytest.fixture(scope="module")
def fit():
    return tractexp.identify(simulated(0.3), validate=simulated(0.5), **FAST)


def test_it_is_in_the_result_beside_the_model_s_own_error(fit):
    beside, own = fit.result.linear_network, fit.result.model_error
    assert beside["chosen_by"] == CRITERION
    assert beside["model_error"].keys() == own.keys()
    assert [e["name"] for e in beside["model_error"]["events"]] == [
        e["name"] for e in own["events"]
    ]
    assert beside["ratio"] == own["held_out"]["value"] / beside["model_error"]["held_out"]["value"]
    assert all(pole["decay"] > 0 for pole in beside["poles"])


def test_the_right_model_leaves_less_than_a_network_that_cannot_be_nonlinear(fit):
    assert fit.result.linear_network["ratio"] < 0.5


def test_one_sentence_on_console_page_and_result(fit, tmp_path):
    sentence = fit.result.linear_network["sentence"]
    poles = len(fit.result.linear_network["poles"])
    ratio = fit.result.linear_network["ratio"]
    assert sentence == (
        f"the physical model leaves {ratio:.2g} times what the best linear network of {poles} poles"
        " does on the dip it"
        " never saw"
    )
    assert fit.yardstick == sentence
    told = sentence.replace("the physical", "The physical")
    assert f"{told}. The network's poles: " in " ".join(str(fit.summary()).split())
    assert f"{told}. The network's poles: " in unescape(fit.report().html)
    assert (
        json.loads(fit.result.write(tmp_path / "result.json").read_text())["linear_network"][
            "sentence"
        ]
        == sentence
    )


def test_a_model_that_is_wrong_leaves_a_multiple():
    """A static load fitted to a motor's dip."""
    wrong = tractexp.identify(
        simulated(0.3), "static_exponential", validate=simulated(0.35), **FAST
    )
    assert wrong.result.linear_network["ratio"] > 3


def test_of_a_linear_load_the_network_leaves_no_more_than_noise():
    """P and Q that follow U by a line: no model is better than no pole."""
    t = np.arange(400) / 200
    U = np.where((t >= 0.5) & (t < 0.8), 0.7, 1.0)
    rng = np.random.default_rng(5)
    P, Q = (
        x + 0.002 * rng.standard_normal(400) for x in (0.8 + 1.6 * (U - 1), 0.3 + 0.9 * (U - 1))
    )
    (dip,) = tractexp.read(t=t, U=U, P=P, Q=Q, name="line")
    beside = tractexp.identify(dip, "static_exponential", **FAST).result.linear_network
    assert beside["poles"] == []
    assert beside["chosen_by"] == CRITERION
    assert beside["model_error"]["value"] < 0.01
    assert "the best linear network without poles" in beside["sentence"]
    assert beside["sentence"].partition(" on the dip it was fitted to")[1]


def test_the_error_is_that_of_every_other_model(fit):
    """The network is the one that a user fits by itself, its error told by the one definition."""
    network = tractexp.linear_network(fit.setup.train, validate=fit.setup.validate)
    beside = fit.result.linear_network
    assert [pole["decay"] for pole in network.poles] == [pole["decay"] for pole in beside["poles"]]
    assert network.content["model_error"] == beside["model_error"]


def test_a_record_that_is_too_short_is_a_sentence_beside_the_fit(fit):
    fits = [
        replace(f, event=replace(f.event, start=f.event.record.samples - 3))
        for f in fit.details.fits[:1]
    ]
    beside = compare_with_network(fits, fit.result.model_error)
    assert beside.keys() == {"sentence"}
    assert beside["sentence"].startswith(
        "no linear network stands beside it: dip 0.3: 3 samples from the dip on are"
    )


def test_a_result_of_an_earlier_version_has_none(fit, tmp_path):
    content = json.loads(fit.result.write(tmp_path / "result.json").read_text())
    del content["linear_network"]
    (tmp_path / "result.json").write_text(json.dumps(content))
    assert tractexp.load(tmp_path / "result.json").yardstick == ""


def test_of_waves_the_sentence_tells_of_the_currents_too(shared_data):
    """Without its path the zero sequence of an earthed transformer is missing in the currents, but
    not in P and Q.
    """
    path = shared_data / "dfr220kv-shandong" / "xtz.cfg"
    train, validate = tractexp.read(path, voltages=[0, 1, 2], currents=[16, 17, 18])
    fit = tractexp.identify(
        train, "third_order_impedance", validate=validate, domain="waves", **FAST | {"budget": 50}
    )
    beside, own = fit.result.linear_network, fit.result.events[1]["epsilon_i"]
    network = beside["events"][1]["epsilon_i"]
    assert beside["events"][1]["role"] == "validate"
    assert f", and of the currents {own / network:.2g} times (epsilon_i " in fit.yardstick
    assert own / network > 3 > beside["ratio"]


def test_poles_are_told_as_decay_and_frequency():
    poles = [{"decay": 17.65, "frequency": 47.53}, {"decay": 44.6, "frequency": 3.66}]
    assert describe_poles(poles) == "17.6/s at 47.5 Hz, 44.6/s at 3.66 Hz"
    assert describe_poles([]) == "none"


@pytest.mark.parametrize(
    ("voltages", "currents", "fitted", "held"),
    [([0, 1, 2], [16, 17, 18], 0.18, 0.19), ([4, 5, 6], [8, 9, 10], 0.15, 0.17)],
    ids=["earthed", "isolated"],
)
def test_two_poles_follow_a_real_transformer(shared_data, voltages, currents, fitted, held):
    """One dip fitted, one held out: the currents' error, zero sequence included where it is
    earthed.
    """
    path = shared_data / "dfr220kv-shandong" / "xtz.cfg"
    train, validate = tractexp.read(path, voltages=voltages, currents=currents)
    network = tractexp.linear_network(train, validate=validate, domain="waves", poles=2)
    known, unseen = (fit.epsilon_i for fit in network.fits)
    assert known < fitted
    assert unseen < held
    rotor, stator = sorted(network.poles, key=lambda pole: -pole["frequency"])
    assert rotor["frequency"] == pytest.approx(47, abs=1.5)
    assert stator["frequency"] == pytest.approx(4.5, abs=1.5)
