"""Members of a family beside the textbook's effect: when one takes its place, `compare_members`,
and where their fits start, `list_member_starts` and `scatter_starts`.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from made_context import bench
from made_dips import base, events, investigate
from made_sets import fitted

from tractexp.discrepancy import families
from tractexp.discrepancy.families import (
    compare_members,
    is_worth,
    list_member_starts,
    open_settings,
)
from tractexp.inference.fitting import Refit
from tractexp.inference.wide_fit import scatter_starts

TRIPS = ("undervoltage_trip",)
CORE = ("magnetic_saturation", "stator_resistance")


def test_nothing_is_tried_where_nothing_is_missing(monkeypatch):
    monkeypatch.setattr(
        families, "refit_sets_widely", lambda *_: pytest.fail("a member was fitted")
    )
    assert investigate(events(), effects=("undervoltage_trip",)).verdict == "none"


def test_a_member_pays_for_its_further_parameters():
    """The same gain is worth one further parameter and not three; none where it is no better."""
    textbook = fitted(200.0, 1, "one")
    assert is_worth(fitted(178.0, 2, "other"), textbook, 1e-5)
    assert not is_worth(fitted(178.0, 4, "other"), textbook, 1e-5)
    assert not is_worth(fitted(201.0, 2, "other"), textbook, 1.0)


@pytest.mark.parametrize(("better", "named"), [(60.0, True), (99.0, False)])
def test_a_name_that_suffices_gives_way_to_a_member_that_explains_more_and_leaves_nothing(
    monkeypatch, better, named
):
    """Where it does not, the member is held against it: both may explain what is there."""
    at = bench(base(), events(), ("magnetic_saturation", "static_var_compensator"))
    refits = {f.names: f for f in (fitted(1000.0, 0), fitted(100.0, 4, "static_var_compensator"))}
    refits["magnetic_saturation",] = fitted(400.0, 1, "magnetic_saturation")
    told = SimpleNamespace(fit=refits["static_var_compensator",], noise=None, suffices=True)
    member = fitted(better, 4, "saturation_curve")
    monkeypatch.setattr(families, "list_member_starts", lambda *_: [])
    monkeypatch.setattr(families, "refit_sets_widely", lambda *_: [member])
    monkeypatch.setattr(
        families, "examine_fit", lambda quiet, fit, *_: SimpleNamespace(fit=fit, suffices=True)
    )
    tests, held_against = compare_members(SimpleNamespace(context=at, quiet=None), told, refits, 0)
    assert tests.fit is (member if named else told.fit)
    assert held_against == [member]


@pytest.mark.parametrize(
    ("deviance", "textbook_suffices", "member_suffices", "named"),
    [
        (395.0, False, True, True),  # its three further parameters cost as much as it explains
        (395.0, True, True, False),
        (395.0, False, False, False),
        (410.0, False, True, False),  # farther behind than what is refitted exactly
        (60.0, False, False, False),
    ],
)
def test_a_member_that_leaves_nothing_is_taken_where_a_textbook_effect_that_fits_alike_does_not(
    monkeypatch, deviance, textbook_suffices, member_suffices, named
):
    at = bench(base(), events(), ("magnetic_saturation",))
    refits = {f.names: f for f in (fitted(1000.0, 0), fitted(400.0, 1, "magnetic_saturation"))}
    member = fitted(deviance, 4, "saturation_curve")
    told = SimpleNamespace(
        fit=refits["magnetic_saturation",], noise=None, suffices=textbook_suffices
    )
    monkeypatch.setattr(families, "list_member_starts", lambda *_: [])
    monkeypatch.setattr(families, "refit_sets_widely", lambda *_: [member])
    monkeypatch.setattr(
        families,
        "examine_fit",
        lambda quiet, fit, *_: SimpleNamespace(fit=fit, suffices=member_suffices),
    )
    tests, held_against = compare_members(SimpleNamespace(context=at, quiet=None), told, refits, 0)
    assert tests.fit is (member if named else told.fit)
    assert held_against == ([member] if named or textbook_suffices else [])


def test_a_member_that_nests_the_textbook_starts_from_its_fit():
    """There it calculates what the textbook does, so that it can only fit better."""
    at = bench(base(), events(), CORE)
    unit = at.coordinates.null.copy()
    unit[at.coordinates.column["saturation"]] = at.coordinates.to_unit("saturation", 0.5)
    refits = {
        (): Refit((), at.coordinates.null, 0.0, 0),
        ("magnetic_saturation",): Refit(CORE[:1], unit, 0.0, 1),
    }
    member = at.catalogue["saturation_curve"]
    begun = [point for _, point in list_member_starts(at, member, refits)]
    assert len(begun) == len(open_settings(member, ("curve_saturation",)))
    textbook = at.residuals(unit[None], CORE[:1])[0]
    apart = [
        np.abs(at.residuals(point[None], (member.name,))[0] - textbook).max() for point in begun
    ]
    assert min(apart) < 1e-12
    assert max(apart) > 1e-4


def two_stages(share):
    """A bench with the trip in two stages, and the textbook's fit of such a share."""
    at = bench(base(), events(), TRIPS)
    unit = at.coordinates.place_values(
        at.coordinates.null, {"tripped_share": share, "trip_level": 0.8}
    )
    return at, {
        (): Refit((), at.coordinates.null, 0.0, 0),
        TRIPS: Refit(TRIPS, unit, 0.0, 6),
    }


def test_two_stages_begin_with_the_whole_of_one_or_with_halves():
    at, refits = two_stages(0.2)
    begun = [unit for _, unit in list_member_starts(at, at.catalogue["two_stage_trip"], refits)]
    shares = {
        tuple(round(at.coordinates.value(f"stage_{k}_tripped", u), 6) for k in (1, 2))
        for u in begun
    }
    assert shares == {(0.2, 0.02), (0.1, 0.1)}


def test_what_is_scattered_moves_all_times_and_no_size():
    at, refits = two_stages(0.2)
    ((names, unit), *_) = list_member_starts(at, at.catalogue["two_stage_trip"], refits)
    points = np.array([point for _, point in scatter_starts(at, Refit(names, unit, 0.0, 11))])
    moved = np.abs(points - unit)
    settings = at.coordinates.settings(names)
    still = np.setdiff1d(np.arange(len(unit)), settings)
    assert (moved[:, still] == 0).all()
    assert (points >= 0).all()
    assert (points <= 1).all()
    assert len(settings) == 9
    assert np.median((moved[:, settings] > 0).mean(axis=1)) == 1.0
    assert ((moved[:, settings] > 0.001) & (moved[:, settings] < 0.02)).any(axis=0).all()
    assert (moved[:, settings] > 0.1).any(axis=0).all()
    assert len(np.unique(points.round(9), axis=0)) == len(points)
