"""Workbooks and Parquet files, read by libraries in a process of its own that may die.

A file of a few hundred bytes may have one cell in the last row and column, or a column of which a
page says that it holds a gigabyte: what reads it asks the system for all of that, and ends the
process where there is no such memory. So that process is another one, whose memory and time are
limited before it opens the file. It runs this file as a script, and needs no other of this package.
"""

import contextlib
import io
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any, Self

# bytes of memory that a file may take, and more for each byte of it
ROOM, PER_BYTE = 2 << 30, 40
# s of a processor that it may take, and bytes of it for which it may take one more
PATIENCE, BYTES_PER_SECOND = 60, 200_000
# libraries that would reserve memory for each processor, and more than they use
FRUGAL = {"OPENBLAS_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}


class BadFile(Exception):
    """The file, or what was asked of it, is none of its kind; the message is empty, or says that
    its reader died.
    """


class ReadingProcess:
    """An open file: `content` is what it says it holds, `read` gives a part of it. Use it in a
    `with` statement.
    """

    def __init__(self, kind: str, data: bytes) -> None:
        """`kind` is one of those in `OPENERS`. Raises `BadFile` for what is none of it."""
        memory, seconds = ROOM + PER_BYTE * len(data), PATIENCE + len(data) // BYTES_PER_SECOND
        command = [sys.executable, "-P", __file__, kind, str(memory), str(seconds)]
        pipe = subprocess.PIPE
        self._reader = subprocess.Popen(
            command,
            stdin=pipe,
            stdout=pipe,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **FRUGAL},
        )
        try:
            self.content: Any = self._answer(data)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        """The open file."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def close(self) -> None:
        """End the process that reads it."""
        self._reader.kill()
        with contextlib.suppress(BrokenPipeError):  # what it has not read any more
            self._reader.communicate()

    def read(self, name: str = "") -> Any:
        """The rows of the sheet of that name, or all columns. Raises `BadFile` where they cannot be
        read.
        """
        return self._answer(name)

    def _answer(self, question: object) -> Any:
        """The answer of the reading process. Raises `BadFile` where it has ended."""
        stdin, stdout = self._reader.stdin, self._reader.stdout
        assert stdin is not None
        assert stdout is not None
        try:
            pickle.dump(question, stdin)
            stdin.flush()
            answer = pickle.load(stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise BadFile(
                f"it takes more than {ROOM >> 30} GB of memory to read, or {PATIENCE} s, or its"
                " reader fails: a few bytes of it stand for very many cells, as where a sheet has"
                " one in its last row; save the table without them"
            ) from None
        if answer is None:
            raise BadFile
        return answer


def _open_workbook(data: bytes) -> tuple[list[str], Callable[[str], list[list[Any]]]]:
    """The names of the sheets, and the cells of one of them, from its first row and column on."""
    import python_calamine

    try:
        book = python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
    except python_calamine.CalamineError as error:
        raise ValueError from error

    def read_sheet(name: str) -> list[list[Any]]:
        try:
            return book.get_sheet_by_name(name).to_python(skip_empty_area=False)
        except python_calamine.CalamineError as error:
            raise ValueError from error

    return list(book.sheet_names), read_sheet


def _open_parquet(data: bytes) -> tuple[tuple[int, int], Callable[[str], list[tuple[str, Any]]]]:
    """The numbers of columns and rows, and all columns: name, cells."""
    import pyarrow
    from pyarrow import parquet

    try:
        file = parquet.ParquetFile(pyarrow.BufferReader(data))
    except pyarrow.ArrowException as error:
        raise ValueError from error

    def read_columns(_: str) -> list[tuple[str, Any]]:
        """All columns, for this kind of file has no sheets to name. Raises ValueError where Arrow
        cannot read them.
        """
        try:
            table = file.read(use_threads=False)
            return [
                (str(name), _list_cells(table.column(k)))
                for k, name in enumerate(table.column_names)
            ]
        except MemoryError:  # which is one of Arrow's, too
            raise
        except pyarrow.ArrowException as error:
            raise ValueError from error

    return (file.metadata.num_columns, file.metadata.num_rows), read_columns


def _list_cells(column: Any) -> Any:
    """The cells of a column: an array of numbers where it is one, gaps nan."""
    import numpy as np
    import pyarrow
    from pyarrow import types

    kind, numeric = (
        column.type,
        (types.is_floating, types.is_integer, types.is_boolean, types.is_null, types.is_decimal),
    )
    if any(is_of(kind) for is_of in numeric):
        numbers = column.cast("float64")
        if numbers.null_count:
            return np.array(numbers.to_pylist(), dtype=float)
        # Arrow's own `to_numpy` imports pandas first, which takes three times as long as all else
        return np.from_dlpack(numbers.combine_chunks())
    if types.is_timestamp(kind):  # Python's own times have microseconds at most
        moments = column.cast(pyarrow.timestamp("us", tz=kind.tz), safe=False)
        return [None if cell is None else cell.replace(tzinfo=None) for cell in moments.to_pylist()]
    return column.to_pylist()


# each gives what a file says it holds, and what reads a part of it; they raise ValueError, OSError
OPENERS: dict[str, Callable[[bytes], tuple[Any, Callable[[str], Any]]]] = {
    "workbook": _open_workbook,
    "columns": _open_parquet,
}


def _serve(kind: str, memory: int, seconds: int) -> None:
    """Answer what `ReadingProcess` asks: what a file says it holds, then parts of it; None for what
    is none.
    """
    with contextlib.suppress(ImportError):  # a system that knows no such limits
        import resource

        for limited, limit in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds)):
            hard = resource.getrlimit(limited)[1]
            own = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
            resource.setrlimit(limited, (own, hard))

    opened = _call(OPENERS[kind], _take_question())
    if opened is None:
        _give(None)
        return
    content, read = opened
    _give(content)
    with contextlib.suppress(EOFError):
        while True:
            _give(_call(read, _take_question()))


def _call(read: Callable[[Any], Any], question: Any) -> Any:
    """The result of a library's reader; None for what it cannot read."""
    with contextlib.suppress(OSError, ValueError):
        return read(question)


def _take_question() -> Any:
    """The next question, in the reading process."""
    return pickle.load(sys.stdin.buffer)


def _give(answer: Any) -> None:
    """Give an answer, in the reading process."""
    pickle.dump(answer, sys.stdout.buffer)
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    _serve(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
