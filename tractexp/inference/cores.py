"""Independent items on all cores, each in a process that is forked for it and so knows all that
this one knows.

A search is thousands of short calls of machine code. Threads that hand the interpreter to each
other after each of them took longer on two cores than one takes by itself.
"""

import contextlib
import multiprocessing
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from tractexp.errors import UserError
from tractexp.inference.effort import Effort
from tractexp.process.workers import end_with_parent

FORKS = sys.platform == "linux"  # elsewhere it is not safe, or not there
Item = TypeVar("Item")
Result = TypeVar("Result")
# what this process was forked for: it takes the position of an item
_calls: list[Callable[[int], Any]] = []


def count_cores() -> int:
    """The number of processes that an investigation may fork: the cores of this one, a container's
    limit considered.

    It is 1 where forking is not safe: off Linux, in a worker of a sweep (which has its share of the
    cores), in a process that was forked here, and in a thread, beside which others may hold locks.
    """
    from joblib import cpu_count

    beside = (
        multiprocessing.parent_process()
        or threading.current_thread() is not threading.main_thread()
    )
    return 1 if beside or not FORKS else cpu_count()


def map_on_cores(
    function: Callable[[Item], Result], items: Sequence[Item], effort: Effort
) -> list[Result]:
    """Apply a function to independent items, on all cores.

    Parameters
    ----------
    function : item -> result
        What it returns is sent back as data; what it does to objects of this process is lost, but
        for what it spends of the effort.
    items : sequence
        The arguments.
    effort : Effort
        Counts the simulations, and tells how many items have ended.

    Returns
    -------
    list
        The results, in the order of the items.

    Raises
    ------
    UserError
        Where a process is killed, as systems do where memory is short.
    """
    processes = min(count_cores(), len(items))
    with effort.parts(len(items)) as ended:
        if processes < 2:
            return [_count_result(function(item), ended) for item in items]

        def call(k: int) -> tuple[Result, list[int]]:
            before = effort.counts
            result = function(items[k])
            return result, effort.spent_since(before)

        results = list[Result]()
        with _fork_processes(call, processes) as done:
            for result, spent in done(range(len(items))):
                effort.add(spent)
                results.append(_count_result(result, ended))
        return results


@contextlib.contextmanager
def _fork_processes(
    call: Callable[[int], Any], processes: int
) -> Iterator[Callable[[Iterable[int]], Iterable[Any]]]:
    """Processes that know this call, ended at once where an error or Ctrl-C leaves it."""
    others = multiprocessing.active_children()
    try:
        with warnings.catch_warnings():
            # no thread holds a lock that they take
            warnings.filterwarnings("ignore", ".*fork", DeprecationWarning)
            with ProcessPoolExecutor(
                processes, multiprocessing.get_context("fork"), _begin, (call,)
            ) as pool:
                try:
                    yield lambda positions: _collect_in_order(
                        [pool.submit(_call, k) for k in positions]
                    )
                except BaseException:
                    for process in multiprocessing.active_children():
                        if process not in others:
                            process.kill()
                    raise
    except BrokenProcessPool as error:
        raise UserError(
            "a process at work on a part of this step was killed, as systems do where memory is"
            " short; close other"
            " programs, or allow this one fewer cores (taskset)"
        ) from error


def _collect_in_order(calls: Sequence[Future[Any]]) -> Iterator[Any]:
    """The results of calls, in their order.

    `Executor.map` does not serve: it cancels what is left, and Python 3.11's pool cannot end a call
    that was cancelled.
    """
    for future in calls:
        yield future.result()


def _count_result(result: Result, ended: Callable[[], None]) -> Result:
    """The result, whose end is counted."""
    ended()
    return result


def _call(k: int) -> Any:
    """The result of the k-th item; runs in a worker."""
    return _calls[-1](k)


def _begin(call: Callable[[int], Any]) -> None:
    """Set a worker up: it keeps the call, which a fork need not send, and ends by Ctrl-C without a
    traceback and with its parent, even where that is killed.
    """
    _calls.append(call)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    end_with_parent()
