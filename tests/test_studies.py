"""The studies as public calls: results that print, tabulate, save, load and write the same page again; refusals."""

import json

import numpy as np
import pytest
from test_compare import samples, write_sweep

import tractexp
from tractexp.api.inputs import Setup, events, optimizers_by_name, settings
from tractexp.errors import UserError
from tractexp.identification.result import parts
from tractexp.model.model import compose
from tractexp.plugin import build

NODE = {"motor": {"name": "electromechanical"}, "static": {"name": "exponential"}, "effects": []}


@pytest.fixture(scope="module")
def model():
    return compose(*parts(NODE))


@pytest.fixture(scope="module")
def dips():
    """The shipped records: 30, 50 and 65 %."""
    files = [f"pkg://tractexp.data/tibet_{depth}pct.csv" for depth in (30, 50, 65)]
    return build("data", {"name": "csv", "train": files}).read().train


@pytest.fixture(scope="module")
def generalised(dips, model):
    return tractexp.generalise(
        [dips[1]], [dips[0], dips[2]], model=model, optimizers={"brief": {"name": "pso", "population": 20}}, seeds=2,
        budget=200,
    )  # fmt: skip


@pytest.fixture(scope="module")
def replicated(dips, model):
    return tractexp.paper([dips[1]], [dips[0]], model=model, parts=["figure4", "figure6", "table2"], seeds=1,
                          budget=200, workers=1)  # fmt: skip


@pytest.fixture(scope="module")
def benchmarked():
    pytest.importorskip("ioh", reason="the extra [benchmark] is not installed")
    return tractexp.benchmark(["random_search", build("optimizer", {"name": "pso"})], functions=[1, 15],
                              dimensions=[2], instances=[1], multiplier=50, cores=1)  # fmt: skip


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compared") / "sweep"
    write_sweep(folder, samples({"good": 1.0, "bad": 2.0, "worst": 8.0}, seeds=range(8)))
    return tractexp.compare(folder, targets=[2, 1.1], floor=1e-6)


KINDS = ["compared", "benchmarked", "generalised", "replicated"]


@pytest.mark.parametrize("name", KINDS)
def test_a_result_comes_back_from_its_file_and_writes_the_same_folder(name, request, tmp_path):
    made = request.getfixturevalue(name)
    back = type(made).load(made.save(tmp_path / "saved.json"))
    assert back.to_dict().keys() == made.to_dict().keys()
    assert repr(back) == repr(made)
    page, again = made.report(tmp_path / "one"), back.report(tmp_path / "two")
    assert page.name == again.name
    written = sorted(path.name for path in page.parent.iterdir())
    assert written == sorted(path.name for path in again.parent.iterdir())
    for each in written:
        assert (page.parent / each).read_bytes() == (again.parent / each).read_bytes(), each


@pytest.mark.parametrize("name", KINDS)
def test_a_result_prints_and_tabulates(name, request):
    made = request.getfixturevalue(name)
    frame, html = made.to_frame(), made._repr_html_()
    assert len(frame) == len(made.table().rows) == html.count("<tr>") - 1 > 0
    for column in frame.columns:
        assert column in repr(made)
        assert f"<th>{column}</th>" in html.replace("&#x27;", "'")


def test_a_comparison_holds_what_its_file_does(compared, tmp_path):
    content = json.loads((compared.report(tmp_path).parent / "comparison.json").read_text())
    assert content == compared.content
    frame = compared.to_frame().set_index("variant")
    assert list(frame.index[:2]) == ["good", "bad"]
    by_name = {v["name"]: v for v in content["variants"]}
    assert frame["median [pu²]"]["bad"] == by_name["bad"]["objective"]["median"]
    assert frame["ERT [simulations]"]["good"] == pytest.approx(by_name["good"]["ert"]["simulations"][1], nan_ok=True)
    assert compared.sentences == content["sentences"]


def test_a_benchmark_is_told_the_same_by_names_and_by_plugins(benchmarked):
    again = tractexp.benchmark({"random_search": {"name": "random_search"}, "pso": "pso"}, functions=[1, 15],
                               dimensions=[2], instances=[1], multiplier=50, cores=1)  # fmt: skip
    assert again.to_dict() == benchmarked.to_dict()
    assert benchmarked.made.share("pso", 2, [1]) == benchmarked.to_dict()["summary"][1]["groups"]["separable"]


