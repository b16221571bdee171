"""A run in waveforms from a shipped record to its page, and what `forecast_intervals` and `advise`
make of what it finds.
"""

import base64
import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import tractexp
from tractexp.configuration.plugin import get
from tractexp.domain import WAVES, find_domain
from tractexp.domain.playback import measure_as_phasors, measure_unsteadiness
from tractexp.errors import UserError
from tractexp.identification.adequacy import Grade
from tractexp.identification.advice import advise, advise_domain
from tractexp.identification.plan import DipShape, forecast_intervals
from tractexp.inference.problem import Problem
from tractexp.record import convert_to_waves
from tractexp.report.waves import Drawn, compute_spectra, draw_waves

LOAD = {"motor": "stator_flux", "static": "exponential", "domain": "waves"}
BEFORE = {"U0": 1.0, "P0": 0.8, "Q0": 0.5, "frequency": 50.0}


@pytest.fixture(scope="module")
def dip():
    return tractexp.read("tibet_50pct_comtrade")[0]


@pytest.fixture(scope="module")
def fit(dip):
    """The machine of the shipped records has no stator resistance."""
    return tractexp.identify(
        dip,
        tractexp.compose(**LOAD, fixed={"R_s": 0.001}),
        optimizer="multistart_least_squares",
        budget=1200,
        check_intervals=False,
        progress=False,
    )


def test_the_truth_behind_a_shipped_record_is_found(dip, fit):
    """What is well seen to a few percent; X', C and q_v trade against each other, as in phasors
    (docs/data.md).
    """
    # its per unit is P, a file's is |S|
    truth, one = json.loads(_truth("tibet_50pct"))["truth"], 1 / dip.P0
    at_base = {"X_prime": truth["X_prime"] * one, "M": truth["M"] / one, "T_m": truth["T_m"] / one}
    found = {
        name: e.value / (truth | at_base)[name]
        for name, e in fit.parameters.items()
        if name != "R_s"
    }
    for name, within in {
        "T_prime": 0.03,
        "M": 0.06,
        "T_m": 0.03,
        "p_v": 0.02,
        "X_prime": 0.25,
        "C": 0.2,
        "q_v": 0.25,
    }.items():
        assert found[name] == pytest.approx(1, abs=within), name
    (event,) = fit.result.events
    assert event["epsilon_p"] < 0.01
    assert event["epsilon_q"] < 0.01
    assert 0.02 < event["epsilon_i"] < 0.035  # 2 % of it is the recorder's noise


def _truth(name):
    from importlib.resources import files

    return (files("tractexp.data") / f"{name}.json").read_text()


def test_the_page_shows_currents_spectra_and_the_power_of_the_same_estimator(fit, tmp_path):
    path = next(one for one in fit.write_drawings(tmp_path) if one.name == fit.page)
    text = path.read_text(encoding="utf-8")
    for told in (
        "In waveforms the sampled currents are compared",
        "epsilon_i",
        "offsets of up to",
        "Runge-Kutta steps",
        "cycles before the dip",
        "still change by",
        "phasors of the currents above",
    ):
        assert told in text, told
    axes = re.findall(r'"title":\{"text":"([^"]*)"\}', text)
    assert {"u [pu]", "i_a [pu]", "i_c [pu]", "frequency [Hz]", "after [%]"} <= set(axes)
    assert '"labels":["u [kV]","i_a [A]","i_b [A]","i_c [A]","Δi [A]"]' in text
    assert any(axis.startswith("i_alpha [") for axis in axes)
    assert not any(axis.startswith("i_zero [") for axis in axes)  # not compared


