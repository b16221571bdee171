"""What became of the search for a term in sentences, `describe_proposal`."""

from types import SimpleNamespace

from tractexp.discrepancy.proposal.propose import propose
from tractexp.discrepancy.proposal.wording import describe_proposal


def test_where_no_term_was_asked_for_nothing_is_said():
    assert describe_proposal(None, None) == []
    assert describe_proposal(None, "why not") == ["no term is proposed: why not"]


def test_what_a_proposal_ties_with_and_looks_like_is_said():
    term = {
        "words": "a step of P",
        "function_of_voltage": False,
        "parameters": {"k": {"value": 0.2, "standard_error": 0.01}},
    }
    told = {"terms": [term], "explained": {"train": 0.9, "validate": 0.8}, "ties": [], "alike": {}}
    alone = describe_proposal(told, None)
    assert alone[0].startswith("proposed: a step of P, which explains 90% of")
    assert alone[1:] == ["it is not a function of the voltage: something happened by itself"]
    further = describe_proposal(
        {**told, "ties": [{"words": "a ramp of P"}], "alike": {"undervoltage_trip": 0.93}}, None
    )
    assert further[2:] == [
        "these events cannot tell it from a ramp of P",
        "looks like it: undervoltage_trip (93%)",
    ]


def test_without_a_held_out_event_no_term_is_searched():
    found = propose(SimpleNamespace(context=None), None, None, None, (), None)
    assert "none was held out" in found.why
