"""Results of PSCAD that the tests write themselves, in the columns of EMTDC."""

import numpy as np
import pytest

import tractexp
from tractexp.errors import UserError
from tractexp.record.reader import find_reader

STEP, F = 1 / 4000, 50.0
T = np.arange(4800) * STEP
DEPTH = np.where((T >= 0.5) & (T < 0.7), 0.7, 1.0)
TURN = np.exp(1j * (2 * np.pi * F * T - 2 * np.pi / 3 * np.arange(3)[:, None]))


def inf(names):
    """The lines that name channels [(name, unit)]."""
    return "".join(
        f'PGB({k}) Output Desc="{name}" Group="Main" Max=2.0 Min=-2.0 Units="{unit}"\n'
        for k, (name, unit) in enumerate(names, 1)
    )


def write(folder, case, names, columns, each=10):
    """The files of a case: columns (K, N) in files of at most `each`."""
    (folder / f"{case}.inf").write_text(inf(names))
    paths = []
    for k in range(0, len(columns), each):
        paths.append(folder / f"{case}_{k // each + 1:02d}.out")
        rows = np.column_stack([T[: len(columns[0])], *columns[k : k + each]])
        np.savetxt(paths[-1], rows, fmt="%22.14E", header=" A test, of 3 channels", comments="")
    return paths


def powers():
    return [("Vrms", "kV"), ("P", "MW"), ("Q", "MVAR"), ("Speed", "")], [
        27.5 * DEPTH,
        12 * DEPTH**1.5,
        4 * DEPTH**2,
        np.ones(len(T)),
    ]


def test_powers_are_read_by_their_names_and_units(tmp_path):
    [path] = write(tmp_path, "load case", *powers())
    assert find_reader(str(path)).name == "csv"
    [event] = tractexp.read(str(path))
    assert (event.record.base.voltage, event.record.base.power) == pytest.approx(
        (27.5, np.hypot(12, 4))
    )
    assert pytest.approx((12 / np.hypot(12, 4), 4 / np.hypot(12, 4)), rel=1e-9) == (
        event.P0,
        event.Q0,
    )
    assert event.depth == pytest.approx(0.3)
    assert event.t_start == pytest.approx(0.5, abs=2 * STEP)


@pytest.mark.parametrize("each", [10, 4])
def test_waveforms_of_vectors_in_several_files_are_one_recording(tmp_path, each):
    volts, amperes = (
        15 * np.sqrt(2) * TURN.real * DEPTH,
        0.3 * np.sqrt(2) * (TURN * np.exp(-0.4j)).real * DEPTH,
    )
    names = [*((f"Vabc:{k}", "kV") for k in (1, 2, 3)), *((f"Iabc:{k}", "kA") for k in (1, 2, 3))]
    paths = write(tmp_path, "emt", names, [*volts, *amperes], each)
    assert len(paths) == (2 if each == 4 else 1)
    for path in paths:
        assert find_reader(str(path)).name == "waveforms"
        [event] = tractexp.read(str(path))
        assert event.record.base.voltage == pytest.approx(15 * np.sqrt(3), rel=1e-4)
        assert pytest.approx((np.cos(0.4), np.sin(0.4)), abs=1e-3) == (event.P0, event.Q0)


def test_a_file_without_its_names_is_refused_with_where_they_would_be(tmp_path):
    [path] = write(tmp_path, "case", *powers())
    (tmp_path / "case.inf").unlink()
    with pytest.raises(
        UserError, match=r"PSCAD writes them to case\.inf beside it, which is not there"
    ):
        tractexp.read(str(path))


def test_a_file_of_another_run_is_refused(tmp_path):
    names, columns = powers()
    write(tmp_path, "case", names, columns, each=2)
    (tmp_path / "case.inf").write_text(inf(names[:3]))
    with pytest.raises(UserError, match=r"names 3 channels, and the \.out files have 4"):
        tractexp.read(str(tmp_path / "case_01.out"))
    (tmp_path / "case.inf").write_text(inf(names))
    lines = (tmp_path / "case_02.out").read_text().splitlines()
    (tmp_path / "case_02.out").write_text("\n".join(lines[:-100]))
    with pytest.raises(UserError, match="have 4700 and 4800 rows: they are not of one run"):
        tractexp.read(str(tmp_path / "case_01.out"))


@pytest.mark.parametrize(
    "content",
    [b"", b"title\n", b"\0\1\2\3" * 50, b"title\n a b c\n", b"t\n 0 1 2 3 4\n 1e-3 1 x 3 4\n"],
)
def test_damaged_files_end_in_a_sentence(tmp_path, content):
    [path] = write(tmp_path, "case", *powers())
    path.write_bytes(content)
    with pytest.raises(UserError):
        tractexp.read(str(path))
