"""A report as Markdown; of its charts the captions."""

from collections.abc import Iterator

from tractexp.blocks import Report, Table
from tractexp.blocks import block as blocks
from tractexp.text import quoting


def render_markdown(report: Report) -> str:
    """A report as Markdown."""
    parts = [f"# {quoting.markdown(report.title)}"]
    if report.lead:
        parts.append(quoting.markdown(report.lead))
    for block in report.blocks:
        parts.extend(_write_parts(block))
    return "\n\n".join(parts) + "\n"


def _write_parts(block: blocks.Block) -> Iterator[str]:
    """A block as paragraphs of Markdown."""
    match block:
        case blocks.Heading(text, level):
            yield f"{'#' * level} {quoting.markdown(text)}"
        case blocks.Paragraphs(texts):
            yield from map(quoting.markdown, texts)
        case blocks.VerdictBlock(texts):
            yield "\n>\n".join(f"> {quoting.markdown(text)}" for text in texts)
        case blocks.Items(texts):
            yield "\n".join(f"- {quoting.markdown(text)}" for text in texts)
        case blocks.CodeBlock(text):
            yield quoting.fence_markdown(text)
        case blocks.Equation(latex):
            yield f"$$ {latex} $$"
        case Table():
            yield _write_table(block)
            if block.caption:
                yield quoting.markdown(block.caption)
        case blocks.ChartBlock(_, caption) | blocks.Figure(_, caption):
            yield f"*Chart of the page: {quoting.markdown(caption)}*"
        case blocks.Markup():
            return
        case blocks.Charts(charts):
            for chart in charts:
                yield from _write_parts(chart)
        case blocks.Fold(_, parts):
            for inner in parts:
                yield from _write_parts(inner)


def _write_table(table: Table) -> str:
    """The first column and those of words are to the left."""
    marks = ["---" if i == 0 or i in table.words else "---:" for i in range(len(table.columns))]
    head, *rows = [
        [quoting.markdown(str(cell)) for cell in line] for line in (table.columns, *table.cells)
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, marks, *rows))
