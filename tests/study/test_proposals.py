"""A term for what no effect of the catalogue explains, `propose`: columns, screen, refit, gate,
plugin and what machines read.
"""

import importlib.util
import itertools
import json
import sys
import zlib
from types import SimpleNamespace

import numpy as np
import pytest
from nasty import NASTY

import tractexp
from hidden_effects import EFFECTS, Case, Noise, Recorder, make
from tractexp.configuration.plugin import get
from tractexp.discrepancy.disagreement import disagreement
from tractexp.discrepancy.proposal import generate
from tractexp.discrepancy.proposal.bed import (
    carried_over,
    context_of_terms,
    place,
    sizes_of,
    with_terms,
)
from tractexp.discrepancy.proposal.effect import Library
from tractexp.discrepancy.proposal.library import (
    ANSWER,
    BALANCES,
    CLOCKS,
    SIGNALS,
    Term,
    pick_of,
    term,
    terms,
)
from tractexp.discrepancy.proposal.propose import propose, to_dict
from tractexp.discrepancy.proposal.refit import term_fits
from tractexp.discrepancy.proposal.screen import Ground, compute_library_p, scores, screen
from tractexp.discrepancy.proposal.wording import proposed_in_words
from tractexp.identification.grade import grade_model
from tractexp.inference.base_fit import base_fit
from tractexp.inference.catalogue import catalogue
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.effort import Effort
from tractexp.inference.fitting import refit
from tractexp.inference.problem import Problem
from tractexp.inference.records import Records
from tractexp.model.model import compose
from tractexp.record import Record, detect

pytestmark = pytest.mark.usefixtures("registry_as_it_was")

SLOW, FAST = Recorder(rate=250.0, samples=500), Recorder()

STEP, TRIP = "timed:power:step:of_return", "answer:static:relay"
FEW = tuple(
    term(n)
    for n in (
        STEP,
        "timed:power:ramp:of_dip",
        "timed:power_P:step:of_record",
        TRIP,
        "answer:torque:slip",
        "answer:decay:slip",
        "answer:static:washout",
        "answer:whole:relay",
        "answer:resistance:constant",
    )
)


def base(*effects):
    return compose(
        get("model/motor", "electromechanical")(), get("model/static", "exponential")(), effects
    )


def events(effect=None, size=1.0, seed=800001, count=3, noise=0.003, recorder=SLOW):
    records = make(Case(effect, size, events=count, noise=Noise(noise), recorder=recorder), seed)
    return [
        detect(Record(f"event{k + 1}", **r, source=f"made {k + 1}").check())
        for k, r in enumerate(records)
    ]


def fitted_base(made):
    model = base()
    missing = catalogue(model, made, ["stator_resistance"])
    return base_fit(
        Context.from_records(
            model, missing, Records.from_events(made), {}, {}, Criteria(), Effort()
        )
    )


def searched(made, held, among=FEW, seed=0):
    """What a search among a few terms comes to, whatever the catalogue says."""
    fit = fitted_base(made)
    first = disagreement(fit, seed)
    at = fit.context.coordinates
    bare = refit(
        fit.context, first.noise, [((), at.without_faults(first.fit.unit, ()))], faults=()
    )[0]
    graded = grade_model(Problem(base(), made))
    return propose(fit, first, bare, first.noise, held, graded, among)


@pytest.fixture(scope="module")
def ground():
    fit = fitted_base(events(count=2, recorder=FAST))
    bench = context_of_terms(fit.context)
    return Ground.from_coordinates(bench, carried_over(bench, fit.context, fit.fit.unit), fit.noise)


@pytest.fixture(scope="module")
def stepped():
    made = events("load_step", 3.0, count=3)
    return made, tractexp.investigate(
        made[:2], validate=made[2:], effects=["stator_resistance"], progress=False
    )


