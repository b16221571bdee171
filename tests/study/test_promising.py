"""Starts ranked by one simulation each, `select_promising_starts`, as a descent from every one of
them would.
"""

import numpy as np
import pytest
from made_context import fitted_base
from made_dips import FAST, LOUD, events

from tractexp.inference import fit_effort, fitting
from tractexp.inference.promising import select_promising_starts

TRIP = ("undervoltage_trip",)


@pytest.fixture(scope="module")
def planted():
    """The bench of a trip of 5 %, its base fit, and a start at each setting of the catalogue's
    grid.
    """
    made = events("undervoltage_trip", 0.5, 800012, noise=LOUD, recorder=FAST)
    first = fitted_base(made, TRIP)
    at = first.context
    settings = at.catalogue["undervoltage_trip"].settings
    units = np.array(
        [at.coordinates.place_values(first.fit.unit, s | {"tripped_share": 0.05}) for s in settings]
    )
    coordinates = at.coordinates
    faults = coordinates.parameters(at.catalogue.of_measurement)
    return at, first.noise, units, [*coordinates.base, *coordinates.before, *faults]


def test_the_best_of_all_descents_begins_at_a_start_that_promises(planted):
    at, noise, units, nuisances = planted
    kept = select_promising_starts(at, noise, TRIP, units, nuisances, fit_effort.MOST_STARTS)
    assert len(units) == 2 * fit_effort.MOST_STARTS
    assert len(kept) == fit_effort.MOST_STARTS
    best = lambda these: min(  # noqa: E731
        f.deviance
        for f in fitting.run_descents(
            at, noise, [(TRIP, u) for u in these], None, fit_effort.ROUGH_DESCENT
        )
    )
    assert best(kept) == pytest.approx(best(units), abs=1.0)


def test_what_changes_nothing_promises_least(planted):
    """A relay whose level no dip reaches leaves the deviance of the base model; so does one of no
    size.
    """
    at, noise, units, nuisances = planted
    never = at.coordinates.place_values(units[0], {"trip_level": 0.3, "trip_delay": 0.5})
    still = at.coordinates.place_values(units[1], {"tripped_share": 0.0})
    kept = select_promising_starts(
        at, noise, TRIP, np.array([never, *units, still]), nuisances, len(units)
    )
    assert not any(np.array_equal(k, u) for k in kept for u in (never, still))


def test_few_starts_are_taken_as_they_are_and_the_order_is_kept(planted):
    at, noise, units, nuisances = planted
    spent = at.effort.total
    assert select_promising_starts(at, noise, TRIP, units[:5], nuisances, 5) is not None
    assert at.effort.total == spent
    kept = select_promising_starts(at, noise, TRIP, units, nuisances, 7)
    places = [int(np.flatnonzero((units == k).all(axis=1))[0]) for k in kept]
    assert places == sorted(places)


def test_it_costs_a_simulation_for_each_start_and_two_for_each_nuisance(planted):
    at, noise, units, nuisances = planted
    spent = at.effort.total
    select_promising_starts(at, noise, TRIP, units, nuisances, 7)
    assert at.effort.total - spent == len(units) + 2 * len(nuisances) + 1
