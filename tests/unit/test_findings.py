"""What follows of `Findings`: whether a name closes a share of the error, and where the setting of
an effect rests, `is_end_of_range`.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from tractexp.configuration.plugin import get
from tractexp.discrepancy.findings import Findings, is_end_of_range
from tractexp.inference.criteria import Criteria
from tractexp.inference.model_error import ModelChange


@pytest.mark.parametrize(
    ("effect", "name", "value", "ends"),
    [
        ("undervoltage_trip", "tripped_share", 0.0, True),
        ("undervoltage_trip", "trip_level", 0.95, True),
        ("undervoltage_trip", "trip_delay", 0.5, True),
        ("undervoltage_trip", "trip_delay", 0.0, False),
        ("undervoltage_trip", "reconnect_delay", 0.02, True),
        ("speed_dependent_torque", "quadratic_share", 1.0, False),
        ("speed_dependent_torque", "quadratic_share", 0.0, True),
        ("dc_link_lag", "lag_share", 1.0, True),
        ("static_var_compensator", "compensator_exponent", 2.0, False),
    ],
)
def test_a_setting_rests_at_the_end_of_its_range_unless_nature_ends_there(
    effect, name, value, ends
):
    """The level of a relay at the end of what was tried is no level; a delay of 0 is one, and so
    is a torque that is all quadratic.
    """
    own = {p.name: p for p in get("effect", effect)().parameters}
    assert is_end_of_range(own[name], value) == ends


@pytest.mark.parametrize(
    ("kept", "closed", "ahead", "told"),
    [
        (1, 0.9, 1.5, True),
        (2, 0.9, 1.5, False),
        (1, 0.54, 1.5, False),
        (1, 0.54, 1.45, True),
        (1, np.nan, 1.5, False),
    ],
)
def test_what_only_all_events_show_closes_a_share_of_the_error_and_has_no_rival(
    kept, closed, ahead, told
):
    """A name closed 7 % of the gap once, because its deviance was beyond a hundred."""
    before, after = (
        SimpleNamespace(error=SimpleNamespace(square=square)) for square in (1.0, 1.0 - closed)
    )
    found = SimpleNamespace(
        context=SimpleNamespace(criteria=Criteria(ahead=ahead)),
        graded_change=ModelChange(before, after),
        verdict=SimpleNamespace(kept=("one",) * kept),
    )
    assert Findings.closes_share.fget(found) == told
