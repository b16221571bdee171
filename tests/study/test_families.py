"""Families of effects, as `investigate` names them: another place or another law where the
catalogue's leaves something, and only there.
"""

import dataclasses
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_context import bench
from made_dips import FAST, LOUD, base, events
from scipy.optimize import least_squares

import tractexp.discrepancy.investigate as investigating
from tractexp.configuration.plugin import discover, get
from tractexp.discrepancy import families, held_out, rival_sets
from tractexp.discrepancy.all_events import AllEvents, JointFit
from tractexp.discrepancy.decide import decide, find_adequate, holds
from tractexp.discrepancy.evidence import Evidence, SetEvidence, Verdict
from tractexp.discrepancy.explanations import worth_another
from tractexp.discrepancy.families import against_members, open_settings, starts, worth
from tractexp.discrepancy.forms import forms
from tractexp.discrepancy.gap import GapTest
from tractexp.discrepancy.held_out import assess
from tractexp.discrepancy.investigate import investigate
from tractexp.discrepancy.recommend import recommendation
from tractexp.errors import RefusedEffect, UserError
from tractexp.extend import Effect, Parameter, plugin
from tractexp.inference import fit_effort, wide_fit
from tractexp.inference.catalogue import catalogue
from tractexp.inference.criteria import Criteria
from tractexp.inference.effort import Effort
from tractexp.inference.fitting import Refit
from tractexp.inference.injection import PUSHES
from tractexp.inference.kernels import Family, Kernels
from tractexp.inference.linearization import tangent
from tractexp.inference.wide_fit import scatter_starts

pytestmark = pytest.mark.usefixtures("registry_as_it_was")

TRIPS = ("undervoltage_trip", "exponential_recovery")
CORE = ("magnetic_saturation", "stator_resistance")
NODE = {
    "motor": {"name": "electromechanical"},
    "static": {"name": "exponential"},
    "bounds": {},
    "fixed": {},
}
MEMBERS = sorted(name for name, cls in discover()["effect"].items() if cls.family)


def found(effect, size, seed, only):
    made = events(effect, size=size, seed=seed, count=3, recorder=FAST)
    return investigate(base(), made[:2], made[2:], {}, {}, only=only)


def test_the_catalogues_own_trip_keeps_its_name_beside_its_members():
    made = found("undervoltage_trip", 1.0, 800011, TRIPS[:1])
    assert made.names == ("undervoltage_trip",)
    ((_, form),) = forms(made)
    assert form["law"] == "catalogue"
    # the others are far behind after a few iterations
    assert ("two_stage_trip",) in made.explanations.refits


def test_nothing_is_tried_where_nothing_is_missing(monkeypatch):
    monkeypatch.setattr(families, "wide_refits", lambda *_: pytest.fail("a member was fitted"))
    assert found(None, 1.0, 3, TRIPS).verdict.word == "none"


class Narrow(Family):
    """A family in which effects `b` and `m` do not go together."""

    def with_effects(self, names):
        names = {*names}
        clashes = lambda more: {"b", "m"} <= {*names, *more}  # noqa: E731

        def compiled():
            if clashes(()):
                raise RefusedEffect("m", "the model has a state 'x' already")

        def acceptance(effect):
            return SimpleNamespace(
                refusal="the model has a state 'x' already" if clashes([effect.name]) else None
            )

        return SimpleNamespace(names=names, compile=compiled, acceptance=acceptance)


def narrow():
    some = type("", (dict,), {"of_load": ("a", "b", "c", "i"), "of_measurement": ()})
    effects = {
        n: SimpleNamespace(effect=SimpleNamespace(name=n, iterates=n == "i")) for n in "abcim"
    }
    return Narrow(None, some(effects))


