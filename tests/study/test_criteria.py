"""Every threshold of `Criteria` decides: each has a case that its default settles one way and a
looser one the other.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from made_dips import FEW, base, events
from test_random_walk import steady

from tractexp.configuration.plugin import get
from tractexp.discrepancy import disagreement, judgement
from tractexp.discrepancy.decide import decide, holds, needs_all_events
from tractexp.discrepancy.disagreement import Disagreement
from tractexp.discrepancy.evidence import Evidence, PredictedError, SetEvidence
from tractexp.discrepancy.families import worth
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.gap import GapTest
from tractexp.discrepancy.investigate import investigate
from tractexp.discrepancy.judgement import assessment
from tractexp.discrepancy.next_event import choose
from tractexp.discrepancy.next_event.choose import EventTrial, mildest
from tractexp.discrepancy.next_event.imagined import ImaginedDip
from tractexp.discrepancy.proposal import judge
from tractexp.discrepancy.proposal.judge import TermAssessment
from tractexp.discrepancy.ranking import beats
from tractexp.errors import UserError
from tractexp.inference import catalogue, chance, criteria
from tractexp.inference.catalogue import candidate, missing_channel
from tractexp.inference.chance import Chance
from tractexp.inference.context import FAULT_PRIOR
from tractexp.inference.criteria import CHOSEN, DERIVED, Criteria
from tractexp.inference.fitting import Refit
from tractexp.inference.free_set import FreeSet
from tractexp.inference.model_error import Change
from tractexp.inference.score_test import Score
from tractexp.noise import random_walk
from tractexp.noise.random_walk import Rest, find
from tractexp.parameter import Box


def at_fit(c, p, names=(), fault_p=1.0, blur=0.0, left=1.0):
    """The tests at a fit with these names: p of the best further effect, of a fault of the
    measurement, of the rest.

    Chance gives every p from 0.001 to 1 with the same probability.
    """
    return Disagreement(
        fit=SimpleNamespace(names=names),
        noise=SimpleNamespace(loudest_input_mode=blur),
        tangent=SimpleNamespace(context=SimpleNamespace(criteria=c)),
        projection=SimpleNamespace(
            fault_p=lambda: {"time_skew": np.array([fault_p])},
            scores=lambda: [Score("an effect", 10.0, p, {}, {}, {})],
        ),
        chance=SimpleNamespace(
            critical_p=Chance(np.arange(1, 1001) / 1000, {}).critical_p,
            surprises=lambda *_: {"a test": left},
        ),
    )


def refitted(deviance, parameters):
    """A fit of one effect with so many parameters."""
    return Refit(("one",), np.zeros(0), deviance, parameters)


def judged_by(c, closed=1.0, gain=100.0, expected=100.0, p_left=1.0):
    """What held-out events say of an explanation."""
    gap = measured_gap(c, closed, gain, expected)
    return SetEvidence(None, ("one",), ("one",), gap=gap, p_of_all=p_left)


def measured_gap(c, closed=1.0, gain=100.0, expected=100.0):
    """A gap of which so much of what exceeds the noise is closed."""
    left = abs(gain) * (1 / closed - 1)
    return GapTest(None, None, gain, left, expected, c.shown, None, SimpleNamespace(criteria=c))


def missing(error):
    """What a set leaves of held-out events, in ten blocks."""
    blocks = np.ones(10)
    prediction = PredictedError(error**2 * blocks, 0 * blocks, blocks, np.zeros(0))
    return SetEvidence(refitted(0.0, 1), ("one",), ("one",), prediction=prediction)


def word_of(c, row, base_p=0.0):
    """The verdict on one set alone that leaves nothing of the fitted events."""
    base = SetEvidence(refitted(1000.0, 0), (), (), p_left=base_p)
    row = dataclasses.replace(row, fit=refitted(0.0, 1), behind=0.0, p_left=1.0)
    return decide(Evidence(base, (row,)), c).word


def closes_share(c, closed, kept=1):
    """Whether an investigation of all events that keeps so many sets closes a share of the model's
    error.
    """
    before, after = (
        SimpleNamespace(error=SimpleNamespace(square=square)) for square in (1.0, 1.0 - closed)
    )
    found = SimpleNamespace(
        context=SimpleNamespace(criteria=c),
        graded_change=Change(before, after),
        verdict=SimpleNamespace(kept=("one",) * kept),
    )
    return Findings.closes_share.fget(found)


def wandering(seed, rests=(), walk=0.0):
    """How a load wanders that shows noise and a random walk before its event; None where it is not
    said to.
    """
    rng = np.random.default_rng(seed)
    before = rng.normal(size=(2, 250)) + np.cumsum(
        rng.normal(size=(2, 250)) * np.array([[walk], [0.0]]), axis=1
    )
    return find([before], 0.002, steady(1000), rests)


def wandering_within():
    """The same with what is left of the event, which shows a little more than the stretch before
    it.
    """
    rng = np.random.default_rng(24)
    left = rng.normal(size=(2, 1000)) + np.cumsum(
        rng.normal(size=(2, 1000)) * np.array([[0.012], [0.0]]), axis=1
    )
    return wandering(73, [Rest(left, np.zeros((1, 2, 1000)), np.ones(1000))])


def prior_of_skew(prior):
    """How far clocks are believed to be off [s]."""
    skew = candidate(get("effect", "time_skew")())
    known = {
        "of_measurement": ("time_skew",),
        "members": (),
        "__getitem__": lambda self, name: skew,
    }
    catalogue = type("One", (), known)()
    one = np.array([0.0])
    box = Box(one - 0.01, one + 0.01, ("skew",))
    at = FreeSet(box, one, one, one, 1, catalogue, prior)
    return at.prior_deviation[0] * at.width("skew")


def swinging(swing=0.045):
    """Why an effect of the frequency cannot be tested where it swings by so much."""
    record = SimpleNamespace(channels={"f": np.linspace(50.0, 50.0 + swing, 10)})
    return missing_channel(
        get("effect", "frequency_dependence")(), [SimpleNamespace(record=record, channels=("f",))]
    )


def status():
    """Of an effect that would be seen with a probability of 0.75 at its smallest relevant size."""
    one = candidate(get("effect", "stator_resistance")())
    score = Score(
        "stator_resistance", 0.0, 0.5, {"R_s": 0.0}, {"R_s": 0.01 / (1.6449 + 0.6745)}, {}
    )
    return assessment(one, score, 0.05)[0]


def chosen_dip():
    tried = [
        EventTrial(ImaginedDip(depth, 0.1), np.array([p]), np.ones((1, 1)))
        for depth, p in ((0.2, 0.93), (0.6, 0.99))
    ]
    return mildest(tried, choose.DECIDED).event.depth


def with_a_member(c, **assessment):
    """An explanation of several effects that is shown, and what held-out events say of
    one of them.
    """
    return dataclasses.replace(judged_by(c), without={"one": measured_gap(c, **assessment)})


def proposed(c, explained=0.9, p=1e-6, whole=1000.0):
    """A term that would be proposed; with the pushes it explains the `whole`."""
    judged = measured_gap(c, closed=explained, gain=explained * whole, expected=whole)
    return TermAssessment(None, judged, judged, p)


CASES = {  # criterion: a looser value, the decision, what it is by default
    "false_alarms": (0.06, lambda c: at_fit(c, 0.022).asks_for_more, False),
    "adequate_p": (0.0006, lambda c: at_fit(c, 1.0, left=0.0008).adequate, False),
    "further_name_p": (3e-5, lambda c: at_fit(c, 2e-5, names=("one",)).asks_for_more, False),
    "rejected": (0.06, lambda c: c.rejects(5.9), False),
    "shown": (9.0, lambda c: word_of(c, judged_by(c, gain=10.0, expected=11.0)), "candidate"),
    "divides": (2.0, lambda c: needs_all_events([judged_by(c, closed=0.78)], c), True),
    "ahead": (1.4, lambda c: beats(missing(0.1), missing(0.145), c), False),
}
FURTHER = [  # decisions by a criterion that has one above, too
    ("adequate_p", 0.0006, lambda c: holds(judged_by(c, p_left=0.0008), c), False),
    (
        "adequate_p",
        0.0006,
        lambda c: word_of(c, judged_by(c, gain=-99.0), base_p=0.0008),
        "unexplained",
    ),
    ("shown", 9.0, lambda c: word_of(c, with_a_member(c, gain=10.0, expected=11.0)), "candidate"),
    ("ahead", 1.45, lambda c: proposed(c, explained=0.54).objections(c) == [], False),
    ("ahead", 1.45, lambda c: closes_share(c, 0.54), False),
    ("shown", 9.0, lambda c: proposed(c, whole=11.0).objections(c) == [], False),
]
# of one algorithm alone: where it stands, a looser value, what it decides, what that is by default
NUMBERS = [
    (criteria, "NAMING_SHARE", 0.45, lambda: at_fit(Criteria(), 0.021).asks_for_more, False),
    (
        disagreement,
        "BLURRED",
        0.7,
        lambda: at_fit(Criteria(), 1.0, fault_p=1e-9, blur=0.6).faults,
        (),
    ),
    (chance, "QUIET_WORTH", 100.0, lambda: is_known(120.0), False),
    (catalogue, "LEAST_SWING", 0.04, lambda: "moves by less than" in swinging(), True),
    (judgement, "TESTABLE", 0.7, status, "not testable"),
    (
        judge,
        "PROPOSED_P",
        0.02,
        lambda: proposed(Criteria(), p=0.011).objections(Criteria()) == [],
        False,
    ),
    (choose, "DECIDED", 0.9, chosen_dip, 0.6),
]


def is_known(worth):
    """Whether quiet stretches worth so many independent samples tell the noise exactly enough."""
    problem = SimpleNamespace(quiet=())
    context = SimpleNamespace(problem=problem, domain=SimpleNamespace(noise_from_model=False))
    return chance.is_noise_exact(context, SimpleNamespace(worth=lambda samples: worth))


@pytest.mark.parametrize(("module", "name", "looser", "decide", "by_default"), NUMBERS)
def test_a_looser_number_of_an_algorithm_decides_otherwise(
    monkeypatch, module, name, looser, decide, by_default
):
    assert decide() == by_default
    monkeypatch.setattr(module, name, looser)
    assert decide() != by_default


def test_a_wider_prior_lets_clocks_be_farther_off():
    assert prior_of_skew(FAULT_PRIOR) < 0.0051 < prior_of_skew(6.0)


@pytest.mark.parametrize("walk", [lambda: wandering(73), wandering_within])
def test_a_lower_likelihood_lets_a_load_wander(walk, monkeypatch):
    assert walk() is None
    monkeypatch.setattr(random_walk, "LEAST_WANDERING", 1.5)
    assert walk() is not None


def test_every_criterion_has_a_case_and_an_origin():
    fields = {item.name: item.metadata for item in dataclasses.fields(Criteria)}
    assert fields.keys() == CASES.keys()
    for name, told in fields.items():
        assert told["origin"] in (CHOSEN, DERIVED), name
        assert told["about"], name
        assert told["why"], name


@pytest.mark.parametrize(
    ("kept", "closed", "told"),
    [(1, 0.9, True), (2, 0.9, False), (1, 0.5, False), (1, np.nan, False)],
)
def test_what_only_all_events_show_closes_a_share_of_the_error_and_has_no_rival(kept, closed, told):
    """A name closed 7 % of the gap once, because its deviance was beyond a hundred."""
    assert closes_share(Criteria(), closed, kept) == told


def test_a_member_of_a_family_pays_as_a_second_name_does():
    p = Criteria().further_name_p
    assert not worth(refitted(181.8, 2), refitted(200.0, 1), p)
    assert worth(refitted(181.8, 2), refitted(200.0, 1), 3 * p)


@pytest.mark.parametrize(
    ("name", "looser", "decide", "by_default"),
    [*((name, *case) for name, case in CASES.items()), *FURTHER],
)
def test_a_looser_criterion_decides_otherwise(name, looser, decide, by_default):
    assert decide(Criteria()) == by_default
    assert decide(Criteria.from_choices({name: looser})) != by_default


def test_a_criterion_that_is_unknown_or_out_of_range_is_refused():
    with pytest.raises(
        UserError,
        match=r"criteria\.adequatep: there is no such criterion; did you mean 'adequate_p'",
    ):
        Criteria.from_choices({"adequatep": 0.1})
    with pytest.raises(
        UserError, match=r"task\.false_alarms=0\.7 is out of range: .* at most 0\.5"
    ):
        Criteria(false_alarms=0.7)


def test_loose_criteria_name_what_is_not_there():
    """A step of the load is in no catalogue: by default that is said, by loose criteria something
    is named for it.
    """
    made = events("load_step", size=2.0, count=3)[:2]
    assert investigate(base(), made, only=FEW).verdict.word == "unexplained"
    loose = Criteria(adequate_p=0.0, further_name_p=0.5)
    assert investigate(base(), made, only=FEW, criteria=loose).names != ()
