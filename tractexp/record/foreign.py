"""Files that no reader takes although users have them: what they are, and what to do with them."""

from pathlib import Path

COMPANION = (
    "a companion of a record that holds no samples: give the .cfg beside it, or the .out of PSCAD"
)
ARCHIVE = "an archive: unpack it, or pack it as .zip, which is read as it is"
DOCUMENT = "a document: give the record's data"
RECORDER = "a recorder's own format: export it as COMTRADE or CSV with the recorder's software"
RESULT = (
    "no record: where a run wrote it, 'tractexp again FOLDER' runs it with other settings on top,"
    " 'tractexp task=simulate task.parameters=FOLDER/result.json' plays its load, and in Python"
    " tractexp.load('FOLDER') opens it"
)
FOREIGN = {
    ".json": RESULT,
    ".hdr": COMPANION,
    ".inf": COMPANION,
    ".dmf": COMPANION,
    ".rio": COMPANION,
    ".rar": ARCHIVE,
    ".7z": ARCHIVE,
    ".gz": ARCHIVE,
    ".tar": ARCHIVE,
    ".mat": "a MATLAB file: write its signals as columns with writetable (.csv) or parquetwrite"
    " (.parquet)",
    ".eve": "an SEL event report as text for people: get the compressed one with the command CEV R"
    " (.cev), or the relay's COMTRADE file",
    ".h5": "HDF5, whose layout is everybody's own: write its signals as columns of a .csv or"
    " .parquet",
    ".hdf5": "HDF5, whose layout is everybody's own: write its signals as columns of a .csv or"
    " .parquet",
    ".tdms": "a LabVIEW file: export it as .csv, or write its channels as columns of a .parquet",
    ".pl4": "ATP's plot file: export it as COMTRADE with PlotXY",
    ".psout": "PSCAD's own file of results: have it write .out files (project settings), which come"
    " with an .inf",
    ".rec": RECORDER,
    ".wfm": RECORDER,
    ".osc": RECORDER,
    ".dsr": RECORDER,
    ".tr0": RECORDER,
    ".icf": RECORDER,
    ".dmk": RECORDER,
    ".sig": RECORDER,
    ".trc": RECORDER,
    ".wdf": RECORDER,
    ".d01": RECORDER,
    ".pdf": DOCUMENT,
    ".docx": DOCUMENT,
}


def describe_foreign_file(path: str | Path) -> str:
    """The sentence on a file of a listed foreign ending: what it is and how to convert it; "" for
    other endings.
    """
    kind = FOREIGN.get(Path(path).suffix.lower())
    return f"{path} is {kind}" if kind else ""


def is_record(path: str | Path) -> bool:
    """Whether a foreign ending is that of a record, which somebody who gives its folder expects to
    be read.
    """
    no_record = COMPANION, ARCHIVE, DOCUMENT, RESULT
    return FOREIGN.get(Path(path).suffix.lower(), COMPANION) not in no_record