def test_what_a_member_does_not_take_beside_it_is_not_tested_there():
    here = narrow()
    for names, tested in (((), "abc"), (("a", "b"), "abc"), (("m",), "acm")):
        assert here.build_model(here.key(names, beside="c")).names == {*tested}
    assert here.build_model(here.key(("m",), beside=PUSHES)).names == {"m", PUSHES}
    assert here.build_model(here.key(("m", "a"))).names == {"m", "a"}


def test_an_effect_that_iterates_and_the_pushes_are_simulated_by_themselves():
    """One such effect beside all others made each of their columns thirty times as dear."""
    here = narrow()
    assert here.key(("a",), beside="i") == ({"a"}, {"i"})
    assert here.key(("a", "i"), beside=PUSHES) == ({"a", "i"}, {PUSHES})
    # the same for all sets of cheap effects
    assert here.key(("a", "i"), beside="b") == ({"i"}, {"a", "b", "c"})


def fit(deviance, parameters, *names):
    return Refit(names, np.zeros(0), deviance, parameters)


def test_a_member_pays_for_its_further_parameters():
    """The same gain is worth one further parameter and not three; none where it is no better."""
    textbook = fit(200.0, 1, "one")
    assert worth(fit(178.0, 2, "other"), textbook, 1e-5)
    assert not worth(fit(178.0, 4, "other"), textbook, 1e-5)
    assert not worth(fit(201.0, 2, "other"), textbook, 1.0)


def test_a_trip_of_the_static_load_alone_is_told_by_its_family_and_its_place():
    """The relay's times have hardly a slope: a descent from the coarse grid alone ends far from
    what was hidden.
    """
    made = found("static_part_trip", 2.0, 820001, TRIPS[:1])
    assert made.verdict.word == "named"
    assert made.catalogue.textbook(made.names) == ("undervoltage_trip",)
    ((_, form),) = forms(made)
    assert (form["effect"], form["differs"]) == ("static_trip", "of the static load only")
    at = made.context.coordinates
    assert at.value("static_tripped", made.extended_fit.unit) == pytest.approx(0.2, abs=0.01)
    assert made.validate.explained_share > 0.9
    # its instants are no parameters of each event:
    there = tangent(made.context, made.extended_fit, made.evidence.noise)
    # of the relay the share alone
    assert len(there.split) == 2 * (len(at.base) - len(there.held) + 1)


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "size", "seed", "member"),
    [
        ("ramped_return", 2.0, 820034, "ramped_current"),
        ("thermostat_recovery", 2.0, 820061, "thermostatic_load"),
        ("link_voltage_control", 1.0, 820070, "limited_link"),
    ],
)
def test_a_law_that_the_textbook_has_not_is_told_by_its_family(hidden, size, seed, member):
    """A curve, a memory and a control; the judgement set has a data set of every other law."""
    textbook = get("effect", member).family
    made = found(hidden, size, seed, (textbook,))
    assert made.verdict.word == "named"
    ((name, form),) = forms(made)
    assert (name, form["effect"]) == (textbook, member)
    assert made.validate.explained_share > 0.9


@pytest.mark.long
def test_a_bounded_flux_is_a_saturation_with_a_round_corner():
    """How well one held-out event is met by a curve drawn beyond the fitted ones is chance: 0.9
    here.
    """
    made = events("froelich_saturation", size=1.8, seed=820081, count=4, noise=LOUD, recorder=FAST)
    told = investigate(base(), made[:3], made[3:], {}, {}, only=("magnetic_saturation",))
    ((_, form),) = forms(told)
    assert form["effect"] == "saturation_curve"
    assert told.context.coordinates.value("saturation_rounding", told.extended_fit.unit) > 0.1
    assert told.validate.explained_share > 0.85


