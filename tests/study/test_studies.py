"""The studies as public calls: results that print, tabulate, save, load and write the same page
again; refusals.
"""

import json
import pickle
from html import escape

import numpy as np
import pytest
from test_compare import samples, write_sweep

import tractexp
from tractexp.api.arguments import Choice
from tractexp.api.setup import Setup
from tractexp.configuration.plugin import build
from tractexp.errors import UserError


@pytest.fixture(scope="module")
def model():
    return tractexp.compose()


@pytest.fixture(scope="module")
def dips():
    """The shipped records: 30, 50 and 65 %."""
    return tractexp.read("tibet_30pct", "tibet_50pct", "tibet_65pct")


@pytest.fixture(scope="module")
def generalised(dips, model):
    return tractexp.generalise(
        dips[1],
        model,
        validate=[dips[0], dips[2]],
        optimizers={"brief": {"name": "pso", "population": 20}},
        seeds=2,
        budget=200,
        progress=False,
    )


@pytest.fixture(scope="module")
def replicated(dips, model):
    return tractexp.paper(
        dips[1],
        model,
        validate=dips[0],
        parts=["figure4", "figure6", "table2"],
        seeds=1,
        budget=200,
        workers=1,
        progress=False,
    )


@pytest.fixture(scope="module")
def benchmarked():
    pytest.importorskip("ioh", reason="the extra [benchmark] is not installed")
    return tractexp.benchmark(
        ["random_search", "issa_no_levy"],
        functions=[1, 15],
        dimensions=[2],
        instances=[1],
        multiplier=50,
        cores=1,
        progress=False,
    )


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compared") / "sweep"
    write_sweep(folder, samples({"good": 1.0, "bad": 2.0, "worst": 8.0}, seeds=range(8)))
    return tractexp.compare(folder, targets=[2, 1.1], floor=1e-6)


@pytest.fixture(scope="module")
def compared_searches(dips):
    brief = {"brief": {"name": "pso", "population": 10}}
    made = tractexp.search(dips[1], optimizers=brief, seeds=2, budget=60, cores=1, progress=False)
    return tractexp.compare(made, progress=False)


KINDS = ["compared", "compared_searches", "benchmarked", "generalised", "replicated"]


@pytest.mark.parametrize("name", KINDS)
def test_a_result_comes_back_from_its_file_and_writes_the_same_folder(name, request, tmp_path):
    made = request.getfixturevalue(name)
    back = type(made).load(made.save(tmp_path / "saved.json"))
    assert back.to_dict().keys() == made.to_dict().keys()
    assert repr(back) == repr(made)
    written, again = made.write(tmp_path / "one"), back.write(str(tmp_path / "two"))
    assert [path.name for path in written] == [path.name for path in again]
    for one, other in zip(written, again, strict=True):
        assert one.read_bytes() == other.read_bytes(), one.name
    pages = [path.read_text(encoding="utf-8") for path in written if path.suffix == ".html"]
    shown = made.report()
    assert [shown.html] == pages if pages else shown.html.count("<figure>") == len(written) - 1 > 0
    assert shown.save(tmp_path / "page.html").read_text(encoding="utf-8") == shown.html
    assert shown._repr_html_().startswith("<iframe")


@pytest.mark.parametrize("name", KINDS)
def test_a_result_prints_and_tabulates(name, request):
    made = request.getfixturevalue(name)
    frame, html = made.to_frame(), made._repr_html_()
    assert len(frame) == len(made.table().rows) == html.count("<tr>") - 1 > 0
    for column in frame.columns:
        assert column in repr(made)
        assert f">{escape(column)}</th>" in html


def test_a_comparison_holds_what_its_file_does(compared, tmp_path):
    content = json.loads(compared.write(tmp_path)[0].read_text())
    assert content == compared.content
    frame = compared.to_frame().set_index("variant")
    assert list(frame.index[:2]) == ["good", "bad"]
    by_name = {v["name"]: v for v in content["variants"]}
    assert frame["median [pu²]"]["bad"] == by_name["bad"]["objective"]["median"]
    assert frame["ERT [simulations]"]["good"] == pytest.approx(
        by_name["good"]["ert"]["simulations"][1], nan_ok=True
    )
    assert compared.sentences == content["sentences"]


