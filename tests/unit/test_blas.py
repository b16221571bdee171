"""Linear algebra has one thread in our calls, and as many as before in the host's."""

import pytest
from threadpoolctl import ThreadpoolController

from tractexp.api.arguments import public
from tractexp.process.blas import OF_PROCESS, limit_threads, limit_to_one_thread


@pytest.fixture
def host(monkeypatch):
    """The libraries of a program that has given them two threads."""
    monkeypatch.delenv(OF_PROCESS)
    with limit_threads():  # they are loaded by then
        pass
    libraries = ThreadpoolController()
    with libraries.limit(limits=2, user_api="blas"):
        yield lambda: {one.num_threads for one in libraries.select(user_api="blas").lib_controllers}


def test_a_call_has_one_thread_and_leaves_the_host_its_own(host):
    @public
    def call() -> set[int]:
        """What the libraries use within."""
        return host()

    assert host() == {2}
    assert call() == {1}
    assert limit_to_one_thread(host)() == {1}
    assert host() == {2}


def test_a_call_that_fails_leaves_the_host_its_own(host):
    with pytest.raises(ZeroDivisionError):
        limit_to_one_thread(lambda: 1 / 0)()
    assert host() == {2}