@pytest.mark.parametrize(("better", "named"), [(60.0, True), (99.0, False)])
def test_a_name_that_suffices_gives_way_to_a_member_that_explains_more_and_leaves_nothing(
    monkeypatch, better, named
):
    """Where it does not, the member is held against it: both may explain what is there."""
    at = bench(base(), events(), ("magnetic_saturation", "static_var_compensator"))
    refits = {f.names: f for f in (fit(1000.0, 0), fit(100.0, 4, "static_var_compensator"))}
    refits["magnetic_saturation",] = fit(400.0, 1, "magnetic_saturation")
    told = SimpleNamespace(fit=refits["static_var_compensator",], noise=None, suffices=True)
    member = fit(better, 4, "saturation_curve")
    monkeypatch.setattr(families, "starts", lambda *_: [])
    monkeypatch.setattr(families, "wide_refits", lambda *_: [member])
    monkeypatch.setattr(
        families, "examine_fit", lambda quiet, fit, *_: SimpleNamespace(fit=fit, suffices=True)
    )
    tests, held_against = against_members(SimpleNamespace(context=at, quiet=None), told, refits, 0)
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
    refits = {f.names: f for f in (fit(1000.0, 0), fit(400.0, 1, "magnetic_saturation"))}
    member = fit(deviance, 4, "saturation_curve")
    told = SimpleNamespace(
        fit=refits["magnetic_saturation",], noise=None, suffices=textbook_suffices
    )
    monkeypatch.setattr(families, "starts", lambda *_: [])
    monkeypatch.setattr(families, "wide_refits", lambda *_: [member])
    monkeypatch.setattr(
        families,
        "examine_fit",
        lambda quiet, fit, *_: SimpleNamespace(fit=fit, suffices=member_suffices),
    )
    tests, held_against = against_members(SimpleNamespace(context=at, quiet=None), told, refits, 0)
    assert tests.fit is (member if named else told.fit)
    assert held_against == ([member] if named or textbook_suffices else [])


def test_the_chosen_set_comes_first_with_its_own_tests_though_another_fits_better(monkeypatch):
    """Of two that fit alike the one that asks for no further effect is chosen, and its tests are
    not the other's.
    """
    chosen, better, far = fit(104.0, 1, "chosen"), fit(100.0, 1, "better"), fit(300.0, 1, "far")
    bare = fit(1000.0, 0)
    rows = np.array([[0.0, 0.0], [2.0, 0.0], [14.0, 0.0]])
    at = SimpleNamespace(
        criteria=Criteria(),
        catalogue=SimpleNamespace(textbook=lambda names: names),
        effort=Effort(),
        coordinates=SimpleNamespace(parameters=lambda names: []),
        rows=lambda *_: rows,
    )
    monkeypatch.setattr(rival_sets, "refit_from", lambda *_: bare)
    monkeypatch.setattr(rival_sets, "refit", lambda *_: [better, chosen, far])
    monkeypatch.setattr(
        rival_sets, "examine_fit", lambda quiet, fit, *_, **__: SimpleNamespace(fit=fit, p_left=0.0)
    )
    last = SimpleNamespace(fit=chosen, noise=None, p_left=1.0)
    explained = SimpleNamespace(
        base=SimpleNamespace(context=at, quiet=None),
        last=last,
        chosen=chosen,
        faults=(),
        steps=[SimpleNamespace(fit=bare, p_left=0.0)],
        refits={f.names: f for f in (bare, better, chosen, far)},
    )
    evidence = rival_sets.compare_rivals(explained, 0)
    assert [
        (row.fit.names, row.behind, row.tests and row.tests.fit.names) for row in evidence.rows
    ] == [
        (("chosen",), 0.0, ("chosen",)),
        (("better",), -4.0, ("better",)),
        (("far",), 196.0, None),
    ]
    assert [row.fit.names for row in find_adequate(evidence, Criteria())] == [("chosen",)]


@pytest.mark.long
def test_a_knee_saturation_is_named_by_its_family_though_the_textbook_is_far_behind_a_compensator():
    # 4 detection limits
    made = events("knee_saturation", 0.46, 312360453, count=4, noise=LOUD, recorder=FAST)
    told = investigate(base(), made[:3], made[3:], {}, {}, only=("static_var_compensator", *CORE))
    refits = told.explanations.refits
    assert refits["magnetic_saturation",].deviance > refits["static_var_compensator",].deviance + 50
    assert told.verdict.sets == (("saturation_curve",),)


