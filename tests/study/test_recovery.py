"""Parameters that others' simulators were run with come back from their records (table:
benchmarks/recovery.py).
"""

from dataclasses import replace
from functools import cache

import motulator_check
import pytest
import recovery


def skip_without(simulator):
    if recovery.SIMULATORS[simulator][0]() is None:
        variable = f"TRACTEXP_{simulator.upper()}_PYTHON"
        pytest.skip(
            f"{simulator} is not installed; install the extra 'crosscheck' or name a Python in"
            f" {variable}"
        )


@cache
def identified(number):
    """The values of a case, searched once for all tests."""
    return recovery.identified(recovery.CASES[number - 1])


QUICK = (3, 6)  # one of each simulator; the others are searched in all that is long


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            case,
            id=f"{case.number:04d}",
            marks=[] if case.number in QUICK else pytest.mark.long,
        )
        for case in recovery.CASES
    ],
)
def test_the_parameters_of_a_case_are_recovered(case):
    skip_without(case.simulator)
    errors = recovery.errors(case, identified(case.number))
    assert {name: error for name, error in errors.items() if not error <= case.within[name]} == {}


def test_cases_are_numbered_and_ask_for_what_their_loads_have():
    assert [case.number for case in recovery.CASES] == list(range(1, len(recovery.CASES) + 1))
    for case in recovery.CASES:
        assert {name for pair in case.within for name in pair.split(" / ")} <= set(case.truth), (
            case.number
        )


def test_a_truth_off_by_a_thousandth_is_not_recovered():
    (case,) = [case for case in recovery.CASES if case.simulator == "motulator"]
    skip_without("motulator")
    off = replace(case, truth={**case.truth, "M": 1.001 * case.truth["M"]})
    errors = recovery.errors(off, identified(case.number))
    assert [name for name, error in errors.items() if error > case.within[name]] == ["M"]


def test_our_motor_draws_what_motulators_machine_draws():
    """Against a machine that nobody here wrote, where a Python that has it is named
    (benchmarks/motulator_check.py).
    """
    skip_without("motulator")
    found = motulator_check.check()
    assert found["largest"] > 3.0
    assert found["difference"] < 1e-4
