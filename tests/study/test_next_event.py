"""What to record next: an investigation's own decision is what its chances are of (at least
`DECIDED`), and what it recommends ends a tie.

The events come from the independent generator of `tests/oracle/hidden_effects`. The study over many
ties, which counts how often the predicted chances come true, is `benchmarks/next_event.py`.
"""

import json
from dataclasses import replace
from pathlib import Path

import next_event as study
import pytest
from made_alike import MILD, hidden, recorded
from made_dips import investigate

import tractexp
from independent import Dip
from tractexp.discrepancy.decide import CONFIRMED_SHARE
from tractexp.discrepancy.next_event.choose import DECIDED
from tractexp.domain import PHASORS
from tractexp.errors import UserError

TIE = ("feeder_impedance", "speed_dependent_torque")


@pytest.fixture(scope="module")
def tied():
    return investigate(recorded(hidden(*MILD)), effects=TIE)


def test_two_rivals_tie_and_the_recommended_event_ends_the_tie(tied):
    assert tied.verdict == "tied"
    assert {names for (names,) in tied.content["name_sets"]} == set(TIE)
    told = tied.content["next_event"]
    best = told["recommended"]
    assert best["probability"] >= DECIDED
    assert told["sentence"].startswith(f"record {best['words']}: it tells ")
    edge = PHASORS.dips.edge
    dip = Dip(depth=best["depth"], start=0.5, duration=best["duration"], fall=edge, rise=edge)
    made = hidden(*MILD)
    more = replace(made, dips=(*made.dips, dip), static=(*made.static, made.static[0]))
    after = investigate(recorded(more), effects=TIE)
    # no event was held out: each is left out in turn
    is_confirmed = after.steps.verdict.kept[0].replicated_share >= CONFIRMED_SHARE
    assert after.verdict == ("named" if is_confirmed else "candidate")
    assert after.names == ("speed_dependent_torque",)


def test_what_is_recommended_stands_in_what_machines_read(tied):
    told = json.loads(json.dumps(tied.content))
    assert told["recommendation"] == told["next_event"]["sentence"]
    chances = told["next_event"]["recommended"]
    assert chances["probability"] == min(chances["by_truth"].values())
    assert set(chances["by_truth"]) == set(TIE)
    assert {"words", "depth", "duration", "probability"} <= told["next_event"]["tried"][0].keys()
    assert told["next_event"]["indistinguishable"] == []


def test_what_is_tied_is_classes_with_the_dip_from_which_they_part(tied):
    told = tied.content["classes"]
    assert [names for one in told for names in one["sets"]] == tied.content["name_sets"]
    assert len(told) == 2
    assert all(one["by"] > 0.01 for one in told)
    assert "; 2 classes: they predict alike in milder dips, and part by " in tied.reason
    assert tied.reason.endswith(told[0]["part_at"]["words"])


@pytest.mark.parametrize(
    ("rivals", "sentence"),
    [
        (["stator_resistance"], "to tell two explanations or more apart"),
        (
            ["stator_resistance", "negative_sequence_braking"],
            "cannot be tested here: it is seen through U2",
        ),
        (["stator_resistance", "time_skew"], "a fault of the measurement"),
        ("nowhere.json", "there is no such file"),
    ],
)
def test_rivals_that_cannot_be_planned_for_are_refused_in_a_sentence(rivals, sentence):
    with pytest.raises(UserError, match=sentence):
        tractexp.plan(recorded(hidden(*MILD)), rivals=rivals)


def test_a_plan_for_rivals_says_what_an_investigation_says(tied, tmp_path):
    made = tractexp.plan(tied.question.train, model=tied.question.model, rivals=TIE, progress=False)
    expected = tied.content["next_event"]["recommended"]["probability"]
    assert made.probability == pytest.approx(expected, abs=0.05)
    assert made.sentence.startswith("record a dip of")
    paths = made.write(tmp_path)
    assert {p.name for p in paths} == {"plan.json", "plan.html"}
    assert "What to record next" in (tmp_path / "plan.html").read_text()
    assert json.loads((tmp_path / "plan.json").read_text())["sentence"] == made.sentence


def test_the_docs_report_what_the_stored_study_holds():
    root = Path(__file__).parents[2]
    rows = json.loads((root / "benchmarks" / "next_event.json").read_text())["rows"]
    docs = (root / "docs" / "coverage.md").read_text()
    part = docs.partition("<!-- next event -->")[2].partition("<!-- end of next event -->")[0]
    assert part.strip() == study.table(rows)
