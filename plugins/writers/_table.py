"""Tidy tables with a sidecar, whatever the format of the table."""

from pathlib import Path

from tractexp.extend import Record, Recording, Writer
from tractexp.extend.files import tidy


class _Table(Writer):
    """A column for each quantity, a row for each sample; the sidecar in JSON says
    everything else.
    """

    def record(self, record: Record, path: Path) -> list[Path]:
        return tidy.write_record(record, path)

    def recording(self, recording: Recording, path: Path) -> list[Path]:
        return tidy.write_recording(recording, path)
