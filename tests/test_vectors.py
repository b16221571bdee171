"""The width of the kernels' vectors: measured once, the same in all processes, and the same bits with either."""

import subprocess
import sys

import numpy as np
import pytest

from tractexp import files
from tractexp.doors import numba_vector_width
from tractexp.model import kernel, vectors
from tractexp.model.drive import Drive, Excitation
from tractexp.model.model import compose
from tractexp.plugin import get

WITH, WITHOUT = ("any", "processor", "+avx2,+avx512f"), ("any", "processor", "+avx2,-avx512f")
PROCESS = """
import sys, time
from pathlib import Path
from tractexp.doors import numba_vector_width
from tractexp.model import vectors
numba_vector_width.compiled_for = lambda: ("any", "processor", "+avx512f")
def measured():
    time.sleep(0.3)
    return int(sys.argv[2])
vectors.faster = measured
print(vectors.width(Path(sys.argv[1])))
"""


@pytest.fixture
def machine(monkeypatch):
    """A machine with these features on which this width is found the faster; gives the list of measurements."""
    measured = []

    def be(features, faster=256):
        monkeypatch.setattr(numba_vector_width, "compiled_for", lambda: features)
        monkeypatch.setattr(vectors, "faster", lambda: measured.append(faster) or faster)
        vectors.width.cache_clear()  # as a new process would find it
        return measured

    yield be
    vectors.width.cache_clear()


def test_the_width_is_measured_once_and_remembered(machine, tmp_path):
    measured = machine(WITH, 512)
    assert vectors.width(tmp_path) == 512
    machine(WITH, 256)
    assert vectors.width(tmp_path) == 512
    assert measured == [512]
    machine(("any", "another processor", WITH[-1]), 256)
    assert vectors.width(tmp_path) == 256


@pytest.mark.parametrize("content", [b"", b"51", b"512", b"1024\n", b"\xff\xfe", b"512\n512\n"])
def test_a_damaged_choice_is_measured_again(machine, tmp_path, content):
    machine(WITH, 512)
    vectors.width(tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(content)
    measured = machine(WITH, 256)
    assert vectors.width(tmp_path) == 256
    assert measured == [512, 256]
    assert [p.read_text() for p in tmp_path.iterdir()] == ["256\n"]


def test_without_wide_vectors_there_is_nothing_to_measure(machine, tmp_path):
    measured = machine(WITHOUT)
    assert vectors.width(tmp_path) == 0
    assert not measured
    assert not list(tmp_path.iterdir())


def test_processes_that_measure_differently_agree(tmp_path):
    command = [sys.executable, "-c", PROCESS, str(tmp_path)]
    running = [subprocess.Popen([*command, bits], stdout=subprocess.PIPE, text=True) for bits in ("256", "512", "256")]
    told = [process.communicate(timeout=60)[0].strip() for process in running]
    assert set(told) <= {"256", "512"}
    assert len(set(told)) == 1
    assert [path.read_text() for path in tmp_path.iterdir()] == [f"{told[0]}\n"]


def test_a_file_system_without_links_keeps_the_first_choice_too(monkeypatch, tmp_path):
    def refused(*_):
        raise PermissionError

    monkeypatch.setattr(files.os, "link", refused)
    for bits in (512, 256):
        files.offer(tmp_path / "chosen", f"{bits}\n")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["512\n"]


def test_the_race_ends_with_one_of_the_widths():
    assert vectors.faster() in vectors.WIDTHS


@pytest.mark.parametrize(
    ("motor", "static"),
    [("electromechanical", "exponential"), ("double_cage", "exponential"), ("mechanical", "zip")],
)
def test_both_widths_give_the_same_bits(monkeypatch, motor, static):
    if "+avx512f" not in numba_vector_width.compiled_for()[-1].split(","):
        pytest.skip("this processor has no vectors of 512 bits")
    model = compose(get("model/motor", motor)(), get("model/static", static)())
    rng = np.random.default_rng(1)
    values = np.array([p.default for p in model.parameters]) * rng.uniform(0.9, 1.1, (70, len(model.names)))
    t = np.arange(300) * 2e-3
    U, P, Q = 1 - 0.4 * (abs(t - 0.3) < 0.1), np.ones(300), np.full(300, 0.6)
    P[40:60] = Q[100:300:7] = np.nan  # gaps
    drive = Drive.of([Excitation(2e-3, U, P, Q, 1.0, 1.0, 0.6), Excitation(2e-3, 1 - 0.2 * (U < 1), P, Q, 1, 0.9, 0.5)])
    found = []
    for bits in vectors.WIDTHS:
        monkeypatch.setattr(kernel, "width", lambda folder, bits=bits: bits)
        kernel.load.cache_clear()
        model.__dict__["kernel"] = kernel.load(model.source)
        assert bits == model.kernel.VECTORS
        response = model.simulate(drive, values, [1, 3])
        found.append((model.errors(drive, values, [1, 3]).sums, response.P, response.Q))
    kernel.load.cache_clear()
    assert (response.miss == 0).any()
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(*found, strict=True))
    assert np.isfinite(found[0][0]).any()


@pytest.fixture(scope="module")
def dip():
    """The benchmark's dip and candidates, and the base model's sums of squared errors of them."""
    import simulation

    drive, values = Drive.of([simulation.excitation()]), simulation.candidates(9)
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
    assert ((P - excitation.P) ** 2 + (Q - excitation.Q) ** 2).sum() == pytest.approx(sums[0], rel=1e-6)


def test_the_operations_of_a_kernel_are_counted():
    import arithmetic
    import simulation

    bits = vectors.width(kernel.cache_folder()) or 256
    if not {"+avx2", "+fma"} <= set(numba_vector_width.compiled_for()[-1].split(",")):
        pytest.skip("operations are counted in code for processors with AVX2")
    model = simulation.base(vectors.width(kernel.cache_folder()))
    model.errors(Drive.of([simulation.excitation()]), simulation.TRUTH)
    least = arithmetic.limit(model.kernel.run, 3, 1, bits, 3)
    # four slopes of three states, at least four operations each; two exponentials of at least ten
    assert 45 <= least.step.all <= 90
    assert 35 <= least.sample.all <= 70
    assert 0.01 < least.nanoseconds < 100
