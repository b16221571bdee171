"""The static loads against their formulas, and each other."""

import functools

import numpy as np
import pytest
from sympy import Piecewise

import tractexp
from tractexp.configuration.plugin import get
from tractexp.errors import UserError
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose
from tractexp.model.parts import Static
from tractexp.parameter import Parameter
from tractexp.record import Record, detect


@functools.cache
def alone(static):
    """A static load without a motor."""
    return compose(get("model/motor", "none")(), get("model/static", static)())


def identify_alone(static, record):
    """The public call, which refuses what it cannot identify."""
    return tractexp.identify(record, tractexp.compose(motor="none", static=static), progress=False)


def event(U, U0=0.98, P0=0.8, Q0=0.5, omega_s=None, omega_s0=0.0):
    U = np.asarray(U, dtype=float)
    return Excitation(1e-3, U, np.zeros(len(U)), np.zeros(len(U)), U0, P0, Q0, omega_s, omega_s0)


VOLTAGES = np.array([0.98, 0.9, 0.5, 0.2, 1.1])
SHARES = VOLTAGES / 0.98


@pytest.mark.parametrize(
    ("static", "values", "P", "Q"),
    [
        ("exponential", [1.3, 2.6], SHARES**1.3, SHARES**2.6),
        (
            "zip",
            [0.4, 0.35, 0.7, 0.1],
            0.4 * SHARES**2 + 0.35 * SHARES + 0.25,
            0.7 * SHARES**2 + 0.1 * SHARES + 0.2,
        ),
        ("constant_impedance", [], SHARES**2, SHARES**2),
        ("compensated_branch", [0.3, 0.5], SHARES**2, SHARES**2),
        ("constant_power", [], np.ones(5), np.ones(5)),
    ],
)
def test_a_static_load_alone_is_its_formula(static, values, P, Q):
    response = alone(static).simulate(Drive.from_events([event(VOLTAGES)]), np.array([values]))
    assert response.P[0] == pytest.approx(0.8 * P, rel=1e-11)
    assert response.Q[0] == pytest.approx(0.5 * Q, rel=1e-11)


class Dimmed(Static):
    """Out below a voltage: pieces whose conditions hold the voltage, a parameter, or neither.

    Source: made here.
    """

    name = "dimmed"
    parameters = (
        Parameter(0.7, (0.4, 0.95), "1", "voltage below which it is out", "made here", name="cut"),
    )

    def law(self, u, cut):
        P = Piecewise((0, u < 0.3), ((u - 0.3) / (cut - 0.3), u < cut), (1, True))
        return P, Piecewise((u, cut > 2), (u**2, True))


def test_a_law_in_pieces_is_its_formula():
    load = compose(get("model/motor", "none")(), Dimmed())
    response = load.simulate(Drive.from_events([event(VOLTAGES)]), np.array([[0.7]]))
    P = np.where(SHARES < 0.3, 0.0, np.where(SHARES < 0.7, (SHARES - 0.3) / 0.4, 1.0))
    assert response.P[0] == pytest.approx(0.8 * P, rel=1e-11)
    assert response.Q[0] == pytest.approx(0.5 * SHARES**2, rel=1e-11)


@pytest.mark.parametrize("motor", ["electromechanical", "stator_flux", "double_cage"])
def test_a_law_in_pieces_stands_beside_a_motor(motor):
    load = compose(get("model/motor", motor)(), Dimmed())
    values = np.array([[p.default for p in load.parameters]])
    assert np.isfinite(
        load.simulate(Drive.from_events([event(np.full(5, 0.98), P0=1.0)]), values).P
    ).all()


def test_the_frequency_exponent_counts_from_the_frequency_before_the_event():
    speed = np.array([-2.0, 0.0, 3.0, -8.0, 5.0])
    ratio = (2 * np.pi * 50 + speed) / (2 * np.pi * 50 - 2.0)
    drive = Drive.from_events([event(VOLTAGES, omega_s=speed, omega_s0=-2.0)])
    response = alone("exponential_frequency").simulate(drive, [[1.3, 2.6, 1.7, -2.2]])
    assert response.P[0] == pytest.approx(0.8 * SHARES**1.3 * ratio**1.7, rel=1e-11)
    assert response.Q[0] == pytest.approx(0.5 * SHARES**2.6 * ratio**-2.2, rel=1e-11)


def test_without_a_recorded_frequency_its_exponents_change_nothing():
    drive = Drive.from_events([event(VOLTAGES)])
    response = alone("exponential_frequency").simulate(
        drive, [[1.3, 2.6, 1.7, -2.2], [1.3, 2.6, 0.0, 3.0]]
    )
    assert np.array_equal(response.P[0], response.P[1])
    assert np.array_equal(response.Q[0], response.Q[1])


