"""The gallery: small complete programs, run when the site is built, with what they print and the
first chart of their page.
"""

import ast
import contextlib
import io
import os
import runpy
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from tractexp.blocks import Report
from tractexp.blocks.block import ChartBlock, Charts, Figure, Fold
from tractexp.blocks.drawing import draw_chart
from tractexp.storage import files

EXAMPLES = Path(__file__).parents[1] / "gallery"
LEAD = (
    "Each is a whole program: it needs an installed `tractexp`, an empty folder and nothing else."
    " What it prints, and the picture, were made by it when this page was built. `page.save(path)`"
    " writes the page that the picture is from."
)
ORDER = (
    *("identify", "two_groups", "waves", "railway", "station", "discrepancy"),
    *("draw_again", "compare_optimizers", "tune", "export", "sheet", "notebook"),
)
MOST_LINES = 30  # of what an example prints


def write(folder: Path) -> Path:
    """Run all examples and write their page."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = ["# Gallery", LEAD, *(_run_example(example, folder) for example in list_examples())]
    path = folder / "gallery.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path


def list_examples() -> list[Path]:
    """The programs, in their order."""
    return [EXAMPLES / f"{name}.py" for name in ORDER]


def _run_example(path: Path, folder: Path) -> str:
    """A section: what the program is for, itself, what it prints and its picture."""
    text = path.read_text(encoding="utf-8")
    title, _, about = (ast.get_docstring(ast.parse(text)) or "").partition("\n")
    printed, page = run_program(path)
    parts = [f"## {title}", about.strip(), f"```python\n{_without_docstring(text)}\n```"]
    if lines := printed.rstrip().split("\n")[:MOST_LINES]:
        parts.append("```text\n" + "\n".join(lines) + "\n```")
    picture = folder / "gallery" / f"{path.stem}.svg"
    match next(_find_pictures(page.blocks), None):
        case Figure(svg):
            files.write(picture, svg.encode())
        case ChartBlock(chart):
            draw_chart(chart, picture)
        case None:
            raise ValueError(f"{path.name}: its page has no picture")
    parts.append(f"![{title}](gallery/{picture.name})")
    return "\n\n".join(parts)


def run_program(path: Path) -> tuple[str, Report]:
    """What a program prints, and its `page`; it runs in an empty folder."""
    printed, before = io.StringIO(), Path.cwd()
    with tempfile.TemporaryDirectory() as empty, contextlib.redirect_stderr(io.StringIO()):
        os.chdir(empty)
        try:
            with contextlib.redirect_stdout(printed):
                names = runpy.run_path(str(path), run_name="__main__")
        finally:
            os.chdir(before)
    return printed.getvalue(), names["page"]


def _without_docstring(text: str) -> str:
    """The lines of a program below its docstring."""
    first = ast.parse(text).body[0]
    return "\n".join(text.splitlines()[first.end_lineno :]).strip()


def _find_pictures(blocks: Sequence[object]) -> Iterator[Figure | ChartBlock]:
    """The figures and charts of a page in their order."""
    for block in blocks:
        if isinstance(block, Figure | ChartBlock):
            yield block
        elif isinstance(block, Charts):
            yield from block.charts
        elif isinstance(block, Fold):
            yield from _find_pictures(block.blocks)
