"""Rows with names: a table to be read, a frame, and the mappings that they are."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tractexp.blocks import Table
from tractexp.outcome import Tabulated

if TYPE_CHECKING:
    import pandas


class Listed(Tabulated):
    """Rows with names, shown as a table and given as a frame or as the mappings they are."""

    def __init__(self, rows: Sequence[Mapping[str, Any]], title: str = ""):
        """Rows of one kind, {column: value} each."""
        self.rows, self.title = rows, title

    def __len__(self) -> int:
        """How many rows there are."""
        return len(self.rows)

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        """The rows."""
        return iter(self.rows)

    def table(self) -> Table:
        """The rows with a list in one cell as text."""
        columns = list(self.rows[0]) if self.rows else []
        return Table(
            columns,
            [[_format_cell(row[name]) for name in columns] for row in self.rows],
            self.title,
        )

    def to_frame(self) -> "pandas.DataFrame":
        """The rows as a pandas frame; what is not known is nan."""
        import pandas

        frame = pandas.DataFrame(list(self.rows))
        unknown = [name for name in frame if all(row[name] is None for row in self.rows)]
        # what no row has is nan, as where some rows have it
        return frame.astype(dict.fromkeys(unknown, float))


def _format_cell(value: Any) -> Any:
    """A value as a cell shows it: the items of a list in a line."""
    return "; ".join(map(str, value)) if isinstance(value, list | tuple) else value
