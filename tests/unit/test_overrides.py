"""Names of files and channels on the command line as they stand: what Hydra reads of them is what
was meant.
"""

import shlex

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from nasty import NASTY
from omegaconf import OmegaConf

from tractexp.configuration.overrides import (
    build_typed_command,
    format_assignment,
    quote_override,
    quote_overrides,
    survey_of,
)
from tractexp.errors import UserError

FILES = [
    "站北.cfg",
    "name (1).cfg",
    "a=b.cfg",
    "Ф1 #2.cfg",
    "{x}.cfg",
    "it's.cfg",
    "~/x.cfg",
    "[1].cfg",
    "a b.cfg",
    "C:\\x\\y.cfg",
    'say "so".cfg',
    "100%.cfg",
    "back\\'slash.cfg",
    "plain.cfg",
    "folder/plain-2.cfg",
    "null (copy).csv",
    "ends[1]",
]


def read(argument):
    return OverridesParser.create().parse_override(argument).value()


@pytest.mark.parametrize("name", FILES)
def test_a_path_is_read_as_it_stands(name):
    assert read(quote_override(f"data.path={name}")) == name


@pytest.mark.parametrize("name", ["a,b.cfg", "[1,2].csv", "{a: b}"])
def test_a_file_that_is_there_is_meant_though_hydra_would_read_something_else(
    tmp_path, monkeypatch, name
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).touch()
    assert str(read(quote_override(f"data.path={name}"))) == name


@pytest.mark.parametrize(
    "names",
    [
        ["UA(kV)", "UB(kV)", "UC(kV)"],
        ["母线 Ua", "母线 Ub", "母线 Uc"],
        ["Ia_2СШ-110_ВЛ_ВЛ2", "x", "y"],
        ["a b.csv", "站.csv"],
        ["it's", "5'"],
        ["Ia [A]", "Ib [A]", "Ic [A]"],
        ["f(a,b)", "g"],
    ],
)
def test_a_list_of_names_is_read_as_it_stands(names):
    assert read(quote_override(f"data.voltages=[{','.join(names)}]")) == names


def test_numbers_of_channels_stay_numbers_beside_names():
    assert read(quote_override("data.voltages=[4,UA(kV),'5']")) == [4, "UA(kV)", "5"]


@pytest.mark.parametrize(
    "argument",
    [
        "seed=3",
        "data=csv",
        "data.path='a b.cfg'",
        "data.train=[a.csv,'b c.csv']",
        "data.pre=0.5",
        "-m",
        "~data.pre",
        "data.estimator={name: p_class}",
        "optimizer=issa,pso",
        "data.train=[[1],[2]]",
        "data.path=",
    ],
)
def test_what_hydra_reads_is_left_alone(argument):
    assert quote_override(argument) == argument


def test_a_setting_that_takes_names_of_its_own_is_added():
    assert quote_override("model.bounds.C=[0.5,0.9]") == "++model.bounds.C=[0.5,0.9]"
    columns = "data.columns={U: 'Voltage (kV)', t: time}"
    assert quote_override(columns) == f"++{columns}"
    assert quote_override("data.columns.U=Voltage (kV)") == "++data.columns.U='Voltage (kV)'"
    assert quote_override("data.units.t=ms") == "++data.units.t=ms"


def composed(words):
    """The values that arguments have in a configuration."""
    for word in quote_overrides(words):
        yield OmegaConf.to_container(OmegaConf.create({"a": read(word)}), resolve=True)["a"]


@pytest.mark.parametrize(
    "name", [name for name in NASTY if name and name.isprintable() and name != "???"]
)
def test_a_command_that_is_printed_means_the_name_that_it_holds(name):
    printed = shlex.split(build_typed_command({"name": "csv", "path": name, "train": [name, "b"]}))
    assert [*composed(printed[1:])] == ["csv", name, [name, "b"]]
    *_, path = shlex.split(survey_of(name))
    assert [*composed([path])] == [name]


@pytest.mark.parametrize("name", [name for name in NASTY if name and not name.isprintable()])
def test_a_name_that_cannot_be_printed_is_refused_in_one_line(name):
    with pytest.raises(UserError) as refused:
        quote_overrides([format_assignment("data.path", name)])
    assert len(str(refused.value).splitlines()) == 1


def test_an_interpolation_that_is_typed_stays_one_but_not_where_a_file_is_called_so(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PLACE", "there")
    name = "${oc.env:PLACE} (1).csv"
    assert [*composed([f"data.path={name}"])] == ["there (1).csv"]
    (tmp_path / name).touch()
    assert [*composed([f"data.path={name}"])] == [name]
