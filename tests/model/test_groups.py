"""Several motor groups as one motor: they draw what the motors draw, in both domains."""

import functools

import numpy as np
import pytest
from waves_of import dip, event

import tractexp
from tractexp.configuration.overrides import quote_overrides
from tractexp.configuration.plugin import build, get
from tractexp.errors import UserError
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose

ONE = {
    "T_prime": 0.12,
    "X_prime": 0.4,
    "C": 0.9,
    "M": 0.004,
    "T_m": 0.4,
    "R_s": 0.03,
    "T_second": 0.01,
    "X_second": 0.3,
}
TWO = {
    "T_prime": 0.06,
    "X_prime": 0.5,
    "C": 0.85,
    "M": 0.009,
    "T_m": 0.25,
    "R_s": 0.05,
    "T_second": 0.02,
    "X_second": 0.4,
}
BOTH = ONE | {f"{name}_2": value for name, value in TWO.items()}
DOMAINS = ("phasors", "waves")


@functools.cache
def model(motors, domain, *effects, static="none"):
    motor = {"name": "motor_groups", "of": list(motors)} if len(motors) > 1 else {"name": motors[0]}
    made = [get("effect", name)() for name in effects]
    return compose(build("model/motor", motor), get("model/static", static)(), made, domain=domain)


def drawn(motors, domain, known, *effects):
    """P and Q, or three currents (C, N), along a dip."""
    of = model(motors, domain, *effects)
    if domain == "waves":
        made = event(dip(0.4, jump=0.4, negative=0.2), length=0.3)
    else:
        t = np.arange(600) * 1e-3
        U = 1 - 0.4 * np.exp(-(((t - 0.2) / 0.05) ** 2))
        made = Excitation(1e-3, U, np.ones(len(t)), np.full(len(t), 0.6), 1.0, 1.0, 0.6)
    response = of.simulate(
        Drive.from_events([made]), np.array([known[name] for name in of.names]), 8
    )
    assert response.miss[0, 0] == 0
    return response.outputs[:, 0]


@pytest.mark.parametrize("domain", DOMAINS)
def test_two_groups_draw_what_both_motors_draw(domain):
    pair = ("stator_flux", "double_cage")
    both = drawn(pair, domain, BOTH)
    assert both == pytest.approx(
        drawn(pair[:1], domain, ONE) + drawn(pair[1:], domain, TWO), abs=1e-9
    )


@pytest.mark.parametrize("domain", DOMAINS)
def test_two_halves_are_one_motor(domain):
    half = ONE | {"X_prime": 2 * ONE["X_prime"], "M": ONE["M"] / 2, "T_m": ONE["T_m"] / 2}
    halves = half | {f"{name}_2": value for name, value in half.items()}
    whole = drawn(("electromechanical",), domain, ONE)
    assert drawn(("electromechanical",) * 2, domain, halves) == pytest.approx(whole, abs=1e-9)


def test_an_effect_acts_on_the_first_group():
    known = BOTH | {"R_s": 0.04}
    pair = ("electromechanical",) * 2
    both = drawn(pair, "phasors", known, "stator_resistance")
    first = drawn(pair[:1], "phasors", known, "stator_resistance")
    assert both == pytest.approx(first + drawn(pair[1:], "phasors", TWO), abs=1e-9)


def test_each_group_has_its_parameters():
    of = model(("stator_flux", "electromechanical", "electromechanical"), "waves", static="branch")
    own = ["T_prime", "X_prime", "C", "M", "T_m"]
    suffixed = [f"{name}_{k}" for k in (2, 3) for name in own]
    assert of.names == (*own, "R_s", *suffixed, "branch_resistance")
    by_name = {p.name: p for p in of.parameters}
    assert sum(by_name[n].default for n in ("T_m", "T_m_2", "T_m_3")) == pytest.approx(0.5)
    assert by_name["M_3"].default == pytest.approx(4 * by_name["M"].default)
    assert by_name["X_prime_2"].about == by_name["X_prime"].about + ", of group 2"
    assert of.motor.within_a_cycle
    assert (
        of.title
        == "stator_flux + electromechanical + electromechanical motor and branch static load, on"
        " waveforms"
    )
    assert not build("model/motor", {"name": "motor_groups"}).within_a_cycle


