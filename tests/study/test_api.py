"""The front door: public calls with named arguments, and results that print, tabulate, save and
load.
"""

import ast
import dataclasses
import inspect
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import run_command
from conftest import MOTOR
from test_readers_comtrade import waveforms, write

import tractexp
from tractexp.errors import UserError

QUICK = {"name": "multistart_least_squares", "starts": 2}


def same(one, other):
    """Whether two identifications are the same in all but the time they took, and the commands that
    they advise.
    """

    def timeless(result):
        return dataclasses.replace(
            result, seconds=0.0, search=result.search | {"seconds": 0.0}, advice=[]
        )

    return timeless(one.result) == timeless(other.result)


@pytest.fixture(scope="module")
def dips(resistive_dips):
    return tractexp.read(*resistive_dips)


@pytest.fixture(scope="module")
def fit(dips):
    return tractexp.identify(
        dips[0], model="third_order_exponential", optimizer=QUICK, validate=dips[2]
    )


@pytest.fixture(scope="module")
def found(dips):
    effects = ["stator_resistance", "speed_dependent_torque"]
    return tractexp.investigate(dips[:2], validate=dips[2], effects=effects)


def test_the_events_are_a_list_that_prints_as_a_table(dips):
    assert [e.record.name for e in dips] == ["dip1", "dip2", "dip3"]
    assert repr(dips[0]).startswith("dip1: dip of 30 % lasting")
    assert repr(dips).splitlines()[0] == "3 dips"
    assert "starts [s]" in repr(dips)
    assert repr(dips[:1]).startswith("1 dip\n")
    assert "<td" in dips._repr_html_()
    assert dips.to_frame()["event"].tolist() == ["dip1", "dip2", "dip3"]
    frame = dips[0].to_frame()
    assert frame.columns.tolist() == ["t", "U", "P", "Q"]
    assert frame["P"].tolist() == dips[0].record.P.tolist()
    assert repr(dips[0].record) == "dip1: 401 samples of t, U, P, Q, 0.000 to 2.000 s, 200 Hz"


def test_values_have_names(fit, dips):
    inertia = fit.parameters["M"]
    assert inertia.interval[0] < inertia.value < inertia.interval[1]
    assert inertia.verdict == fit.result.verdicts["M"]
    assert (inertia.value, inertia.unit) == (fit.result.parameters["M"], "pu s²/rad")
    assert inertia.bounds == (0.0005, 0.03)
    assert "inertia" in inertia.about
    assert inertia.standard_error == fit.result.standard_errors["M"]
    response = fit.predict(dips[1])
    assert response.P.shape == dips[1].record.t.shape
    record = dips[1].record
    assert response.epsilon[0] == pytest.approx(
        np.linalg.norm(response.P - record.P) / np.linalg.norm(record.P)
    )
    assert "electromechanical motor and exponential static load\n" in repr(fit)
    assert "95 % interval" in repr(fit)
    assert fit.headline[1:] in repr(fit)
    assert "<table>" in fit._repr_html_()
    frame = fit.to_frame().set_index("parameter")
    assert frame.index.tolist() == list(MOTOR)
    assert tuple(frame.loc["M", ["lower", "upper"]]) == inertia.interval
    assert frame.loc["M", "standard_error"] == inertia.standard_error
    with pytest.raises(KeyError, match="no parameter is called Xprime; did you mean 'X_prime'"):
        fit.parameters["Xprime"]
    assert fit.report().html.startswith("<!DOCTYPE html>")
    assert fit.report()._repr_html_().startswith("<iframe")


def test_summary_page_and_sheet_begin_with_whether_the_model_may_be_used(fit):
    word = fit.usability.capitalize()
    first = fit.usability_reason.partition(",")[0]
    assert f"{word}: {first}" in str(fit.summary())
    assert f"{word}: {first}" in fit.report().html
    assert f"{word.upper()}. T{first[1:]}" in fit.sheet().html


