"""Worker processes for many calls, by `joblib.Parallel` with any of its backends.

Three things joblib cannot do by its public calls. With one worker it runs calls in this process,
which a call that kills its worker takes along; so one that is to be apart is two, which get one
call at a time. Where a worker is killed, `Parallel` ends and does not say whose worker it was; so
what was in work is called again, each in a `Parallel` of its own, and only a call that kills a
worker by itself is to blame. A loky worker outlives a parent that is killed; so a thread of it
watches the parent.
"""

import contextlib
import importlib
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from tractexp.errors import UserError
from tractexp.process import interpreter

BARREN = 3  # times in a row that workers may be killed before they begin a call
WATCH = 0.5  # s between two looks of a worker at its parent

Item = TypeVar("Item")


def list_backends() -> list[str]:
    """The names of joblib's backends, and of those that a package or plugin has
    registered with it.
    """
    from joblib.parallel import BACKENDS

    return sorted({*BACKENDS, "dask", "ray"})


@dataclass(frozen=True)
class Workers:
    """Workers of a joblib backend: "loky" (processes of this computer), "dask", "ray", "threading"
    or a registered one.

    `n_jobs` -1: one for each core this process may use, containers' limits considered, or all of a
    cluster. `address` is that of a Dask scheduler; without one, "dask" starts a cluster here. One
    worker is this process, unless it is to be `apart`.
    """

    n_jobs: int = -1
    backend: str = "loky"
    address: str | None = None
    apart: bool = False
    where: str = "hydra.launcher"  # the setting that chose them, as sentences name it

    def run_items(
        self, function: Callable[[Item], Any], items: Iterable[Item], count: int
    ) -> Iterator[tuple[int, Any]]:
        """(position, result) of the `count` items, as they are done.

        Raises `BrokenExecutor` where a worker is killed; a killed worker of a Dask cluster leaves
        its item out.
        """
        from joblib import delayed, effective_n_jobs

        with self._chosen(), _silence_joblib():
            n = min(self.n_jobs if self.n_jobs > 0 else effective_n_jobs(self.n_jobs), count)
            parallel = _make_parallel(max(n, 1 + self.apart), ahead=n)
            calls = (delayed(_number_result)(function, k, item) for k, item in enumerate(items))
            # One at a time where one is at work: joblib drops a result that waits when the next
            # call kills its worker.
            for batch in ([call] for call in calls) if n == 1 else [calls]:
                results = parallel(batch)
                try:
                    yield from (result for result in results if result is not None)
                finally:
                    # anew: a thread that ends its own `catch_warnings` takes these filters back
                    with _silence_joblib():
                        if not isinstance(results, list):
                            results.close()

    def results(
        self,
        function: Callable[[Item], Any],
        items: Sequence[Item],
        tries: int = 2,
        trace: Callable[[Item], Any] = lambda item: True,
    ) -> Generator[tuple[Item, Any], None, None]:
        """(item, result) as they are done; None for an item whose worker was killed each of the
        `tries` times.

        `trace` tells what an item has left that was in work when a worker was killed: False where
        it had not begun, True where it had, or its result. Raises `UserError` where workers are
        killed before they begin.
        """
        suspects = yield from self._side_by_side(function, items, trace)
        alone = replace(self, n_jobs=1, apart=True)
        # each alone, since joblib takes items ahead of those that are in work
        for item in suspects:
            remaining = [item]
            for _ in range(tries - 1):
                remaining = yield from alone._side_by_side(function, remaining, trace)
            yield from ((item, None) for item in remaining)

    def _side_by_side(
        self, function: Callable[[Item], Any], items: Sequence[Item], trace: Callable[[Item], Any]
    ) -> Generator[tuple[Item, Any], None, list[Item]]:
        """Yield results and return the items that were in work when a worker was killed."""
        remaining, suspects, barren = dict(enumerate(items)), [], 0
        while remaining:
            barren += 1
            keys, working = list(remaining), set[int]()
            with contextlib.suppress(BrokenExecutor):
                for k, result in self.run_items(
                    function, _note_items(remaining, keys, working), len(keys)
                ):
                    working.discard(k)
                    barren = 0
                    yield remaining.pop(keys[k]), result
            for key in [keys[k] for k in sorted(working)]:
                state = trace(remaining[key])
                if state is False:
                    continue
                barren, item = 0, remaining.pop(key)
                if state is True:
                    suspects.append(item)
                else:
                    yield item, state
            if barren == BARREN:
                raise UserError(
                    "worker processes are killed before they begin: is there enough memory for"
                    " them?"
                )
        return suspects

    @contextlib.contextmanager
    def _chosen(self) -> Iterator[None]:
        """The backend, for the calls of joblib within."""
        from joblib import parallel_config

        with contextlib.ExitStack() as stack:
            stack.enter_context(interpreter.keep_safe_path())
            if self.backend == "dask":
                from tractexp.compat.joblib_dask import Dask

                chosen = {
                    "backend": Dask(
                        client=stack.enter_context(
                            connect_to_dask(self.n_jobs, self.address, self.where)
                        )
                    )
                }
            elif self.backend == "loky":
                chosen = {"backend": "loky", "inner_max_num_threads": 1, "initializer": _begin}
            else:
                if self.backend == "ray":
                    _register_ray()
                chosen = {"backend": self.backend}
            stack.enter_context(parallel_config(**chosen))
            yield


