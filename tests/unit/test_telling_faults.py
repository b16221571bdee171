"""Which faults of the measurement are told beside an effect, `find_telling_faults`: deviances in,
names out.
"""

from types import SimpleNamespace
from typing import Any

import pytest
from made_sets import fitted

from tractexp.discrepancy import held_out
from tractexp.discrepancy.held_out import find_telling_faults

BOTH = ("load_change", "time_skew")
BARE = fitted(1000.0, 0)


@pytest.fixture
def tell(monkeypatch):
    """The faults told beside some effects, by the deviance that each set of faults leaves."""

    def find(names, left):
        def refit_from(context, noise, names, unit, faults):
            return fitted(left[faults], 1, *names)

        monkeypatch.setattr(held_out, "refit_from", refit_from)
        coordinates = SimpleNamespace(without_faults=lambda unit, faults: unit)
        explained: Any = SimpleNamespace(
            base=SimpleNamespace(context=SimpleNamespace(coordinates=coordinates)),
            last=SimpleNamespace(noise=None),
            chosen=fitted(0.0, 1, *names),
            faults=BOTH,
        )
        return find_telling_faults(explained, BARE)

    return find


@pytest.mark.parametrize(
    ("without_skew", "alone", "told"),
    [
        (110.0, 400.0, ("load_change",)),  # of 900 that are explained the skew explains 10
        (110.0, 120.0, ()),  # both together explain 20
        (110.0, 150.0, ("load_change",)),  # and here 50, more than a twentieth
        (150.0, 400.0, BOTH),
    ],
)
def test_a_fault_that_only_mends_the_formula_of_an_effect_is_not_told(
    tell, without_skew, alone, told
):
    left = {BOTH: 100.0, ("load_change",): without_skew, ("time_skew",): 600.0, (): alone}
    assert tell(("an_effect",), left) == told


def test_where_no_effect_is_found_all_faults_are_told(tell):
    assert tell((), {}) == BOTH
