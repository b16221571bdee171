"""Worker processes: killed ones, one by itself, none that begins, and those that are replaced."""

import contextlib
import os
import subprocess
import sys
import time
import warnings
from concurrent.futures import BrokenExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from joblib.parallel import BACKENDS, ThreadingBackend

from tractexp.errors import UserError
from tractexp.process import interpreter
from tractexp.process.workers import BARREN, Workers

GROWING = """
import sys
import time
from tractexp.process.workers import Workers

def grow(k):  # past the 300 MB at which joblib lets a worker end; it looks once in a second
    sys.__dict__.setdefault("kept", []).append(b"x" * 150_000_000)
    time.sleep(1.1)
    return k

print(sorted(k for _, k in Workers(2).run_items(grow, range(10), 10)))
"""


def test_jobs_end_where_warnings_are_errors_and_their_workers_grow():
    """With joblib's warning the last jobs never end: this one is killed."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", GROWING], capture_output=True, text=True, timeout=100
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[0] == str(list(range(10)))
    assert "A worker stopped" not in done.stderr


def counted(case):
    """Note in a file that a call has begun; the third one kills its worker."""
    folder, k = case
    with Path(folder, str(k)).open("a") as file:
        file.write("x")
    if k == 2:
        os._exit(9)
    time.sleep(0.05)
    return k, os.getpid()


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_a_call_that_kills_its_worker_is_blamed_and_no_other(n_jobs, tmp_path):
    cases = [(tmp_path, k) for k in range(5)]
    ends = {
        case[1]: result
        for case, result in Workers(n_jobs, apart=True).results(counted, cases, tries=3)
    }
    assert {k: result and result[0] for k, result in ends.items()} == {
        0: 0,
        1: 1,
        2: None,
        3: 3,
        4: 4,
    }
    # nor with one worker
    assert os.getpid() not in {result[1] for result in ends.values() if result}
    begun = {k: len((tmp_path / str(k)).read_text()) for k in range(5)}
    assert begun[2] == 3
    assert all(1 <= begun[k] <= 2 for k in (0, 1, 3, 4))
    if n_jobs == 1:
        assert {begun[k] for k in (0, 1, 3, 4)} == {1}


def killed_between(k):
    """The second of three calls that are in work together kills its worker."""
    time.sleep(0.3 if k == 1 else 0.8)
    if k == 1:
        os._exit(9)
    return k


def test_a_call_that_joblib_takes_ahead_with_the_one_that_kills_is_not_blamed():
    assert sorted(Workers(3).results(killed_between, range(3))) == [(0, 0), (1, None), (2, 2)]


class Killed(Workers):
    """Workers that are killed as soon as they start, as where there is no memory for them."""

    def run_items(self, function, items, count):
        next(iter(items))
        raise BrokenExecutor
        yield


def test_workers_that_never_begin_are_refused_in_a_sentence():
    looks = []
    with pytest.raises(
        UserError, match="killed before they begin: is there enough memory for them"
    ):
        list(Killed().results(abs, [1, 2], trace=lambda item: bool(looks.append(item))))
    assert looks == [1] * BARREN


def pause(seconds):
    time.sleep(0.01 * seconds)


def test_what_a_call_had_left_is_its_result():
    ends = list(Killed().results(abs, [1, 2], trace=lambda item: f"end of {item}"))
    assert ends == [(1, "end of 1"), (2, "end of 2")]


class AtTheEnd(ThreadingBackend):
    """Gives its results at the end alone, as joblib's "multiprocessing" and Ray's."""

    supports_return_generator = False


def test_a_backend_that_gives_its_results_at_the_end_alone_does_the_calls(monkeypatch):
    monkeypatch.setitem(BACKENDS, "at_the_end", AtTheEnd)
    for n_jobs in (1, 2):
        found = Workers(n_jobs, "at_the_end", apart=True).results(abs, [-1, -2, -3])
        assert [*found] == [(-1, 1), (-2, 2), (-3, 3)]


def test_ray_is_asked_for_its_backend_where_it_is_installed(monkeypatch):
    """Here a stand-in of it; Ray 2.60 itself runs a sweep."""
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UserError, match="backend=ray needs Ray, which is not installed"):
        list(Workers(2, "ray").results(abs, [-1]))
    monkeypatch.setitem(BACKENDS, "ray", None)
    ray = SimpleNamespace(register_ray=lambda: BACKENDS.update(ray=AtTheEnd))
    for name in ("ray", "ray.util", "ray.util.joblib"):
        monkeypatch.setitem(sys.modules, name, ray)
    assert [*Workers(2, "ray").results(abs, [-1, -2])] == [(-1, 1), (-2, 2)]


def test_calls_that_are_given_up_end_without_a_warning_whatever_other_threads_filter():
    """joblib warns of results that are not used; here what filtered that is taken back before."""
    with contextlib.closing(Workers(2).run_items(pause, range(40), 40)) as results:
        next(results)
        warnings.resetwarnings()
        warnings.simplefilter("error")


def test_libraries_use_one_thread_in_each_worker(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    assert sorted(Workers(2).run_items(os.getenv, names, 3)) == [(0, "1"), (1, "1"), (2, "1")]


def test_an_import_changes_nothing_of_its_process():
    code = (
        "import os, signal, sys, threading, warnings\n"
        "def state():\n"
        "    handlers = [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)]\n"
        "    outside = [n for n in sys.modules if n.partition('.')[0] == 'numpy']\n"
        "    return dict(os.environ), sys.path[:], handlers, threading.enumerate(),"
        " warnings.filters[:], outside\n"
        "before = state()\n"
        "import tractexp\n"
        "assert state() == before\n"
    )
    subprocess.run(interpreter.build_command("-c", code), check=True, timeout=60)