@pytest.mark.long
def test_a_place_that_the_textbooks_trip_imitates_is_named_where_the_held_out_dip_denies_that():
    """That of the whole load leaves nothing of the fitted dips; of the held-out one only that of
    the motors does.
    """
    made = events("motor_share_trip", 0.269, 762707680, count=4, noise=LOUD, recorder=FAST)
    told = investigate(base(), made[:3], made[3:], {}, {}, only=TRIPS[:1])
    assert (
        told.explanations.refits["undervoltage_trip",].deviance
        > told.explanations.refits["motor_trip",].deviance
    )
    assert told.names == ("motor_trip",)


def compared(costs, p_left=(1.0, 1.0), helps=(True, True)):
    """What becomes of two explanations that cost so much in a fit to all events, the base model
    500.
    """
    at = SimpleNamespace(
        criteria=Criteria(), events=(), catalogue=SimpleNamespace(textbook=lambda names: names)
    )
    fits = [fit(0.0, 1, name) for name in ("one", "other")]
    joint = [
        JointFit(replace(f, deviance=cost - 2), 10.0, p)
        for f, cost, p in zip(fits, costs, p_left, strict=True)
    ]
    both = SimpleNamespace(
        fitted=at,
        events=(),
        bare=fit(500.0, 0),
        plain=SimpleNamespace(cost=500.0),
        compare=lambda *_: joint,
        without_each=lambda fit: {},
        fit_to_all=lambda fits: fits,
    )
    gains = {f.names: 100.0 if good else -100.0 for f, good in zip(fits, helps, strict=True)}
    judged = lambda context, events, bare, fits: {  # noqa: E731
        f.names: GapTest(None, None, gains[f.names], 10.0, 100.0, 10.8, None) for f in fits
    }
    return both, [SetEvidence(f, f.names, f.names) for f in fits], judged


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
    monkeypatch.setattr(held_out, "compare_on", judged)
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
        fit(0.0, 2, "one", "other"),
        {"one": fit(200.0, 1, "other"), "other": fit(alone, 1, "one")},
    )
    joint = SimpleNamespace(fit=pair, p_left=1.0, louder=-1.0)
    both = SimpleNamespace(
        **{**vars(both), "without_each": lambda fit: fewer, "compare": lambda *_: [joint]}
    )

    def judged(context, events, bare, fits):
        gap = (gain, 0.0, expected) if bare.names == ("one",) else (200.0, 0.0, 200.0)
        return {f.names: GapTest(None, None, *gap, 10.8, None) for f in fits}

    monkeypatch.setattr(held_out, "compare_on", judged)
    (row,) = assess(both, [SetEvidence(pair, pair.names, pair.names)], 0)
    assert row.gap.outcome == "shown"
    assert [name for name, gap in row.without.items() if gap.outcome == "denied"] == needless
    assert holds(row, Criteria()) == (not needless)
    verdict = decide(
        Evidence(
            SetEvidence(fit(0.0, 0), (), (), p_left=0.0), (replace(row, behind=0.0, p_left=1.0),)
        ),
        Criteria(),
    )
    assert verdict.word == ("unexplained" if needless else "named" if gain >= 10.8 else "candidate")


@pytest.mark.parametrize(
    ("chosen", "rival", "kept"),
    [
        (1.0, 0.03, ["chosen", "rival"]),
        (1.0, 0.0008, ["chosen"]),  # it leaves something of all events
        (0.0008, 0.03, ["rival"]),
        (0.0008, 0.0008, []),
    ],
)
def test_an_explanation_is_kept_by_what_it_leaves_of_all_events(chosen, rival, kept):
    gap = GapTest(None, None, 100.0, 5.0, 100.0, 10.8, None)
    rows = [
        SetEvidence(
            fit(0.0, 1, name), (name,), (name,), behind=0.0, p_left=1.0, gap=gap, p_of_all=p
        )
        for name, p in (("chosen", chosen), ("rival", rival))
    ]
    verdict = decide(
        Evidence(SetEvidence(fit(0.0, 0), (), (), p_left=0.0), tuple(rows)), Criteria()
    )
    assert [row.names[0] for row in verdict.kept] == kept


