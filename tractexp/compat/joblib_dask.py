"""Joblib's Dask backend, which waits forever for a call whose worker was killed.

What: `DaskDistributedBackend._collect` stores the error of a future that failed, `KilledWorker`,
but leaves out the callback, so that `Parallel` never hears of it. This backend calls it. A killed
worker is answered by None in place of a result and not by an error, for an error ends the whole
`Parallel` while other workers of a cluster work on. Why not through joblib: its documentation shows
how to write a backend, but this one is in `joblib._dask` only. Since: at least joblib 1.5; looked
at in 1.6.0. Upstream: not reported yet. When mended: drop this module, and let `KilledWorker` end a
`Parallel` as a broken executor does.
"""

from concurrent.futures import Future
from typing import Any

from joblib._dask import DaskDistributedBackend


class Dask(DaskDistributedBackend):
    """The backend that tells of killed workers, by None, and leaves the calls to its worker where
    there is but one.
    """

    def configure(self, *args: Any, **settings: Any) -> int:
        """Two workers at least: with one joblib would run calls in this process."""
        return max(2, super().configure(*args, **settings))

    def submit(self, func: Any, callback: Any = None) -> Any:
        """Submit a call; the callback hears of a failed one, too."""
        future = super().submit(func, callback)
        if callback is not None:
            future.add_done_callback(lambda done: done.exception() and callback(done))
        return future

    def retrieve_result_callback(self, out: Any) -> Any:
        """The result of a call; [None] where its worker was killed."""
        if not isinstance(out, Future):
            return super().retrieve_result_callback(out)
        if type(out.exception()).__name__ == "KilledWorker":
            return [None]
        return out.result()
