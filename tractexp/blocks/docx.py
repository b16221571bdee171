"""A report as a document for a word processor, by python-docx where that is installed: headings,
sentences, tables, and charts and equations as pictures.
"""

import io
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unicodedata import category

from tractexp.blocks import Report, Table
from tractexp.blocks import block as blocks
from tractexp.blocks.drawing import draw_chart, draw_equation
from tractexp.blocks.style import FAINT
from tractexp.errors import UserError
from tractexp.storage import files

PAPER, MARGIN = (21.0, 29.7), 2.0  # cm, A4
TEXT_WIDTH = PAPER[0] - 2 * MARGIN
EQUATION_SCALE = 0.8  # of an equation as it is drawn, so that its letters are as large as the text
TABLE_STYLE = "Light List Accent 1"
FONT = "Arial"
FONT_SIZES = {"Normal": 10, "Caption": 8, "Title": 20, "Heading 1": 13, "Heading 2": 11}  # points
TABLE_FONT_SIZE = 9  # points
LETTER, CELL_MARGIN = 0.18, 0.45  # cm of a table: one letter, both margins of a cell
MOST_ROWS_TOGETHER = 12  # of a table that stands on one page
LONGEST_WORD = 20  # letters that a column has room for; longer words, such as sums, are broken
FIRST_ROW = 0x20  # of the flags by which a table's style is applied: there is a head
SPACE = "Zs"  # category of what parts words and is shown, also without a break
LONGEST_TITLE = 255  # characters of a document's property
LEFT_OUT = "What the page moves or folds away, such as sliders, is left out of this document."


def save_document(report: Report, path: Path) -> Path:
    """Write a report as .docx, whole or not at all.

    Raises `UserError` without python-docx, and where it cannot be written.
    """
    try:
        import docx
    except ImportError:
        raise UserError(
            f"{path.name} needs python-docx; install it by: pip install 'tractexp[word]'"
        ) from None
    document = docx.Document()
    _set_paper(document.sections[0])
    _set_fonts(document)
    document.core_properties.title = _keep_visible(report.title)[:LONGEST_TITLE]
    document.add_heading(_keep_visible(report.title), 0)
    if report.lead:
        document.add_paragraph(_keep_visible(report.lead))
    with tempfile.TemporaryDirectory() as folder:
        for block in report.blocks:
            _add_block(document, block, Path(folder))
    if any(isinstance(block, blocks.Markup | blocks.Fold) for block in report.blocks):
        document.add_paragraph(LEFT_OUT)
    written = io.BytesIO()
    document.save(written)
    return files.write(path, written.getvalue())


def _add_block(document: Any, block: blocks.Block, folder: Path) -> None:
    """A block as paragraphs, a table or a picture; nothing for what only a page can show."""
    match block:
        case blocks.Heading(text, level):
            document.add_heading(_keep_visible(text), level - 1)
        case blocks.Paragraphs(texts):
            for text in texts:
                document.add_paragraph(_keep_visible(text))
        case blocks.VerdictBlock(texts):
            for text in texts:
                document.add_paragraph().add_run(_keep_visible(text)).bold = True
        case blocks.Items(texts):
            for text in texts:
                document.add_paragraph(_keep_visible(text), style="List Bullet")
        case blocks.CodeBlock(text):
            document.add_paragraph(_keep_visible(text), style="No Spacing")
        case Table():
            _add_table(document, block)
        case blocks.ChartBlock(chart, caption):
            _add_picture(document, draw_chart(chart, folder / "chart.png"))
            document.add_paragraph(_keep_visible(caption), style="Caption")
        case blocks.Equation(latex):
            _add_equation(document, latex, folder / "equation.png")


def _keep_visible(text: str) -> str:
    """A text as a document can hold it: what cannot be printed, such as control characters in the
    names of a record, as its escape.
    """
    kept = (c.isprintable() or c in "\n\t" or category(c) == SPACE for c in text)
    return "".join(c if keep else ascii(c)[1:-1] for c, keep in zip(text, kept, strict=True))


def _set_paper(section: Any) -> None:
    """A4 with its margins."""
    from docx.shared import Cm

    section.page_width, section.page_height = map(Cm, PAPER)
    for side in ("left", "right", "top", "bottom"):
        setattr(section, f"{side}_margin", Cm(MARGIN))


