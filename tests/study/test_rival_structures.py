"""Rival structures, `add_rivals`: what a stator resistance that is there, or is not, does to the
parameters of a model without it.
"""

from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study

from hidden_effects import Case, Noise
from hidden_effects.generator import make, truth
from tractexp.configuration.plugin import get
from tractexp.identification.estimate import estimate_without_search
from tractexp.identification.rivals import (
    IDENTIFIED_SHARE,
    RivalStructure,
    _find_moved_parameters,
    _list_structures,
    add_rivals,
)
from tractexp.identification.verdict import IDENTIFIED, WEAK
from tractexp.inference.problem import Problem
from tractexp.model.model import compose
from tractexp.record import Record, detect

SEED = 5


def judged(case):
    """The judgement of the first two events of a case of the independent generator,
    and the truth.
    """
    dips = [detect(Record(f"event{k}", **r).check()) for k, r in enumerate(make(case, SEED))]
    return add_rivals(estimate_without_search(Problem(study.model(), dips)).uncertainty), truth(
        case, SEED
    )["load"]


@pytest.fixture(scope="module")
def missing():
    return judged(Case("stator_resistance", 4.0, events=2, noise=Noise(0.001)))


def test_a_resistance_that_is_there_fits_better_and_its_parameters_are_nearer_the_truth(missing):
    known, load = missing
    assert not known.exact
    rivals = {rival.name: rival for rival in known.rivals}
    best = rivals["stator_resistance"]
    assert best.squares < 0.9
    off = {
        n: (abs(best.values[n] / load[n] - 1), abs(v / load[n] - 1))
        for n, v in zip(known.names, known.values, strict=True)
    }
    assert sum(with_it < without for with_it, without in off.values()) >= 5


def test_intervals_reach_over_what_a_rival_makes_of_a_parameter_where_more_than_noise_is_left(
    missing,
):
    known, _ = missing
    alone = replace(known, rivals=())
    for rival in known.rivals:
        for name, value in rival.values.items():
            j = known.names.index(name)
            low, high = known.intervals[j]
            assert low <= np.clip(value, known.lower[j], known.upper[j]) <= high
    assert (known.intervals[:, 0] <= alone.intervals[:, 0]).all()
    assert (known.intervals[:, 1] >= alone.intervals[:, 1]).all()


def test_a_static_load_that_refuses_an_effect_of_the_model_is_no_rival():
    """A ZIP load has the share of constant power already."""
    motor, static = get("model/motor", "electromechanical")(), get("model/static", "exponential")()
    with_share = compose(motor, static, [get("effect", "polynomial_static_load")()])
    assert {name for name, _ in _list_structures(compose(motor, static))} == {
        "second_cage",
        "stator_resistance",
        "stator_transients",
        "zip",
    }
    assert {name for name, _ in _list_structures(with_share)} == {
        "second_cage",
        "stator_resistance",
        "stator_transients",
    }


def test_where_nothing_is_missing_the_interval_is_the_fits_own_and_no_rival_gains():
    known, load = judged(Case(events=2, noise=Noise(0.003)))
    assert known.exact
    assert (known.intervals == replace(known, rivals=()).intervals).all()
    assert all(rival.squares > 0.98 for rival in known.rivals)
    inside = [
        low <= load[n] <= high for n, (low, high) in zip(known.names, known.intervals, strict=True)
    ]
    assert sum(inside) >= 6


def rival(name, T_m, known):
    """A structure that fits as well, with another torque."""
    return RivalStructure(name, 1.0, {"T_m": T_m}, known.likelihood.problem, known.values)


def test_a_parameter_that_a_rival_moves_far_is_not_called_identified(missing):
    known, _ = missing
    known = replace(known, rivals=())
    j = known.names.index("T_m")
    far = rival("other", float(1.5 * known.values[j]), known)
    told = dict(_find_moved_parameters(known, replace(known, rivals=(far,))))
    assert list(told) == ["T_m"]
    assert known.verdicts["T_m"].word == IDENTIFIED
    assert told["T_m"].word == WEAK
    assert f"with other it is {1.5 * known.values[j]:.4g}" in told["T_m"].detail


def test_a_parameter_whose_interval_rivals_make_wide_is_not_called_identified(missing):
    """Each moves it by a tenth only, but one up and one down: with its scatter that is more than a
    fifth each way.
    """
    known, _ = missing
    known = replace(known, rivals=())
    j = known.names.index("T_m")
    value = float(known.values[j])
    known = replace(known, profiled=dict(known.profiled) | {"T_m": (0.88 * value, 1.12 * value)})
    rivals = tuple(rival(f"by {share}", share * value, known) for share in (0.9, 1.1))
    assert dict(_find_moved_parameters(known, replace(known, rivals=rivals[:1]))) == {}
    assert IDENTIFIED_SHARE == 0.2
    both = dict(_find_moved_parameters(known, replace(known, rivals=rivals)))
    assert both["T_m"].word == WEAK
    assert known.verdicts["T_m"].word == IDENTIFIED
