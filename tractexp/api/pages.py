"""Results told in a folder, and their page with its figures inside, as a notebook shows it and a file keeps it."""

import html
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tractexp import files
from tractexp.errors import UserError
from tractexp.outcome import Outcome
from tractexp.progress import say


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


Drawing = Callable[[Path], Path]  # makes the file of this path


class Written(Outcome):
    """Base of the results that are told in a folder.

    A subclass writes in `_results` what cannot be had again without the computation, and names in `_drawings` what is
    made from it.
    """

    def write(self, folder: Path | str) -> list[Path]:
        """Write everything into a folder, and return the paths: files for machines first, then pages and figures.

        Raises `UserError` where the results cannot be written. A page or a figure that fails is a sentence on the
        terminal, for the results are on the disk by then.
        """
        return [*self.write_results(folder), *self.write_drawings(folder)]

    def write_results(self, folder: Path | str) -> list[Path]:
        """Write the files for machines; their paths. Raises `UserError` where they cannot be written."""
        return self._results(Path(folder))

    def write_drawings(self, folder: Path | str) -> list[Path]:
        """Write pages and figures; the paths of those that could be made. Of each of the others a sentence is told."""
        made = []
        for name, draw in self._drawings().items():
            try:
                made.append(draw(Path(folder) / name))
            except Exception as error:  # whatever it is, the results stand
                say(f"note: {not_drawn(Path(folder) / name, error)}")
        return made

    def report(self) -> Shown:
        """The page, as a notebook shows it; `save(path)` writes it. Without a page of its own: table and figures."""
        with tempfile.TemporaryDirectory() as folder:
            paths = self._results(Path(folder))
            paths += [draw(Path(folder) / name) for name, draw in self._drawings().items()]
            pages = [path for path in paths if path.suffix == ".html"]
            page = pages[0] if pages else self._page(paths, Path(folder) / "page.html")
            return Shown(page.read_text(encoding="utf-8"))

    def _results(self, folder: Path) -> list[Path]:
        raise NotImplementedError

    def _drawings(self) -> Mapping[str, Drawing]:
        """Pages and figures, {name of the file: what makes it}."""
        return {}

    def _page(self, paths: Sequence[Path], path: Path) -> Path:
        """A page of the table and of the figures among `paths`."""
        from tractexp.report.page import Page

        told = self.table()
        page = Page(told.title or self.kind).table(told.columns, told.cells).text(*told.said)
        for figure in paths:
            if figure.suffix == ".svg":
                page.figure(figure)
        return page.write(path)


def not_drawn(path: Path, error: Exception) -> str:
    """Why a page or a figure is missing, as a sentence."""
    reason = str(error) if isinstance(error, UserError) else f"{type(error).__name__}: {error}".strip()
    return f"{path.name} could not be made, while the results are whole ({reason.partition(chr(10))[0]})"
