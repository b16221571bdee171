"""Machines of records from the field are held to what machines are, and `say_ranges` tells what
that costs.
"""

import functools
from dataclasses import replace

import numpy as np
import pytest

import tractexp
from tractexp.api.compose import resolve_model
from tractexp.configuration.plugin import get
from tractexp.identification.physical import say_ranges
from tractexp.identification.verdict import (
    BOUND,
    END_OF_RANGE,
    ParameterVerdict,
    rests_on_bound,
)
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose

MACHINE = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55}
STEP, FIELD = 5e-3, {"base_voltage": 27.5, "base_power": 20.0}


@functools.cache
def dips(M, **base):
    """Two dips of a load whose motor has this inertia and whose static part draws by exponents."""
    truth = MACHINE | {"M": M, "p_v": 1.2, "q_v": 1.8}
    load = compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())
    values, events = np.array([[truth[name] for name in load.names]]), []
    for k, depth in enumerate((0.35, 0.45)):
        t = np.arange(500) * STEP
        U = np.where((t > 0.5) & (t < 0.75), 1 - depth, 1.0)
        still = np.ones(len(t))
        event = Excitation(STEP, U, still, still, 1.0, 1.0, 0.6)
        P, Q = load.simulate(Drive.from_events([event]), values, 4).outputs[:, 0]
        noise = 3e-4 * np.random.default_rng([3, k]).standard_normal((2, len(t)))
        one = {"U": FIELD["base_voltage"], "P": FIELD["base_power"]} if base else {"U": 1, "P": 1}
        columns = {"t": t, "U": one["U"] * U, "P": one["P"] * (P + noise[0])}
        columns |= {"Q": one["P"] * (Q + noise[1]), "f": np.full(len(t), 50.0)}
        events += tractexp.read(columns, **base)
    return events


def fit(events, **settings):
    return tractexp.identify(
        events[:1],
        validate=events[1:],
        optimizer="multistart_least_squares",
        progress=False,
        check_intervals=False,
        **settings,
    )


@pytest.fixture(scope="module")
def odd():
    """A load of the field whose "motor" is no machine."""
    return fit(dips(0.02, **FIELD))


def test_records_in_kV_and_MW_are_held_and_others_are_not():
    model = resolve_model("third_order_exponential")
    field, plain = dips(0.006, **FIELD), dips(0.006)
    held = model.hold_to_machines(field)
    assert held.bounds == {
        "X_prime": [0.08, 1.5],
        "C": [0.85, 0.99],
        "M": [0.0005, 0.01],
        "T_m": [0.05, 0.9],
    }
    assert model.hold_to_machines(plain) is model
    assert model.hold_to_machines([*field, *plain]) is model
    assert model.hold_to_machines(tractexp.read("tibet_50pct_comtrade")) is model


def test_what_is_given_goes_before_what_machines_are():
    model = resolve_model("third_order_exponential")
    field = dips(0.006, **FIELD)
    assert model.with_(physical=False).hold_to_machines(field).bounds == {}
    assert model.with_(physical=True).hold_to_machines(dips(0.006)).bounds["C"] == [0.85, 0.99]
    given = model.with_(bounds={"C": [0.3, 0.7]}, fixed={"M": 0.03}).hold_to_machines(field)
    assert given.bounds["C"] == [0.3, 0.7]
    assert {*given.held} == {"X_prime", "T_m"}


def test_a_model_that_was_held_is_held_and_not_given_when_it_is_fitted_again():
    """As the extended model of an investigation is."""
    field = dips(0.006, **FIELD)
    once = resolve_model("third_order_exponential").hold_to_machines(field)
    assert once.hold_to_machines(field).held == once.held
    given = once.with_(effects=["stator_resistance"], bounds={"C": [0.3, 0.7]})
    assert {*given.hold_to_machines(field).held} == {*once.held} - {"C"}
    assert given.hold_to_machines(field).bounds["C"] == [0.3, 0.7]


def test_a_machine_within_the_ranges_costs_nothing_and_nothing_is_said():
    found = fit(dips(0.006, **FIELD))
    assert found.parameters["M"].value == pytest.approx(0.006, rel=0.03)
    assert found.result.free_optimum == {}
    assert not any("what machines are" in note for note in found.result.uncertainty["notes"])


def test_the_free_optimum_is_a_diagnosis(odd):
    """It is the truth here, an inertia that no machine has; the answer stays a machine."""
    told = odd.result.free_optimum
    assert odd.parameters["M"].value == pytest.approx(0.01, rel=1e-3)
    assert told["parameters"]["M"] == pytest.approx(0.02, rel=0.03)
    assert told["error"] < 0.01 < told["held_error"]
    assert told["predicted"] < told["held_predicted"]
    assert told["held_error"] == pytest.approx(odd.result.model_error["value"], rel=1e-6)


def test_one_line_tells_the_price(odd):
    lines = [line for line in str(odd.summary()).splitlines() if "what machines are" in line]
    assert len(lines) == 1
    assert "model.physical=false" in lines[0]
    assert not any("widen" in text for text in (*odd.advice, odd.parameters["M"].verdict))


def test_the_end_of_a_range_is_a_word_of_its_own(odd):
    judged = dict.fromkeys(("M", "T_prime"), ParameterVerdict(BOUND, "widen it"))
    uncertainty = replace(odd.details.uncertainty, verdicts=judged)
    told = say_ranges(uncertainty, {"M": (0.0005, 0.01)}).verdicts
    assert [told[name].word for name in ("M", "T_prime")] == [END_OF_RANGE, BOUND]
    assert [rests_on_bound(str(told[name])) for name in ("M", "T_prime")] == [False, True]


def test_free_it_is_found():
    free = fit(dips(0.02, **FIELD), physical=False)
    assert free.parameters["M"].value == pytest.approx(0.02, rel=0.03)
    assert free.result.free_optimum == {}