def _set_fonts(document: Any) -> None:
    """One font for text and headings, whose own are those of a theme; captions are no headings."""
    from docx.shared import Pt, RGBColor

    for name, size in FONT_SIZES.items():
        style = document.styles[name]
        style.font.name, style.font.size = FONT, Pt(size)
        fonts = style.element.rPr.rFonts
        for key in [key for key in fonts.attrib if key.endswith("Theme")]:
            del fonts.attrib[key]
    caption = document.styles["Caption"].font
    caption.bold, caption.color.rgb = False, RGBColor.from_string(FAINT.removeprefix("#"))


def _add_picture(document: Any, path: Path, scale: float | None = None) -> None:
    """A picture of so much of its own size, at most as wide as the text; as wide as the text where
    nothing is said.
    """
    from docx.shared import Cm

    shape, most = document.add_picture(str(path)), int(Cm(TEXT_WIDTH))
    width = most if scale is None else min(most, round(scale * shape.width))
    shape.width, shape.height = width, round(shape.height * width / shape.width)


def _add_equation(document: Any, latex: str, path: Path) -> None:
    """An equation as a picture; as LaTeX where mathtext cannot draw it."""
    drawn = draw_equation(latex, "png")
    if not drawn:
        document.add_paragraph(_keep_visible(latex))
        return
    files.write(path, drawn)
    _add_picture(document, path, EQUATION_SCALE)


def _add_table(document: Any, table: Table) -> None:
    """A table with its title above and its caption below; the end of a page parts no row and no
    short table, and a long one has its head on each.
    """
    from docx.oxml import OxmlElement
    from docx.shared import Cm

    if table.title:
        document.add_paragraph(_keep_visible(table.title), style="Caption")
    head = [list(table.columns)] if any(table.columns) else []
    rows = [*head, *table.cells]
    grid = document.add_table(len(rows), len(table.columns), style=TABLE_STYLE)
    grid.autofit = False
    widths = [Cm(width) for width in share_width(rows)]
    for column, width in zip(grid.columns, widths, strict=True):
        column.width = width
    left, together = {0, *table.words}, len(rows) <= MOST_ROWS_TOGETHER
    for line, row in zip(grid.rows, rows, strict=True):
        line._tr.get_or_add_trPr().append(OxmlElement("w:cantSplit"))
        for k, (cell, text, width) in enumerate(zip(line.cells, row, widths, strict=True)):
            cell.width = width
            paragraph = _fill_cell(cell, text, to_the_right=k not in left)
            paragraph.paragraph_format.keep_with_next = together and row is not rows[-1]
    if head:
        grid.rows[0]._tr.get_or_add_trPr().append(OxmlElement("w:tblHeader"))
    else:
        _take_off_head(grid)
    if table.caption:
        document.add_paragraph(_keep_visible(table.caption), style="Caption")


def _fill_cell(cell: Any, text: str, to_the_right: bool) -> Any:
    """Write a text into a cell, close to its edges; its paragraph."""
    from docx.enum.text import WD_ALIGN_PARAGRAPH
    from docx.shared import Pt

    (paragraph,) = cell.paragraphs
    paragraph.add_run(_keep_visible(text)).font.size = Pt(TABLE_FONT_SIZE)
    paragraph.paragraph_format.space_after = Pt(0)
    if to_the_right:
        paragraph.alignment = WD_ALIGN_PARAGRAPH.RIGHT
    return paragraph


def _take_off_head(grid: Any) -> None:
    """Let the first row of a table without a head look like the others."""
    from docx.oxml.ns import qn

    look = grid._tbl.tblPr.find(qn("w:tblLook"))
    look.set(qn("w:firstRow"), "0")
    look.set(qn("w:val"), f"{int(look.get(qn('w:val')), 16) & ~FIRST_ROW:04X}")


def share_width(rows: Sequence[Sequence[str]]) -> list[float]:
    """Widths [cm] of a table's columns: each has room for its longest word where there is, and what
    is left goes to those that need more lines.
    """
    columns = list(zip(*rows, strict=True))
    words = [[len(word) for cell in column for word in cell.split()] for column in columns]
    least = [CELL_MARGIN + LETTER * min(max(one, default=1), LONGEST_WORD) for one in words]
    whole = [CELL_MARGIN + LETTER * max(map(len, column)) for column in columns]
    if sum(whole) <= TEXT_WIDTH:
        return [width * TEXT_WIDTH / sum(whole) for width in whole]
    shrunk = min(1.0, TEXT_WIDTH / sum(least))
    wanted = [max(a - b, 0.0) for a, b in zip(whole, least, strict=True)]
    rest = (TEXT_WIDTH - shrunk * sum(least)) / (sum(wanted) or 1.0)
    return [shrunk * a + rest * b for a, b in zip(least, wanted, strict=True)]
