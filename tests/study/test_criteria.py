"""Every threshold of `Criteria` decides: each has a case that its default settles one way and a
looser one the other.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from made_dips import events
from made_sets import beside_base, held_out, off, row

import tractexp
from tractexp.discrepancy.decide import decide, holds, needs_all_events
from tractexp.discrepancy.disagreement import Disagreement
from tractexp.discrepancy.ranking import beats
from tractexp.errors import UserError
from tractexp.inference.criteria import CHOSEN, DERIVED, Criteria


def at_fit(c, p, names=(), fault_p=1.0, blur=0.0, left=1.0):
    """The tests at a fit with these names: p of the best further effect, of a fault of the
    measurement, of the rest.

    Chance gives every p with the same probability.
    """
    return Disagreement(
        fit=SimpleNamespace(names=names),
        noise=SimpleNamespace(loudest_input_mode=blur),
        tangent=SimpleNamespace(context=SimpleNamespace(criteria=c)),
        projection=SimpleNamespace(
            fault_p=lambda: {"time_skew": np.array([fault_p])},
            scores=lambda: [SimpleNamespace(p=p)],
        ),
        chance=SimpleNamespace(critical_p=lambda p: p, surprises=lambda *_: {"a test": left}),
    )


def word_of(c, gain, expected, base_p=0.0, **columns):
    """The verdict on one set alone, by what held-out events say of it."""
    one = row("a", gap=held_out(gain, expected, shown=c.shown), **columns)
    return decide(beside_base(one, base_p=base_p), c).word


def word_of_pair(c, gain, expected):
    """The verdict on two effects, by what one of them gains over the other alone."""
    return word_of(c, 50.0, 55.0, without={"b": held_out(gain, expected, shown=c.shown)})


def is_doubted(c, share):
    """Whether a set that explains so much of held-out events must be fitted to all."""
    return needs_all_events([row("a", gap=held_out(100.0, 100.0, 100.0 * (1 / share - 1)))], c)


def stands(c, p):
    """Whether a set does of which all events leave something with so small a p."""
    return holds(row("a", gap=held_out(50.0, 55.0), p_of_all=p), c)


CASES = {  # criterion: a looser value, the decision, what it is by default
    "false_alarms": (0.06, lambda c: at_fit(c, 0.022).asks_for_more, False),
    "adequate_p": (0.0006, lambda c: at_fit(c, 1.0, left=0.0008).adequate, False),
    "further_name_p": (3e-5, lambda c: at_fit(c, 2e-5, names=("one",)).asks_for_more, False),
    "rejected": (0.06, lambda c: c.rejects(5.9), False),
    "shown": (9.0, lambda c: word_of(c, 10.0, 11.0), "candidate"),
    "divides": (2.0, lambda c: is_doubted(c, 0.78), True),
    "ahead": (1.4, lambda c: beats(off("a", error=0.1), off("b", error=0.145), c), False),
}
FURTHER = [  # decisions by a criterion that has one above, too
    ("adequate_p", 0.0006, lambda c: stands(c, 0.0008), False),
    ("adequate_p", 0.0006, lambda c: word_of(c, -99.0, 100.0, base_p=0.0008), "unexplained"),
    ("shown", 9.0, lambda c: word_of_pair(c, 10.0, 11.0), "candidate"),
]


@pytest.mark.parametrize(
    ("name", "looser", "decide", "by_default"),
    [*((name, *case) for name, case in CASES.items()), *FURTHER],
)
def test_a_looser_criterion_decides_otherwise(name, looser, decide, by_default):
    assert decide(Criteria()) == by_default
    assert decide(Criteria.from_choices({name: looser})) != by_default


def test_naming_spends_a_part_of_the_false_alarms():
    """Two of the five in a hundred."""
    assert at_fit(Criteria(), 0.019).asks_for_more
    assert not at_fit(Criteria(), 0.021).asks_for_more


def test_no_fault_of_the_measurement_is_told_where_noise_of_the_voltage_is_loud():
    """Half as loud as that of the power."""
    assert at_fit(Criteria(), 1.0, fault_p=1e-9, blur=0.45).faults == ("time_skew",)
    assert at_fit(Criteria(), 1.0, fault_p=1e-9, blur=0.55).faults == ()


def test_every_criterion_has_a_case_and_an_origin():
    fields = {item.name: item.metadata for item in dataclasses.fields(Criteria)}
    assert fields.keys() == CASES.keys()
    for name, told in fields.items():
        assert told["origin"] in (CHOSEN, DERIVED), name
        assert told["about"], name
        assert told["why"], name


@pytest.mark.parametrize(
    ("choice", "sentence"),
    [
        (
            {"criteria": {"adequatep": 0.1}},
            r"criteria\.adequatep: there is no such criterion; did you mean 'adequate_p'",
        ),
        (
            {"criteria": {"adequate_p": 1.5}},
            r"criteria\.adequate_p=1\.5 is out of range: .* at most 1",
        ),
    ],
)
def test_a_criterion_that_is_unknown_or_out_of_range_is_refused(choice, sentence):
    with pytest.raises(UserError, match=sentence):
        tractexp.investigate(events(count=1), **choice)
