"""Workbooks and Parquet files that say they hold more than memory does end their reader, not the
process that asked.
"""

import re
import subprocess
import sys
from pathlib import Path

import hostile
import pyarrow
import pytest
from pyarrow import parquet

import tractexp
from tractexp.errors import UserError
from tractexp.filetypes import reading_process

resource = pytest.importorskip("resource")


@pytest.mark.parametrize("name", ["far_cell.xlsx", "far_cell_of_a_table.xlsx"])
def test_a_cell_in_the_last_row_and_column_is_a_sentence(name, tmp_path):
    path = hostile.INPUTS[name](tmp_path / name)
    with pytest.raises(
        UserError, match=r"xlsx: it takes more than 2 GB .* save the table without them"
    ):
        tractexp.look(str(path))


def test_a_sound_table_is_read_and_its_reader_has_ended(tmp_path):
    path = hostile.workbook(tmp_path / "dip.xlsx", hostile.rows_of_cells(hostile.VALUES))
    with reading_process.ReadingProcess("workbook", path.read_bytes()) as book:
        rows = book.read("a")
        with pytest.raises(reading_process.BadFile):
            book.read("another")
    assert book._reader.returncode is not None
    assert (rows[0], len(rows)) == (["t", "U", "P", "Q"], 1 + hostile.ROWS)
    (event,) = tractexp.read(str(path))
    assert event.depth == pytest.approx(0.4)


def test_the_memory_of_the_reader_is_limited_and_not_ours(tmp_path, monkeypatch):
    before = resource.getrlimit(resource.RLIMIT_AS)
    far = '<row r="2000"><c r="XFD2000"><v>1</v></c></row>'
    path = hostile.workbook(tmp_path / "dip.xlsx", hostile.rows_of_cells(hostile.VALUES) + far)
    monkeypatch.setattr(reading_process, "ROOM", 500 << 20)  # of 0.8 GB
    monkeypatch.setattr(reading_process, "PER_BYTE", 0)
    with pytest.raises(UserError, match="of memory to read"):
        tractexp.read(str(path))
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_a_parquet_file_whose_few_bytes_stand_for_gigabytes_is_a_sentence(tmp_path, monkeypatch):
    """Its numbers of rows and columns are small: one text is long, and stands in every row."""
    path = hostile.endless_text_parquet(tmp_path / "dip.parquet")
    assert path.stat().st_size < 1 << 16
    monkeypatch.setattr(reading_process, "ROOM", 700 << 20)  # of 1.6 GB and more
    with pytest.raises(UserError, match=r"parquet: it takes more than .* of memory to read"):
        tractexp.read(str(path))


@pytest.mark.skipif(not Path("/proc/self/limits").exists(), reason="asks the system for limits")
def test_the_time_of_the_reader_is_limited_and_not_ours(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_CPU)
    path = hostile.workbook(tmp_path / "dip.xlsx", hostile.rows_of_cells(hostile.VALUES))
    with reading_process.ReadingProcess("workbook", path.read_bytes()) as book:
        limits = Path(f"/proc/{book._reader.pid}/limits").read_text()
    assert re.search(rf"Max cpu time +{reading_process.PATIENCE} ", limits)
    assert resource.getrlimit(resource.RLIMIT_CPU) == before


@pytest.mark.parametrize("name", ["no_book.xlsx", "no_book.xls", "empty_zip.xlsx", "repeated.ods"])
def test_what_is_no_workbook_is_said(name, tmp_path):
    path = hostile.INPUTS[name](tmp_path / name)
    with pytest.raises(UserError, match=rf"{name}: (not a workbook|byte 5 is zero)"):
        tractexp.read(str(path))


def test_a_parquet_file_is_read_without_pandas(tmp_path):
    """Its import takes three times as long as the rest of the reading."""
    path = tmp_path / "numbers.parquet"
    columns = {"t": [0.0, 0.1], "n": [1, None], "on": [True, False]}
    parquet.write_table(pyarrow.table(columns), path)
    program = (
        "import runpy, sys; own = runpy.run_path(sys.argv[1]);"
        "_, read = own['_open_parquet'](open(sys.argv[2], 'rb').read());"
        "print([(name, cells.tolist()) for name, cells in read('')], 'pandas' in sys.modules)"
    )
    command = [sys.executable, "-P", "-c", program, reading_process.__file__, str(path)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said == "[('t', [0.0, 0.1]), ('n', [1.0, nan]), ('on', [1.0, 0.0])] False\n"