@pytest.mark.parametrize(
    ("sets", "another"),
    [
        (((),), True),
        (((), ("a",)), True),
        (((), ("a",), ("a", "b")), False),
        # the pair led back to the same one: what follows would be the same search
        (((), ("a",), ("a",)), False),
        (((), ("a",), ("b",)), True),
    ],
)
def test_a_second_effect_is_tried_and_no_third(sets, another):
    assert (
        worth_another([SimpleNamespace(fit=fit(0.0, len(names), *names)) for names in sets])
        == another
    )


def test_a_start_that_may_overtake_the_best_is_searched_on(monkeypatch):
    """The best of them gains nothing; the other falls by 30 a turn, from 50 behind."""
    at = SimpleNamespace(coordinates=None)
    ways = {"still": [100.0] * 9, "falls": [150.0, 120.0, 90.0, 60.0, 60.0]}
    turns = []

    def descended(bench, noise, wanted, *_):
        turns.append(len(wanted))
        return [Refit(names, unit, ways[names[0]][len(turns) - 1], 0) for names, unit in wanted]

    monkeypatch.setattr(wide_fit, "run_descents", descended)
    monkeypatch.setattr(wide_fit, "_begin_fits", descended)
    monkeypatch.setattr(wide_fit, "moved_across", lambda bench, noise, fit, faults: fit.unit)
    ended = wide_fit._in_turns(
        at, None, [(("still",), np.zeros(1)), (("falls",), np.zeros(1))], None
    )
    assert (ended[0].names, ended[0].deviance) == (("falls",), 60.0)
    assert len(turns) == 1 + fit_effort.MOST_TURNS


@pytest.mark.long
@pytest.mark.usefixtures("no_proposal")
def test_what_only_the_held_out_dip_shows_is_named_by_a_fit_of_all_if_that_leaves_no_doubt(
    monkeypatch,
):
    """The relay trips there alone, and no event is left that the name would predict."""
    made = events("trip_in_two_stages", 0.09768, 1865577783, count=4, noise=LOUD, recorder=FAST)
    investigations, findings_of = [], investigating._findings

    def recorder(*given):
        investigations.append(findings_of(*given))
        return investigations[-1]

    monkeypatch.setattr(investigating, "_findings", recorder)
    told = investigate(base(), made[:3], made[3:], {}, {}, only=TRIPS[:1])
    doubtful, of_all = investigations
    assert told.names == of_all.names == ("undervoltage_trip",)
    assert told.verdict.word == "candidate"
    assert told.closes_share
    assert "only all events together show it, so all were fitted, and " in told.reason
    assert told.fitted_to_both
    assert not of_all.fitted_to_both
    assert (len(told.context.events), told.withheld, told.validate) == (4, (), None)
    assert doubtful.first.adequate
    assert doubtful.verdict.word == "unexplained"
    assert (
        "the fitted events alone show no disagreement, but all events together do"
        in doubtful.reason
    )
    assert recommendation(doubtful) == "fit the held-out events, too (data.train)"
    assert (
        doubtful.final_grade.adequacy.grade == "adequate"
    )  # what it is of the fitted events, as an identification says
    swapped = investigate(base(), made[1:], made[:1], {}, {}, only=TRIPS[:1])
    assert swapped.names == ("undervoltage_trip",)
    assert not swapped.fitted_to_both


