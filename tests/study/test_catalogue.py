"""The effects that some events can show, `build_catalogue`, with the members of their families, and
what an event lacks, `explain_missing_channel`.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import wave_records
from made_dips import base, events
from wave_records import case

from tractexp.configuration.plugin import discover, get
from tractexp.inference.catalogue import build_catalogue, explain_missing_channel
from tractexp.model.model import compose
from tractexp.record import convert_to_waves

MEMBERS = {name for name, cls in discover()["effect"].items() if cls.family}


def test_members_belong_to_the_effects_that_are_asked_for():
    made = events(count=1)

    def names(only):
        return {member.name for member in build_catalogue(base(), made, only).members}

    assert names(("magnetic_saturation",)) == {"saturation_curve"}
    assert names(("stator_resistance",)) == set()
    assert names(()) == MEMBERS


def test_a_member_is_no_candidate_of_the_first_search():
    missing = build_catalogue(base(), events(count=1))
    assert not {c.name for c in missing.candidates} & MEMBERS
    assert missing.textbook(("saturation_curve", "load_change")) == (
        "magnetic_saturation",
        "load_change",
    )


@pytest.mark.parametrize(("swing", "is_enough"), [(0.045, False), (0.055, True)])
def test_an_effect_of_the_frequency_is_tested_where_that_swings(swing, is_enough):
    """By a twentieth of a Hz."""
    record = SimpleNamespace(channels={"f": np.linspace(50.0, 50.0 + swing, 10)})
    event = SimpleNamespace(record=record, channels=("f",))
    told = explain_missing_channel(get("effect", "frequency_dependence")(), [event])
    assert ("moves by less than" not in (told or "")) == is_enough


def test_an_effect_that_makes_no_sense_of_waveforms_says_why():
    motor, static = get("model/motor", "stator_flux")(), get("model/static", "branch")()
    seed = 4, 0
    made = [convert_to_waves(event) for event in wave_records.events(case(seed, 1), seed)]
    named = "stator_resistance", "speed_dependent_torque"
    refused = build_catalogue(compose(motor, static, domain="waves"), made, named).untestable
    assert "R_s" in refused["stator_resistance"]
