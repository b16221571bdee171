"""What to record next, `next_event`: the chances are those of the product's own decision, and what
is recommended ends a tie.

The events come from the independent generator of `tests/oracle/hidden_effects`. The study over many
ties, which counts how often the predicted chances come true, is `benchmarks/next_event.py`.
"""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import next_event as study
import numpy as np
import pytest
from made_dips import base

import tractexp
from hidden_effects import Case, Noise
from hidden_effects.generator import scene
from independent import Dip
from tractexp.discrepancy.classes import compare_predictions, describe_classes, group_alike
from tractexp.discrepancy.decide import CONFIRMED_SHARE
from tractexp.discrepancy.discrepancy_json import content
from tractexp.discrepancy.evidence import SLIGHT_ERROR
from tractexp.discrepancy.investigate import investigate
from tractexp.discrepancy.next_event import rivals
from tractexp.discrepancy.next_event.choose import DECIDED, LEAST_CHANCE, EventTrial, next_event
from tractexp.discrepancy.next_event.imagined import ImaginedDip, as_recorded, imagine_dips
from tractexp.discrepancy.next_event.same import same
from tractexp.discrepancy.next_event.separation import (
    EventView,
    Separation,
    _reduce_blocks,
    linearize_side,
    seen,
)
from tractexp.domain import PHASORS
from tractexp.errors import UserError
from tractexp.extend import Effect, Parameter, sites
from tractexp.inference.base_fit import base_fit
from tractexp.inference.catalogue import Catalogue, candidate, catalogue
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.effort import Effort
from tractexp.inference.fitting import refit
from tractexp.inference.records import Records
from tractexp.record import Record, detect

TIE = ("feeder_impedance", "speed_dependent_torque")
MILD = (Dip(depth=0.32, start=0.5, duration=0.14), Dip(depth=0.33, start=0.5, duration=0.22))
NOISE, SEED = Noise(0.004), 931034


class LeakageLoss(Effect):
    """The stator's resistance told as a share of the leakage reactance: the same equation in
    another parameter.
    """

    name = "leakage_loss"
    loss = Parameter(
        0.0, (-0.2, 1.5), "1", "resistance over reactance of the stator", "a test", null=0.0
    )
    parameters = (loss,)
    places, kind = ("stator impedance",), "law"

    def edit(self, eq, loss):
        from sympy import I

        eq.edit(sites.stator_impedance, lambda Z: Z - I * loss * Z)


def hidden(*dips, effect="speed_dependent_torque", size=0.9):
    return scene(Case(effect, size, events=dips, noise=NOISE), SEED)


def recorded(made):
    noisy = [
        NOISE.add(r, np.random.default_rng([SEED, 2, k])) for k, r in enumerate(made.records())
    ]
    return [
        detect(Record(f"event{k}", **r, source=f"made {k}").check()) for k, r in enumerate(noisy, 1)
    ]


def judged(events):
    return investigate(base(), events, (), {}, {}, only=TIE)


@pytest.fixture(scope="module")
def tied():
    return judged(recorded(hidden(*MILD)))


@pytest.fixture(scope="module")
def alike():
    """A bench of three effects, of which two are one, fitted to events with stator resistance."""
    events, model = recorded(hidden(*MILD, effect="stator_resistance", size=1.0)), base()
    known = catalogue(model, events, ("stator_resistance", "speed_dependent_torque"))
    bench = Context.from_records(
        model,
        Catalogue((*known.candidates, candidate(LeakageLoss())), {}),
        Records.from_events(events),
        {},
        {},
        Criteria(),
        Effort(),
    )
    found, at = base_fit(bench), bench.coordinates
    starts = []
    for name, label, value in (
        ("stator_resistance", "R_s", 0.01),
        ("leakage_loss", "loss", 0.05),
        ("speed_dependent_torque", "quadratic_share", 0.2),
    ):
        starts.append(((name,), found.fit.unit.copy()))
        starts[-1][1][at.column[label]] = at.to_unit(label, value)
    fits = refit(bench, found.noise, starts)
    bare = refit(bench, found.noise, [((), found.fit.unit)])[0]
    return bench, found.noise, bare, {f.names[0]: f for f in fits}


def test_two_rivals_tie_and_the_recommended_event_ends_the_tie(tied):
    assert tied.verdict.word == "tied"
    assert {names for (names,) in tied.verdict.sets} == set(TIE)
    chosen = tied.next_event
    assert chosen.probability >= DECIDED
    assert chosen.sentence().startswith(f"record {chosen.best.event.words}: it tells ")
    event = chosen.best.event
    dip = Dip(
        depth=event.depth,
        start=0.5,
        duration=event.duration,
        fall=PHASORS.dips.edge,
        rise=PHASORS.dips.edge,
    )
    made = hidden(*MILD)
    more = replace(made, dips=(*made.dips, dip), static=(*made.static, made.static[0]))
    after = judged(recorded(more))
    # no event was held out: each is left out in turn
    is_confirmed = after.verdict.kept[0].replicated_share >= CONFIRMED_SHARE
    assert after.verdict.word == ("named" if is_confirmed else "candidate")
    assert after.names == ("speed_dependent_torque",)


