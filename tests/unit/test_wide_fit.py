"""A search from many starts in turns, `_descend_in_turns`."""

from types import SimpleNamespace

import numpy as np

from tractexp.inference import fit_effort, wide_fit
from tractexp.inference.fitting import Refit
from tractexp.inference.wide_fit import _descend_in_turns


def test_a_start_that_may_overtake_the_best_is_searched_on(monkeypatch):
    """The best of them gains nothing; the other falls by 30 a turn, from 50 behind."""
    at = SimpleNamespace(coordinates=None)
    ways = {"still": [100.0] * 9, "falls": [150.0, 120.0, 90.0, 60.0, 60.0]}
    turns = []

    def descended(bench, noise, wanted, *_):
        turns.append(len(wanted))
        return [Refit(names, unit, ways[names[0]][len(turns) - 1], 0) for names, unit in wanted]

    monkeypatch.setattr(wide_fit, "run_descents", descended)
    monkeypatch.setattr(wide_fit, "_begin_fits", descended)
    monkeypatch.setattr(wide_fit, "move_across", lambda bench, noise, fit, faults: fit.unit)
    ended = _descend_in_turns(
        at, None, [(("still",), np.zeros(1)), (("falls",), np.zeros(1))], None
    )
    assert (ended[0].names, ended[0].deviance) == (("falls",), 60.0)
    assert len(turns) == 1 + fit_effort.MOST_TURNS
