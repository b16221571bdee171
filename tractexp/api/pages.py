"""Interim, until the studies are converted."""

from pathlib import Path

from tractexp import outcome
from tractexp.outcome import Drawing as Drawing


class Written(outcome.Written):
    def write_results(self, folder: Path) -> list[Path]:
        return self._results(folder)  # type: ignore[attr-defined]

    def drawings(self):  # type: ignore[no-untyped-def]
        return self._drawings()  # type: ignore[attr-defined]