def test_a_benchmark_is_the_same_by_names_and_by_settings_and_tells_of_each_run(benchmarked):
    told = []
    named = {
        "random_search": {"name": "random_search"},
        "issa_no_levy": {"name": "issa", "levy": False},
    }
    again = tractexp.benchmark(
        named,
        functions=[1, 15],
        dimensions=[2],
        instances=[1],
        multiplier=50,
        cores=1,
        progress=told.append,
    )
    assert again.to_dict() == benchmarked.to_dict()
    assert told == [f"{k} of 4 runs" for k in (1, 2, 3, 4)]
    assert benchmarked.optimizers["issa_no_levy"]["levy"] is False
    assert (
        benchmarked.bbob.share("issa_no_levy", 2, [1])
        == benchmarked.to_dict()["summary"][1]["groups"]["separable"]
    )


def test_medians_are_those_of_the_rows(generalised):
    rows = [
        r
        for r in generalised.residuals
        if (r["kind"], r["optimizer"]) == ("extrapolation", "brief")
    ]
    assert [row["seed"] for row in rows] == [0, 1]
    (middle,) = [
        r for r in generalised.medians if (r["kind"], r["optimizer"]) == ("extrapolation", "brief")
    ]
    for error in ("residual_P", "epsilon_q"):
        assert middle[error] == pytest.approx((rows[0][error] + rows[1][error]) / 2)
    assert rows[0]["residual_P"] != rows[1]["residual_P"]


def test_a_study_finds_what_an_identification_does(dips, model, generalised):
    """The same as an identification with these settings, seed by seed: its estimate first, then its
    searches.
    """
    assert [told["optimizer"] for told in generalised.identified] == ["estimate", "brief", "brief"]
    for told in generalised.identified:
        brief = {"name": "pso", "population": 20}
        fit = tractexp.identify(
            dips[1],
            model,
            optimizer=brief,
            seed=told["seed"],
            budget=200,
            check_intervals=False,
            progress=False,
        )
        estimate = told["optimizer"] == "estimate"
        assert told["objective"] == (
            fit.result.objective if estimate else fit.result.search["objective"]
        )
        assert told["parameters"] == (
            fit.result.parameters if estimate else fit.result.search["parameters"]
        )


def test_a_study_tells_what_it_reads_and_each_search(dips, capsys):
    lines = []
    tractexp.generalise(
        dips[1],
        validate=dips[0],
        optimizers=["issa_no_levy", "pso"],
        budget=50,
        progress=lines.append,
    )
    assert [line for line in lines if not line.startswith("  ")] == [
        f"fit: {dips[1]!r}",
        f"validate: {dips[0]!r}",
        lines[-3],
        "issa_no_levy, seed 0",
        "pso, seed 0",
    ]
    assert lines[-3].startswith(
        "model: electromechanical motor and exponential static load, 7 parameters"
    )
    capsys.readouterr()
    tractexp.generalise(dips[1], validate=dips[0], optimizers="pso", budget=50, progress=False)
    lines.clear()
    tractexp.paper(dips[1], parts=["figure3"], progress=lines.append)
    assert lines == ["Figures 3 and 4: maps and flights"]
    assert capsys.readouterr().out == ""


def test_claims_are_judged_and_counted(replicated):
    assert {claim.part for claim in replicated.claims} <= {"figure4", "figure6", "table2"}
    assert sum(replicated.counts.values()) == len(replicated.claims) > 0


def test_a_setup_poses_the_same_problem_after_travel(dips, model):
    """Through JSON, and through pickle once it holds what cannot be pickled."""
    setup = Setup.from_arguments(
        dips[1], model, dips[0], "huber", fixed={"C": 0.9}, bounds=None, seed=3, budget=10
    )
    one = setup.problem
    middle = (one.lower + one.upper)[None] / 2
    told = json.loads(json.dumps(tractexp.storage.files.make_plain(setup.to_dict())))
    packed = pickle.dumps(setup)
    assert len(packed) < 3 * len(pickle.dumps([setup.train, setup.validate]))
    for back in (
        Setup.from_dict(told),
        pickle.loads(packed),
        pickle.loads(pickle.dumps(setup.problem_of)).__self__,
    ):
        assert vars(back).keys() == vars(Setup.from_dict(told)).keys()
        two = back.problem
        assert one.space.names == two.space.names
        assert "C" not in one.space.names
        assert np.array_equal(one.objective(middle), two.objective(middle))
        assert (back.limits, back.seed, two.loss.name) == (setup.limits, 3, "huber")


