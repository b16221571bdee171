"""Parts of readers and writers: the parsers of the package, tables and their sidecars, dips within a record."""

from tractexp.files import PACKAGE, located
from tractexp.filetypes import cev, comtrade, pqdif, tidy
from tractexp.filetypes.mapping import QUANTITIES
from tractexp.filetypes.sidecar import Sidecar, beside
from tractexp.filetypes.table import ENDINGS
from tractexp.filetypes.tabulated import Powers, Tabular, kind_of, powers
from tractexp.filetypes.tabulated_waves import recording
from tractexp.filetypes.tidy import restored
from tractexp.overrides import survey_of
from tractexp.record.dips import FileDip, check_load, check_numbers, chosen, level, numbered, signs
from tractexp.record.record import DECLARATION, LOAD, SIZES
from tractexp.recording.archive import records
from tractexp.recording.estimator import estimator_of
from tractexp.wording import counted

__all__ = [
    "DECLARATION",
    "ENDINGS",
    "LOAD",
    "PACKAGE",
    "QUANTITIES",
    "SIZES",
    "FileDip",
    "Powers",
    "Sidecar",
    "Tabular",
    "beside",
    "cev",
    "check_load",
    "check_numbers",
    "chosen",
    "comtrade",
    "counted",
    "estimator_of",
    "kind_of",
    "level",
    "located",
    "numbered",
    "powers",
    "pqdif",
    "recording",
    "records",
    "restored",
    "signs",
    "survey_of",
    "tidy",
]
