"""Pages as documents for a word processor, and charts as pictures."""

import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from browser import BROWSER

import tractexp
from tractexp.blocks import Report
from tractexp.blocks.block import Markup
from tractexp.blocks.chart import Chart
from tractexp.blocks.docx import LEFT_OUT, TEXT_WIDTH
from tractexp.blocks.drawing import draw_chart
from tractexp.errors import UserError

BLUE = "#0072B2"


@pytest.fixture(scope="module")
def fit():
    search = {"name": "multistart_least_squares", "starts": 2}
    return tractexp.identify("tibet_50pct", optimizer=search, check_intervals=False, progress=False)


def chart():
    x = np.linspace(0, 1, 50)
    made = Chart("t [s]", ["U [pu]", "P & Q [pu]"]).line("measured", x, x, BLUE)
    made.band("noise", x, x - 1, x + 1, BLUE, 1).line("rival", x, 2 * x, BLUE, 1, hidden=True)
    return made.units(["U [kV]", "P & Q [MW]"], [27.5, 40.0])


def test_a_page_is_a_document_with_its_tables_charts_and_equations(tmp_path):
    docx = pytest.importorskip("docx", reason="the extra [word] is not installed")
    page = Report("Load of <Nord>", "a lead").heading("Numbers").text("one", "two")
    page.verdict("USABLE.", kind="good").items(["an item"]).code("tractexp a b")
    page.table(["parameter", "value"], [["M", 0.0123456789]], "a caption").chart(chart(), "a dip")
    page.equation(r"\frac{a}{b}").equation(r"\begin{pmatrix} 1 \end{pmatrix}")
    page.add(Markup("<script></script>"))
    document = docx.Document(str(page.save(tmp_path / "sheet.docx")))
    told = [paragraph.text for paragraph in document.paragraphs]
    for text in ("Load of <Nord>", "a lead", "Numbers", "one", "two", "USABLE.", "an item"):
        assert text in told
    assert told[-1] == LEFT_OUT
    assert r"\begin{pmatrix} 1 \end{pmatrix}" in told  # beyond mathtext
    (table,) = document.tables
    rows = [[cell.text for cell in row.cells] for row in table.rows]
    assert rows == [["parameter", "value"], ["M", "0.012346"]]
    assert len(document.inline_shapes) == 2  # the chart and the first equation
    width = document.sections[0].page_width - 2 * document.sections[0].left_margin
    assert all(shape.width <= width for shape in document.inline_shapes)


def test_a_document_has_columns_by_their_words_and_equations_as_large_as_its_text(tmp_path):
    docx = pytest.importorskip("docx", reason="the extra [word] is not installed")
    from docx.oxml.ns import qn

    page = Report("a").equation("a = b").equation(r"\frac{a + b + c + d}{b}")
    page.table(["", "meaning"], [["C", " ".join(["words"] * 60)], ["x" * 64, "a sum"]])
    page.table(["", ""], [["command", "tractexp a"], ["tractexp", "0.2"]])
    document = docx.Document(str(page.save(tmp_path / "sheet.docx")))
    small, large = document.inline_shapes
    assert small.height < large.height < 3 * small.height
    assert small.width < large.width
    told, made = document.tables
    narrow, wide = (column.width for column in told.columns)
    assert 2 * narrow < wide
    assert 0.99 < (narrow + wide) / docx.shared.Cm(TEXT_WIDTH) < 1.01
    first_rows = [
        one._tbl.tblPr.find(qn("w:tblLook")).get(qn("w:firstRow")) for one in (told, made)
    ]
    assert first_rows == ["1", "0"], "a table without a head has none"
    assert all(row._tr.trPr.find(qn("w:cantSplit")) is not None for row in told.rows)
    assert document.styles["Heading 1"].font.name == document.styles["Normal"].font.name


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("\x1b[2J\u202ea", "\\x1b[2J\\u202ea"),
        ("a\0\udcff", "a\\x00\\udcff"),
        ("x" * 300, "x" * 300),
    ],
)
def test_names_that_xml_cannot_hold_are_shown_by_their_escapes(tmp_path, name, shown):
    docx = pytest.importorskip("docx", reason="the extra [word] is not installed")
    page = Report(f"Load {name}", name).heading(name).text(name).items([name]).code(name)
    page.table([name], [[name]], name).equation(rf"\begin{{x}} {name}").verdict(name, kind="good")
    document = docx.Document(str(page.save(tmp_path / "sheet.docx")))
    told = [paragraph.text for paragraph in document.paragraphs]
    assert told.count(shown) == 7
    assert [cell.text for row in document.tables[0].rows for cell in row.cells] == [shown] * 2
    assert document.core_properties.title == f"Load {shown}"[:255]


def test_without_the_library_the_sentence_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "docx", None)
    with pytest.raises(UserError, match=r"pip install 'tractexp\[word\]'"):
        Report("a").save(tmp_path / "a.docx")
    assert not (tmp_path / "a.docx").exists()


def test_a_chart_is_drawn_in_the_units_of_its_page_without_what_a_click_draws(tmp_path):
    drawn = draw_chart(chart(), tmp_path / "chart.svg").read_text(encoding="utf-8")
    assert "U [kV]" in drawn
    assert "P &amp; Q [MW]" in drawn
    assert "measured" in drawn
    assert "rival" not in drawn
    bars = Chart("gain", [""], log_x=True).bars("gain", ["a", "b"], [2, 1], BLUE)
    bars.points("best", [2], ["a"], BLUE)
    assert draw_chart(bars, tmp_path / "bars.png").stat().st_size > 1000
    waves = Chart("t [s]", ["i [pu]"]).samples("a", 0.0, 1e-3, np.sin(np.arange(300)), BLUE)
    waves.phasors("a", 0.0, 1e-3, np.ones(300) * (1 + 1j), BLUE, 0)
    assert "i [pu]" in draw_chart(waves, tmp_path / "waves.svg").read_text(encoding="utf-8")


def test_a_notebook_shows_the_answer_and_one_figure_beside_it(fit):
    shown = fit._repr_html_()
    assert shown.count("<svg") == 1
    assert shown.count("<table") == 1
    assert "height=" in shown
    for word in ("T_prime", "doubtful", "measured", "calculated"):
        assert word in shown
    alone = replace(fit, behind=None)._repr_html_()
    assert "<svg" not in alone
    assert "T_prime" in alone


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_a_sheet_is_printed_on_three_pages(fit, tmp_path):
    """Its short equations stand side by side: one below the other they take a page of their own."""
    page, printed = fit.sheet().save(tmp_path / "sheet.html"), tmp_path / "sheet.pdf"
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run"]
    command += [f"--user-data-dir={tmp_path / 'browser'}", "--virtual-time-budget=5000"]
    command += ["--host-resolver-rules=MAP * ~NOTFOUND", f"--print-to-pdf={printed}"]
    subprocess.run([*command, page.as_uri()], capture_output=True, timeout=120, check=True)
    assert len(re.findall(rb"/Type /Page\b", printed.read_bytes())) == 3
