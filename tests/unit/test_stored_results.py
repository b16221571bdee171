"""Stored results that nobody's identification wrote: a sentence when they are read, and no number
that is none.
"""

import json

import hostile
import numpy as np
import pandas as pd
import pytest

import tractexp
from tractexp.errors import UserError
from tractexp.tracking.model import Predictor, _load_pyfunc

SENTENCES = {
    "deep.json": "brackets lie deeper",
    "number.json": "more digits than can be read",
    "latin.json": "byte 8 is not UTF-8",
    "kind.json": "lacks the keys 'tractexp' and 'kind'",
    "look.json": "not a whole saved look",
    "bare.json": "it lacks 'objective'",
    "nested.json": "each value a number",
    "texts.json": "each value a number",
    "missing.json": "parameters lacks T_prime, which the model/motor 'electromechanical' needs",
    "infinite.json": "parameters.C = nan is no finite number",
    "huge.json": "parameters.C = 10+ is no finite number",
    "no_model.json": "model or own_base is none",
    "list_model.json": "model=.1. is a list, but it must be a mapping",
    "nested_model.json": "model/motor lacks the name",
    "no_before.json": "before lacks U0",
    "infinite_before.json": "before.U0 = inf is no finite number",
    "base.json": "own_base has powers that are no finite numbers above zero",
    "list_base.json": "own_base=.1. is a list",
    "pipe.json": "is a named pipe, no ordinary file",
    "folder.json": "there is no result file",
    "sparse.json": "at most",
    "database.json": "is not UTF-8 text",
}


@pytest.mark.parametrize("name", SENTENCES)
def test_a_result_that_is_none_is_a_sentence(name, tmp_path):
    path = hostile.INPUTS[name](tmp_path / name)
    for read in (tractexp.load, lambda p: _load_pyfunc(str(p))):
        with pytest.raises(UserError) as caught:
            read(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(UserError, match=SENTENCES[name]):
        tractexp.load(path)


@pytest.fixture
def sound(tmp_path):
    path = tmp_path / "result.json"
    path.write_text(hostile.result())
    return path


def test_a_sound_one_is_read_without_a_word(sound):
    assert tractexp.load(sound).result.parameters == hostile.MOTOR


def test_values_outside_their_bounds_are_said(tmp_path):
    path = hostile.INPUTS["outside.json"](tmp_path / "outside.json")
    for read in (tractexp.load, lambda p: _load_pyfunc(str(p))):
        with pytest.warns(
            UserWarning, match=r"outside.json: X_prime = 1e\+30 is outside its bounds, 0.125 to 0.5"
        ):
            read(path)


def test_nulls_that_stand_for_numbers_of_no_model_are_read(tmp_path):
    path = tmp_path / "result.json"
    content = json.loads(
        hostile.result(epsilon_q=None, standard_errors={"C": None}, intervals={"C": [None, 1.0]})
    )
    path.write_text(json.dumps(content))
    assert np.isnan(tractexp.load(path).result.epsilon_q)


T = np.arange(100) / 100
DIP = {"t": T, "U": np.where((T > 0.3) & (T < 0.5), 0.7, 1.0)}
SIGNALS = {
    "U = nan at sample 51 is not a finite number": DIP | {"U": np.where(T == 0.5, np.nan, 1.0)},
    "f = inf at sample 1 is not a finite number": DIP | {"f": np.full(100, np.inf)},
    "U = 0 at sample 51, but voltage must be above zero": DIP | {"U": np.where(T == 0.5, 0.0, 1.0)},
    "t = 0 s at sample 100 follows 0.98 s": DIP | {"t": np.where(T == 0.99, 0.0, T)},
    "t = 0 s at sample 2 follows 0 s, and steps of 0 s are usual": DIP | {"t": 0 * T},
    "U holds what is no number": DIP | {"U": ["a"] * 100},
    "U has 50 samples where t has 100": DIP | {"U": np.ones(50)},
    r"U has shape \(100, 2\)": DIP | {"U": np.ones((100, 2))},
    "t has 1 sample; a prediction needs at least two": {"t": [0.0], "U": [1.0]},
    "t has 0 samples": {"t": [], "U": []},
}


@pytest.mark.parametrize("sentence", SIGNALS)
def test_what_is_no_signal_is_a_sentence(sentence, sound):
    with pytest.raises(UserError, match=sentence):
        tractexp.load(sound).predict(**SIGNALS[sentence])
    columns = SIGNALS[sentence]
    if all(np.shape(values) == np.shape(columns["t"]) for values in columns.values()):
        with pytest.raises(UserError, match=sentence):
            _load_pyfunc(str(sound)).predict(pd.DataFrame(columns))


def test_a_column_that_is_missing_is_named(sound):
    with pytest.raises(UserError, match="the data lack a column U"):
        Predictor(tractexp.load(sound).result).predict(pd.DataFrame({"t": T}))


@pytest.mark.parametrize("power", [{"P0": float("nan")}, {"Q0": float("inf")}])
def test_a_power_that_is_no_number_is_a_sentence(power, sound):
    with pytest.raises(UserError, match="is no finite number"):
        tractexp.load(sound).predict(**DIP, **power)


def test_a_prediction_is_finite_and_as_before(sound):
    answer = Predictor(tractexp.load(sound).result).predict(pd.DataFrame(DIP))
    assert np.isfinite(answer.to_numpy()).all()
    assert answer["P"][0] == pytest.approx(0.8)
    assert np.array_equal(answer["P"], tractexp.load(sound).predict(**DIP).P)