def test_currents_are_drawn_whole_and_the_dip_is_in_view(fit):
    (one,) = fit.details.fits
    drawn = draw_waves(one.waves, [Drawn("estimate", one.currents, "#000000")]).plain()
    low, high = drawn["layout"]["xaxis"]["range"]
    assert low < one.waves.t_start < one.waves.t_end < high
    assert high - low < 0.5
    measured = [trace for trace in drawn["data"] if trace["name"] == "measured"]
    assert len(measured) == 3
    kept = np.frombuffer(base64.b64decode(measured[0]["samples"]["bdata"]), dtype="<i2")
    assert len(kept) == len(one.waves.record.t) - one.waves.lead


def test_the_estimator_sees_in_recorded_currents_the_power_before_the_dip(dip):
    event = convert_to_waves(dip)
    seen, P, Q = measure_as_phasors(event, 2 * np.nan_to_num(event.currents))
    before = seen.steady
    assert seen.record.P[before].mean() == pytest.approx(event.P0, rel=2e-3)
    assert seen.record.Q[before].mean() == pytest.approx(event.Q0, rel=5e-3)
    np.testing.assert_allclose(P, 2 * seen.record.P, rtol=1e-9)
    np.testing.assert_allclose(Q, 2 * seen.record.Q, rtol=1e-9)


def test_a_spectrum_tells_frequency_and_size_of_what_is_left(dip):
    event = convert_to_waves(dip)
    size = abs(event.P0 + 1j * event.Q0) / event.U0
    t = event.record.t
    planted = np.nan_to_num(event.currents).copy()
    planted[0] += 0.03 * size * np.cos(2 * np.pi * 5 * event.f0 * t)  # alpha is phase a
    for spectrum in compute_spectra(event, planted):
        row = spectrum.amplitudes[0]
        assert spectrum.frequencies[row.argmax()] == pytest.approx(250, abs=1)
        assert row.max() == pytest.approx(0.03, rel=0.01)


def test_the_periodic_steady_state_is_measured_by_what_still_changes(fit):
    (one,) = fit.details.fits
    event = one.waves
    assert one.unsettled == fit.result.events[0]["unsettled"] < 1e-3
    decay = np.exp(-(np.arange(len(event.record.t)) / event.rate) * event.f0)  # to 1/e in a cycle
    turning = np.stack([event.turn.real, event.turn.imag, 0 * decay])
    assert measure_unsteadiness(event, turning) < 1e-4
    last = decay[event.lead - round(event.rate / event.f0) : event.lead]
    grown = turning * (1 + decay)
    told = np.sqrt(np.mean((last * (np.e - 1)) ** 2)) / np.sqrt(np.mean((1 + last) ** 2))
    assert measure_unsteadiness(event, grown) == pytest.approx(told, rel=0.02)
    grown[0, event.lead - 3 :] = np.nan  # the load diverges
    assert np.isnan(measure_unsteadiness(event, grown))


def test_a_fit_in_waveforms_is_saved_and_read_back(fit, tmp_path):
    again = tractexp.load(fit.save(tmp_path / "fit.json"))
    dip = tractexp.read("tibet_30pct_comtrade")[0]
    first, second = fit.predict(dip), again.predict(dip)
    assert np.array_equal(first.P, second.P)
    assert first.epsilon_i == second.epsilon_i < 0.04
    assert again.details.fits[0].epsilon_i == fit.result.events[0]["epsilon_i"]


def test_a_simulated_record_gives_currents(fit, tmp_path):
    made = tractexp.simulate(fit, records="tibet_65pct_comtrade")
    (one,) = made.responses
    assert max(one.epsilon) < 0.02
    assert set(one.currents) == {"t", *(f"i_{p}{m}" for p in "abc" for m in ("", "_measured"))}
    made.write(tmp_path)
    rows = np.genfromtxt(tmp_path / "response_currents.csv", delimiter=",", names=True)
    np.testing.assert_allclose(rows["i_a"], one.currents["i_a"], atol=1e-8)
    made.save(tmp_path / "made.json")
    assert tractexp.load(tmp_path / "made.json").responses[0].epsilon_i == one.epsilon_i
    assert "epsilon_i" in str(made)


