"""Where the setting of an effect rests, `is_end_of_range`."""

import pytest

from tractexp.configuration.plugin import get
from tractexp.discrepancy.findings import is_end_of_range


@pytest.mark.parametrize(
    ("name", "value", "ends"),
    [
        ("tripped_share", 0.0, True),
        ("trip_level", 0.95, True),
        ("trip_delay", 0.5, True),
        ("trip_delay", 0.0, False),
        ("reconnect_delay", 0.02, True),
    ],
)
def test_a_setting_rests_at_the_end_of_its_range_unless_nature_ends_there(name, value, ends):
    """The level of a relay at the end of what was tried is no level; a delay of 0 is one."""
    own = {p.name: p for p in get("effect", "undervoltage_trip")().parameters}
    assert is_end_of_range(own[name], value) == ends
