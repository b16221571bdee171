"""Remarks on what was mended in a file, one for all lines concerned."""

from tractexp.text.wording import list_first

NAMED_LINES = 5  # of those concerned that are told


class Remarks:
    """Notes about one file, in the order in which they came up; the same words about several lines
    are one note.
    """

    def __init__(self, where: str) -> None:
        """No remarks yet on a file."""
        self.where = where
        self._lines: dict[str, list[int]] = {}

    def add(self, words: str, line: int | None = None) -> None:
        """Note something, about one line of the file (from 1) or about all of it."""
        self._lines.setdefault(words, []).extend([] if line is None else [line])

    def notes(self) -> tuple[str, ...]:
        """One sentence for each remark, with its lines."""
        return tuple(
            f"{self.where}{_list_places(lines)}: {words}" for words, lines in self._lines.items()
        )


def _list_places(lines: list[int]) -> str:
    """ ", line 3" or ", lines 3, 4 and 7 more"."""
    if not lines:
        return ""
    if len(lines) == 1:
        return f", line {lines[0]}"
    return f", lines {list_first([*map(str, lines)], NAMED_LINES)}"
