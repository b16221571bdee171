"""All tests at one fit, `examine_base_fit`: where model and records differ is found by the test
that looks for it, and chance is drawn as exactly as the decision asks.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_context import bench
from made_dips import base, events

from tractexp.discrepancy.disagreement import examine_base_fit
from tractexp.inference.base_fit import fit_base_model
from tractexp.inference.chance import draw_scales
from tractexp.inference.goodness_of_fit import GoodnessOfFit


@pytest.fixture(scope="module")
def first():
    """The tests of the base model on dips where nothing is missing."""
    return examine_base_fit(fit_base_model(bench(base(), events())), seed=0)


@pytest.mark.parametrize(
    ("looked_for", "shape"),
    [
        (
            "an oscillation",
            lambda t, event: 0.8 * np.sin(2 * np.pi * 31.0 * t) * (t >= event.t_start),
        ),
        (
            "a step or a pulse",
            lambda t, event: 1.5 * (t >= event.t_end + 0.37) * (event.record.name == "event1"),
        ),
        ("a step or a pulse", lambda t, event: 3.0 * (np.abs(t - event.t_end - 0.3) < 0.006)),
        (
            "an oscillation",
            lambda t, event: (
                1.5 * np.sin(97.0 * (t - event.t_end)) * (np.abs(t - event.t_end - 0.4) < 0.1)
            ),
        ),
        (
            "the loudest window",
            lambda t, event: (
                4.0 * (np.abs(t - event.t_start - 0.02) < 0.01) * (-1.0) ** (t // 0.004)
            ),
        ),
    ],
)
def test_what_no_effect_explains_is_found_by_the_test_that_looks_for_it(first, looked_for, shape):
    """Planted into what the base model leaves, in standard deviations of the noise; without it
    nothing is found.
    """
    at = first.context
    assert first.p_left > 0.01
    planted = first.tangent.residual.copy()
    for e, event in enumerate(at.events):
        planted[0, at.drive.part(e)] += 0.002 * shape(event.record.t, event)
    found = first.chance.surprises(
        first.projection.replace_residuals(at.whiten(first.noise, planted[None])), at
    )
    assert min(found, key=found.get) == looked_for
    assert found[looked_for] < 1e-5


def test_only_a_decision_that_is_open_asks_for_exact_scales(first):
    """p of the six tests together is moved to either side of what draws leave open."""
    level = first.criteria.adequate_p
    bare = replace(first, chance=replace(first.chance, scales={}))
    for p, open_ in [
        (level / 30, False),
        (level / 10, True),
        (level * 10, True),
        (level * 30, False),
    ]:
        moved = replace(bare)
        moved.__dict__["goodness_of_fit"] = GoodnessOfFit({"one of six": p})
        assert moved.is_undecided == open_
    exact = replace(
        bare,
        chance=replace(
            bare.chance, scales=draw_scales(first.tangent, first.projection, first.noise, 3)
        ),
    )
    exact.__dict__["goodness_of_fit"] = GoodnessOfFit({"one of six": level})
    assert not exact.is_undecided
    drawn = bare.chance.left
    for name, scale in exact.chance.scales.items():
        assert np.median(np.abs(scale.mean / drawn[name].mean(axis=0) - 1)) < 0.1
        assert np.median(np.abs(scale.spread / drawn[name].std(axis=0) - 1)) < 0.15
    assert set(exact.chance.scales) == {
        name for name, values in drawn.items() if values[0].size > 1
    }


def test_what_only_a_parameter_beyond_its_bounds_explains_is_left(first):
    """The best fit lies on a wall; a projection that lets the parameter leave the box would find
    nothing.
    """
    T = first.context.coordinates.value("T_prime", first.fit.unit)
    made = bench(base(), events(), bounds={"T_prime": [1.05 * T, 2 * T]})
    bounded = examine_base_fit(fit_base_model(made), seed=0)
    assert bounded.fit.unit[made.coordinates.column["T_prime"]] == 0.0
    assert "T_prime" in bounded.parameters_at_bound
    assert first.parameters_at_bound == []
    assert bounded.fit.deviance > first.fit.deviance + 50
    assert first.adequate
    assert bounded.p_left < 1e-6


def test_nuisance_columns_are_orthogonal_to_the_projected_residual(first):
    projection = first.projection
    assert np.abs(projection.r @ projection.Q).max() < 1e-8
    for block in projection.blocks:
        assert np.abs(block @ projection.Q).max() < 1e-6 * max(np.abs(block).max(), 1.0)
