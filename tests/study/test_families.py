"""Families of effects: another place or another law where the catalogue's leaves something, and
only there.
"""

import numpy as np
import pytest
from made_dips import FAST, LOUD, events, investigate
from scipy.optimize import least_squares

from hidden_effects import Recorder
from tractexp.configuration.plugin import discover, get
from tractexp.errors import UserError
from tractexp.extend import Effect, Parameter, plugin

pytestmark = pytest.mark.usefixtures("registry_as_it_was")

TRIP = ("undervoltage_trip",)
CORE = ("magnetic_saturation", "stator_resistance")
SHORT = Recorder(rate=250.0, samples=350)
MEMBERS = sorted(name for name, cls in discover()["effect"].items() if cls.family)


def find(effect, size, seed, effects, recorder=FAST):
    """What is found of two dips with an effect and one held out, where few are tested."""
    made = events(effect, size=size, seed=seed, count=3, recorder=recorder)
    return investigate(made[:2], made[2:], effects)


def test_the_catalogues_own_trip_keeps_its_name_beside_its_members():
    made = events("undervoltage_trip", seed=800011, recorder=SHORT)
    found = investigate(made, effects=TRIP)
    assert (found.names, found.members) == (TRIP, TRIP)
    assert found.forms["undervoltage_trip"]["law"] == "catalogue"
    # the others are far behind after a few iterations
    assert ("two_stage_trip",) in found.steps.explanations.refits


def test_a_trip_of_the_static_load_alone_is_told_by_its_family_and_its_place():
    """The relay's times have hardly a slope: a descent from the coarse grid alone ends far from
    what was hidden.
    """
    found = find("static_part_trip", 2.0, 820001, TRIP, SHORT)
    assert (found.verdict, found.names, found.members) == ("named", TRIP, ("static_trip",))
    assert found.forms["undervoltage_trip"]["differs"] == "of the static load only"
    assert found.content["parameters"]["static_tripped"]["value"] == pytest.approx(0.2, abs=0.01)
    assert found.gap.validate.closed > 0.9


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "size", "seed", "member", "word"),
    [
        # the time of its ramp rests on a bound
        ("ramped_return", 2.0, 820034, "ramped_current", "candidate"),
        ("thermostat_recovery", 2.0, 820061, "thermostatic_load", "named"),
        ("link_voltage_control", 1.0, 820070, "limited_link", "named"),
    ],
)
def test_a_law_that_the_textbook_has_not_is_told_by_its_family(hidden, size, seed, member, word):
    """A curve, a memory and a control; the judgement set has a data set of every other law."""
    textbook = get("effect", member).family
    found = find(hidden, size, seed, (textbook,))
    assert (found.verdict, found.names, found.members) == (word, (textbook,), (member,))
    assert found.gap.validate.closed > 0.9


@pytest.mark.long
def test_a_bounded_flux_is_a_saturation_with_a_round_corner():
    """How well one held-out event is met by a curve drawn beyond the fitted ones is chance: 0.9
    here.
    """
    made = events("froelich_saturation", size=1.8, seed=820081, count=4, noise=LOUD, recorder=FAST)
    found = investigate(made[:3], made[3:], ("magnetic_saturation",))
    assert found.members == ("saturation_curve",)
    assert found.content["parameters"]["saturation_rounding"]["value"] > 0.1
    assert found.gap.validate.closed > 0.85


@pytest.mark.long
def test_a_knee_saturation_is_named_by_its_family_though_the_textbook_is_far_behind_a_compensator():
    # 4 detection limits
    made = events("knee_saturation", 0.46, 312360453, count=4, noise=LOUD, recorder=FAST)
    found = investigate(made[:3], made[3:], ("static_var_compensator", *CORE))
    refits = found.steps.explanations.refits
    assert refits["magnetic_saturation",].deviance > refits["static_var_compensator",].deviance + 50
    assert found.members == ("saturation_curve",)


@pytest.mark.long
def test_a_place_that_the_textbooks_trip_imitates_is_named_where_the_held_out_dip_denies_that():
    """That of the whole load leaves nothing of the fitted dips; of the held-out one only that of
    the motors does.
    """
    made = events("motor_share_trip", 0.269, 762707680, count=4, noise=LOUD, recorder=FAST)
    found = investigate(made[:3], made[3:], TRIP)
    refits = found.steps.explanations.refits
    assert refits["undervoltage_trip",].deviance > refits["motor_trip",].deviance
    assert found.members == ("motor_trip",)


@pytest.mark.long
@pytest.mark.usefixtures("no_proposal")
def test_what_only_the_held_out_dip_shows_is_named_by_a_fit_of_all_if_that_leaves_no_doubt():
    """The relay trips there alone, and no event is left that the name would predict."""
    made = events("trip_in_two_stages", 0.09768, 1865577783, count=4, noise=LOUD, recorder=FAST)
    found = investigate(made[:3], made[3:], TRIP)
    assert (found.verdict, found.names) == ("candidate", TRIP)
    assert "only all events together show it, so all were fitted, and " in found.reason
    assert found.gap.fitted_to_both
    swapped = investigate(made[1:], made[:1], TRIP)
    assert swapped.names == TRIP
    assert not swapped.gap.fitted_to_both


def test_a_place_or_a_kind_that_there_is_not_is_refused_with_the_nearest():
    about = {
        "__doc__": "a = b. Source: here.",
        "__module__": "elsewhere.stranger",
        "__annotations__": {},
    }
    for told, sentence in (
        ({"places": ("statc P",)}, "did you mean 'static P'"),
        ({"kind": "lags"}, "mean 'lag'"),
    ):
        size = {"a": Parameter(0.0, (0.0, 1.0), "1", "size", "here", null=0.0)}
        made = type("Stranger", (Effect,), about | size | {"edit": lambda self, eq, a: None} | told)
        with pytest.raises(UserError, match=sentence):
            plugin(made)


@pytest.mark.parametrize(
    ("rounding", "least", "most"), [((0.01, 0.6), 0.0, 0.001), ((0.03, 0.0301), 0.005, 0.01)]
)
def test_a_well_rounded_corner_follows_a_bounded_flux(rounding, least, most):
    """Froelich's psi = a i / (b + i) with 0.7 of a before the dip; a sharp corner is ten times as
    far from it.
    """
    names = ("curve_saturation", "saturation_bend", "saturation_corner", "saturation_rounding")
    effect = get("effect", "saturation_curve")()

    def off(values):
        law = effect.curve(flux_depth=1.0, **dict(zip(names, values, strict=True)))
        return law.y - ((1 - 0.7) / (1 - 0.7 * np.sqrt(1 - law.x)) - 1)

    bounds = np.array(
        [*({p.name: p.bounds for p in effect.parameters}[n] for n in names[:3]), rounding]
    ).T
    found = least_squares(off, [1.0, -1.0, 0.2, np.mean(rounding)], bounds=bounds)
    assert least < np.abs(found.fun).max() < most


@pytest.mark.parametrize(
    "name",
    [
        n
        for n in MEMBERS
        if get("effect", n)().curve(**{p.name: p.default for p in get("effect", n)().parameters})
        is not None
    ],
)
def test_every_curve_is_monotone_whatever_its_bends(name):
    effect, rng = get("effect", name)(), np.random.default_rng(1)
    for _ in range(20):
        law = effect.curve(**{p.name: rng.uniform(*p.bounds) for p in effect.parameters})
        slopes = np.diff(law.y)
        assert (slopes <= 1e-9).all() or (slopes >= -1e-9).all()
