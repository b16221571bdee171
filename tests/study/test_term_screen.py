"""What a term of the library would gain in one linear step, `screen_terms`, against simulations and
a refit.
"""

import numpy as np
import pytest
from made_context import fitted_base
from made_dips import FAST, events

from tractexp.discrepancy.proposal.library import find_term
from tractexp.discrepancy.proposal.refit import fit_terms
from tractexp.discrepancy.proposal.screen import (
    ScreeningFit,
    compute_library_p,
    score_terms,
    screen_terms,
)
from tractexp.discrepancy.proposal.term_context import (
    add_terms,
    build_term_context,
    carry_over,
    list_sizes,
    place,
)

STEP, RELAY = "timed:power:step:of_return", "answer:static:relay"


@pytest.fixture(scope="module")
def fitted():
    """The base model as it fits two events in which the load steps a little."""
    made = events("load_step", 0.15, seed=800001, recorder=FAST)
    return fitted_base(made, ["stator_resistance"])


@pytest.fixture(scope="module")
def ground(fitted):
    """The same beside the library of terms."""
    terms = build_term_context(fitted.context)
    unit = carry_over(terms, fitted.context, fitted.fit.unit)
    return ScreeningFit.from_coordinates(terms, unit, fitted.noise)


def test_the_base_model_has_the_same_bits_beside_the_library(fitted, ground):
    mine = ground.context.residuals(ground.unit[None], ())
    assert np.array_equal(mine, fitted.context.residuals(fitted.fit.unit[None], ()))


@pytest.mark.parametrize(
    "name",
    ["answer:torque:slip", "answer:decay:slip", "answer:static_P:relay", "answer:angle:rate", STEP],
)
def test_a_column_is_the_difference_of_two_simulations(ground, name):
    """Central differences of a tenth of the relevant size, against the one-sided ones of the
    screen.
    """
    chosen, at = find_term(name), ground.context.coordinates
    setting = chosen.signal.settings[len(chosen.signal.settings) // 2]
    (size, _), zeros = list_sizes(chosen)[0], [0.0] * (len(list_sizes(chosen)) - 1)
    up, down, small = (
        place(at, ground.unit, chosen, setting, [k * size.relevant, *zeros])
        for k in (0.1, -0.1, 0.02)
    )
    raw = ground.context.residuals(np.array([up, down]), (chosen.signal.kind,))
    central = ground.context.whiten(ground.noise, (raw[:1] - raw[1:]) / (0.2 * size.relevant))
    column = ground.columns(small[None], np.array([0.02 * size.relevant]), chosen.signal.kind)
    assert np.linalg.norm(central) > 0
    assert np.linalg.norm(column - central) < 0.01 * np.linalg.norm(central)


def test_the_linear_drop_is_that_of_a_refit_where_the_term_is_small(ground):
    made = fit_terms(ground, screen_terms(ground, [find_term(STEP)]), [])
    (found,) = score_terms(
        ground, [(find_term(STEP), {"instant": made.values(made.fits[0])["instant"]})]
    )
    lowered = made.bare.deviance - made.fits[0].deviance
    assert lowered > 20
    assert found.drop == pytest.approx(lowered, rel=0.1)


def test_noise_gives_the_best_of_many_tries_as_much_as_often_as_is_told():
    rng = np.random.default_rng(4)
    for name, sizes in (("timed:power_P:step:of_dip", 1), (STEP, len(list_sizes(find_term(STEP))))):
        best = rng.chisquare(sizes, (4000, 200)).max(axis=1)
        p = np.array([compute_library_p(find_term(name), drop, 200) for drop in best])
        assert 0.04 < np.mean(p < 0.05) < 0.06


@pytest.mark.parametrize(
    ("clock", "begins"), [("of_record", 0.0), ("of_dip", "start"), ("of_return", "end")]
)
def test_a_clock_counts_from_where_it_says(ground, clock, begins):
    chosen = find_term(f"timed:power_P:step:{clock}")
    point = place(ground.context.coordinates, ground.unit, chosen, {"instant": 0.1}, [1.0])
    added = ground.context.residuals(point[None], (chosen.signal.kind,))[0, 0] - ground.raw[0]
    for e, event in enumerate(ground.context.events):
        own, t = added[ground.context.drive.part(e)], event.record.t - event.record.t[0]
        assert np.all(
            (np.abs(own) < 1e-9) | (np.abs(own - 1) < 1e-6) | (np.abs(np.gradient(own)) > 0)
        )
        first = t[np.flatnonzero(own > 0.5)[0]] - 0.1
        if begins == 0.0:
            assert first == pytest.approx(0.0, abs=event.record.step)
        elif begins == "start":
            assert 0 < first - (event.t_start - event.record.t[0]) < 0.06
        else:
            assert -0.12 < first - (event.t_end - event.record.t[0]) < 0.02


def test_terms_become_candidates_with_their_own_parameters_only(ground):
    beside = add_terms(ground.context, [find_term(RELAY), find_term(RELAY)])
    own = [beside.coordinates.names[k] for k in beside.coordinates.parameters([RELAY])]
    assert own == [
        "answer_static_size",
        *(f"answer_relay_{n}" for n in ("level", "margin", "delay", "wait", "ramp")),
    ]
