"""What a look still tells where nothing is worth fitting."""

from math import log

import pytest

from tractexp.report import unfitted


def event(kind="step", depth=0.02, P=(30.0, 29.0), Q=(5.0, 4.8), worth=False):
    powers = dict(zip(("P_before", "P_after", "Q_before", "Q_after"), (*P, *Q), strict=True))
    return {"kind": kind, "start": 3.2, "depth": depth, "worth": worth, **powers}


def files(*events, loaded=True):
    return [{"feeders": [{"name": "T2", "loaded": loaded, "events": list(events)}]}]


@pytest.mark.parametrize("depth", [0.02, -0.03])
def test_a_step_tells_the_exponents_that_the_load_has(depth):
    ratio = 1 - depth
    told = unfitted.list_sentences(
        files(event(depth=depth, P=(30, 30 * ratio**1.4), Q=(5, 5 * ratio**3.1)))
    )
    assert "the step of" in told[0]
    assert "p_v 1.4 and q_v 3.1" in told[0]
    assert told[0].endswith("model.fixed.p_v=1.4 model.fixed.q_v=3.1")
    assert f"wrong by {0.01 / abs(log(ratio)):.1g} for every percent" in told[0]
    assert told[1:] == [unfitted.DIPS, unfitted.AMBIENT]


def test_where_q_changes_its_sign_the_exponent_of_p_is_told_alone():
    (told, *_) = unfitted.list_sentences(files(event(Q=(0.5, -0.5))))
    assert "p_v" in told
    assert "q_v" not in told


@pytest.mark.parametrize(
    "silent",
    [files(event("dip", worth=True)), files(event(), loaded=False), [{"feeders": []}]],
)
def test_nothing_is_told_where_something_is_worth_fitting_or_no_load_is_there(silent):
    assert unfitted.list_sentences(silent) == []


@pytest.mark.parametrize(
    "odd",
    [
        event("swell"),
        event(depth=0.001),
        event(depth=1.0),
        event(P=(None, 1.0)),
        event(P=(-1.0, 1.0)),
    ],
)
def test_an_event_that_tells_no_exponent_leaves_the_advice(odd):
    assert unfitted.list_sentences(files(odd)) == [unfitted.DIPS, unfitted.AMBIENT]