def test_an_investigation_names_what_is_missing_and_gives_a_model_again(found, fit, dips):
    assert (found.verdict, found.names) == ("named", ("stator_resistance",))
    assert found.gap.validate.closed > 0.9
    assert found.gap.train.after.chi2_per_sample < 1.3 < found.gap.train.before.chi2_per_sample
    assert found.predict(dips[2]).epsilon[1] < 0.5 * fit.predict(dips[2]).epsilon[1]
    extended = tractexp.identify(dips[:2], model=found.extended_model, optimizer=QUICK)
    assert extended.parameters["R_s"].value == pytest.approx(0.02, rel=0.1)
    assert "stator_resistance" in [row[0] for row in found.candidates.rows]
    assert found.extended_model.model.latex()[0] in found.extended_model._repr_latex_()
    assert "R_s" in found.extended_model._repr_html_()


def test_where_nothing_is_named_there_is_no_extended_model(dips, tmp_path):
    """A base model under the name of an extended one would pass for an answer."""
    found = tractexp.investigate(
        dips[:2], effects=["speed_dependent_torque"], criteria={"adequate_p": 1.0}
    )
    assert found.names == ()
    assert not found.gap.validate
    with pytest.raises(UserError, match="no event was held out, so nothing is known of its closed"):
        _ = found.gap.validate.closed
    with pytest.raises(
        UserError, match=rf"no extended model: the verdict is '{found.verdict}'.* base model"
    ):
        _ = found.extended_model
    assert found.question.model.effects == ()
    assert found.fit.parameters.keys() == set(MOTOR)
    assert [row[1] for row in found.table().rows] == ["base model"]
    assert found.content["extended"] is None
    written = {path.name for path in found.write(tmp_path)}
    assert "extended.yaml" not in written
    assert ("unexplained.csv" in written) == (found.verdict == "unexplained")
    assert found.remainder.caption == (
        found.content["remainder"]["sentence"] if found.content["remainder"] else ""
    )


def test_what_is_saved_is_json_and_comes_back_the_same(fit, found, dips, tmp_path):
    made = {
        "fit": fit,
        "found": found,
        "profile": tractexp.profile(fit, points=3),
        "plan": tractexp.plan(dips[0], parameter="M", values=fit),
        "simulation": tractexp.simulate(fit, records=dips[1]),
        "export": tractexp.export(fit, "modelica"),
    }
    for name, result in made.items():
        path = result.save(tmp_path / f"{name}.json")
        json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)
        if name != "export":
            assert "<figure" in result.report().html
        again = tractexp.load(path)
        assert type(again) is type(result)
        assert [list(map(str, row)) for row in again.table().rows] == [
            list(map(str, r)) for r in result.table().rows
        ]
        assert again.to_dict().keys() == result.to_dict().keys()
        assert type(result).load(path).table().title == result.table().title
    again = tractexp.load(tmp_path / "fit.json")
    assert again.result == fit.result
    assert np.array_equal(again.predict(dips[1]).P, fit.predict(dips[1]).P)
    assert again.details.uncertainty.values == pytest.approx(
        fit.details.uncertainty.values, rel=1e-12
    )
    assert again.advice == fit.advice
    assert np.array_equal(
        tractexp.load(tmp_path / "found.json").predict(dips[2]).Q, found.predict(dips[2]).Q
    )
    assert np.array_equal(tractexp.load(tmp_path / "simulation.json").P, made["simulation"].P)
    with pytest.raises(UserError, match="kind 'identification', not 'plan'"):
        type(made["plan"]).load(tmp_path / "fit.json")


def test_a_posterior_comes_back_too(fit, tmp_path):
    pytest.importorskip("emcee", reason="the optional extra [posterior] is not installed")
    drawn = tractexp.posterior(fit, walkers=20, steps=100)
    again = tractexp.load(drawn.save(tmp_path / "posterior.json"))
    assert repr(again) == repr(drawn)
    assert np.array_equal(again.draws["M"], drawn.draws["M"])


def test_frames_and_arrays_give_the_fit_of_the_file(resistive_dips, fit):
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(resistive_dips[0])
    arrays = {name: frame[name].to_numpy() for name in ("t", "U", "P", "Q")}
    given = [tractexp.read(**arrays, name="dip1"), tractexp.read(frame), tractexp.read(arrays)]
    try:
        import polars
    except ImportError:
        pass
    else:
        given.append(tractexp.read(polars.from_dict(arrays)))
    small = {"optimizer": QUICK, "check_intervals": False, "progress": False}
    one = tractexp.identify(resistive_dips[0], **small)
    for read in given:
        other = tractexp.identify(read, **small)
        assert other.result.parameters == one.result.parameters
        assert other.result.intervals == one.result.intervals


