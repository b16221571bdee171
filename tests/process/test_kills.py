"""`kill -9` of real commands at some moments; `benchmarks/kills.py` takes every one."""

import os

import pytest
from command_line import as_it_was

if os.name == "nt":
    pytest.skip("forks", allow_module_level=True)


@pytest.mark.parametrize("task", ["plan", "export"])
def test_who_kills_a_command_leaves_the_earlier_files_or_the_new_ones(task, tmp_path, monkeypatch):
    import kills

    monkeypatch.chdir(tmp_path)
    with as_it_was({}):  # a command that runs in this process sets Hydra's switches
        counts = kills.KILLS[task](every=20)
    assert counts.keys() <= {kills.EARLIER, kills.NEWER}
    assert counts.total() > 3
    assert counts[kills.EARLIER] > 0
