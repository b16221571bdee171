"""How wide an interval is, `compute_interval_factor`."""

import pytest

from tractexp.inference.interval import compute_interval_factor


def test_students_t_of_few_blocks_is_wide():
    assert compute_interval_factor(4) == pytest.approx(2.776, abs=1e-3)
    assert compute_interval_factor(999) == pytest.approx(1.96, abs=5e-3)
