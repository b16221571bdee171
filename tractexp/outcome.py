"""What every public call returns: a result that prints, tabulates, saves and loads, and is written
into a folder.

A result is the call that made it (records and settings) and what that call found, both as plain
data. What is heavy, such as the figures of a page, is computed again from the call where it is
asked of a result that was loaded: a call with the same records, settings and seed gives the same
bits.
"""

import functools
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, get_origin

from tractexp.blocks import Report, Table
from tractexp.errors import UserError
from tractexp.process.blas import limit_to_one_thread
from tractexp.storage import files
from tractexp.text.progress import say

if TYPE_CHECKING:
    import pandas

MARK = "tractexp"  # the key by which a saved result is known
COMPUTING = ("report", "predict", "write_results", "write_drawings")  # methods of results
Drawing = Callable[[Path], Path]  # makes the file of this path


class Tabulated:
    """Shows itself by its `summary`: printed, in a notebook; as a frame by its `table`."""

    def table(self) -> Table:
        """The rows that a person sees first."""
        raise NotImplementedError

    def summary(self) -> Report:
        """The report that a terminal and a notebook show; by default the table."""
        return Report().add(self.table())

    def to_frame(self) -> "pandas.DataFrame":
        """The table as a pandas frame."""
        return self.table().to_frame()

    def __repr__(self) -> str:
        """The text that the command line prints."""
        return str(self.summary())

    def _repr_html_(self) -> str:
        """The HTML that a notebook shows."""
        return self.summary().fragment


class Plain:
    """Base of dataclasses that are saved: plain data by their fields, and made again by the types
    of these.

    A field whose type stands in quotes holds what is behind the others, and is computed again.
    """

    def to_dict(self) -> dict[str, Any]:
        """Everything found, as plain data that JSON knows."""
        return {f.name: _form(f)[0](getattr(self, f.name)) for f in _list_saved_fields(type(self))}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The result that `to_dict` gave."""
        required = [
            f
            for f in _list_saved_fields(cls)
            if f.name in content or (f.default is f.default_factory is MISSING)
        ]
        return cls(**{f.name: _form(f)[1](content[f.name]) for f in required})


def _list_saved_fields(cls: Any) -> list[Field[Any]]:
    """The fields of a dataclass that `save` writes: those whose types can be read back."""
    return [f for f in fields(cls) if not isinstance(f.type, str)]


def _form(of: Field[Any]) -> tuple[Callable[[Any], Any], Callable[[Any], Any]]:
    """(write, read): how a field's value becomes plain data, and a value again."""
    kind: Any = of.type
    if isinstance(kind, type) and issubclass(kind, Plain):
        return kind.to_dict, kind.from_dict
    return _copy_mappings, tuple if get_origin(kind) is tuple else _copy_mappings


def _copy_mappings(value: Any) -> Any:
    """The value, a mapping of any kind as a dictionary."""
    return dict(value) if isinstance(value, Mapping) else value


class Outcome(Plain, Tabulated):
    """Base of the results: dataclasses. A subclass names its `kind` and gives `table`.

    The file that `save` writes is JSON: `tractexp` (the version), `kind`, and what `to_dict` holds.
    """

    kind: ClassVar[str]
    kinds: ClassVar[dict[str, type["Outcome"]]] = {}

    def __init_subclass__(cls, **settings: Any) -> None:
        """Register a kind of result by its name; what it computes later runs in one thread, as the
        call did that made it.
        """
        super().__init_subclass__(**settings)
        if "kind" in vars(cls):
            Outcome.kinds[cls.kind] = cls
        for name, value in [*vars(cls).items()]:
            if isinstance(value, functools.cached_property):
                value.func = limit_to_one_thread(value.func)
            elif name in COMPUTING:
                setattr(cls, name, limit_to_one_thread(value))

    @classmethod
    def from_saved(cls, content: Mapping[str, Any]) -> Self:
        """As `from_dict`; raises `UserError` where something is missing or of the wrong kind."""
        try:
            return cls.from_dict(content)
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            reason = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
            raise UserError(
                f"this is not a whole saved {cls.kind}: {reason}; save it again"
            ) from error

    def save(self, path: Path | str) -> Path:
        """Write the result as one JSON file, whole or not at all; `tractexp.load` reads it back."""
        from tractexp import __version__

        return files.write_json(path, {MARK: __version__, "kind": self.kind, **self.to_dict()})

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """The saved result. Raises `UserError` where the file is missing, damaged or of another
        kind.
        """
        content = read_saved_result(path)
        if content["kind"] != cls.kind:
            raise UserError(
                f"{path} holds a result of kind '{content['kind']}', not '{cls.kind}'; read it by"
                " load()"
            )
        return cls.from_saved(content)


