"""An investigation of waveforms: what is planted is named and closes the gap held out, what is not
there is not; what `next_event` and `propose` make of waveforms.

Records come from the independent generator of `tests/oracle/independent`: other equations, another
solver, noise of the voltage and of the currents, offsets, quantization.
"""

import json
import runpy
from dataclasses import replace

import numpy as np
import pytest
from wave_records import case, events

import tractexp
from tractexp.discrepancy.next_event.choose import find_next_event
from tractexp.discrepancy.proposal.library import find_term
from tractexp.discrepancy.proposal.propose import propose
from tractexp.discrepancy.remainder import find_remainders
from tractexp.errors import UserError
from tractexp.model.model import compose
from tractexp.report import overlay

# Nothing but noise is left. Its level is estimated from quiet stretches; the later ones are louder
# by noise that the machine's fluxes have summed up, and edges of the voltage are left open:
# chi-squared is 0.77 where nothing is missing.
QUIET, LOUD = 0.75, 1.15
FEW = ("shunt_capacitor", "speed_dependent_torque")
SEED, RATE, FAN = (4, 0), 3200.0, 0.9  # samples per second, share of the torque


def dips(fan=0.0):
    """Two dips of one load, whose torque falls with the speed in part."""
    made = case(SEED, 2)
    site = replace(made.site, group=replace(made.site.group, fan=fan))
    return events(replace(made, site=site, sampler=replace(made.sampler, rate=RATE)), SEED)


@pytest.fixture(scope="module")
def given():
    return dips(FAN)


@pytest.fixture(scope="module")
def planted(given):
    return tractexp.investigate(
        given[:1], validate=given[1:], domain="waves", effects=FEW, progress=False
    )


@pytest.fixture(scope="module")
def silent():
    made = dips()
    return tractexp.investigate(
        made[:1], validate=made[1:], domain="waves", effects=FEW, progress=False
    )


def test_what_is_planted_is_named_with_its_size(planted):
    assert (planted.verdict, planted.names) == ("named", ("speed_dependent_torque",))
    found = planted.content["parameters"]["quadratic_share"]
    assert found["value"] == pytest.approx(FAN, abs=max(4 * found["standard_error"], 0.05))


def test_the_gap_shrinks_to_the_noise_on_the_dip_held_out(planted):
    for gap in (planted.gap.train, planted.gap.validate):
        # half of what is missed there is the currents' noise
        assert gap.after.epsilon_i < 0.6 * gap.before.epsilon_i
        assert gap.closed > 0.9
        assert QUIET < gap.after.chi2_per_sample < LOUD
    told = planted.content["gap"]["validate"]["after"]
    assert set(told) == {"model_error", "epsilon_p", "epsilon_q", "epsilon_i", "chi2_per_sample"}


def test_nothing_is_said_where_nothing_is_missing(silent):
    assert (silent.verdict, silent.names, silent.content["where"]) == ("none", (), [])
    assert QUIET < silent.gap.train.after.chi2_per_sample < LOUD


def test_places_and_noise_are_told_in_words(planted):
    assert {place["channel"] for place in planted.content["where"]} <= {
        "current alpha",
        "current beta",
    }
    assert planted.content["where"]
    assert "current alpha 0.0" in planted.content["noise"]
    # a delta winding keeps it out, so it is not compared
    assert "zero-sequence" not in planted.content["noise"]


def test_the_page_and_the_extended_model(planted, tmp_path):
    planted.write(tmp_path)
    page = (tmp_path / "discrepancy.html").read_text(encoding="utf-8")
    assert "epsilon_i" in page
    assert "domain=waves" in page
    assert "extended.yaml" in page
    assert "The same in phasors: P and Q" in page
    told = json.loads((tmp_path / "discrepancy.json").read_text(encoding="utf-8"))
    assert told["verdict"] == "named"
    again = tractexp.compose(tmp_path / "conf" / "model" / "extended.yaml", domain="waves")
    assert again.node == planted.extended_model.node


