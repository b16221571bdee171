"""What every public call returns: a result that prints, tabulates, saves and loads.

A result is the call that made it (records and settings) and what that call found, both as plain data. What is heavy,
such as the figures of a page, is reckoned again from the call where it is asked of a result that was loaded: a call
with the same records, settings and seed gives the same bits.
"""

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

from tractexp import files
from tractexp.errors import UserError

MARK = "tractexp"  # the key by which a saved result is known


@dataclass(frozen=True)
class Table:
    """Rows under columns, as a terminal, a notebook and a frame show them. `said` are sentences below it."""

    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    title: str = ""
    said: Sequence[str] = field(default=())

    @property
    def cells(self) -> list[list[str]]:
        """The rows as they are read."""
        return [[_told(cell) for cell in row] for row in self.rows]

    def __str__(self) -> str:
        cells = [list(map(str, self.columns)), *self.cells]
        widths = [max(len(row[k]) for row in cells) for k in range(len(self.columns))]
        lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in cells]
        ruled = [lines[0], "  ".join("-" * w for w in widths), *lines[1:]] if self.columns else []
        return "\n".join([*([self.title] if self.title else []), *ruled, *self.said])

    def _repr_html_(self) -> str:
        def cell(content: Any, tag: str) -> str:
            side = "left" if isinstance(content, str) else "right"
            return f'<{tag} style="text-align:{side}">{html.escape(_told(content))}</{tag}>'

        def row(cells: Sequence[Any], tag: str) -> str:
            return "<tr>" + "".join(cell(content, tag) for content in cells) + "</tr>"

        title = f'<caption style="text-align:left"><b>{html.escape(self.title)}</b></caption>' if self.title else ""
        head = f"<thead>{row(self.columns, 'th')}</thead>" if self.columns else ""
        body = "".join(row(cells, "td") for cells in self.rows)
        said = "<br>".join(html.escape(sentence) for sentence in self.said)
        return f"<table>{title}{head}<tbody>{body}</tbody></table>" + (f"<p>{said}</p>" if said else "")

    def to_frame(self) -> Any:
        """A pandas frame of the rows."""
        import pandas

        return pandas.DataFrame([list(row) for row in self.rows], columns=list(self.columns))


def _told(cell: Any) -> str:
    if cell is None:
        return ""
    return f"{cell:.5g}" if isinstance(cell, float) else str(cell)


class Tabulated:
    """Shows itself by its `table`: printed, in a notebook, as a frame."""

    def table(self) -> Table:
        """What a person sees first."""
        raise NotImplementedError

    def to_frame(self) -> Any:
        """The table as a pandas frame."""
        return self.table().to_frame()

    def __repr__(self) -> str:
        return str(self.table())

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


class Outcome(Tabulated):
    """Base of the results. A subclass names its `kind`, gives `to_dict` and `table`, and is made again by `from_dict`.

    The file that `save` writes is JSON: `tractexp` (the version), `kind`, and what `to_dict` holds.
    """

    kind: ClassVar[str]
    kinds: ClassVar[dict[str, type["Outcome"]]] = {}

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        if "kind" in vars(cls):
            Outcome.kinds[cls.kind] = cls

    def to_dict(self) -> dict[str, Any]:
        """Everything found, as plain data that JSON knows."""
        raise NotImplementedError

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The result that `to_dict` told."""
        raise NotImplementedError

    @classmethod
    def revived(cls, content: Mapping[str, Any]) -> Self:
        """As `from_dict`; raises `UserError` where something is missing or of the wrong kind."""
        try:
            return cls.from_dict(content)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            told = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
            raise UserError(f"this is not a whole saved {cls.kind}: {told}; save it again") from error

    def save(self, path: Path | str) -> Path:
        """Write the result as one JSON file, whole or not at all; `tractexp.load` reads it back."""
        from tractexp import __version__

        return files.write_json(path, {MARK: __version__, "kind": self.kind, **self.to_dict()})

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """The saved result. Raises `UserError` where the file is missing, damaged or of another kind."""
        content = saved(path)
        if content["kind"] != cls.kind:
            raise UserError(f"{path} holds a result of kind '{content['kind']}', not '{cls.kind}'; read it by load()")
        return cls.revived(content)


def saved(path: Path | str) -> dict[str, Any]:
    """The content of a saved result, its kind checked to be there. Raises `UserError` where it is none."""
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror or error}; give a file written by save()") from error
    except ValueError as error:
        raise UserError(f"{path} is not a saved result: {error}") from error
    if not (isinstance(content, dict) and MARK in content and "kind" in content):
        raise UserError(f"{path} is not a saved result: it lacks the keys '{MARK}' and 'kind', which save() writes")
    return content
