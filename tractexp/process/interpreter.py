"""How another Python is started: never with the folder of the records among those that modules are
looked for in.
"""

import contextlib
import os
import sys
from collections.abc import Iterator

SAFE_PATH = "PYTHONSAFEPATH"  # what -P says, for a Python that another package starts


def build_command(*arguments: str) -> list[str]:
    """The command that runs Python with these arguments; `-c` and `-m` would put the current folder
    first.
    """
    return [sys.executable, "-P", *arguments]


@contextlib.contextmanager
def keep_safe_path() -> Iterator[None]:
    """Within, every Python that this process starts, by whatever package, leaves the current folder
    out.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(SAFE_PATH, None)
        else:
            os.environ[SAFE_PATH] = before