def test_the_page_shows_the_currents_of_the_phases_before_and_after(planted):
    first = planted.steps.overlays[0]
    chart = overlay.draw_currents(first.event, first).plain()
    curves = {trace["name"] for trace in chart["data"]}
    assert {"phase a", "measured", "base model", "extended model", "± 2 σ of the noise"} <= curves
    shown = chart["layout"]["xaxis"]["range"]
    assert shown[0] < first.event.t_start < first.event.t_end < shown[1]
    assert shown[1] - shown[0] < 0.3  # s: the dip is in view, not the whole record
    part = slice(first.event.start, None)
    before, after = (
        np.abs((first.measurements - made)[:2, part]).max() for made in (first.before, first.after)
    )
    assert after < before


@pytest.mark.usefixtures("registry_as_it_was")
def test_a_term_is_proposed_that_does_what_no_effect_is_said_to_do(planted, tmp_path):
    steps, few = (
        planted.steps,
        ("torque:slip", "motor:slip", "power:washout"),
    )
    among = [find_term(f"answer:{name}") for name in few]
    proposed = propose(
        steps.base,
        steps.first,
        steps.bare,
        steps.last.noise,
        steps.withheld,
        steps.base_grade,
        among,
    )
    proposal = proposed.proposal
    assert proposal.term.name == "answer:torque:slip"  # the torque falls with the speed
    assert proposal.values["size"] < 0
    assert proposal.judged.validate.explained_share > 0.9
    (tmp_path / "proposed_effect.py").write_text(proposal.source, encoding="utf-8")
    effect = runpy.run_path(str(tmp_path / "proposed_effect.py"))["ProposedEffect"]()
    context, fit = proposal.judged.train.context, proposed.tried[0][1].fit
    faults = [context.catalogue[name].effect for name in context.catalogue.of_measurement]
    model = compose(context.load.motor, context.load.static, [effect, *faults], domain="waves")
    own = {f"proposed_{name}": value for name, value in proposal.values.items()}
    at = lambda name: own[name] if name in own else context.coordinates.value(name, fit.unit)  # noqa: E731
    values = np.array([[at(name) for name in model.names]])
    drawn = model.simulate(context.drive, values, context.problem.step.substeps).outputs[:, 0]
    with_it, without = (
        proposal.judged.train.after.calculated,
        proposal.judged.train.before.calculated,
    )
    # all but the power before the dip, which the fit leaves free
    assert np.abs((drawn - with_it) * context.valid).max() < 0.1 * np.abs(without - with_it).max()


@pytest.mark.long
def test_an_event_that_would_decide_is_found_in_waveforms(planted):
    steps = planted.steps
    bench, noise, kept = steps.context, steps.evidence.noise, steps.evidence.rows[0].fit
    other = next(row.fit for row in steps.evidence.rows if row.fit.names != kept.names)
    chosen = find_next_event(bench, noise, steps.bare, [kept, other], ["a", "b"])
    assert 0.04 <= chosen.best.event.duration <= 0.32
    assert {np.sign(t.event.jump) for t in chosen.tried} == {-1.0, 0.0, 1.0}
    assert {t.event.unbalance for t in chosen.tried} == {0.0, 0.5}
    assert not any(", with " in t.event.words for t in chosen.tried), (
        "waveforms need no channel of their own"
    )
    assert chosen.best.least > 0.5
    assert not chosen.same
    assert chosen.sentence()


def test_what_is_left_of_a_current_is_told_by_its_shape(silent):
    (event,), noise = silent.steps.context.events, silent.steps.last.noise
    t = event.record.t - event.t_end
    ring = np.where(
        t >= 0, 0.1 * np.exp(-np.maximum(t, 0) / 0.03) * np.cos(2 * np.pi * 180 * t), 0.0
    )
    residual = (
        noise.draw(np.random.default_rng(1), 1, [event.record.samples])[0]
        * silent.steps.context.valid
    )
    residual[1] += ring
    told = find_remainders(residual, [event], noise)[0]
    assert (told.channel, told.kind) == ("current beta", "ringing")
    assert told.frequency == pytest.approx(180, abs=3)
    assert told.size == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize("role", ["records", "validate"])
def test_a_record_without_samples_is_refused_in_a_sentence(given, role):
    bare = replace(given[0], record=replace(given[0].record, waves=None, name="magnitudes"))
    train, held = ([bare], []) if role == "records" else (given[1:], [bare])
    with pytest.raises(UserError, match=r"magnitudes|has no waveforms: domain=waves needs"):
        tractexp.investigate(train, validate=held, domain="waves", effects=FEW, progress=False)
