"""Text in a page of the docs that is made from a stored result, between two marks that name what makes it."""

from pathlib import Path

from tractexp import files


def marks(name: str) -> tuple[str, str]:
    """The lines before and after the text that `name` makes."""
    return f"<!-- from here on made by {name} -->\n", f"<!-- to here made by {name} -->\n"


def parted(page: str, name: str) -> tuple[str, str, str]:
    """What stands before, between and after the marks of `name`. Raises `ValueError` where they are missing."""
    first, last = marks(name)
    before, found, rest = page.partition(first)
    made, ended, after = rest.partition(last)
    if not (found and ended):
        raise ValueError(f"the page lacks the two lines {first.strip()} and {last.strip()}")
    return before + first, made, last + after


def replace(path: Path, name: str, text: str) -> Path:
    """Put `text` between the marks of `name` in a page."""
    before, _, after = parted(path.read_text(encoding="utf-8"), name)
    return files.write(path, f"{before}\n{text.strip()}\n\n{after}")
