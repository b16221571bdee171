"""Which load a record is of: one object that console, pages, result.json and MLflow say."""

import dataclasses

import numpy as np

import tractexp
from tractexp.api.setup import describe_records
from tractexp.record import Base, Record, detect
from tractexp.record.identity import (
    UNKNOWN,
    Identity,
    compose_title,
    describe_identities,
    label,
    list_distinct,
)
from tractexp.record.record import LOAD

SOURCE = {
    "station": "North",
    "device": "R1",
    "load": "T2",
    "voltages": "Ua, Ub, Uc",
    "currents": "Ia, Ib, Ic",
    "time": "2023-05-12T19:45:25",
}


def record(number=1, **changes):
    t = np.arange(400) / 500
    U = np.where((t > 0.3) & (t < 0.5), 0.7, 1.0)
    made = Record(
        f"north_dip{number}",
        t,
        U,
        U**2,
        0.5 * U**2,
        base=Base(110.0, 30.2, 50.0, LOAD),
        source=f"north.cfg dip {number}",
        identity=SOURCE,
    )
    return dataclasses.replace(made, **changes)


def test_an_identity_says_all_that_is_known_in_one_line():
    told = str(Identity.from_record(record()))
    assert told == (
        "north.cfg dip 1; station North; device R1; load T2; voltages Ua, Ub, Uc; currents Ia, Ib,"
        " Ic;"
        " time 2023-05-12T19:45:25; per unit of 110 kV and 30.2 MVA"
    )


def test_an_identity_comes_back_from_result_json():
    first = Identity.from_record(record(original_base=Base(110.0, 100.0)))
    assert first.to_dict()["given_base"]["power_MVA"] == 100.0
    assert Identity.from_content({"name": "north", "role": "train", **first.to_dict()}) == first
    assert Identity.from_content({"name": "of an early version"}).label == ""


def test_a_base_that_nobody_told_is_said_to_be_unknown():
    told = str(Identity.from_record(record(base=Base(), identity={}, source="dip.csv")))
    assert told == f"dip.csv; {UNKNOWN}"
    assert str(Identity.from_record(record(base=Base(), identity={}, source=""))) == ""


def test_what_is_unknown_of_several_records_is_said_once_with_those_it_concerns():
    known = Identity.from_record(record())
    one, other = (
        Identity.from_record(record(base=Base(), identity={}, source=f"{name}.csv"))
        for name in "ab"
    )
    assert describe_identities([one, one]) == [f"a.csv; {UNKNOWN}"]
    assert describe_identities([one, other]) == ["a.csv", "b.csv", f"{UNKNOWN} of each"]
    assert describe_identities([one, known, other])[-1] == f"{UNKNOWN} of a.csv, b.csv"
    assert describe_identities([known, one]) == [str(known.recording), str(one)]


def test_dips_of_one_recording_are_one_load():
    identities = [Identity.from_record(record(k)) for k in (1, 2)]
    assert [one.dip for one in identities] == ["dip 1", "dip 2"]
    assert len(list_distinct(identities)) == 1
    assert (label(identities), compose_title(identities, ["a", "b"])) == (
        "North, T2",
        "North, T2: a, b",
    )
    assert compose_title([], ["a"]) == "a"


def test_the_console_says_of_each_recording_once_what_it_is_of():
    lines = [*describe_records([detect(record(1)), detect(record(2))], [])]
    assert [line for line in lines if "MVA" in line] == [
        f"  record: {Identity.from_record(record()).recording}"
    ]
    assert lines[0].startswith("fit: north_dip1")


def test_a_load_chosen_by_its_channels_is_named_all_the_same():
    """The command that `tractexp look` prints chooses channels, not a load."""
    (event,) = tractexp.read("tibet_50pct_comtrade")
    assert event.record.identity["load"] == "V/v 27.5 kV"
    assert event.record.identity["voltages"] == "UAB, UBC"
    assert event.record.identity["time"] == "2024-01-01T00:00:00"
