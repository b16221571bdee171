"""The task `linear_network`: what it finds, writes and refuses."""

import json

import numpy as np
import pytest
from command_line import run_command
from test_network_comparison import simulated

import tractexp
from tractexp.errors import UserError


@pytest.fixture(scope="module")
def dips():
    return simulated(0.3), simulated(0.5)


@pytest.fixture(scope="module")
def fit(dips):
    return tractexp.linear_network(dips[0], validate=dips[1], progress=False)


def test_its_error_is_told_of_the_dip_fitted_and_of_the_one_held_out(fit):
    error = fit.content["model_error"]
    assert error["value"] < error["held_out"]["value"] < 1
    assert "leaves" in fit.headline
    assert ", and of the held-out dips " in fit.headline
    assert fit.content["chosen_by"] == "the Bayesian information criterion"


def test_it_is_the_yardstick_of_an_identification_of_the_same_dips(fit, dips):
    other = tractexp.identify(
        dips[0],
        validate=dips[1],
        optimizer="multistart_least_squares",
        budget=300,
        check_intervals=False,
        progress=False,
    )
    beside = other.result.linear_network
    assert beside["poles"] == fit.poles
    assert beside["model_error"] == fit.content["model_error"]


def test_the_dip_held_out_tells_nothing_of_how_many_poles(fit, dips):
    by_poles = fit.content["by_poles"]
    assert [row["poles"] for row in by_poles] == [0, 1, 2, 3, 4]
    alone = tractexp.linear_network(dips[0], progress=False)
    assert alone.poles == fit.poles
    assert by_poles[len(fit.poles)]["held_out"] == fit.content["model_error"]["held_out"]["value"]


def test_as_many_poles_as_are_asked_for(dips):
    one = tractexp.linear_network(dips[0], poles=1, progress=False)
    assert len(one.poles) == 1
    assert one.content["chosen_by"] == "task.poles=1"
    none = tractexp.linear_network(dips[0], poles=0, progress=False)
    assert none.poles == []
    assert "the best linear network without poles leaves" in none.headline


def test_it_predicts_a_dip_on_the_base_of_its_file(fit, dips):
    predicted = fit.predict(dips[1])
    assert len(predicted.P) == dips[1].record.samples
    before = slice(0, dips[1].start)
    assert np.nanmean(predicted.P[before]) == pytest.approx(dips[1].P0, rel=0.01)
    assert predicted.epsilon[0] == pytest.approx(fit.content["events"][1]["epsilon_p"], rel=1e-9)


def test_it_is_the_same_once_saved_and_loaded(fit, tmp_path):
    loaded = tractexp.load(fit.save(tmp_path / "network.json"))
    assert loaded.content == fit.content
    assert loaded.box.poles == fit.poles
    assert str(loaded) == str(fit)


def test_console_and_page_say_the_same(fit):
    sentence = fit.headline.replace("the best", "The best", 1)
    assert sentence in " ".join(str(fit.summary()).split())
    page = fit.report().html
    assert f"{sentence}." in page
    assert "The number of poles is chosen by the Bayesian information criterion." in page
    assert "frequency: of P and Q" in page


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"poles": 13}, "poles=13 is out of range: it must be at least 0 and at most 12"),
        ({"poles": -1}, "poles=-1 is out of range"),
        ({"domain": "wave"}, "domain=wave is not one of phasors, waves; did you mean 'waves'"),
        ({"domain": "waves"}, "has no waveforms: domain=waves needs the samples"),
    ],
)
def test_what_it_cannot_do_is_a_sentence(dips, given, sentence):
    with pytest.raises(UserError, match=sentence):
        tractexp.linear_network(dips[0], progress=False, **given)


def test_more_poles_than_the_samples_tell_are_refused():
    t = np.arange(130) / 200
    U = np.where((t >= 0.5) & (t < 0.56), 0.7, 1.0)
    (dip,) = tractexp.read(t=t, U=U, P=U**1.5, Q=0.4 * U**2, name="short")
    with pytest.raises(
        UserError,
        match=r"^poles=4: the samples from the dips on are enough for [12]; ask for fewer",
    ):
        tractexp.linear_network(dip, poles=4, progress=False)


def test_the_command_writes_its_result_and_its_page(tmp_path):
    done = run_command(
        "task=linear_network",
        "data=tibet_50pct",
        "task.poles=2",
        "tracking.enabled=false",
        "hydra.run.dir=run",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    content = json.loads((tmp_path / "run" / "linear_network.json").read_text(encoding="utf-8"))
    assert len(content["poles"]) == 2
    assert content["sentence"].replace("the best", "The best", 1) in " ".join(done.stdout.split())
    assert "estimate" in (tmp_path / "run" / "linear_network.html").read_text(encoding="utf-8")


def test_as_a_model_it_is_refused_with_the_task_that_fits_it(tmp_path):
    done = run_command("model=linear_network", cwd=tmp_path)
    assert done.returncode == 2
    assert (
        done.stderr == "tractexp: model=linear_network: there is no such choice, but there is"
        " task=linear_network\n"
    )
    with pytest.raises(UserError, match="but there is task=linear_network"):
        tractexp.identify("tibet_50pct", model="linear_network")
