"""Results told in a folder, and their page with its figures inside, as a notebook shows it and a file keeps it."""

import html
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tractexp import files
from tractexp.outcome import Outcome


@dataclass(frozen=True)
class Shown:
    """One HTML page that needs nothing else. A notebook shows it in a frame."""

    html: str

    def save(self, path: Path | str) -> Path:
        """Write the page, whole or not at all."""
        return files.write(path, self.html)

    def __repr__(self) -> str:
        return f"a page of {len(self.html) // 1000} kB; save(path) writes it"

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{html.escape(self.html)}" style="width:100%;height:40rem;border:0"></iframe>'


class Written(Outcome):
    """Base of the results that are told in a folder. A subclass says in `_write` what it writes."""

    def write(self, folder: Path | str) -> list[Path]:
        """Write everything into a folder: the page where there is one, figures, files for machines; their paths."""
        return self._write(Path(folder))

    def report(self) -> Shown:
        """The page, as a notebook shows it; `save(path)` writes it. Without a page of its own: table and figures."""
        with tempfile.TemporaryDirectory() as folder:
            paths = self._write(Path(folder))
            pages = [path for path in paths if path.suffix == ".html"]
            page = pages[0] if pages else self._page(paths, Path(folder) / "page.html")
            return Shown(page.read_text(encoding="utf-8"))

    def _write(self, folder: Path) -> list[Path]:
        raise NotImplementedError

    def _page(self, paths: Sequence[Path], path: Path) -> Path:
        """A page of the table and of the figures among `paths`."""
        from tractexp.report.page import Page

        told = self.table()
        page = Page(told.title or self.kind).table(told.columns, told.cells).text(*told.said)
        for figure in paths:
            if figure.suffix == ".svg":
                page.figure(figure)
        return page.write(path)