def _make_parallel(n_jobs: int, ahead: int) -> Any:
    """A `Parallel` of so many workers that takes so many calls ahead, one a time.

    Results come as they are done; all at the end from a backend that knows no other way, as
    "multiprocessing" and Ray's.
    """
    from joblib import Parallel

    # numbers, other than joblib's annotations say
    dispatch: Any = {"n_jobs": n_jobs, "batch_size": 1, "pre_dispatch": ahead}
    try:
        return Parallel(return_as="generator_unordered", **dispatch)
    except ValueError:
        return Parallel(**dispatch)


def _number_result(function: Callable[[Any], Any], k: int, item: Any) -> tuple[int, Any]:
    """The position of an item, and what a function gives for it."""
    return k, function(item)


def _note_items(
    remaining: dict[int, Item], keys: Sequence[int], working: set[int]
) -> Iterator[Item]:
    """The items by their keys; the position of one that is taken is in work from then on."""
    for k, key in enumerate(keys):
        working.add(k)
        yield remaining[key]


@contextlib.contextmanager
def _silence_joblib() -> Iterator[None]:
    """Without two warnings of joblib's.

    A worker that has grown by 300 MB ends between two calls, and another takes its place. Joblib
    warns of it in the thread that minds the workers: where warnings are errors that thread ends,
    and the calls never do. The other one says that results are not used where this process is
    ended.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", "A worker stopped while some jobs were given", UserWarning
        )
        warnings.filterwarnings("ignore", ".*tasks (have been|which were still)", UserWarning)
        yield


def _begin() -> None:
    """Leave Ctrl-C, which reaches the whole group, to the parent, and end with it, even where it is
    killed.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


def end_with_parent() -> None:
    """End this process once its parent has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    """Wait for the parent's end, and end."""
    if os.name == "nt":
        parent.join()
    # elsewhere loky hands down nothing to wait for
    while os.name != "nt" and os.getppid() == parent.pid:
        time.sleep(WATCH)
    os._exit(1)


def _register_ray() -> None:
    """Let joblib know Ray's backend. Raises `UserError` where Ray is not installed."""
    try:
        importlib.import_module("ray.util.joblib").register_ray()
    except ImportError:
        raise UserError(
            "hydra.launcher.backend=ray needs Ray, which is not installed: pip install ray"
        ) from None


@contextlib.contextmanager
def connect_to_dask(
    n_jobs: int, address: str | None, where: str = "hydra.launcher"
) -> Iterator[Any]:
    """A client of the Dask cluster at `address`, or of one of our own; `where` names the setting.

    Raises `UserError` where Dask is not installed or no scheduler answers.
    """
    try:
        import dask.config
        from distributed import Client, LocalCluster
    except ImportError:
        raise UserError(
            f"{where}.backend=dask needs Dask, which is not installed: pip install 'tractexp[dask]'"
        ) from None
    import logging

    from joblib import cpu_count

    # its remarks on every worker that comes or goes would tear the bar
    loud = logging.getLogger("distributed")
    loud.propagate, loud.handlers = False, [logging.NullHandler()]
    with contextlib.ExitStack() as stack:
        # we count ourselves
        stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
        if address is None:
            # its annotations know neither a cluster without a dashboard nor its address
            local: Any = LocalCluster
            n = n_jobs if n_jobs > 0 else cpu_count()
            cluster = local(
                n_workers=n, threads_per_worker=1, dashboard_address=None, silence_logs=50
            )
            address = stack.enter_context(cluster).scheduler_address
        try:
            client = stack.enter_context(Client(address, timeout="10s"))
        except (OSError, ValueError) as error:
            raise UserError(
                f"{where}.address={address}: no Dask scheduler answers there ({error})"
            ) from error
        yield client
