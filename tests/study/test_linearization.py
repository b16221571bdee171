"""Everything that could change at a fit, `linearize_fit`."""

from made_context import bench
from made_dips import base, events

from tractexp.inference.base_fit import fit_base_model
from tractexp.inference.fitting import Refit
from tractexp.inference.linearization import linearize_fit

TRIP = ("undervoltage_trip",)


def test_the_instants_of_a_relay_are_no_parameters_of_each_event():
    """Of the relay the share alone may differ between them."""
    fit = fit_base_model(bench(base(), events(), TRIP))
    at = fit.context.coordinates
    unit = at.place_values(fit.fit.unit, {"tripped_share": 0.1, "trip_level": 0.8})
    there = linearize_fit(fit.context, Refit(TRIP, unit, 0.0, 6), fit.noise)
    assert len(there.split) == 2 * (len(at.base) - len(there.held) + 1)
