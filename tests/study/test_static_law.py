"""A static load by another law than the base model's: an investigation names the share of constant
power.
"""

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import get
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose
from tractexp.record import Record, detect

STEP, NOISE, Q0 = 5e-3, 1e-3, 0.6
ZIP = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.45,
    "a_Z": 0.5,
    "a_I": 0.1,
    "b_Z": 0.7,
    "b_I": 0.1,
}


def load(static):
    return compose(get("model/motor", "electromechanical")(), get("model/static", static)())


def dip(depth, duration, rng):
    """A record of the load beside a ZIP static load, whose power is noisy."""
    t = np.arange(401) * STEP
    U = 1 - depth * (np.clip((t - 0.5) / 0.02, 0, 1) - np.clip((t - 0.5 - duration) / 0.06, 0, 1))
    excitation = Excitation(STEP, U, np.ones(len(t)), np.full(len(t), Q0), 1.0, 1.0, Q0)
    of = load("zip")
    response = of.simulate(
        Drive.from_events([excitation]), np.array([ZIP[name] for name in of.names]), 8
    )
    P, Q = (power[0] + NOISE * rng.standard_normal(len(t)) for power in (response.P, response.Q))
    return detect(Record(f"dip of {depth:.0%}", t, U, P, Q).check())


def test_a_zip_load_taken_for_an_exponential_one_is_named_with_its_share_of_constant_power():
    """Constant current of 0.1 adds a little to the share of constant power, 0.4, where the exponent
    is free.
    """
    rng = np.random.default_rng(1)
    made = [dip(depth, duration, rng) for depth, duration in ((0.5, 0.2), (0.3, 0.3), (0.6, 0.15))]
    answer = tractexp.investigate(
        made[:2],
        tractexp.compose(static="exponential"),
        validate=made[2:],
        effects=("stator_resistance", "polynomial_static_load"),
        progress=False,
    )
    assert (answer.verdict, answer.names) == ("named", ("polynomial_static_load",))
    share = answer.fit.parameters["constant_share_P"].value
    assert share == pytest.approx(0.417, abs=0.02)
