"""What a profile makes of a verdict, `revise_verdict`, and where other places that fit are looked
for, `find_outermost`.
"""

from dataclasses import replace

import numpy as np

from tractexp.identification.profile import revise_verdict
from tractexp.identification.profile_lanes import End, LikelihoodProfile, find_outermost
from tractexp.identification.verdict import (
    IDENTIFIED,
    UNIDENTIFIED,
    WEAK,
    ParameterVerdict,
    shorten_verdict,
)


def closed_profile(values, interval):
    """A profile of C whose deviance rises by 5 on either side of its best value."""
    rises = np.array([5.0, 0.0, 5.0])
    return LikelihoodProfile("C", np.array(values), rises, interval, (End.CLOSED, End.CLOSED), ())


def test_two_minima_and_open_sides_change_the_verdict():
    good = ParameterVerdict(IDENTIFIED, "± 3 %")
    base = closed_profile([0.4, 0.5, 0.6], (0.48, 0.52))
    assert revise_verdict(good, base, 0, 1).word == IDENTIFIED
    twice = revise_verdict(good, replace(base, minima=(0.58,)), 0, 1)
    assert (twice.word, "two minima, another at 0.58" in twice.detail) == (WEAK, True)
    upwards = revise_verdict(good, replace(base, ends=(End.CLOSED, End.BOUND)), 0, 1)
    assert (upwards.word, "open upwards" in upwards.detail) == (WEAK, True)
    assert (
        revise_verdict(good, replace(base, ends=(End.BOUND, End.BOUND)), 0, 1).word == UNIDENTIFIED
    )
    assert revise_verdict(good, replace(base, interval=(0.3, 0.7)), 0, 1).word == WEAK


def test_a_verdict_repeats_no_interval():
    """The table has the one interval that holds: a half-width of the curvature beside it would be
    another.
    """
    by_curvature = ParameterVerdict(WEAK, "trades against T_m (correlation 0.98)")
    profile = closed_profile([0.3, 0.5, 0.9], (0.31, 0.88))
    verdict = str(revise_verdict(by_curvature, profile, 0.0, 1.0))
    assert verdict == "weakly identified: trades against T_m (correlation 0.98)"
    assert shorten_verdict(verdict) == "weakly identified"
    assert shorten_verdict("identified") == "identified"


def test_places_that_fit_are_looked_for_beside_an_interval_without_ends():
    points = np.array([[0.2], [0.9]]), np.array([[0.5], [2.0]])
    with np.errstate(all="raise"):
        assert find_outermost(*points, 0, (-np.inf, np.inf)) == []
    assert find_outermost(*points, 0, (0.3, 0.4)) == [0]
    assert find_outermost(*points, 0, (0.0, 0.1)) == [0]
