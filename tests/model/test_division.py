"""What no load is, is said of an estimate: its division, by `doubt_division`, and swings that count
as noise.
"""

import numpy as np
import pytest

import tractexp
from tractexp.identification.division import doubt_division

TRUTH = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.55, "p_v": 1.4, "q_v": 3}


def fit(swing=0.0, **truth):
    """The fit of a load whose P swings at 18.5 Hz, with noise of 0.1 %; all but T_m is fixed."""
    values = TRUTH | truth
    made = tractexp.simulate(
        tractexp.compose(), values, depth=0.3, duration=0.2, rate=400.0, length=2.0
    )
    r = made.responses[0]
    draws = 1e-3 * np.random.default_rng(0).standard_normal((2, len(r.t)))
    P = r.P * (1 + swing * np.sin(2 * np.pi * 18.5 * r.t)) + draws[0]
    return tractexp.identify(
        {"t": r.t, "U": r.U, "P": P, "Q": r.Q + draws[1]},
        fixed={name: value for name, value in values.items() if name != "T_m"},
        bounds={"T_m": (0.3, 2.0)},
        optimizer={"name": "multistart_least_squares", "starts": 2},
        check_intervals=False,
        progress=False,
    )


@pytest.mark.parametrize(
    ("motor", "said"),
    [
        (0.5 + 0.3j, ""),
        (1.15 + 0.3j, ""),
        (2.5 + 0.5j, "the motor draws 2.5 pu of a load of 1 pu and 0.5 pu, and the static part"),
        (0.5 + 2.0j, "the static part supplies 1.5 pu"),
        (-0.5 + 0.3j, "the motor generates 0.5 pu and the static part draws 1.5 pu"),
    ],
)
def test_a_division_that_no_load_has_is_doubted(motor, said):
    doubt = doubt_division(1 + 0.5j, motor, ("pu", "pu"))
    assert said in doubt
    assert bool(said) == bool(doubt)


def test_an_estimate_is_doubted_by_its_own_steady_state():
    drawing = fit(X_prime=0.1, T_m=1.9)
    assert "the motor draws 1.9 pu of a load of" in drawing.operating_point.doubt
    assert "physical=True" in drawing.advice[-1]


def test_the_grade_says_that_a_swing_counts_as_noise():
    swinging, quiet = fit(swing=0.03), fit()
    sentence = swinging.result.adequacy["sentence"]
    assert "what counts as noise is a swing of the load as well: P swings at 18.5 Hz by" in sentence
    assert "swing" not in quiet.result.adequacy["sentence"]
    assert quiet.operating_point.doubt == ""
