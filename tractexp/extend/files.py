"""Parts of readers and writers: the parsers of the package, tables and their sidecars, dips within
a record.
"""

from tractexp.configuration.overrides import survey_of
from tractexp.filetypes import cev, comtrade, pqdif, tidy
from tractexp.filetypes.column_key import QUANTITIES
from tractexp.filetypes.power_columns import Powers
from tractexp.filetypes.sidecar import Sidecar, read_sidecar
from tractexp.filetypes.table import ENDINGS
from tractexp.filetypes.tabulated import Tabular, kind_of, powers
from tractexp.filetypes.tabulated_waves import recording
from tractexp.filetypes.tidy import restore_recording
from tractexp.record.dips import FileDip, check_load, check_numbers, chosen, cut_dips, level, signs
from tractexp.record.record import DECLARATION, LOAD, SIZES
from tractexp.recording.archive import records
from tractexp.recording.estimator import estimator_of
from tractexp.recording.event_files import check_joined, event_paths
from tractexp.storage.files import PACKAGE, locate_file
from tractexp.text.wording import count_noun

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
    "cev",
    "check_joined",
    "check_load",
    "check_numbers",
    "chosen",
    "comtrade",
    "count_noun",
    "cut_dips",
    "estimator_of",
    "event_paths",
    "kind_of",
    "level",
    "locate_file",
    "powers",
    "pqdif",
    "read_sidecar",
    "recording",
    "records",
    "restore_recording",
    "signs",
    "survey_of",
    "tidy",
]