@pytest.mark.parametrize(
    ("word", "closes", "chosen"),
    [
        ("unexplained", True, "of all"),
        ("unexplained", False, "as asked"),
        ("named", True, "as asked"),
    ],
)
def test_all_events_are_fitted_where_nothing_is_named_and_their_name_closes_a_share(
    monkeypatch, word, closes, chosen
):
    """A name that predicts the held-out events is kept: that of all events predicts none."""
    # so that no term is sought
    mild = SetEvidence(None, (), (), gap=GapTest(None, None, 1.0, 0.0, 1.0, 10.8, None))
    held = Evidence(SetEvidence(None, (), (), p_of_all=0.0), (mild,))
    empty = dict.fromkeys(item.name for item in dataclasses.fields(investigating.Findings))

    def findings_of(base, validate, seed, grader):
        found = {
            "evidence": held,
            "by_likelihood": held,
            "verdict": Verdict(word, (), complete=False),
        }
        return investigating.Findings(
            **empty | found | {"withheld": "as asked" if validate else "of all"}
        )

    monkeypatch.setattr(investigating.Findings, "closes_share", closes)
    monkeypatch.setattr(investigating.Findings, "base_values", None)
    monkeypatch.setattr(Kernels, "too_coarse", lambda *_: False)
    monkeypatch.setattr(investigating, "base_fit", lambda context: None)
    monkeypatch.setattr(investigating, "_findings", findings_of)
    made = events(count=2)
    told = investigate(base(), made[:1], made[1:], {}, {}, only=TRIPS[:1])
    assert told.withheld == chosen
    assert bool(told.all_fitted) == (chosen == "of all")


def test_nothing_is_asked_of_all_events_where_the_base_model_cannot_run_before_the_held_out_ones():
    stalled = SimpleNamespace(plain=SimpleNamespace(deviance=np.inf))
    assert AllEvents.p_left(stalled, (), 0) == 1.0


def test_members_belong_to_the_effects_that_are_asked_for():
    made = events(count=1)
    names = lambda only: {m.name for m in catalogue(base(), made, only).members}  # noqa: E731
    assert names(("magnetic_saturation",)) == {"saturation_curve"}
    assert names(("stator_resistance",)) == set()
    assert names(()) == set(MEMBERS)


def test_a_member_is_no_candidate_of_the_first_search():
    missing = catalogue(base(), events(count=1))
    assert not {c.name for c in missing.candidates} & set(MEMBERS)
    assert missing.textbook(("saturation_curve", "load_change")) == (
        "magnetic_saturation",
        "load_change",
    )


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
    begun = [point for _, point in starts(at, member, refits)]
    assert len(begun) == len(open_settings(member, ("curve_saturation",)))
    textbook = at.residuals(unit[None], CORE[:1])[0]
    apart = [
        np.abs(at.residuals(point[None], (member.name,))[0] - textbook).max() for point in begun
    ]
    assert min(apart) < 1e-12
    assert max(apart) > 1e-4


def two_stages(share):
    """A bench with the trip in two stages, and the textbook's fit of such a share."""
    at = bench(base(), events(), TRIPS[:1])
    unit = at.coordinates.place_values(
        at.coordinates.null, {"tripped_share": share, "trip_level": 0.8}
    )
    return at, {
        (): Refit((), at.coordinates.null, 0.0, 0),
        TRIPS[:1]: Refit(TRIPS[:1], unit, 0.0, 6),
    }


def test_two_stages_begin_with_the_whole_of_one_or_with_halves():
    at, refits = two_stages(0.2)
    begun = [unit for _, unit in starts(at, at.catalogue["two_stage_trip"], refits)]
    shares = {
        tuple(round(at.coordinates.value(f"stage_{k}_tripped", u), 6) for k in (1, 2))
        for u in begun
    }
    assert shares == {(0.2, 0.02), (0.1, 0.1)}


def test_what_is_scattered_moves_all_times_and_no_size():
    at, refits = two_stages(0.2)
    ((names, unit), *_) = starts(at, at.catalogue["two_stage_trip"], refits)
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