def test_what_is_recommended_stands_in_what_machines_read(tied):
    told = json.loads(json.dumps(content(tied)))
    assert told["recommendation"] == told["next_event"]["sentence"]
    chances = told["next_event"]["recommended"]
    assert chances["probability"] == min(chances["by_truth"].values())
    assert set(chances["by_truth"]) == set(TIE)
    assert {"words", "depth", "duration", "probability"} <= told["next_event"]["tried"][0].keys()


def test_what_is_tied_is_classes_with_the_dip_from_which_they_part(tied):
    told = content(tied)["classes"]
    assert [tuple(names) for one in told for names in one["sets"]] == [*tied.verdict.sets]
    assert len(told) == 1 or all(one["by"] > SLIGHT_ERROR for one in told)
    assert tied.reason.endswith(describe_classes(tied.effect_classes))
    assert f"; {len(told)} class" in tied.reason or "; one class" in tied.reason


def test_sets_that_are_one_function_of_the_voltage_are_one_class(alike):
    """Beside them another effect is a class of its own, from the mildest dip on in which it differs
    from either.
    """
    bench, _, _, fits = alike
    every = [fits[name] for name in ("stator_resistance", "speed_dependent_torque", "leakage_loss")]
    pair = [every[0], every[2]]
    (one,) = compare_predictions(bench, pair, [fit.names for fit in pair], 0.0)
    assert one.part_at is None
    assert one.by < SLIGHT_ERROR
    assert describe_classes([one]).startswith("one class: they predict alike within ")
    both, other = compare_predictions(bench, every, [fit.names for fit in every], 0.0)
    assert both.sets == (("stator_resistance",), ("leakage_loss",))
    assert other.sets == (("speed_dependent_torque",),)
    assert both.part_at == other.part_at
    told = describe_classes([both, other])
    assert told.startswith("2 classes: they predict alike in milder dips, and part by ")
    assert told.endswith("; no dip tried parts stator_resistance and leakage_loss")


def test_each_joins_the_first_group_of_which_it_is_parted_from_none():
    parted = np.zeros((4, 4), bool)
    parted[0, 1] = parted[1, 0] = parted[3, 2] = parted[2, 3] = True
    assert group_alike(parted) == [[0, 2], [1, 3]]


def test_an_equation_in_another_parameter_is_proved_to_be_the_same(alike):
    bench, noise, bare, fits = alike
    pair = fits["stator_resistance"], fits["leakage_loss"]
    proof = same(bench, *pair)
    assert proof["off"] < 1e-6
    assert proof["rank"] == len(bench.coordinates.base) + 1
    chosen = next_event(bench, noise, bare, pair, ["copper", "loss"])
    assert [(a, b) for a, b, _ in chosen.same] == [(0, 1)]
    assert chosen.sentence().startswith(
        "copper and loss cannot be told apart by any dip at this bus: over "
    )
    assert chosen.probability < 0.05


def test_effects_that_only_look_alike_are_not_called_the_same(alike, tied):
    bench, _, _, fits = alike
    assert same(bench, fits["stator_resistance"], fits["speed_dependent_torque"]) is None
    assert not tied.next_event.same
    assert "cannot be told apart" not in tied.next_event.sentence()


def test_a_rival_is_linearised_as_its_refit_moves(alike):
    """What a rival gains and loses by one mild event more is, linearised, what a refit of all
    parameters finds.
    """
    bench, noise, bare, fits = alike
    truth, rival, event = (
        fits["stator_resistance"],
        fits["speed_dependent_torque"],
        ImaginedDip(0.1, 0.2),
    )
    sides = [linearize_side(bench, noise, fit) for fit in (bare, truth, rival)]
    views = [seen(bench, noise, side, [event])[0] for side in sides]
    separation = Separation(sides, bench.criteria)
    rows = _reduce_blocks([np.vstack([v.f - views[0].f, v.K]) for v in views])
    from tractexp.discrepancy.next_event.choose import _fitted_to

    linear = separation._deviance(2, (rows[2][0] - rows[1][0])[None], rows[2][1:])
    exact = separation._deviance(1, np.zeros((1, len(rows[1][0]))), rows[1][1:])
    moved = _fitted_to(bench, noise, sides, sides[1], event)[2]
    refitted = moved.deviance - truth.deviance
    assert float(exact[0]) == pytest.approx(truth.deviance, rel=1e-3)
    assert float(linear[0]) - truth.deviance == pytest.approx(refitted, rel=0.15, abs=1.0)


def test_rows_are_reduced_without_loss():
    rng = np.random.default_rng(1)
    blocks = [rng.normal(size=(3, 40)), rng.normal(size=(5, 40))]
    made = _reduce_blocks(blocks)
    assert [b.shape for b in made] == [(3, 8), (5, 8)]
    assert np.concatenate(made) @ np.concatenate(made).T == pytest.approx(
        np.concatenate(blocks) @ np.concatenate(blocks).T
    )


