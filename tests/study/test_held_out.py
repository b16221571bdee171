"""What events that no fit saw say of an explanation: `compare_on`, `assess`, and a fit to
`AllEvents`.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_context import bench
from made_dips import base, events

from tractexp.discrepancy.all_events import AllEvents
from tractexp.discrepancy.decide import holds, needs_all_events
from tractexp.discrepancy.held_out import assess, carry_fits, compare_on
from tractexp.inference.fitting import Refit


def add_events(steps, made):
    """The events of an investigation together with these."""
    known = steps.evidence
    return AllEvents(steps.context, made, known.noise, known.faults, known.base.fit)


def test_all_events_together_confirm_only_what_the_held_out_ones_show(planted):
    """An event with the effect adds to the evidence of the fitted ones, one without it takes from
    it.
    """
    steps = planted.steps
    alone, criteria = steps.extended_fit, steps.context.criteria
    dip_with_it = events("stator_resistance", size=2.0, count=3)[2:]
    both = add_events(steps, dip_with_it)
    ((confirmed, p_left),) = both.fit_jointly([alone], seed=0)
    assert both.measure_loudness(confirmed, alone) > 0
    assert p_left >= criteria.adequate_p
    assert confirmed.names == ("stator_resistance",)
    assert confirmed.unit.shape == alone.unit.shape
    value = steps.context.coordinates.value
    assert value("R_s", confirmed.unit) == pytest.approx(value("R_s", alone.unit), rel=0.2)
    dip_without_it = events(None, count=3)[2:]
    both = add_events(steps, dip_without_it)
    ((denied, p_left),) = both.fit_jointly([alone], seed=0)
    assert both.measure_loudness(denied, alone) < 0
    assert p_left < criteria.adequate_p


def test_what_has_no_steady_state_on_a_held_out_event_is_denied_there():
    """A motor that would not run before it: nothing of it can be compared, and the noise is another
    fit's.
    """
    made = bench(base(), events(count=3)[:2])
    at = made.coordinates
    runs = Refit((), at.null.copy(), 0.0, 0)
    stalls = Refit(("stator_resistance",), at.null.copy(), 0.0, 1)
    stalls.unit[at.column["T_m"]] = stalls.unit[at.column["C"]] = 1.0
    stalls.unit[at.parameters(stalls.names)] = 1.0
    held = events(count=3)[2:]
    other, units, noise = carry_fits(made, held, [runs, stalls])
    assert not np.isfinite(other.residuals(units[1][None], stalls.names)).any()
    assert np.isfinite(noise.levels).all()
    judged = compare_on(made, held, runs, [runs, stalls])
    assert judged[stalls.names].outcome != "shown"
    assert judged[stalls.names].gain == -np.inf


def test_an_effect_that_closes_little_of_the_held_out_gap_must_leave_nothing_in_a_fit_to_all_events(
    planted,
):
    """A step of the load after the held-out dip is seen beside the effect; without it nobody asks
    for that fit.
    """
    steps = planted.steps
    criteria = steps.context.criteria

    def judged_on(made):
        (row,) = assess(add_events(steps, made), steps.verdict.kept, seed=0)
        assert row.names == ("stator_resistance",)
        assert not row.is_fitted_to_all
        return row

    (clean,) = events("stator_resistance", size=2.0, count=3)[2:]
    assert not needs_all_events([judged_on([clean])], criteria)
    assert holds(judged_on([clean]), criteria)
    record = clean.record
    later = record.t > record.t[clean.end] + 0.2
    stepped = judged_on(
        [replace(clean, record=replace(record, P=record.P + 0.05 * clean.P0 * later))]
    )
    assert stepped.gap.outcome == "shown"
    assert needs_all_events([stepped], criteria)
    assert not holds(stepped, criteria)


def test_of_a_small_effect_the_held_out_dips_show_nothing_and_deny_nothing(planted):
    """Of a resistance of 0.0005 pu both curves are about as far apart as noise is large."""
    steps = planted.steps
    large, place = steps.extended_fit, steps.context.coordinates.place_values
    small = replace(large, unit=place(large.unit, {"R_s": 0.0005}))
    bare = replace(large, names=(), unit=place(large.unit, {"R_s": 0.0}))
    (dip,) = events("stator_resistance", size=0.05, count=3)[2:]
    told = compare_on(steps.context, [dip], bare, [small])[small.names]
    assert told.outcome == "mild"
