"""A page is one file that needs nothing else, whatever is written into it."""

import re
import warnings
from xml.etree import ElementTree

import numpy as np
import pytest
from nasty import NASTY
from pages import read

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.errors import UserError
from tractexp.report import figures

HOSTILE = '<script>alert("x & y")</script>'


@pytest.fixture
def drawing(tmp_path):
    t, power = np.arange(50.0), np.geomspace(1, 1e-5, 50)
    return figures.fit(
        tmp_path / "fit.svg",
        t,
        t,
        (power, power),
        (power, power),
        title="a fit",
        epsilon=(0.0, 0.0),
    )


def test_whatever_is_written_is_escaped(tmp_path, drawing):
    page = (
        Report(HOSTILE, HOSTILE)
        .heading(HOSTILE)
        .text(HOSTILE)
        .verdict(HOSTILE, kind="bad")
        .items([HOSTILE])
    )
    page.chart(
        Chart(HOSTILE, [HOSTILE]).line(HOSTILE, np.arange(3), np.arange(3), "#000000"), HOSTILE
    )
    page.table([HOSTILE, "b"], [[HOSTILE, "1"]], HOSTILE).figure(drawing, HOSTILE).equation(HOSTILE)
    with page.fold_blocks(HOSTILE):
        page.text("inside")
    reader = read(page.save(tmp_path / "page.html"))
    assert reader.words.count(HOSTILE) >= 10
    assert "inside" in reader.words


@pytest.mark.parametrize("name", [name for name in NASTY if name.isprintable() and name.strip()])
def test_a_nasty_name_is_a_word_of_the_page_and_of_a_figure(name, tmp_path):
    t = np.arange(5.0)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")  # which the reader's font has, if not ours
        drawing = figures.draw_response(tmp_path / "a.svg", t, t, (t, t), title=name, notes=(name,))
    assert name in [text for node in ElementTree.parse(drawing).iter() if (text := node.text)]
    page = Report(name, name).text(name).items([name]).code(name).figure(drawing, name)
    page.table([name], [[name]], name).chart(Chart(name, [name]).line(name, t, t, "#000000"), name)
    reader = read(page.save(tmp_path / "page.html"))
    assert reader.words.count(name) >= 8


def test_two_copies_of_a_figure_keep_apart(tmp_path, drawing):
    reader = read(Report("twice").figure(drawing).figure(drawing).save(tmp_path / "page.html"))
    assert reader.tags.count("svg") == 2
    assert any(reference.startswith("#f1-") for reference in reader.references)
    assert any(reference.startswith("#f2-") for reference in reader.references)
    assert reader.words.count("t [s]") == 2


def test_the_same_page_has_the_same_bytes(tmp_path, drawing):
    def write(name):
        return (
            Report("same")
            .figure(drawing)
            .equation(r"\frac{a}{b}")
            .save(tmp_path / name)
            .read_bytes()
        )

    assert write("one.html") == write("two.html")


def test_every_equation_of_the_model_is_typeset(tmp_path):
    from tractexp.configuration.plugin import build
    from tractexp.model.model import compose

    model = compose(
        build("model/motor", {"name": "electromechanical"}),
        build("model/static", {"name": "exponential"}),
    )
    page = Report("equations")
    for latex in model.latex():
        page.equation(latex)
    reader = read(page.save(tmp_path / "page.html"))
    assert reader.tags.count("svg") == len(model.latex()) > 5
    assert "code" not in reader.tags


def test_equations_of_a_page_share_the_outlines_of_letters(tmp_path):
    page = Report("equations").equation("a + b").equation("b + c").equation("a + b")
    text = page.save(tmp_path / "page.html").read_text(encoding="utf-8")
    outlines, drawn = (
        re.findall(rf'{mark}(Cm\w+-[0-9a-f]+)"', text) for mark in ('path id="', 'href="#')
    )
    assert len(outlines) == len({*outlines}) == 4  # a, b, c and the plus
    assert {*drawn} == {*outlines}
    assert len(drawn) == 9
    read(tmp_path / "page.html")


def test_latex_beyond_mathtext_is_shown_as_it_is(tmp_path):
    latex = r"\begin{pmatrix} 1 & 2 \end{pmatrix}"
    reader = read(Report("matrix").equation(latex).save(tmp_path / "page.html"))
    assert latex in reader.words
    assert "svg" not in reader.tags


def test_a_table_is_as_wide_as_its_columns(tmp_path):
    reader = read(
        Report("t").table(["a", "b", "c"], [["1", "2", "3"]] * 4).save(tmp_path / "page.html")
    )
    assert (reader.tags.count("th"), reader.tags.count("td"), reader.tags.count("tr")) == (3, 12, 5)
    with pytest.raises(ValueError, match="a row of 1 cells"):
        Report("t").table(["a", "b"], [["1"]])


def test_a_figure_that_is_not_there_or_not_svg_is_refused(tmp_path):
    with pytest.raises(UserError, match=r"missing\.svg cannot be read: No such file"):
        Report("p").figure(tmp_path / "missing.svg")
    (tmp_path / "plain.svg").write_text("nothing")
    with pytest.raises(UserError, match="is not SVG"):
        Report("p").figure(tmp_path / "plain.svg")
    with pytest.raises(UserError, match="did you mean 'good'"):
        Report("p").verdict("x", kind="god")


def test_a_page_that_cannot_be_written_is_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"page\.html cannot be written: "):
        Report("p").save(tmp_path / "file" / "page.html")
