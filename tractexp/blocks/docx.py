"""A report as a document for a word processor, by python-docx where that is installed: headings,
sentences, tables, and charts and equations as pictures.
"""

import io
import tempfile
from pathlib import Path
from typing import Any

from tractexp.blocks import Report, Table
from tractexp.blocks import block as blocks
from tractexp.blocks.drawing import draw_chart, draw_equation
from tractexp.errors import UserError
from tractexp.storage import files

PAPER, MARGIN = (21.0, 29.7), 2.0  # cm, A4
TEXT_WIDTH = PAPER[0] - 2 * MARGIN
EQUATION_HEIGHT = 0.9  # cm
TABLE_STYLE = "Light List Accent 1"
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
    document.core_properties.title = report.title
    document.add_heading(report.title, 0)
    if report.lead:
        document.add_paragraph(report.lead)
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
            document.add_heading(text, level - 1)
        case blocks.Paragraphs(texts):
            for text in texts:
                document.add_paragraph(text)
        case blocks.VerdictBlock(texts):
            for text in texts:
                document.add_paragraph().add_run(text).bold = True
        case blocks.Items(texts):
            for text in texts:
                document.add_paragraph(text, style="List Bullet")
        case blocks.CodeBlock(text):
            document.add_paragraph(text, style="No Spacing")
        case Table():
            _add_table(document, block)
        case blocks.ChartBlock(chart, caption):
            _add_picture(document, draw_chart(chart, folder / "chart.png"))
            document.add_paragraph(caption, style="Caption")
        case blocks.Equation(latex):
            _add_equation(document, latex, folder / "equation.png")


def _set_paper(section: Any) -> None:
    """A4 with its margins."""
    from docx.shared import Cm

    section.page_width, section.page_height = map(Cm, PAPER)
    for side in ("left", "right", "top", "bottom"):
        setattr(section, f"{side}_margin", Cm(MARGIN))


def _add_picture(document: Any, path: Path, height: float | None = None) -> None:
    """A picture of that height [cm], as wide as the text where that is less."""
    from docx.shared import Cm

    shape = document.add_picture(str(path), height=None if height is None else Cm(height))
    most = int(Cm(TEXT_WIDTH))
    if height is None or shape.width > most:
        shape.width, shape.height = most, round(shape.height * most / shape.width)


def _add_equation(document: Any, latex: str, path: Path) -> None:
    """An equation as a picture; as LaTeX where mathtext cannot draw it."""
    drawn = draw_equation(latex, "png")
    if not drawn:
        document.add_paragraph(latex)
        return
    files.write(path, drawn)
    _add_picture(document, path, EQUATION_HEIGHT)


def _add_table(document: Any, table: Table) -> None:
    """A table with its title above and its caption below."""
    if table.title:
        document.add_paragraph(table.title, style="Caption")
    head = [list(table.columns)] if any(table.columns) else []
    rows = [*head, *table.cells]
    grid = document.add_table(len(rows), len(table.columns), style=TABLE_STYLE)
    for line, row in zip(grid.rows, rows, strict=True):
        for cell, text in zip(line.cells, row, strict=True):
            cell.text = text
    if table.caption:
        document.add_paragraph(table.caption, style="Caption")
