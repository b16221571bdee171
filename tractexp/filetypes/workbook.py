"""The sheets of a workbook, read in a process of its own that may die.

A file of a few hundred bytes may have one cell in the last row and column: what reads it asks the
system for the whole rectangle, and ends the process where there is no such memory. So that process
is another one, whose memory and time are limited before it opens the file. It runs this file as a
script, and needs no other of this package.
"""

import contextlib
import io
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any, Self

# bytes of memory that a workbook may take, and more for each byte of its file
ROOM, PER_BYTE = 2 << 30, 40
# s of a processor that it may take, and bytes of its file for which it may take one more
PATIENCE, BYTES_PER_SECOND = 120, 500_000


class BadWorkbook(Exception):
    """The file is no workbook, or a sheet of it is none; the message is empty, or says that its
    reader died.
    """


class Workbook:
    """An open workbook: the `names` of its sheets, and their rows on demand. Use it in a `with`
    statement.
    """

    def __init__(self, data: bytes) -> None:
        """Raises `BadWorkbook` for what is none."""
        memory, seconds = ROOM + PER_BYTE * len(data), PATIENCE + len(data) // BYTES_PER_SECOND
        command = [sys.executable, "-P", __file__, str(memory), str(seconds)]
        pipe = subprocess.PIPE
        self._reader = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL)
        try:
            self.names: list[str] = self._answer(data)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        """The open workbook."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def close(self) -> None:
        """End the process that reads it."""
        self._reader.kill()
        with contextlib.suppress(BrokenPipeError):  # what it has not read any more
            self._reader.communicate()

    def rows(self, name: str) -> list[list[Any]]:
        """The cells of a sheet, from its first row and column on. Raises `BadWorkbook` where it
        cannot be read.
        """
        return self._answer(name)

    def _answer(self, question: object) -> Any:
        """What the reading process answers. Raises `BadWorkbook` where it has ended."""
        stdin, stdout = self._reader.stdin, self._reader.stdout
        assert stdin is not None
        assert stdout is not None
        try:
            pickle.dump(question, stdin)
            stdin.flush()
            answer = pickle.load(stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise BadWorkbook(
                f"it takes more than {ROOM >> 30} GB of memory to read, or {PATIENCE} s, or its"
                " reader fails: a cell far from the "
                "table, such as one in the last row, counts as all the cells between; save the"
                " workbook without it"
            ) from None
        if answer is None:
            raise BadWorkbook
        return answer


def _serve(memory: int, seconds: int) -> None:
    """Answer what `Workbook` asks: the names of the sheets of a file, then the rows of each; None
    for what is none.
    """
    with contextlib.suppress(ImportError):  # a system that knows no such limits
        import resource

        for kind, limit in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds)):
            hard = resource.getrlimit(kind)[1]
            own = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
            resource.setrlimit(kind, (own, hard))
    import python_calamine

    def try_reading(read: Callable[[Any], Any], question: Any) -> Any:
        with contextlib.suppress(python_calamine.CalamineError, OSError, ValueError):
            return read(question)

    book: Any = try_reading(
        lambda data: python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data)), _question()
    )
    _give(book and list(book.sheet_names))
    with contextlib.suppress(EOFError):
        while True:
            _give(
                try_reading(
                    lambda name: book.get_sheet_by_name(name).to_python(skip_empty_area=False),
                    _question(),
                )
            )


def _question() -> Any:
    """The next question, in the reading process."""
    return pickle.load(sys.stdin.buffer)


def _give(answer: Any) -> None:
    """Give an answer, in the reading process."""
    pickle.dump(answer, sys.stdout.buffer)
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    _serve(int(sys.argv[1]), int(sys.argv[2]))