def test_a_set_is_not_told_from_itself_whatever_the_recorder_did(alike):
    """Skew and drift of two fits say nothing of the load."""
    bench, noise, bare, fits = alike
    fit, at = fits["stator_resistance"], bench.coordinates
    unit = fit.unit.copy()
    unit[at.parameters(["time_skew", "load_change"])] += 0.1
    sides = [linearize_side(bench, noise, f) for f in (bare, fit, replace(fit, unit=unit))]
    event = ImaginedDip(0.5, 0.4)
    own, other = (seen(bench, noise, side, [event])[0].f for side in sides[1:])
    assert other == pytest.approx(own, abs=1e-9)


def test_what_a_model_does_not_survive_tells_nothing(alike):
    bench, noise, bare, fits = alike
    sides = [
        linearize_side(bench, noise, f)
        for f in (bare, fits["stator_resistance"], fits["leakage_loss"])
    ]
    lost = EventView(np.full(10, np.nan), np.zeros((3, 10)))
    assert not Separation(sides, bench.criteria).find_denied_rivals([lost] * 3, 1).any()


def test_dips_switching_phase_jumps_and_rates_are_tried(alike):
    bench = alike[0]
    events = imagine_dips(bench)
    assert {e.switched for e in events} == {True, False}
    assert {np.sign(e.jump) for e in events} == {-1.0, 0.0, 1.0}
    assert {e.rate for e in events} == {1, 4}
    assert not any(e.unbalance for e in events)
    assert any(e.unbalance for e in imagine_dips(bench, ["U2"]))
    assert "with the frequency f" in ImaginedDip(0.3, 0.1, jump=20.0).words
    assert "tap or a capacitor bank" in ImaginedDip(0.04, 1.0, switched=True).words


def test_the_smallest_switching_is_an_event_that_can_be_read(alike):
    bench = alike[0]
    made = as_recorded(bench, ImaginedDip(0.04, 1.0, switched=True), np.ones((2, 1400)))
    again = detect(replace(made.record, name="switched").check())
    assert again.depth == pytest.approx(0.04, abs=0.005)
    assert again.duration == pytest.approx(1.0, abs=0.1)


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


def test_a_rival_is_an_effect_of_the_load_that_the_events_can_show():
    missing = SimpleNamespace(
        untestable={"negative_sequence_braking": "no U2"}, of_load=("stator_resistance",)
    )
    assert rivals._check(missing, ["stator_resistance"]) is None
    for name, why in (
        ("negative_sequence_braking", "cannot be tested here: no U2"),
        ("time_skew", "by the catalogue"),
    ):
        with pytest.raises(UserError, match=why):
            rivals._check(missing, ["stator_resistance", name])


def test_a_plan_for_rivals_says_what_an_investigation_says(tied, tmp_path):
    made = tractexp.plan(
        list(tied.context.records.recorded),
        model="third_order_exponential",
        rivals=TIE,
        progress=False,
    )
    assert made.probability == pytest.approx(tied.next_event.probability, abs=0.05)
    assert made.sentence.startswith("record a dip of")
    paths = made.write(tmp_path)
    assert {p.name for p in paths} == {"plan.json", "plan.html"}
    page = (tmp_path / "plan.html").read_text()
    assert "What to record next" in page
    told = json.loads((tmp_path / "plan.json").read_text())
    assert told["sentence"] == made.sentence
    assert isinstance(tied.next_event.best, EventTrial)


def test_the_docs_report_what_the_stored_study_holds():
    root = Path(__file__).parents[2]
    rows = json.loads((root / "benchmarks" / "next_event.json").read_text())["rows"]
    docs = (root / "docs" / "coverage.md").read_text()
    part = docs.partition("<!-- next event -->")[2].partition("<!-- end of next event -->")[0]
    assert part.strip() == study.table(rows)


def test_what_rivals_miss_is_missed_in_each_of_its_like(alike):
    """Twenty events of one kind leave one rival of noise alone; of a model's error they do not."""
    bench, noise, bare, fits = alike
    rivals = fits["stator_resistance"], fits["speed_dependent_torque"]
    sides = [linearize_side(bench, noise, fit) for fit in (bare, *rivals)]
    separation, event = Separation(sides, Criteria(), 200), ImaginedDip(0.4, 0.2)

    def chance(error, times):
        views = [seen(bench, noise, side, [event], error)[0] for side in sides]
        denied = np.stack([separation.find_denied_rivals(views, truth, times) for truth in (1, 2)])
        return EventTrial.from_draws(event, denied, np.zeros((2, 2), bool)).least

    assert chance(0.0, 20) > DECIDED
    assert chance(1.0, 20) < LEAST_CHANCE
    assert chance(1.0, 2000) == chance(1.0, 20)
