"""How long this process may work on one record, by the bytes of its files."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

from tractexp.errors import UserError

# s of a processor that the files of one record may take, and bytes of them that may take one more
PATIENCE, BYTES_PER_SECOND = 120.0, 500_000


class _OutOfTime(BaseException):
    """The time of a record is over: no error that a reader may take for one of the file's."""


def _end_reading(*_: object) -> None:
    raise _OutOfTime


@contextlib.contextmanager
def limit_time(path: Path | str) -> Iterator[None]:
    """Let this process work on the record at `path`, and on the files that belong to it, as long as
    any record takes. Raises `UserError` after that, whatever its reader does then.

    It counts the seconds of a processor in this process, so that neither a slow disk nor another
    program shortens them, and gives more for each byte that is opened. Within another limit that
    one holds. A thread that is not the main one, and Windows, have no such clock.
    """
    main = threading.current_thread() is threading.main_thread()
    if not (main and hasattr(signal, "setitimer")) or _has_clock():
        yield
        return
    before = signal.signal(signal.SIGVTALRM, _end_reading)
    # again each second: where Python ignores what is raised, as in a weak reference's call
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE, 1.0)
    try:
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    except _OutOfTime:
        raise UserError(
            f"{path} takes more than {PATIENCE:g} s of a processor to read, which no record of its"
            " size does: it is damaged, or made to do so; give a part of it"
        ) from None
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before or signal.SIG_DFL)


def _has_clock() -> bool:
    """Whether the time of a record is being counted."""
    vtalrm = getattr(signal, "SIGVTALRM", None)
    return vtalrm is not None and signal.getsignal(vtalrm) is _end_reading


def grant_time(count: int) -> None:
    """Let a record that is being read take longer, by the bytes of a file of it."""
    if _has_clock() and threading.current_thread() is threading.main_thread():
        left, again = signal.getitimer(signal.ITIMER_VIRTUAL)
        signal.setitimer(signal.ITIMER_VIRTUAL, left + count / BYTES_PER_SECOND, again)
