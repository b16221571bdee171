"""A report as Markdown; of its charts the captions."""

from collections.abc import Iterator

from tractexp.blocks.block import (
    Block,
    ChartBlock,
    Charts,
    CodeBlock,
    Equation,
    Figure,
    Fold,
    Heading,
    Items,
    Markup,
    Paragraphs,
    Report,
    Table,
    VerdictBlock,
)  # fmt: skip


def markdown(report: Report) -> str:
    """The whole report."""
    parts = [f"# {report.title}"] + [report.lead] * bool(report.lead)
    return "\n\n".join([*parts, *(part for block in report.blocks for part in _parts(block))]) + "\n"


def _parts(block: Block) -> Iterator[str]:
    match block:
        case Heading(text, level):
            yield f"{'#' * level} {text}"
        case Paragraphs(texts):
            yield from map(_escaped, texts)
        case VerdictBlock(texts):
            yield "\n>\n".join(f"> {_escaped(text)}" for text in texts)
        case Items(texts):
            yield "\n".join(f"- {_escaped(text)}" for text in texts)
        case CodeBlock(text):
            yield f"```\n{text}\n```"
        case Equation(latex):
            yield f"$$ {latex} $$"
        case Table():
            yield _table(block)
            if block.caption:
                yield _escaped(block.caption)
        case ChartBlock(_, caption) | Figure(_, caption):
            yield f"*Chart of the page: {_escaped(caption)}*"
        case Markup():
            return
        case Charts(charts):
            for chart in charts:
                yield from _parts(chart)
        case Fold(_, blocks):
            for inner in blocks:
                yield from _parts(inner)


def _table(table: Table) -> str:
    """The first column and those of words are to the left."""
    marks = ["---" if i == 0 or i in table.words else "---:" for i in range(len(table.columns))]
    lines = [[*table.columns], marks, *table.cells]
    return "\n".join(f"| {' | '.join(_escaped(str(cell)) for cell in line)} |" for line in lines)


def _escaped(text: str) -> str:
    """Text with the signs that Markdown would read as markup escaped."""
    return text if set(text) <= set("-:") else "".join(f"\\{c}" if c in "|*_<>[]" else c for c in text)
