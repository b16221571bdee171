"""The dip that is recommended, `pick_mildest` of those that decide."""

import numpy as np
import pytest

from tractexp.discrepancy.next_event.choose import DECIDED, EventTrial, pick_mildest
from tractexp.discrepancy.next_event.imagined import ImaginedDip


@pytest.mark.parametrize(("of_mild", "depth"), [(0.93, 0.6), (0.96, 0.2)])
def test_the_mildest_dip_is_recommended_that_decides_with_nineteen_chances_in_twenty(
    of_mild, depth
):
    tried = [
        EventTrial(ImaginedDip(deep, 0.1), np.array([p]), np.ones((1, 1)))
        for deep, p in ((0.2, of_mild), (0.6, 0.99))
    ]
    assert pick_mildest(tried, DECIDED).event.depth == depth
