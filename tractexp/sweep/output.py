"""Where a job prints: into its own file, also where several jobs run in threads of one process."""

import contextlib
import sys
import threading
from collections.abc import Iterator
from typing import Any

_lock = threading.Lock()
_outputs: dict[int, Any] = {}  # of jobs that are running, by thread
_redirected = contextlib.ExitStack()


class _ByThread:
    """A stream that is the output of the job in this thread, or of the one in the main thread, or
    else `usual`.
    """

    def __init__(self, usual: Any):
        """A stream that each thread may have another one of."""
        self.usual = usual

    def __getattr__(self, name: str) -> Any:
        """An attribute of this thread's stream."""
        main = threading.main_thread().ident or 0
        return getattr(
            _outputs.get(threading.get_ident()) or _outputs.get(main) or self.usual, name
        )


@contextlib.contextmanager
def redirect_prints(output: Any) -> Iterator[None]:
    """Send what this thread prints to `output`."""
    thread = threading.get_ident()
    with _lock:
        if not _outputs:
            out: Any = _ByThread(sys.stdout)
            error: Any = _ByThread(sys.stderr)
            _redirected.enter_context(contextlib.redirect_stdout(out))
            _redirected.enter_context(contextlib.redirect_stderr(error))
        _outputs[thread] = output
    try:
        yield
    finally:
        with _lock:
            del _outputs[thread]
            if not _outputs:
                _redirected.close()
