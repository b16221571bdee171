"""What a reader plugin must do: turn the `data` configuration into records."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from tractexp.plugin import Plugin
from tractexp.record.record import Record


@dataclass(frozen=True)
class Events:
    """The recorded events of one run: those that are fitted and those held out."""

    train: Sequence[Record]
    validate: Sequence[Record] = ()


class Reader(Plugin):
    """Base of the reader plugins, chosen by `data=NAME`."""

    group: ClassVar[str] = "data"

    def read(self) -> Events:
        """Read and check everything; raises `UserError` naming the file, the place and the value."""
