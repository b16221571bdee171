"""Explanations compared on held-out events and by a fit to all, `assess`: numbers in, the sets that
stand out.
"""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from made_sets import beside_base, fitted, held_out, row

from tractexp.discrepancy.decide import decide, holds
from tractexp.discrepancy.held_out import assess
from tractexp.inference.criteria import Criteria


def compared(costs, p_left=(1.0, 1.0), helps=(True, True)):
    """What becomes of two explanations that cost so much in a fit to all events, the base model
    500.
    """
    at = SimpleNamespace(
        criteria=Criteria(), events=(), catalogue=SimpleNamespace(textbook=lambda names: names)
    )
    fits = [fitted(0.0, 1, name) for name in ("one", "other")]
    joint = [
        (replace(f, deviance=cost - 2), p) for f, cost, p in zip(fits, costs, p_left, strict=True)
    ]
    both = SimpleNamespace(
        fitted=at,
        events=(),
        bare=fitted(500.0, 0),
        plain=SimpleNamespace(cost=500.0),
        compare=lambda *_: joint,
        measure_loudness=lambda *_: 10.0,
        without_each=lambda fit: {},
        fit_to_all=lambda fits: fits,
    )
    gains = {f.names: 100.0 if good else -100.0 for f, good in zip(fits, helps, strict=True)}

    def judged(context, events, bare, fits):
        return {f.names: held_out(gains[f.names], 100.0, left=10.0) for f in fits}

    return both, [row(f.names[0]) for f in fits], judged


@pytest.mark.parametrize(
    ("costs", "p_left", "helps", "standing", "again"),
    [
        ((100.0, 105.0), (1.0, 1.0), (True, True), ["one", "other"], []),
        # the other is too far behind on all events
        ((100.0, 107.0), (1.0, 1.0), (True, True), ["one"], []),
        # what was open of it, all events tell
        ((107.0, 100.0), (1.0, 1.0), (True, False), [], ["other"]),
        ((100.0, 105.0), (1.0, 0.04), (False, False), [], ["one", "other"]),  # no other is there
    ],
)
def test_explanations_are_compared_on_all_events(
    monkeypatch, costs, p_left, helps, standing, again
):
    both, rows, judged = compared(costs, p_left, helps)
    monkeypatch.setattr("tractexp.discrepancy.held_out.compare_on", judged)
    assessed = assess(both, rows, 0)
    assert [row.names[0] for row in assessed if holds(row, Criteria())] == standing
    assert [row.names[0] for row in assessed if row.is_fitted_to_all] == again


@pytest.mark.parametrize(
    ("gain", "expected", "alone", "needless"),
    [
        (20.0, 100.0, 30.0, []),
        (5.0, 100.0, 30.0, ["other"]),
        (5.0, 6.0, 30.0, []),  # the held-out events are too mild to show or to deny it
        (-5.0, 100.0, 130.0, ["other"]),
    ],
)
def test_of_two_effects_each_is_shown_over_the_other_alone(
    monkeypatch, gain, expected, alone, needless
):
    """The pair gains 200 over the base model, and as much over the other one of them."""
    both, _, _ = compared((100.0, 100.0))
    pair, fewer = (
        fitted(0.0, 2, "one", "other"),
        {"one": fitted(200.0, 1, "other"), "other": fitted(alone, 1, "one")},
    )
    both = SimpleNamespace(
        **vars(both)
        | {
            "without_each": lambda fit: fewer,
            "compare": lambda *_: [(pair, 1.0)],
            "measure_loudness": lambda *_: -1.0,
        }
    )

    def judged(context, events, bare, fits):
        gap = (gain, expected) if bare.names == ("one",) else (200.0, 200.0)
        return {f.names: held_out(*gap) for f in fits}

    monkeypatch.setattr("tractexp.discrepancy.held_out.compare_on", judged)
    (pair_of,) = assess(both, [row(*pair.names)], 0)
    assert pair_of.gap.outcome == "shown"
    assert [name for name, gap in pair_of.without.items() if gap.outcome == "denied"] == needless
    assert holds(pair_of, Criteria()) == (not needless)
    verdict = decide(beside_base(pair_of), Criteria())
    assert verdict.word == ("unexplained" if needless else "named" if gain >= 10.8 else "candidate")
