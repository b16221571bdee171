"""COMTRADE, in two files or in one."""

from pathlib import Path

from tractexp.extend import Record, Recording, Writer
from tractexp.extend.files import comtrade, tidy


class _COMTRADE(Writer):
    """The first data file type that holds the raw values exactly: 16 or 32 bits, or text."""

    waves = True

    def record(self, record: Record, path: Path) -> list[Path]:
        return self.recording(tidy.convert_record(record), path)

    def recording(self, recording: Recording, path: Path) -> list[Path]:
        return comtrade.write(recording, path)
