"""The ways that the benchmark races against do the same work."""

import pytest

from tractexp.model.drive import Drive

pytest.importorskip(
    "numba", reason="rivals of the benchmark are compiled by Numba: pip install 'tractexp[race]'"
)


@pytest.fixture(scope="module")
def dip():
    """The benchmark's dip and candidates, and the base model's sums of squared errors of them."""
    import simulation

    drive, values = Drive.from_events([simulation.excitation()]), simulation.candidates(9)
    return simulation.excitation(), values, simulation.ours(simulation.base(), drive)(values)


@pytest.mark.parametrize("way", ["OneAtATime", "Vectorized"])
def test_the_rivals_of_the_benchmark_do_the_same_steps(dip, way):
    import rivals

    excitation, values, sums = dip
    assert getattr(rivals, way)(rivals.Record(excitation))(values) == pytest.approx(sums, rel=1e-11)


def test_the_rivals_with_a_tolerance_solve_the_same_equations(dip):
    import rivals

    excitation, values, sums = dip
    record = rivals.Record(excitation)
    assert rivals.SciPy(record, "LSODA", 1e-9)(values[:2]) == pytest.approx(sums[:2], rel=1e-6)
    P, Q = record.solution(values[0])
    assert ((P - excitation.P) ** 2 + (Q - excitation.Q) ** 2).sum() == pytest.approx(
        sums[0], rel=1e-6
    )


def test_the_operations_of_a_kernel_are_counted():
    import arithmetic
    import simulation

    from tractexp.kernel import target

    if "+avx512f" not in target.describe_processor()[1].split(","):
        pytest.skip("operations are counted where a vector of a kernel is one of the processor's")
    least = arithmetic.limit(simulation.base().source, 1, 3)
    # four slopes of three states, at least four operations each; two exponentials of at least ten
    assert 45 <= least.step.all <= 90
    assert 35 <= least.sample.all <= 70
    assert 0.01 < least.nanoseconds < 100
