"""The page of an identification: what each event adds."""

import pytest

from tractexp.report.identify import _tell_widening


@pytest.mark.parametrize(
    ("ratio", "told"),
    [
        (1.257, "1.26"),
        (999.99, "999.99"),
        (1000.0, "not identifiable"),
        (float("inf"), "not identifiable"),
    ],
)
def test_an_interval_a_thousand_times_as_wide_is_none(ratio, told):
    assert _tell_widening(ratio) == told
