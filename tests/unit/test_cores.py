"""Independent items on all cores, `map_on_cores`: forked processes that know all of this one, and
tell what they spent.
"""

import multiprocessing
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import joblib
import pytest

from tractexp.errors import UserError
from tractexp.inference import cores
from tractexp.inference.cores import map_on_cores
from tractexp.inference.effort import Effort
from tractexp.process.workers import Workers

forked = pytest.mark.skipif(not cores.FORKS, reason="processes are forked on Linux only")


@pytest.mark.parametrize("number", [1, 3])
def test_items_are_counted_as_they_end_and_what_they_spend_is_told_part_by_part(
    number, monkeypatch
):
    monkeypatch.setattr(cores, "count_cores", lambda: number)
    effort, told = Effort(), []
    part, parts = effort.anew(), effort.parts

    @contextmanager
    def counted(total):
        with parts(total) as ended:
            yield lambda: (told.append(total), ended())

    def work(k):
        effort.spend(k)
        part.spend(10 * k)
        part.anew().spend(100)  # a part that the caller does not know yet is the item's
        return k, os.getpid()

    monkeypatch.setattr(effort, "parts", counted)
    results = map_on_cores(work, [1, 2, 3, 4], effort)
    assert [k for k, _ in results] == [1, 2, 3, 4]
    assert told == [4] * 4
    assert effort.total == 10 + 100 + 400
    assert part.simulations == 100
    assert (os.getpid() in {pid for _, pid in results}) == (number == 1 or not cores.FORKS)


@forked
def test_an_item_that_has_items_does_them_one_after_the_other(monkeypatch):
    monkeypatch.setattr(joblib, "cpu_count", lambda: 2)
    pids = map_on_cores(
        lambda k: map_on_cores(lambda _: os.getpid(), [1, 2], Effort()), [1, 2], Effort()
    )
    assert all(len({*inner}) == 1 for inner in pids)
    assert os.getpid() not in {pid for inner in pids for pid in inner}


@forked
def test_an_interrupted_step_waits_for_nobody(monkeypatch):
    """Ctrl-C may come while an item ends; the others would sleep for long."""

    @contextmanager
    def interrupted(total):
        def ended():
            raise KeyboardInterrupt

        yield ended

    effort = Effort()
    # an earlier test of a sweep may have left workers that idle
    others = multiprocessing.active_children()
    monkeypatch.setattr(cores, "count_cores", lambda: 2)
    monkeypatch.setattr(effort, "parts", interrupted)
    with pytest.raises(KeyboardInterrupt):
        map_on_cores(lambda seconds: time.sleep(seconds), [0, 10_000, 10_000], effort)
    assert not {*multiprocessing.active_children()} - {*others}


@forked
def test_a_thread_and_a_worker_of_a_sweep_fork_nothing(monkeypatch):
    monkeypatch.setattr(joblib, "cpu_count", lambda: 2)
    assert cores.count_cores() == 2
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(cores.count_cores).result() == 1
    results = Workers(n_jobs=1, apart=True).run_items(_cores, [0], 1)
    assert [count for _, count in results] == [1]


def _cores(_):
    return cores.count_cores()


@forked
def test_an_error_of_an_item_is_its_own_and_a_killed_process_is_a_sentence(monkeypatch):
    monkeypatch.setattr(cores, "count_cores", lambda: 2)

    def refuse(k):
        raise UserError(f"item {k} is not allowed; leave it out")

    with pytest.raises(UserError, match="item 1 is not allowed; leave it out"):
        map_on_cores(refuse, [1, 2], Effort())
    with pytest.raises(
        UserError, match="killed, as systems do where memory is short; close other programs"
    ):
        map_on_cores(lambda k: os.kill(os.getpid(), signal.SIGKILL), [1, 2], Effort())
    assert map_on_cores(lambda k: k + 1, [1, 2], Effort()) == [2, 3]
