"""A page as Markdown: the same calls as `Page`, so that one description makes both."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tractexp import files
from tractexp.report.chart import Chart


class Markdown:
    """Collects the parts of a page in order; of its charts the captions."""

    def __init__(self, title: str, lead: str = ""):
        self._parts = [f"# {title}"] + [lead] * bool(lead)

    def heading(self, text: str, level: int = 2) -> "Markdown":
        return self._add(f"{'#' * level} {text}")

    def text(self, *paragraphs: str) -> "Markdown":
        return self._add(*map(_escaped, paragraphs))

    def verdict(self, *paragraphs: str, kind: str = "plain") -> "Markdown":
        return self._add("\n>\n".join(f"> {_escaped(text)}" for text in paragraphs))

    def items(self, texts: Sequence[str]) -> "Markdown":
        return self._add("\n".join(f"- {_escaped(text)}" for text in texts))

    def table(
        self, columns: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "", words: Sequence[int] = ()
    ) -> "Markdown":
        """The first column and those counted in `words` are to the left."""
        marks = ["---" if i == 0 or i in words else "---:" for i in range(len(columns))]
        lines = [columns, marks, *rows]
        told = "\n".join(f"| {' | '.join(_escaped(str(cell)) for cell in line)} |" for line in lines)
        return self._add(told, *([_escaped(caption)] if caption else []))

    def chart(self, chart: Chart, caption: str = "") -> "Markdown":
        """What a chart of the page beside it shows."""
        return self._add(f"*Chart of the page: {_escaped(caption)}*")

    def write(self, path: Path) -> Path:
        """Write the page in one move. Raises `UserError` where that is impossible."""
        return files.write(path, "\n\n".join(self._parts) + "\n")

    def _add(self, *parts: str) -> "Markdown":
        self._parts += parts
        return self


def _escaped(text: str) -> str:
    """Text with the signs that Markdown would read as markup escaped."""
    return text if set(text) <= set("-:") else "".join(f"\\{c}" if c in "|*_<>[]" else c for c in text)


class Together:
    """Pages that are written as one: every call goes to each."""

    def __init__(self, *pages: Any):
        self.pages = pages

    def __getattr__(self, name: str) -> Callable[..., "Together"]:
        def each(*args: Any, **kwargs: Any) -> "Together":
            for page in self.pages:
                getattr(page, name)(*args, **kwargs)
            return self

        return each
