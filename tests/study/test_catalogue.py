"""The effects that some events can show, `catalogue`, with the members of their families."""

from made_dips import base, events

from tractexp.configuration.plugin import discover
from tractexp.inference.catalogue import catalogue

MEMBERS = {name for name, cls in discover()["effect"].items() if cls.family}


def test_members_belong_to_the_effects_that_are_asked_for():
    made = events(count=1)
    names = lambda only: {m.name for m in catalogue(base(), made, only).members}  # noqa: E731
    assert names(("magnetic_saturation",)) == {"saturation_curve"}
    assert names(("stator_resistance",)) == set()
    assert names(()) == MEMBERS


def test_a_member_is_no_candidate_of_the_first_search():
    missing = catalogue(base(), events(count=1))
    assert not {c.name for c in missing.candidates} & MEMBERS
    assert missing.textbook(("saturation_curve", "load_change")) == (
        "magnetic_saturation",
        "load_change",
    )