def test_a_slow_voltage_draws_in_waveforms_what_it_draws_in_phasors():
    """Where nothing happens within a cycle the two domains are one."""
    t = np.linspace(0.0, 3.0, 301)
    U = 1 - 0.1 * np.exp(-(((t - 1.5) / 0.4) ** 2))
    made = []
    for domain in ("waves", "phasors"):
        model = tractexp.compose(**LOAD | {"domain": domain}).model
        values = np.array([p.default for p in model.parameters])
        made.append(np.stack(find_domain(model).play(model, values, t, U, BEFORE)))
    np.testing.assert_allclose(made[0], made[1], atol=4e-3)
    assert np.ptp(made[1][0]) > 0.04


def test_a_result_of_waveforms_predicts_from_a_voltage(fit):
    t = np.arange(0, 1, 0.01)
    P, Q = fit.result.predict(t, np.where((t > 0.4) & (t < 0.6), 0.8, 1.0))
    assert P[10] == pytest.approx(fit.result.before["P0"], abs=1e-3)
    assert Q[10] == pytest.approx(fit.result.before["Q0"], abs=1e-3)
    assert P[45:59].mean() < 0.9 * P[10]


def test_a_forecast_in_waveforms_narrows_with_depth_and_with_a_jump_of_the_phase(fit):
    problem, values = fit.spec.problem, fit.details.uncertainty.values
    shape = DipShape.from_event(problem.events[0])
    assert shape.domain is WAVES
    assert shape.jump == pytest.approx(0, abs=1)
    shape = replace(shape, depth=0.2, duration=0.1, jump=0.0, noise_P=0.005, noise_Q=0.005)
    shape.check()
    plain, deeper, jumping = (
        forecast_intervals(problem, values, s)
        for s in (shape, replace(shape, depth=0.5), replace(shape, jump=40.0))
    )
    assert (deeper.half < plain.half).all()
    T_m = plain.names.index("T_m")
    assert jumping.half[T_m] < plain.half[T_m]
    with pytest.raises(
        UserError, match=r"task\.rate=600.* is out of range: it must be at least 800"
    ):
        replace(shape, rate=600.0).check()


def test_a_planned_dip_has_the_sequences_that_were_asked_for():
    """Long after the edge the last half cycle shows 1 - depth of the positive and unbalance x depth
    of the negative.
    """
    shape = DipShape(0.4, 0.2, 6400.0, 0.005, 0.005, domain=WAVES, jump=20.0, unbalance=0.6)
    event = shape.event()
    low = slice(event.start + 128, event.end - 32)
    np.testing.assert_allclose(event.record.U[low], 0.6, atol=1e-9)
    np.testing.assert_allclose(event.record.U2[low], 0.24, atol=1e-9)
    np.testing.assert_allclose(np.abs(event.v[low]).max(), 0.84, atol=1e-3)
    assert event.depth == pytest.approx(0.4)
    again = DipShape.from_event(event)
    assert (again.depth, again.unbalance) == pytest.approx((0.4, 0.6), abs=1e-6)
    assert again.jump == pytest.approx(20.0, abs=1e-6)
    with pytest.raises(UserError, match=r"task\.unbalance=1\.5 is out of range"):
        replace(shape, unbalance=1.5).check()


def test_an_unbalanced_dip_tells_more_of_the_locked_rotor(fit):
    """The negative sequence sees the machine at a slip of nearly two: its leakages, whatever its
    flux does.
    """
    problem, values = fit.spec.problem, fit.details.uncertainty.values
    shape = replace(
        DipShape.from_event(problem.events[0]),
        depth=0.2,
        duration=0.2,
        jump=0.0,
        unbalance=0.0,
        noise_P=0.005,
        noise_Q=0.005,
    )
    plain, unbalanced = (
        forecast_intervals(problem, values, replace(shape, unbalance=u)) for u in (0.0, 1.0)
    )
    X_prime = plain.names.index("X_prime")
    assert unbalanced.half[X_prime] < 0.8 * plain.half[X_prime]


