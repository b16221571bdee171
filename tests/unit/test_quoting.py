"""Names that somebody else chose are text wherever they stand: one list of nasty ones, every
language.
"""

import ast
import csv
import html
import io
import json
import os
import re
import shlex
import subprocess

import pytest
import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser
from nasty import NASTY
from omegaconf import OmegaConf

from tractexp.text import quoting


@pytest.mark.parametrize("name", NASTY)
@pytest.mark.parametrize("quote", ['"""', "'''", '"', "'"])
def test_python_reads_the_name_back(name, quote):
    read = ast.literal_eval(f"{quote}{quoting.python(name)}{quote}")
    assert read == name.encode(errors="backslashreplace").decode()  # a file's name may be no UTF-8


@pytest.mark.parametrize("name", NASTY)
def test_modelica_ends_a_string_where_the_name_ends(name):
    literal = quoting.modelica(name)
    assert re.fullmatch(r'"(?:[^"\\]|\\["\\])*"', literal)
    assert re.sub(r"\\(.)", r"\1", literal[1:-1], flags=re.DOTALL) == name


@pytest.mark.parametrize("name", NASTY)
def test_a_page_reads_the_name_back_and_has_no_element_of_it(name):
    assert html.unescape(quoting.html(name)) == name
    assert not set(quoting.html(name)) & set("<>\"'")
    packed = quoting.script({"name": name})
    assert json.loads(packed) == {"name": name}
    assert "<" not in packed


@pytest.mark.parametrize("name", NASTY)
def test_hydra_and_its_files_read_the_name_back(name):
    value = OverridesParser.create().parse_override(f"a=[{quoting.hydra(name)}]").value()
    assert OmegaConf.to_container(OmegaConf.create({"a": value}), resolve=True) == {"a": [name]}
    if name.isascii() or name.isprintable():
        read = yaml.safe_load(quoting.yaml({"a": {"b": [name]}}))
        assert OmegaConf.to_container(OmegaConf.create(read), resolve=True) == {"a": {"b": [name]}}


@pytest.mark.parametrize("name", NASTY)
def test_a_shell_reads_the_name_back(name):
    assert shlex.split(quoting.shell("echo", name)) == ["echo", name]


@pytest.mark.parametrize("name", NASTY)
def test_a_comment_of_yaml_ends_where_its_line_ends(name):
    assert yaml.safe_load(f"# {quoting.comment(name)}\na: 1\n") == {"a": 1}


@pytest.mark.skipif(os.name == "nt", reason="as POSIX shells take it")
def test_a_word_with_single_quotes_is_read_easily_unless_double_ones_would_change_it():
    assert quoting.shell("a", "data=['b c']") == """a "data=['b c']\""""
    assert quoting.shell("'$HOME'") == """''"'"'$HOME'"'"''"""


def test_a_real_shell_runs_nothing_of_any_name(tmp_path):
    names = [name for name in NASTY if "\0" not in name]
    command = quoting.shell("printf", "%s\\0", *names)
    done = subprocess.run(["sh", "-c", command], capture_output=True, cwd=tmp_path, check=True)
    assert done.stdout.decode(errors="surrogateescape").split("\0")[:-1] == names
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", NASTY)
def test_markdown_has_the_name_in_one_line_and_ends_no_block(name):
    line = quoting.markdown(name)
    assert len(line.splitlines()) <= 1
    assert re.sub(r"\\([^\w\s])", r"\1", line) == " ".join(name.splitlines())
    assert not re.search(r"(?<!\\)(?:\\\\)*[`<>|*_$\[\]]", line)
    assert quoting.markdown_again(line) == line
    fence, *inside, last = quoting.fence_markdown(name).split("\n")
    assert fence == last == "`" * len(fence)
    assert not any(fence in each for each in inside)


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("=1+1", "'=1+1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("-2+3", "'-2+3"),
        ("\t=1", "'\t=1"),
        ("a=1", "a=1"),
        ("", ""),
    ],
)
def test_a_spreadsheet_takes_no_cell_for_a_formula(text, cell):
    assert quoting.cell(text) == cell


@pytest.mark.parametrize(
    "name", [name for name in NASTY if name.isprintable()] + ["a\nb", "a\r\nb", "\t"]
)
def test_a_row_of_csv_keeps_the_name_in_its_cell(name):
    ((first, second),) = csv.reader(io.StringIO(f"{quoting.csv(name)},1\r\n", newline=""))
    assert (first.removeprefix("'") if first != name else first, second) == (name, "1")
    assert not first.startswith(quoting.FORMULA)


@pytest.mark.parametrize(
    ("word", "quoted"),
    [
        ("data.path=C:\\records\\a.cfg", "data.path=C:\\records\\a.cfg"),
        ("data.voltages=[4,5,6]", '"data.voltages=[4,5,6]"'),
        ("data.path=C:\\my records\\", '"data.path=C:\\my records\\\\"'),
        ('say "so"', '"say \\"so\\""'),
        ('a\\"b', '"a\\\\\\"b"'),
        ("it's", '"it\'s"'),
        ("", '""'),
    ],
)
def test_a_word_for_both_shells_of_windows(word, quoted):
    """As the C runtime of Windows reads its command line: 2n backslashes before a quote are n."""
    assert quoting.quote_for_windows(word) == quoted
