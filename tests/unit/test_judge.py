"""Why a fitted term is not proposed, `TermAssessment`."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from made_sets import held_out

from tractexp.discrepancy.proposal.judge import TermAssessment
from tractexp.inference.criteria import Criteria


def assessed(gain=50.0, left=5.0, expected=55.0, p=1e-3):
    """A term that gains so much of the held-out events' deviance."""
    there = held_out(gain, expected, left)
    return TermAssessment(SimpleNamespace(), there, there, p)


@pytest.mark.parametrize(
    ("term", "objections"),
    [
        (assessed(), []),
        (assessed(left=50.0), ["it explains 50% of what exceeds the noise on the held-out events"]),
        (assessed(gain=-1.0), ["it makes the held-out events worse"]),
        (
            assessed(gain=3.0, left=0.0, expected=6.0),
            ["the held-out events are too mild to show it"],
        ),
        (assessed(p=0.011), ["chance gives the best of the library as much"]),
    ],
)
def test_a_term_is_proposed_unless_held_out_events_or_chance_object(term, objections):
    told = term.objections(Criteria())
    assert len(told) == len(objections)
    assert all(why.startswith(start) for why, start in zip(told, objections, strict=True))


@pytest.mark.parametrize(
    ("name", "looser", "term"),
    [
        ("ahead", 1.45, assessed(gain=54.0, left=46.0)),
        ("shown", 9.0, assessed(gain=10.0, left=1.0, expected=11.0)),
    ],
)
def test_a_looser_criterion_proposes_what_the_usual_one_does_not(name, looser, term):
    criteria = Criteria.from_choices({name: looser})
    there = replace(term.validate, shown=criteria.shown)
    assert term.objections(Criteria())
    assert not replace(term, validate=there).objections(criteria)
