"""A motor on its own rating, beside typical machines, and exports on it."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from test_export import OMEGA, VALUES, identified

import tractexp
from tractexp.api.identification import Identification
from tractexp.configuration.plugin import get
from tractexp.errors import UserError
from tractexp.exchange.circuit import TCircuit
from tractexp.exchange.operating_point import OperatingPoint
from tractexp.exchange.rating import (
    NOMINAL_SPEED,
    TYPES,
    compute_rating,
    compute_typical_figures,
    rate_machine,
)

MEGAWATTS = {"power": 40.0, "file_power": 100.0, "in_mva": True, "origin": "given"}


def figures(result):
    return {quantity.name: quantity.value for quantity in rate_machine(result).quantities}


def test_the_rating_is_what_the_motor_draws_and_its_figures_are_on_it():
    result = identified().result
    point, own = OperatingPoint.from_result(result), figures(result)
    S = compute_rating(result)
    assert pytest.approx(np.hypot(point.P_motor, point.Q_motor), rel=1e-9) == S
    assert own["X_prime"] == pytest.approx(VALUES["X_prime"] * S, rel=1e-9)
    assert own["X"] == pytest.approx(VALUES["X_prime"] * S / (1 - VALUES["C"]), rel=1e-9)
    assert own["H"] == pytest.approx(VALUES["M"] * OMEGA / 2 / S, rel=1e-9)
    assert own["T0_prime"] == pytest.approx(VALUES["T_prime"] / (1 - VALUES["C"]), rel=1e-9)
    assert own["slip"] == pytest.approx(100 * point.slip, rel=1e-9)
    assert own["starting"] == pytest.approx(point.starting, rel=1e-6)


def test_typical_figures_are_those_of_the_published_types():
    """By hand: X' = X_s + X_m X_1/(X_m + X_1), T0' = (X_m + X_1)/(omega R_1)."""
    typical = compute_typical_figures()
    assert typical["H"] == (0.34, 1.5)
    assert typical["X"] == pytest.approx((2.23 + 0.091, 3.8 + 0.067))
    largest = 0.100 + 3.2 * 0.18 / 3.38
    smallest = 0.091 + 2.23 * 0.071 / 2.301
    assert typical["X_prime"] == pytest.approx((smallest, largest))
    speed = 2 * np.pi * 60
    assert typical["T0_prime"] == pytest.approx((2.318 / (speed * 0.079), 3.97 / (speed * 0.009)))
    low, high = typical["starting"]
    assert 3 < low < high < 6


def test_a_figure_beyond_the_typical_is_said_to_be_so():
    result = identified().result
    heavy = dataclasses.replace(result, parameters={**result.parameters, "M": 0.1})
    (H,) = (q for q in rate_machine(heavy).quantities if q.name == "H")
    assert (H.place, H.value > H.high) == ("above", True)


def test_a_load_without_a_motor_has_no_rating():
    for ask in (compute_rating, rate_machine):
        with pytest.raises(UserError, match="has no motor that draws power"):
            ask(identified(motor="none").result)


def test_an_export_is_on_the_motors_own_rating():
    """The base of CIM5BL is what load 'M' draws, and the file follows the fit as on any base."""
    fit = Identification(dataclasses.replace(identified().result, own_base=MEGAWATTS))
    made = tractexp.export(fit, "psse_dyr")
    own = tractexp.export(fit, "psse_dyr", base="own")
    numbers = [float(x) for x in re.findall(r"[-\d.e+]+", made.text.partition("/")[0])]
    P, Q = re.search(r"'M' of [^:]*: (\S+) MW, (\S+) Mvar", str(made.notes)).groups()
    point = fit.operating_point
    S = np.hypot(float(P), float(Q))
    assert any(number == pytest.approx(S, rel=1e-4) for number in numbers)
    assert any(number == pytest.approx(point.H, rel=1e-4) for number in numbers)
    assert "the motor's own rating" in str(made.notes)
    assert max(made.agreement, own.agreement) < 1e-5
    assert tractexp.export(identified_without_motor(), "andes", playback=False).text


def identified_without_motor():
    return Identification(identified(motor="none").result)


def test_the_sheet_says_load_numbers_and_why_parts_are_refused():
    fit = Identification(
        dataclasses.replace(
            identified(motor="none").result,
            adequacy={"grade": "wrong_model", "sentence": "the model leaves much", "p": 0.0},
        ),
        behind=NoFits,
    )
    page = str(fit.sheet())
    for part in (
        "UNUSABLE. The model leaves much.",
        "It must not be used",
        "The model has no motor that draws power",
        "The record does not say what one per unit is",
        "No event was held out",
        "refused: the model is unusable",
    ):
        assert part in page, part


class NoFits:
    """Stands for what was played back of no event."""

    fits = ()


@pytest.mark.parametrize("motor", ["electromechanical", "double_cage", "none"])
def test_the_json_of_a_load_keeps_its_schema_and_gives_the_load_back(motor):
    jsonschema = pytest.importorskip("jsonschema", reason="the extra [test] is not installed")
    path = Path(__file__).parents[2] / "docs" / "load.schema.json"
    schema = json.loads(path.read_text(encoding="utf-8"))
    fit = Identification(dataclasses.replace(identified(motor=motor).result, own_base=MEGAWATTS))
    made = tractexp.export(fit, "load_json")
    content = json.loads(made.text)
    jsonschema.validate(content, schema)
    assert made.agreement < 1e-9
    assert content["before"]["load"]["P_MW"] == pytest.approx(40.0 * fit.result.before["P0"])
    assert (content["circuit"] is None) == (motor == "none")
    content["parameters"] = {"T_prime": 0.1}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(content, schema)


def test_what_a_motor_usually_is_follows_from_the_types_that_a_sheet_shows():
    """X'/X and T' need no load factor: their geometric means, and 1.5 times their scatter."""
    motor = get("model/motor", "electromechanical")()
    usual = motor.usual(T_prime=0.1, X_prime=0.3, C=0.9, M=0.005, T_m=0.5)
    circuits = [TCircuit(NOMINAL_SPEED, *elements) for *elements, _ in TYPES]
    ratios = np.log([[c.X_prime / c.X, c.X_prime / c.X * c.T0_prime] for c in circuits])
    for k in range(2):
        _, mean, factor = usual[k]
        assert np.exp(ratios[:, k].mean()) == pytest.approx(mean, rel=0.02)
        assert np.exp(1.5 * ratios[:, k].std(ddof=1)) == pytest.approx(factor, rel=0.02)
    assert 1 - np.exp(ratios[:, 0].max()) == pytest.approx(0.90, abs=0.005)