def test_optimizers_are_given_by_name_by_settings_and_by_names_of_ones_own():
    def several(given):
        return {one.name: one.build("optimizer") for one in Choice.several("optimizer", given)}

    brief = {"name": "pso", "population": 20}
    pso, plain = build("optimizer", brief), build("optimizer", {"name": "pso"})
    assert several(["pso", "issa_no_levy"]) == {
        "pso": plain,
        "issa_no_levy": build("optimizer", {"name": "issa", "levy": False}),
    }
    assert several({"mine": brief, "theirs": "pso"}) == {"mine": pso, "theirs": plain}
    assert several([brief]) == several(brief) == {"pso": pso}
    assert several("pso") == {"pso": plain}
    assert several(None).keys() == {"issa"}


@pytest.mark.parametrize("forms", ["third_order_exponential", "mapping", "model"])
def test_a_study_takes_a_model_in_every_form(forms, dips, model):
    given = {"mapping": model.node, "model": model.model}.get(forms, forms)
    made = tractexp.generalise(
        dips[1], given, validate="tibet_30pct", optimizers="pso", budget=50, progress=False
    )
    same = tractexp.generalise(
        dips[1], validate=dips[0], optimizers="pso", budget=50, progress=False
    )
    assert made.identified == same.identified
    assert made.residuals == same.residuals


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda d: tractexp.compare("x", filter="y"), "sweep and filter are both given"),
        (lambda d: tractexp.compare("missing"), "sweep=missing is not a folder"),
        (lambda d: tractexp.compare("x", targets=[0.5]), "targets=0.5 is out of range"),
        (
            lambda d: tractexp.compare("x", targets="2"),
            "targets='2' is a text, but it must be a list, each a number",
        ),
        (lambda d: tractexp.compare("x", floor=0), "floor=0 must be an objective above 0"),
        (
            lambda d: tractexp.compare("x", tie=1),
            "compare() has no argument 'tie'; did you mean 'ties'?",
        ),
        (lambda d: tractexp.benchmark([]), "optimizers is empty"),
        (lambda d: tractexp.benchmark(["pso", "pso"]), "optimizers names pso twice"),
        (
            lambda d: tractexp.benchmark(["pos"]),
            "optimizer=pos: there is no such choice; did you mean 'pso'",
        ),
        (lambda d: tractexp.benchmark("issa_polish"), "set optimizer.polish=false"),
        (lambda d: tractexp.benchmark(["pso"], functions=[25]), "functions=25 is out of range"),
        (lambda d: tractexp.benchmark(["pso"], seed=-1), "seed=-1 is out of range"),
        (
            lambda d: tractexp.generalise(d, validate=[]),
            "generalise() needs dips that are not fitted: name them in validate",
        ),
        (
            lambda d: tractexp.generalise(d[1]),
            "generalise(): missing a required argument: 'validate'",
        ),
        (lambda d: tractexp.generalise("a.csv", validate=d), "a.csv: there is no such file"),
        (lambda d: tractexp.generalise([], validate=d), "records is empty"),
        (lambda d: tractexp.generalise(d, validate=d, budget=0), "budget=0 is out of range"),
        (lambda d: tractexp.generalise(d, validate=d, seeds=0), "seeds=0 is out of range"),
        (
            lambda d: tractexp.generalise(d, validate=d, fixed={"c": 1}),
            "fixed.c: this model has no parameter 'c'",
        ),
        (
            lambda d: tractexp.generalise(d, "third", validate=d),
            "model=third: there is no such choice",
        ),
        (lambda d: tractexp.paper(d[:1], parts=["table6"]), "parts=table6 is not one of"),
        (
            lambda d: tractexp.paper(d[:1], parts="table2"),
            "parts='table2' is a text, but it must be a list",
        ),
        (
            lambda d: tractexp.paper(d[:1], parts=["table5"]),
            "name one in validate, or leave the table out with parts",
        ),
        (lambda d: tractexp.paper(d[:1], seeds=0), "seeds=0 is out of range"),
    ],
)
def test_wrong_arguments_are_refused_in_a_sentence(call, sentence, dips):
    with pytest.raises(UserError) as refusal:
        call(dips)
    assert sentence in str(refusal.value)
