"""Files of instruments that hold waveforms or a table, as they were set to record."""

from pathlib import Path
from types import ModuleType

from tractexp.filetypes import cev, pqdif


def instrument_of(path: Path | str) -> ModuleType | None:
    """The module that reads such a file, by how it begins: `holds_waveforms`, `load` and `table`; None for another."""
    return next((each for each in (pqdif, cev) if each.recognizes(path)), None)
