"""Linear algebra in one thread, wherever this package computes in the process of another program.

Our matrices have a dozen columns: threads of a BLAS only wait for each other (a hundredfold under
load), and their number would change the last bits of a result. A process of our own says so before
it imports NumPy (`__main__`, the workers); in the process of another program nothing of it may stay
changed, so each call limits the libraries that are loaded for as long as it takes.
"""

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

OF_PROCESS = "OPENBLAS_NUM_THREADS"  # set by every process of ours before it imports NumPy
P = ParamSpec("P")
R = TypeVar("R")


@functools.cache
def _find_libraries() -> "ThreadpoolController":
    """The libraries of NumPy and SciPy, which bring one each: both are loaded by then."""
    import numpy as np  # noqa: F401
    import scipy.linalg  # noqa: F401  # pyright: ignore[reportUnusedImport]
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def limit_threads() -> Iterator[None]:
    """Within it, linear algebra runs in one thread; behind it, in as many as before."""
    if os.environ.get(OF_PROCESS) == "1":  # as the libraries found it when they were loaded
        yield
        return
    with _find_libraries().limit(limits=1, user_api="blas"):
        yield


def limit_to_one_thread(function: Callable[P, R]) -> Callable[P, R]:
    """The function, whose linear algebra runs in one thread.

    Examples
    --------
    >>> from threadpoolctl import threadpool_info
    >>> count = limit_to_one_thread(lambda: {one["num_threads"] for one in threadpool_info()})
    >>> count()
    {1}
    """

    @functools.wraps(function)
    def compute(*arguments: P.args, **keywords: P.kwargs) -> R:
        with limit_threads():
            return function(*arguments, **keywords)

    return compute
