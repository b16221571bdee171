"""Worker processes that start once for many jobs: on this computer, or on a Dask cluster.

On this computer they are those of the standard library. `joblib.Parallel` cannot do it by its public interface: with
one worker it runs the job in this process, which a job that kills its worker then takes along, and what runs cannot be
ended (joblib/joblib#508, #881). A `concurrent.futures` executor has both, and one of loky's is no faster.
"""

import contextlib
import logging
import multiprocessing
import os
import signal
import threading
import warnings
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import Any

from tractexp.errors import UserError

MOST = 61  # processes Windows can wait for


@contextlib.contextmanager
def processes(n: int) -> Iterator[Executor]:
    """An executor on `n` processes of their own, which end with the block, whatever they are doing."""
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")  # a fork would copy threads' locks, as MLflow's
    executor = ProcessPoolExecutor(min(n, MOST), context, initializer=_begin)
    try:
        yield executor
    finally:  # at a good end as well: the jobs' ends are on disk, and a worker takes a while to leave
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()
        executor.shutdown(cancel_futures=True)


def _begin() -> None:
    """Leave Ctrl-C, which reaches the whole group, to the parent, and end with it, even where it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()


@contextlib.contextmanager
def replaced() -> Iterator[None]:
    """Around `joblib.Parallel`: a worker that has grown by 300 MB ends between two jobs, and another takes its place.

    joblib warns of it in the thread that minds the workers. Where warnings are errors it is the thread that ends, and
    the jobs never do.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "A worker stopped while some jobs were given", UserWarning)
        yield


@contextlib.contextmanager
def dask_cluster(n: int, address: str | None) -> Iterator[Executor]:
    """An executor on the Dask cluster at `address`, or on one of our own with `n` workers.

    Raises `UserError` where Dask is not installed or no scheduler answers.
    """
    try:
        import dask.config
        from distributed import Client, LocalCluster
    except ImportError:
        raise UserError(
            "hydra.launcher.backend=dask needs Dask, which is not installed: pip install 'tractexp[dask]'"
        ) from None
    loud = logging.getLogger("distributed")  # its remarks on every worker that comes or goes would tear the bar
    loud.propagate, loud.handlers = False, [logging.NullHandler()]
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))  # we count ourselves
        if address is None:
            local: Any = LocalCluster  # its annotations know neither a cluster without a dashboard nor its address
            cluster = local(n_workers=n, threads_per_worker=1, dashboard_address=None, silence_logs=50)
            address = stack.enter_context(cluster).scheduler_address
        try:
            client = stack.enter_context(Client(address, timeout="10s"))
        except (OSError, ValueError) as error:
            raise UserError(f"hydra.launcher.address={address}: no Dask scheduler answers there ({error})") from error
        yield client.get_executor(pure=False)
