"""A short walk through the states of a run's folder; `benchmarks/run_machine.py` is the machine and
walks long.
"""

import os

import pytest

if os.name == "nt":
    pytest.skip("forks", allow_module_level=True)


def test_nothing_is_lost_mixed_or_logged_twice_whatever_comes_next():
    import run_machine
    from hypothesis.stateful import run_state_machine_as_test

    run_state_machine_as_test(run_machine.RunMachine, settings=run_machine.SHORT)
    assert len(run_machine.STATES) > 6
    assert all(
        run_machine.COUNTS[name]
        for name in ("killed", "disk full", "second run", "again", "sync", "export")
    )