class Written(Outcome):
    """Base of the results that are written into a folder: files for machines first, then pages and
    figures.
    """

    page: ClassVar[str] = ""  # file of the page; "" for none
    content: Mapping[str, Any]  # for machines

    def screen(self) -> Report:
        """The answer on one screen, which a command prints; by default the summary."""
        return self.summary()

    @property
    def next_step(self) -> str:
        """The sentence that a command ends with: what leads on, and the command that does it; ""
        where that stands on the screen itself.
        """
        return ""

    def report(self) -> Report:
        """The page as a list of blocks: a notebook shows it, `save(path)` writes it.

        Without a page of its own: the summary, and the figures among the drawings.
        """
        title, summary = self.table().title or self.kind, self.summary()
        report = Report(title[:1].upper() + title[1:])
        report.add(*summary.blocks)
        with tempfile.TemporaryDirectory() as folder:
            for name, draw in self.drawings().items():
                if name.endswith(".svg"):
                    report.figure(draw(Path(folder) / name))
        return report

    def write_results(self, folder: Path) -> list[Path]:
        """Write what cannot be had again without the computation; the paths. Raises `UserError`
        where it cannot.

        By default the result's `content`, beside its page.
        """
        return [files.write_json((folder / self.page).with_suffix(".json"), self.content)]

    def drawings(self) -> Mapping[str, Drawing]:
        """The drawings of the results, {name of the file: what makes it}."""
        return {self.page: lambda path: self.report().save(path)} if self.page else {}

    def write(self, folder: Path | str) -> list[Path]:
        """Write everything into a folder, and return the paths: files for machines first, then
        pages and figures.

        Raises `UserError` where the results cannot be written. A page or a figure that fails is a
        sentence on the terminal, for the results are on the disk by then.
        """
        return [*self.write_results(Path(folder)), *self.write_drawings(folder)]

    def write_drawings(self, folder: Path | str) -> list[Path]:
        """Write pages and figures; the paths of those that could be made. A sentence says why
        another could not.
        """
        paths = []
        for name, draw in self.drawings().items():
            try:
                paths.append(draw(Path(folder) / name))
            except Exception as error:  # whatever it is, the results stand
                say(f"note: {describe_missing_drawing(Path(folder) / name, error)}")
        return paths


def describe_missing_drawing(path: Path, error: Exception) -> str:
    """Why a page or a figure is missing, as a sentence."""
    reason = (
        str(error) if isinstance(error, UserError) else f"{type(error).__name__}: {error}".strip()
    )
    return (
        f"{path.name} could not be made, while the results are whole"
        f" ({reason.partition(chr(10))[0]})"
    )


def read_saved_result(path: Path | str) -> dict[str, Any]:
    """The content of a saved result, its kind checked to be there. Raises `UserError` where it is
    none.
    """
    try:
        content = files.read_json(path)
    except FileNotFoundError as error:
        raise UserError(
            f"{path} cannot be read: {error.strerror}; give a file written by save()"
        ) from error
    except UserError as error:
        raise UserError(f"{error}: this is not a saved result") from error
    if not (isinstance(content, dict) and MARK in content and isinstance(content.get("kind"), str)):
        raise UserError(
            f"{path} is not a saved result: it lacks the keys '{MARK}' and 'kind', which save()"
            " writes"
        )
    return content
