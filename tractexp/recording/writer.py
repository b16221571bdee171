"""The interface of writer plugins: a record or a recording in a format that a reader reads."""

from abc import abstractmethod
from pathlib import Path
from typing import ClassVar

from tractexp.configuration.plugin import Plugin
from tractexp.record.record import Record
from tractexp.recording.recording import Recording


class Writer(Plugin):
    """Base of the writers, chosen by `task.to=NAME`. What they write is read again as it was."""

    group: ClassVar[str] = "writer"
    chosen: ClassVar[bool] = False
    # of the files it writes, first the one that a reader opens
    endings: ClassVar[tuple[str, ...]] = ()
    usual: ClassVar[bool] = False  # taken where none is named
    waves: ClassVar[bool] = False  # events of waveforms are written as the waveforms about them

    @abstractmethod
    def record(self, record: Record, path: Path) -> list[Path]:
        """Write a record, and what belongs beside it.

        Parameters
        ----------
        record : Record
            Of one event.
        path : Path
            With the first of `endings`.

        Returns
        -------
        list of Path
            The files written.
        """

    @abstractmethod
    def recording(self, recording: Recording, path: Path) -> list[Path]:
        """Write a recording, and what belongs beside it.

        Parameters
        ----------
        recording : Recording
            All channels of a file.
        path : Path
            With the first of `endings`.

        Returns
        -------
        list of Path
            The files written.
        """
