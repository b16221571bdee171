"""The commands that the pages show: those of their blocks of code, one a line, with where they
stand.
"""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SHELL = ("", "sh", "bash", "console")  # languages of a block whose lines may be commands


@dataclass(frozen=True)
class Command:
    """A line of a page. `words` are what the shell makes of it, without what follows a `#`."""

    page: Path
    heading: str
    line: str

    @property
    def words(self) -> list[str]:
        return shlex.split(self.line, comments=True)

    @property
    def arguments(self) -> list[str] | None:
        """The arguments of `tractexp`; None where the line runs something else."""
        words = self.words
        return words[words.index("tractexp") + 1 :] if "tractexp" in words else None


def of(page: Path) -> Iterator[Command]:
    """The commands of a page: lines of fenced blocks without a language or of a shell, and of
    indented blocks.
    """
    for heading, line in _lines(page):
        if runs(line):
            yield Command(page, heading, line)


def inline(page: Path) -> Iterator[Command]:
    """The commands within the text of a page."""
    text = re.sub(
        r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    for line in re.findall(r"`([^`]+)`", text):
        if runs(line) and " " in line:
            yield Command(page, "", " ".join(line.split()))


def _lines(page: Path) -> Iterator[tuple[str, str]]:
    """(heading, line) of all code, lines that end in a backslash joined with the next."""
    heading, fence, held = "", None, ""
    for line in page.read_text(encoding="utf-8").splitlines():
        if marked := re.match(r"^```(\S*)", line):
            fence = None if fence is not None else marked[1]
        elif fence is None and (title := re.match(r"^#+ (.+)$", line)):
            heading = title[1]
        elif fence in SHELL if fence is not None else held or re.match(r"^ {4}\S", line):
            held += line.strip()
            if held.endswith("\\"):
                held = held[:-1].rstrip() + " "
            else:
                yield heading, held
                held = ""


def runs(line: str) -> bool:
    """Whether a line is a command, not a printed answer or a program."""
    first = line.split(maxsplit=1)[0] if line.strip() else ""
    programs = ("tractexp", "python", "python3", "pip", "pipx", "bash", "cd", "eval", "sbatch", ".")
    return first == "." or first.rpartition("/")[2] in programs