@pytest.mark.parametrize("asked", [{"jump": 20.0}, {"unbalance": 0.5}])
def test_phase_jumps_and_negative_sequences_are_of_waveforms(asked):
    (name,) = asked
    with pytest.raises(
        UserError, match=f"{name}={asked[name]:g} is of waveforms: add domain=waves"
    ):
        tractexp.plan("tibet_50pct", **asked)


def test_a_step_is_chosen_by_the_circuits_that_last(dip, monkeypatch):
    """Most reactances below zero grow without end at any step; the others say how many steps it
    takes.
    """
    # fewer, since the search up to them takes its time
    for module in ("model.model", "inference.steps"):
        monkeypatch.setattr(f"tractexp.{module}.MOST_SUBSTEPS", 16)
    bounds = {"X_f": (-0.05, 0.0)}
    model = tractexp.compose(
        motor="stator_flux", static="branch", effects=["feeder_impedance"], domain="waves"
    )
    problem = Problem(model.model, [dip], bounds=bounds)
    assert problem.step.substeps.tolist() == [4]
    assert problem.step.error < 5e-5


@pytest.mark.parametrize("objective", ["squares", "huber"])
def test_what_diverges_where_nothing_is_compared_warns_nobody(dip, objective, monkeypatch):
    """In the zero sequence of a balanced dip, and in the cycles before the record."""
    model = tractexp.compose(motor="stator_flux", static="branch", domain="waves").model
    problem = Problem(model, [dip], substeps=4, loss=get("objective", objective)())
    endless = np.full((1, *problem.drive.measurements.shape), np.inf)
    monkeypatch.setattr(problem, "_errors", lambda values: (endless, np.zeros((1, 1))))
    assert not np.isfinite(problem.residuals(np.ones((1, 1)))).all()


@pytest.mark.parametrize("format", ["psse_dyr", "andes", "modelica"])
def test_what_was_found_in_waveforms_is_exported_for_phasors(fit, format):
    made = tractexp.export(fit, format, playback=False)
    left_out = any("transients are not exported" in note for note in made.notes)
    assert left_out == (format != "modelica")
    assert "v_d" not in made.text


def test_a_short_or_unbalanced_dip_with_samples_is_better_fitted_in_waveforms(dip):
    def said(event, domain="phasors"):
        model = tractexp.compose(domain=domain).model
        return advise_domain(Problem(model, [event]))

    assert said(dip) == []  # 340 ms, balanced
    short = replace(dip, end=dip.start + round(0.06 * dip.rate))
    assert said(short) == [
        "fit the sampled waveforms, by domain=waves: the dip of tibet_50pct_dip1 lasts 60 ms, less"
        " than 5 cycles, which"
        " phasors smear"
    ]
    assert said(replace(short, record=replace(dip.record, waves=None))) == []
    unbalanced = replace(dip.record, U2=np.full(dip.record.samples, 0.2))
    assert "is unbalanced, U2 20% of U" in said(replace(dip, record=unbalanced))[0]
    slow = replace(dip.record, waves=replace(dip.record.waves, rate=600.0))
    assert said(replace(short, record=slow)) == []


@pytest.mark.parametrize(
    ("share", "first"), [(1.0, "find what is missing: "), (0.06, "fit the sampled waveforms")]
)
def test_what_is_missing_is_looked_for_where_waveforms_tell_more(dip, share, first):
    """One way on, not two: a model of smeared phasors is not extended before the waveforms are
    fitted.
    """
    event = replace(dip, end=dip.start + round(share * dip.rate)) if share < 1 else dip
    problem = Problem(tractexp.compose().model, [event])
    known = SimpleNamespace(likelihood=SimpleNamespace(problem=problem))
    (said,) = advise(known, SimpleNamespace(grade=Grade.WRONG_MODEL))
    assert said.startswith(first)
