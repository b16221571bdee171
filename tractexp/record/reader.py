"""What a reader plugin must do: turn the `data` configuration into records."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from tractexp.plugin import Plugin


@dataclass(frozen=True)
class Events:
    """The recorded events of one run, fitted and held out: as records, or with their dips found."""

    train: Sequence[Any]
    validate: Sequence[Any] = ()


class Reader(Plugin):
    """Base of the reader plugins, chosen by `data=NAME`."""

    group: ClassVar[str] = "data"
    endings: ClassVar[tuple[str, ...]] = ()  # of the files that `tractexp.read` gives it, in lower case

    @staticmethod
    def of(path: str) -> dict[str, Any]:
        """The settings that make it read all of one file; for a reader with `endings`."""
        return {"path": path}

    @classmethod
    def takes(cls, path: str) -> bool:
        """Whether a file with one of its endings is meant for it: readers that share an ending look inside."""
        return True

    @abstractmethod
    def read(self) -> Events:
        """Read and check everything; raises `UserError` naming the file, the place and the value."""
