"""Every decision threshold decides: each has a case that its default settles one way and a looser one the other."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from test_discrepancy import FEW, base, events, steady

from tractexp.discrepancy.criteria import CHOSEN, DERIVED, Criteria
from tractexp.discrepancy.disagreement import Disagreement
from tractexp.discrepancy.families import worth
from tractexp.discrepancy.gap import GapTest
from tractexp.discrepancy.held_out import Assessment
from tractexp.discrepancy.incomplete import PredictedDeviance
from tractexp.discrepancy.investigate import Findings, investigate
from tractexp.discrepancy.judgement import assessment
from tractexp.discrepancy.next_event.choose import EventTrial, mildest
from tractexp.discrepancy.next_event.imagined import ImaginedDip
from tractexp.discrepancy.next_event.separation import Chances
from tractexp.discrepancy.proposal.judge import TermAssessment
from tractexp.errors import UserError
from tractexp.inference.catalogue import candidate, missing_channel
from tractexp.inference.chance import Chance
from tractexp.inference.fitting import Refit
from tractexp.inference.free_set import FreeSet
from tractexp.inference.score_test import Score
from tractexp.noise.random_walk import Rest, find
from tractexp.parameter import Box
from tractexp.plugin import get


def at_fit(c, p, names=(), fault_p=1.0, blur=0.0, left=1.0):
    """The tests at a fit with these names: p of the best further effect, of a fault of the measurement, of the rest.

    Chance gives every p from 0.001 to 1 with the same probability.
    """
    return Disagreement(
        fit=SimpleNamespace(names=names),
        noise=SimpleNamespace(loudest_input_mode=blur),
        tangent=SimpleNamespace(context=SimpleNamespace(criteria=c)),
        projection=SimpleNamespace(fault_p=lambda: {"time_skew": np.array([fault_p])}),
        chance=SimpleNamespace(
            critical_p=Chance(np.arange(1, 1001) / 1000, {}).critical_p, surprises=lambda *_: {"a test": left}
        ),
        scores=[Score("an effect", 10.0, p, {}, {}, {})],
    )


def refitted(deviance, parameters):
    """A fit of one effect with so many parameters."""
    return Refit(("one",), np.zeros(0), deviance, parameters)


def judged_by(c, closed=1.0, gain=100.0, expected=100.0, p_left=1.0, explained=0.0):
    """What held-out events say of an explanation."""
    gap = GapTest(None, None, gain, abs(gain) * (1 / closed - 1), expected, c.shown, None)
    return Assessment(gap, SimpleNamespace(criteria=c), (), explained, p_left=p_left)


def test_no_share_is_told_of_a_gap_within_the_error_of_the_noise():
    """273 came out once, where less was left than noise leaves by that much more than there had been."""

    def closed(before, after):
        curves = (SimpleNamespace(error=SimpleNamespace(square=square)) for square in (before, after))
        return GapTest(*curves, 1.0, 1.0, 1.0, 10.8, None).closed

    assert closed(4e-4, 1e-4) == pytest.approx(0.75)
    assert closed(4e-4, -4e-5) == pytest.approx(1.1)
    assert closed(4e-4, 8e-4) == pytest.approx(-1.0)
    assert all(np.isnan(closed(before, after)) for before, after in ((1e-6, -2.7e-4), (0.0, 1e-5), (-1e-6, 1e-6)))


def deviance(left):
    """What a set leaves of held-out events."""
    return PredictedDeviance(refitted(0.0, 1), left, SimpleNamespace(deviance=1000.0 + left), False, 10.8)


def named_of_all(c, lowered, word="named"):
    """An investigation of all events whose name lowers the deviance by so much."""
    verdict = SimpleNamespace(word=word, chosen=SimpleNamespace(lowered=lowered))
    return SimpleNamespace(verdict=verdict, context=SimpleNamespace(criteria=c))


def wandering(c, seed, rests=(), walk=0.0):
    """How a load wanders that shows noise and a random walk before its event; None where it is not said to."""
    rng = np.random.default_rng(seed)
    before = rng.normal(size=(2, 250)) + np.cumsum(rng.normal(size=(2, 250)) * np.array([[walk], [0.0]]), axis=1)
    return find([before], 0.002, steady(1000), rests, seen=c.wandering)


def wandering_within(c):
    """The same with what is left of the event, which shows a little more than the stretch before it."""
    rng = np.random.default_rng(24)
    left = rng.normal(size=(2, 1000)) + np.cumsum(rng.normal(size=(2, 1000)) * np.array([[0.012], [0.0]]), axis=1)
    return wandering(c, 73, [Rest(left, np.zeros((1, 2, 1000)), np.ones(1000))])


def prior_of_skew(c):
    """How far clocks are believed to be off [s]."""
    skew = candidate(get("effect", "time_skew")())
    known = {"of_measurement": ("time_skew",), "members": (), "__getitem__": lambda self, name: skew}
    catalogue = type("One", (), known)()
    one = np.array([0.0])
    box = Box(one - 0.01, one + 0.01, ("skew",))
    at = FreeSet(box, one, one, one, 1, catalogue, c.measurement_prior)
    return at.prior_deviation[0] * at.width("skew")


def swinging(c, swing=0.045):
    """Why an effect of the frequency cannot be tested where it swings by so much."""
    record = SimpleNamespace(channels={"f": np.linspace(50.0, 50.0 + swing, 10)})
    return missing_channel(
        get("effect", "frequency_dependence")(), [SimpleNamespace(record=record, channels=("f",))], c.frequency_swing
    )


def status(c):
    """Of an effect that would be seen with a probability of 0.75 at its smallest relevant size."""
    one = candidate(get("effect", "stator_resistance")())
    score = Score("stator_resistance", 0.0, 0.5, {"R_s": 0.0}, {"R_s": 0.01 / (1.6449 + 0.6745)}, {})
    return assessment(one, score, 0.05, c.testable)[0]


def chosen_dip(c):
    tried = [
        EventTrial(ImaginedDip(depth, 0.1), Chances(np.array([p]), np.ones((1, 1))))
        for depth, p in ((0.2, 0.93), (0.6, 0.99))
    ]
    return mildest(tried, c.decided).event.depth


def with_a_member(c, **assessment):
    """An explanation of several effects that is shown, and what held-out events say of one of them."""
    return dataclasses.replace(judged_by(c), of_member={"one": judged_by(c, **assessment)})


def proposed(c, explained=0.9, p=1e-6, whole=1000.0):
    """A term that would be proposed; with the pushes it explains the `whole`."""
    judged = judged_by(c, closed=explained, gain=explained * whole, expected=whole)
    return TermAssessment(None, judged, judged, p)


def test_what_only_gets_worse_explains_nothing():
    assert [judged_by(Criteria(), gain=gain).gap.explained for gain in (-5.0, 0.0, 5.0)] == [0.0, 0.0, 1.0]


CASES = {  # criterion: a looser value, the decision, what it is by default
    "false_alarms": (0.06, lambda c: at_fit(c, 0.022).asks_for_more, False),
    "naming_share": (0.45, lambda c: at_fit(c, 0.021).asks_for_more, False),
    "adequate_p": (0.0006, lambda c: at_fit(c, 1.0, left=0.0008).adequate, False),
    "further_name_p": (3e-5, lambda c: at_fit(c, 2e-5, names=("one",)).asks_for_more, False),
    "rejected": (0.06, lambda c: c.rejects(5.9), False),
    "mended": (0.04, lambda c: c.stands_out(45.0, 1000.0), False),
    "shown": (9.0, lambda c: judged_by(c, gain=10.0).helps, False),
    "evident": (90.0, lambda c: judged_by(c, gain=5.0, expected=6.0, explained=95.0).helps, False),
    "divides": (2.0, lambda c: judged_by(c, closed=0.78).convincing, False),
    "ahead": (1.4, lambda c: deviance(100.0).ahead_of(deviance(200.0), c.ahead), False),
    "window_share": (0.4, lambda c: c.least_window(best=1000.0) < 450.0, False),
    "blurred": (0.7, lambda c: at_fit(c, 1.0, fault_p=1e-9, blur=0.6).faults, ()),
    "quiet_worth": (100.0, lambda c: c.knows_noise(120.0), False),
    "wandering": (1.5, lambda c: wandering(c, 73) is not None, False),
    "measurement_prior": (6.0, lambda c: prior_of_skew(c) < 0.0051, True),
    "frequency_swing": (0.04, lambda c: "moves by less than" in swinging(c), True),
    "testable": (0.7, status, "not testable"),
    "proposal_p": (0.02, lambda c: proposed(c, p=0.011).stands(c), False),
    "decided": (0.9, chosen_dip, 0.6),
}
FURTHER = [  # decisions by a criterion that has one above, too
    ("adequate_p", 0.0006, lambda c: judged_by(c, p_left=0.0008).helps, False),
    ("shown", 9.0, lambda c: c.least_window(best=0.0) < 9.5, False),
    ("shown", 9.0, lambda c: with_a_member(c, gain=10.0).helps, False),
    ("evident", 90.0, lambda c: with_a_member(c, gain=5.0, expected=6.0, explained=95.0).helps, False),
    ("evident", 90.0, lambda c: Findings.evident.fget(named_of_all(c, lowered=95.0)), False),
    ("wandering", 1.5, lambda c: wandering_within(c) is not None, False),
    ("ahead", 1.45, lambda c: proposed(c, explained=0.54).stands(c), False),
    ("shown", 9.0, lambda c: proposed(c, whole=11.0).stands(c), False),
]


def test_every_criterion_has_a_case_and_an_origin():
    fields = {item.name: item.metadata for item in dataclasses.fields(Criteria)}
    assert fields.keys() == CASES.keys()
    for name, told in fields.items():
        assert told["origin"] in (CHOSEN, DERIVED), name
        assert told["about"], name
        assert told["why"], name


@pytest.mark.parametrize(("word", "evident"), [("named", True), ("tied", False)])
def test_what_no_held_out_event_shows_is_told_without_a_rival_only(word, evident):
    assert Findings.evident.fget(named_of_all(Criteria(), 1e3, word)) == evident


def test_a_member_of_a_family_pays_as_a_second_name_does():
    p = Criteria().further_name_p
    assert not worth(refitted(181.8, 2), refitted(200.0, 1), p)
    assert worth(refitted(181.8, 2), refitted(200.0, 1), 3 * p)


@pytest.mark.parametrize(
    ("name", "looser", "decide", "by_default"), [*((name, *case) for name, case in CASES.items()), *FURTHER]
)
def test_a_looser_criterion_decides_otherwise(name, looser, decide, by_default):
    assert decide(Criteria()) == by_default
    assert decide(Criteria.of({name: looser})) != by_default


def test_a_criterion_that_is_unknown_or_out_of_range_is_refused():
    with pytest.raises(UserError, match=r"criteria\.adequatep: there is no such criterion; did you mean 'adequate_p'"):
        Criteria.of({"adequatep": 0.1})
    with pytest.raises(UserError, match=r"task\.false_alarms=0\.7 is out of range: .* at most 0\.5"):
        Criteria(false_alarms=0.7)


def test_loose_criteria_name_what_is_not_there():
    """A step of the load is in no catalogue: by default that is said, by loose criteria something is named for it."""
    made = events("load_step", size=2.0, count=3)[:2]
    assert investigate(base(), made, only=FEW).verdict.word == "unexplained"
    loose = Criteria(adequate_p=0.0, further_name_p=0.5)
    assert investigate(base(), made, only=FEW, criteria=loose).names != ()