def test_all_dips_of_a_comtrade_file_are_read(tmp_path):
    t = np.arange(6400) / 3200
    path = write(tmp_path, waveforms(t, 50.0, [(0.5, 0.7, 0.4), (1.3, 1.4, 0.2)]), [(3200, 6400)])
    made = tractexp.read(path, voltages=[0, 1, 2], currents=[3, 4, 5])
    assert [round(e.depth, 1) for e in made] == [0.4, 0.2]
    # the only load needs no channels
    assert [e.depth for e in tractexp.read(path)] == [e.depth for e in made]


def test_a_base_makes_a_table_per_unit(resistive_dips):
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(resistive_dips[0])
    scaled = frame.assign(U=27.5 * frame["U"], P=20 * frame["P"], Q=20 * frame["Q"], extra=1.0)
    (event,) = tractexp.read(scaled, base_voltage=27.5, base_power=20)
    np.testing.assert_allclose(event.record.P, frame["P"])
    np.testing.assert_allclose(event.record.U, frame["U"])
    assert event.record.notes == ("columns not used: extra",)


def test_the_command_and_the_call_give_the_same_numbers(resistive_dips, tmp_path):
    settings = {
        "seed": 2,
        "budget": 600,
        "per_event": ["T_m"],
        "bounds": {"C": [0.5, 0.95]},
        "fixed": {"q_v": 3.0},
    }
    call = tractexp.identify(
        [*map(str, resistive_dips[:2])],
        validate=str(resistive_dips[2]),
        objective={"name": "squares", "weight_P": 2.0},
        optimizer="issa_polish",
        progress=False,
        **settings,
    )
    done = run_command(
        "data=csv",
        f"data.train=[{resistive_dips[0]},{resistive_dips[1]}]",
        f"data.validate=[{resistive_dips[2]}]",
        "objective.weight_P=2",
        "optimizer=issa_polish",
        "seed=2",
        "budget=600",
        "model.per_event=[T_m]",
        "model.bounds.C=[0.5,0.95]",
        "model.fixed.q_v=3",
        "task.figures=false",
        "tracking.enabled=false",
        "hydra.run.dir=run",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    told = tractexp.load(tmp_path / "run" / "result.json")
    assert same(told, call)
    assert call.parameters["T_m[1]"].value != call.parameters["T_m[2]"].value
    assert (call.parameters["q_v"].verdict, call.parameters["q_v"].interval) == ("fixed", None)
    assert told.predict(call.spec.train[0]).epsilon == call.predict(call.spec.train[0]).epsilon
    with pytest.raises(UserError, match=r"a result\.json holds no records"):
        told.report()


def test_a_model_is_found_by_name_by_file_and_by_parts(tmp_path, found):
    named = tractexp.compose("fifth_order_double_cage")
    parts = tractexp.compose(motor="double_cage", static={"name": "exponential"})
    assert named.node == parts.node
    file = tmp_path / "mine.yaml"
    file.write_text(
        "defaults:\n  - motor: mechanical\n  - static: zip\n  - _self_\nfixed: {T_m: 0.5}\n"
    )
    mine = tractexp.compose(file.as_posix(), bounds={"M": [0.001, 0.02]})
    assert (mine.motor["name"], mine.static["name"], mine.fixed) == (
        "mechanical",
        "zip",
        {"T_m": 0.5},
    )
    assert mine.parameters["M"].bounds == (0.001, 0.02)
    assert "fixed" in repr(mine)
    again = tractexp.compose(found.extended_model.model)
    assert again.node == found.extended_model.node


def test_progress_tells_each_line_or_nothing(dips, capsys):
    lines = []
    tractexp.identify(dips[0], optimizer=QUICK, check_intervals=False, progress=lines.append)
    assert lines[0] == f"fit: {dips[0]!r}"
    assert lines[-1] == "optimizer: multistart_least_squares, seed 0"
    tractexp.identify(dips[0], optimizer=QUICK, check_intervals=False, progress=False)
    assert capsys.readouterr().out == ""


T = np.arange(100) * 0.01
REFUSED = {
    "identify() has no argument 'optimiser'; did you mean 'optimizer'?": lambda d: (
        tractexp.identify(d, optimiser=1)
    ),
    "investigate() has no argument 'optimizer'": lambda d: tractexp.investigate(d, optimizer="pso"),
    "investigate() has no argument 'budget'": lambda d: tractexp.investigate(d, budget=10),
    "per_event=['T_m'] has no meaning in an investigation": lambda d: tractexp.investigate(
        d, model=tractexp.compose(per_event=["T_m"])
    ),
    "identify(): missing a required argument: 'records'": lambda d: tractexp.identify(),
    "seed='x' is a text, but it must be a whole number": lambda d: tractexp.identify(d, seed="x"),
    "seed=-1 is out of range": lambda d: tractexp.identify(d, seed=-1),
    "budget=0 is out of range": lambda d: tractexp.identify(d, budget=0),
    "bounds={'C': 3} is a mapping, but it must be a mapping": lambda d: tractexp.identify(
        d, bounds={"C": 3}
    ),
    "bounds.C: bounds [0.9, 0.5] must be two finite numbers": lambda d: tractexp.identify(
        d, bounds={"C": [0.9, 0.5]}
    ),
    "fixed.Cc: this model has no parameter 'Cc'; did you mean 'C'?": lambda d: tractexp.identify(
        d, fixed={"Cc": 1.0}
    ),
    "substeps=0 is out of range": lambda d: tractexp.identify(d, substeps=0),
    "model=third: there is no such choice": lambda d: tractexp.identify(d, model="third"),
    "model is of type int": lambda d: tractexp.identify(d, model=3),
    "optimizer=issa_polsh: there is no such choice; did you mean 'issa_polish'": lambda d: (
        tractexp.identify(d, optimizer="issa_polsh")
    ),
    "optimizer 'pso' has no setting 'populaton'; did you mean 'population'?": lambda d: (
        tractexp.identify(d, optimizer={"name": "pso", "populaton": 3})
    ),
    "optimizer.population='many' is a text": lambda d: tractexp.identify(
        d, optimizer={"name": "pso", "population": "many"}
    ),
    "objective=3 is a whole number, but it must be a text or a mapping": lambda d: (
        tractexp.identify(d, objective=3)
    ),
    "per_event='T_m' is a text, but it must be a list, each a text": lambda d: tractexp.identify(
        d, per_event="T_m"
    ),
    "records is empty": lambda d: tractexp.identify([]),
    "false_alarms=0.9 is out of range": lambda d: tractexp.investigate(d, false_alarms=0.9),
    "names 'stator_resistence', which is no effect": lambda d: tractexp.investigate(
        d, effects=["stator_resistence"]
    ),
    "is both in records and in validate": lambda d: tractexp.investigate(d, validate=d),
    "nothing to read": lambda d: tractexp.read(),
    "nowhere.csv: there is no such file": lambda d: tractexp.read("nowhere.csv"),
    "result.json is no record: where a run wrote it, 'tractexp again FOLDER'": lambda d: (
        tractexp.read("result.json")
    ),
    "no reader takes files ending in '.abc'": lambda d: tractexp.read("dip.abc"),
    "tibet_5pct is neither a file with an ending nor": lambda d: tractexp.read("tibet_5pct"),
    "has no setting 'voltages'": lambda d: tractexp.read("tibet_50pct", voltages=[1, 2, 3]),
    "arrays: Q missing; t, U, P, Q are needed": lambda d: tractexp.read(t=T, U=T, P=T),
    "arrays: P holds 'a' at sample 1, which is no number": lambda d: tractexp.read(
        t=T, U=T, P=["a"] * 100, Q=T
    ),
    "U has shape (99,) where t has 100 samples": lambda d: tractexp.read(t=T, U=T[1:], P=T, Q=T),
    "values.T_prim: this model has no parameter 'T_prim'": lambda d: tractexp.simulate(
        None, {"T_prim": 1}, depth=0
    ),
    "no value for T_prime": lambda d: tractexp.simulate(depth=0.3),
    "depth=1.5 is out of range": lambda d: tractexp.simulate(values=MOTOR, depth=1.5),
    "either records to play, or the depth of a dip": lambda d: tractexp.simulate(values=MOTOR),
    "duration describes a dip made by hand": lambda d: tractexp.simulate(
        values=MOTOR, records=d, duration=0.3
    ),
    "parameter=X_prim is not a free parameter": lambda d: tractexp.plan(d, parameter="X_prim"),
    "fit='result.json' is a text, but it must be an Identification": lambda d: tractexp.profile(
        "result.json"
    ),
    "nowhere.json cannot be read": lambda d: tractexp.load("nowhere.json"),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_wrong_values_get_a_sentence_that_names_the_argument(sentence, dips):
    with pytest.raises(UserError) as caught:
        REFUSED[sentence](dips[:1])
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_damaged_file_gets_a_sentence(fit, tmp_path):
    path = fit.save(tmp_path / "fit.json")
    content = json.loads(path.read_text(encoding="utf-8"))
    for wrong, sentence in (
        ("{", "is not a saved result"),
        ("{}", "lacks the keys"),
        (json.dumps({**content, "kind": "identificatio"}), "did you mean"),
        (json.dumps({k: v for k, v in content.items() if k != "result"}), "it lacks 'result'"),
    ):
        path.write_text(wrong, encoding="utf-8")
        with pytest.raises(UserError, match=sentence):
            tractexp.load(path)


def test_the_door_is_light():
    """No module of a tracker, a plotter or a configurator is imported by a fit; none at all by the
    import.
    """
    code = (
        "import sys, tractexp; assert 'numpy' not in sys.modules;"
        "d = tractexp.read('tibet_50pct'); tractexp.identify(d, optimizer={'name':"
        " 'random_search'}, budget=50,"
        " check_intervals=False, progress=False);"
        "print([m for m in ('mlflow', 'matplotlib', 'hydra', 'omegaconf', 'pandas') if m in"
        " sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=os.environ
    )
    assert done.stdout.strip() == "[]", done.stderr


def test_a_fitted_model_is_measured_by_the_same_names_whichever_task_fitted_it(found, fit):
    from tractexp.api.logged import GRADES, measure_model

    for made in (fit, found.fit):
        metrics = measure_model(made)
        assert metrics["model_error"] == made.model_error.value
        assert GRADES[int(metrics["grade"])] == made.grade
        for name, one in made.parameters.items():
            assert metrics[name] == one.value
    assert measure_model(fit)["M_low"] == fit.parameters["M"].interval[0]


def test_every_public_name_is_there_and_says_what_it_does():
    from tractexp import PUBLIC

    for name in PUBLIC:
        assert name in dir(tractexp)
        if name == "UserError":
            continue
        told = inspect.unwrap(getattr(tractexp, name))
        sections = re.findall(r"^    (\w+)\n    -+$", told.__doc__, re.M)
        assert sections[:3] == ["Parameters", "Returns", "Raises"], name
        parameters = told.__doc__.partition("Returns\n")[0]
        for argument in inspect.signature(told).parameters:
            assert re.search(rf"(?m)^    .*\b{argument}\b", parameters), f"{name}: {argument}"


def test_type_checkers_see_the_names_that_a_program_gets():
    """The block that only they read, beside the table by which a name is imported at
    its first use.
    """
    tree = ast.parse(Path(tractexp.__file__).read_text(encoding="utf-8"))
    (block,) = (
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    )
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    assert {
        alias.asname: node.module for node in imports for alias in node.names
    } == tractexp.PUBLIC


def test_every_call_has_the_door_and_every_result_a_picture():
    """All that is in a module of `api`, found rather than listed."""
    from tractexp import PUBLIC
    from tractexp.api.load import list_result_kinds
    from tractexp.outcome import Outcome

    for name in (name for name, module in PUBLIC.items() if ".api." in module):
        with pytest.raises(
            UserError,
            match=rf"^{name}\(\) has no argument 'nonsense'|is no setting|nothing to|missing a"
            r" required",
        ):
            getattr(tractexp, name)(nonsense=1)
    assert len(list_result_kinds()) == 17
    for cls in list_result_kinds().values():
        assert issubclass(cls, Outcome)
        assert cls._repr_html_
        assert cls.write
        assert cls.kind == "export" or cls.report
