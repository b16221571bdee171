"""The interface of reader plugins: records from the `data` configuration."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tractexp.configuration.overrides import survey_of
from tractexp.configuration.plugin import Plugin, build, discover
from tractexp.errors import UserError
from tractexp.record import foreign
from tractexp.storage import time_limit

if TYPE_CHECKING:
    from tractexp.record.dips import FileDip
    from tractexp.record.record import Record


@dataclass(frozen=True)
class Events:
    """The recorded events of one run, fitted and held out: each a record or an `Event`."""

    train: Sequence[Any]
    validate: Sequence[Any] = ()


class Reader(Plugin):
    """Base of the reader plugins, chosen by `data=NAME`."""

    group: ClassVar[str] = "data"
    # of the files that `tractexp.read` gives it, in lower case
    endings: ClassVar[tuple[str, ...]] = ()
    # endings of an instrument's files: of one stem they are one record
    parts: ClassVar[tuple[str, ...]] = ()
    # `data.path` is a folder, and `train` names events of its files
    folders: ClassVar[bool] = False

    @staticmethod
    def build_settings(path: str) -> dict[str, Any]:
        """The settings that make it read all of one file; for a reader with `endings`.

        Parameters
        ----------
        path : str
            Of the file.

        Returns
        -------
        dict
            {setting: value}.
        """
        return {"path": path}

    @classmethod
    def takes(cls, path: str, *join: str) -> bool:
        """Whether files are meant for this reader: readers that share an ending look inside.

        Parameters
        ----------
        path : str
            A file with one of its endings.
        *join : str
            Those of the same event.
        """
        return True

    @abstractmethod
    def read(self) -> Events:
        """Read and check everything.

        Returns
        -------
        Events
            Those that are fitted, and those held out.

        Raises
        ------
        UserError
            It names the file, the place and the value.
        """

    def table(self) -> tuple["Record", Sequence["FileDip"]] | None:
        """The whole record of a file and its dips, from a reader of one table.

        Returns
        -------
        (Record, Sequence[FileDip]) or None
            None from other readers.
        """
        return None

    def read_voltage(self) -> "Record | None":
        """The voltage alone of a table that holds no powers, P and Q unknown (nan); None from other
        readers, and of other tables.
        """
        return None


def read_records(data: Mapping[str, Any]) -> Events:
    """The records of a choice of data. Raises `UserError` as their reader does, and where they take
    longer than any record.
    """
    reader = build(Reader.group, data)
    if reader.folders:  # each file of the folder has its own time
        return reader.read()
    named = getattr(reader, "path", "") or next(iter(getattr(reader, "train", None) or [""]))
    with time_limit.limit_time(str(named) or reader.name):
        return reader.read()


def find_reader(path: str, *join: str) -> type[Any]:
    """The reader of a file, or of the files of one event: by the ending and, where several share
    it, by what is inside.

    Parameters
    ----------
    path : str
        The file.
    *join : str
        Those of the same event.

    Returns
    -------
    type
        A reader plugin.

    Raises
    ------
    UserError
        For a folder, and for an ending that no reader takes.

    Examples
    --------
    >>> find_reader("station.cfg").name
    'comtrade'
    """
    ending = Path(path).suffix.lower()
    classes: list[Any] = list(discover()[Reader.group].values())
    readers = [cls for cls in classes if ending and ending in cls.endings]
    if Path(path).is_dir():
        raise UserError(
            f"{path} is a folder; give a file of it, or make a table: {survey_of(path)}"
        )
    if not readers:
        reason = (
            foreign.describe_foreign_file(path)
            or f"{path}: no reader takes files ending in '{ending}'"
        )
        raise UserError(f"{reason}; endings that can be read: {', '.join(list_endings())}")
    return next((cls for cls in readers if cls.takes(path, *join)), readers[0])


def list_endings() -> list[str]:
    """The endings of the files that can be read."""
    return sorted(
        {e for cls in discover()[Reader.group].values() for e in getattr(cls, "endings", ())}
    )
