"""What sets leave of held-out events, `PredictedError`, and what each member of a set is good for,
`Evidence`.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_sets import off, table

from tractexp.discrepancy.evidence import PredictedError


def test_what_one_block_decides_is_chance():
    """Without its loudest block the rival is as good."""
    one, other = off("a", error=0.1).prediction, off("b", error=0.1).prediction
    other.squares[3] += 1.0
    assert one.compute_lead(other) <= 0
    assert one.compute_lead(off("c", error=0.2, uneven=0.5).prediction) > 0


def test_few_blocks_tell_less_of_chance_and_one_tells_nothing():
    """A lead that is clear in twenty blocks; three alike have the quantile of two degrees of
    freedom.
    """

    def first(one, blocks):
        rows = (getattr(one, name)[:blocks] for name in ("squares", "noise", "response"))
        return PredictedError(*rows, one.unit)

    one, other = off("a", error=0.1).prediction, off("b", error=0.2, uneven=0.8).prediction
    assert [first(one, blocks).compute_lead(first(other, blocks)) > 0 for blocks in (1, 3, 20)] == [
        False,
        False,
        True,
    ]


def test_a_model_that_diverges_is_behind_any_that_does_not():
    lost, sound = off("b", error=0.1).prediction, off("a", error=0.5).prediction
    lost.squares[2] = np.inf
    assert sound.compute_lead(lost) > 0
    assert lost.compute_lead(sound) <= 0


def test_contributions_begin_with_the_member_that_helps_most():
    sets = [off(error=1.0), off("a", error=0.5), off("b", error=0.3), off("a", "b", error=0.1)]
    assert [row.names for row in table(*sets).contributions(("a", "b"))] == [(), ("b",), ("a", "b")]


def test_where_noise_hides_what_the_base_model_misses_no_set_can_divide_it():
    blocks = np.ones(10)
    hidden = PredictedError(1.05 * blocks, blocks, 50 * blocks, np.zeros(0))
    assert hidden.largest_factor == 1.0
    assert replace(hidden, squares=1.6 * blocks).largest_factor == pytest.approx(6**0.5)
    assert replace(hidden, squares=np.full(10, np.inf)).largest_factor == np.inf  # it stalls
