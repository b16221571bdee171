"""What a report is made of: blocks of a few kinds, which a terminal, a page, a notebook, Markdown
and JSON show.
"""

import dataclasses
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.errors import UserError, check_choice
from tractexp.storage import files

if TYPE_CHECKING:
    import pandas

    from tractexp.blocks.chart import Chart

KINDS = ("plain", "good", "bad")


@dataclass(frozen=True)
class Heading:
    """The head of a section; level 2 is the highest below the title."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Paragraphs:
    """Sentences, each a paragraph on a page and a line on a terminal."""

    texts: Sequence[str]


@dataclass(frozen=True)
class VerdictBlock:
    """The sentences that the reader should take away, framed as "plain", "good" or "bad"."""

    texts: Sequence[str]
    kind: str = "plain"


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    texts: Sequence[str]


@dataclass(frozen=True)
class CodeBlock:
    """A line to be copied."""

    text: str


@dataclass(frozen=True)
class Equation:
    """A displayed equation in LaTeX."""

    latex: str


@dataclass(frozen=True, repr=False)
class Table:
    """Rows under columns: cells are numbers, texts or None.

    `words` counts the columns that hold words, beside the first; `detail` those that a page shows
    and a terminal, a notebook and a frame's reader at a glance do not need. `caption` stands below,
    `title` above.
    """

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    title: str = ""
    caption: str = ""
    words: Collection[int] = ()
    detail: Collection[int] = ()

    def __post_init__(self) -> None:
        """Raise ValueError for a row of more or fewer cells than there are columns."""
        if wrong := next((row for row in self.rows if len(row) != len(self.columns)), None):
            raise ValueError(
                f"a row of {len(wrong)} cells in a table of {len(self.columns)} columns: {wrong}"
            )

    @property
    def cells(self) -> list[list[str]]:
        """The rows as they are read."""
        return [[format_cell(cell) for cell in row] for row in self.rows]

    @property
    def brief(self) -> "Table":
        """The table without its columns of detail."""
        columns = [k for k in range(len(self.columns)) if k not in self.detail]
        words = [at for at, k in enumerate(columns) if k in self.words]
        rows = [[row[k] for k in columns] for row in self.rows]
        return dataclasses.replace(
            self, columns=[self.columns[k] for k in columns], rows=rows, words=words, detail=()
        )

    def __repr__(self) -> str:
        """The table as a terminal shows it."""
        return str(Report().add(self))

    def _repr_html_(self) -> str:
        """The table as a notebook shows it."""
        return Report().add(self).fragment

    def to_frame(self) -> "pandas.DataFrame":
        """A pandas frame of the rows."""
        import pandas

        return pandas.DataFrame([list(row) for row in self.rows], columns=list(self.columns))


def format_cell(cell: Any) -> str:
    """A cell as it is read: "" for None, five digits of a number.

    Examples
    --------
    >>> format_cell(None), format_cell(0.1234567), format_cell(3)
    ('', '0.12346', '3')
    """
    if cell is None:
        return ""
    return f"{cell:.5g}" if isinstance(cell, float) else str(cell)


@dataclass(frozen=True)
class ChartBlock:
    """A chart to look into, and what it shows."""

    chart: "Chart"
    caption: str = ""


@dataclass(frozen=True)
class Charts:
    """Small charts side by side."""

    charts: Sequence[ChartBlock]


@dataclass(frozen=True)
class Figure:
    """A drawing in SVG, and what it shows."""

    svg: str
    caption: str


@dataclass(frozen=True)
class Markup:
    """HTML of our own, for what a page does and no other block can. What stands in it is escaped
    already.
    """

    html: str


@dataclass(frozen=True)
class Fold:
    """Blocks that a page hides until the reader opens them."""

    summary: str
    blocks: Sequence["Block"]


Block = (
    Heading
    | Paragraphs
    | VerdictBlock
    | Items
    | CodeBlock
    | Equation
    | Table
    | ChartBlock
    | Charts
    | Figure
    | Markup
    | Fold
)


class Report:
    """Blocks in order, below a title and a lead. Every method that adds one returns the report.

    A terminal shows what can be read there: no charts, figures and folded blocks, and no columns of
    detail. A page with `reload` loads itself again after so many seconds.
    """

    def __init__(self, title: str = "", lead: str = "", reload: int | None = None):
        """An empty page with a title and a sentence below it; with `reload` [s] it loads itself
        again.
        """
        self.title, self.lead, self.reload = title, lead, reload
        self.blocks: list[Block] = []

    def add(self, *blocks: Block) -> "Report":
        """Add blocks, and return the report."""
        self.blocks += blocks
        return self

    def heading(self, text: str, level: int = 2) -> "Report":
        """Add a heading of that level."""
        return self.add(Heading(text, level))

    def text(self, *paragraphs: str) -> "Report":
        """Add paragraphs, if there are any."""
        return self.add(Paragraphs(paragraphs)) if paragraphs else self

    def verdict(self, *paragraphs: str, kind: str = "plain") -> "Report":
        """Add paragraphs in a frame of that kind."""
        check_choice("kind", kind, KINDS)
        return self.add(VerdictBlock(paragraphs, kind))

    def items(self, texts: Sequence[str]) -> "Report":
        """Add a list, if it has items."""
        return self.add(Items(texts)) if texts else self

    def code(self, text: str) -> "Report":
        """Add a text that is shown as it stands."""
        return self.add(CodeBlock(text))

    def equation(self, latex: str) -> "Report":
        """Add an equation."""
        return self.add(Equation(latex))

    def table(
        self,
        columns: Sequence[str],
        rows: Sequence[Sequence[Any]],
        caption: str = "",
        words: Sequence[int] = (),
        title: str = "",
        detail: Collection[int] = (),
    ) -> "Report":
        """Add a table; columns by number in `words` wrap, those in `detail` are shown on demand."""
        return self.add(Table(columns, rows, title, caption, words=words, detail=detail))

    def chart(self, chart: "Chart", caption: str = "") -> "Report":
        """Add a chart with a caption."""
        return self.add(ChartBlock(chart, caption))

    def charts(self, charts: Sequence["Chart"], caption: str = "") -> "Report":
        """Add charts side by side, with one caption."""
        self.add(Charts([ChartBlock(chart) for chart in charts]))
        return self.text(caption) if caption else self

    def figure(self, path: Path, caption: str = "") -> "Report":
        """An SVG file. Raises `UserError` where it is not there or not SVG."""
        path = Path(path)
        try:
            drawing = files.read_text(path)
        except OSError as error:
            raise UserError(f"the figure {path} cannot be read: {error.strerror}") from error
        if "<svg" not in drawing:
            raise UserError(f"the figure {path} is not SVG, the only kind a page can hold")
        return self.add(Figure(drawing, caption or path.stem))

    @contextmanager
    def fold_blocks(self, summary: str) -> Iterator[None]:
        """Hide the blocks added inside on a page until the reader opens them."""
        outside, self.blocks = self.blocks, []
        yield
        self.blocks = [*outside, Fold(summary, self.blocks)]

    @property
    def html(self) -> str:
        """A page in one file."""
        from tractexp.blocks.html import render_page

        return render_page(self)

    @property
    def fragment(self) -> str:
        """The blocks without detail as a part of another page, as a notebook shows it."""
        from tractexp.blocks.html import render_fragment

        return render_fragment(self)

    @property
    def markdown(self) -> str:
        """The blocks as Markdown."""
        from tractexp.blocks.markdown import render_markdown

        return render_markdown(self)

    def to_dict(self) -> dict[str, Any]:
        """Title, lead and blocks as plain data, each block with its kind; of charts and figures the
        captions.
        """
        return {
            "title": self.title,
            "lead": self.lead,
            "blocks": [_describe_block(block) for block in self.blocks],
        }

    def save(self, path: Path | str) -> Path:
        """Write the page, or a document for a word processor where the path ends in .docx, whole or
        not at all. Raises `UserError` where that is impossible.
        """
        if Path(path).suffix.lower() == ".docx":
            from tractexp.blocks.docx import save_document

            return save_document(self, Path(path))
        return files.write(Path(path), self.html)

    def __str__(self) -> str:
        """The report as a terminal shows it."""
        from tractexp.blocks.terminal import render_plain

        return render_plain(self)

    def __repr__(self) -> str:
        """How many blocks there are, and what shows them."""
        return (
            f"a report of {len(self.blocks)} blocks; save(path) writes its page, print() shows what"
            " a terminal can"
        )

    def _repr_html_(self) -> str:
        """The page in a frame, for a notebook."""
        from tractexp.blocks.html import render_frame

        return render_frame(self)


def _describe_block(block: Block) -> dict[str, Any]:
    """A block as plain data, without what only draws it."""
    fields = {
        f.name: getattr(block, f.name)
        for f in dataclasses.fields(block)
        if f.name not in ("chart", "svg", "html")
    }
    for key in ("blocks", "charts"):
        if key in fields:
            fields[key] = [_describe_block(inner) for inner in fields[key]]
    if isinstance(block, Table):
        fields |= {"words": sorted(block.words), "detail": sorted(block.detail)}
    return files.make_plain({"block": type(block).__name__.lower(), **fields})