def test_its_identification_from_a_record_without_frequency_is_refused():
    t = np.arange(600) * 2e-3
    U = np.where((t > 0.4) & (t < 0.55), 0.6, 1.0)
    recorded = detect(Record("plain", t, U, U**1.5, 0.5 * U**2))
    sentence = (
        "the model/static 'exponential_frequency' reads f, which plain does not have; record f, or"
        " choose another"
        " model/static"
    )
    with pytest.raises(UserError, match=f"^{sentence}$"):
        identify_alone("exponential_frequency", recorded)


def test_zip_and_exponential_agree_at_the_voltage_before_the_event_in_value_and_slope():
    """p_v = 2 a_Z + a_I: the difference vanishes with the square of the distance from U_0."""
    differences = []
    for distance in (1e-2, 1e-3):
        drive = Drive.from_events([event([0.98, 0.98 * (1 - distance), 0.98 * (1 + distance)])])
        zip_load = alone("zip").simulate(drive, [[0.3, 0.5, 0.2, 0.3]])
        exponential = alone("exponential").simulate(drive, [[2 * 0.3 + 0.5, 2 * 0.2 + 0.3]])
        gap = np.abs(np.stack([zip_load.P - exponential.P, zip_load.Q - exponential.Q]))
        assert gap[..., 0].max() < 1e-15
        differences.append(gap[..., 1:].min())
    assert differences[1] == pytest.approx(differences[0] / 100, rel=0.05)


@pytest.mark.parametrize(
    ("special", "general", "values"),
    [
        ("constant_impedance", "zip", [1, 0, 1, 0]),
        ("constant_impedance", "exponential", [2, 2]),
        ("constant_power", "zip", [0, 0, 0, 0]),
        ("constant_power", "exponential", [0, 0]),
        ("exponential", "exponential_frequency", [1.5, 2.5, 0, 0]),
    ],
)
def test_the_presets_are_special_cases(special, general, values):
    drive = Drive.from_events([event(VOLTAGES, omega_s=np.linspace(-3, 3, 5))])
    own = values[:2] if special == "exponential" else []
    left, right = alone(special).simulate(drive, [own]), alone(general).simulate(drive, [values])
    assert pytest.approx(right.P, rel=1e-11) == left.P
    assert pytest.approx(right.Q, rel=1e-11) == left.Q


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ([0.8, 0.5, 0.1, 0.1], "shares of the active power must add up to 1: a_Z + a_I is 1.3"),
        ([0.1, 0.1, 0.9, 0.3], "shares of the reactive power must add up to 1: b_Z + b_I is 1.2"),
        ([-0.1, 0.5, 0.1, 0.1], "a_Z is a share and must not be negative: it is -0.1"),
    ],
)
def test_shares_that_do_not_add_up_get_a_sentence_and_are_refused(values, sentence):
    of, drive = alone("zip"), Drive.from_events([event(VOLTAGES)])
    assert sentence in of.refusal(np.array(values), drive)
    assert of.errors(drive, [values]).is_refused[0]


@pytest.mark.parametrize(
    ("P0", "Q0", "named"),
    [
        (-0.2, 0.5, "active power, and before the event P0 is -0.2 pu"),
        (0.8, -0.1, "reactive power, and before the event Q0 is -0.1 pu"),
    ],
)
def test_a_motor_alone_cannot_meet_power_that_is_fed_back(P0, Q0, named):
    of = compose(get("model/motor", "electromechanical")(), get("model/static", "none")())
    values = np.array([p.default for p in of.parameters])
    drive = Drive.from_events([event(VOLTAGES, P0=P0, Q0=Q0)])
    assert named in of.refusal(values, drive)
    assert "choose a static load" in of.refusal(values, drive)
    assert of.errors(drive, values).is_refused[0]


def test_a_motor_alone_draws_its_own_power_before_the_event():
    of = compose(get("model/motor", "electromechanical")(), get("model/static", "none")())
    response = of.simulate(
        Drive.from_events([event(np.full(20, 0.98))]), [[0.1, 0.3, 0.9, 0.005, 0.37]]
    )
    assert response.P[0] == pytest.approx(np.full(20, 0.37), abs=1e-12)


def test_a_model_without_parameters_cannot_be_identified():
    with pytest.raises(
        UserError, match="none motor and constant_power static load has no parameters"
    ):
        identify_alone("constant_power", "tibet_50pct")
