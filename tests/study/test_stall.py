"""A motor that stalls on a dip it was not fitted to: words where a number would mean nothing, and a
place behind all sets whose motors survive.
"""

import json
import warnings

import numpy as np
import pytest
from conftest import no_term_is_searched

import tractexp
from tractexp.domain import find_domain
from tractexp.model.drive import Drive
from tractexp.model.model import LARGEST_OUTPUT
from tractexp.report.discrepancy import build_gap_table

HEAVY = {
    "T_prime": 0.1,
    "X_prime": 0.2,
    "C": 0.9,
    "M": 0.03,
    "T_m": 0.3,
    "p_v": 1.4,
    "q_v": 3.0,
}
# a motor that drives more than half the load and has hardly any inertia: a deep dip stops it
WEAK = {"T_m": 0.6, "X_prime": 0.2, "C": 0.9, "T_prime": 0.1}
LIGHT = {"M": (0.0005, 0.001)}


@pytest.fixture(scope="module")
def dips():
    """Two mild dips and a deep one that the load survives."""
    noise, made = np.random.default_rng(7), []
    for k, (depth, duration) in enumerate(((0.1, 0.1), (0.15, 0.15), (0.8, 0.5)), 1):
        answer = tractexp.simulate(
            tractexp.compose(), HEAVY, depth=depth, duration=duration, rate=200, length=1.5
        )
        frame = answer.responses[0].to_frame()
        signals = {name: frame[name].to_numpy() for name in ("t", "U", "P", "Q")}
        for name in "PQ":
            signals[name] = signals[name] + 0.003 * noise.standard_normal(len(frame))
        made += tractexp.read(**signals, name=f"dip{k}")
    return made


@pytest.fixture(scope="module")
def stalled(dips):
    """The base model's motor stalls on the third dip; with a second group of motors it need not."""
    with warnings.catch_warnings(), no_term_is_searched():
        warnings.simplefilter("error")
        return tractexp.investigate(
            dips[:2],
            validate=dips[2:],
            effects=("second_motor_group", "stator_resistance"),
            fixed=WEAK,
            bounds=LIGHT,
            progress=False,
        )


def test_a_motor_that_stalls_has_words_and_no_number(stalled):
    error = stalled.content["gap"]["validate"]["before"]["model_error"]
    assert error == {"value": None, "interval": [None, None], "stalls": ["dip3"]}
    sentence = stalled.content["base_adequacy"]["sentence"]
    assert "the motor stalls in this model on dip3" in sentence
    assert stalled.content["base_adequacy"]["grade"] == "wrong_model"


def test_console_page_and_json_tell_it(stalled, tmp_path):
    console, page = str(stalled.summary()), stalled.report().html
    stalled.write_results(tmp_path)
    written = (tmp_path / "discrepancy.json").read_text(encoding="utf-8")
    for text in (console, page, json.dumps(stalled.content), written):
        assert "the motor stalls" in text
    held_out = next(row for row in stalled.table().rows if row[0] == "held out")
    assert held_out[2] == "the motor stalls"


def test_a_table_of_waveforms_keeps_its_columns_where_currents_have_no_number():
    error = {"value": 0.1, "interval": [0.05, 0.15]}
    known = {"epsilon_p": 0.1, "epsilon_q": 0.1, "epsilon_i": 0.1, "chi2_per_sample": 1.0}
    none = dict.fromkeys(known)
    fitted = {"model_error": error, **known}
    held_out = {"model_error": {"value": None, "interval": [None] * 2, "stalls": ["b"]}, **none}
    gaps = {
        role: {"before": misfit, "after": misfit, "closed": None}
        for role, misfit in (("train", fitted), ("validate", held_out))
    }
    table = build_gap_table({"effects": [], "gap": gaps})
    assert [len(row) for row in table.rows] == [len(table.columns)] * 2
    assert table.rows[1][2] == "the motor stalls"


def test_sets_that_stall_are_behind_all_that_survive(stalled):
    rows = [row for row in stalled.steps.evidence.every if row.prediction is not None]
    assert rows
    stalling = [row for row in rows if row.prediction.stalls]
    assert all(row.prediction.excess == np.inf for row in stalling)
    survive = [row for row in rows if not row.prediction.stalls]
    assert all(np.isfinite(row.prediction.excess) for row in survive)


def test_an_identification_tells_it_too(dips, tmp_path):
    found = tractexp.identify(
        dips[:1],
        validate=dips[2:],
        fixed=WEAK,
        bounds=LIGHT,
        optimizer="multistart_least_squares",
        budget=300,
        check_intervals=False,
        progress=False,
    )
    assert found.grade == "wrong_model"
    assert "the motor stalls in this model on dip3" in found.headline
    assert found.model_error_held_out.stalls == ("dip3",)
    assert "the motor stalls" in str(found.summary())
    found.save(tmp_path / "found")
    again = tractexp.load(tmp_path / "found")
    assert again.headline == found.headline
    assert again.model_error_held_out.stalls == ("dip3",)
    assert "the motor stalls" in str(again.report())


def test_what_diverges_is_no_number(dips):
    """A flux that turns backwards faster than steps can follow."""
    model, event = tractexp.compose().model, dips[2]
    domain = find_domain(model)
    drive = Drive.from_events([domain.excitation(event, model)])
    values = np.array([{**HEAVY, **WEAK, "M": 2e-5}[name] for name in model.names])
    outputs = model.simulate(drive, values, 1).outputs[:, 0]
    assert np.isfinite(outputs[:, : event.start]).all()
    assert np.isnan(outputs[:, -1]).all()
    assert np.nanmax(np.abs(outputs)) <= LARGEST_OUTPUT
    assert domain.comparison(event, outputs).stalls


def test_a_load_that_has_stopped_itself_does_not_stall_in_a_model_that_does_as_it_did(dips):
    """Where the record shows the current of standstill, a model that draws it is right."""
    event = dips[2]
    domain, record = find_domain(event), event.record
    stopped = 4.0 * np.ones(record.samples)
    stopped[: event.start] = 1.0
    assert domain.comparison(event, np.stack([stopped, 0 * stopped])).stalls
    told = tractexp.read(t=record.t, U=record.U, P=stopped, Q=0.1 * stopped, name="stopped")[0]
    assert not domain.comparison(told, np.stack([stopped, 0.1 * stopped])).stalls
    assert not domain.comparison(event, np.stack([record.P, record.Q])).stalls
