"""Interim, until the studies are converted."""

from pathlib import Path

from tractexp.blocks import Report


class Page(Report):
    def write(self, path: Path) -> Path:
        return self.save(path)
