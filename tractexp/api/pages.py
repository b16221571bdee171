"""A page with its figures inside, as a notebook shows it and a file keeps it."""

import html
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tractexp import files


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


def shown(written: Callable[[Path], Sequence[Path]]) -> Shown:
    """The page among the files that `written` makes in a folder."""
    with tempfile.TemporaryDirectory() as folder:
        page = next(path for path in written(Path(folder)) if path.suffix == ".html")
        return Shown(page.read_text(encoding="utf-8"))