@pytest.mark.parametrize(
    "name",
    ["answer:torque:slip", "answer:decay:slip", "answer:static_P:relay", "answer:angle:rate", STEP],
)
def test_a_column_is_the_difference_of_two_simulations(ground, name):
    """Central differences of a tenth of the relevant size, against the one-sided ones of the
    screen.
    """
    chosen, at = term(name), ground.context.coordinates
    setting = chosen.signal.settings[len(chosen.signal.settings) // 2]
    (size, _), zeros = sizes_of(chosen)[0], [0.0] * (len(sizes_of(chosen)) - 1)
    up, down, small = (
        place(at, ground.unit, chosen, setting, [k * size.relevant, *zeros])
        for k in (0.1, -0.1, 0.02)
    )
    raw = ground.context.residuals(np.array([up, down]), (chosen.signal.kind,))
    central = ground.context.whiten(ground.noise, (raw[:1] - raw[1:]) / (0.2 * size.relevant))
    column = ground.columns(small[None], np.array([0.02 * size.relevant]), chosen.signal.kind)
    assert np.linalg.norm(central) > 0
    assert np.linalg.norm(column - central) < 0.01 * np.linalg.norm(central)


def test_the_linear_drop_is_that_of_a_refit_where_the_term_is_small():
    fit = fitted_base(events("load_step", 0.15, count=2))
    bench = context_of_terms(fit.context)
    there = Ground.from_coordinates(
        bench, carried_over(bench, fit.context, fit.fit.unit), fit.noise
    )
    made = term_fits(there, screen(there, [term(STEP)]), [])
    (found,) = scores(there, [(term(STEP), {"instant": made.values(made.fits[0])["instant"]})])
    lowered = made.bare.deviance - made.fits[0].deviance
    assert lowered > 20
    assert found.drop == pytest.approx(lowered, rel=0.1)


def test_noise_gives_the_best_of_many_tries_as_much_as_often_as_is_told():
    rng = np.random.default_rng(4)
    for name, sizes in (("timed:power_P:step:of_dip", 1), (STEP, len(sizes_of(term(STEP))))):
        best = rng.chisquare(sizes, (4000, 200)).max(axis=1)
        p = np.array([compute_library_p(term(name), drop, 200) for drop in best])
        assert 0.04 < np.mean(p < 0.05) < 0.06


def test_equal_bits_of_the_base_model_on_both_benches():
    fit = fitted_base(events(count=2))
    bench = context_of_terms(fit.context)
    mine = bench.residuals(carried_over(bench, fit.context, fit.fit.unit)[None], ())
    assert np.array_equal(mine, fit.context.residuals(fit.fit.unit[None], ()))


@pytest.mark.parametrize(
    ("clock", "begins"), [("of_record", 0.0), ("of_dip", "start"), ("of_return", "end")]
)
def test_a_clock_counts_from_where_it_says(ground, clock, begins):
    chosen = term(f"timed:power_P:step:{clock}")
    point = place(ground.context.coordinates, ground.unit, chosen, {"instant": 0.1}, [1.0])
    added = ground.context.residuals(point[None], (chosen.signal.kind,))[0, 0] - ground.raw[0]
    for e, event in enumerate(ground.context.events):
        own, t = added[ground.context.drive.part(e)], event.record.t - event.record.t[0]
        assert np.all(
            (np.abs(own) < 1e-9) | (np.abs(own - 1) < 1e-6) | (np.abs(np.gradient(own)) > 0)
        )
        first = t[np.flatnonzero(own > 0.5)[0]] - 0.1
        if begins == 0.0:
            assert first == pytest.approx(0.0, abs=event.record.step)
        elif begins == "start":
            assert 0 < first - (event.t_start - event.record.t[0]) < 0.06
        else:
            assert -0.12 < first - (event.t_end - event.record.t[0]) < 0.02


def test_a_step_by_itself_is_found_with_its_time(stepped):
    made, found = stepped
    assert found.verdict == "unexplained"
    (proposed,) = found.proposal["terms"]
    assert (proposed["balance"], proposed["signal"], proposed["clock"]) == (
        "power",
        "step",
        "of_return",
    )
    assert proposed["function_of_voltage"] is False
    assert found.proposal["explained"]["train"] > 0.9
    assert found.proposal["explained"]["validate"] > 0.9
    truth = EFFECTS["load_step"].details(
        np.random.default_rng([800001, zlib.crc32(b"load_step")]), ()
    )
    assert proposed["parameters"]["instant"]["value"] == pytest.approx(truth["delay"], abs=0.02)
    assert made[0].record.P[0] * 0.06 == pytest.approx(
        proposed["parameters"]["size_P"]["value"], rel=0.1
    )


def test_the_errors_of_a_proposal_are_those_of_graded_fits_and_less_with_the_term(stepped):
    """The likelihood and least squares have different minima here: 3.2 and 1.5 % held out."""
    findings = stepped[1].steps
    changes, graded = findings.proposed.proposal.changes, findings.misfits(findings.base_grade)
    for change, misfit in zip(changes, graded, strict=True):
        assert change.before.error.value == pytest.approx(misfit.error.value, rel=0.01)
        assert change.after.error.square <= change.before.error.square


def test_what_machines_read(stepped):
    _, found = stepped
    told = json.loads(json.dumps(found.content))
    assert {"terms", "explained", "p", "plugin"} <= told["proposal"].keys()
    assert {"balance", "signal", "parameters", "latex"} <= told["proposal"]["terms"][0].keys()
    assert told["proposal"]["explained"].keys() == {"train", "validate"}
    assert told["no_proposal"] is None
    for known in told["proposal"]["terms"][0]["parameters"].values():
        low, high = known["interval"]
        assert low < known["value"] < high


def test_the_page_and_the_table_tell_it(stepped, tmp_path):
    _, found = stepped
    paths = {path.name: path for path in found.write(tmp_path)}
    text = paths["discrepancy.html"].read_text()
    assert ">Proposal<" in text
    assert "not a function of the voltage" in text
    assert "proposed_effect.py" in paths
    assert "tractexp new effect proposed_effect --from proposed_effect.py" in text
    assert any(
        line.startswith("proposed: a step")
        for line in map(str.strip, str(found.summary()).splitlines())
    )


def test_the_plugin_file_reproduces_the_fit(stepped, tmp_path, monkeypatch):
    made, found = stepped
    found.write(tmp_path)
    module = _loaded(tmp_path / "proposed_effect.py", monkeypatch)
    proposal, bench = (
        found.steps.proposed.proposal,
        found.steps.proposed.proposal.judged.train.context,
    )
    chosen = found.steps.proposed.tried[0][1].fit
    faults = [bench.catalogue[n].effect for n in bench.catalogue.of_measurement]
    model = base(module.ProposedEffect(), *faults)
    at, own = bench.coordinates, {generate.PREFIX + n: v for n, v in proposal.values.items()}
    values = [own[n] if n in own else at.value(n, chosen.unit) for n in model.names]
    width = 0.2 * np.maximum(np.linalg.norm(bench.drive.before, axis=1, keepdims=True), 0.1)
    before = bench.drive.before + width * (2 * chosen.unit[at.before].reshape(-1, 2) - 1)
    made = model.simulate(
        bench.drive, np.array(values)[None], bench.problem.step.substeps, before[:, None]
    )
    assert np.abs(made.outputs[:, 0] - proposal.judged.train.after.calculated).max() < 1e-8
    assert any("proposed_size_P" in line or "k_P" in line for line in model.latex())


@pytest.mark.long
def test_a_transformer_whose_ratio_steps_is_found_in_the_voltage_that_the_load_sees():
    """The motors answer it by a decaying swing of Q, which a term in the power alone fits worse."""
    made = events("tap_changer_step", 0.5)
    voltage, power = "timed:voltage:step:of_return", "timed:power:decay:of_return"
    found = searched(made[:2], made[2:], (*FEW, term(voltage), term(power)))
    assert found.proposal.term.name == voltage
    assert found.proposal.values["size"] == pytest.approx(
        0.5 * EFFECTS["tap_changer_step"].reference, rel=0.05
    )
    assert min(change.closed_share for change in found.proposal.changes) > 0.5
    assert [t.name for t, _ in found.tried].index(power) > 0


@pytest.mark.long
@pytest.mark.parametrize(("seed", "measured"), [(800001, 0.6), (800002, 4.0)])
def test_what_a_right_term_explains_does_not_hang_on_the_level_of_the_noise(seed, measured):
    """Of the deviance in excess of the noise, `measured` on the held-out event, the same step gains
    too little once, and once four times what there is.
    """
    made = events("load_step", 0.2, seed=seed, recorder=FAST)
    found = searched(made[:2], made[2:])
    held = found.proposal.judged.validate
    excess = held.before.deviance - held.context.samples
    assert held.gain / excess == pytest.approx(measured, abs=0.1)
    assert 0.8 < held.explained_share <= 1.0
    assert found.proposal.term.name == STEP
    fitted, _ = found.proposal.changes  # a term in a fit leaves no more of it
    assert fitted.after.error.square <= fitted.before.error.square


def test_nothing_is_proposed_where_nothing_is_missing():
    made = events(seed=800003, count=3)
    found = searched(made[:2], made[2:])
    assert found.proposal is None
    assert found.why
    assert to_dict(found, "x.py") is None


def test_without_a_held_out_event_nothing_is_proposed():
    given = SimpleNamespace(context=None), None, None, None, (), None
    assert "none was held out" in propose(*given).why
    assert proposed_in_words(None, "why not") == ["no term is proposed: why not"]
    assert proposed_in_words(None, None) == []


def test_what_a_proposal_ties_with_and_looks_like_is_said():
    term = {
        "words": "a step of P",
        "function_of_voltage": False,
        "parameters": {"k": {"value": 0.2, "standard_error": 0.01}},
    }
    told = {"terms": [term], "explained": {"train": 0.9, "validate": 0.8}, "ties": [], "alike": {}}
    alone = proposed_in_words(told, None)
    assert alone[0].startswith("proposed: a step of P, which explains 90% of")
    assert alone[1:] == ["it is not a function of the voltage: something happened by itself"]
    further = proposed_in_words(
        {**told, "ties": [{"words": "a ramp of P"}], "alike": {"undervoltage_trip": 0.93}}, None
    )
    assert further[2:] == [
        "these events cannot tell it from a ramp of P",
        "looks like it: undervoltage_trip (93%)",
    ]


def test_the_library_adds_each_signal_that_is_picked():
    """Of the steady state only: what it adds to an equation is the picked signal times the size,
    with its sign.
    """
    library = Library(ANSWER)
    eq = base(library).equations
    (defined,) = [e for s, e in eq.definitions.items() if s.name == f"{ANSWER}_signal"]
    picked = {s: 1 for s in defined.free_symbols if s.name == pick_of(ANSWER, "constant")}
    others = {s: 0 for s in defined.free_symbols if "pick_" in s.name and s not in picked}
    assert picked
    assert others
    assert defined.subs(others | picked) == 1


def _loaded(path, monkeypatch):
    spec = importlib.util.spec_from_file_location("proposed_effect", path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "proposed_effect", module)
    spec.loader.exec_module(module)
    return module


def _every_balance_and_signal():
    answers = [s for s in SIGNALS if s.kind == ANSWER]
    here = list(BALANCES)
    pairs = [
        (b, s)
        for b, s in zip(here, itertools.cycle(answers), strict=False)
        if s.name not in b.without
    ]
    pairs += [(here[7], s) for s in answers if s.name != "constant"]
    made = [Term(b, s) for b, s in dict.fromkeys(pairs)]
    return [
        *made,
        *(
            Term(here[2], s, c)
            for s, c in zip((s for s in SIGNALS if s.kind != ANSWER), itertools.cycle(CLOCKS))
        ),
    ]


@pytest.mark.parametrize("chosen", _every_balance_and_signal(), ids=lambda t: t.name)
def test_every_balance_and_signal_makes_a_plugin_that_the_model_takes(
    chosen, tmp_path, monkeypatch
):
    values = {s.name: 0.1 for s in chosen.balance.sizes}
    values |= {s.name: s.grid[0] for s in chosen.signal.shapes}
    path = tmp_path / "proposed_effect.py"
    path.write_text(generate.source(chosen, values, "event1"), encoding="utf-8")
    effect = _loaded(path, monkeypatch).ProposedEffect()
    assert base().acceptance(effect).refusal is None
    assert [p.name for p in effect.parameters] == list(generate.parameters_of(chosen))


def test_a_name_of_a_record_is_text_in_the_plugin_that_is_to_be_installed(tmp_path, monkeypatch):
    chosen = _every_balance_and_signal()[0]
    values = {s.name: 0.1 for s in chosen.balance.sizes} | {
        s.name: s.grid[0] for s in chosen.signal.shapes
    }
    monkeypatch.chdir(tmp_path)
    for k, name in enumerate(NASTY):
        path = tmp_path / f"{k}.py"
        path.write_text(generate.source(chosen, values, name), encoding="utf-8")
        name = name.encode(errors="backslashreplace").decode()
        assert (
            f"workflow from {name}; no textbook"
            in _loaded(path, monkeypatch).ProposedEffect.__doc__
        )
    assert not (tmp_path / "owned").exists()


def test_the_library_has_a_name_for_each_term():
    names = [t.name for t in terms()]
    assert len(set(names)) == len(names) > 200
    assert sum(len(t.signal.settings) for t in terms()) > 5000


def test_terms_become_candidates_with_their_own_parameters_only(ground):
    bench = with_terms(ground.context, [term(TRIP), term(TRIP)])
    own = [bench.coordinates.names[k] for k in bench.coordinates.parameters([TRIP])]
    assert own == [
        "answer_static_size",
        *(f"answer_relay_{n}" for n in ("level", "margin", "delay", "wait", "ramp")),
    ]
