"""What a fitted load is before its dip: the circuit's own figures, and the machine that none can
be.
"""

import dataclasses
from contextlib import nullcontext

import numpy as np
import pytest
from test_export import OMEGA, VALUES, identified

import tractexp
from tractexp.api.identification import Identification
from tractexp.errors import UserError
from tractexp.exchange.circuit import TCircuit
from tractexp.exchange.operating_point import OperatingPoint

PLAIN = "modelica"  # a format that no other program plays back: what is asked does not depend on it


def fitted(base=None, **parameters):
    """A result with some of its parameters, and perhaps its base, changed."""
    result = identified().result
    changes = {"own_base": base} if base else {}
    # the band was that of the parameters identified
    changes |= {"parameters": result.parameters | parameters, "next_dip": {}}
    return dataclasses.replace(result, **changes)


@pytest.mark.parametrize("slip", [0.01, 0.3, 1.0])
def test_the_impedance_of_the_circuit_is_that_of_its_operational_reactance(slip):
    """X(s) = X (1 + j s omega T') / (1 + j s omega T0'), which one cage follows exactly."""
    c = TCircuit.single(0.12, 0.25, 0.9, OMEGA, 0.02)
    turn = 1j * slip * OMEGA
    expected = 0.02 + 1j * c.X * (1 + turn * 0.12) / (1 + turn * c.T0_prime)
    assert c.impedance(slip) == pytest.approx(expected, rel=1e-12)


def test_the_motor_draws_what_its_circuit_draws_at_its_slip():
    result = fitted()
    point, circuit = OperatingPoint.from_result(result), identified().circuit
    drawn = result.before["U0"] ** 2 / np.conj(circuit.impedance(point.slip) - circuit.R_s)
    assert (point.P_motor, point.Q_motor) == pytest.approx((drawn.real, drawn.imag), rel=1e-6)
    S = abs(drawn)
    assert pytest.approx(VALUES["M"] * OMEGA / 2 / S, rel=1e-6) == point.H
    assert point.starting == pytest.approx(
        result.before["U0"] ** 2 / abs(circuit.impedance(1.0)) / S, rel=1e-6
    )


def test_it_is_said_in_megawatts_where_the_base_is_in_them():
    point = OperatingPoint.from_result(
        fitted({"power": 29.7, "file_power": 100.0, "in_mva": True, "origin": "file"})
    )
    assert point.units == ("MW", "Mvar")
    assert pytest.approx(29.7) == point.P
    assert pytest.approx(29.7 * OperatingPoint.from_result(fitted()).P_motor) == point.P_motor
    assert f"motor {point.P_motor:.4g} MW and {point.Q_motor:.4g} Mvar" in str(point)
    alone = OperatingPoint.from_result(fitted())
    assert f"motor P {alone.P_motor:.4g} pu and Q {alone.Q_motor:.4g} pu" in str(alone)


@pytest.mark.parametrize(
    ("parameters", "doubt"),
    [
        ({"T_m": 0.55}, ""),
        ({"T_m": 1.15}, ""),  # 1.2 of the load's power is let pass
        (
            {"T_m": 1.9, "X_prime": 0.1},
            "draws 1.9 pu of a load of 1 pu and 0.6 pu, and the static part generates",
        ),
        (
            {"X_prime": 0.05, "C": 0.3},
            "pu of a load of 1 pu and 0.6 pu, and the static part supplies",
        ),
    ],
)
def test_a_motor_that_no_load_has_is_doubted_and_its_export_asked_for(parameters, doubt):
    result = fitted(**parameters)
    result = dataclasses.replace(
        result, adequacy={"grade": "effect_missing", "sentence": "it fits"}
    )
    fit = Identification(result)
    assert doubt in OperatingPoint.from_result(result).doubt
    assert bool(doubt) == (fit.headline != "it fits")
    refused = pytest.raises(
        UserError, match=r"is no physical load: the motor draws .*doubtful=true exports it all"
    )
    with refused if doubt else nullcontext():
        tractexp.export(fit, PLAIN)
    assert tractexp.export(fit, PLAIN, doubtful=True).text


def test_a_model_that_does_not_describe_the_load_is_exported_when_asked_for_only(tmp_path):
    sentence = "this model does not describe this load: it leaves 45 % of its response (11 % of S)"
    wrong = dataclasses.replace(
        fitted(), adequacy={"grade": "wrong_model", "sentence": sentence, "p": 0.0}
    )
    wrong.write(tmp_path / "result.json")
    fit = tractexp.load(tmp_path)
    assert (fit.grade, fit.headline) == ("wrong_model", sentence)
    with pytest.raises(UserError) as refused:
        tractexp.export(fit, PLAIN)
    assert str(refused.value).startswith(sentence)
    for mend in ("task=discrepancy", "doubtful=true exports it all the same"):
        assert mend in str(refused.value)
    assert tractexp.export(fit, PLAIN, doubtful=True).notes[0].startswith(sentence)


def test_a_parameter_that_a_bound_holds_is_exported_when_asked_for_only():
    result = dataclasses.replace(
        fitted(), verdicts={"C": "at its bound (0.99; widen model.bounds.C)"}
    )
    with pytest.raises(UserError, match="C is held by a bound alone"):
        tractexp.export(Identification(result), PLAIN)


def test_a_load_without_a_motor_has_no_such_point():
    assert OperatingPoint.from_result(identified(motor="none").result) is None


def test_a_load_without_active_power_has_no_share_of_it():
    point = OperatingPoint(0.0, 0.6, 0.1, 0.57, 0.6, None, None, ("pu", "pu"))
    assert "of P" not in str(point)
    assert "nan" not in str(point)
    assert point.doubt == ""
