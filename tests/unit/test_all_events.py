"""Explanations fitted to all events: `AllEvents`."""

from types import SimpleNamespace

import numpy as np
import pytest

from tractexp.discrepancy.all_events import AllEvents
from tractexp.inference.criteria import Criteria

ONE, TWO = ("undervoltage_trip",), ("two_stage_trip",)


class Stuck(AllEvents):
    """Fits whose costs are given: from where the sets were, and from every setting."""

    def __init__(self, near, everywhere, p_left):
        super().__init__(SimpleNamespace(criteria=Criteria()), (), None, (), None)
        object.__setattr__(self, "told", (near, everywhere, p_left))

    def fit_jointly(self, alone, seed, *, anew=False):
        near, everywhere, p_left = self.told
        costs = everywhere if anew else near
        return [(SimpleNamespace(names=fit.names, cost=costs[fit.names]), p_left) for fit in alone]


def compare(near, everywhere, p_left=0.7):
    alone = [SimpleNamespace(names=ONE), SimpleNamespace(names=TWO)]
    joint = Stuck(near, everywhere, p_left).compare(alone, seed=0)
    return {fit.names: fit.cost for fit, _ in joint}


@pytest.mark.parametrize(("behind", "ahead"), [(ONE, TWO), (TWO, ONE)])
def test_what_another_set_would_reject_is_fitted_from_every_setting_first(behind, ahead):
    near = {ahead: 6150.0, behind: 6880.0}
    assert compare(near, {behind: 6152.0})[behind] == 6152.0


def test_what_was_ahead_is_fitted_from_every_setting_once_another_passes_it():
    """Else it would be rejected by a fit that was sought harder than its own."""
    near = {ONE: 6150.0, TWO: 6880.0}
    everywhere = {TWO: 6000.0, ONE: 5999.0}
    assert compare(near, everywhere) == everywhere


def test_what_is_as_good_as_the_best_is_not_fitted_again():
    near = {ONE: 6150.0, TWO: 6153.0}
    assert compare(near, {ONE: 0.0, TWO: 0.0}) == near


def test_what_leaves_more_than_chance_does_is_fitted_again_and_keeps_the_better_fit():
    near = {ONE: 6150.0, TWO: 6153.0}
    assert compare(near, {ONE: 6140.0, TWO: 6160.0}, p_left=1e-6) == {ONE: 6140.0, TWO: 6153.0}


def test_nothing_is_asked_of_all_events_where_the_base_model_cannot_run_before_the_held_out_ones():
    stalled = SimpleNamespace(plain=SimpleNamespace(deviance=np.inf))
    assert AllEvents.p_left(stalled, (), 0) == 1.0
