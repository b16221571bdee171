"""A model's file may come from a stranger: values of a model are read, anything else is refused in
a sentence.
"""

import pytest

import tractexp
from tractexp.configuration.composition import read_choice
from tractexp.configuration.model_file import LARGEST, read_model_file
from tractexp.configuration.overrides import quote_overrides
from tractexp.configuration.repeatable import explain_refusal
from tractexp.errors import UserError
from tractexp.storage.yaml_files import DEEPEST

GOOD = """\
# A comment, and @package hydra within it
defaults:
- motor: electromechanical
- static: exponential
- _self_
effects: [stator_resistance]
bounds: {T_prime: [1e-3, 0.5]}
fixed: {C: 0.8}
"""


@pytest.fixture
def write(tmp_path):
    def written(text, name="mine.yaml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return written


def test_a_file_of_a_model_is_read_for_python(write):
    model = tractexp.compose(write(GOOD))
    assert (model.motor["name"], model.effects) == ("electromechanical", ["stator_resistance"])
    assert (model.bounds, model.fixed) == ({"T_prime": [1e-3, 0.5]}, {"C": 0.8})


def test_a_file_may_begin_with_a_shipped_choice(write):
    content = read_choice(
        "model", str(write("defaults: [third_order_zip, _self_]\nfixed: {C: 0.9}\n"))
    )
    assert content == {
        "motor": {"name": "electromechanical"},
        "static": {"name": "zip"},
        "fixed": {"C": 0.9},
    }


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "hydra: {callbacks: {x: {_target_: numpy.testing.measure}}}",
            "'hydra' is no key of a model",
        ),
        ("defaults: [/hydra/launcher@hydra.launcher: x]", "its defaults have"),
        ("defaults: ['override /optimizer: pso']", "its defaults have override /optimizer"),
        ("defaults: [{/model/motor: electromechanical}]", "its defaults have"),
        ("defaults: [{motor: ../../x}]", "its defaults have"),
        ("defaults: [../other]", "its defaults have ../other"),
        ("fixed: {C: '${oc.env:SECRET}'}", r"model\.fixed\.C is \$\{oc\.env"),
        ("effects: ['???']", "no references to others"),
        ("effects: !!python/object/apply:os.system [ls]", "not valid YAML"),
        ("fixed: &a {C: *a}", "aliases written out"),
        (
            "fixed: " + "[" * (DEEPEST + 5) + "]" * (DEEPEST + 5),
            f"more than {DEEPEST} deep",
        ),
        ("fixed: " + "[" * 100_000, f"more than {DEEPEST} deep"),
        ("fixed: {1: 2}", "keys are names"),
        ("- a list", "must hold keys and values"),
        ("fixed: {C", "not valid YAML"),
        ("fixed: {C: 2026-13-45}", "not valid YAML"),
        ("# " + "x" * LARGEST, "a file of its kind at most"),
    ],
)
def test_what_is_no_model_is_refused(write, text, sentence):
    with pytest.raises(UserError, match=sentence):
        read_model_file(write(text))


def test_a_file_that_is_missing_or_no_text_is_refused(tmp_path):
    with pytest.raises(UserError, match="there is no such file"):
        read_model_file(tmp_path / "no.yaml")
    (tmp_path / "odd.yaml").write_bytes(b"fixed: \xff")
    with pytest.raises(UserError, match="byte 8 is not UTF-8"):
        read_model_file(tmp_path / "odd.yaml")


def test_a_path_is_a_model_on_the_command_line(write, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = write(GOOD)
    assert quote_overrides(["model=mine.yaml", "data=tibet"]) == [f"model='{path}'", "data=tibet"]
    odd = write(GOOD, "mein, 'Modell' [1].yaml")
    assert quote_overrides([f"model={odd.name}"]) == [
        "model='" + str(odd).replace("'", "\\'") + "'"
    ]
    kept = quote_overrides(["model=mine.yaml"]) + quote_overrides([f"model={odd.name}"])
    assert [*map(explain_refusal, kept)] == ["", ""]  # a folder keeps them so, and repeats the run
    assert explain_refusal("model='/a/b.yaml' + 'c'") != ""
    assert quote_overrides(["model=mine.yaml,third_order_zip"]) == [
        f"model='{path}',third_order_zip"
    ]
    with pytest.raises(UserError, match="there is no such file"):
        quote_overrides(["model=other.yaml"])


@pytest.mark.parametrize("flag", [["--config-dir", "conf"], ["--config-dir=conf"], ["-cd", "conf"]])
def test_a_model_of_a_folder_is_its_file(write, tmp_path, monkeypatch, flag):
    """Where nothing else lies in the folder, Hydra does not look at it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "conf" / "model").mkdir(parents=True)
    path = write(GOOD, "conf/model/extended.yaml")
    assert quote_overrides([*flag, "model=extended"]) == [f"model='{path}'"]
    assert quote_overrides([*flag, "model=third_order_zip"]) == [*flag, "model=third_order_zip"]
    own = write(GOOD, "conf/model/third_order_zip.yaml")  # one's own folder replaces ours
    assert quote_overrides([*flag, "model=third_order_zip"]) == [f"model='{own}'"]
    (tmp_path / "conf" / "experiment").mkdir()
    write("", "conf/experiment/own.yaml")
    assert quote_overrides([*flag, "model=extended"]) == [*flag, f"model='{path}'"]