def test_medians_are_those_of_the_rows(generalised):
    rows = [row for row in generalised.residuals if row["kind"] == "extrapolation"]
    assert [row["seed"] for row in rows] == [0, 1]
    (middle,) = [row for row in generalised.medians if row["kind"] == "extrapolation"]
    for error in ("residual_P", "epsilon_q"):
        assert middle[error] == pytest.approx((rows[0][error] + rows[1][error]) / 2)
    assert rows[0]["residual_P"] != rows[1]["residual_P"]


def test_the_task_identifies_what_the_call_does(dips, model, generalised):
    """The same as an identification with these settings, seed by seed."""
    from tractexp.identification.problem import Problem
    from tractexp.identification.search import Limits, search

    problem = Problem(model, events(dips[1]))
    for told in generalised.identified:
        brief = build("optimizer", {"name": "pso", "population": 20})
        found = search(problem, brief, told["seed"], Limits(200))
        assert told["objective"] == found.objective
        assert list(told["parameters"].values()) == problem.full(found.values)[0].tolist()


def test_claims_are_judged_and_counted(replicated):
    assert {claim.part for claim in replicated.claims} <= {"figure4", "figure6", "table2"}
    assert sum(replicated.counts.values()) == len(replicated.claims) > 0


def test_a_setup_poses_the_same_problem_after_travel(dips, model):
    setup = Setup.of(dips[1], [dips[0]], model, {"fixed": {"C": 0.9}, "bounds": None}, "huber", 3, budget=10)
    back = Setup.from_dict(json.loads(json.dumps(tractexp.files.plain(setup.to_dict()))))
    one, two = setup.problem(), back.problem()
    middle = (one.lower + one.upper)[None] / 2
    assert one.space.names == two.space.names
    assert "C" not in one.space.names
    assert np.array_equal(one.objective(middle), two.objective(middle))
    assert back.search_limits == setup.search_limits
    assert two.loss.name == "huber"


def test_optimizers_are_given_by_name_by_settings_and_as_plugins():
    pso = build("optimizer", {"name": "pso", "population": 20})
    assert optimizers_by_name(["pso", "issa"]).keys() == {"pso", "issa"}
    assert optimizers_by_name({"mine": pso}) == {"mine": pso}
    assert optimizers_by_name([settings(pso)]) == {"pso": pso}


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda d, m: tractexp.compare("x", filter="y"), "sweep and filter are both given"),
        (lambda d, m: tractexp.compare("missing"), "missing is not a folder"),
        (lambda d, m: tractexp.compare("x", targets=[0.5]), "targets=0.5 is out of range"),
        (lambda d, m: tractexp.compare("x", floor=0), "floor=0 must be an objective above 0"),
        (lambda d, m: tractexp.benchmark([]), "optimizers is empty"),
        (lambda d, m: tractexp.benchmark(["pos"]), "there is no optimizer 'pos'; did you mean 'pso'"),
        (lambda d, m: tractexp.benchmark(["pso"], functions=[25]), "functions=25 is out of range"),
        (lambda d, m: tractexp.benchmark(["pso"], seed=-1), "seed=-1 is out of range"),
        (lambda d, m: tractexp.generalise(d[1:2], [], model=m, optimizers=["pso"]), "needs dips that are not fitted"),
        (lambda d, m: tractexp.generalise(["a.csv"], d, model=m, optimizers=["pso"]), "'a.csv' is of type str; give"),
        (lambda d, m: tractexp.generalise(d, d, model=m, optimizers=["pso"], budget=0), "budget=0 is out of range"),
        (
            lambda d, m: tractexp.generalise(d, d, model=m, optimizers=["pso"], fixed={"c": 1}),
            "this model has no parameter 'c'",
        ),
        (lambda d, m: tractexp.paper(d[:1], model=m, parts=["table6"]), "parts=table6 is not one of"),
        (lambda d, m: tractexp.paper(d[:1], model=m, parts=["table5"]), "no held-out event for the extrapolation"),
        (lambda d, m: tractexp.paper(d[:1], model=m, seeds=0), "seeds=0 is out of range"),
    ],
)
def test_wrong_arguments_are_refused_in_a_sentence(call, sentence, dips, model):
    with pytest.raises(UserError) as refusal:
        call(dips, model)
    assert sentence in str(refusal.value)