def test_groups_of_the_same_motor_stand_in_order_of_inertia():
    of = model(("electromechanical",) * 2, "phasors")
    drive = Drive.from_events([Excitation(1e-3, np.ones(5), np.ones(5), np.ones(5), 1.0, 1.0, 0.6)])
    swapped = np.array([(TWO | {f"{n}_2": v for n, v in ONE.items()})[name] for name in of.names])
    assert of.refusal(swapped, drive) == (
        "groups of the same motor stand in order of inertia: M may not exceed M_2, and it is larger"
        " by 0.005; let them"
        " change places"
    )
    different = model(("stator_flux", "double_cage"), "phasors")
    values = np.array([(BOTH | {"M": 0.02})[name] for name in different.names])
    assert different.refusal(values, drive) is None


def test_a_steady_state_that_a_group_lacks_names_the_group():
    of = model(("electromechanical",) * 2, "phasors")
    drive = Drive.from_events([Excitation(1e-3, np.ones(5), np.ones(5), np.ones(5), 1.0, 1.0, 0.6)])
    refusal = of.refusal(np.array([(BOTH | {"T_m_2": 0.95})[name] for name in of.names]), drive)
    assert refusal.startswith("of motor group 2: no steady state exists before the event")


def test_the_command_line_takes_a_list():
    assert quote_overrides(["model/motor=[stator_flux, double_cage]", "seed=3"]) == [
        "model/motor=motor_groups",
        "model.motor.of=[stator_flux,double_cage]",
        "seed=3",
    ]
    assert quote_overrides(["model/motor=stator_flux"]) == ["model/motor=stator_flux"]
    for several in ("model/motor=[a,b],c", "model/motor=[a,b],[c,d]"):
        with pytest.raises(
            UserError, match="a sweep over lists is written model/motor=motor_groups"
        ) as told:
            quote_overrides([several])
        assert several in str(told.value)


def test_a_list_of_motors_is_a_model_that_is_kept():
    made = tractexp.compose(
        motor=["stator_flux", {"name": "double_cage"}], static="branch", domain="waves"
    )
    assert made.node["motor"] == {
        "name": "motor_groups",
        "of": ["stator_flux", {"name": "double_cage"}],
    }
    again = tractexp.compose(
        motor=made.node["motor"], static=made.node["static"]["name"], domain="waves"
    )
    assert list(again.parameters) == list(made.parameters)
    assert {"X_prime", "X_prime_2", "X_second_2"} <= set(made.parameters)


@pytest.mark.parametrize(
    ("motors", "sentence"),
    [
        (
            ["stator_flux"],
            "several motor groups are two or more, and model/motor=['stator_flux'] names 1",
        ),
        (["stator_flux", "none"], "has 'none' in it, which is no motor by itself"),
        (["motor_groups", "stator_flux"], "has 'motor_groups' in it, which is no motor by itself"),
        (
            ["stator_flux", "stator_flx"],
            "there is no model/motor 'stator_flx'; did you mean 'stator_flux'?",
        ),
        (["stator_flux", 3], "has 3 in its list; give a name, or a mapping of 'name' and settings"),
        (["stator_flux", {"nam": "x"}], "has {'nam': 'x'} in its list"),
    ],
)
def test_a_list_that_makes_no_sense_gets_a_sentence(motors, sentence):
    with pytest.raises(UserError) as refused:
        tractexp.compose(motor=motors)
    assert sentence in str(refused.value)


def test_a_group_that_makes_no_sense_of_waveforms_is_refused():
    with pytest.raises(
        UserError,
        match="the motor 'stator_flux \\+ mechanical' does not go with domain=waves: its flux",
    ):
        _ = model(("stator_flux", "mechanical"), "waves").equations
