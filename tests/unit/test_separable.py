"""Columns that fall apart by event, `SeparableColumns`, against the same with every entry written
out.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from written_out import dense, dense_normal

from tractexp.inference.differences import compute_central_differences, compute_forward_differences
from tractexp.inference.least_squares import build_normal_matrix
from tractexp.inference.separable import (
    NOT_SEPARABLE,
    NormalMatrix,
    Sensitivities,
    SeparableColumns,
)

RNG = np.random.default_rng(7)
LENGTHS = (6, 9, 7)
K, M, E = 4, 2, len(LENGTHS)
PARTS = [slice(sum(LENGTHS[:e]), sum(LENGTHS[: e + 1])) for e in range(E)]
DRIVE = SimpleNamespace(measurements=np.zeros((2, sum(LENGTHS))), events=E, parts=PARTS)
APART = SeparableColumns.of_power(DRIVE, K)  # type: ignore[arg-type]
SIZE = DRIVE.measurements.size
J = Sensitivities(RNG.normal(size=(K + M, SIZE)), K, APART.rows)
CHANGES, ROWS = RNG.normal(size=(3, K + M * E)), RNG.normal(size=(3, SIZE))
DENSE = dense(J)


def test_the_powers_of_an_event_act_on_both_channels_of_it():
    assert APART.coordinates.tolist() == [[4, 5], [6, 7], [8, 9]]
    assert APART.rows[1].tolist() == [*range(6, 15), *range(28, 37)]
    assert SeparableColumns.of_power(DRIVE, None).count == 0  # type: ignore[arg-type]
    assert np.count_nonzero(DENSE) == SIZE * (K + M)


def test_one_simulation_moves_a_coordinate_of_every_event():
    moves = APART.moves(K + M * E)
    assert moves.shape == (K + M, K + M * E)
    assert np.flatnonzero(moves[K]).tolist() == [4, 6, 8]
    assert moves.sum(axis=0).tolist() == [1] * (K + M * E)


def test_changes_and_fits_are_those_of_every_entry():
    np.testing.assert_allclose(J.times(CHANGES), CHANGES @ DENSE.T, rtol=1e-12)
    np.testing.assert_allclose(J.fit(ROWS), np.linalg.lstsq(DENSE, ROWS.T)[0].T, rtol=1e-10)


def test_what_is_projected_out_is_that_of_every_entry():
    Q, _ = np.linalg.qr(DENSE)
    basis = J.basis()
    np.testing.assert_allclose(basis.project_out(ROWS), ROWS - (ROWS @ Q) @ Q.T, atol=1e-12)
    np.testing.assert_allclose(basis.energy(ROWS), ((ROWS @ Q) ** 2).sum(axis=1), rtol=1e-12)
    np.testing.assert_allclose(basis.leverage, (Q**2).sum(axis=1), rtol=1e-12)
    own, _ = np.linalg.qr(DENSE[:, K:])
    np.testing.assert_allclose(
        J.without_own, J.shared_columns - own @ (own.T @ J.shared_columns), atol=1e-12
    )


def test_coordinates_on_a_bound_take_nothing():
    """One parameter, P0 of the second event and both powers of the third rest."""
    free = np.ones(K + M * E, dtype=bool)
    free[[1, 6, 8, 9]] = False
    Q, _ = np.linalg.qr(DENSE[:, free])
    np.testing.assert_allclose(
        J.only(free).basis().project_out(ROWS), ROWS - (ROWS @ Q) @ Q.T, atol=1e-12
    )
    whole = np.zeros((len(ROWS), K + M * E))
    whole[:, free] = np.linalg.lstsq(DENSE[:, free], ROWS.T)[0].T
    np.testing.assert_allclose(J.only(free).fit(ROWS), np.delete(whole, 1, axis=1), atol=1e-10)


@pytest.mark.parametrize("differences", ["forward", "central"])
def test_differences_and_normal_equations_are_those_of_every_coordinate_by_itself(differences):
    central = differences == "central"
    unit, lanes = RNG.uniform(0.2, 0.8, (2, K + M * E)), np.arange(2)
    simulated = []

    def rows(x, lanes):
        simulated.append(len(x))
        return np.sin(x @ DENSE.T)

    base = rows(unit, lanes)
    alone, together = (
        build_normal_matrix(rows, unit, base, lanes, a, central=central)
        for a in (NOT_SEPARABLE, APART)
    )
    _, each, shared = simulated
    lanes_and_sides = 2 * (1 + central)
    assert each - shared == lanes_and_sides * M * (E - 1)
    np.testing.assert_allclose(together[0], alone[0], rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(
        dense_normal(together[1]), dense_normal(alone[1]), rtol=1e-7, atol=1e-7
    )
    np.testing.assert_allclose(
        together[1].diagonal, np.einsum("nkk->nk", dense_normal(together[1]))
    )


def test_a_step_solves_the_equations_of_every_entry_and_what_rests_stays():
    matrix = build_normal_matrix(lambda x, lanes: x @ DENSE.T, *_at(), APART)[1]
    kept = RNG.uniform(size=(2, K + M * E)) > 0.3
    side, added = RNG.normal(size=(2, K + M * E)) * kept, RNG.uniform(0.5, 1, (2, 3, K + M * E))
    solution = matrix.solve(side, kept, (added, ~kept[:, None] * 1.0))
    for lane in range(2):
        for q in range(3):
            H = dense_normal(matrix)[lane] * np.outer(kept[lane], kept[lane]) + np.diag(
                added[lane, q] + ~kept[lane]
            )
            np.testing.assert_allclose(
                solution[lane, q], np.linalg.solve(H, side[lane]), rtol=1e-9, atol=1e-12
            )
    assert (solution[~np.repeat(kept[:, None], 3, axis=1)] == 0).all()


def test_equations_without_events_are_solved_as_a_whole():
    """To the last bit: Eq. (8) has no coordinates of its events."""
    H, side = _positive(), RNG.normal(size=(1, K))
    diagonal = RNG.uniform(0.5, 1, (1, 1, K))
    empty = np.empty((1, 0, 0, K)), np.empty((1, 0, 0, 0))
    matrix = NormalMatrix(H[None], *empty, np.arange(K), NOT_SEPARABLE)
    solution = matrix.solve(side, np.ones((1, K), dtype=bool), (diagonal,))
    assert (solution[0, 0] == np.linalg.solve(H + np.diag(diagonal[0, 0]), side[0])).all()


def test_a_power_that_cannot_be_simulated_on_one_side_is_one_sided_in_its_event_alone():
    def rows(x, lanes):
        made = x @ DENSE.T
        made[np.ix_(x[:, 6] > 0.5, APART.rows[1])] = np.nan
        return made

    _, columns = compute_central_differences(
        rows, np.full((1, K + M * E), 0.5), np.zeros(1, dtype=int), APART
    )
    np.testing.assert_allclose(columns[0], J.columns, rtol=1e-5, atol=1e-8)
    ahead = compute_forward_differences(
        rows, np.full((1, K + M * E), 0.5), 0.5 * DENSE.sum(axis=1)[None], np.zeros(1), APART
    )
    lost = ahead[0][K] == 0
    assert lost.sum() == len(APART.rows[1])


def _at():
    unit = RNG.uniform(size=(2, K + M * E))
    return unit, unit @ DENSE.T, np.arange(2)


def _positive():
    A = RNG.normal(size=(9, K))
    return A.T @ A
