"""What a command prints: where it cannot be written, as into a pipe that nobody reads any more, the
work goes on.
"""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any


class Outlet(io.FileIO):
    """A stream of bytes that ends nobody: after its first fault, which it keeps, it drops what is
    written.
    """

    fault: OSError | None = None

    def write(self, data: object, /) -> int:
        """Write what is printed; where that fails, keep why and go on."""
        if self.fault is None:
            try:
                return super().write(data)  # type: ignore[arg-type]
            except OSError as error:
                self.fault = error
        return len(data)  # type: ignore[arg-type]

    @property
    def lost(self) -> str:
        """Why something could not be printed; "" where all was, or its reader did not want more."""
        return (
            ""
            if self.fault is None or isinstance(self.fault, BrokenPipeError)
            else str(self.fault.strerror)
        )


@contextmanager
def open_outlet() -> Iterator[Outlet | None]:
    """Print by an `Outlet` within; None where the process's own output is redirected, closed, or
    Windows'.

    Characters that the encoding of the output lacks are written as escapes.
    """
    usual: Any = sys.stdout
    if usual is None or usual is not sys.__stdout__ or os.name == "nt":
        yield None
        return
    usual.flush()
    raw = Outlet(usual.fileno(), "w", closefd=False)
    lines, through = usual.line_buffering, usual.write_through
    stream = io.TextIOWrapper(
        io.BufferedWriter(raw),
        usual.encoding,
        "backslashreplace",
        line_buffering=lines,
        write_through=through,
    )
    with redirect_stdout(stream):
        try:
            yield raw
        finally:
            stream.flush()
